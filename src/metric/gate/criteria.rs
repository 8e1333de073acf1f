//! Criteria: a standard for elements, and how well a mesh keeps it.
//!
//! # Algorithm
//! A [`Criterion`] names a metric of elements and five levels of it, from ideal over good, warn and fail to worst. The
//! value of an element becomes a penalty: 0 up to good, then linear between the [`PENALTIES`] of the levels (0, 0, 0.8,
//! 1, 10), and that of worst beyond it. An element passes where its value is no worse than fail. From the penalties
//! p with the weights w of the criteria:
//!
//! - of an element: the weighted mean of the penalties that pass + the weighted sum of those that fail,
//!   `Σ w p / Σ w` over what passes `+ Σ w p` over what fails;
//! - of a criterion: the mean of the penalties of the elements that pass + the sum of those that fail;
//! - of the mesh, the **quality index**: the weighted mean of the criteria that no element fails + the weighted sum of
//!   the others. 0 is best; a mesh without a failing element has at most 1.
//!
//! # Source
//! Altair HyperMesh, "Quality Index Calculations": levels, penalties and the three indices. That page weights within a
//! criterion too, where all weights are one and the same; here the weight counts once, between criteria.
//!
//! # Invariants
//! - Sums run in the order of faces and criteria, so that an index has the same bits everywhere.
//! - What is judged is what is told: levels are resolved once, and the report carries them.
//! - A criterion that no element could be judged by passes with the index 0, and its row says so.
//!
//! # Cost
//! O(F) a criterion, besides what its metric costs.

use std::collections::BTreeSet;

use serde::{Deserialize, Serialize};

use super::super::element::{self, ElementMetric, On};
use super::super::registry::{Direction, Unit};
use super::super::summary::sum;
use super::super::{Subject, Value};
use super::column::fault_at;
use super::fault::members;
use super::{Fault, FaultKind, GateRow, Limit, MAX_FAULTS};
use crate::watch::Cancelled;

/// The penalties at ideal, good, warn, fail and worst where criteria name no others.
pub const PENALTIES: [f64; 5] = [0.0, 0.0, 0.8, 1.0, 10.0];

/// The names of the levels, and of the classes that they bound: an element is as good as its level and worse than the
/// one before it.
pub const LEVELS: [&str; 5] = ["ideal", "good", "warn", "fail", "worst"];

/// Elements of each criterion that a report names, worst first.
pub const NAMED: usize = 12;

/// Values this much beyond a level, relative to it, still count as within: steps are given the same numbers.
const ROUNDING: f64 = 1e-9;

/// A level for a metric: what is good, and what is not.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Criterion {
    /// The metric of elements.
    pub metric: String,
    /// Ideal, good, warn, fail and worst.
    pub levels: [Limit; 5],
    /// How much it counts in the indices.
    pub weight: f64,
}

/// A named standard.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Criteria {
    /// What people call it.
    pub name: String,
    /// Penalties at the five levels.
    pub penalties: [f64; 5],
    /// The criteria that are on, in the order of the metrics.
    pub criteria: Vec<Criterion>,
    /// Face groups that are not judged.
    pub except: Vec<String>,
}

impl Criteria {
    /// The first criterion that compares with a reference.
    pub fn compares(&self) -> Option<&'static ElementMetric> {
        self.criteria.iter().filter_map(|criterion| element::find(&criterion.metric)).find(|m| m.needs_reference())
    }
}

/// How well a mesh keeps a standard.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct CriteriaReport {
    /// The standard.
    pub name: String,
    /// Face groups that were not judged.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub except: Vec<String>,
    /// The compound index, 0 at best.
    pub quality_index: f64,
    /// Faces by the worst class that any criterion puts them in: ideal, good, warn, fail, worst.
    pub levels: [u64; 5],
    /// The face of the largest index of its own, with that index.
    pub worst: Option<Fault>,
    /// The criteria.
    pub rows: Vec<CriterionRow>,
}

