//! Gates: what a mesh must hold, whether it does, and which elements are at fault.
//!
//! A check names one metric of the registry and one or more bounds. Bounds on lengths may be percents of the
//! bounding-box diagonal of the reference named by the check, else of the mesh itself. A gate is evaluated on plain
//! meshes; which step's mesh is meant is the planner's business.

use serde::{Deserialize, Serialize};

mod column;
pub mod criteria;
mod evaluate;
mod fault;

pub use evaluate::{GateError, bounds_distance, evaluate, judge, judges_faces};

/// A bound of a check, as the recipe gives it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Limit {
    /// A number in the metric's unit: mesh units, degrees, a share from 0 to 1, a count.
    Number(f64),
    /// Percent: of the diagonal for lengths, of 1 for shares.
    Percent(f64),
    /// For metrics that hold or not.
    Flag(bool),
}

/// One line of a gate: a metric and what it must be.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default, rename_all = "kebab-case")]
pub struct Check {
    /// The metric's name in the registry.
    pub metric: String,
    /// The value must be at least this.
    pub at_least: Option<Limit>,
    /// The value must be at most this.
    pub at_most: Option<Limit>,
    /// The value must be exactly this.
    pub equals: Option<Limit>,
    /// The value must equal that of the reference: `euler-characteristic = { same-as = "clean" }`.
    pub same_as_reference: bool,
    /// The value must not exceed that of the reference: no new self-intersections.
    pub no_more_than_reference: bool,
    /// The step that the check compares with, named by `to`, `same-as` or `no-more-than`; absent where none is needed.
    pub reference: Option<String>,
    /// Face groups that are not judged.
    pub except: Vec<String>,
    /// Files written of the mesh must hold it too, read back: `groups-kept` alone asks for that, for what is measured
    /// on a mesh is judged on its files anyway.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub files: bool,
}

/// An element that fails a check.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct Fault {
    /// What sort of element.
    pub kind: FaultKind,
    /// Its number in the mesh.
    pub id: u32,
    /// Its centre.
    pub at: [f64; 3],
    /// What was measured there.
    pub value: f64,
}

/// What sort of element is at fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum FaultKind {
    /// A face of the mesh.
    Face,
    /// A vertex of the mesh.
    Vertex,
    /// A face of the reference: the mesh is missing there.
    ReferenceFace,
}

/// Where most of the faces at fault lie, where that tells what to turn. With their number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Cause {
    /// From one marked curve to another that runs close to it.
    BetweenCurves(u64),
    /// In a corner between two marked edges.
    AtCurves(u64),
}

/// The outcome of one check.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct GateRow {
    /// The metric's name.
    pub metric: String,
    /// The bound in words, resolved: `at most 0.2% = 0.41`.
    pub limit: String,
    /// What was measured over the elements judged; absent where the metric is undefined.
    pub measured: Option<super::Value>,
    /// Whether the check holds. An undefined metric fails, unless there is no element that it could be measured on.
    pub passed: bool,
    /// How far the value lies on the right side of its bound, in the metric's unit; negative when it fails.
    pub slack: Option<f64>,
    /// How many elements are at fault.
    pub fault_count: u64,
    /// The elements at fault, worst first, at most [`MAX_FAULTS`].
    pub faults: Vec<Fault>,
    /// Faces excused, worst first, at most [`MAX_FAULTS`].
    pub excused: Vec<Fault>,
    /// Where the faces at fault lie, for checks of shape.
    #[serde(default)]
    pub cause: Option<Cause>,
    /// What else there is to say: excused faces and why, a bound that was not met exactly.
    pub note: Option<String>,
}

/// The outcome of all checks of a gate.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GateReport {
    /// One row a check, in order; of criteria, one row for all of them.
    pub rows: Vec<GateRow>,
    /// What stands behind the row of criteria.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub criteria: Option<criteria::CriteriaReport>,
}

impl GateReport {
    /// Whether all checks hold.
    pub fn passed(&self) -> bool {
        self.rows.iter().all(|row| row.passed)
    }
}

/// How many faults a row lists.
pub const MAX_FAULTS: usize = 1000;

#[cfg(test)]
mod tests;
