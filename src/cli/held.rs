//! A run held against a lock: it must be of what was locked, and give what was locked.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use super::context::{Planned, lock_file};
use super::exit::{Exit, Fault, say};
use crate::report::Report;
use crate::report::lock::{Lock, ingredients};
use crate::run::{self, RunOptions};
use crate::store::Store;

/// Keeps the results that a lock refers to in the cache. They can be made again, so that failing to do so is told and
/// no error.
pub(super) fn pin(lock: &Path, store: &Store, keys: &BTreeSet<String>) {
    if let Err(error) = store.pin(lock, run::VERSION, keys) {
        say(&format!("warning: `cache gc` may remove what {} refers to: {error}", lock.display()));
    }
}

/// A lock that a run is held against.
pub(super) struct Held {
    file: PathBuf,
    lock: Lock,
    now: Lock,
}

impl Held {
    /// Reads the lock, the usual one where `file` is empty, and fails when the run would not be of what was locked.
    pub(super) fn new(file: &Path, planned: &Planned, store: &Store, options: &RunOptions) -> Result<Self, Fault> {
        let file = if file.as_os_str().is_empty() { lock_file(&planned.recipe) } else { file.to_path_buf() };
        let text = fs::read_to_string(&file).map_err(|error| {
            Fault::usage(format!("cannot read the lock {}: {error}", file.display())).help("`meshmill lock` writes one")
        })?;
        let lock = Lock::from_ron(&text)
            .map_err(|error| Fault::usage(format!("{} is not a lock of this version: {error}", file.display())))?;
        let now = ingredients(&planned.recipe.name, &planned.plan, &run::records(&planned.plan, store, options));
        let held = Self { file, lock, now };
        held.differs(held.lock.changed_ingredients(&held.now), "nothing has run")?;
        Ok(held)
    }

    /// Fails when the results are not those that were locked.
    pub(super) fn check(self, report: &Report, out: &Path) -> Result<Self, Fault> {
        let now = self.now.clone().with_results(report, out);
        self.differs(self.lock.changed_results(&now), "the files are those of this run")?;
        Ok(self)
    }

    /// Keeps the results of these keys in the cache as long as the lock is there.
    pub(super) fn pin(&self, store: &Store, keys: &BTreeSet<String>) {
        pin(&self.file, store, keys);
    }

    fn differs(&self, lines: Vec<String>, state: &str) -> Result<(), Fault> {
        if lines.is_empty() {
            return Ok(());
        }
        let shown: Vec<String> = lines.iter().take(60).map(|line| format!("  {line}")).collect();
        let more = if lines.len() > 60 { format!("\n  and {} more", lines.len() - 60) } else { String::new() };
        let message = format!("this is not what {} locked; {state}\n{}{more}", self.file.display(), shown.join("\n"));
        Err(Fault::new(Exit::Locked, message).help("take the change back, or lock anew with `meshmill lock`"))
    }
}