/// How well a mesh keeps one criterion.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct CriterionRow {
    /// The metric of elements.
    pub metric: String,
    /// How much it counts.
    pub weight: f64,
    /// Ideal, good, warn, fail and worst, as numbers.
    pub limits: [f64; 5],
    /// Elements in each class: no worse than good is `ideal`, no worse than warn is `good`, no worse than fail is
    /// `warn`, no worse than worst is `fail`, all others are `worst`.
    pub levels: [u64; 5],
    /// Its own index.
    pub quality_index: f64,
    /// Whether no element is worse than fail.
    pub passed: bool,
    /// The worst value; absent where there is no element to judge.
    pub value: Option<f64>,
    /// The worst elements, worst first, at most [`NAMED`]; none for a metric of the whole mesh.
    pub worst: Vec<Fault>,
}

impl CriteriaReport {
    /// Whether no element fails any criterion.
    pub fn passed(&self) -> bool {
        self.rows.iter().all(|row| row.passed)
    }
}

/// Why a mesh cannot be judged.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CriteriaError {
    /// No metric of elements has this name.
    #[error("there is no metric of elements `{0}`")]
    UnknownMetric(String),
    /// A criterion compares with another mesh, and none was given.
    #[error("the criterion `{0}` needs a mesh to compare with")]
    NoReference(String),
    /// The run was interrupted.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

/// Where a value lies between five levels.
#[derive(Clone, Copy, Debug)]
pub struct Scale {
    /// 1 where low is good, −1 where high is.
    sign: f64,
    limits: [f64; 5],
    penalties: [f64; 5],
}

impl Scale {
    /// A scale for values of which those in `direction` are good.
    pub fn new(direction: Direction, limits: [f64; 5], penalties: [f64; 5]) -> Self {
        Self { sign: if direction == Direction::Higher { -1.0 } else { 1.0 }, limits, penalties }
    }

    /// The penalty of a value; that of the worst level where it is not a number.
    pub fn penalty(&self, value: f64) -> f64 {
        if value.is_nan() {
            return self.penalties[4];
        }
        let [value, limits] = [[value; 5], self.limits].map(|v| v.map(|v| self.sign * v));
        let value = value[0];
        if value <= limits[0] {
            return self.penalties[0];
        }
        let Some(i) = (0..4).find(|&i| value <= limits[i + 1]) else { return self.penalties[4] };
        let part = (value - limits[i]) / (limits[i + 1] - limits[i]);
        self.penalties[i] + part * (self.penalties[i + 1] - self.penalties[i])
    }

    /// The class of a value, an index of [`LEVELS`].
    pub fn level(&self, value: f64) -> usize {
        let within = |limit: f64| self.sign * value <= self.sign * limit + ROUNDING * limit.abs();
        (0..4).find(|&i| within(self.limits[i + 1])).unwrap_or(4)
    }

    /// Which of two values is worse: the larger of these numbers.
    fn badness(&self, value: f64) -> f64 {
        if value.is_nan() { f64::INFINITY } else { self.sign * value }
    }

    /// The value as a table can hold it: the end of the bad side where it is not a number or infinite.
    fn finite(&self, value: f64) -> f64 {
        if value.is_nan() { self.sign * f64::MAX } else { value.clamp(-f64::MAX, f64::MAX) }
    }
}

/// Whether a value of a report stands for one that is not a number or infinite.
pub fn is_undefined(value: f64) -> bool {
    value.abs() >= f64::MAX
}

/// The class that fails first.
const FAILS: usize = 3;

/// What the criteria say of each face, added up.
#[derive(Clone, Copy, Debug, Default)]
struct Tally {
    /// The worst class.
    level: usize,
    passing: f64,
    passing_weight: f64,
    failing: f64,
}

