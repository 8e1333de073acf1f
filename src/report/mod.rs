//! From the outcome of a run to what people and programs read of it.
//!
//! [`Report`] is the one model: `run.ron` is its RON, `--json` its JSON, the terminal shows its tables. Everything that
//! repeats from run to run stands apart from `timings`, which does not.

mod advice;
pub mod bundle;
pub mod diff;
pub mod json;
pub mod junit;
pub mod lock;
pub mod measure;
pub mod page;
pub mod picture;
pub mod record;
pub mod sweep;
pub mod table;

use std::collections::BTreeMap;
use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use crate::metric::Measurement;
use crate::metric::gate::GateRow;
use crate::metric::gate::criteria::CriteriaReport;
pub use crate::run::in_case;
use crate::run::{
    Case, Figures, FileState, Gate, Outcome, Peak, Plan, RunOutcome, Task, TaskId, TaskOutcome, TaskState, VERSION,
};
use crate::step::StepFailure;

/// How a run ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Status {
    /// Everything was made and every gate holds.
    Done,
    /// A forced step gave something else than before: a fault of the program.
    Differs,
    /// An input file is wrong.
    BadInput,
    /// A gate does not hold.
    GateFailed,
    /// A step failed.
    StepFailed,
    /// It was interrupted.
    Cancelled,
}

/// A run, for people and programs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct Report {
    /// Version of the program.
    pub meshmill: String,
    /// Name of the recipe.
    pub recipe: String,
    /// What the recipe is for.
    #[serde(default)]
    pub description: String,
    /// The texts of the recipe, with the names of their files: its own, and those that it extends.
    #[serde(default)]
    pub texts: Vec<(String, String)>,
    /// How the run ended.
    pub status: Status,
    /// The cases, one for a plain run.
    pub cases: Vec<CaseReport>,
    /// Files that were read, by path, with the BLAKE3 hash of their bytes.
    pub inputs: BTreeMap<String, Option<String>>,
    /// States and seconds of this run, by task label; a cached task tells the seconds it once took.
    pub timings: Timings,
}

/// One case of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct CaseReport {
    /// Its name; empty for a plain run.
    pub name: String,
    /// Parameters with their values, as they would be written.
    pub params: BTreeMap<String, String>,
    /// Paths of the input files by the names that the recipe gives them.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub inputs: BTreeMap<String, String>,
    /// Steps, in the order of the graph.
    pub steps: Vec<StepReport>,
    /// Gates, by step.
    pub gates: Vec<GateSection>,
    /// Output files, in the order of the recipe.
    pub files: Vec<FileReport>,
}

/// One step of a case.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct StepReport {
    /// Its name in the recipe, with `.OUTPUT` for a further output.
    pub name: String,
    /// The kind of step.
    pub kind: String,
    /// Its inputs by name: a step of the case, or the path of a file.
    #[serde(default)]
    pub inputs: BTreeMap<String, String>,
    /// Its key in the cache, where it became known.
    pub key: Option<String>,
    /// The hash of its result.
    pub content: Option<String>,
    /// The fields behind its key, so that another run can be compared with it.
    #[serde(default)]
    pub record: Vec<(String, String)>,
    /// Size and quality of its result.
    pub figures: Option<Figures>,
    /// What the step says of its work.
    pub stats: Option<serde_json::Value>,
    /// Why it failed.
    pub failure: Option<StepFailure>,
    /// The hash of its result before, where it was forced and gave another one.
    pub differs_from: Option<String>,
}

/// The checks of one step.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct GateSection {
    /// The step as the recipe names it.
    pub step: String,
    /// The steps that its mesh is compared with.
    #[serde(default)]
    pub references: Vec<String>,
    /// Whether all checks hold; absent where they could not be decided.
    pub passed: Option<bool>,
    /// The checks; criteria are one row each.
    pub rows: Vec<GateRow>,
    /// What stands behind the rows of criteria.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub criteria: Vec<CriteriaReport>,
    /// Why checks could not be decided.
    pub failures: Vec<StepFailure>,
    /// For checks that failed: `METRIC: which step and parameter to turn`.
    #[serde(default)]
    pub advice: Vec<String>,
}

/// An output file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct FileReport {
    /// Where it is.
    pub path: String,
    /// The step that it was written of.
    pub step: String,
    /// Hash of its bytes; absent where it was not written.
    pub content: Option<String>,
    /// Whether it shows a result whose gate failed.
    pub failed_gate: bool,
    /// What the mesh has and the file has not: groups and fields that its format cannot hold, faces lost to rounding.
    #[serde(default)]
    pub lost: Vec<String>,
    /// What else there is to say of it: that it was written as text to keep a gate, by how much rounding moved it.
    #[serde(default)]
    pub note: Option<String>,
    /// Why it could not be written.
    pub failure: Option<StepFailure>,
}

