//! Criteria on the page: bars of the elements in each class, and a colouring of the mesh by class.

use std::sync::Arc;

use serde::Serialize;

use super::column::{Column, Merge, Ramp, face_column};
use super::text::{FaultView, digits, short};
use crate::mesh::Soup;
use crate::metric::Subject;
use crate::metric::element::find;
use crate::metric::gate::Fault;
use crate::metric::gate::criteria::{CriteriaReport, CriterionRow, LEVELS, is_undefined, levels};
use crate::report::picture::ramp::{QUALITY, css};
use crate::report::table::criteria::{limit, value};
use crate::report::table::grouped;
use crate::watch::Watch;

/// A standard as the page shows it.
#[derive(Serialize)]
pub(super) struct CriteriaView {
    name: String,
    index: String,
    verdict: &'static str,
    class: &'static str,
    /// What the bars mean.
    key: Vec<(&'static str, String)>,
    whole: Vec<Part>,
    rows: Vec<RowView>,
    worst: Option<FaultView>,
}

#[derive(Serialize)]
struct RowView {
    metric: String,
    doc: &'static str,
    limit: String,
    value: String,
    weight: String,
    index: String,
    passed: bool,
    bar: Vec<Part>,
    worst: Option<FaultView>,
}

/// A part of a bar.
#[derive(Serialize)]
struct Part {
    level: &'static str,
    colour: String,
    count: String,
    share: f64,
}

/// The colour of a class: that of the ramp of quality.
fn colour(level: usize) -> String {
    css(QUALITY[LEVELS.len() - 1 - level].map(f64::from))
}

/// A standard that judged a step.
pub(super) fn view(report: &CriteriaReport, step: &str) -> CriteriaView {
    let (verdict, class) = if report.passed() { ("passed", "good") } else { ("failed", "bad") };
    CriteriaView {
        name: report.name.clone(),
        index: short(report.quality_index),
        verdict,
        class,
        key: LEVELS.iter().enumerate().map(|(level, name)| (*name, colour(level))).collect(),
        whole: bar(report.levels),
        rows: report.rows.iter().map(|row| row_view(row, step)).collect(),
        worst: report.worst.as_ref().map(|fault| fault_view(fault, step)),
    }
}

fn row_view(row: &CriterionRow, step: &str) -> RowView {
    RowView {
        metric: row.metric.clone(),
        doc: find(&row.metric).map_or("", |metric| metric.doc),
        limit: limit(row),
        value: value(row),
        weight: short(row.weight),
        index: short(row.quality_index),
        passed: row.passed,
        bar: bar(row.levels),
        worst: row.worst.first().map(|fault| fault_view(fault, step)),
    }
}

fn fault_view(fault: &Fault, step: &str) -> FaultView {
    FaultView {
        mesh: step.to_owned(),
        label: format!("face {}", fault.id),
        value: if is_undefined(fault.value) { "degenerate".to_owned() } else { short(fault.value) },
        at: fault.at.map(|x| digits(x, 5)).join(", "),
        place: fault.at.map(|x| x.to_string()).join(","),
    }
}

/// The classes that have elements; each part is wide enough to be seen.
fn bar(levels: [u64; 5]) -> Vec<Part> {
    let total = levels.iter().sum::<u64>().max(1) as f64;
    let parts = levels.into_iter().enumerate().filter(|(_, count)| *count > 0);
    parts
        .map(|(level, count)| Part {
            level: LEVELS[level],
            colour: colour(level),
            count: grouped(count),
            share: (100.0 * count as f64 / total).max(0.5),
        })
        .collect()
}

/// A standard with what its mesh was compared with.
#[derive(Clone)]
pub(super) struct Judged<'a> {
    pub(super) report: &'a CriteriaReport,
    pub(super) reference: Option<Arc<Soup>>,
}

/// The classes of the faces as numbers to colour by: 4 for ideal, 0 for worst.
pub(super) fn column(mesh: &Soup, judged: &Judged<'_>) -> Column {
    let watch = Watch::silent();
    let subject = Subject::new(mesh, judged.reference.as_deref(), &watch);
    let best = LEVELS.len() - 1;
    let values = levels(&subject, judged.report).into_iter();
    let values = values.map(|level| level.map_or(f64::NAN, |level| (best - level) as f64)).collect();
    let name = &judged.report.name;
    let title = format!("Criteria {name} (4 ideal, 3 good, 2 warn, 1 fail, 0 worst)");
    let column = face_column(&format!("criteria-{name}"), &title, "", values);
    Column { ramp: Ramp::Quality, range: [0.0, best as f64], merge: Merge::Least, ..column }
}
