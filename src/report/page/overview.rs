//! The parts of a page about the whole run: head, main figures, graph, gates, files and inputs.

use serde::Serialize;

use super::criteria::CriteriaView;
use super::graph::{Graph, GraphNode, draw};
use super::meshes::Gathered;
use super::outline::Outline;
use super::text::{FaultView, anchor, digits, seconds, short, unit, value};
use crate::metric::Value;
use crate::metric::gate::{Fault, FaultKind, GateRow};
use crate::metric::registry::{self, Direction};
use crate::report::table::{file_notes, grouped, state_text};
use crate::report::{CaseReport, Report, Status, in_case};
use crate::run::{FileState, TaskState};

/// Graphs with more nodes than these are not drawn.
const MOST_NODES: usize = 400;
/// Elements at fault that a row of a gate lists.
const LISTED_FAULTS: usize = 12;

#[derive(Serialize)]
pub(super) struct Head {
    recipe: String,
    description: String,
    status: &'static str,
    class: &'static str,
    version: String,
    total: String,
    computed: usize,
    cached: usize,
    case: String,
    params: Vec<(String, String)>,
}

pub(super) fn head(report: &Report, case: &CaseReport) -> Head {
    let (status, class) = match report.status {
        Status::Done => ("all gates passed", "good"),
        Status::Differs => ("a step is not deterministic", "bad"),
        Status::BadInput => ("an input is wrong", "bad"),
        Status::GateFailed => ("a gate failed", "bad"),
        Status::StepFailed => ("a step failed", "bad"),
        Status::Cancelled => ("interrupted", "bad"),
    };
    let status = if class == "good" && case.gates.is_empty() { "done" } else { status };
    let count = |state| report.timings.tasks.values().filter(|(found, _)| *found == state).count();
    Head {
        recipe: report.recipe.clone(),
        description: report.description.clone(),
        status,
        class,
        version: report.meshmill.clone(),
        total: seconds(report.timings.total),
        computed: count(TaskState::Done),
        cached: count(TaskState::Cached),
        case: case.name.clone(),
        params: case.params.iter().map(|(name, value)| (name.clone(), value.clone())).collect(),
    }
}

#[derive(Serialize)]
pub(super) struct Tile {
    title: String,
    value: String,
    unit: &'static str,
    note: String,
}

/// The main figures of the result.
pub(super) fn tiles(case: &CaseReport, outline: &Outline, gathered: &Gathered) -> Vec<Tile> {
    let Some(known) = outline.result.as_ref().and_then(|name| gathered.meshes.get(name)) else { return Vec::new() };
    let has_quads = known.measurement.get("quads").is_some_and(|count| count.as_f64() > 0.0);
    let wanted = if has_quads {
        ["faces", "triangle-share", "min-scaled-jacobian", "mean-scaled-jacobian", "irregular-share", "distance"]
    } else {
        ["faces", "min-stretch", "mean-stretch", "max-size", "min-angle", "distance"]
    };
    let begun = outline.reference.as_ref().and_then(|name| gathered.meshes.get(name));
    let tile = |name: &&str| {
        let metric = registry::find(name)?;
        // A gate bounds a distance until it is decided; the page must not say another number beside that.
        let gated = gated(case, outline, name);
        let measured = gated.or_else(|| known.measurement.get(name))?;
        let before = begun.filter(|begun| begun.content != known.content).and_then(|begun| begun.measurement.get(name));
        let note = match (before, &outline.reference, &outline.reference) {
            (Some(before), Some(reference), _) => format!("{} in {reference}", value(&before, metric.unit)),
            (None, Some(reference), _) if *name == "distance" => format!("at most, to {reference}"),
            _ => String::new(),
        };
        Some(Tile { title: sentence(name), value: value(&measured, metric.unit), unit: unit(metric.unit), note })
    };
    let mut tiles: Vec<Tile> = wanted.iter().filter_map(tile).collect();
    let rows: Vec<&GateRow> = case.gates.iter().flat_map(|gate| &gate.rows).collect();
    if !rows.is_empty() {
        let passed = rows.iter().filter(|row| row.passed).count();
        let value = format!("{passed} of {}", rows.len());
        let note = if passed == rows.len() { "every check holds" } else { "see the gates below" };
        tiles.push(Tile { title: "Checks passed".to_owned(), value, unit: "", note: note.to_owned() });
    }
    tiles
}

/// What a gate of the result measured, against the mesh that the page compares with.
fn gated(case: &CaseReport, outline: &Outline, metric: &str) -> Option<Value> {
    let (result, reference) = (outline.result.as_ref()?, outline.reference.as_ref()?);
    let gates = case.gates.iter().filter(|gate| gate.step == *result && gate.references.contains(reference));
    let mut rows = gates.flat_map(|gate| &gate.rows);
    rows.find(|row| row.metric == metric && metric == "distance").and_then(|row| row.measured)
}

