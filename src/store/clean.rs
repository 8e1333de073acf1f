//! Looking after a store: how full it is, what is damaged, and removal of what is old or too much.
//!
//! All of it is safe beside running programs: whoever loses an entry or a blob under its feet computes it again.
//! Garbage collection removes entries, oldest use first, then the blobs that no entry names any more. An unnamed blob
//! younger than an hour stays, since its entry may be on the way. What a lock pins stays too, and so do the files of
//! other versions of the program, which this one cannot read: age alone takes them.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::PathBuf;
use std::time::{Duration, SystemTime};

use serde::Serialize;

use super::folder::{EARLIER, Folder, LAYOUT, TAG_FILE, files};
use super::level::Flaw;
use super::pin::Pins;
use super::place::{Item, Kind, Place, Trouble};
use super::{Entry, LevelSpec, Store, StoreError, seal, verified};

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
    /// Locks whose results stay.
    pub pins: u64,
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
    /// Entries that would have gone if no lock pinned them.
    pub pinned: u64,
    /// Files of other versions of the program, which were left alone; `verify` only.
    pub foreign: u64,
    /// Damaged files, by path; `verify` only.
    pub damaged: Vec<PathBuf>,
}

impl Store {
    /// How many levels there are.
    pub fn level_count(&self) -> usize {
        self.levels.len()
    }

    /// What a level is, by its number.
    pub fn level_spec(&self, number: usize) -> &LevelSpec {
        self.levels[number].spec()
    }

    /// A level to look after, by its number.
    pub(super) fn level(&self, number: usize) -> Result<&dyn Place, StoreError> {
        self.levels[number].open()
    }

    /// Counts what is in a level, by its number.
    pub fn stat(&self, level: usize) -> Result<StoreStat, StoreError> {
        let place = self.level(level)?;
        let (entries, blobs) = (place.list(Kind::Entry)?, place.list(Kind::Blob)?);
        let bytes = entries.iter().chain(&blobs).map(|item| item.bytes).sum();
        let tmp = Folder::of(place).map(|folder| files(&folder.folder("tmp"))).transpose()?;
        let leftovers = tmp.map_or(0, |files| files.len() as u64);
        let pins = place.list(Kind::Pin)?.len() as u64;
        Ok(StoreStat { entries: entries.len() as u64, blobs: blobs.len() as u64, bytes, leftovers, pins })
    }

    /// How many results each version on each machine has made, of a level by its number. Reads every entry.
    pub fn makers(&self, level: usize) -> Result<BTreeMap<(String, String), u64>, StoreError> {
        let place = self.level(level)?;
        let mut makers = BTreeMap::new();
        for item in place.list(Kind::Entry)? {
            let read = place.read(Kind::Entry, &item.hash).ok().flatten();
            if let Some(entry) = read.and_then(|bytes| Entry::decode(&item.hash, &bytes).ok()) {
                *makers.entry((entry.version, entry.host)).or_default() += 1;
            }
        }
        Ok(makers)
    }

    /// Removes old entries, unused blobs and leftovers of a level, by its number.
    pub fn gc(&self, level: usize, limits: GcLimits) -> Result<CleanReport, StoreError> {
        let place = self.level(level)?;
        let now = SystemTime::now();
        let pins = Pins::of(place)?;
        if pins.foreign {
            let reason =
                "a newer version of the program has pinned results there; collect garbage with that one".into();
            return Err(StoreError::Level { level: self.level_spec(level).name(), reason });
        }
        let report = collect(place, limits, &pins.keys(place, limits.dry_run), now)?;
        if let Some(folder) = Folder::of(place) {
            folder.remove_leftovers(now, limits.dry_run)?;
        }
        Ok(report)
    }

