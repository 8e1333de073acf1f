//! Adds tasks to a plan so that equal ones are one node.
//!
//! The identity of a task is the hash of its fields and of the identities of its inputs: the same walk as the key, with
//! identities in the place of contents. Two steps of a recipe, or of two cases, that would do the same to the same
//! input are found equal however they are called.

use std::collections::BTreeMap;
use std::path::Path;

use super::key::{ContentHash, task_key};
use super::task::{GateTask, SourceTask, StepTask, Task, TaskId};
use super::{Case, CaseId, Node, Plan};
use crate::recipe::normalize;

/// Collects tasks and cases.
#[derive(Debug, Default)]
pub struct PlanBuilder {
    plan: Plan,
    by_identity: BTreeMap<[u8; 32], TaskId>,
    identities: Vec<ContentHash>,
}

impl PlanBuilder {
    /// The node of a file; two spellings of one path are one node.
    pub fn source(&mut self, path: &Path) -> TaskId {
        let path = normalize(path);
        let identity = blake3::hash(path.as_os_str().as_encoded_bytes());
        let label = path.display().to_string();
        self.node(identity, label, Task::Source(SourceTask { path }), &[])
    }

    /// The node of a step's output.
    pub fn step(&mut self, label: &str, task: StepTask, inputs: &[(&'static str, TaskId)]) -> TaskId {
        self.task(label, Task::Step(task), inputs)
    }

    /// The node of a gate; its inputs are `target` and perhaps `reference`.
    pub fn gate(&mut self, label: &str, task: GateTask, inputs: &[(&'static str, TaskId)]) -> TaskId {
        self.task(label, Task::Gate(task), inputs)
    }

    fn task(&mut self, label: &str, task: Task, inputs: &[(&'static str, TaskId)]) -> TaskId {
        let contents: Vec<_> = inputs.iter().map(|(name, id)| (*name, self.identities[id.index()])).collect();
        let identity = task_key(&task, 0, &contents);
        self.node(identity, label.to_owned(), task, inputs)
    }

    fn node(&mut self, identity: ContentHash, label: String, task: Task, inputs: &[(&'static str, TaskId)]) -> TaskId {
        if let Some(known) = self.by_identity.get(identity.as_bytes()) {
            return *known;
        }
        let id = self.plan.graph.add_node(Node { label, task });
        for (name, input) in inputs {
            self.plan.graph.add_edge(*input, id, *name);
        }
        self.by_identity.insert(*identity.as_bytes(), id);
        self.identities.push(identity);
        id
    }

    /// Adds a case; its tasks come from this builder.
    pub fn case(&mut self, case: Case) -> CaseId {
        self.plan.cases.push(case);
        CaseId(self.plan.cases.len() as u32 - 1)
    }

    /// The plan.
    pub fn finish(self) -> Plan {
        self.plan
    }
}
