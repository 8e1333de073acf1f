//! Judging a mesh by the checks of a gate.

use super::super::crossing::compare_crossing;
use super::super::distance::{Decision, Inside, decide, decide_outside};
use super::super::number::number_text;
use super::super::registry::{MetricDef, Needs, Unit, find, lost_groups};
use super::super::{Subject, Value};
use super::column::{Column, Extreme, column, fault_at};
use super::{Check, Fault, FaultKind, GateReport, GateRow, Limit, MAX_FAULTS, fault};
use crate::mesh::{FaceId, Soup};
use crate::watch::{Cancelled, Watch};

/// Why a gate could not be judged.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum GateError {
    /// No metric has this name.
    #[error("there is no metric `{0}`")]
    UnknownMetric(String),
    /// The check compares with another mesh, and none was given.
    #[error("the check of `{0}` needs a mesh to compare with")]
    NoReference(String),
    /// The run was interrupted.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

/// Computed lengths differ in the last digits from lengths that a step was given: both count as equal.
const ROUNDING: f64 = 1e-9;

/// Why a check of a count that stopped fails.
const UNKNOWN: &str = "counting stopped at this many, so that nobody can say whether the check holds: it fails";

/// A check with its bounds as numbers.
struct Bounds {
    at_least: Option<f64>,
    at_most: Option<f64>,
    equals: Option<f64>,
    text: String,
}

impl Bounds {
    fn is_empty(&self) -> bool {
        self.at_least.is_none() && self.at_most.is_none() && self.equals.is_none()
    }

    fn tolerance(bound: f64) -> f64 {
        ROUNDING * bound.abs()
    }

    fn admits(&self, value: f64) -> bool {
        self.at_least.is_none_or(|b| value >= b - Self::tolerance(b))
            && self.at_most.is_none_or(|b| value <= b + Self::tolerance(b))
            && self.equals.is_none_or(|b| (value - b).abs() <= Self::tolerance(b))
    }

    fn slack(&self, value: f64) -> Option<f64> {
        let slacks = [
            self.at_least.map(|b| value - b),
            self.at_most.map(|b| b - value),
            self.equals.map(|b| -(value - b).abs()),
        ];
        slacks.into_iter().flatten().reduce(f64::min).filter(|s| s.is_finite())
    }
}

/// Judges a mesh by all checks, in order.
///
/// `reference` is the mesh that the checks compare with; percents of lengths are of its diagonal where a check names
/// it.
pub fn evaluate(
    mesh: &Soup,
    reference: Option<&Soup>,
    checks: &[Check],
    watch: &Watch,
) -> Result<GateReport, GateError> {
    judge(&Subject::new(mesh, reference, watch), checks)
}

/// The same of a subject, of which some may be known.
pub fn judge(subject: &Subject<'_>, checks: &[Check]) -> Result<GateReport, GateError> {
    let mut report = GateReport::default();
    for check in checks {
        let metric = find(&check.metric).ok_or_else(|| GateError::UnknownMetric(check.metric.clone()))?;
        let compares = metric.needs == Needs::Reference || check.same_as_reference || check.no_more_than_reference;
        if compares && subject.reference().is_none() {
            return Err(GateError::NoReference(check.metric.clone()));
        }
        report.rows.push(judge_one(subject, metric, check)?);
        subject.watch().check().map_err(GateError::Cancelled)?;
    }
    Ok(report)
}

fn judge_one(subject: &Subject<'_>, metric: &MetricDef, check: &Check) -> Result<GateRow, GateError> {
    let bounds = resolve(subject, metric, check);
    if let (Some(at_most), None, None) = (bounds.at_most, bounds.at_least, bounds.equals)
        && let Some(sides) = sides(metric.name)
    {
        return judge_distance(subject, check, sides, at_most, &bounds);
    }
    if let Some(column) = column(subject, metric.name) {
        return Ok(judge_column(subject, check, column, &bounds));
    }
    let whole = judge_whole(subject, metric, &bounds);
    Ok(if judges_crossings(check) { by_place(subject, whole) } else { whole })
}