impl Tally {
    fn add(&mut self, level: usize, penalty: f64, weight: f64) {
        self.level = self.level.max(level);
        if level >= FAILS {
            self.failing += weight * penalty;
        } else {
            self.passing += weight * penalty;
            self.passing_weight += weight;
        }
    }

    fn index(&self) -> f64 {
        ratio(self.passing, self.passing_weight) + self.failing
    }
}

fn ratio(above: f64, below: f64) -> f64 {
    if below > 0.0 { above / below } else { 0.0 }
}

/// Judges a mesh by a standard.
///
/// # Errors
/// Where a metric is unknown, or compares and the subject has no reference; when the run was interrupted.
pub fn judge(subject: &Subject<'_>, criteria: &Criteria) -> Result<(CriteriaReport, GateRow), CriteriaError> {
    let mesh = subject.mesh();
    let except = members(mesh, &criteria.except);
    let mut tallies: Vec<Option<Tally>> = vec![None; mesh.faces.len()];
    let (name, groups) = (criteria.name.clone(), criteria.except.clone());
    let mut report = CriteriaReport { name, except: groups, ..CriteriaReport::default() };
    for criterion in &criteria.criteria {
        let metric = element::find(&criterion.metric);
        let metric = metric.ok_or_else(|| CriteriaError::UnknownMetric(criterion.metric.clone()))?;
        if metric.needs_reference() && subject.reference().is_none() {
            return Err(CriteriaError::NoReference(criterion.metric.clone()));
        }
        subject.watch().check()?;
        let limits = criterion.levels.map(|limit| resolve(subject, metric, limit));
        let scale = Scale::new(metric.direction, limits, criteria.penalties);
        let row = CriterionRow {
            metric: criterion.metric.clone(),
            weight: criterion.weight,
            limits,
            passed: true,
            ..CriterionRow::default()
        };
        report.rows.push(if metric.on() == On::Mesh {
            judge_mesh(subject, metric, &scale, row)
        } else {
            judge_faces(subject, metric, &scale, (&except, &mut tallies), row)
        });
    }
    subject.watch().check()?;
    let indices = report.rows.iter().fold(Tally::default(), |mut tally, row| {
        tally.add(if row.passed { 0 } else { FAILS }, row.quality_index, row.weight);
        tally
    });
    report.quality_index = indices.index().min(f64::MAX);
    let faults = whole(subject, &tallies, &mut report);
    let row = gate_row(&report, faults);
    Ok((report, row))
}

fn resolve(subject: &Subject<'_>, metric: &ElementMetric, limit: Limit) -> f64 {
    match limit {
        Limit::Number(number) => number,
        Limit::Percent(percent) if metric.unit == Unit::Length => percent / 100.0 * subject.extent().bounds.diagonal(),
        Limit::Percent(percent) => percent / 100.0,
        Limit::Flag(flag) => f64::from(u8::from(flag)),
    }
}

/// The whole mesh is one element.
fn judge_mesh(subject: &Subject<'_>, metric: &ElementMetric, scale: &Scale, mut row: CriterionRow) -> CriterionRow {
    let element::Measure::Mesh(measure) = metric.measure else { return row };
    if let Some(value) = measure(subject) {
        let level = scale.level(value);
        row.levels[level] = 1;
        row.passed = level < FAILS;
        row.quality_index = scale.penalty(value);
        row.value = Some(scale.finite(value));
    }
    row
}

