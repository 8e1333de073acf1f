//! Files that a run reads, with those that they include: one content, one hash, and a list of all files behind it.
//!
//! A deck with includes counts as the deck with their lines in place, so that a change of any of them is a change of
//! the input. A file is included by its name relative to the deck's folder, else relative to the folder of the included
//! file that names it, and only from below the deck's folder: no path and no link leads out. All included files
//! together have at most [`MOST_BYTES`].

use std::collections::BTreeSet;
use std::io;
use std::path::{Path, PathBuf};

use crate::format::include::{Opened, expand};
use crate::format::{Format, FormatError};
use crate::plan::{ContentHash, Plan, Task};
use crate::step::StepFailure;
use crate::store::StatIndex;

/// The files that a deck includes may have so many bytes together, each counted as often as it is included.
pub const MOST_BYTES: u64 = 1 << 30;

/// A file with all that it includes.
#[derive(Debug)]
pub struct Source {
    /// Its bytes, with those of included files in place.
    pub bytes: Vec<u8>,
    /// The included files by their names.
    pub included: Vec<PathBuf>,
}

/// Why a file cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum SourceError {
    /// The system says so.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// It includes something that cannot be read.
    #[error(transparent)]
    Include(#[from] FormatError),
}

/// Reads a file with all that it includes.
///
/// # Errors
/// Where it or a file that it includes cannot be read.
pub fn read(path: &Path) -> Result<Source, SourceError> {
    let bytes = std::fs::read(path)?;
    let mut folder = Folder::of(path);
    let expanded = folder.expand(path, &bytes)?;
    Ok(Source { bytes: expanded.unwrap_or(bytes), included: folder.included.into_iter().collect() })
}

/// All files that a plan reads, included ones as well, as far as they are there.
pub fn files(plan: &Plan) -> Vec<PathBuf> {
    let mut files = Vec::new();
    for id in plan.order() {
        if let Task::Source(source) = &plan.node(id).task {
            files.push(source.path.clone());
            if may_include(&source.path)
                && let Ok(bytes) = std::fs::read(&source.path)
            {
                let mut folder = Folder::of(&source.path);
                // What cannot be read is in the list too: it may be there later.
                let _ = folder.expand(&source.path, &bytes);
                files.extend(folder.included);
            }
        }
    }
    files
}

/// The bytes of a source and the hash of its content.
pub(super) fn bytes(index: &StatIndex, path: &Path) -> Result<(Vec<u8>, ContentHash), StepFailure> {
    let (bytes, hash) = index.read(path).map_err(|error| unreadable(path, &error))?;
    match Folder::of(path).expand(path, &bytes).map_err(|error| not_included(path, &error))? {
        None => Ok((bytes, hash)),
        Some(expanded) => {
            let hash = blake3::hash(&expanded);
            Ok((expanded, hash))
        }
    }
}

/// The hash of a source's content; of a file that can include nothing, from the index where it is unchanged.
pub(super) fn hash(index: &StatIndex, path: &Path) -> Result<ContentHash, StepFailure> {
    if may_include(path) {
        return bytes(index, path).map(|(_, hash)| hash);
    }
    index.hash(path).map_err(|error| unreadable(path, &error))
}

fn unreadable(path: &Path, error: &io::Error) -> StepFailure {
    StepFailure::bad_input(format!("cannot read {}: {error}", path.display()))
}

fn not_included(path: &Path, error: &FormatError) -> StepFailure {
    let failure = StepFailure::bad_input(format!("cannot read {}: {error}", path.display()));
    match &error.remedy {
        Some(remedy) => failure.with_help(remedy.clone()),
        None => failure,
    }
}

fn format_of(path: &Path) -> Option<Format> {
    Format::from_file_name(&path.file_name()?.to_string_lossy()).filter(|format| format.has_includes())
}

/// Whether a file may include others, as its ending tells.
fn may_include(path: &Path) -> bool {
    format_of(path).is_some()
}

/// The folder of a deck, from which files are included.
struct Folder {
    path: PathBuf,
    included: BTreeSet<PathBuf>,
    /// How many bytes may still be included.
    left: u64,
}

impl Folder {
    fn of(deck: &Path) -> Self {
        let folder = deck.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        Self { path: folder.to_path_buf(), included: BTreeSet::new(), left: MOST_BYTES }
    }

    fn expand(&mut self, deck: &Path, bytes: &[u8]) -> Result<Option<Vec<u8>>, FormatError> {
        let Some(format) = format_of(deck) else { return Ok(None) };
        expand(format, bytes, &mut |name, within| self.open(name, within))
    }

    /// Opens a file by the name in the deck, or in an included file.
    fn open(&mut self, name: &str, within: Option<&Path>) -> Result<Opened, String> {
        // Decks from Windows.
        let name = name.replace('\\', "/");
        let mut path = self.path.join(&name);
        self.included.insert(path.clone());
        if let Some(folder) = within.and_then(Path::parent)
            && !path.exists()
            && folder.join(&name).exists()
        {
            path = folder.join(&name);
            self.included.insert(path.clone());
        }
        let system = |error: io::Error| match error.kind() {
            io::ErrorKind::NotFound => format!("there is no such file in {}", self.path.display()),
            _ => error.to_string(),
        };
        let whole = path.canonicalize().map_err(system)?;
        if !whole.starts_with(self.path.canonicalize().map_err(system)?) {
            return Err(format!("it lies outside of {}, the folder of the deck", self.path.display()));
        }
        let meta = std::fs::metadata(&whole).map_err(system)?;
        if !meta.is_file() {
            return Err("it is not a file".to_owned());
        }
        let more = || format!("the included files have more than {} MiB together", MOST_BYTES >> 20);
        self.left = self.left.checked_sub(meta.len()).ok_or_else(more)?;
        let bytes = std::fs::read(&whole).map_err(system)?;
        Ok((whole, bytes))
    }
}
