//! Two runs side by side: which metrics changed, and which parameter, input or revision made it.

use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};

use super::lock::metrics;
use super::measure::value_text;
use super::table;
use crate::metric::Value;
use crate::run::{Change, Figures, Record};

/// What of `run.ron` a comparison reads.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub struct RunRecord {
    meshmill: String,
    recipe: String,
    cases: Vec<CaseRecord>,
    inputs: BTreeMap<String, Option<String>>,
}

#[derive(Clone, Debug, PartialEq, Deserialize)]
struct CaseRecord {
    name: String,
    params: BTreeMap<String, String>,
    steps: Vec<StepRecord>,
    gates: Vec<GateRecord>,
}

#[derive(Clone, Debug, PartialEq, Deserialize)]
struct StepRecord {
    name: String,
    content: Option<String>,
    record: Vec<(String, String)>,
    figures: Option<Figures>,
}

#[derive(Clone, Debug, PartialEq, Deserialize)]
struct GateRecord {
    step: String,
    rows: Vec<GateRowRecord>,
}

#[derive(Clone, Debug, PartialEq, Deserialize)]
struct GateRowRecord {
    metric: String,
    measured: Option<Value>,
    passed: bool,
}

impl RunRecord {
    /// The record in the text of a `run.ron`.
    pub fn from_ron(text: &str) -> Result<Self, String> {
        ron::from_str(text).map_err(|error| error.to_string())
    }
}

/// What differs between two runs.
#[derive(Clone, Debug, Default, PartialEq, Serialize, schemars::JsonSchema)]
pub struct RunDiff {
    /// Versions, names, parameters and input files that differ: what, before, after.
    pub head: Vec<[String; 3]>,
    /// Steps that differ, in the order of the graph.
    pub steps: Vec<StepDiff>,
}

/// Two meshes side by side.
#[derive(Clone, Debug, Default, PartialEq, Serialize, schemars::JsonSchema)]
pub struct MeshDiff {
    /// Every metric that is defined on one of them.
    pub metrics: Vec<MetricChange>,
}

/// What differs in one step.
#[derive(Clone, Debug, Default, PartialEq, Serialize, schemars::JsonSchema)]
pub struct StepDiff {
    /// Its name, with the case before it in a sweep.
    pub step: String,
    /// Which of its own parameters, files or revision changed.
    pub causes: Vec<String>,
    /// The inputs that changed because of steps before it.
    pub upstream: Vec<String>,
    /// Whether its result has other bytes.
    pub other_result: bool,
    /// Metrics that differ.
    pub metrics: Vec<MetricChange>,
    /// Gates whose verdict differs.
    pub verdicts: Vec<VerdictChange>,
}

/// A metric of two meshes.
#[derive(Clone, Debug, Default, PartialEq, Serialize, schemars::JsonSchema)]
pub struct MetricChange {
    /// Its name in the registry.
    pub metric: String,
    /// The value before; absent where undefined.
    pub before: Option<Value>,
    /// The value after.
    pub after: Option<Value>,
}

/// The verdict of a gate in two runs.
#[derive(Clone, Debug, Default, PartialEq, Serialize, schemars::JsonSchema)]
pub struct VerdictChange {
    /// The metric that it judges.
    pub metric: String,
    /// Whether it held before.
    pub before: bool,
    /// Whether it holds after.
    pub after: bool,
}

/// Compares two runs.
pub fn diff(before: &RunRecord, now: &RunRecord) -> RunDiff {
    let mut found = RunDiff { head: head(before, now), steps: Vec::new() };
    let cases: BTreeMap<&str, &CaseRecord> = before.cases.iter().map(|case| (case.name.as_str(), case)).collect();
    // Two plain runs are compared whatever their recipes are called; cases of sweeps by name.
    for case in &now.cases {
        if let Some(earlier) = cases.get(case.name.as_str()) {
            found.steps.extend(steps(earlier, case));
        } else {
            found.head.push([format!("case {}", case.name), "absent".to_owned(), "present".to_owned()]);
        }
    }
    for case in before.cases.iter().filter(|case| !now.cases.iter().any(|other| other.name == case.name)) {
        found.head.push([format!("case {}", case.name), "present".to_owned(), "absent".to_owned()]);
    }
    found
}

fn head(before: &RunRecord, now: &RunRecord) -> Vec<[String; 3]> {
    let mut lines = Vec::new();
    let mut note = |what: String, before: Option<&String>, now: Option<&String>| {
        if before != now {
            let text = |value: Option<&String>| value.cloned().unwrap_or_else(|| "absent".to_owned());
            lines.push([what, text(before), text(now)]);
        }
    };
    note("version".to_owned(), Some(&before.meshmill), Some(&now.meshmill));
    note("recipe".to_owned(), Some(&before.recipe), Some(&now.recipe));
    if let ([a], [b]) = (before.cases.as_slice(), now.cases.as_slice()) {
        for name in union(&a.params, &b.params) {
            note(format!("parameter {name}"), a.params.get(name), b.params.get(name));
        }
    }
    let hash = |run: &RunRecord, path: &String| run.inputs.get(path).cloned().flatten().map(|hash| short(&hash));
    for path in union(&before.inputs, &now.inputs) {
        note(format!("input {path}"), hash(before, path).as_ref(), hash(now, path).as_ref());
    }
    lines
}

fn union<'a, A, B>(a: &'a BTreeMap<String, A>, b: &'a BTreeMap<String, B>) -> BTreeSet<&'a String> {
    a.keys().chain(b.keys()).collect()
}

