//! Meshes of a folder beside the project, for benches of real parts.

use meshmill::format::{Format, read};
use meshmill::mesh::Surface;
use meshmill::steps::repair::{RepairParams, repair};
use meshmill::watch::Watch;
use std::path::Path;

/// A repaired mesh of the folder that `MESHMILL_CORPUS` names; `None` where there is none.
pub(crate) fn from_corpus(file: &str) -> Option<Surface> {
    let path = Path::new(&std::env::var_os("MESHMILL_CORPUS")?).join(file);
    let bytes = std::fs::read(path).ok()?;
    let watch = Watch::silent();
    let (soup, _) = read(Format::Stl, &bytes, &watch).ok()?;
    Some(repair(&soup, &RepairParams::default(), &watch).ok()?.0)
}