/// `min-stretch` as `Min stretch`.
pub(super) fn sentence(name: &str) -> String {
    let words = name.replace('-', " ").replace("jacobian", "Jacobian").replace("euler", "Euler");
    let mut letters = words.chars();
    letters.next().map(|first| first.to_uppercase().chain(letters).collect()).unwrap_or_default()
}

/// The graph as SVG; empty where it is too large to read.
pub(super) fn graph(report: &Report, case: &CaseReport) -> String {
    let mut graph = Graph::default();
    let mut names: Vec<&str> = Vec::new();
    let inputs = case.steps.iter().flat_map(|step| step.inputs.values().map(String::as_str));
    for path in inputs.filter(|name| !case.steps.iter().any(|step| step.name == **name)) {
        if !names.contains(&path) {
            names.push(path);
            graph.nodes.push(source_node(path));
        }
    }
    for step in &case.steps {
        let (state, time) = report.timings.tasks.get(&in_case(&case.name, &step.name)).copied().unwrap_or_default();
        names.push(&step.name);
        graph.nodes.push(step_node(&step.name, &step.kind, state, time));
    }
    let position = |names: &[&str], name: &str| names.iter().position(|known| *known == name);
    for (index, step) in case.steps.iter().enumerate() {
        let to = graph.nodes.len() - case.steps.len() + index;
        let mut from: Vec<usize> = step.inputs.values().filter_map(|name| position(&names, name)).collect();
        from.sort_unstable();
        from.dedup();
        graph.edges.extend(from.into_iter().map(|from| (from, to)));
    }
    for gate in &case.gates {
        let from = std::iter::once(&gate.step).chain(&gate.references).filter_map(|name| position(&names, name));
        graph.edges.extend(from.map(|from| (from, graph.nodes.len())));
        graph.nodes.push(gate_node(gate));
    }
    for step in files_by_step(case) {
        if let Some(from) = position(&names, step.0) {
            graph.edges.push((from, graph.nodes.len()));
            graph.nodes.push(file_node(&step.1));
        }
    }
    if graph.nodes.len() > MOST_NODES { String::new() } else { draw(&graph) }
}

fn source_node(path: &str) -> GraphNode {
    GraphNode {
        name: file_name(path).to_owned(),
        kind: "input".to_owned(),
        class: "file".to_owned(),
        title: format!("input file {path}"),
        link: "files".to_owned(),
        ..GraphNode::default()
    }
}

fn step_node(name: &str, kind: &str, state: TaskState, time: f64) -> GraphNode {
    let note = match state {
        TaskState::Done | TaskState::Cached => seconds(time),
        other => state_text(other).to_lowercase(),
    };
    let class = match state {
        TaskState::Done => "done",
        TaskState::Cached => "cached",
        TaskState::Failed => "failed",
        _ => "idle",
    };
    let title = match state {
        TaskState::Done => format!("{name} ({kind}): computed in {note}"),
        TaskState::Cached => format!("{name} ({kind}): taken from the cache, computed once in {note}"),
        _ => format!("{name} ({kind}): {note}"),
    };
    GraphNode {
        name: name.to_owned(),
        kind: kind.to_owned(),
        note,
        class: format!("step {class}"),
        link: format!("step-{}", anchor(name)),
        title,
    }
}

fn gate_node(gate: &crate::report::GateSection) -> GraphNode {
    let passed = gate.rows.iter().filter(|row| row.passed).count();
    let (class, words) = match gate.passed {
        Some(true) => ("done", "passed"),
        Some(false) => ("failed", "FAILED"),
        None => ("idle", "not decided"),
    };
    GraphNode {
        name: format!("gate {}", gate.step),
        kind: format!("{passed} of {}", gate.rows.len()),
        note: words.to_owned(),
        class: format!("gate {class}"),
        link: "gates".to_owned(),
        title: format!("gate of {}: {words}, {passed} of {} checks hold", gate.step, gate.rows.len()),
    }
}

fn file_node(files: &[String]) -> GraphNode {
    let more = if files.len() > 1 { format!("+ {} more", files.len() - 1) } else { "output".to_owned() };
    GraphNode {
        name: files.first().cloned().unwrap_or_default(),
        kind: more,
        class: "file".to_owned(),
        title: format!("output files {}", files.join(", ")),
        link: "files".to_owned(),
        ..GraphNode::default()
    }
}

fn files_by_step(case: &CaseReport) -> Vec<(&str, Vec<String>)> {
    let mut steps: Vec<(&str, Vec<String>)> = Vec::new();
    for file in &case.files {
        let name = file_name(&file.path).to_owned();
        match steps.iter_mut().find(|(step, _)| *step == file.step) {
            Some((_, files)) => files.push(name),
            None => steps.push((&file.step, vec![name])),
        }
    }
    steps
}

pub(super) fn file_name(path: &str) -> &str {
    path.rsplit(['/', '\\']).next().unwrap_or(path)
}

#[derive(Serialize)]
pub(super) struct GateView {
    step: String,
    compared: String,
    verdict: &'static str,
    class: &'static str,
    rows: Vec<RowView>,
    criteria: Vec<CriteriaView>,
    failures: Vec<String>,
    advice: Vec<String>,
}

