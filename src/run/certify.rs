//! Whether a file holds what the gates of its mesh promise.
//!
//! Every file is read back before it is written. Formats round: binary STL to single precision, bulk data to sixteen
//! characters, any text to the `precision` asked for. Where a vertex moved, the checks are judged again on the mesh as
//! the file has it. A binary STL that would break one is written as text, which has all digits; another file is not
//! written, and its output fails.

use std::sync::Arc;

use glam::DVec3;

use super::gate;
use super::node::{FileNotes, Finished};
use super::shared::Shared;
use crate::format::{self, Format};
use crate::mesh::{FaceId, Soup, VertexId};
use crate::metric::Measured;
use crate::metric::gate::{Check, GateReport, GateRow, bounds_distance};
use crate::plan::{GateTask, Output, Task, TaskId};
use crate::step::StepFailure;
use crate::watch::Watch;

/// Told where a vertex moves by more than this share of the shortest edge.
const TELLING: f64 = 0.01;

/// Makes the bytes of an output file and certifies them. `write` makes them, binary or not.
pub(super) fn certified(
    (shared, case, output): (&Shared<'_>, usize, &Output),
    (format, soup): (Format, &Soup),
    write: &dyn Fn(bool) -> Result<Vec<u8>, StepFailure>,
    watch: &Watch,
) -> Result<(Vec<u8>, FileNotes), Finished> {
    let gates: Vec<(TaskId, &GateTask)> = shared.plan.cases()[case]
        .gates
        .iter()
        .filter(|gate| gate.target == output.task)
        .flat_map(|gate| &gate.tasks)
        .filter_map(|&id| if let Task::Gate(task) = &shared.plan.node(id).task { Some((id, task)) } else { None })
        // A result that fails its gate is shown as it is.
        .filter(|(id, _)| shared.report(*id).is_some_and(GateReport::passed))
        .collect();
    let attempt = |binary: bool| -> Result<Attempt, Finished> {
        let bytes = write(binary).map_err(Finished::Failed)?;
        let mut attempt = Attempt::read_back(format, soup, bytes, watch);
        for (id, task) in &gates {
            attempt.judge((shared, *id, task), watch)?;
        }
        Ok(attempt)
    };
    let binary = output.options.binary.unwrap_or(format.is_binary_by_default());
    let first = attempt(binary);
    let reason = match &first {
        Err(Finished::Failed(failure)) => Some(failure.message.clone()),
        Ok(made) if !made.broken.is_empty() => Some(format!("its gate would not hold: {}", made.broken.join("; "))),
        Ok(_) | Err(_) => None,
    };
    let made = match reason.filter(|_| binary && format == Format::Stl) {
        Some(reason) => Attempt { note: Some(format!("written as text; as binary, {reason}")), ..attempt(false)? },
        None => first?,
    };
    if made.broken.is_empty() {
        return Ok((made.bytes, FileNotes { lost: made.lost, note: made.note }));
    }
    let message = format!("the file would not hold what its gate promises: {}", made.broken.join("; "));
    Err(Finished::Failed(StepFailure::failed(message).with_help(
        "write a format that keeps every digit and all groups, such as .vtu, without `precision`; or move the part nearer \
         to the origin",
    )))
}

/// Bytes, and what they say when they are read again.
struct Attempt {
    bytes: Vec<u8>,
    lost: Vec<String>,
    /// The part of `lost` that is about groups.
    groups: Vec<String>,
    note: Option<String>,
    /// Checks that fail on the file.
    broken: Vec<String>,
    /// The mesh as the file has it, where that is another one than was written.
    file: Option<Measured>,
    /// Largest distance between a vertex and where the file has it; `None` where the faces of the file are others, as
    /// where a format cuts quads into triangles.
    moved: Option<f64>,
}

impl Attempt {
    fn read_back(format: Format, soup: &Soup, bytes: Vec<u8>, watch: &Watch) -> Self {
        let read = format::read(format, &bytes, watch);
        let mut made = Self {
            bytes,
            lost: Vec::new(),
            groups: Vec::new(),
            note: None,
            broken: Vec::new(),
            file: None,
            moved: None,
        };
        let after = match read {
            Ok((after, _)) => after,
            Err(error) => {
                made.lost.push(format!("all of it; it cannot be read back: {error}"));
                made.groups.clone_from(&made.lost);
                return made;
            }
        };
        made.lost = format::not_kept(soup, &after);
        made.groups = format::groups_not_kept(soup, &after);
        let Some(corners) = corners(soup, &after) else {
            made.file = Some(Measured::new(Arc::new(after)));
            return made;
        };
        let largest = corners.iter().map(|&(vertex, at)| soup.points[vertex].distance(at)).fold(0.0, f64::max);
        made.moved = Some(largest);
        if largest > 0.0 {
            made.note = rounding(soup, largest);
            let mut file = soup.clone();
            for (vertex, at) in corners {
                file.points[vertex] = at;
            }
            made.file = Some(Measured::new(Arc::new(file)));
        }
        made
    }

    /// Judges the checks of a gate that the file may break.
    fn judge(&mut self, (shared, id, task): (&Shared<'_>, TaskId, &GateTask), watch: &Watch) -> Result<(), Finished> {
        if task.checks.iter().any(|check| check.files) {
            self.broken.extend(self.groups.iter().map(|what| format!("`groups-kept` asks for {what}")));
        }
        let Some(file) = &self.file else { return Ok(()) };
        let Some(task) = self.at_risk(task, shared.report(id)) else { return Ok(()) };
        let reference = shared.plan.inputs(id).into_iter().find(|(name, _)| *name == "reference");
        let reference = reference.map(|(_, input)| gate::mesh(shared, input)).transpose()?;
        let work = || gate::evaluate(&task, file, reference.as_ref(), watch);
        let report = shared.pool()?.install(work).map_err(Finished::Failed)?;
        let failed = report.rows.iter().filter(|row| !row.passed);
        self.broken.extend(failed.map(|row| {
            if task.criteria.is_some() {
                return format!("{} elements fail the {}", row.fault_count, row.metric);
            }
            let measured = row.measured.map_or_else(|| "undefined".to_owned(), |value| short(value.as_f64()));
            format!("`{}` is {measured}, and must be {}", row.metric, row.limit)
        }));
        Ok(())
    }

    /// What of a gate the file may break, although the mesh holds it; none where that is nothing.
    fn at_risk(&self, task: &GateTask, report: Option<&GateReport>) -> Option<GateTask> {
        if task.criteria.is_some() {
            // Faces of another kind have other shapes.
            return self.moved.is_some().then(|| task.clone());
        }
        let rows = report.map(|report| report.rows.as_slice()).unwrap_or_default();
        let at_risk = |(check, row): (&Check, &GateRow)| {
            let is_distance = bounds_distance(check);
            let is_safe = is_distance && row.slack.zip(self.moved).is_some_and(|(slack, moved)| moved <= slack);
            // Faces of another kind have other shapes; how far they lie from the reference counts all the same.
            (!is_safe && !check.files && (is_distance || self.moved.is_some())).then(|| check.clone())
        };
        let checks: Vec<Check> = task.checks.iter().zip(rows).filter_map(at_risk).collect();
        (!checks.is_empty()).then_some(GateTask { checks, criteria: None })
    }
}

/// Each corner of the mesh and where its file has it. `None` where the faces of the file are not those of the mesh;
/// formats may list triangles and quads apart.
fn corners(soup: &Soup, file: &Soup) -> Option<Vec<(VertexId, DVec3)>> {
    let of = |soup: &Soup, corners: usize| -> Vec<FaceId> {
        let faces = soup.faces.enumerate().filter(|(_, facet)| facet.corners().len() == corners);
        faces.map(|(face, _)| face).collect()
    };
    let mut pairs = Vec::with_capacity(4 * soup.faces.len());
    for corners in [3, 4] {
        let (ours, theirs) = (of(soup, corners), of(file, corners));
        if ours.len() != theirs.len() {
            return None;
        }
        for (ours, theirs) in ours.into_iter().zip(theirs) {
            let (ours, theirs) = (soup.faces[ours].corners(), file.faces[theirs].corners());
            pairs.extend(ours.iter().zip(theirs).map(|(&our, &their)| (our, file.points[their])));
        }
    }
    Some(pairs)
}

/// What is said of rounding that shows.
fn rounding(soup: &Soup, largest: f64) -> Option<String> {
    let edges = soup.faces.iter().flat_map(|facet| {
        let corners = facet.corners();
        (0..corners.len()).map(move |at| (corners[at], corners[(at + 1) % corners.len()]))
    });
    let shortest = edges.map(|(a, b)| soup.points[a].distance(soup.points[b])).fold(f64::INFINITY, f64::min);
    (largest > TELLING * shortest).then(|| {
        let (largest, shortest) = (short(largest), short(shortest));
        format!("rounding moves vertices by up to {largest}, where the shortest edge is {shortest}")
    })
}

/// Four significant digits.
fn short(number: f64) -> String {
    format!("{number:.3e}").parse().map_or_else(|_| number.to_string(), |rounded: f64| rounded.to_string())
}
