//! From a plan to an outcome: tasks run in parallel, are looked up before they run, and are stored when they are done.
//!
//! A node is a task of the plan, an output file, or the list of elements at fault of a gate. A node is looked at once
//! the contents of all its inputs are known; then its key is known, and the store says whether its result is. Only a
//! node that misses makes its inputs' artifacts be loaded. An artifact is shared by its readers and dropped after the
//! last one.
//!
//! # Invariants
//! - Every change of state goes through `board::Board::set`.
//! - A result is the same for any number of threads: a step sees nothing of the schedule, and what it does in
//!   parallel it reduces in index order.
//! - Files appear whole or not at all. A run that dies leaves finished results in the store and, at most, hidden
//!   temporary files that the next run removes.
//! - An artifact that was cached and cannot be loaded is computed again; if it then differs, that is a failure.
//!
//! # Cost
//! A cached task costs one small read. Among ready nodes the first of the plan runs first, so that the cases of a
//! sweep finish one after the other and few artifacts are alive.

pub mod board;
mod bounded;
mod certify;
mod claim;
mod failed;
mod figures;
mod gate;
mod guard;
mod job;
mod ledger;
mod names;
mod node;
pub mod observe;
pub mod outcome;
mod output;
mod patches;
pub mod preview;
mod queue;
mod schedule;
mod shared;
pub mod source;
mod state;
pub mod study;
mod whole;

use std::collections::BTreeSet;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

pub use claim::{Claim, claim};
pub use guard::{is_inside, replaced};
pub use ledger::Meter;
pub use node::FileNotes;
pub use observe::{Event, Observer, Silent};
pub use outcome::{FileOutcome, FileState, RunOutcome, TaskOutcome};
pub use preview::{Explained, Forecast, explain, preview, records};
pub use schedule::run;
pub use shared::{VERSION, recipe_task};
pub use state::TaskState;

// An outcome speaks of these, so whoever reads outcomes finds them here.
pub use crate::plan::{Case, Change, Column, Gate, Output, Plan, Record, StepTask, Task, TaskId, in_case};
pub use crate::store::{Entry, Figures, Outcome, Peak, StoreError};

/// What the caller decides about a run.
#[derive(Clone, Debug)]
pub struct RunOptions {
    /// Name of the recipe; tasks are called `NAME/STEP` in the store.
    pub name: String,
    /// Folder for the output files.
    pub out: PathBuf,
    /// Most tasks at once, and most threads within them.
    pub jobs: usize,
    /// How much memory tasks may take together, as far as that was recorded of them; a task that takes more runs alone.
    pub memory: Option<u64>,
    /// Measures memory; without it there are no limits and no records of it.
    pub meter: Option<Meter>,
    /// Only these steps and what they need; empty for all.
    pub only: Vec<String>,
    /// Steps that run again although they are cached.
    pub force: Vec<String>,
    /// Whether steps run again whose failure is remembered.
    pub retry_failed: bool,
    /// Files besides the plan's that no output may replace: the recipe, its bases, a lock file.
    pub protected: Vec<PathBuf>,
    /// Becomes true when the run should stop.
    pub cancelled: Arc<AtomicBool>,
}

impl RunOptions {
    /// A run of all steps, nothing forced, that nobody interrupts.
    pub fn new(name: &str, out: PathBuf, jobs: usize) -> Self {
        let (only, force, protected) = (Vec::new(), Vec::new(), Vec::new());
        let (retry_failed, cancelled) = (false, Arc::default());
        let (memory, meter) = (None, None);
        Self { name: name.to_owned(), out, jobs, memory, meter, only, force, retry_failed, protected, cancelled }
    }
}

/// Why a run ended early. Failures of steps and gates are part of the outcome instead.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// The store failed.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// An output could not be written.
    #[error("cannot {action} {}: {source}", path.display())]
    Output {
        /// What was tried.
        action: &'static str,
        /// Where.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// An output is one of the files that the run reads, perhaps by another name.
    #[error("the output {} is the file {}, which the run reads", output.display(), input.display())]
    WouldReplace {
        /// The file to be written.
        output: PathBuf,
        /// The file that is read.
        input: PathBuf,
    },
    /// A folder below that of the outputs is a link.
    #[error("{} is a link, and outputs below it would lie elsewhere", .0.display())]
    Link(PathBuf),
    /// Another run writes into the folder of the outputs.
    #[error("another run writes into {}", .0.display())]
    Claimed(PathBuf),
    /// The threads that were asked for could not be started.
    #[error("cannot start {0} threads: {1}")]
    Threads(usize, String),
}

/// The tasks of these steps, by `STEP` or `STEP.OUTPUT`.
pub(crate) fn tasks_of(plan: &Plan, steps: &[String]) -> BTreeSet<crate::plan::TaskId> {
    let of_step = |name: &str, step: &String| name == step || name.split_once('.').is_some_and(|(s, _)| s == step);
    let mut tasks = BTreeSet::new();
    for case in plan.cases() {
        for (name, task) in &case.steps {
            if steps.iter().any(|step| of_step(name, step)) && matches!(plan.node(*task).task, Task::Step(_)) {
                tasks.insert(*task);
            }
        }
    }
    tasks
}

/// Writes a file below the folder of the outputs: it appears whole or not at all, and a link in its place is replaced.
pub fn write_file(path: &std::path::Path, bytes: &[u8]) -> Result<(), RunError> {
    whole::write(path, bytes).map_err(|source| RunError::Output { action: "write", path: path.to_path_buf(), source })
}

/// The same for a file that the user named: where that is a link, what it leads to is written, and a device or a pipe
/// is written to as it is.
pub fn write_named(path: &std::path::Path, bytes: &[u8]) -> Result<(), RunError> {
    let written = whole::write_named(path, bytes);
    written.map_err(|source| RunError::Output { action: "write", path: path.to_path_buf(), source })
}