fn resolve(subject: &Subject<'_>, metric: &MetricDef, check: &Check) -> Bounds {
    let of_diagonal = match (&check.reference, subject.reference()) {
        (Some(_), Some(reference)) => reference,
        _ => subject,
    };
    let mut words = Vec::new();
    let mut number = |relation: &str, limit: Option<Limit>| {
        let limit = limit?;
        let (value, text) = match limit {
            Limit::Number(value) => (value, format!("{relation} {}", number_text(value))),
            Limit::Flag(flag) => (f64::from(u8::from(flag)), format!("{relation} {flag}")),
            Limit::Percent(percent) => {
                let whole = if metric.unit == Unit::Length { of_diagonal.extent().bounds.diagonal() } else { 1.0 };
                // As steps resolve their lengths, to the last bit.
                let value = percent / 100.0 * whole;
                (value, format!("{relation} {percent}% = {}", number_text(value)))
            }
        };
        words.push(text.trim_start().to_owned());
        Some(value)
    };
    let at_least = number("at least", check.at_least);
    let mut at_most = number("at most", check.at_most);
    let mut equals = number("", check.equals);
    let theirs = subject.reference().and_then(|r| (metric.measure)(r));
    let is_lower_bound = matches!(theirs, Some(Value::AtLeast(_)));
    let theirs = theirs.map(Value::as_f64);
    if check.same_as_reference && metric.needs != Needs::Reference {
        equals = Some(theirs.filter(|_| !is_lower_bound).unwrap_or(f64::NAN));
        words.push(format!(
            "the same as the reference{}",
            theirs.map_or(String::new(), |v| format!(" = {}", number_text(v)))
        ));
    }
    if check.no_more_than_reference && metric.needs != Needs::Reference {
        let theirs = theirs.unwrap_or(f64::NAN);
        at_most = Some(at_most.map_or(theirs, |b| b.min(theirs)));
        let relation = if is_lower_bound { "≥" } else { "=" };
        words.push(format!("no more than the reference {relation} {}", number_text(theirs)));
    }
    Bounds { at_least, at_most, equals, text: words.join(", ") }
}

fn row(check: &Check, bounds: &Bounds) -> GateRow {
    GateRow {
        metric: check.metric.clone(),
        limit: bounds.text.clone(),
        measured: None,
        passed: false,
        slack: None,
        fault_count: 0,
        faults: Vec::new(),
        excused: Vec::new(),
        cause: None,
        note: None,
    }
}

/// Keeps the worst faults, first those with the largest badness, of equals the lowest id.
fn worst(mut faults: Vec<Fault>, badness: impl Fn(f64) -> f64) -> (u64, Vec<Fault>) {
    let count = faults.len() as u64;
    faults.sort_by(|a, b| badness(b.value).total_cmp(&badness(a.value)).then(a.id.cmp(&b.id)));
    faults.truncate(MAX_FAULTS);
    (count, faults)
}

fn judge_column(subject: &Subject<'_>, check: &Check, column: Column, bounds: &Bounds) -> GateRow {
    let mut out = row(check, bounds);
    let except = fault::members(subject.mesh(), &check.except);
    let skipped = |id: u32| column.kind == FaultKind::Face && except.contains(&id);
    let needed = (check.metric == "min-stretch").then(|| bounds.at_least.map(fault::angle_needed)).flatten();
    let mut measured: Option<f64> = None;
    let (mut faults, mut excused) = (Vec::new(), Vec::new());
    for (&id, &value) in column.ids.iter().zip(&column.values) {
        if skipped(id) {
            continue;
        }
        let fails = match column.extreme {
            Extreme::Least => bounds.at_least.is_some_and(|b| value < b - Bounds::tolerance(b)),
            Extreme::Largest => bounds.at_most.is_some_and(|b| value > b + Bounds::tolerance(b)),
        };
        if fails {
            let fault = fault_at(subject.mesh(), column.kind, id, value);
            if needed.is_some_and(|angle| fault::is_excused(subject.mesh(), FaceId::from_raw(id), angle)) {
                excused.push(fault);
                continue;
            }
            faults.push(fault);
        }
        measured = Some(match column.extreme {
            Extreme::Least => measured.map_or(value, |m| m.min(value)),
            Extreme::Largest => measured.map_or(value, |m| m.max(value)),
        });
    }
    if column.kind == FaultKind::Face {
        out.cause = fault::cause(subject.mesh(), faults.iter().map(|fault| FaceId::from_raw(fault.id)));
    }
    let badness = |v: f64| if column.extreme == Extreme::Least { -v } else { v };
    (out.fault_count, out.faults) = worst(faults, badness);
    let (excused_count, excused) = worst(excused, badness);
    out.excused = excused;
    // Without an element there is nothing that could fail.
    out.passed = measured.is_none_or(|m| bounds.admits(m));
    out.slack = measured.and_then(|m| bounds.slack(m));
    let whole = column.kind == FaultKind::Vertex;
    let number = |m: f64| if whole { Value::Count(m as u64) } else { Value::Number(m) };
    out.measured = measured.filter(|m| m.is_finite()).map(number);
    out.note = note_of(excused_count, needed, measured.is_none(), except.len());
    out
}

