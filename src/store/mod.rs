//! The content-addressed store: results by key, artifacts by content, shared by many processes and machines.
//!
//! ```text
//! ROOT/CACHEDIR.TAG           tells backup programs to skip the folder, and `clear` that it is ours
//! ROOT/v2/ac/ab/abcd...       entry: what the task of this key gave, by content hash; published last
//! ROOT/v2/cas/ef/efgh...      blob: a packed artifact under its content hash
//! ROOT/v2/names/..            key of the newest result of a task name, for explanations only
//! ROOT/v2/stat/HOST           content hashes of files by their stat, one small file a machine
//! ROOT/v2/stat/HOST-run-..    stamps of whole runs
//! ROOT/v2/tmp/..              files being written
//! ```
//!
//! # Invariants
//! - A file appears under its final name only whole: it is written in `tmp`, on the same file system, and renamed.
//! - There is no lock. Whoever dies at any moment leaves at most a file in `tmp`, which the next one removes.
//! - An entry is published after its blob. A missing or damaged blob or entry is a miss, never a wrong result:
//!   entries, names and indices are sealed with the name they have, blobs are hashed when they are loaded.
//! - Only plain files count. A link, folder or pipe in a file's place is a miss and is replaced, never followed.
//! - Two writers of one key write the same content, because steps are pure; the last rename wins and nothing changes.
//!
//! Nothing is flushed to the disk by `fsync`: after a power cut a file may be empty or cut short, which the checks
//! above find, and the result is computed again.

pub mod clean;
pub mod codec;
mod columns;
pub mod entry;
pub mod leftover;
mod pack;
mod seal;
pub mod stamp;
pub mod stat_index;

use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use blake3::Hash;
use tracing::warn;

pub use clean::{CleanReport, GcLimits, StoreStat};
pub use codec::{CODEC_VERSION, CodecError};
pub use entry::{Entry, Figures, Outcome, Peak};
pub use seal::SealError;
pub use stat_index::StatIndex;

use crate::step::Artifact;

/// Folder of the layout above.
const LAYOUT: &str = "v2";
/// Folders of earlier layouts, which other versions of the program may still use; `clear` removes them.
const EARLIER: [&str; 1] = ["v1"];
/// Marks a cache folder, see <https://bford.info/cachedir/>.
const TAG_FILE: &str = "CACHEDIR.TAG";
const TAG_TEXT: &str = "Signature: 8a477f597d28d172789f06886806bc55\n# Results cached by meshmill.\n";
/// A hit refreshes an entry's time only when it is older, so that a hit costs no write as a rule.
const REFRESH_AFTER: Duration = Duration::from_hours(24);

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
    #[error("{} is not a cache of meshmill: it has no {TAG_FILE}", .0.display())]
    NotACache(PathBuf),
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

/// A store in a folder. Cloning shares nothing but the path.
#[derive(Clone, Debug)]
pub struct Store {
    root: PathBuf,
}

impl Store {
    /// Opens the store in this folder and creates what is missing.
    pub fn open(root: &Path) -> Result<Self, StoreError> {
        let store = Self { root: root.to_path_buf() };
        for folder in ["ac", "cas", "names", "stat", "tmp"] {
            let path = store.folder(folder);
            if !path.is_dir() {
                fs::create_dir_all(&path).map_err(StoreError::io("create the cache folder", &path))?;
            }
        }
        leftover::remove_leftovers(&store.folder("tmp"));
        let tag = root.join(TAG_FILE);
        if fs::symlink_metadata(&tag).is_err() {
            store.write_whole(&tag, TAG_TEXT.as_bytes())?;
        }
        Ok(store)
    }

    /// Whether a folder is a store.
    pub fn is_at(root: &Path) -> bool {
        root.join(LAYOUT).is_dir()
    }

    /// The folder of this store.
    pub fn root(&self) -> &Path {
        &self.root
    }

    fn folder(&self, name: &str) -> PathBuf {
        self.root.join(LAYOUT).join(name)
    }

    fn place(&self, folder: &str, hash: &Hash) -> PathBuf {
        let hex = hash.to_hex();
        self.folder(folder).join(&hex[..2]).join(hex.as_str())
    }

    /// What the task of this key gave, where that is known. A damaged entry is a miss, and said so.
    pub fn entry(&self, key: &Hash) -> Option<Entry> {
        let path = self.place("ac", key);
        let bytes = match seal::read(&path) {
            Ok(bytes) => bytes,
            Err(error) => {
                if error.kind() != io::ErrorKind::NotFound {
                    warn!(path = %path.display(), %error, "a cache entry cannot be read; it is computed again");
                }
                return None;
            }
        };
        match Entry::decode(key, &bytes) {
            Ok(entry) => {
                refresh(&path);
                Some(entry)
            }
            Err(error) => {
                warn!(path = %path.display(), %error, "a cache entry is damaged; it is computed again");
                None
            }
        }
    }

