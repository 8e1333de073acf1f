//! What a mesh is: closed, closed with faces that cross, or open; and a list of that by name.
//!
//! A line is `KIND FOLDER/FILE`. Meshes are judged after `repair` with its defaults, which fills no hole: a file of
//! loose triangles says nothing of either. The list is kept as a file, so that what a mesh counts as does not change
//! with the program that is being rated.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use meshmill::format::Format;
use meshmill::metric::Subject;
use meshmill::steps::repair::{RepairParams, repair};
use meshmill::watch::Watch;

use super::program::load;

/// What a mesh counts as, in the order of the tables.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Kind {
    /// Closed, and no face runs through another.
    Closed,
    /// Closed, with faces that run through or touch others.
    Crossing,
    /// It has a rim.
    Open,
}

const KINDS: [(Kind, &str); 3] = [(Kind::Closed, "closed"), (Kind::Crossing, "crossing"), (Kind::Open, "open")];

impl Kind {
    /// As the list has it.
    pub(super) fn name(self) -> &'static str {
        KINDS.iter().find(|(kind, _)| *kind == self).map_or("", |(_, name)| name)
    }

    /// What the mesh of this file is; `None` where it cannot be read or repaired.
    pub(super) fn of(path: &Path) -> Option<Self> {
        let watch = Watch::silent();
        let surface = repair(&load(path)?, &RepairParams::default(), &watch).ok()?.0.to_soup();
        let subject = Subject::new(&surface, None, &watch);
        Some(match subject.topology().is_closed() {
            false => Self::Open,
            true if subject.intersections().pairs.is_empty() => Self::Closed,
            true => Self::Crossing,
        })
    }
}

/// The kinds that a list tells, by name.
pub(super) fn read(path: &Path) -> BTreeMap<String, Kind> {
    let text = fs::read_to_string(path).unwrap_or_default();
    let line = |line: &str| {
        let (kind, name) = line.split_once(' ')?;
        Some((name.trim().to_owned(), KINDS.iter().find(|(_, known)| *known == kind)?.0))
    };
    text.lines().filter_map(line).collect()
}

/// Every file of a folder whose ending is one of a mesh, by name.
pub(super) fn meshes(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path());
    let is_mesh = |path: &PathBuf| Format::from_file_name(&path.to_string_lossy()).is_some();
    let mut files: Vec<PathBuf> = entries.filter(|path| path.is_file() && is_mesh(path)).collect();
    files.sort();
    files
}

/// `FOLDER/FILE`.
pub(super) fn name(path: &Path) -> String {
    let folder = path.parent().and_then(Path::file_name).unwrap_or_default().to_string_lossy();
    format!("{folder}/{}", path.file_name().unwrap_or_default().to_string_lossy())
}

/// Prints the list; whether there is something on it.
pub(super) fn list(folders: &[PathBuf]) -> bool {
    let files: Vec<PathBuf> = folders.iter().flat_map(|folder| meshes(folder)).collect();
    for file in &files {
        match Kind::of(file) {
            Some(kind) => println!("{} {}", kind.name(), name(file)),
            None => eprintln!("{} cannot be made a surface", name(file)),
        }
    }
    !files.is_empty()
}
