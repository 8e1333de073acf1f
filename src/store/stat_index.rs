//! Content hashes of files by their stat, so that an unchanged file is not hashed twice.
//!
//! A hash is trusted while path, size, times of modification and change (in nanoseconds), device and inode are the
//! same. Links are followed for the stat and not for the path: to tell where each of ten thousand files really lies
//! costs more than its stat, and a link that now leads elsewhere leads to another inode. As in Git's index, a file that
//! was modified within two seconds before it was hashed is not trusted: it may have changed again within the resolution
//! of the file system's clock. One small file a machine, replaced atomically; of two processes that write at once one
//! loses its additions, which costs a hashing later and nothing else.

use std::collections::BTreeMap;
use std::fs;
use std::io::{self, Read};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, OnceLock};
use std::time::{Duration, SystemTime};

use blake3::Hash;
use serde::{Deserialize, Serialize};

use super::{Store, seal};

/// Modified less than this before hashing: not trusted.
const RACY: Duration = Duration::from_secs(2);
/// Changed less than this before hashing, as a copy with an old time of modification is: not trusted either.
const TICK: Duration = Duration::from_millis(20);
/// The index forgets the longest unused files beyond this number.
const MAX_FILES: usize = 10_000;

/// What says that a file is unchanged.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Stat {
    size: u64,
    /// Nanoseconds since 1970.
    modified: u64,
    /// The same of the last change of content, name or owner, which no program can set: a copy with an old time of
    /// modification is told by it.
    #[serde(default)]
    changed: u64,
    #[serde(default)]
    device: u64,
    inode: u64,
}

impl Stat {
    /// The same file with the same content, though perhaps by another name.
    pub(super) fn is_renamed(self, other: Self) -> bool {
        Self { changed: 0, ..self } == Self { changed: 0, ..other }
    }

    /// Time since the last change of content or name.
    pub(super) fn age(self, now: SystemTime) -> Duration {
        let now = now.duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
        now.saturating_sub(Duration::from_nanos(self.modified.max(self.changed)))
    }

    /// Whether its file system tells fractions of a second.
    pub(super) fn has_fractions(self) -> bool {
        !(self.modified.is_multiple_of(1_000_000_000) && self.changed.is_multiple_of(1_000_000_000))
    }
}

#[derive(Clone, Debug, Serialize, Deserialize)]
struct Known {
    stat: Stat,
    hash: String,
    /// Seconds since 1970 of the last use, to the day.
    used: u64,
}

/// The index of this machine.
#[derive(Debug)]
pub struct StatIndex {
    file: PathBuf,
    state: Mutex<State>,
}

#[derive(Debug, Default)]
struct State {
    known: BTreeMap<PathBuf, Known>,
    changed: bool,
}

impl StatIndex {
    /// Reads the index of this machine; a missing or damaged one is empty.
    pub fn open(store: &Store) -> Self {
        let file = store.home.folder("stat").join(host());
        let known = known_files(&file);
        Self { file, state: Mutex::new(State { known, changed: false }) }
    }

    /// The BLAKE3 hash of the file's bytes, from the index where its stat is unchanged.
    pub fn hash(&self, path: &Path) -> io::Result<Hash> {
        let path = place(path)?;
        let stat = stat(&fs::metadata(&path)?);
        if let Some(hash) = self.lookup(&path, stat) {
            return Ok(hash);
        }
        let mut hasher = blake3::Hasher::new();
        let mut file = fs::File::open(&path)?;
        let mut buffer = vec![0; 1 << 18];
        loop {
            match file.read(&mut buffer)? {
                0 => break,
                count => hasher.update(&buffer[..count]),
            };
        }
        let hash = hasher.finalize();
        self.remember(path, stat, hash)?;
        Ok(hash)
    }

    /// The file's bytes and their hash; hashed always, since the bytes are what a step will see.
    pub fn read(&self, path: &Path) -> io::Result<(Vec<u8>, Hash)> {
        let path = place(path)?;
        let stat = stat(&fs::metadata(&path)?);
        let bytes = fs::read(&path)?;
        let hash = blake3::hash(&bytes);
        self.remember(path, stat, hash)?;
        Ok((bytes, hash))
    }

