//! Gates as the recipe states them: a metric, limits, and what it is compared with.

use serde::{Deserialize, Serialize};

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
}
