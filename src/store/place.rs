//! What a level of the store is made of: files by kind and hash, in a folder or elsewhere.

use std::any::Any;
use std::path::PathBuf;
use std::time::SystemTime;

use blake3::Hash;

use super::StoreError;

/// An object store. What gives access to it stands in the environment and nowhere else.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RemoteSpec {
    /// Bucket and prefix: `s3://bucket/prefix`.
    pub url: String,
    /// Address of a server that is not Amazon's.
    pub endpoint: Option<String>,
    /// Region of the bucket.
    pub region: Option<String>,
    /// Whether the server may be spoken to without encryption.
    pub allow_http: bool,
}

/// What a file of the store holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// What a task gave, by its key.
    Entry,
    /// A packed artifact, by its content.
    Blob,
    /// The newest key of a task, by the hash of its name.
    Name,
    /// The keys that a lock needs, by the hash of the lock's place.
    Pin,
}

impl Kind {
    /// All of them.
    pub(super) const ALL: [Self; 4] = [Self::Entry, Self::Blob, Self::Name, Self::Pin];

    /// The folder that they are in.
    pub(super) fn folder(self) -> &'static str {
        match self {
            Self::Entry => "ac",
            Self::Blob => "cas",
            Self::Name => "names",
            Self::Pin => "pins",
        }
    }
}

/// A file of a level, as a list tells it.
#[derive(Clone, Debug)]
pub(super) struct Item {
    /// What it is filed under.
    pub(super) hash: Hash,
    /// Where it is, as a user would name it.
    pub(super) path: PathBuf,
    /// Its size on the disk.
    pub(super) bytes: u64,
    /// When it was written or used last.
    pub(super) modified: SystemTime,
}

/// Why a file cannot be read.
#[derive(Debug)]
pub(super) enum Trouble {
    /// This file cannot, others may.
    File(StoreError),
    /// The whole level is gone.
    Level(StoreError),
}

/// Where a level keeps its files. Nothing here is believed: whoever reads verifies.
pub(super) trait Place: std::fmt::Debug + Send + Sync {
    /// The bytes of a file, or `None` where there is none.
    fn read(&self, kind: Kind, hash: &Hash) -> Result<Option<Vec<u8>>, Trouble>;

    /// Whether a file of this length is there. Not being sure is `false`: it is written again.
    fn has(&self, kind: Kind, hash: &Hash, length: usize) -> bool;

    /// Puts a file in place, whole or not at all.
    fn write(&self, kind: Kind, hash: &Hash, bytes: &[u8]) -> Result<(), StoreError>;

    /// Removes a file. One that is gone already is no error.
    fn remove(&self, kind: Kind, hash: &Hash) -> Result<(), StoreError>;

    /// All files of a kind, sorted by hash.
    fn list(&self, kind: Kind) -> Result<Vec<Item>, StoreError>;

    /// Notes that a file is in use, so that it is collected later; `bytes` is what it holds. Never an error.
    fn refresh(&self, kind: Kind, hash: &Hash, bytes: &[u8]);

    /// The path of a file as a user would name it.
    fn name(&self, kind: Kind, hash: &Hash) -> PathBuf;

    /// Itself, for those who want to know what it is.
    fn as_any(&self) -> &dyn Any;
}