fn note_of(excused: u64, needed: Option<f64>, nothing: bool, except: usize) -> Option<String> {
    let mut notes = Vec::new();
    if let (1.., Some(angle)) = (excused, needed) {
        let faces = if excused == 1 { "1 face is excused" } else { &format!("{excused} faces are excused") };
        notes.push(format!(
            "{faces}: marked edges meet there at less than {:.2} degrees, where no triangle reaches this stretch",
            angle.to_degrees()
        ));
    }
    if except > 0 {
        notes.push(format!("{except} faces are in the groups excepted"));
    }
    if nothing {
        notes.push("there is no element to judge".to_owned());
    }
    (!notes.is_empty()).then(|| notes.join("; "))
}

/// Whether a check asks for no crossings besides those of the reference, and for nothing else.
fn judges_crossings(check: &Check) -> bool {
    let is_bounded = check.at_least.is_some() || check.at_most.is_some() || check.equals.is_some();
    ["self-intersections", "self-intersecting-faces"].contains(&check.metric.as_str())
        && check.no_more_than_reference
        && !check.same_as_reference
        && !is_bounded
}

/// More pairs than in the reference are no fault where they lie along the crossings of the reference.
fn by_place(subject: &Subject<'_>, mut out: GateRow) -> GateRow {
    let Some(reference) = subject.reference() else { return out };
    let complete = subject.intersections().complete && reference.intersections().complete;
    if out.passed || !complete || reference.intersections().pairs.is_empty() {
        return out;
    }
    let found = compare_crossing(subject, reference);
    let lengths =
        format!("{} long, {} in the reference", number_text(found.length), number_text(found.reference_length));
    if found.is_old() {
        out.passed = true;
        (out.fault_count, out.faults) = (0, Vec::new());
        out.note = Some(format!("along the crossings of the reference: {lengths}"));
    } else if found.elsewhere.is_empty() {
        out.note = Some(format!("at the places of the reference's, but longer: {lengths}"));
    } else {
        let new: std::collections::BTreeSet<u32> = found.elsewhere.iter().map(|face| face.raw()).collect();
        out.faults.retain(|fault| new.contains(&fault.id));
        out.fault_count = new.len() as u64;
        out.note = Some("these lie elsewhere than the crossings of the reference".to_owned());
    }
    out
}

fn judge_whole(subject: &Subject<'_>, metric: &MetricDef, bounds: &Bounds) -> GateRow {
    let check = Check { metric: metric.name.to_owned(), ..Check::default() };
    let mut out = row(&check, bounds);
    out.measured = (metric.measure)(subject);
    let value = out.measured.map(Value::as_f64);
    let nothing = match metric.needs {
        Needs::Triangles => subject.triangles().faces.is_empty(),
        Needs::Quads => subject.quads().faces.is_empty(),
        Needs::Mesh | Needs::Reference => false,
    };
    // A check without a bound only measures.
    out.passed = value.map_or(nothing || bounds.is_empty(), |v| bounds.admits(v));
    out.slack = value.and_then(|v| bounds.slack(v)).filter(|_| metric.unit != Unit::Flag);
    let stopped = |value: Option<Value>| matches!(value, Some(Value::AtLeast(_)));
    // A lower bound decides nothing that needs the count.
    let is_unknown = stopped(out.measured) && !bounds.is_empty();
    out.passed &= !is_unknown;
    out.slack = out.slack.filter(|_| !is_unknown);
    if nothing {
        out.note = Some("there is no element to judge".to_owned());
    } else if out.measured.is_none() {
        out.note = Some("undefined on this mesh".to_owned());
    } else if is_unknown {
        out.note = Some(UNKNOWN.to_owned());
    }
    if !out.passed {
        (out.fault_count, out.faults) = worst(fault::of_whole(subject, metric.name), |v| v);
        if let ("groups-kept", Some(reference)) = (metric.name, subject.reference()) {
            out.note = Some(format!("lost: {}", lost_groups(subject.mesh(), reference.mesh()).join(", ")));
        }
    }
    out
}

/// Distances for which what is inside of the mesh's bodies does not count.
const OUTER: [&str; 2] = ["outer-distance", "outer-distance-from-reference"];

