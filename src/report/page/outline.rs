//! Which meshes a page shows, and what they are compared with.

use std::collections::BTreeMap;

use super::PageError;
use super::front::{front, mesh_name};
use crate::report::sweep::{SweepRow, SweepTable};
use crate::report::{CaseReport, StepReport};

/// The plan of a page.
pub(super) struct Outline {
    /// Steps whose meshes are shown, in the order of the run.
    pub(super) shown: Vec<String>,
    /// The two that the viewer begins with.
    pub(super) pair: [String; 2],
    /// The step that distances are measured to.
    pub(super) reference: Option<String>,
    /// The step that the result comes from.
    pub(super) result: Option<String>,
    /// Results of the cases of a sweep, which are shown instead of the steps.
    pub(super) cases: Vec<CaseMesh>,
    /// The mesh that a step began with.
    pub(super) previous: BTreeMap<String, String>,
}

/// The result of a case of a sweep.
#[derive(Clone, Debug)]
pub(super) struct CaseMesh {
    /// `CASE/STEP`.
    pub(super) name: String,
    /// The content hash.
    pub(super) content: String,
}

/// Whether a step gave a mesh that can be drawn.
pub(super) fn has_mesh(step: &StepReport) -> bool {
    let port = step.figures.as_ref().map(|figures| figures.port.as_str());
    step.content.is_some() && matches!(port, Some("soup" | "surface" | "quads"))
}

impl Outline {
    pub(super) fn new(case: &CaseReport, wanted: &[String]) -> Result<Self, PageError> {
        let all: Vec<&str> = case.steps.iter().filter(|step| has_mesh(step)).map(|step| step.name.as_str()).collect();
        if let Some(name) = wanted.iter().find(|name| !all.contains(&name.as_str())) {
            let known = all.iter().map(ToString::to_string).collect();
            return Err(PageError::UnknownStep { name: name.clone(), known });
        }
        let is_shown = |name: &&&str| wanted.is_empty() || wanted.iter().any(|wanted| wanted == **name);
        let shown: Vec<String> = all.iter().filter(is_shown).map(ToString::to_string).collect();
        let reference = reference(case, &all);
        let result = result(case, &all);
        let first = wanted.first().or(reference.as_ref()).or(shown.first()).cloned().unwrap_or_default();
        let second = wanted.get(1).or(result.as_ref().filter(|_| wanted.is_empty())).or(shown.last()).cloned();
        let second = second.unwrap_or_default();
        let other = shown.iter().find(|name| **name != second).filter(|_| first == second && wanted.len() < 2);
        let pair = [other.cloned().unwrap_or(first), second];
        Ok(Self { pair, shown, reference, result, previous: previous(case, &all), cases: Vec::new() })
    }
}

impl Outline {
    /// Shows the results of a sweep's cases beside the reference, unless steps were asked for.
    pub(super) fn show_cases(&mut self, table: &SweepTable, wanted: &[String]) {
        let mesh = |row: &SweepRow| Some(CaseMesh { name: mesh_name(row)?, content: row.content.clone()? });
        self.cases = table.rows.iter().filter_map(mesh).collect();
        if !wanted.is_empty() || self.cases.is_empty() {
            return;
        }
        self.shown = self.reference.iter().cloned().chain(self.cases.iter().map(|case| case.name.clone())).collect();
        // The two ends of the front are what one compares first.
        let front: Vec<String> = front(table).into_iter().filter_map(mesh_name).collect();
        let first = front.first().or(self.shown.first()).cloned().unwrap_or_default();
        self.pair = [first, front.last().or(self.shown.last()).cloned().unwrap_or_default()];
    }
}

/// What gates or steps compare with most; of equals the one that comes first. Else the first surface.
fn reference(case: &CaseReport, meshes: &[&str]) -> Option<String> {
    let of_gates = case.gates.iter().flat_map(|gate| gate.references.iter());
    let of_steps = case.steps.iter().filter_map(|step| step.inputs.get("reference"));
    let mut votes = vec![0_usize; meshes.len()];
    for name in of_gates.chain(of_steps) {
        if let Some(position) = meshes.iter().position(|mesh| mesh == name) {
            votes[position] += 1;
        }
    }
    let best = (0..votes.len()).filter(|i| votes[*i] > 0).max_by_key(|i| (votes[*i], std::cmp::Reverse(*i)));
    let is_surface = |step: &&StepReport| has_mesh(step) && step.figures.as_ref().is_some_and(|f| f.port == "surface");
    let first = || case.steps.iter().find(is_surface).map(|step| step.name.clone());
    best.map(|i| meshes[i].to_owned()).or_else(first)
}

/// The step of the first output file, else the last mesh.
fn result(case: &CaseReport, meshes: &[&str]) -> Option<String> {
    let of_file = case.files.iter().map(|file| file.step.as_str()).find(|step| meshes.contains(step));
    of_file.or(meshes.last().copied()).map(str::to_owned)
}

/// The mesh that each step's main input leads to, through steps that give no mesh.
fn previous(case: &CaseReport, meshes: &[&str]) -> BTreeMap<String, String> {
    let main: BTreeMap<&str, &str> =
        case.steps.iter().filter_map(|step| Some((step.name.as_str(), step.inputs.get("from")?.as_str()))).collect();
    let before = |name: &str| {
        let mut at = main.get(name).copied()?;
        for _ in 0..main.len() {
            if meshes.contains(&at) {
                return Some(at.to_owned());
            }
            at = main.get(at).copied()?;
        }
        None
    };
    case.steps.iter().filter_map(|step| Some((step.name.clone(), before(&step.name)?))).collect()
}
