//! What a run does one by one, and how each of it ends.

use serde::{Deserialize, Serialize};

use super::shared::NoArtifact;
use super::{FileState, RunError};
use crate::plan::{ContentHash, TaskId};
use crate::step::StepFailure;
use crate::store::Entry;

/// What a node of a run does.
#[derive(Clone, Copy, Debug)]
pub(super) enum Node {
    /// A task of the plan.
    Task(TaskId),
    /// An output file: case and position in the case.
    File(usize, usize),
    /// The elements at fault of a gate: case and position in the case.
    Faults(usize, usize),
}

/// How a job ended.
pub(super) enum Finished {
    /// The task's result is stored.
    Task(Box<Entry>),
    /// The file is right.
    File(FileState, ContentHash, FileNotes),
    /// There is nothing to write.
    Nothing,
    /// The artifact of this input is gone: make it again, then run this job again.
    Lost(TaskId),
    /// It seemed to take more memory than its limit beside others: run it alone.
    Crowded,
    /// It cannot be done.
    Failed(StepFailure),
    /// The disk failed; the whole run ends.
    Broken(RunError),
}

impl From<NoArtifact> for Finished {
    fn from(reason: NoArtifact) -> Self {
        match reason {
            NoArtifact::Lost(task) => Self::Lost(task),
            NoArtifact::Failed(failure) => Self::Failed(failure),
        }
    }
}

impl<E: Into<RunError>> From<E> for Finished {
    fn from(error: E) -> Self {
        Self::Broken(error.into())
    }
}

/// What there is to say of a file.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct FileNotes {
    /// What the mesh has and the file has not.
    pub lost: Vec<String>,
    /// What else: how it was written and why, by how much rounding moved it.
    pub note: Option<String>,
}
