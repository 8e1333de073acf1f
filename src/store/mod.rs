//! The content-addressed store: results by key, artifacts by content, shared by many processes and machines.
//!
//! A store is a list of levels: a folder of this machine first, then folders that many share. What is looked for is
//! looked for level by level; what a later level has is verified and copied into the earlier ones. What is made is
//! written to all levels that take it. In each of them lies:
//!
//! ```text
//! ROOT/CACHEDIR.TAG           tells backup programs to skip the folder, and `clear` that it is ours
//! ROOT/v2/ac/ab/abcd...       entry: what the task of this key gave, by content hash; published last
//! ROOT/v2/cas/ef/efgh...      blob: a packed artifact under its content hash
//! ROOT/v2/pins/..             keys that a lock needs, which are not collected
//! ROOT/v2/names/..            key of the newest result of a task name, for explanations only; first level
//! ROOT/v2/stat/HOST           content hashes of files by their stat, one small file a machine; first level
//! ROOT/v2/stat/HOST-run-..    stamps of whole runs; first level
//! ROOT/v2/tmp/..              files being written
//! ```
//!
//! # Invariants
//! - Nothing that is read is believed: entries, names and indices are sealed with the name they have, blobs are hashed
//!   when they are loaded, on every level. A missing or damaged blob or entry is a miss, never a wrong result.
//! - An entry is published after its blob, in every level.
//! - Two writers of one key write the same content, because steps are pure; the last rename wins and nothing changes.
//! - A level in trouble is said once and passed over (`level`); only where no level takes a file is it an error.
//! - What a folder promises by itself is said in `folder`.
//!
//! Nothing is flushed to the disk by `fsync`: after a power cut a file may be empty or cut short, which the checks
//! above find, and the result is computed again. Whoever may write to a shared level is trusted to run the same
//! program: checksums find damage, not malice.

pub mod clean;
pub mod codec;
mod columns;
pub mod entry;
mod folder;
pub mod leftover;
mod level;
mod pack;
mod pin;
mod place;
#[cfg(feature = "remote")]
mod remote;
mod seal;
pub mod stamp;
pub mod stat_index;
mod transfer;

use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use blake3::Hash;
use tracing::warn;

use folder::Folder;
use level::{Flaw, Level};
use place::{Kind, Place};

pub use clean::{CleanReport, GcLimits, StoreStat};
pub use codec::{CODEC_VERSION, CodecError};
pub use entry::{Entry, Figures, Outcome, Peak};
pub use level::{LevelSpec, Location};
pub use pin::Pin;
pub use place::RemoteSpec;
pub use seal::SealError;
pub use stat_index::{StatIndex, host};
pub use transfer::CopyReport;

use crate::step::Artifact;

/// Why the store could not do its work. Misses and damaged files are not errors.
#[derive(Debug, thiserror::Error)]
pub enum StoreError {
    /// The disk or folder refused.
    #[error("cannot {action} {}: {source}", path.display())]
    Io {
        /// What was tried.
        action: &'static str,
        /// Where.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// `clear` was asked of a folder that is not a cache.
    #[error("{} is not a cache of meshmill: it has no {}", .0.display(), folder::TAG_FILE)]
    NotACache(PathBuf),
    /// A level cannot be used.
    #[error("the level {level} of the cache: {reason}")]
    Level {
        /// Which one.
        level: String,
        /// Why.
        reason: String,
    },
    /// An artifact could not be packed; a fault of the program.
    #[error("cannot pack an artifact: {0}")]
    Pack(#[from] CodecError),
}

impl StoreError {
    fn io(action: &'static str, path: &Path) -> impl FnOnce(io::Error) -> Self {
        move |source| Self::Io { action, path: path.to_path_buf(), source }
    }
}

/// An artifact that was saved.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Saved {
    /// Hash of its canonical bytes.
    pub content: Hash,
    /// Length of its canonical bytes.
    pub bytes: u64,
}

/// A store of one or more levels. Clones share them, and what has become of them.
#[derive(Clone, Debug)]
pub struct Store {
    levels: Arc<[Level]>,
    /// The folder for what concerns this machine alone: stamps, the index of files, names.
    home: Folder,
}

impl Store {
    /// Opens the store in this folder and creates what is missing.
    pub fn open(root: &Path) -> Result<Self, StoreError> {
        Self::with_levels(&[LevelSpec::folder(root)])
    }

    /// Opens a store of these levels. The first is a folder, which is made where it is not there; later ones are opened
    /// when something is looked for in them.
    ///
    /// # Errors
    /// Where no level is a folder that can be written.
    pub fn with_levels(specs: &[LevelSpec]) -> Result<Self, StoreError> {
        let levels: Vec<Level> =
            specs.iter().enumerate().map(|(number, spec)| Level::new(spec.clone(), number == 0)).collect();
        let home = home(&levels)?;
        Ok(Self { levels: levels.into(), home })
    }

    /// Whether a folder is a store.
    pub fn is_at(root: &Path) -> bool {
        Folder::is_at(root)
    }

    /// The folder of this machine's files: as a rule the first level.
    pub fn root(&self) -> &Path {
        self.home.root()
    }

