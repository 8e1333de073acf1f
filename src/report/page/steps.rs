//! The parts of a page about each step: metrics beside those of the step before, distributions, worst elements,
//! parameters and statistics.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde::Serialize;
use serde_json::Value as Json;

use super::Library;
use super::chart::{Histogram, histogram};
use super::meshes::{Gathered, Known, Shapes};
use super::outline::Outline;
use super::overview::{file_name, is_better, sentence};
use super::text::{FaultView, anchor, digits, seconds, unit, value};
use super::worst::{Element, Worst};
use crate::metric::registry::{METRICS, MetricDef};
use crate::report::table::state_text;
use crate::report::{CaseReport, Report, StepReport, in_case};
use crate::run::TaskState;
use crate::step::StepFailure;

/// Metrics that are shown at once; the others stand in the table of all.
const MAIN: [&str; 18] = [
    "vertices",
    "faces",
    "quads",
    "boundary-loops",
    "self-intersections",
    "min-scaled-jacobian",
    "mean-scaled-jacobian",
    "irregular-share",
    "min-stretch",
    "p5-stretch",
    "mean-stretch",
    "max-size",
    "mean-size",
    "min-angle",
    "max-angle",
    "max-valence",
    "distance",
    "volume-drift",
];

#[derive(Serialize)]
pub(super) struct StepView {
    id: String,
    name: String,
    kind: String,
    state: &'static str,
    class: &'static str,
    time: String,
    port: String,
    key: String,
    content: String,
    inputs: Vec<(String, String)>,
    parameters: Vec<(String, String)>,
    statistics: Vec<(String, String)>,
    failure: Option<Failure>,
    previous: String,
    metrics: Vec<MetricView>,
    charts: Vec<String>,
    worst: Vec<WorstView>,
    picture: String,
    in_viewer: bool,
    gone: bool,
}

#[derive(Serialize)]
struct Failure {
    message: String,
    help: String,
}

#[derive(Serialize)]
struct MetricView {
    name: String,
    title: String,
    doc: &'static str,
    unit: &'static str,
    before: String,
    now: String,
    /// `better`, `worse` or empty.
    change: &'static str,
}

#[derive(Serialize)]
struct WorstView {
    title: String,
    unit: &'static str,
    column: String,
    elements: Vec<FaultView>,
}

/// All steps of a case.
pub(super) fn steps(
    report: &Report,
    case: &CaseReport,
    outline: &Outline,
    gathered: &Gathered,
    library: &dyn Library,
) -> Vec<StepView> {
    case.steps.iter().map(|step| step_view(report, case, step, outline, gathered, library)).collect()
}

fn step_view(
    report: &Report,
    case: &CaseReport,
    step: &StepReport,
    outline: &Outline,
    gathered: &Gathered,
    library: &dyn Library,
) -> StepView {
    let (state, time) = report.timings.tasks.get(&in_case(&case.name, &step.name)).copied().unwrap_or_default();
    let known = gathered.meshes.get(&step.name).map(|known| &**known);
    // A table of metrics is that of the mesh before, so there is nothing to set beside it.
    let previous = outline.previous.get(&step.name).filter(|_| known.is_some());
    let before = previous.and_then(|name| Some((name.as_str(), &**gathered.meshes.get(name)?)));
    let picture = known.map(|known| STANDARD.encode(&known.picture)).unwrap_or_default();
    StepView {
        id: anchor(&step.name),
        name: step.name.clone(),
        kind: step.kind.clone(),
        state: state_text(state),
        class: class(state),
        time: if state.is_available() { seconds(time) } else { String::new() },
        port: step.figures.as_ref().map(|figures| figures.port.clone()).unwrap_or_default(),
        key: step.key.clone().unwrap_or_default(),
        content: step.content.clone().unwrap_or_default(),
        inputs: step.inputs.iter().map(|(input, from)| (input.clone(), file_name(from).to_owned())).collect(),
        parameters: step.key.as_ref().map(|key| library.parameters(key)).unwrap_or_default(),
        statistics: step.stats.as_ref().map(flat).unwrap_or_default(),
        failure: step.failure.as_ref().map(failure_view),
        previous: previous.cloned().unwrap_or_default(),
        metrics: metrics(step, known, before.map(|(_, before)| before)),
        charts: known.map(|known| charts(&known.shapes, before)).unwrap_or_default(),
        worst: known.into_iter().flat_map(|known| &known.worst).map(|list| worst_view(list, &step.name)).collect(),
        picture,
        in_viewer: outline.shown.contains(&step.name) && known.is_some(),
        gone: known.is_none() && super::outline::has_mesh(step),
    }
}

/// How the page shows a state.
fn class(state: TaskState) -> &'static str {
    match state {
        TaskState::Done => "done",
        TaskState::Cached => "cached",
        TaskState::Failed => "failed",
        _ => "idle",
    }
}

fn failure_view(failure: &StepFailure) -> Failure {
    Failure { message: failure.message.clone(), help: failure.help.clone().unwrap_or_default() }
}