fn steps(before: &CaseRecord, now: &CaseRecord) -> Vec<StepDiff> {
    let earlier: BTreeMap<&str, &StepRecord> = before.steps.iter().map(|step| (step.name.as_str(), step)).collect();
    let mut found = Vec::new();
    for step in &now.steps {
        let mut diff = StepDiff { step: super::in_case(&now.name, &step.name), ..StepDiff::default() };
        match earlier.get(step.name.as_str()) {
            None => diff.causes.push("the step is new".to_owned()),
            Some(earlier) => {
                causes(earlier, step, &mut diff);
                diff.other_result = earlier.content != step.content;
                let metrics = |step: &StepRecord| step.figures.as_ref().map(metrics).unwrap_or_default();
                let (a, b) = (metrics(earlier), metrics(step));
                for name in union(&a, &b) {
                    let (before, after) = (a.get(name).copied(), b.get(name).copied());
                    if before != after {
                        diff.metrics.push(MetricChange { metric: name.clone(), before, after });
                    }
                }
            }
        }
        diff.verdicts = verdicts(before, now, &step.name);
        if diff != (StepDiff { step: diff.step.clone(), ..StepDiff::default() }) {
            found.push(diff);
        }
    }
    for step in before.steps.iter().filter(|step| !now.steps.iter().any(|other| other.name == step.name)) {
        let causes = vec!["the step is gone".to_owned()];
        found.push(StepDiff { step: super::in_case(&now.name, &step.name), causes, ..StepDiff::default() });
    }
    found
}

fn causes(before: &StepRecord, now: &StepRecord, diff: &mut StepDiff) {
    let record = |step: &StepRecord| Record { fields: step.record.clone() };
    for change in record(now).changes_since(&record(before)) {
        match change {
            Change::Input { name } if name == "file" => diff.causes.push("its file changed".to_owned()),
            Change::Input { name } => diff.upstream.push(name),
            own @ (Change::Value { .. } | Change::Revision { .. }) => diff.causes.push(own.to_string()),
        }
    }
}

fn verdicts(before: &CaseRecord, now: &CaseRecord, step: &str) -> Vec<VerdictChange> {
    let rows = |case: &CaseRecord| -> BTreeMap<String, bool> {
        let gates = case.gates.iter().filter(|gate| gate.step == step);
        gates.flat_map(|gate| gate.rows.iter().map(|row| (row.metric.clone(), row.passed))).collect()
    };
    let (before, now) = (rows(before), rows(now));
    let both = now.into_iter().filter_map(|(metric, after)| {
        let before = *before.get(&metric)?;
        Some(VerdictChange { metric, before, after })
    });
    both.filter(|verdict| verdict.before != verdict.after).collect()
}

fn short(hash: &str) -> String {
    hash.get(..12).unwrap_or(hash).to_owned()
}

/// The differences for a terminal: causes first, then what came of them.
pub fn text(diff: &RunDiff) -> String {
    let mut parts = Vec::new();
    if !diff.head.is_empty() {
        let mut rows = table::plain(&["what", "before", "after"]);
        for line in &diff.head {
            table::add(&mut rows, line.clone());
        }
        parts.push(table::text(&rows));
    }
    for step in &diff.steps {
        let mut lines = vec![step.step.clone()];
        lines.extend(step.causes.iter().map(|cause| format!("  because {cause}")));
        if !step.upstream.is_empty() {
            lines.push(format!("  because of what comes before it: {}", step.upstream.join(", ")));
        }
        if step.other_result && step.causes.is_empty() && step.upstream.is_empty() {
            lines.push("  from equal inputs, which is a fault of the program".to_owned());
        } else if !step.other_result
            && step.metrics.is_empty()
            && step.causes.iter().any(|cause| !cause.starts_with("the step"))
        {
            lines.push("  its result is the same".to_owned());
        }
        lines.extend(step.verdicts.iter().map(|verdict| {
            let change = if verdict.after { "failed before, holds now" } else { "held before, FAILS now" };
            format!("  gate {}: {change}", verdict.metric)
        }));
        if !step.metrics.is_empty() {
            let changed = metrics_text(&step.metrics);
            lines.extend(changed.lines().map(|line| format!("  {line}")));
        }
        parts.push(lines.join("\n"));
    }
    if parts.is_empty() { "nothing differs".to_owned() } else { parts.join("\n\n") }
}

/// Metrics side by side, with the change in percent.
pub fn metrics_text(metrics: &[MetricChange]) -> String {
    let mut rows = table::plain(&["metric", "before", "after", "change"]);
    for MetricChange { metric, before, after } in metrics {
        let text = |value: &Option<Value>| value.as_ref().map_or_else(|| "undefined".to_owned(), value_text);
        table::add(&mut rows, [metric.clone(), text(before), text(after), change(*before, *after)]);
    }
    table::align(&mut rows, &[1, 2, 3]);
    table::text(&rows)
}

fn change(before: Option<Value>, now: Option<Value>) -> String {
    match (before, now) {
        (Some(Value::Flag(_)) | None, _) | (_, Some(Value::Flag(_)) | None) => String::new(),
        (Some(before), Some(now)) => {
            let (before, now) = (before.as_f64(), now.as_f64());
            if before == 0.0 { String::new() } else { format!("{:+.1}%", (now - before) / before.abs() * 100.0) }
        }
    }
}