    /// A file of a level that opens, and its bytes go into the levels before it.
    fn find<T>(&self, kind: Kind, hash: &Hash, open: impl Fn(&[u8]) -> Result<T, Flaw>) -> Option<T> {
        for (number, level) in self.levels.iter().enumerate() {
            let Some(bytes) = level.read(kind, hash) else { continue };
            match open(&bytes) {
                Ok(found) => {
                    if let (Kind::Entry, false, Some(place)) = (kind, level.spec().read_only, level.place()) {
                        place.refresh(kind, hash, &bytes);
                    }
                    for earlier in self.levels[..number].iter().filter(|level| level.is_writable()) {
                        if let Err(error) = earlier.write(kind, hash, &bytes) {
                            earlier.refuse(&error);
                        }
                    }
                    return Some(found);
                }
                Err(flaw) => level.distrust(kind, hash, &flaw),
            }
        }
        None
    }

    /// Puts a file into every level that takes it. An error where none does.
    fn put(&self, kind: Kind, hash: &Hash, bytes: &[u8]) -> Result<(), StoreError> {
        let (mut taken, mut first) = (false, None);
        for level in self.levels.iter() {
            // Content is determined by its name, so what is there and as long need not be written.
            if kind == Kind::Blob && level.has(kind, hash, bytes.len()) {
                taken = true;
                continue;
            }
            match level.write(kind, hash, bytes) {
                Ok(()) => taken = true,
                Err(error) => {
                    // Only where there is another level is one given up: a lone one may take the next, smaller file.
                    if self.levels.len() > 1 {
                        level.refuse(&error);
                    }
                    first.get_or_insert(error);
                }
            }
        }
        if taken { Ok(()) } else { first.map_or(Ok(()), Err) }
    }

    /// What the task of this key gave, where that is known. A damaged entry is a miss, and said so.
    pub fn entry(&self, key: &Hash) -> Option<Entry> {
        self.find(Kind::Entry, key, |bytes| Entry::decode(key, bytes).map_err(|error| error.flaw()))
    }

    /// Publishes what the task of this key gave. Save its artifact first.
    pub fn publish(&self, key: &Hash, entry: &Entry) -> Result<(), StoreError> {
        self.put(Kind::Entry, key, &entry.encode(key))?;
        let name = name_hash(&entry.task);
        let newest = seal::seal(name.as_bytes(), key.to_hex().as_bytes());
        // Names serve explanations alone; where the first level is in trouble, that has been said.
        let written = self.home.write(Kind::Name, &name, &newest);
        if self.levels.len() > 1 { Ok(()) } else { written }
    }

    /// The newest result of a task of this name, whatever its key.
    pub fn newest(&self, task: &str) -> Option<(Hash, Entry)> {
        let name = name_hash(task);
        let bytes = self.home.read(Kind::Name, &name).ok()??;
        let key = Hash::from_hex(seal::open(name.as_bytes(), &bytes).ok()?).ok()?;
        Some((key, self.entry(&key)?))
    }

    /// Saves an artifact under its content hash. Content that is there already, and as long, is not written again.
    ///
    /// What it is called is known although it could not be written: the work that made it is not lost with the disk.
    pub fn save(&self, artifact: &Artifact) -> (Saved, Result<(), StoreError>) {
        let canonical = codec::encode(artifact);
        let content = codec::content_hash(&canonical);
        let packed = pack::pack(&canonical).map_err(StoreError::from);
        let written = packed.and_then(|packed| self.put(Kind::Blob, &content, &packed));
        (Saved { content, bytes: canonical.len() as u64 }, written)
    }

    /// The artifact of this content. A missing or damaged blob is a miss; a damaged one is said so and removed.
    pub fn load(&self, content: &Hash) -> Option<Artifact> {
        let found = self.find(Kind::Blob, content, |bytes| {
            let canonical = verified(bytes, content)?;
            codec::decode(&canonical).map_err(|error| Flaw::Foreign(error.to_string()))
        });
        if found.is_none() {
            warn!("an artifact is not in the cache any more and is computed again: {}", content.to_hex());
        }
        found
    }
}

/// The folder for what concerns this machine alone: the first level, or else the first later one that can be written.
fn home(levels: &[Level]) -> Result<Folder, StoreError> {
    let mut first = None;
    for (number, level) in levels.iter().enumerate() {
        let opened = level.open().and_then(|place| match Folder::of(place) {
            Some(_) if number > 0 && level.refusal().is_some() => Ok(None),
            Some(folder) if number > 0 => folder.probe().map(|()| Some(folder.clone())),
            folder => Ok(folder.cloned()),
        });
        match opened {
            Ok(Some(folder)) => return Ok(folder),
            Ok(None) => {}
            Err(error) => {
                if levels.len() > 1 {
                    level.lose(&error);
                }
                first.get_or_insert(error);
            }
        }
    }
    let none = || StoreError::Level { level: "first".into(), reason: "it must be a folder that can be written".into() };
    Err(first.unwrap_or_else(none))
}

/// The canonical bytes of a blob file, when they have the hash that its name promises.
fn verified(file: &[u8], content: &Hash) -> Result<Vec<u8>, Flaw> {
    let flaw = |error: CodecError| {
        let why = error.to_string();
        if pack::is_foreign(file) { Flaw::Foreign(why) } else { Flaw::Damaged(why) }
    };
    let canonical = pack::unpack(file).map_err(flaw)?;
    if codec::content_hash(&canonical) == *content {
        Ok(canonical)
    } else {
        Err(Flaw::Damaged("the content differs from its hash".to_owned()))
    }
}

fn name_hash(task: &str) -> Hash {
    blake3::hash(task.as_bytes())
}

#[cfg(test)]
mod tests;
