//! What bars a collapse: the tests of an edit, asked without doing it.
//!
//! A position is barred by the first test that refuses it; an edge by the latest of these over its positions, as that
//! one is the nearest to being admitted.

use glam::DVec3;
use schemars::JsonSchema;
use serde::Serialize;

use super::editor::{CollapseRules, Editor};
use crate::mesh::EdgeId;
use crate::mesh::edit::{Refusal, check_collapse};

/// What refuses the collapse of an edge, in the order of the tests.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Bar {
    /// The surface would change its topology.
    Topology,
    /// Marked curves, their corners, seams, regions or locks stay.
    Features,
    /// A vertex would have too many edges.
    Valence,
    /// A face would be worse than the least stretch and than what was there, or too large.
    Shape,
    /// A face would turn over.
    FoldOver,
    /// A marked curve would move too far.
    Curves,
    /// The surface would leave the tolerance.
    Tolerance,
    /// Faces would intersect.
    Intersection,
    /// No test does.
    Nothing,
}

/// Edges by what bars their collapse.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub struct Bars {
    /// The topology would change.
    pub topology: usize,
    /// Marked curves, smooth borders of flat faces, regions or locks hold both ends apart.
    pub features: usize,
    /// A vertex would have too many edges.
    pub valence: usize,
    /// A face would break the aspect ratio or the size allowed.
    pub aspect_ratio: usize,
    /// A face would turn over.
    pub fold_over: usize,
    /// A marked curve would move by more than `feature-tolerance`.
    pub feature_tolerance: usize,
    /// The surface would leave `tolerance`.
    pub tolerance: usize,
    /// Faces would intersect.
    pub intersection: usize,
    /// No test refuses the collapse; the order of the work did not come to it.
    pub none: usize,
}

impl Bars {
    /// Counts an edge.
    pub fn add(&mut self, bar: Bar) {
        let count = match bar {
            Bar::Topology => &mut self.topology,
            Bar::Features => &mut self.features,
            Bar::Valence => &mut self.valence,
            Bar::Shape => &mut self.aspect_ratio,
            Bar::FoldOver => &mut self.fold_over,
            Bar::Curves => &mut self.feature_tolerance,
            Bar::Tolerance => &mut self.tolerance,
            Bar::Intersection => &mut self.intersection,
            Bar::Nothing => &mut self.none,
        };
        *count += 1;
    }
}

/// Positions along an edge that are asked.
const SHARES: [f64; 3] = [0.5, 0.0, 1.0];

impl Editor<'_> {
    /// What bars the collapse of an edge at its middle and at both ends; the mesh and all counts stay as they are.
    pub fn bar_of(&mut self, edge: EdgeId, rules: &CollapseRules, most_valence: usize) -> Bar {
        let plan = match check_collapse(&self.mesh, edge) {
            Ok(plan) => plan,
            Err(Refusal::Boundary | Refusal::LinkCondition { .. } | Refusal::FourFaces) => return Bar::Topology,
            Err(_) => return Bar::Features,
        };
        let counts = self.counts;
        let [a, b] = [plan.removed, plan.kept].map(|v| self.mesh.point(v));
        let Some(merge) = self.plan_edge(edge, rules) else { return Bar::Valence };
        if self.rim().count() > most_valence {
            return Bar::Valence;
        }
        let mut worst = Bar::Shape;
        let mut asked: Option<DVec3> = None;
        for p in SHARES.map(|share| merge.placement.nearest(a + share * (b - a))) {
            if asked != Some(p) {
                worst = worst.max(self.bar_at(&merge, p, rules));
            }
            asked = Some(p);
        }
        self.counts = counts;
        worst
    }
}