    fn lookup(&self, path: &Path, stat: Stat) -> Option<Hash> {
        let mut state = self.state.lock().ok()?;
        let known = state.known.get_mut(path).filter(|known| known.stat == stat)?;
        let hash = Hash::from_hex(&known.hash).ok()?;
        let today = today();
        if known.used != today {
            known.used = today;
            state.changed = true;
        }
        Some(hash)
    }

    fn remember(&self, path: PathBuf, before: Stat, hash: Hash) -> io::Result<()> {
        let now = SystemTime::now();
        let meta = fs::metadata(&path)?;
        // A time in the future comes from another clock, which says nothing about when the file last changed.
        let settled = meta.modified().ok().and_then(|time| now.duration_since(time).ok()).is_some_and(|age| age > RACY);
        if settled
            && before.age(now) > TICK
            && stat(&meta) == before
            && let Ok(mut state) = self.state.lock()
        {
            state.known.insert(path, Known { stat: before, hash: hash.to_hex().to_string(), used: today() });
            state.changed = true;
        }
        Ok(())
    }

    /// Writes the index back where something is new. Failing to do so costs a hashing later and nothing else.
    pub fn flush(&self, store: &Store) {
        let Ok(mut state) = self.state.lock() else { return };
        if !state.changed {
            return;
        }
        let mut merged = known_files(&self.file);
        merged.extend(state.known.iter().map(|(path, known)| (path.clone(), known.clone())));
        if merged.len() > MAX_FILES {
            let mut ages: Vec<u64> = merged.values().map(|known| known.used).collect();
            ages.sort_unstable();
            let oldest_kept = ages[merged.len() - MAX_FILES];
            merged.retain(|_, known| known.used >= oldest_kept);
        }
        if let Ok(bytes) = serde_json::to_vec(&merged)
            && let Err(error) = store.home.write_whole(&self.file, &seal::seal(host().as_bytes(), &bytes))
        {
            tracing::warn!(%error, "the index of file hashes was not saved");
        }
        state.changed = false;
    }
}

/// What an index file of this machine holds; nothing where it is missing, damaged or another machine's.
fn known_files(file: &Path) -> BTreeMap<PathBuf, Known> {
    let read = || serde_json::from_slice(seal::open(host().as_bytes(), &seal::read(file).ok()?).ok()?).ok();
    read().unwrap_or_default()
}

/// Under which name a file is known. Where there are no inodes, a link is known by where it leads.
fn place(path: &Path) -> io::Result<PathBuf> {
    if cfg!(unix) { std::path::absolute(path) } else { fs::canonicalize(path) }
}

fn today() -> u64 {
    SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).map_or(0, |time| time.as_secs() / 86_400 * 86_400)
}

pub(super) fn stat(meta: &fs::Metadata) -> Stat {
    let modified = meta
        .modified()
        .ok()
        .and_then(|time| time.duration_since(SystemTime::UNIX_EPOCH).ok())
        .map_or(0, |time| u64::try_from(time.as_nanos()).unwrap_or(u64::MAX));
    let (changed, device, inode) = identity(meta);
    Stat { size: meta.len(), modified, changed, device, inode }
}

/// Nanoseconds of the last change, device and inode.
#[cfg(unix)]
fn identity(meta: &fs::Metadata) -> (u64, u64, u64) {
    use std::os::unix::fs::MetadataExt;
    let seconds = u64::try_from(meta.ctime()).unwrap_or(0);
    let nanoseconds = u64::try_from(meta.ctime_nsec()).unwrap_or(0);
    (seconds.saturating_mul(1_000_000_000).saturating_add(nanoseconds), meta.dev(), meta.ino())
}

#[cfg(not(unix))]
fn identity(_meta: &fs::Metadata) -> (u64, u64, u64) {
    (0, 0, 0)
}

/// A name for this machine, fit as a file name. Two machines of one name share a file, which the stat keeps safe.
pub fn host() -> String {
    static HOST: OnceLock<String> = OnceLock::new();
    HOST.get_or_init(read_host).clone()
}

fn read_host() -> String {
    let name = fs::read_to_string("/proc/sys/kernel/hostname").or_else(|_| fs::read_to_string("/etc/hostname"));
    let name: String =
        name.unwrap_or_default().trim().chars().filter(|c| c.is_ascii_alphanumeric() || *c == '-').collect();
    if name.is_empty() { "host".to_owned() } else { name }
}
