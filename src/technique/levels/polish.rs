//! Bettering an extracted front by edits that were never seen while recording, each one certified.
//!
//! Flips and relaxation as after a simplification, held to what the front already keeps: its least stretch, its largest
//! side, its largest valence, its distance to the finest mesh. So a polished front keeps every threshold that the front
//! kept, and is no farther from the finest mesh.

use schemars::JsonSchema;
use serde::Serialize;

use crate::mesh::bvh::TriangleBvh;
use crate::mesh::{LockRules, Surface, resolve_freedom};
use crate::metric::ToleranceMode;
use crate::technique::guarded::{Limits, Setup, SizeField, open};
use crate::technique::remesh::optimise;
use crate::watch::{Cancelled, Watch};

/// Rounds of flips and relaxation.
const ROUNDS: usize = 8;

/// The room for rounding in thresholds that the front itself sets.
const SLACK: f64 = 1e-6;

/// What thresholds are asked of.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shape {
    pub(super) min_stretch: f64,
    pub(super) mean_stretch: f64,
    pub(super) max_size: f64,
    pub(super) max_valence: usize,
}

/// What polishing did.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub struct PolishReport {
    /// Edges flipped.
    pub flips: usize,
    /// Vertices moved.
    pub moves: usize,
    /// Least stretch before.
    pub min_stretch_before: f64,
    /// Mean stretch before.
    pub mean_stretch_before: f64,
}

/// Polishes `mesh`, a front of the hierarchy of `finest` with the shape `before`, within `reach` of `finest`.
///
/// A front on the finest mesh (`reach` 0) and a mesh that the guarded cannot take are left as they are.
pub(super) fn polish(
    mesh: &Surface,
    finest: &Surface,
    before: Shape,
    reach: f64,
    watch: &Watch,
) -> Result<Option<(Surface, PolishReport)>, Cancelled> {
    let Ok(freedom) = resolve_freedom(mesh, &LockRules::default()) else { return Ok(None) };
    let setup = Setup {
        mode: ToleranceMode::Distance,
        tolerance: reach,
        feature_tolerance: reach,
        feature_weight: 1.0,
        limits: Limits {
            min_stretch: before.min_stretch * (1.0 - SLACK),
            max_size: SizeField::Uniform(before.max_size * (1.0 + SLACK)),
            max_valence: before.max_valence,
        },
        may_merge_corners: false,
    };
    let tree = TriangleBvh::of_surface(finest);
    let Ok(mut guarded) = open(mesh, &freedom, finest, &tree, setup) else { return Ok(None) };
    optimise(&mut guarded, ROUNDS, watch)?;
    let counts = guarded.counts();
    let report = PolishReport {
        flips: counts.flips,
        moves: counts.moves,
        min_stretch_before: before.min_stretch,
        mean_stretch_before: before.mean_stretch,
    };
    Ok(Some((guarded.into_mesh().leave().surface, report)))
}