/// Which ways a distance metric looks: from the mesh to the reference, and back.
fn sides(metric: &str) -> Option<[bool; 2]> {
    match metric {
        "distance" | "outer-distance" => Some([true, true]),
        "distance-to-reference" => Some([true, false]),
        "distance-from-reference" | "outer-distance-from-reference" => Some([false, true]),
        _ => None,
    }
}

/// Whether a check bounds a distance from above, so that vertices that move by less than its slack cannot break it.
pub fn bounds_distance(check: &Check) -> bool {
    check.at_most.is_some() && check.at_least.is_none() && check.equals.is_none() && sides(&check.metric).is_some()
}

/// Whether a check judges faces one by one, so that `except` can leave some out.
pub fn judges_faces(check: &Check) -> bool {
    let nothing = Soup::default();
    let watch = Watch::silent();
    if let Some(column) = column(&Subject::new(&nothing, None, &watch), &check.metric) {
        return column.kind == FaultKind::Face;
    }
    let is_upper_bound = check.at_most.is_some() && check.at_least.is_none() && check.equals.is_none();
    is_upper_bound && sides(&check.metric).is_some_and(|[own, _]| own)
}

/// The certified upper bound of the distance on all sides that count; `None` where one of the meshes has no face.
fn closest_bound(sides: [bool; 2], subject: &Subject<'_>) -> Option<f64> {
    let wanted = [false, true].into_iter().zip(sides).filter(|(_, wanted)| *wanted);
    wanted
        .map(|(from_reference, _)| subject.bound(from_reference))
        .try_fold(0.0, |most: f64, bound| Some(most.max(bound?)))
}

/// A distance that passes is bounded closely, so that the figures of a study can be compared. Where that bound is not
/// enough, or some faces are excused, faces are refined one by one until the comparison is decided.
fn judge_distance(
    subject: &Subject<'_>,
    check: &Check,
    sides: [bool; 2],
    at_most: f64,
    bounds: &Bounds,
) -> Result<GateRow, GateError> {
    let mut out = row(check, bounds);
    let Some(reference) = subject.reference() else { return Err(GateError::NoReference(check.metric.clone())) };
    let except = fault::members(subject.mesh(), &check.except);
    let (mesh, theirs) = (subject.target(), reference.target());
    if except.is_empty()
        && let Some(bound) = closest_bound(sides, subject).filter(|&bound| bound <= at_most)
    {
        out.passed = true;
        out.measured = Some(Value::Number(bound));
        out.slack = bounds.slack(bound);
        out.note = Some("a certified upper bound".to_owned());
        return Ok(out);
    }
    let hidden = OUTER.contains(&check.metric.as_str()).then(|| Inside::of(subject.mesh()));
    let mut faults = Vec::new();
    let (mut undecided, mut upper, mut defined) = (0, 0.0_f64, true);
    for (wanted, from, to, kind) in
        [(sides[0], mesh, theirs, FaultKind::Face), (sides[1], theirs, mesh, FaultKind::ReferenceFace)]
    {
        if !wanted {
            continue;
        }
        let hidden = hidden.as_ref().filter(|_| kind == FaultKind::ReferenceFace);
        let decided = match hidden {
            Some(hidden) => decide_outside(from, to, at_most, hidden, subject.watch())?,
            None => decide(from, to, at_most, subject.watch())?,
        };
        let Some(decision) = decided else {
            defined = false;
            continue;
        };
        let Decision { beyond, undecided: open, upper: bound, .. } = decision;
        let counts = |face: FaceId| kind != FaultKind::Face || !except.contains(&face.raw());
        undecided += open.iter().filter(|(face, _)| counts(*face)).count();
        upper = upper.max(bound);
        let of_side = beyond.into_iter().filter(|(face, ..)| counts(*face));
        faults.extend(of_side.map(|(face, at, d)| Fault { kind, id: face.raw(), at: at.to_array(), value: d }));
    }
    out.passed = defined && faults.is_empty() && undecided == 0;
    let farthest = faults.iter().map(|f| f.value).reduce(f64::max);
    let measured = farthest.unwrap_or(if except.is_empty() { upper } else { upper.min(at_most) });
    out.measured = defined.then_some(Value::Number(measured));
    out.slack = bounds.slack(measured).filter(|_| defined);
    (out.fault_count, out.faults) = worst(faults, |v| v);
    out.note = if !defined {
        Some("undefined: one of the meshes has no face".to_owned())
    } else if undecided > 0 {
        Some(format!("{undecided} faces could not be decided within the work allowed"))
    } else if out.passed {
        Some("a certified bound, refined until the comparison was decided".to_owned())
    } else {
        Some("a distance that is reached".to_owned())
    };
    Ok(out)
}