fn metrics(step: &StepReport, known: Option<&Known>, before: Option<&Known>) -> Vec<MetricView> {
    let of_step = step.figures.as_ref().and_then(|figures| figures.metrics.as_ref());
    let Some(now) = known.map(|known| &known.measurement).or(of_step) else { return Vec::new() };
    let has_quads = now.get("quads").is_some_and(|count| count.as_f64() > 0.0);
    let row = |metric: &MetricDef| {
        let measured = now.get(metric.name)?;
        let before = before.and_then(|before| before.measurement.get(metric.name));
        if !has_quads && metric.name == "quads" {
            return None;
        }
        let better = before.and_then(|before| is_better(metric.direction, before.as_f64(), measured.as_f64()));
        Some(MetricView {
            name: metric.name.to_owned(),
            title: sentence(metric.name),
            doc: metric.doc,
            unit: unit(metric.unit),
            before: before.map(|before| value(&before, metric.unit)).unwrap_or_default(),
            now: value(&measured, metric.unit),
            change: match better {
                Some(true) => "better",
                Some(false) => "worse",
                None => "",
            },
        })
    };
    METRICS.iter().filter(|metric| MAIN.contains(&metric.name) || known.is_none()).filter_map(row).collect()
}

fn charts(shapes: &Shapes, before: Option<(&str, &Known)>) -> Vec<String> {
    let of = |figure: fn(&Shapes) -> &Vec<f64>| before.map(|(name, known)| (name, figure(&known.shapes).as_slice()));
    let largest = shapes.size.iter().copied().fold(0.0, f64::max);
    let chart = |title, unit, range, figure: fn(&Shapes) -> &Vec<f64>, is_quality| {
        let previous = of(figure).filter(|(_, values)| !values.is_empty());
        histogram(&Histogram { title, unit, range, values: figure(shapes), previous, is_quality })
    };
    let mut charts = Vec::new();
    if !shapes.jacobian.is_empty() {
        charts.push(chart("Scaled Jacobian", "", [0.0, 1.0], |s| &s.jacobian, true));
    }
    if !shapes.stretch.is_empty() {
        charts.push(chart("Stretch", "", [0.0, 1.0], |s| &s.stretch, true));
        charts.push(chart("Size", "longest edge, length", [0.0, largest], |s| &s.size, false));
        charts.push(chart("Angles", "degrees", [0.0, 180.0], |s| &s.angles, false));
    }
    charts
}

fn worst_view(list: &Worst, step: &str) -> WorstView {
    let element = |element: &Element| FaultView {
        mesh: step.to_owned(),
        label: format!("{} {}", element.kind, element.id),
        value: digits(element.value, 4),
        at: element.at.map(|x| digits(x, 5)).join(", "),
        place: element.at.map(|x| x.to_string()).join(","),
    };
    WorstView {
        title: list.title.clone(),
        unit: match list.unit {
            "degrees" => "°",
            other => other,
        },
        column: list.column.clone(),
        elements: list.elements.iter().map(element).collect(),
    }
}

/// The leaves of a JSON value by name.
fn flat(json: &Json) -> Vec<(String, String)> {
    let mut rows = Vec::new();
    leaves("", json, &mut rows);
    rows
}

fn leaves(name: &str, json: &Json, rows: &mut Vec<(String, String)>) {
    let inner = |key: &str| if name.is_empty() { key.to_owned() } else { format!("{name}.{key}") };
    match json {
        Json::Null => {}
        Json::Object(table) => table.iter().for_each(|(key, value)| leaves(&inner(key), value, rows)),
        Json::Array(items) if items.iter().any(|item| item.is_object() || item.is_array()) => {
            rows.push((name.to_owned(), format!("{} entries", items.len())));
        }
        Json::Array(items) => {
            let listed: Vec<String> = items.iter().take(20).map(leaf).collect();
            let more = if items.len() > 20 { ", …" } else { "" };
            rows.push((name.to_owned(), format!("{}{more}", listed.join(", "))));
        }
        Json::Bool(_) | Json::Number(_) | Json::String(_) => rows.push((name.to_owned(), leaf(json))),
    }
}

fn leaf(json: &Json) -> String {
    match json {
        Json::Bool(flag) => if *flag { "yes" } else { "no" }.to_owned(),
        Json::Number(number) => match (number.as_i64(), number.as_f64()) {
            (Some(whole), _) => whole.to_string(),
            (None, Some(real)) => digits(real, 5),
            (None, None) => number.to_string(),
        },
        Json::String(text) => text.clone(),
        Json::Null | Json::Array(_) | Json::Object(_) => String::new(),
    }
}

/// All metrics of all steps: a row a metric, a column a step.
#[derive(Serialize)]
pub(super) struct Matrix {
    steps: Vec<String>,
    rows: Vec<MatrixRow>,
}

#[derive(Serialize)]
struct MatrixRow {
    metric: &'static str,
    doc: &'static str,
    unit: &'static str,
    values: Vec<String>,
}

/// The table of all metrics.
pub(super) fn matrix(case: &CaseReport, gathered: &Gathered) -> Matrix {
    let known: Vec<(&str, &Known)> =
        case.steps.iter().filter_map(|step| Some((step.name.as_str(), &**gathered.meshes.get(&step.name)?))).collect();
    let row = |metric: &MetricDef| {
        let values: Vec<String> = known
            .iter()
            .map(|(_, known)| known.measurement.get(metric.name).map(|v| value(&v, metric.unit)).unwrap_or_default())
            .collect();
        let row = MatrixRow { metric: metric.name, doc: metric.doc, unit: unit(metric.unit), values };
        row.values.iter().any(|value| !value.is_empty()).then_some(row)
    };
    Matrix {
        steps: known.iter().map(|(name, _)| (*name).to_owned()).collect(),
        rows: METRICS.iter().filter_map(row).collect(),
    }
}