    /// Checks every file of a level, by its number, and removes what is damaged: entries, blobs, pins, names, the index
    /// and stamps of this machine, and whatever lies in the place of one and is no file, which is moved aside.
    pub fn verify(&self, level: usize) -> Result<CleanReport, StoreError> {
        let place = self.level(level)?;
        let mut report = CleanReport::default();
        for (kind, what) in [
            (Kind::Entry, Some(Removed::Entry)),
            (Kind::Blob, Some(Removed::Blob)),
            (Kind::Pin, None),
            (Kind::Name, None),
        ] {
            for item in place.list(kind)? {
                let bytes = match place.read(kind, &item.hash) {
                    Ok(Some(bytes)) => bytes,
                    Ok(None) | Err(Trouble::File(_)) => continue,
                    Err(Trouble::Level(error)) => return Err(error),
                };
                match flaw(kind, &item, &bytes) {
                    None => {}
                    Some(Flaw::Foreign(_)) => report.foreign += 1,
                    Some(Flaw::Damaged(_)) => {
                        report.remove((place, kind), &item, false, what);
                        report.damaged.push(item.path);
                    }
                }
            }
        }
        if let Some(folder) = Folder::of(place) {
            folder.verify_rest(&mut report)?;
        }
        Ok(report)
    }

    /// Removes everything from a level that is a folder, by its number. Refuses one that does not say that it is a
    /// cache.
    pub fn clear(&self, level: usize) -> Result<CleanReport, StoreError> {
        let name = || self.level_spec(level).name();
        let no_folder = || StoreError::Level { level: name(), reason: "only a folder can be cleared".into() };
        let folder = Folder::of(self.level(level)?).ok_or_else(no_folder)?;
        if !seal::is_plain(&folder.root().join(TAG_FILE)) {
            return Err(StoreError::NotACache(folder.root().to_path_buf()));
        }
        let stat = self.stat(level)?;
        for path in [LAYOUT].into_iter().chain(EARLIER).map(|name| folder.root().join(name)) {
            if fs::symlink_metadata(&path).is_ok_and(|meta| meta.is_dir()) {
                fs::remove_dir_all(&path).map_err(StoreError::io("remove", &path))?;
            }
        }
        Folder::open(folder.root(), false)?;
        Ok(CleanReport { entries: stat.entries, blobs: stat.blobs, bytes: stat.bytes, ..CleanReport::default() })
    }
}

/// Removes entries that are too old or too many, and the blobs that are named no more.
fn collect(
    place: &dyn Place,
    limits: GcLimits,
    pinned: &BTreeSet<[u8; 32]>,
    now: SystemTime,
) -> Result<CleanReport, StoreError> {
    let old = |item: &Item, age: Duration| now.duration_since(item.modified).is_ok_and(|a| a >= age);
    let mut entries = place.list(Kind::Entry)?;
    entries.sort_by(|a, b| (a.modified, a.hash.as_bytes()).cmp(&(b.modified, b.hash.as_bytes())));
    let blobs: BTreeMap<[u8; 32], Item> =
        place.list(Kind::Blob)?.into_iter().map(|blob| (*blob.hash.as_bytes(), blob)).collect();
    let contents: Vec<Named> = entries.iter().map(|entry| named_by(place, entry)).collect();
    let mut users: BTreeMap<[u8; 32], u64> = BTreeMap::new();
    for content in contents.iter().filter_map(Named::blob) {
        *users.entry(content).or_default() += 1;
    }
    let mut total: u64 = entries.iter().chain(blobs.values()).map(|item| item.bytes).sum();
    let mut report = CleanReport::default();
    for (entry, content) in entries.iter().zip(&contents) {
        let too_old = limits.max_age.is_some_and(|age| old(entry, age));
        if !too_old && limits.max_bytes.is_none_or(|max| total <= max) {
            continue;
        }
        if pinned.contains(entry.hash.as_bytes()) {
            report.pinned += 1;
            continue;
        }
        total -= report.remove((place, Kind::Entry), entry, limits.dry_run, Some(Removed::Entry));
        if let Some(content) = content.blob()
            && let Some(count) = users.get_mut(&content)
        {
            *count -= 1;
            if let (0, Some(blob)) = (*count, blobs.get(&content)) {
                total -= report.remove((place, Kind::Blob), blob, limits.dry_run, Some(Removed::Blob));
            }
        }
    }
    // What another version's entries name is not known, so that no blob is known to be unnamed.
    let unknown = contents.iter().any(|content| matches!(content, Named::Unknown));
    for (content, blob) in blobs.iter().filter(|_| !unknown) {
        if !users.contains_key(content) && old(blob, GRACE) {
            report.remove((place, Kind::Blob), blob, limits.dry_run, Some(Removed::Blob));
        }
    }
    Ok(report)
}

