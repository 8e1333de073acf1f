//! A level of the store in a folder, on a disk of this machine or on one that many machines share.
//!
//! # Invariants
//! - A file appears under its final name only whole: it is written in `tmp`, on the same file system, and renamed.
//! - There is no lock. Whoever dies at any moment leaves at most a file in `tmp`, which the next one removes.
//! - Only plain files count. A link, folder or pipe in a file's place is a miss and is replaced, never followed.
//! - Files and folders have the rights that the mode of the level's own folder says, whatever the umask of who writes:
//!   what a group may read stays readable to the group, and a set-group-id bit is kept.
//! - That a file is not there is believed only after its folder was opened anew, which makes a network file system ask
//!   its server; until then it may answer from what it knew some seconds ago.
//! - A level that has vanished is not made anew: below a mount point without its disk nothing is written.
//!
//! # Cost
//! A hit is one `lstat` and one read; a miss opens two folders besides.

use std::any::Any;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use blake3::Hash;

use super::place::{Item, Kind, Place, Trouble};
use super::{StoreError, leftover, seal};

/// Folder of the layout.
pub(super) const LAYOUT: &str = "v2";
/// Folders of earlier layouts, which other versions of the program may still use; `clear` removes them.
pub(super) const EARLIER: [&str; 1] = ["v1"];
/// Marks a cache folder, see <https://bford.info/cachedir/>.
pub(super) const TAG_FILE: &str = "CACHEDIR.TAG";
const TAG_TEXT: &str = "Signature: 8a477f597d28d172789f06886806bc55\n# Results cached by meshmill.\n";
/// A hit refreshes an entry's time only when it is older, so that a hit costs no write as a rule.
const REFRESH_AFTER: Duration = Duration::from_hours(24);

/// A level in a folder.
#[derive(Clone, Debug)]
pub(super) struct Folder {
    root: PathBuf,
    /// Rights of its files and folders; `None` where a system has none.
    mode: Option<u32>,
}

impl Folder {
    /// Opens the level in this folder and creates what is missing. The folder itself is made only where `make` says so.
    pub(super) fn open(root: &Path, make: bool) -> Result<Self, StoreError> {
        const MAKE: &str = "create the cache folder";
        if make && !root.is_dir() {
            fs::create_dir_all(root).map_err(StoreError::io(MAKE, root))?;
        }
        let meta = fs::metadata(root).map_err(StoreError::io("open the cache folder", root))?;
        let folder = Self { root: root.to_path_buf(), mode: mode_of(&meta) };
        let kinds = Kind::ALL.map(Kind::folder);
        for name in [""].into_iter().chain(kinds).chain(["tmp", "stat"]) {
            let path = folder.folder(name);
            if !path.is_dir() {
                match fs::create_dir(&path) {
                    Ok(()) => folder.give_rights(&path),
                    // What has entries can be read, though an earlier version made it and it takes nothing now.
                    Err(_) if path.is_dir() || folder.folder(Kind::Entry.folder()).is_dir() => {}
                    Err(error) => return Err(StoreError::io(MAKE, &path)(error)),
                }
            }
        }
        leftover::remove_leftovers(&folder.folder("tmp"));
        let tag = root.join(TAG_FILE);
        if fs::symlink_metadata(&tag).is_err() {
            let written = folder.write_whole(&tag, TAG_TEXT.as_bytes());
            if make {
                written?;
            }
        }
        Ok(folder)
    }

    /// The folder that a level is, where it is one.
    pub(super) fn of(place: &dyn Place) -> Option<&Self> {
        place.as_any().downcast_ref()
    }

    /// Whether a folder is a store.
    pub(super) fn is_at(root: &Path) -> bool {
        root.join(LAYOUT).is_dir()
    }

    /// The folder of this level.
    pub(super) fn root(&self) -> &Path {
        &self.root
    }

    /// A folder of the layout.
    pub(super) fn folder(&self, name: &str) -> PathBuf {
        self.root.join(LAYOUT).join(name)
    }

    /// The path of a file.
    pub(super) fn place(&self, kind: Kind, hash: &Hash) -> PathBuf {
        let hex = hash.to_hex();
        self.folder(kind.folder()).join(&hex[..2]).join(hex.as_str())
    }

