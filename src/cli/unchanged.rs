//! The short cut of a run or sweep in which nothing has changed since the last one.

use std::path::{Path, PathBuf};

use super::Global;
use super::context::RecipeArguments;
use super::exit::{Fault, data, say};
use super::record::record_text;
use crate::report::Report;
use crate::store::Store;
use crate::store::stamp::{Said, Seen, identity, program};

/// Which run is meant: the program, the place, and the arguments that decide what it does and says.
pub(super) struct Unchanged {
    identity: blake3::Hash,
}

impl Unchanged {
    /// `more` are arguments besides the recipe's that decide what the run does or says, each with its name.
    pub(super) fn of(what: &str, recipe: &RecipeArguments, more: &[(&str, Vec<u8>)], global: &Global) -> Self {
        let here = std::env::current_dir().unwrap_or_default();
        let (program, own) = (program(), recipe.identity());
        let mut parts = vec![program.as_slice(), here.as_os_str().as_encoded_bytes(), what.as_bytes()];
        parts.extend(own.iter().map(Vec::as_slice));
        for (name, value) in more {
            parts.extend([name.as_bytes(), value]);
        }
        parts.push(if global.quiet { b"quiet" } else { b"" });
        Self { identity: identity(&parts) }
    }

    /// Says what that run said, and tells its exit code; `None` when anything has changed.
    pub(super) fn repeat(&self, store: &Store) -> Option<u8> {
        let said = store.unchanged(&self.identity)?;
        if !said.out.is_empty() {
            data(&said.out);
        }
        for line in &said.err {
            say(line);
        }
        Some(said.exit)
    }

    /// Remembers a run by the files that it read, as they were before it, and those that it wrote, besides its record,
    /// which the next run replaces by that of a run in which everything was there.
    pub(super) fn remember(
        &self,
        store: &Store,
        (read, written): (Vec<Seen>, Vec<PathBuf>),
        said: Said,
        report: &Report,
        out: &Path,
    ) -> Result<(), Fault> {
        let record = out.join("run.ron");
        let text = record_text(&report.unchanged())?;
        store.stamp(&self.identity, (read, written), said, Some((record, text)));
        Ok(())
    }
}