    /// Publishes what the task of this key gave. Save its artifact first.
    pub fn publish(&self, key: &Hash, entry: &Entry) -> Result<(), StoreError> {
        self.write_whole(&self.place("ac", key), &entry.encode(key))?;
        let name = name_hash(&entry.task);
        self.write_whole(&self.place("names", &name), &seal::seal(name.as_bytes(), key.to_hex().as_bytes()))
    }

    /// The newest result of a task of this name, whatever its key.
    pub fn newest(&self, task: &str) -> Option<(Hash, Entry)> {
        let name = name_hash(task);
        let bytes = seal::read(&self.place("names", &name)).ok()?;
        let key = Hash::from_hex(seal::open(name.as_bytes(), &bytes).ok()?).ok()?;
        Some((key, Entry::decode(&key, &seal::read(&self.place("ac", &key)).ok()?).ok()?))
    }

    /// Saves an artifact under its content hash. Content that is there already is not written again.
    ///
    /// What it is called is known although it could not be written: the work that made it is not lost with the disk.
    pub fn save(&self, artifact: &Artifact) -> (Saved, Result<(), StoreError>) {
        let canonical = codec::encode(artifact);
        let content = codec::content_hash(&canonical);
        (Saved { content, bytes: canonical.len() as u64 }, self.write_blob(&content, &canonical))
    }

    fn write_blob(&self, content: &Hash, canonical: &[u8]) -> Result<(), StoreError> {
        let path = self.place("cas", content);
        if seal::is_plain(&path) {
            refresh(&path);
            return Ok(());
        }
        self.write_whole(&path, &pack::pack(canonical)?)
    }

    /// The artifact of this content. A missing or damaged blob is a miss; a damaged one is said so and removed.
    pub fn load(&self, content: &Hash) -> Option<Artifact> {
        let path = self.place("cas", content);
        let bytes = match seal::read(&path) {
            Ok(bytes) => bytes,
            Err(error) => {
                warn!(path = %path.display(), %error, "a cached artifact cannot be read; it is computed again");
                return None;
            }
        };
        match verified(&bytes, content) {
            Ok(canonical) => match codec::decode(&canonical) {
                Ok(artifact) => Some(artifact),
                Err(error) => {
                    warn!(path = %path.display(), %error, "a cached artifact does not decode; it is computed again");
                    None
                }
            },
            Err(error) => {
                warn!(path = %path.display(), %error, "a cached artifact is damaged; it is computed again");
                // Without removal, saving the same content again would find the damaged file and leave it.
                let _ = fs::remove_file(&path);
                None
            }
        }
    }

    /// Writes `bytes` aside and renames them to `path`: a link or pipe there is replaced, never written through, and a
    /// folder is moved aside.
    fn write_whole(&self, path: &Path, bytes: &[u8]) -> Result<(), StoreError> {
        let tmp = self.folder("tmp");
        let write = || -> io::Result<()> {
            if let Some(parent) = path.parent() {
                if parent.is_symlink() {
                    fs::remove_file(parent)?;
                }
                fs::create_dir_all(parent)?;
            }
            if fs::symlink_metadata(path).is_ok_and(|meta| meta.is_dir()) {
                self.move_aside(path)?;
            }
            leftover::write_by_rename(&tmp, path, bytes)
        };
        write().map_err(StoreError::io("write", path))
    }

    /// Moves a folder that is in a file's place out of the way; `gc` removes it.
    fn move_aside(&self, path: &Path) -> io::Result<()> {
        let aside = tempfile::Builder::new().prefix("folder").tempdir_in(self.folder("tmp"))?.keep();
        fs::rename(path, aside.join("was"))
    }
}

/// The canonical bytes of a blob file, when they have the hash that its name promises.
fn verified(file: &[u8], content: &Hash) -> Result<Vec<u8>, CodecError> {
    let canonical = pack::unpack(file)?;
    if codec::content_hash(&canonical) == *content {
        Ok(canonical)
    } else {
        Err(CodecError::Malformed("the content differs from its hash"))
    }
}

fn name_hash(task: &str) -> Hash {
    blake3::hash(task.as_bytes())
}

/// Marks a file as used today. Failing to do so only makes it an earlier candidate of `gc`.
fn refresh(path: &Path) {
    let Ok(modified) = fs::metadata(path).and_then(|meta| meta.modified()) else { return };
    let now = SystemTime::now();
    if now.duration_since(modified).is_ok_and(|age| age > REFRESH_AFTER)
        && let Ok(file) = fs::File::options().append(true).open(path)
    {
        let _ = file.set_modified(now);
    }
}

#[cfg(test)]
mod tests;
