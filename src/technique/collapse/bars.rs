//! What bars collapses: the tests of an edit, asked without doing it.
//!
//! A position is barred by the first test that refuses it; an edge by the latest of these over its positions, as that
//! one is the nearest to being admitted.

use glam::DVec3;
use schemars::JsonSchema;
use serde::Serialize;

use crate::mesh::EdgeId;
use crate::technique::guarded::{GuardedMesh, Refused, StarRules};

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
    /// Counts an edge whose collapse this test refuses, or none does.
    pub fn add(&mut self, bar: Result<(), Refused>) {
        let count = match bar {
            Err(Refused::Topology) => &mut self.topology,
            Err(Refused::Features) => &mut self.features,
            Err(Refused::Valence) => &mut self.valence,
            Err(Refused::Shape | Refused::Gain | Refused::Outdated | Refused::Extent) => &mut self.aspect_ratio,
            Err(Refused::FoldOver) => &mut self.fold_over,
            Err(Refused::Curves) => &mut self.feature_tolerance,
            Err(Refused::Tolerance) => &mut self.tolerance,
            Err(Refused::Intersection) => &mut self.intersection,
            Ok(()) => &mut self.none,
        };
        *count += 1;
    }
}

/// Positions along an edge that are asked.
const SHARES: [f64; 3] = [0.5, 0.0, 1.0];

/// Which test bars the collapse of an edge at its middle and at both ends; the mesh and all counts stay as they are.
///
/// # Errors
/// The latest of the tests that are the first against a position.
pub fn bar_of(
    guarded: &mut GuardedMesh<'_>,
    edge: EdgeId,
    rules: &StarRules,
    most_valence: usize,
) -> Result<(), Refused> {
    let merge = guarded.plan_edge(edge, rules)?;
    if guarded.rim().count() > most_valence {
        return Err(Refused::Valence);
    }
    let [a, b] = [merge.ends[0], merge.ends[1]].map(|v| guarded.mesh().point(v));
    let mut worst = Refused::Shape;
    let mut asked: Option<DVec3> = None;
    for p in SHARES.map(|share| merge.placement.nearest(a + share * (b - a))) {
        if asked != Some(p) {
            match guarded.would_merge(&merge, p) {
                Ok(()) => return Ok(()),
                Err(bar) => worst = worst.max(bar),
            }
        }
        asked = Some(p);
    }
    Err(worst)
}
