//! What a run gave: the state of each task, its key and result, failures, and the files.

use std::path::PathBuf;

use super::node::FileNotes;
use super::state::TaskState;
use crate::metric::gate::GateReport;
use crate::plan::{ContentHash, Key, Plan, TaskId};
use crate::step::{FailureKind, StepFailure};
use crate::store::{Entry, Outcome};

/// What became of a task.
#[derive(Clone, Debug)]
pub struct TaskOutcome {
    /// Its last state.
    pub state: TaskState,
    /// Its key, where its inputs became known. A source has none.
    pub key: Option<Key>,
    /// The content hash of what it gave; for a source, of the file.
    pub content: Option<ContentHash>,
    /// What the store knows of it.
    pub entry: Option<Entry>,
    /// Why it failed.
    pub failure: Option<StepFailure>,
    /// Contents before and now, where a forced step gave something else than before.
    pub differs: Option<(ContentHash, ContentHash)>,
}

impl TaskOutcome {
    pub(super) fn unknown() -> Self {
        Self { state: TaskState::Unknown, key: None, content: None, entry: None, failure: None, differs: None }
    }

    /// The verdicts, where the task is a gate that was decided.
    pub fn gate_report(&self) -> Option<GateReport> {
        match &self.entry.as_ref()?.outcome {
            Outcome::Gate(report) => serde_json::from_value(report.clone()).ok(),
            Outcome::Artifact { .. } | Outcome::Failure(_) | Outcome::File { .. } => None,
        }
    }
}

/// What became of an output file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum FileState {
    /// It was right already.
    Current,
    /// It was written.
    Written,
    /// Not written, because its step or a gate could not be decided, or the run ended.
    #[default]
    Missing,
}

/// An output file.
#[derive(Clone, Debug)]
pub struct FileOutcome {
    /// Position of its case in the plan.
    pub case: usize,
    /// The step as the recipe names it.
    pub step: String,
    /// The task that was written.
    pub task: TaskId,
    /// Where it is, or would be.
    pub path: PathBuf,
    /// What became of it.
    pub state: FileState,
    /// Hash of its bytes.
    pub content: Option<ContentHash>,
    /// Whether it shows what failed a gate, below `failed/`.
    pub failed_gate: bool,
    /// What it does not hold of its mesh, and how it was written.
    pub notes: FileNotes,
    /// Why it could not be made.
    pub failure: Option<StepFailure>,
}

/// What a run gave.
#[derive(Clone, Debug)]
pub struct RunOutcome {
    /// By task.
    pub tasks: Vec<TaskOutcome>,
    /// Output files, in the order of the recipe, and those with elements at fault.
    pub files: Vec<FileOutcome>,
    /// Whether it was interrupted.
    pub cancelled: bool,
    /// Why the cache could not take all of it: the results are right, and the next run computes some of them again.
    pub unsaved: Option<String>,
    /// Seconds from start to end.
    pub seconds: f64,
}

impl RunOutcome {
    /// The outcome of a task.
    pub fn task(&self, id: TaskId) -> &TaskOutcome {
        &self.tasks[id.index()]
    }

    /// Failures of steps and outputs, with the label of what failed.
    pub fn failures<'a>(&'a self, plan: &'a Plan) -> impl Iterator<Item = (String, &'a StepFailure)> {
        let tasks = plan.order().zip(&self.tasks);
        let tasks = tasks.filter_map(|(id, task)| Some((plan.node(id).label.clone(), task.failure.as_ref()?)));
        let files = self.files.iter();
        tasks.chain(files.filter_map(|file| Some((file.path.display().to_string(), file.failure.as_ref()?))))
    }

    /// Whether some gate was decided and did not hold.
    pub fn gate_failed(&self) -> bool {
        self.tasks.iter().filter_map(TaskOutcome::gate_report).any(|report| !report.passed())
    }

    /// Whether a forced step gave something else than before.
    pub fn differs(&self) -> bool {
        self.tasks.iter().any(|task| task.differs.is_some())
    }

    /// Whether an input file was wrong.
    pub fn bad_input(&self) -> bool {
        self.tasks.iter().filter_map(|task| task.failure.as_ref()).any(|f| f.kind == FailureKind::BadInput)
    }

    /// Number of tasks in this state.
    pub fn count(&self, state: TaskState) -> usize {
        self.tasks.iter().filter(|task| task.state == state).count()
    }
}
