//! Looking after a store: how full it is, what is damaged, and removal of what is old or too much.
//!
//! All of it is safe beside running programs: whoever loses an entry or a blob under its feet computes it again.
//! Garbage collection removes entries, oldest use first, then the blobs that no entry names any more. An unnamed blob
//! younger than an hour stays, since its entry may be on the way.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use blake3::Hash;
use serde::Serialize;

use super::{EARLIER, Entry, Store, StoreError, TAG_FILE, seal, verified};

/// Files that somebody may be about to name are left alone for this long.
const GRACE: Duration = Duration::from_hours(1);

/// How full a store is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub struct StoreStat {
    /// Results.
    pub entries: u64,
    /// Artifacts.
    pub blobs: u64,
    /// Bytes of both on the disk.
    pub bytes: u64,
    /// Files left behind by programs that were killed.
    pub leftovers: u64,
}

/// What garbage collection removes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct GcLimits {
    /// Oldest entries go until the store is at most this large, in bytes.
    pub max_bytes: Option<u64>,
    /// Entries that were not used for this long go.
    pub max_age: Option<Duration>,
    /// Say what would go, remove nothing.
    pub dry_run: bool,
}

/// What was removed or found.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub struct CleanReport {
    /// Entries removed.
    pub entries: u64,
    /// Blobs removed.
    pub blobs: u64,
    /// Bytes freed.
    pub bytes: u64,
    /// Damaged files, by path; `verify` only.
    pub damaged: Vec<PathBuf>,
}

struct Item {
    hash: Hash,
    path: PathBuf,
    bytes: u64,
    modified: SystemTime,
}

impl Store {
    /// Counts what is in the store.
    pub fn stat(&self) -> Result<StoreStat, StoreError> {
        let (entries, blobs) = (self.items("ac")?, self.items("cas")?);
        let bytes = entries.iter().chain(&blobs).map(|item| item.bytes).sum();
        let leftovers = files(&self.folder("tmp"))?.len() as u64;
        Ok(StoreStat { entries: entries.len() as u64, blobs: blobs.len() as u64, bytes, leftovers })
    }

    /// Removes old entries, unused blobs and leftovers.
    pub fn gc(&self, limits: GcLimits) -> Result<CleanReport, StoreError> {
        let now = SystemTime::now();
        let old = |item: &Item, age: Duration| now.duration_since(item.modified).is_ok_and(|a| a >= age);
        let mut entries = self.items("ac")?;
        entries.sort_by(|a, b| (a.modified, a.hash.as_bytes()).cmp(&(b.modified, b.hash.as_bytes())));
        let blobs: BTreeMap<[u8; 32], Item> =
            self.items("cas")?.into_iter().map(|blob| (*blob.hash.as_bytes(), blob)).collect();
        let contents: Vec<Option<[u8; 32]>> = entries.iter().map(content_of).collect();
        let mut users: BTreeMap<[u8; 32], u64> = BTreeMap::new();
        for content in contents.iter().flatten() {
            *users.entry(*content).or_default() += 1;
        }
        let mut total: u64 = entries.iter().chain(blobs.values()).map(|item| item.bytes).sum();
        let mut report = CleanReport::default();
        let mut released = BTreeSet::new();
        for (entry, content) in entries.iter().zip(&contents) {
            let too_old = limits.max_age.is_some_and(|age| old(entry, age));
            if !too_old && limits.max_bytes.is_none_or(|max| total <= max) {
                continue;
            }
            total -= report.remove(entry, limits.dry_run, Removed::Entry);
            if let Some(content) = content
                && let Some(count) = users.get_mut(content)
            {
                *count -= 1;
                if *count == 0 {
                    released.insert(*content);
                    total -= blobs.get(content).map_or(0, |blob| report.remove(blob, limits.dry_run, Removed::Blob));
                }
            }
        }
        for (content, blob) in &blobs {
            if !users.contains_key(content) && old(blob, GRACE) {
                report.remove(blob, limits.dry_run, Removed::Blob);
            }
        }
        self.remove_leftovers(now, limits.dry_run)?;
        Ok(report)
    }

    /// Checks every file, and removes what is damaged: entries, blobs, names, the index and stamps of this machine, and
    /// whatever lies in the place of one and is no file, which is moved aside.
    pub fn verify(&self) -> Result<CleanReport, StoreError> {
        let mut report = CleanReport::default();
        for entry in self.items("ac")? {
            if fs::read(&entry.path).is_ok_and(|bytes| Entry::decode(&entry.hash, &bytes).is_err()) {
                report.remove(&entry, false, Removed::Entry);
                report.damaged.push(entry.path);
            }
        }
        for blob in self.items("cas")? {
            if fs::read(&blob.path).is_ok_and(|bytes| verified(&bytes, &blob.hash).is_err()) {
                report.remove(&blob, false, Removed::Blob);
                report.damaged.push(blob.path);
            }
        }
        for name in self.items("names")? {
            if fs::read(&name.path).is_ok_and(|bytes| seal::open(name.hash.as_bytes(), &bytes).is_err()) {
                report.discard(name.path);
            }
        }
        for (path, _) in files(&self.folder("stat"))? {
            // Beside a stamp lies the record that the next run puts in place, plain text.
            let name = path.file_name().unwrap_or_default();
            let is_sealed = path.extension().is_none_or(|ending| ending != "ron");
            let opens = |bytes: Vec<u8>| seal::open(name.as_encoded_bytes(), &bytes).is_ok();
            if is_sealed && fs::read(&path).is_ok_and(|bytes| !opens(bytes)) {
                report.discard(path);
            }
        }
        for path in self.intruders()? {
            // A link or pipe goes; what a folder holds may be somebody's.
            if fs::symlink_metadata(&path).is_ok_and(|meta| meta.is_dir()) {
                self.move_aside(&path).map_err(StoreError::io("move aside", &path))?;
            }
            report.discard(path);
        }
        Ok(report)
    }

