//! Stamps of whole runs: the files that a run read and wrote, by their stat, and what it said.
//!
//! While every file of a stamp is as it was, the run would do nothing and say the same, so a recipe of ten thousand
//! tasks that is up to date costs one small file and a stat a file. A stamp is a short cut and never a source: whatever
//! is not exactly as it was is looked at task by task.
//!
//! What a run reads is seen before it is read ([`Seen`]), and is in the stamp only where it is still the same at the
//! end: a file that was replaced while the run went on belongs to no stamp, and the next run looks at it.
//!
//! As in the index of file hashes, a file that was modified just before its stat was taken is not trusted, since it may
//! have changed again within the resolution of its clock: twenty milliseconds where times have fractions of a second,
//! two seconds where they have none.
//!
//! What cannot be seen: a change that leaves size, times of modification and change, device and inode as they were. A
//! file that is written through a memory map and not yet synchronised is such a one, and so is one on a network file
//! system whose attributes are cached here; for these, `--force` a step, or touch the file.

use std::fs;
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use blake3::Hash;
use serde::{Deserialize, Serialize};

use super::stat_index::{Stat, host, stat};
use super::{Store, seal};

/// A file modified so shortly before is waited for.
const FINE: Duration = Duration::from_millis(20);
/// File systems without fractions of a second.
const COARSE: Duration = Duration::from_secs(2);
/// More stamps than this are forgotten, the oldest first.
const MOST: usize = 500;

/// What a run said that would do nothing now.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Said {
    /// On the standard output.
    pub out: String,
    /// On the standard error.
    pub err: Vec<String>,
    /// Its exit code.
    pub exit: u8,
}

#[derive(Serialize, Deserialize)]
struct Stamp {
    files: Vec<(PathBuf, Stat)>,
    said: Said,
    /// The record of the run, which tells what the last run did; and a file of the store that the next run puts in
    /// its place, for it will have done nothing.
    #[serde(default)]
    record: Option<Record>,
}

/// The record of a run, as it is and as the next run leaves it.
#[derive(Serialize, Deserialize)]
struct Record {
    path: PathBuf,
    now: Stat,
    next: PathBuf,
    then: Stat,
}

impl Record {
    /// Puts the next record in place, where that has not been done. False where neither is there.
    fn advance(&self) -> bool {
        // Being renamed changes a file's time of change.
        let is = |path: &Path, known: Stat| fs::metadata(path).is_ok_and(|meta| stat(&meta).is_renamed(known));
        if is(&self.path, self.then) {
            return true;
        }
        // Between two file systems this fails; then the run looks at every task and writes the record itself.
        is(&self.path, self.now) && is(&self.next, self.then) && fs::rename(&self.next, &self.path).is_ok()
    }
}

impl Store {
    /// What the run of this identity said, if all that it read and wrote is as it was. The first time it writes the
    /// record of a run that did nothing.
    pub fn unchanged(&self, identity: &Hash) -> Option<Said> {
        let bytes = seal::read(&self.stamp_file(identity)).ok()?;
        let stamp: Stamp = serde_json::from_slice(seal::open(stamp_name(identity).as_bytes(), &bytes).ok()?).ok()?;
        let same = |(path, known): &(PathBuf, Stat)| fs::metadata(path).is_ok_and(|meta| stat(&meta) == *known);
        if !stamp.files.iter().all(same) {
            return None;
        }
        stamp.record.is_none_or(|record| record.advance()).then_some(stamp.said)
    }

    /// Remembers a run by the files that it read and wrote, and its record with the text that the next run puts there.
    /// Does nothing where a file cannot be trusted; failing to write costs time later and nothing else.
    pub fn stamp(
        &self,
        identity: &Hash,
        (read, written): (Vec<Seen>, Vec<PathBuf>),
        said: Said,
        record: Option<(PathBuf, String)>,
    ) {
        let path = self.stamp_file(identity);
        let next = path.with_extension("ron");
        let record = record.map(|(place, text)| {
            self.home.write_whole(&next, text.as_bytes()).ok()?;
            let known = |path: &Path| fs::metadata(path).ok().map(|meta| stat(&meta));
            let path = std::path::absolute(place).ok()?;
            Some(Record { now: known(&path)?, path, then: known(&next)?, next: next.clone() })
        });
        let (Some(mut files), Some(record)) = (trusted(written), record.map_or(Some(None), |record| record.map(Some)))
        else {
            return;
        };
        let read: Option<Vec<_>> = read.into_iter().map(Seen::still).collect();
        let Some(read) = read else { return };
        files.extend(read);
        if let Ok(bytes) = serde_json::to_vec(&Stamp { files, said, record })
            && let Err(error) = self.home.write_whole(&path, &seal::seal(stamp_name(identity).as_bytes(), &bytes))
        {
            tracing::warn!(%error, "the stamp of the run was not saved");
        }
        self.forget_old_stamps();
    }