impl Folder {
    /// Checks what only folders have: stamps and indices, and what is no file in the place of one.
    fn verify_rest(&self, report: &mut CleanReport) -> Result<(), StoreError> {
        for (path, _) in files(&self.folder("stat"))? {
            // Beside a stamp lies the record that the next run puts in place, plain text.
            let name = path.file_name().unwrap_or_default();
            let is_sealed = path.extension().is_none_or(|ending| ending != "ron");
            let opened = |bytes: Vec<u8>| seal::open(name.as_encoded_bytes(), &bytes).err();
            match fs::read(&path).ok().filter(|_| is_sealed).and_then(opened) {
                None => {}
                Some(seal::SealError::Foreign) => report.foreign += 1,
                Some(_) => report.discard(path),
            }
        }
        for path in self.intruders()? {
            // A link or pipe goes; what a folder holds may be somebody's.
            if fs::symlink_metadata(&path).is_ok_and(|meta| meta.is_dir()) {
                self.move_aside(&path).map_err(StoreError::io("move aside", &path))?;
            }
            report.discard(path);
        }
        Ok(())
    }

    /// What is no plain file in the place of a file, or no folder in the place of a shard.
    fn intruders(&self) -> Result<Vec<PathBuf>, StoreError> {
        let mut found = Vec::new();
        for kind in Kind::ALL {
            let Ok(shards) = fs::read_dir(self.folder(kind.folder())) else { continue };
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

    /// Removes a file and counts it; returns the bytes freed. A file that cannot be removed frees nothing.
    fn remove(&mut self, (place, kind): (&dyn Place, Kind), item: &Item, dry_run: bool, what: Option<Removed>) -> u64 {
        if !dry_run && place.remove(kind, &item.hash).is_err() {
            return 0;
        }
        match what {
            Some(Removed::Entry) => self.entries += 1,
            Some(Removed::Blob) => self.blobs += 1,
            None => return 0,
        }
        self.bytes += item.bytes;
        item.bytes
    }
}

/// What is wrong with a file.
fn flaw(kind: Kind, item: &Item, bytes: &[u8]) -> Option<Flaw> {
    match kind {
        Kind::Entry => Entry::decode(&item.hash, bytes).err().map(|error| error.flaw()),
        Kind::Blob => verified(bytes, &item.hash).err(),
        Kind::Name | Kind::Pin => match seal::open(item.hash.as_bytes(), bytes) {
            Ok(_) => None,
            Err(error @ seal::SealError::Foreign) => Some(Flaw::Foreign(error.to_string())),
            Err(error) => Some(Flaw::Damaged(error.to_string())),
        },
    }
}

/// The blob that an entry names.
enum Named {
    Blob([u8; 32]),
    Nothing,
    /// It is of another version, or cannot be read.
    Unknown,
}

impl Named {
    fn blob(&self) -> Option<[u8; 32]> {
        match self {
            Self::Blob(content) => Some(*content),
            Self::Nothing | Self::Unknown => None,
        }
    }
}

fn named_by(place: &dyn Place, item: &Item) -> Named {
    let bytes = match place.read(Kind::Entry, &item.hash) {
        Ok(Some(bytes)) => bytes,
        Ok(None) => return Named::Nothing,
        Err(_) => return Named::Unknown,
    };
    match Entry::decode(&item.hash, &bytes) {
        Ok(entry) => entry.content().map_or(Named::Nothing, |content| Named::Blob(*content.as_bytes())),
        Err(error) => match error.flaw() {
            Flaw::Damaged(_) => Named::Nothing,
            Flaw::Foreign(_) => Named::Unknown,
        },
    }
}
