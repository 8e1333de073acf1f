//! Copying the results of one level into another, verified on the way.

use std::collections::BTreeSet;

use blake3::Hash;
use serde::Serialize;

use super::level::Flaw;
use super::place::{Kind, Place};
use super::{Entry, Store, StoreError, verified};

/// What was copied.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub struct CopyReport {
    /// Results copied.
    pub entries: u64,
    /// Artifacts copied.
    pub blobs: u64,
    /// Bytes of both.
    pub bytes: u64,
    /// Results that were there already.
    pub present: u64,
    /// Results left out: damaged, of another version, or without their artifact.
    pub left_out: u64,
}

impl Store {
    /// Copies what one level has and another has not, by their numbers: each artifact before the result that names it,
    /// so that a copy that is interrupted is a smaller copy. Pins go along where `pins` says so.
    ///
    /// # Errors
    /// Where one of the levels cannot be used, or the second takes nothing more.
    pub fn copy(&self, from: usize, to: usize, pins: bool) -> Result<CopyReport, StoreError> {
        let (source, target) = (self.level(from)?, self.level(to)?);
        if let Some(reason) = self.levels[to].refusal() {
            let level = self.levels[to].spec().name();
            return Err(StoreError::Level { level, reason: reason.to_owned() });
        }
        let hashes = |place: &dyn Place, kind: Kind| -> Result<BTreeSet<[u8; 32]>, StoreError> {
            Ok(place.list(kind)?.into_iter().map(|item| *item.hash.as_bytes()).collect())
        };
        let (known, mut blobs) = (hashes(target, Kind::Entry)?, hashes(target, Kind::Blob)?);
        let mut report = CopyReport::default();
        for item in source.list(Kind::Entry)? {
            let is_known = known.contains(item.hash.as_bytes());
            if is_known && !self.lacks_artifact(from.min(to), &item.hash, &blobs) {
                report.present += 1;
            } else if !self.copy_one(from, target, &item.hash, (&mut blobs, &mut report))? {
                if self.levels[from].place().is_none() {
                    let (level, reason) = (self.levels[from].spec().name(), "it was lost on the way".to_owned());
                    return Err(StoreError::Level { level, reason });
                }
                report.left_out += 1;
            }
        }
        if pins {
            for item in source.list(Kind::Pin)? {
                if let Ok(Some(bytes)) = source.read(Kind::Pin, &item.hash) {
                    target.write(Kind::Pin, &item.hash, &bytes)?;
                }
            }
        }
        Ok(report)
    }

    /// Whether a result names an artifact that is not among `blobs`: a level that was filled on the way has results
    /// whose artifacts nobody has asked for. `near` is the level that costs less to read.
    fn lacks_artifact(&self, near: usize, key: &Hash, blobs: &BTreeSet<[u8; 32]>) -> bool {
        let bytes = self.levels[near].read(Kind::Entry, key);
        let entry = bytes.and_then(|bytes| Entry::decode(key, &bytes).ok());
        entry.and_then(|entry| entry.content()).is_some_and(|content| !blobs.contains(content.as_bytes()))
    }

    /// Copies one result with its artifact. False where it is left out.
    fn copy_one(
        &self,
        from: usize,
        target: &dyn Place,
        key: &Hash,
        (blobs, report): (&mut BTreeSet<[u8; 32]>, &mut CopyReport),
    ) -> Result<bool, StoreError> {
        let source = &self.levels[from];
        let sound = |kind: Kind, hash: &Hash, flaw: &dyn Fn(&[u8]) -> Option<Flaw>| -> Option<Vec<u8>> {
            let bytes = source.read(kind, hash)?;
            match flaw(&bytes) {
                None => Some(bytes),
                Some(flaw) => {
                    source.distrust(kind, hash, &flaw);
                    None
                }
            }
        };
        let Some(bytes) = sound(Kind::Entry, key, &|bytes| Entry::decode(key, bytes).err().map(|error| error.flaw()))
        else {
            return Ok(false);
        };
        let content = Entry::decode(key, &bytes).ok().and_then(|entry| entry.content());
        if let Some(content) = content.filter(|content| !blobs.contains(content.as_bytes())) {
            let Some(blob) = sound(Kind::Blob, &content, &|bytes| verified(bytes, &content).err()) else {
                return Ok(false);
            };
            target.write(Kind::Blob, &content, &blob)?;
            blobs.insert(*content.as_bytes());
            report.blobs += 1;
            report.bytes += blob.len() as u64;
        }
        target.write(Kind::Entry, key, &bytes)?;
        report.entries += 1;
        report.bytes += bytes.len() as u64;
        Ok(true)
    }
}