    fn stamp_file(&self, identity: &Hash) -> PathBuf {
        self.home.folder("stat").join(stamp_name(identity))
    }

    fn forget_old_stamps(&self) {
        let Ok(entries) = fs::read_dir(self.home.folder("stat")) else { return };
        let prefix = prefix();
        let stamps =
            entries.filter_map(Result::ok).filter(|entry| entry.file_name().to_string_lossy().starts_with(&prefix));
        let mut stamps: Vec<(SystemTime, PathBuf)> =
            stamps.filter_map(|entry| Some((entry.metadata().ok()?.modified().ok()?, entry.path()))).collect();
        if stamps.len() > MOST {
            stamps.sort();
            stamps.iter().take(stamps.len() - MOST).for_each(|(_, path)| drop(fs::remove_file(path)));
        }
    }
}

/// The name of a stamp's file, for which it is sealed.
fn stamp_name(identity: &Hash) -> String {
    format!("{}{}", prefix(), &identity.to_hex()[..32])
}

fn prefix() -> String {
    format!("{}-run-", host())
}

/// A file as it was before it was read.
#[derive(Clone, Debug)]
pub struct Seen(Option<(PathBuf, Stat)>);

impl Seen {
    /// Looks at a file that will be read after this. One that was modified just now is waited for, at most twenty
    /// milliseconds, so that what is read later is what its stat says. Where `text` was read already, the file counts
    /// only if it holds just that.
    pub fn of(path: &Path, text: Option<&[u8]>) -> Self {
        let seen = trusted(vec![path.to_path_buf()]).and_then(|mut files| files.pop());
        Self(seen.filter(|(path, _)| text.is_none_or(|text| fs::read(path).is_ok_and(|bytes| bytes == text))))
    }

    /// The file with its stat, where it is still as it was seen.
    fn still(self) -> Option<(PathBuf, Stat)> {
        self.0.filter(|(path, known)| fs::metadata(path).is_ok_and(|meta| stat(&meta) == *known))
    }
}

/// The files with their stats, when each is old enough; a little is waited for.
fn trusted(files: Vec<PathBuf>) -> Option<Vec<(PathBuf, Stat)>> {
    let begin = SystemTime::now();
    let mut found = Vec::with_capacity(files.len());
    let mut wait = Duration::ZERO;
    for path in files {
        let path = std::path::absolute(&path).ok()?;
        let meta = fs::metadata(&path).ok()?;
        let known = stat(&meta);
        let age = known.age(begin);
        if known.has_fractions() {
            wait = wait.max(FINE.saturating_sub(age));
        } else if age <= COARSE {
            return None;
        }
        found.push((path, known));
    }
    if wait > Duration::ZERO {
        std::thread::sleep(wait);
        // Who wrote meanwhile may have done so within one tick of the clock.
        let same = |(path, known): &(PathBuf, Stat)| fs::metadata(path).is_ok_and(|meta| stat(&meta) == *known);
        return found.iter().all(same).then_some(found);
    }
    Some(found)
}

/// The hash of everything that decides which run is meant, besides the contents of files.
pub fn identity(parts: &[&[u8]]) -> Hash {
    let mut hasher = blake3::Hasher::new();
    for part in parts {
        hasher.update(&(part.len() as u64).to_le_bytes());
        hasher.update(part);
    }
    hasher.finalize()
}