/// What differs from run to run.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct Timings {
    /// Seconds of the run.
    pub total: f64,
    /// State and seconds of each step (`STEP`, or `CASE/STEP` in a sweep) and gate.
    pub tasks: BTreeMap<String, (TaskState, f64)>,
    /// State of each output file.
    pub files: BTreeMap<String, FileState>,
    /// By kind of step, `gate` for gates and metrics, how many tasks ran. Cases of a sweep share tasks, and each is
    /// counted once.
    #[serde(default)]
    pub ran: BTreeMap<String, usize>,
    /// The most memory that each of `tasks` took, where that was measured when it ran.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub memory: BTreeMap<String, Peak>,
}

impl Report {
    /// The report of a run.
    pub fn new(recipe: &str, plan: &Plan, outcome: &RunOutcome) -> Self {
        let mut timings = Timings { total: outcome.seconds, ..Timings::default() };
        let mut inputs = BTreeMap::new();
        for id in plan.order() {
            let (node, task) = (plan.node(id), outcome.task(id));
            match &node.task {
                Task::Source(source) => {
                    let content = task.content.map(|hash| hash.to_hex().to_string());
                    inputs.insert(source.path.display().to_string(), content);
                }
                Task::Step(_) | Task::Gate(_) => timings.count(&node.task, task),
            }
        }
        for case in plan.cases() {
            for (step, task) in &case.steps {
                timings.note(in_case(&case.name, step), outcome.task(*task));
            }
            let gates = case.gates.iter().flat_map(|gate| &gate.tasks);
            for task in gates.copied().chain(case.columns.iter().map(|column| column.task)) {
                let label = &plan.node(task).label;
                let own = label.strip_prefix(&in_case(&case.name, "")).unwrap_or(label);
                timings.note(in_case(&case.name, own), outcome.task(task));
            }
        }
        for file in &outcome.files {
            timings.files.insert(file.path.display().to_string(), file.state);
        }
        let cases = (0..plan.cases().len()).map(|case| CaseReport::new(plan, outcome, case)).collect();
        Self {
            meshmill: VERSION.to_owned(),
            recipe: recipe.to_owned(),
            description: String::new(),
            texts: Vec::new(),
            status: status(outcome),
            cases,
            inputs,
            timings,
        }
    }

    /// The report that a run would give which finds everything as this one left it.
    #[must_use]
    pub fn unchanged(&self) -> Self {
        let mut report = self.clone();
        for (state, _) in report.timings.tasks.values_mut() {
            if *state == TaskState::Done {
                *state = TaskState::Cached;
            }
        }
        for state in report.timings.files.values_mut() {
            if *state == FileState::Written {
                *state = FileState::Current;
            }
        }
        report.timings.ran.clear();
        report
    }

    /// The files that are there after the run, with their pictures.
    pub fn written(&self) -> impl Iterator<Item = PathBuf> + '_ {
        let files = self.cases.iter().flat_map(|case| &case.files);
        let there = files.filter(|file| file.content.is_some()).map(|file| PathBuf::from(&file.path));
        there
            .flat_map(|file| [Some(file.with_extension("png")).filter(|picture| picture.is_file()), Some(file)])
            .flatten()
    }

    /// All failures of a run, with the name of what failed.
    pub fn failures(&self) -> impl Iterator<Item = (&str, &StepFailure)> {
        self.cases.iter().flat_map(|case| {
            let steps = case.steps.iter().filter_map(|step| Some((step.name.as_str(), step.failure.as_ref()?)));
            let gates = case.gates.iter().flat_map(|gate| gate.failures.iter().map(|f| (gate.step.as_str(), f)));
            let files = case.files.iter().filter_map(|file| Some((file.path.as_str(), file.failure.as_ref()?)));
            steps.chain(gates).chain(files)
        })
    }
}

impl Timings {
    fn count(&mut self, task: &Task, outcome: &TaskOutcome) {
        let kind = match task {
            Task::Step(step) => step.def.name,
            Task::Gate(_) => "gate",
            Task::Source(_) => return,
        };
        // A failure that was remembered has an entry.
        let is_known = outcome.state == TaskState::Failed && outcome.entry.is_some();
        if matches!(outcome.state, TaskState::Done | TaskState::Failed) && !is_known {
            *self.ran.entry(kind.to_owned()).or_default() += 1;
        }
    }

    fn note(&mut self, name: String, task: &TaskOutcome) {
        let seconds = task.entry.as_ref().map_or(0.0, |entry| entry.seconds);
        if let Some(peak) = task.entry.as_ref().and_then(|entry| entry.memory) {
            self.memory.insert(name.clone(), peak);
        }
        self.tasks.insert(name, (task.state, seconds));
    }
}

fn status(outcome: &RunOutcome) -> Status {
    let failed = |task: &TaskOutcome| task.state == TaskState::Failed;
    if outcome.cancelled {
        Status::Cancelled
    } else if outcome.bad_input() {
        Status::BadInput
    } else if outcome.tasks.iter().any(failed) || outcome.files.iter().any(|file| file.failure.is_some()) {
        Status::StepFailed
    } else if outcome.gate_failed() {
        Status::GateFailed
    } else if outcome.differs() {
        Status::Differs
    } else {
        Status::Done
    }
}

