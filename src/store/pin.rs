//! Pins: the results that a lock refers to, which garbage collection leaves alone.
//!
//! A pin is a sealed file under the hash of machine and path of its lock, so that locking anew replaces it. It ends
//! when somebody takes it away, or when the machine that set it collects garbage and the lock file is gone.

use std::collections::BTreeSet;
use std::path::Path;

use blake3::Hash;
use serde::{Deserialize, Serialize};

use super::place::{Kind, Place};
use super::seal::{self, SealError};
use super::stat_index::host;
use super::{Store, StoreError};

/// What a lock needs of the store.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Pin {
    /// The lock file.
    pub lock: String,
    /// The machine on which it is.
    pub host: String,
    /// Version of the program that pinned.
    pub version: String,
    /// The keys, in hexadecimal, sorted.
    pub keys: Vec<String>,
}

impl Pin {
    /// What it is filed under.
    fn name(lock: &str, host: &str) -> Hash {
        let mut hasher = blake3::Hasher::new();
        for part in [host, lock] {
            hasher.update(&(part.len() as u64).to_le_bytes());
            hasher.update(part.as_bytes());
        }
        hasher.finalize()
    }

    /// Whether its lock is known to be gone.
    fn is_over(&self) -> bool {
        self.host == host() && std::fs::symlink_metadata(&self.lock).is_err()
    }
}

/// What is known of the pins of a level.
pub(super) struct Pins {
    /// Every one that opens, with the file it is in.
    pub(super) pins: Vec<(Hash, Pin)>,
    /// Whether another version of the program has pinned something that this one cannot read.
    pub(super) foreign: bool,
}

impl Pins {
    /// The pins of a level. A damaged one pins nothing.
    pub(super) fn of(place: &dyn Place) -> Result<Self, StoreError> {
        let (mut pins, mut foreign) = (Vec::new(), false);
        for item in place.list(Kind::Pin)? {
            let Ok(Some(bytes)) = place.read(Kind::Pin, &item.hash) else { continue };
            match seal::open(item.hash.as_bytes(), &bytes) {
                Ok(body) => match serde_json::from_slice(body) {
                    Ok(pin) => pins.push((item.hash, pin)),
                    Err(_) => foreign = true,
                },
                Err(SealError::Foreign) => foreign = true,
                Err(SealError::NotSealed | SealError::Checksum) => {}
            }
        }
        Ok(Self { pins, foreign })
    }

    /// The keys that must stay; the pins of locks that are gone are removed.
    pub(super) fn keys(&self, place: &dyn Place, dry_run: bool) -> BTreeSet<[u8; 32]> {
        let mut keys = BTreeSet::new();
        for (name, pin) in &self.pins {
            if pin.is_over() {
                if !dry_run {
                    let _ = place.remove(Kind::Pin, name);
                }
                continue;
            }
            keys.extend(pin.keys.iter().filter_map(|key| Some(*Hash::from_hex(key).ok()?.as_bytes())));
        }
        keys
    }
}

impl Store {
    /// Keeps the results of these keys for a lock, in every level that can be written.
    pub fn pin(&self, lock: &Path, version: &str, keys: &BTreeSet<String>) -> Result<(), StoreError> {
        let lock = std::path::absolute(lock).unwrap_or_else(|_| lock.to_path_buf()).display().to_string();
        let pin = Pin { host: host(), version: version.to_owned(), keys: keys.iter().cloned().collect(), lock };
        let name = Pin::name(&pin.lock, &pin.host);
        // Text and lists of text cannot fail to serialise.
        let body = serde_json::to_vec(&pin).unwrap_or_default();
        self.put(Kind::Pin, &name, &seal::seal(name.as_bytes(), &body))
    }

    /// The pins of a level, by its number.
    pub fn pins(&self, level: usize) -> Result<Vec<Pin>, StoreError> {
        Ok(Pins::of(self.level(level)?)?.pins.into_iter().map(|(_, pin)| pin).collect())
    }

    /// Takes the pins of a lock away from a level, whichever machine set them. Returns how many there were.
    pub fn unpin(&self, level: usize, lock: &str) -> Result<usize, StoreError> {
        let place = self.level(level)?;
        let pins = Pins::of(place)?.pins;
        let of_lock: Vec<Hash> = pins.into_iter().filter(|(_, pin)| pin.lock == lock).map(|(name, _)| name).collect();
        for name in &of_lock {
            place.remove(Kind::Pin, name)?;
        }
        Ok(of_lock.len())
    }
}
