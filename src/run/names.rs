//! Groups that later steps and gates need: looked for before a step works, so that a misspelt name does not cost the
//! hours of the steps before the one that would miss it.

use std::collections::BTreeSet;

use serde_json::Value;

use crate::mesh::Groups;
use crate::plan::{Plan, Task, TaskId};
use crate::recipe::suggest::did_you_mean;
use crate::step::{Artifact, Inputs, StepFailure};

/// More tasks with groups are not looked at: the cases of a sweep name the same ones.
const MOST: usize = 1000;

/// A task that names groups, with all that it is made of.
struct Need {
    task: TaskId,
    /// The key of the recipe and the group.
    names: Vec<(String, String)>,
    above: BTreeSet<TaskId>,
    /// Groups that steps above it make.
    made: BTreeSet<String>,
}

/// Who needs which groups in a plan.
pub(super) struct Needs(Vec<Need>);

impl Needs {
    pub(super) fn of(plan: &Plan) -> Self {
        let need = |task: TaskId| {
            let names = names(&plan.node(task).task);
            if names.is_empty() {
                return None;
            }
            let mut above = BTreeSet::new();
            let mut open = vec![task];
            while let Some(id) = open.pop() {
                open.extend(plan.inputs(id).into_iter().map(|(_, input)| input).filter(|input| above.insert(*input)));
            }
            let makers = above.iter().filter_map(|id| match &plan.node(*id).task {
                Task::Step(step) => Some(step.bound.new_groups()),
                Task::Source(_) | Task::Gate(_) => None,
            });
            let made = makers.flatten().collect();
            Some(Need { task, names, above, made })
        };
        Self(plan.order().filter_map(need).take(MOST).collect())
    }

    /// Fails when a later task needs a group that neither the meshes given to this one have nor a step makes.
    pub(super) fn check(&self, plan: &Plan, id: TaskId, inputs: &Inputs) -> Result<(), StepFailure> {
        let later: Vec<&Need> = self.0.iter().filter(|need| need.above.contains(&id)).collect();
        if later.is_empty() {
            return Ok(());
        }
        let given: Vec<(TaskId, Option<BTreeSet<&str>>)> =
            plan.inputs(id).into_iter().map(|(name, input)| (input, inputs.get(name).and_then(groups))).collect();
        // A file or a record of edits tells nothing about the groups.
        if given.is_empty() || given.iter().any(|(_, groups)| groups.is_none()) {
            return Ok(());
        }
        let known: BTreeSet<&str> = given.iter().filter_map(|(_, groups)| groups.as_ref()).flatten().copied().collect();
        for need in later {
            if !is_only_way(plan, id, need) {
                continue;
            }
            for (key, group) in &need.names {
                if !known.contains(group.as_str()) && !need.made.contains(group) {
                    let made = need.made.iter().map(String::as_str);
                    return Err(missing(&plan.node(need.task).label, key, group, known.iter().copied().chain(made)));
                }
            }
        }
        Ok(())
    }
}

/// Whether all files that a later task is made of come through this one, so that no other mesh brings groups.
fn is_only_way(plan: &Plan, id: TaskId, need: &Need) -> bool {
    let mut own = BTreeSet::new();
    let mut open = vec![id];
    while let Some(id) = open.pop() {
        open.extend(plan.inputs(id).into_iter().map(|(_, input)| input).filter(|input| own.insert(*input)));
    }
    let is_file = |id: &&TaskId| matches!(plan.node(**id).task, Task::Source(_));
    need.above.iter().filter(is_file).all(|file| own.contains(file))
}

fn missing<'a>(user: &str, key: &str, group: &str, known: impl Iterator<Item = &'a str>) -> StepFailure {
    let help = did_you_mean(group, "groups", known).unwrap_or_else(|| "the mesh has no groups".to_owned());
    StepFailure::failed(format!("`{user}` names the group `{group}` in `{key}`, and there is none of this name"))
        .with_help(help)
}

/// The groups that a task names, each with its key.
fn names(task: &Task) -> Vec<(String, String)> {
    match task {
        Task::Source(_) => Vec::new(),
        Task::Gate(gate) => {
            let of = |group: &String| ("except".to_owned(), group.clone());
            gate.checks.iter().flat_map(|check| &check.except).map(of).collect()
        }
        Task::Step(step) => {
            let locks = [("keep", &step.locks.keep), ("on-curve", &step.locks.on_curve), ("only", &step.locks.only)];
            let locked = locks
                .into_iter()
                .flat_map(|(key, groups)| groups.iter().map(move |group| (key.to_owned(), group.clone())));
            let mut names: Vec<(String, String)> = locked.collect();
            if let Value::Object(params) = step.bound.canonical() {
                for (key, value) in &params {
                    let sizes = value.get("groups").filter(|_| value.get("default").is_some());
                    let groups = sizes.and_then(Value::as_object).into_iter().flatten();
                    names.extend(groups.map(|(group, _)| (format!("{key}.groups"), group.clone())));
                }
            }
            names
        }
    }
}

/// The names of an artifact's groups; none where it is no mesh.
fn groups(artifact: &Artifact) -> Option<BTreeSet<&str>> {
    let carried = match artifact {
        Artifact::Soup(soup) => &soup.carried,
        Artifact::Surface(surface) => &surface.carried,
        Artifact::Quads(quads) => &quads.mesh.carried,
        Artifact::File(_) | Artifact::Hierarchy(_) | Artifact::Patches(_) | Artifact::Metrics(_) => return None,
    };
    let Groups { faces, edges, vertices } = &carried.groups;
    Some(faces.keys().chain(edges.keys()).chain(vertices.keys()).map(String::as_str).collect())
}
