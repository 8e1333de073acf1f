//! One level of the store: opened when it is needed first, and passed over from its first trouble on.
//!
//! A level that cannot be opened, that has vanished, or that takes nothing (read-only, full, over its quota) is said
//! once and left alone for the rest of the process: a run of ten thousand tasks does not say it ten thousand times, and
//! does not wait for a dead server more than once. A level that takes nothing may still be read.

use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use blake3::Hash;
use tracing::{debug, warn};

use super::StoreError;
use super::folder::Folder;
use super::place::{Kind, Place, RemoteSpec, Trouble};

/// Where a level is, and what may be done there.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LevelSpec {
    /// Where its files are.
    pub at: Location,
    /// Whether nothing is ever written there.
    pub read_only: bool,
}

/// Where the files of a level are.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Location {
    /// A folder of this machine, or one that many machines share.
    Folder(PathBuf),
    /// An object store.
    Remote(RemoteSpec),
}

impl LevelSpec {
    /// The level that this text names: the address of an object store, or else a folder.
    pub fn parse(text: &str) -> Self {
        match text.split_once("://") {
            Some(_) => {
                let remote = RemoteSpec { url: text.trim_end_matches('/').to_owned(), ..RemoteSpec::default() };
                Self { at: Location::Remote(remote), read_only: false }
            }
            None => Self::folder(Path::new(text)),
        }
    }

    /// A folder that may be written.
    pub fn folder(path: &Path) -> Self {
        Self { at: Location::Folder(path.to_path_buf()), read_only: false }
    }

    /// The level as a user names it.
    pub fn name(&self) -> String {
        match &self.at {
            Location::Folder(path) => path.display().to_string(),
            Location::Remote(remote) => remote.url.clone(),
        }
    }

    /// Opens it. The folder of the first level is made where it is not there, any other must be.
    pub(super) fn open(&self, first: bool) -> Result<Box<dyn Place>, StoreError> {
        match &self.at {
            Location::Folder(path) => Ok(Box::new(Folder::open(path, first)?)),
            #[cfg(feature = "remote")]
            Location::Remote(remote) => Ok(Box::new(super::remote::Bucket::open(remote)?)),
            #[cfg(not(feature = "remote"))]
            Location::Remote(_) => {
                let reason = "this program was built without the feature `remote`".to_owned();
                Err(StoreError::Level { level: self.name(), reason })
            }
        }
    }
}

/// Why the bytes of a file are not what they should be.
#[derive(Debug)]
pub(super) enum Flaw {
    /// Damaged, or the file of another.
    Damaged(String),
    /// Sound, and of another version of the program, which may still need it.
    Foreign(String),
}

/// A level with what has become of it.
#[derive(Debug)]
pub(super) struct Level {
    spec: LevelSpec,
    /// Whether it is the first of its store.
    first: bool,
    place: OnceLock<Option<Box<dyn Place>>>,
    /// Why it is not read any more.
    lost: OnceLock<()>,
    /// Why it is not written any more.
    refused: OnceLock<String>,
}

impl Level {
    pub(super) fn new(spec: LevelSpec, first: bool) -> Self {
        let refused = OnceLock::new();
        if spec.read_only {
            refused.get_or_init(|| "it is to be read only".to_owned());
        }
        Self { spec, first, place: OnceLock::new(), lost: OnceLock::new(), refused }
    }

    pub(super) fn spec(&self) -> &LevelSpec {
        &self.spec
    }

    /// Opens the level now. Its error is the caller's to tell.
    pub(super) fn open(&self) -> Result<&dyn Place, StoreError> {
        if let Some(Some(place)) = self.place.get() {
            return Ok(place.as_ref());
        }
        let opened = self.spec.open(self.first);
        let (place, error) = match opened {
            Ok(place) => (Some(place), None),
            Err(error) => (None, Some(error)),
        };
        match (self.place.get_or_init(|| place), error) {
            (Some(place), _) => Ok(place.as_ref()),
            (None, Some(error)) => Err(error),
            (None, None) => Err(StoreError::Level { level: self.spec.name(), reason: "it could not be opened".into() }),
        }
    }

    /// The level, where it can be used. The first time that it cannot, that is said.
    pub(super) fn place(&self) -> Option<&dyn Place> {
        if self.lost.get().is_some() {
            return None;
        }
        match self.place.get() {
            Some(place) => place.as_deref(),
            None => self.open().map_err(|error| self.lose(&error)).ok(),
        }
    }

    /// Gives the level up, and says so the first time.
    pub(super) fn lose(&self, error: &StoreError) {
        self.lost.get_or_init(|| {
            let level = self.spec.name();
            warn!("the cache goes on without its level {level}: {error}");
        });
        self.refused.get_or_init(|| error.to_string());
    }

    /// The bytes of a file, where it is there and can be read.
    pub(super) fn read(&self, kind: Kind, hash: &Hash) -> Option<Vec<u8>> {
        let place = self.place()?;
        match place.read(kind, hash) {
            Ok(bytes) => bytes,
            Err(Trouble::Level(error)) => {
                self.lose(&error);
                None
            }
            Err(Trouble::File(error)) => {
                warn!("a file of the cache cannot be read and counts as missing: {error}");
                None
            }
        }
    }

    /// Says what is wrong with a file. A blob that is damaged is removed: as long as it is there, nobody would write a
    /// sound one in its place.
    pub(super) fn distrust(&self, kind: Kind, hash: &Hash, flaw: &Flaw) {
        let Some(place) = self.place() else { return };
        let path = place.name(kind, hash);
        match flaw {
            Flaw::Foreign(why) => debug!("{} is of another version of the program: {why}", path.display()),
            Flaw::Damaged(why) => {
                warn!("a file of the cache is damaged and counts as missing: {}: {why}", path.display());
                if kind == Kind::Blob && !self.spec.read_only {
                    let _ = place.remove(kind, hash);
                }
            }
        }
    }

    /// Whether files may be written here, as far as is known.
    pub(super) fn is_writable(&self) -> bool {
        self.refused.get().is_none() && self.place().is_some()
    }

    /// Why nothing is written here.
    pub(super) fn refusal(&self) -> Option<&str> {
        self.refused.get().map(String::as_str)
    }

    /// Whether a file of this length is there; then it is in use.
    pub(super) fn has(&self, kind: Kind, hash: &Hash, length: usize) -> bool {
        let place = self.place().filter(|place| place.has(kind, hash, length));
        if let Some(place) = place.filter(|_| !self.spec.read_only) {
            place.refresh(kind, hash, &[]);
        }
        place.is_some()
    }

    /// Puts a file in place.
    pub(super) fn write(&self, kind: Kind, hash: &Hash, bytes: &[u8]) -> Result<(), StoreError> {
        match (self.refusal(), self.place()) {
            (None, Some(place)) => place.write(kind, hash, bytes),
            (reason, _) => {
                let reason = reason.or(self.refusal()).unwrap_or("it is gone").to_owned();
                Err(StoreError::Level { level: self.spec.name(), reason })
            }
        }
    }

    /// Writes nothing here from now on, and says so the first time.
    pub(super) fn refuse(&self, error: &StoreError) {
        self.refused.get_or_init(|| {
            let level = self.spec.name();
            warn!("nothing more is written to the level {level} of the cache: {error}");
            error.to_string()
        });
    }
}
