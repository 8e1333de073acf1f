//! Meshes that the project does not ship: files of the folder that `MESHMILL_CORPUS` names, and a visible skip without.

use std::path::{Path, PathBuf};

/// The file or folder `name` of the corpus; `None`, said so, where there is no corpus.
pub(crate) fn corpus(name: &str) -> Option<PathBuf> {
    let Some(folder) = std::env::var_os("MESHMILL_CORPUS") else {
        eprintln!("skipped {name}: MESHMILL_CORPUS names no folder of meshes");
        return None;
    };
    Some(Path::new(&folder).join(name))
}