    /// What is no plain file in the place of a file, or no folder in the place of a shard.
    fn intruders(&self) -> Result<Vec<PathBuf>, StoreError> {
        let mut found = Vec::new();
        for folder in ["ac", "cas", "names"] {
            let root = self.folder(folder);
            let shards = fs::read_dir(&root).map_err(StoreError::io("read", &root))?;
            for shard in shards.filter_map(Result::ok) {
                if shard.file_type().is_ok_and(|kind| !kind.is_dir()) {
                    found.push(shard.path());
                    continue;
                }
                let items = fs::read_dir(shard.path()).into_iter().flatten().filter_map(Result::ok);
                found.extend(items.filter(|item| item.file_type().is_ok_and(|kind| !kind.is_file())).map(|i| i.path()));
            }
        }
        let root = self.folder("stat");
        let stamps = fs::read_dir(&root).map_err(StoreError::io("read", &root))?.filter_map(Result::ok);
        found.extend(stamps.filter(|item| item.file_type().is_ok_and(|kind| !kind.is_file())).map(|item| item.path()));
        found.sort();
        Ok(found)
    }

    /// Removes everything. Refuses a folder that does not say that it is a cache.
    pub fn clear(&self) -> Result<CleanReport, StoreError> {
        if !seal::is_plain(&self.root.join(TAG_FILE)) {
            return Err(StoreError::NotACache(self.root.clone()));
        }
        let stat = self.stat()?;
        for folder in ["ac", "cas", "names", "stat", "tmp"] {
            let path = self.folder(folder);
            fs::remove_dir_all(&path).map_err(StoreError::io("remove", &path))?;
        }
        for path in EARLIER.map(|name| self.root.join(name)) {
            if fs::symlink_metadata(&path).is_ok_and(|meta| meta.is_dir()) {
                fs::remove_dir_all(&path).map_err(StoreError::io("remove", &path))?;
            }
        }
        Self::open(&self.root)?;
        Ok(CleanReport { entries: stat.entries, blobs: stat.blobs, bytes: stat.bytes, damaged: Vec::new() })
    }

    fn items(&self, folder: &str) -> Result<Vec<Item>, StoreError> {
        let mut items = Vec::new();
        let root = self.folder(folder);
        let shards = fs::read_dir(&root).map_err(StoreError::io("read", &root))?;
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

    /// Files of the dead, and folders that were moved out of the place of a file.
    fn remove_leftovers(&self, now: SystemTime, dry_run: bool) -> Result<(), StoreError> {
        let tmp = self.folder("tmp");
        let entries = fs::read_dir(&tmp).map_err(StoreError::io("read", &tmp))?;
        for entry in entries.filter_map(Result::ok).filter(|_| !dry_run) {
            let Ok(meta) = entry.metadata() else { continue };
            let age = meta.modified().ok().and_then(|time| now.duration_since(time).ok());
            if age.is_some_and(|age| age > GRACE) {
                // Somebody else may have removed it meanwhile.
                let _ = if meta.is_dir() { fs::remove_dir_all(entry.path()) } else { fs::remove_file(entry.path()) };
            }
        }
        Ok(())
    }
}

#[derive(Clone, Copy)]
enum Removed {
    Entry,
    Blob,
}

impl CleanReport {
    /// Removes what is damaged and counts as nothing else. What is gone already, or aside, is named all the same.
    fn discard(&mut self, path: PathBuf) {
        let _ = fs::remove_file(&path);
        self.damaged.push(path);
    }

    /// Removes a file and counts it; returns the bytes freed. A file that is gone already frees nothing.
    fn remove(&mut self, item: &Item, dry_run: bool, what: Removed) -> u64 {
        if !dry_run && fs::remove_file(&item.path).is_err() {
            return 0;
        }
        match what {
            Removed::Entry => self.entries += 1,
            Removed::Blob => self.blobs += 1,
        }
        self.bytes += item.bytes;
        item.bytes
    }
}

fn content_of(item: &Item) -> Option<[u8; 32]> {
    let entry = Entry::decode(&item.hash, &fs::read(&item.path).ok()?).ok()?;
    Some(*entry.content()?.as_bytes())
}

/// The files of a folder. Files that vanish while it is read are left out.
fn files(folder: &Path) -> Result<Vec<(PathBuf, fs::Metadata)>, StoreError> {
    let entries = fs::read_dir(folder).map_err(StoreError::io("read", folder))?;
    let files = entries.filter_map(Result::ok).filter_map(|entry| Some((entry.path(), entry.metadata().ok()?)));
    Ok(files.filter(|(_, meta)| meta.is_file()).collect())
}