#[derive(Serialize)]
struct RowView {
    metric: String,
    doc: &'static str,
    limit: String,
    measured: String,
    unit: &'static str,
    slack: String,
    passed: bool,
    fault_count: String,
    faults: Vec<FaultView>,
    note: String,
}

/// All gates with their rows.
pub(super) fn gates(case: &CaseReport) -> Vec<GateView> {
    let view = |gate: &crate::report::GateSection| {
        let (verdict, class) = match gate.passed {
            Some(true) => ("passed", "good"),
            Some(false) => ("failed", "bad"),
            None => ("not decided", "idle"),
        };
        GateView {
            step: gate.step.clone(),
            compared: gate.references.join(", "),
            verdict,
            class,
            rows: gate.rows.iter().map(|row| row_view(row, &gate.step, gate.references.first())).collect(),
            criteria: gate.criteria.iter().map(|criteria| super::criteria::view(criteria, &gate.step)).collect(),
            advice: gate.advice.clone(),
            failures: gate.failures.iter().map(|failure| failure.message.clone()).collect(),
        }
    };
    case.gates.iter().map(view).collect()
}

fn row_view(row: &GateRow, step: &str, reference: Option<&String>) -> RowView {
    let metric = registry::find(&row.metric);
    let kind = metric.map_or(registry::Unit::Ratio, |metric| metric.unit);
    let measured = row.measured.as_ref().map_or_else(|| "undefined".to_owned(), |measured| value(measured, kind));
    let is_number = matches!(row.measured, Some(Value::Number(_)));
    let slack = row.slack.filter(|_| is_number).map(|slack| value(&Value::Number(slack), kind)).unwrap_or_default();
    RowView {
        metric: row.metric.clone(),
        doc: metric.map_or("", |metric| metric.doc),
        limit: shorter(&row.limit),
        measured,
        unit: unit(kind),
        slack,
        passed: row.passed,
        fault_count: if row.fault_count > 0 { grouped(row.fault_count) } else { String::new() },
        faults: row.faults.iter().take(LISTED_FAULTS).map(|fault| fault_view(fault, step, reference)).collect(),
        note: row.note.clone().unwrap_or_default(),
    }
}

fn fault_view(fault: &Fault, step: &str, reference: Option<&String>) -> FaultView {
    let (kind, mesh) = match fault.kind {
        FaultKind::Face => ("face", step),
        FaultKind::Vertex => ("vertex", step),
        FaultKind::ReferenceFace => ("reference face", reference.map_or(step, String::as_str)),
    };
    FaultView {
        mesh: mesh.to_owned(),
        label: format!("{kind} {}", fault.id),
        value: short(fault.value),
        at: fault.at.map(|x| digits(x, 5)).join(", "),
        place: fault.at.map(|x| x.to_string()).join(","),
    }
}

/// A limit with the long tails of its numbers cut.
fn shorter(limit: &str) -> String {
    let word = |word: &str| match word.parse::<f64>() {
        Ok(number) if word.len() > 8 => digits(number, 5),
        _ => word.to_owned(),
    };
    limit.split(' ').map(word).collect::<Vec<_>>().join(" ")
}

#[derive(Serialize)]
pub(super) struct FileView {
    path: String,
    step: String,
    state: &'static str,
    class: &'static str,
    hash: String,
    /// Why it was not written, or what it lacks.
    said: String,
}

/// The files that were written.
pub(super) fn files(report: &Report, case: &CaseReport) -> Vec<FileView> {
    let view = |file: &crate::report::FileReport| {
        let (state, class) = match (report.timings.files.get(&file.path), file.failed_gate) {
            (Some(FileState::Missing) | None, _) => ("not written", "idle"),
            (_, true) => ("written, a gate failed", "bad"),
            (Some(FileState::Current), false) => ("up to date", "good"),
            (Some(FileState::Written), false) => ("written", "good"),
        };
        FileView {
            path: file.path.clone(),
            step: file.step.clone(),
            state,
            class,
            hash: file.content.clone().unwrap_or_default(),
            said: file.failure.as_ref().map_or_else(|| file_notes(file), |failure| failure.message.clone()),
        }
    };
    case.files.iter().map(view).collect()
}

/// The files that were read, with the hashes of their bytes.
pub(super) fn inputs(report: &Report) -> Vec<(String, String)> {
    let hash = |hash: &Option<String>| hash.clone().unwrap_or_else(|| "unreadable".to_owned());
    report.inputs.iter().map(|(path, content)| (path.clone(), hash(content))).collect()
}

/// Whether a change of a metric is for the better; `None` where neither way is better or nothing changed.
pub(super) fn is_better(direction: Direction, before: f64, now: f64) -> Option<bool> {
    match direction {
        _ if before == now => None,
        Direction::Higher => Some(now > before),
        Direction::Lower => Some(now < before),
        Direction::Neutral => None,
    }
}
