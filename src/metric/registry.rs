//! The list of all metrics: name, unit, direction, what each needs, and the function that measures it.
//!
//! One definition each, used by steps, gates, sweeps, reports and snapshots. A metric is one row in one of the four
//! lists below; its values, where it is the least or largest of many, are named in `gate` for the elements at fault.

use std::sync::LazyLock;

use super::Value;
use super::subject::Subject;

mod mesh;
mod quad;
mod reference;
mod triangle;

pub use reference::lost_groups;

/// The unit of a metric.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unit {
    /// A whole number.
    Count,
    /// Holds or not.
    Flag,
    /// Mesh units; a percent in a gate is one of the diagonal.
    Length,
    /// Squared mesh units.
    Area,
    /// Cubed mesh units.
    Volume,
    /// Degrees.
    Degrees,
    /// A part of the whole, 0 to 1.
    Share,
    /// A number without unit.
    Ratio,
}

/// Which values are good.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    /// More is better.
    Higher,
    /// Less is better.
    Lower,
    /// Neither.
    Neutral,
}

/// What a metric is measured on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Needs {
    /// Any mesh.
    Mesh,
    /// Triangles; undefined without one.
    Triangles,
    /// Quads; undefined without one.
    Quads,
    /// A mesh and a reference.
    Reference,
}

/// A metric of the registry.
#[derive(Clone, Copy, Debug)]
pub struct MetricDef {
    /// Its name in recipes and reports.
    pub name: &'static str,
    /// Its unit.
    pub unit: Unit,
    /// Which values are good.
    pub direction: Direction,
    /// What it is measured on.
    pub needs: Needs,
    /// Formula and range.
    pub doc: &'static str,
    /// Measures it; `None` where it is undefined or infinite.
    pub measure: fn(&Subject<'_>) -> Option<Value>,
}

/// The metric of this name.
pub fn find(name: &str) -> Option<&'static MetricDef> {
    METRICS.iter().find(|m| m.name == name)
}

/// Triangles of less stretch are called low: the least that finite-element practice accepts.
pub const LOW_STRETCH: f64 = 0.2;
/// Quads of a lower scaled Jacobian are called low.
pub const LOW_SCALED_JACOBIAN: f64 = 0.2;
/// Quads of a larger warp angle, in degrees, are called folded.
pub const FOLDED: f64 = 30.0;

const fn metric(
    name: &'static str,
    unit: Unit,
    direction: Direction,
    needs: Needs,
    doc: &'static str,
    measure: fn(&Subject<'_>) -> Option<Value>,
) -> MetricDef {
    MetricDef { name, unit, direction, needs, doc, measure }
}

#[expect(clippy::unnecessary_wraps, reason = "every row gives an optional value")]
fn flag(holds: bool) -> Option<Value> {
    Some(Value::Flag(holds))
}

/// All metrics, in the order of reports.
pub static METRICS: LazyLock<Vec<MetricDef>> =
    LazyLock::new(|| [mesh::METRICS, triangle::METRICS, quad::METRICS, reference::METRICS].concat());

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_kebab_case_and_unique() {
        let mut names: Vec<&str> = METRICS.iter().map(|m| m.name).collect();
        assert!(names.iter().all(|n| n.bytes().all(|b| b.is_ascii_lowercase() || b.is_ascii_digit() || b == b'-')));
        names.sort_unstable();
        let count = names.len();
        names.dedup();
        assert_eq!(names.len(), count);
        assert_eq!(find("min-stretch").map(|m| m.unit), Some(Unit::Ratio));
    }
}
