//! Gates as the recipe states them: a metric, limits, and what it is compared with.

use std::fmt;

use serde::{Deserialize, Serialize};

/// One requirement on a mesh.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Check {
    /// Name in the registry of metrics.
    pub metric: String,
    /// The smallest value that passes.
    pub at_least: Option<Limit>,
    /// The largest value that passes.
    pub at_most: Option<Limit>,
    /// The only value that passes.
    pub equals: Option<Limit>,
    /// Which elements do not count.
    pub except: Option<Except>,
}

/// A threshold.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Limit {
    /// In the unit of the metric.
    Number(f64),
    /// Percent, as written: of the diagonal of the step compared with for a length, of one for a share.
    Percent(f64),
    /// A property that must hold or not.
    Flag(bool),
}

impl fmt::Display for Limit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Number(value) => write!(f, "{value}"),
            Self::Percent(value) => write!(f, "{value}%"),
            Self::Flag(value) => write!(f, "{value}"),
        }
    }
}

/// Elements that a check does not count.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Except {
    /// Faces in which marked features meet below the angle that the threshold asks for.
    FeatureAngle,
}