    /// Whether a file can be written here at all.
    pub(super) fn probe(&self) -> Result<(), StoreError> {
        let tmp = self.folder("tmp");
        tempfile::tempfile_in(&tmp).map(drop).map_err(StoreError::io("write", &tmp))
    }

    /// Writes `bytes` aside and renames them to `path`: a link or pipe there is replaced, never written through, and a
    /// folder is moved aside.
    pub(super) fn write_whole(&self, path: &Path, bytes: &[u8]) -> Result<(), StoreError> {
        // Whoever collects garbage at this moment may take a folder or a temporary file away, once.
        let written = self.try_write(path, bytes).or_else(|error| match error.kind() {
            io::ErrorKind::NotFound => self.try_write(path, bytes),
            _ => Err(error),
        });
        written.map_err(StoreError::io("write", path))
    }

    fn try_write(&self, path: &Path, bytes: &[u8]) -> io::Result<()> {
        if let Some(parent) = path.parent() {
            self.make_shard(parent)?;
        }
        if fs::symlink_metadata(path).is_ok_and(|meta| meta.is_dir()) {
            self.move_aside(path)?;
        }
        leftover::write_by_rename(&self.folder("tmp"), path, bytes, self.mode.map(|mode| mode & 0o666 | 0o600))
    }

    /// Makes a folder of files, with its rights from the first moment on. Above it nothing is made.
    fn make_shard(&self, path: &Path) -> io::Result<()> {
        match fs::symlink_metadata(path) {
            Ok(meta) if meta.is_dir() => return Ok(()),
            Ok(_) => fs::remove_file(path)?,
            Err(_) => {}
        }
        let aside = tempfile::Builder::new().prefix("folder").tempdir_in(self.folder("tmp"))?.keep();
        self.give_rights(&aside);
        fs::rename(&aside, path).or_else(|error| {
            // Somebody else has made it, and it is in use.
            let _ = fs::remove_dir(&aside);
            if path.is_dir() { Ok(()) } else { Err(error) }
        })
    }

    /// Gives a new folder the rights of the level. Where the system refuses, those that it has must do.
    fn give_rights(&self, path: &Path) {
        set_mode(path, self.mode.map(|mode| mode | 0o700));
    }

    /// Moves a folder that is in a file's place out of the way; `gc` removes it.
    pub(super) fn move_aside(&self, path: &Path) -> io::Result<()> {
        let aside = tempfile::Builder::new().prefix("folder").tempdir_in(self.folder("tmp"))?.keep();
        fs::rename(path, aside.join("was"))
    }

    /// Looks for a file whose name was not there, after its folders have been opened anew.
    fn look_again(&self, kind: Kind, path: &Path) -> Result<Option<Vec<u8>>, Trouble> {
        let kinds = self.folder(kind.folder());
        fs::read_dir(&kinds).map_err(|error| Trouble::Level(StoreError::io("read", &kinds)(error)))?;
        if path.parent().is_none_or(|shard| fs::read_dir(shard).is_err()) {
            return Ok(None);
        }
        match seal::read(path) {
            Ok(bytes) => Ok(Some(bytes)),
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
            Err(error) => Err(Trouble::File(StoreError::io("read", path)(error))),
        }
    }
}

impl Place for Folder {
    fn read(&self, kind: Kind, hash: &Hash) -> Result<Option<Vec<u8>>, Trouble> {
        let path = self.place(kind, hash);
        match seal::read(&path) {
            Ok(bytes) => Ok(Some(bytes)),
            // A file that was replaced while it was read is a stale handle on some file systems.
            Err(error) if matches!(error.kind(), io::ErrorKind::NotFound | io::ErrorKind::StaleNetworkFileHandle) => {
                self.look_again(kind, &path)
            }
            Err(error) => {
                let error = StoreError::io("read", &path)(error);
                let is_there = fs::read_dir(self.folder(kind.folder())).is_ok();
                Err(if is_there { Trouble::File(error) } else { Trouble::Level(error) })
            }
        }
    }