/// What tells this program from another build of the same version.
pub fn program() -> Vec<u8> {
    let path = std::env::current_exe().unwrap_or_default();
    let known = |path: &Path| fs::metadata(path).ok().map(|meta| stat(&meta));
    format!("{} {:?}", path.display(), known(&path)).into_bytes()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seen(path: &Path) -> Vec<Seen> {
        vec![Seen::of(path, None)]
    }

    #[test]
    fn a_file_replaced_after_it_was_seen_is_in_no_stamp() {
        let folder = tempfile::tempdir().unwrap();
        let store = Store::open(&folder.path().join("cache")).unwrap();
        let file = folder.path().join("part.stl");
        fs::write(&file, "old").unwrap();
        let before = seen(&file);
        fs::write(&file, "new").unwrap();
        let id = identity(&[b"run"]);
        store.stamp(&id, (before, Vec::new()), Said::default(), None);
        assert_eq!(store.unchanged(&id), None);
        store.stamp(&id, (vec![Seen::of(&file, Some(b"old"))], Vec::new()), Said::default(), None);
        assert_eq!(store.unchanged(&id), None, "a text that the file does not hold was trusted");
        store.stamp(&id, (vec![Seen::of(&file, Some(b"new"))], Vec::new()), Said::default(), None);
        assert_eq!(store.unchanged(&id), Some(Said::default()));
    }

    #[test]
    fn what_is_seen_is_older_than_a_tick_of_its_clock() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("part.stl");
        for text in ["one", "two", "six"] {
            fs::write(&file, text).unwrap();
            let Seen(known) = Seen::of(&file, None);
            // Who writes after this, writes at another time.
            if let Some((_, known)) = known {
                assert!(known.age(SystemTime::now()) >= FINE || !known.has_fractions());
            }
        }
    }

    #[test]
    fn a_stamp_holds_until_a_file_changes() {
        let folder = tempfile::tempdir().unwrap();
        let store = Store::open(&folder.path().join("cache")).unwrap();
        let (a, b) = (folder.path().join("a"), folder.path().join("b"));
        fs::write(&a, "1").unwrap();
        fs::write(&b, "2").unwrap();
        let said = Said { out: "done".to_owned(), ..Said::default() };
        let id = identity(&[b"run"]);
        assert_ne!(id, identity(&[b"ru", b"n"]));
        store.stamp(&id, (seen(&a), vec![b.clone()]), said.clone(), None);
        assert_eq!(store.unchanged(&id), Some(said.clone()));
        assert_eq!(store.unchanged(&identity(&[b"other"])), None);
        fs::write(&b, "3").unwrap();
        assert_eq!(store.unchanged(&id), None);
        store.stamp(&id, (seen(&a), vec![b]), said.clone(), None);
        assert_eq!(store.unchanged(&id).as_ref(), Some(&said));
        fs::remove_file(&a).unwrap();
        assert_eq!(store.unchanged(&id), None);
        store.stamp(&id, (seen(&a), Vec::new()), said, None);
        assert_eq!(store.unchanged(&id), None);
    }

    #[test]
    fn the_record_is_replaced_once() {
        let folder = tempfile::tempdir().unwrap();
        let store = Store::open(&folder.path().join("cache")).unwrap();
        let record = folder.path().join("run.ron");
        fs::write(&record, "done").unwrap();
        let id = identity(&[b"run"]);
        store.stamp(&id, (Vec::new(), Vec::new()), Said::default(), Some((record.clone(), "cached".to_owned())));
        for _ in 0..2 {
            assert_eq!(store.unchanged(&id), Some(Said::default()));
            assert_eq!(fs::read_to_string(&record).unwrap(), "cached");
        }
        fs::write(&record, "other").unwrap();
        assert_eq!(store.unchanged(&id), None);
    }

    #[test]
    fn a_file_with_a_coarse_time_is_trusted_when_it_is_old() {
        let folder = tempfile::tempdir().unwrap();
        let store = Store::open(&folder.path().join("cache")).unwrap();
        let file = folder.path().join("a");
        fs::write(&file, "1").unwrap();
        let whole = |ago: u64| {
            let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap().as_secs();
            let time = SystemTime::UNIX_EPOCH + Duration::from_secs(now - ago);
            fs::File::options().append(true).open(&file).unwrap().set_modified(time).unwrap();
        };
        let id = identity(&[b"run"]);
        whole(0);
        store.stamp(&id, (seen(&file), Vec::new()), Said::default(), None);
        // Where the time of change is known, which has fractions, a time of modification without them says enough.
        assert_eq!(store.unchanged(&id), cfg!(unix).then(Said::default));
        whole(10);
        store.stamp(&id, (seen(&file), Vec::new()), Said::default(), None);
        assert_eq!(store.unchanged(&id), Some(Said::default()));
    }
}
