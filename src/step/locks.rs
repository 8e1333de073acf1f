//! The keys that all editing steps share: what must stay, what may only change along its curve.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::mesh::{LockRules, Rim};

/// What edits may do to the rims of an open surface.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Boundary {
    /// Rim vertices and edges are identical in the result.
    Exact,
    /// Rims may be split and collapsed along themselves.
    #[default]
    Curve,
    /// Rims may move within the step's tolerance.
    Free,
}

/// The common keys of editing steps.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default, rename_all = "kebab-case")]
pub struct Locks {
    /// Groups whose elements are identical in the result.
    pub keep: Vec<String>,
    /// Groups whose edges, or whose borders for face groups, may only be split or collapsed along their curve.
    pub on_curve: Vec<String>,
    /// Face groups that may change; everything else is kept. Empty: the whole mesh.
    pub only: Vec<String>,
    /// What happens to the rims of an open surface.
    pub boundary: Boundary,
}

impl Locks {
    /// The same locks as the kernel resolves them.
    pub fn rules(&self) -> LockRules<'_> {
        let rim = match self.boundary {
            Boundary::Exact => Rim::Exact,
            Boundary::Curve => Rim::Curve,
            Boundary::Free => Rim::Free,
        };
        LockRules { keep: &self.keep, on_curve: &self.on_curve, only: &self.only, rim }
    }
}