impl CaseReport {
    fn new(plan: &Plan, outcome: &RunOutcome, number: usize) -> Self {
        let case = &plan.cases()[number];
        let names = Names::new(plan, case);
        let mut steps: Vec<(TaskId, &String)> = case.steps.iter().map(|(name, task)| (*task, name)).collect();
        steps.sort_unstable();
        let gates = case.gates.iter().map(|gate| gate_section(&names, gate, outcome)).collect();
        let files = outcome.files.iter().filter(|file| file.case == number);
        let files = files.map(|file| FileReport {
            path: file.path.display().to_string(),
            step: file.step.clone(),
            content: file.content.map(|hash| hash.to_hex().to_string()),
            failed_gate: file.failed_gate,
            lost: file.notes.lost.clone(),
            note: file.notes.note.clone(),
            failure: file.failure.clone(),
        });
        Self {
            name: case.name.clone(),
            params: case.params.clone(),
            inputs: case.inputs.clone(),
            steps: steps.into_iter().filter_map(|(id, name)| step_report(&names, outcome, (id, name))).collect(),
            gates,
            files: files.collect(),
        }
    }

    /// The metrics that `measure` steps made, by step.
    pub fn measurements(&self) -> impl Iterator<Item = (&str, &Measurement)> {
        let metrics =
            |step: &'_ StepReport| step.figures.as_ref().and_then(|figures| figures.metrics.as_ref()).is_some();
        let steps = self.steps.iter().filter(move |step| metrics(step));
        steps.filter_map(|step| Some((step.name.as_str(), step.figures.as_ref()?.metrics.as_ref()?)))
    }
}

/// What tasks are called in a case: by the first of their names, a file by its path.
struct Names<'a> {
    plan: &'a Plan,
    steps: BTreeMap<TaskId, &'a str>,
}

impl<'a> Names<'a> {
    fn new(plan: &'a Plan, case: &'a Case) -> Self {
        // In reverse, so that the first name stays.
        let steps = case.steps.iter().rev().map(|(name, task)| (*task, name.as_str())).collect();
        Self { plan, steps }
    }

    fn of(&self, id: TaskId) -> String {
        match (&self.plan.node(id).task, self.steps.get(&id)) {
            (Task::Source(source), _) => source.path.display().to_string(),
            (Task::Step(_) | Task::Gate(_), Some(name)) => (*name).to_owned(),
            (Task::Step(_) | Task::Gate(_), None) => self.plan.node(id).label.clone(),
        }
    }
}

fn gate_section(names: &Names<'_>, gate: &Gate, outcome: &RunOutcome) -> GateSection {
    let inputs = gate.tasks.iter().flat_map(|task| names.plan.inputs(*task));
    let mut references: Vec<String> =
        inputs.filter(|(name, _)| *name == "reference").map(|(_, task)| names.of(task)).collect();
    references.sort_unstable();
    references.dedup();
    let (rows, failures) = (Vec::new(), Vec::new());
    let (advice, criteria) = (Vec::new(), Vec::new());
    let step = gate.step.clone();
    let mut section = GateSection { step, references, passed: Some(true), rows, criteria, failures, advice };
    for task in gate.tasks.iter().map(|task| outcome.task(*task)) {
        match task.gate_report() {
            Some(report) => {
                section.passed = section.passed.map(|passed| passed && report.passed());
                section.rows.extend(report.rows);
                section.criteria.extend(report.criteria);
            }
            None => section.passed = None,
        }
        section.failures.extend(task.failure.clone());
    }
    let name = |task| names.of(task);
    section.advice = advice::advice(names.plan, gate.target, &section.references, &section.rows, &name);
    section
}

fn step_report(names: &Names<'_>, outcome: &RunOutcome, (id, name): (TaskId, &str)) -> Option<StepReport> {
    let Task::Step(step) = &names.plan.node(id).task else { return None };
    let task = outcome.task(id);
    // A file that cannot be read is no step of its own: the steps that read it say why.
    let files = names.plan.inputs(id).into_iter().map(|(_, input)| input);
    let mut files = files.filter(|input| matches!(names.plan.node(*input).task, Task::Source(_)));
    let unread = files.find_map(|input| outcome.task(input).failure.clone());
    let figures = task.entry.as_ref().and_then(|entry| match &entry.outcome {
        Outcome::Artifact { figures, .. } => Some(figures.clone()),
        Outcome::Gate(_) | Outcome::Failure(_) | Outcome::File { .. } => None,
    });
    Some(StepReport {
        name: name.to_owned(),
        kind: step.def.name.to_owned(),
        inputs: names.plan.inputs(id).into_iter().map(|(input, task)| (input.to_owned(), names.of(task))).collect(),
        key: task.key.map(|key| key.to_hex().to_string()),
        content: task.content.map(|content| content.to_hex().to_string()),
        record: task.entry.as_ref().map(|entry| entry.record.clone()).unwrap_or_default(),
        figures,
        stats: task.entry.as_ref().map(|entry| entry.stats.clone()),
        failure: task.failure.clone().or(unread),
        differs_from: task.differs.map(|(before, _)| before.to_hex().to_string()),
    })
}
