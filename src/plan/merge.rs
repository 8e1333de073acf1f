//! Adds tasks to a plan so that equal ones are one node.
//!
//! The identity of a task is the hash of its fields and of the identities of its inputs: the same walk as the key, with
//! identities in the place of contents. Two steps of a recipe, or of two cases, that would do the same to the same
//! input are found equal however they are called.

use std::collections::BTreeMap;
use std::path::Path;

use super::key::{ContentHash, task_key};
use super::limits::TaskLimits;
use super::task::{GateTask, SourceTask, StepTask, Task, TaskId};
use super::{Case, CaseId, Node, Plan, in_case};
use crate::recipe::normalize;

/// Collects tasks and cases.
#[derive(Debug, Default)]
pub struct PlanBuilder {
    plan: Plan,
    by_identity: BTreeMap<[u8; 32], TaskId>,
    identities: Vec<ContentHash>,
    limits: BTreeMap<TaskId, TaskLimits>,
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
        let id = self.plan.graph.add_node(Node { label, task, limits: TaskLimits::default() });
        for (name, input) in inputs {
            self.plan.graph.add_edge(*input, id, *name);
        }
        self.by_identity.insert(*identity.as_bytes(), id);
        self.identities.push(identity);
        id
    }

    /// Says what a task may take. Of several cases the most patient one counts.
    pub fn limit(&mut self, id: TaskId, limits: TaskLimits) {
        self.limits.entry(id).and_modify(|known| *known = known.or_more(limits)).or_insert(limits);
    }

    /// Adds a case; its tasks come from this builder.
    pub fn case(&mut self, case: Case) -> CaseId {
        self.plan.cases.push(case);
        CaseId(self.plan.cases.len() as u32 - 1)
    }

    /// The plan.
    pub fn finish(mut self) -> Plan {
        if self.plan.cases.len() > 1 {
            self.name_cases();
        }
        for (id, limits) in self.limits {
            self.plan.graph[id].limits = limits;
        }
        self.plan
    }

    /// Puts the case before the label of a task that one case only has, so that labels tell cases apart.
    fn name_cases(&mut self) {
        let mut users: Vec<Option<usize>> = vec![None; self.plan.len()];
        let mut shared = vec![false; self.plan.len()];
        for (number, case) in self.plan.cases.iter().enumerate() {
            let steps = case.steps.values().copied();
            let judged = case.gates.iter().flat_map(|gate| gate.tasks.iter().copied());
            for task in steps.chain(judged).chain(case.columns.iter().map(|column| column.task)) {
                let user = users[task.index()].get_or_insert(number);
                shared[task.index()] |= *user != number;
            }
        }
        for (id, user) in self.plan.order().zip(users) {
            if let Some(case) = user.filter(|_| !shared[id.index()]) {
                let label = in_case(&self.plan.cases[case].name, &self.plan.graph[id].label);
                self.plan.graph[id].label = label;
            }
        }
    }
}
