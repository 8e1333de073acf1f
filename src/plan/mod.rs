//! From a recipe and a catalog to a graph of tasks, checked before anything runs.
//!
//! A task's identity is what it does and to what, never who asked for it: the cases of a sweep share one graph, and
//! what they have in common is one node. Outputs and gates hang on the nodes per case.

mod bind;
mod build;
mod case;
pub mod columns;
pub mod draw;
mod gates;
pub mod goal;
pub mod key;
mod limits;
pub mod merge;
mod outputs;
pub mod sweep;
pub mod task;
#[cfg(test)]
mod tests;
#[cfg(test)]
mod toy;
mod wire;

use std::collections::BTreeMap;
use std::path::PathBuf;

use petgraph::Direction;
use petgraph::graph::DiGraph;
use petgraph::visit::EdgeRef;

use crate::metric::registry::MetricDef;

pub use bind::LOCK_KEYS;
pub use build::{plan, plan_cases};
pub use case::{CaseSpec, Context};
pub use columns::{COLUMN_KEYS, ColumnRequest};
pub use gates::{CHECK_KEYS, CRITERIA, CRITERIA_KEYS};
pub use key::{Change, ContentHash, Key, Record, task_key, task_record};
pub use limits::{LIMIT_KEYS, LIMITS_KEYS, TaskLimits};
pub use merge::PlanBuilder;
pub use outputs::{ELEMENTS, METRIC_ENDINGS, OUTPUT_KEYS};
pub use task::{GateTask, SourceTask, StepTask, Task, TaskId};

/// Position of a case in [`Plan::cases`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct CaseId(pub u32);

/// A node of the graph.
#[derive(Clone, Debug)]
pub struct Node {
    /// What it is called in the first case that wants it: `fe`, `fe.hierarchy`, a file, `gate fe`.
    pub label: String,
    /// What it does.
    pub task: Task,
    /// What it may take; no part of its key.
    pub limits: TaskLimits,
}

/// One run of the recipe with its own parameters; a plain run has one case, a sweep has many.
#[derive(Clone, Debug, Default)]
pub struct Case {
    /// Folder of its outputs below `--out`; empty for a plain run.
    pub name: String,
    /// The values that the parameters have, as they would be written.
    pub params: BTreeMap<String, String>,
    /// The task behind `STEP` (its main output) and `STEP.OUTPUT`, for those in use.
    pub steps: BTreeMap<String, TaskId>,
    /// Files to write.
    pub outputs: Vec<Output>,
    /// Gates, in the order of the step names.
    pub gates: Vec<Gate>,
    /// Paths of the input files by name.
    pub inputs: BTreeMap<String, String>,
    /// What is measured of the case, in the order asked for; empty for a plain run.
    pub columns: Vec<Column>,
    /// The task whose mesh is the result, as the recipe names its step.
    pub result: Option<(String, TaskId)>,
}

/// A metric that is measured of a case.
#[derive(Clone, Debug)]
pub struct Column {
    /// `STEP.METRIC`, and what it is compared with where that was said.
    pub name: String,
    /// The step as the recipe names it.
    pub step: String,
    /// The metric.
    pub metric: &'static MetricDef,
    /// The task that measures it: a gate of one check.
    pub task: TaskId,
}

/// A file to write.
#[derive(Clone, Debug, PartialEq)]
pub struct Output {
    /// The step as the recipe names it.
    pub step: String,
    /// The task whose artifact is written.
    pub task: TaskId,
    /// Relative to the case's folder; never leaves it.
    pub file: PathBuf,
    /// How it is written.
    pub options: OutputOptions,
}

/// How an output file is written; what a format does not know about, it ignores.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct OutputOptions {
    /// Shell element: `S3`, `S4`, `S6`, `S8R`.
    pub element: Option<String>,
    /// The task on whose surface mid-side nodes are placed.
    pub midside_on: Option<TaskId>,
    /// Binary or text, where the format has both.
    pub binary: Option<bool>,
    /// Significant digits of coordinates in text.
    pub precision: Option<u32>,
    /// First node and element number.
    pub first_id: Option<u64>,
}

/// A gate of a case.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Gate {
    /// The step as the recipe names it.
    pub step: String,
    /// The task whose artifact must pass.
    pub target: TaskId,
    /// The gate tasks; all must pass.
    pub tasks: Vec<TaskId>,
}

/// Tasks and how they depend on each other.
#[derive(Clone, Debug, Default)]
pub struct Plan {
    graph: DiGraph<Node, &'static str, u32>,
    cases: Vec<Case>,
}

impl Plan {
    /// Number of tasks.
    pub fn len(&self) -> usize {
        self.graph.node_count()
    }

    /// Whether there is nothing to do.
    pub fn is_empty(&self) -> bool {
        self.graph.node_count() == 0
    }

    /// The task.
    pub fn node(&self, id: TaskId) -> &Node {
        &self.graph[id]
    }

    /// All tasks, each after its inputs. A node is added after its inputs, so the order of addition will do.
    pub fn order(&self) -> impl DoubleEndedIterator<Item = TaskId> + ExactSizeIterator + use<> {
        (0..self.graph.node_count() as u32).map(TaskId::from)
    }

    /// The inputs of a task, by input name.
    pub fn inputs(&self, id: TaskId) -> Vec<(&'static str, TaskId)> {
        let mut inputs: Vec<_> =
            self.graph.edges_directed(id, Direction::Incoming).map(|edge| (*edge.weight(), edge.source())).collect();
        inputs.sort_unstable();
        inputs
    }

    /// The tasks that use this one, each once, in order.
    pub fn consumers(&self, id: TaskId) -> Vec<TaskId> {
        let mut consumers: Vec<_> = self.graph.neighbors_directed(id, Direction::Outgoing).collect();
        consumers.sort_unstable();
        consumers.dedup();
        consumers
    }

    /// The cases.
    pub fn cases(&self) -> &[Case] {
        &self.cases
    }

    /// The graph itself.
    pub fn graph(&self) -> &DiGraph<Node, &'static str, u32> {
        &self.graph
    }
}

/// The name of a step or task within all cases: `STEP`, or `CASE/STEP` in a sweep.
pub fn in_case(case: &str, step: &str) -> String {
    if case.is_empty() { step.to_owned() } else { format!("{case}/{step}") }
}
