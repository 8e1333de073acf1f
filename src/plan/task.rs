//! The tasks of a plan: what is done, independent of which recipe or case asked for it.

use std::fmt;
use std::path::PathBuf;
use std::sync::Arc;

use crate::metric::gate::Check;
use crate::metric::gate::criteria::Criteria;
use crate::step::{BoundStep, Inputs, Locks, Produced, StepDef, StepFailure};
use crate::watch::Watch;

/// A task of a [`Plan`](super::Plan).
pub type TaskId = petgraph::graph::NodeIndex<u32>;

/// What a task does. Equal tasks with equal inputs are one node of the plan, however many cases want them.
#[derive(Clone, Debug)]
pub enum Task {
    /// Reads a file; its content hash is that of the bytes, with those of the files that it includes in place.
    Source(SourceTask),
    /// Runs a step for one of its outputs.
    Step(StepTask),
    /// Checks a mesh against limits.
    Gate(GateTask),
}

/// A file that the recipe reads.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SourceTask {
    /// Where it is, relative to the working directory or absolute.
    pub path: PathBuf,
}

/// One output of one step with its parameters.
#[derive(Clone)]
pub struct StepTask {
    /// The catalog entry.
    pub def: &'static StepDef,
    /// Which output is made.
    pub output: &'static str,
    /// The step with its parameters.
    pub bound: Arc<dyn BoundStep>,
    /// The common keys; at their defaults where the step does not edit.
    pub locks: Locks,
    /// The lower-case ending of each file input, since it decides how the bytes are read.
    pub endings: Vec<(&'static str, String)>,
}

impl StepTask {
    /// Runs the step, or takes the output from the main one where it is a part of that.
    ///
    /// # Errors
    /// Those of the step.
    pub fn run(&self, inputs: &Inputs, watch: &Watch) -> Result<Produced<serde_json::Value>, StepFailure> {
        let output = self.def.outputs.iter().find(|output| output.name == self.output);
        let Some(derive) = output.and_then(|output| output.derive) else {
            return self.bound.run(inputs, self.output, &self.locks, watch);
        };
        let main = self.def.outputs.first().and_then(|main| inputs.get(main.name));
        let artifact = main.and_then(derive);
        let artifact =
            artifact.ok_or_else(|| StepFailure::failed(format!("the main output has no `{}`", self.output)))?;
        Ok(Produced { artifact, stats: serde_json::Value::Null })
    }
}

impl fmt::Debug for StepTask {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("StepTask")
            .field("step", &self.def.name)
            .field("output", &self.output)
            .field("params", &self.bound.canonical())
            .field("locks", &self.locks)
            .finish_non_exhaustive()
    }
}

/// Checks of one mesh that share a reference. Its inputs are `target` and, where a check compares, `reference`.
///
/// A `[gates.STEP]` table becomes one task for the checks that need no other mesh, and one for each mesh compared
/// with, so that a changed threshold repeats no distance that it does not concern.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct GateTask {
    /// What must hold, in the order of the metric names.
    pub checks: Vec<Check>,
    /// The standard that must hold; a task has either checks or criteria.
    pub criteria: Option<Arc<Criteria>>,
}