    fn has(&self, kind: Kind, hash: &Hash, length: usize) -> bool {
        let meta = fs::symlink_metadata(self.place(kind, hash));
        meta.is_ok_and(|meta| meta.is_file() && meta.len() == length as u64)
    }

    fn write(&self, kind: Kind, hash: &Hash, bytes: &[u8]) -> Result<(), StoreError> {
        let path = self.place(kind, hash);
        match self.write_whole(&path, bytes) {
            // In a folder with the sticky bit nobody replaces the file of another; what is there is as good.
            Err(StoreError::Io { source, .. })
                if source.kind() == io::ErrorKind::PermissionDenied && seal::is_plain(&path) =>
            {
                Ok(())
            }
            written => written,
        }
    }

    fn remove(&self, kind: Kind, hash: &Hash) -> Result<(), StoreError> {
        let path = self.place(kind, hash);
        match fs::remove_file(&path) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => Err(StoreError::io("remove", &path)(error)),
            _ => Ok(()),
        }
    }

    fn list(&self, kind: Kind) -> Result<Vec<Item>, StoreError> {
        let mut items = Vec::new();
        let root = self.folder(kind.folder());
        let shards = match fs::read_dir(&root) {
            Err(error) if error.kind() == io::ErrorKind::NotFound && self.folder("").is_dir() => return Ok(items),
            shards => shards.map_err(StoreError::io("read", &root))?,
        };
        for shard in shards.filter_map(Result::ok).filter(|entry| entry.file_type().is_ok_and(|kind| kind.is_dir())) {
            for (path, meta) in files(&shard.path())? {
                let hash = path.file_name().and_then(|name| name.to_str()).and_then(|name| Hash::from_hex(name).ok());
                if let (Some(hash), Ok(modified)) = (hash, meta.modified()) {
                    items.push(Item { hash, path, bytes: meta.len(), modified });
                }
            }
        }
        items.sort_by(|a, b| a.path.cmp(&b.path));
        Ok(items)
    }

    fn refresh(&self, kind: Kind, hash: &Hash, bytes: &[u8]) {
        let path = self.place(kind, hash);
        let Ok(modified) = fs::metadata(&path).and_then(|meta| meta.modified()) else { return };
        let now = SystemTime::now();
        if now.duration_since(modified).is_ok_and(|age| age > REFRESH_AFTER) {
            let touched = fs::File::options().append(true).open(&path).and_then(|file| file.set_modified(now));
            // Only its owner may set the time of a file; who else may write here replaces it by its equal.
            if touched.is_err() && kind == Kind::Entry {
                let _ = self.write_whole(&path, bytes);
            }
        }
    }

    fn name(&self, kind: Kind, hash: &Hash) -> PathBuf {
        self.place(kind, hash)
    }

    fn as_any(&self) -> &dyn Any {
        self
    }
}

/// The files of a folder. Files that vanish while it is read are left out.
pub(super) fn files(folder: &Path) -> Result<Vec<(PathBuf, fs::Metadata)>, StoreError> {
    let entries = fs::read_dir(folder).map_err(StoreError::io("read", folder))?;
    let files = entries.filter_map(Result::ok).filter_map(|entry| Some((entry.path(), entry.metadata().ok()?)));
    Ok(files.filter(|(_, meta)| meta.is_file()).collect())
}

/// The rights of a folder, with its set-group-id and sticky bits.
#[cfg(unix)]
#[expect(clippy::unnecessary_wraps, reason = "other systems have none")]
fn mode_of(meta: &fs::Metadata) -> Option<u32> {
    use std::os::unix::fs::PermissionsExt;
    Some(meta.permissions().mode() & 0o7777)
}

#[cfg(not(unix))]
fn mode_of(_meta: &fs::Metadata) -> Option<u32> {
    None
}

#[cfg(unix)]
fn set_mode(path: &Path, mode: Option<u32>) {
    use std::os::unix::fs::PermissionsExt;
    if let Some(mode) = mode {
        let _ = fs::set_permissions(path, PermissionsExt::from_mode(mode));
    }
}

#[cfg(not(unix))]
fn set_mode(_path: &Path, _mode: Option<u32>) {}