fn judge_faces(
    subject: &Subject<'_>,
    metric: &ElementMetric,
    scale: &Scale,
    (except, tallies): (&BTreeSet<u32>, &mut [Option<Tally>]),
    mut row: CriterionRow,
) -> CriterionRow {
    let (mut passing, mut failing) = (Vec::new(), Vec::new());
    let mut worst: Vec<(f64, u32, f64)> = Vec::new();
    for (face, value) in element::values(subject, metric) {
        if except.contains(&face.raw()) {
            continue;
        }
        let (level, penalty) = (scale.level(value), scale.penalty(value));
        row.levels[level] += 1;
        if level < FAILS { &mut passing } else { &mut failing }.push(penalty);
        tallies[face.index()].get_or_insert_default().add(level, penalty, row.weight);
        worst.push((scale.badness(value), face.raw(), value));
    }
    let order = |a: &(f64, u32, f64), b: &(f64, u32, f64)| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1));
    if worst.len() > NAMED {
        worst.select_nth_unstable_by(NAMED, order);
        worst.truncate(NAMED);
    }
    worst.sort_unstable_by(order);
    row.passed = failing.is_empty();
    row.quality_index = ratio(sum(passing.iter().copied()), passing.len() as f64) + sum(failing);
    row.value = worst.first().map(|worst| scale.finite(worst.2));
    let fault =
        |(_, face, value): &(f64, u32, f64)| fault_at(subject.mesh(), FaultKind::Face, *face, scale.finite(*value));
    row.worst = worst.iter().map(fault).collect();
    row
}

/// Classes and indices of the faces; gives those that fail, worst first, with their number.
fn whole(subject: &Subject<'_>, tallies: &[Option<Tally>], report: &mut CriteriaReport) -> (u64, Vec<Fault>) {
    let mut failing = Vec::new();
    let mut worst: Option<(f64, u32)> = None;
    for (face, tally) in (0_u32..).zip(tallies) {
        let Some(tally) = tally else { continue };
        let index = tally.index().min(f64::MAX);
        report.levels[tally.level] += 1;
        if worst.is_none_or(|(most, _)| index > most) {
            worst = Some((index, face));
        }
        if tally.level >= FAILS {
            failing.push((index, face));
        }
    }
    let fault = |(index, face): (f64, u32)| fault_at(subject.mesh(), FaultKind::Face, face, index);
    report.worst = worst.map(fault);
    let count = failing.len() as u64;
    failing.sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    failing.truncate(MAX_FAULTS);
    (count, failing.into_iter().map(fault).collect())
}

/// The standard as one row of a gate: its index, and the elements that fail.
fn gate_row(report: &CriteriaReport, (fault_count, faults): (u64, Vec<Fault>)) -> GateRow {
    let failed: Vec<&str> = report.rows.iter().filter(|row| !row.passed).map(|row| row.metric.as_str()).collect();
    let judged = report.rows.iter().any(|row| row.value.is_some());
    GateRow {
        metric: row_name(&report.name),
        limit: "no element worse than fail".to_owned(),
        measured: Some(Value::Number(report.quality_index)),
        passed: report.passed(),
        slack: None,
        fault_count,
        faults,
        excused: Vec::new(),
        cause: None,
        note: match (judged, failed.is_empty()) {
            (false, _) => Some("there is no element to judge".to_owned()),
            (true, true) => Some("measured: the quality index, 0 at best".to_owned()),
            (true, false) => Some(format!("measured: the quality index; failing: {}", failed.join(", "))),
        },
    }
}

/// The worst class of each face, an index of [`LEVELS`], by a report of its mesh; `None` for faces that no criterion
/// judges. Criteria that compare count only where the subject has a reference.
pub fn levels(subject: &Subject<'_>, report: &CriteriaReport) -> Vec<Option<usize>> {
    let mut levels = vec![None; subject.mesh().faces.len()];
    let except = members(subject.mesh(), &report.except);
    for row in &report.rows {
        let Some(metric) = element::find(&row.metric) else { continue };
        let scale = Scale::new(metric.direction, row.limits, PENALTIES);
        for (face, value) in element::values(subject, metric) {
            if !except.contains(&face.raw()) {
                let level = &mut levels[face.index()];
                *level = Some(scale.level(value).max(level.unwrap_or_default()));
            }
        }
    }
    levels
}

/// What the row of a standard is called in a gate.
pub fn row_name(criteria: &str) -> String {
    format!("criteria {criteria}")
}

#[cfg(test)]
mod tests;
