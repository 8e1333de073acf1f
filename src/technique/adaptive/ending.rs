//! The end of the work, in a guarded mesh: the few poor faces that are left, and the promise.

use super::{Input, RemeshError, Rules};
use crate::mesh::bvh::TriangleBvh;
use crate::mesh::{Surface, resolve_freedom};
use crate::metric::ToleranceMode;
use crate::technique::collapse::{CollapseRules, Goal, Order, Priority};
use crate::technique::guarded::{Counts, GuardedMesh, Limits, Setup, StarRules, open};
use crate::technique::refine::{Flips, MaxEdge, refine};
use crate::technique::remesh::{coarsen, mend_stubborn, raise_stretch, touch_up};
use crate::watch::Watch;

/// What faces are mended to, beyond the least stretch asked for.
const BETTER: f64 = 0.45;
/// The weight of the sharpest lines in the quadrics of merged vertices.
const FEATURE_WEIGHT: f64 = 100.0;
/// Edges that a mesh begins with which is guarded all along, as a part of the longest one.
const DENSE: f64 = 0.5;

/// A mesh with the bound of its distance, where it has one.
pub(super) struct Ended {
    pub(super) surface: Surface,
    /// The mean stretch.
    pub(super) mean: f64,
    pub(super) bound: Option<f64>,
    pub(super) counts: Counts,
}

/// Mends the poor faces of `surface`, and certifies it.
pub(super) fn mend(
    surface: &Surface,
    input: &Input<'_>,
    tree: &TriangleBvh,
    rules: &Rules,
    watch: &Watch,
) -> Result<Ended, RemeshError> {
    let mut guarded = opened(surface, input, tree, rules)?;
    let collapses = collapse_rules(rules);
    raise_stretch(&mut guarded, rules.min_stretch, &collapses, watch)?;
    touch_up(&mut guarded, BETTER.max(rules.min_stretch), &collapses, watch)?;
    mend_stubborn(&mut guarded, &collapses, watch)?;
    Ok(end(guarded, rules))
}

/// Meshes the reference anew in a guarded mesh from the beginning, where sizes alone do not do: slow and sure.
pub(super) fn guarded_all_along(
    input: &Input<'_>,
    tree: &TriangleBvh,
    rules: &Rules,
    watch: &Watch,
) -> Result<Ended, RemeshError> {
    let dense = MaxEdge::Uniform(DENSE * rules.longest);
    let (dense, _) = refine(input.surface, &dense, rules.most_faces, Flips::None, &input.locks, watch)?;
    let mut guarded = opened(&dense, input, tree, rules)?;
    let collapses = collapse_rules(rules);
    raise_stretch(&mut guarded, rules.min_stretch, &collapses, watch)?;
    coarsen(&mut guarded, &collapses, Goal { faces: 0, mean_stretch: rules.mean_stretch }, watch)?;
    Ok(end(guarded, rules))
}

fn opened<'a>(
    surface: &Surface,
    input: &Input<'a>,
    tree: &'a TriangleBvh,
    rules: &Rules,
) -> Result<GuardedMesh<'a>, RemeshError> {
    let setup = Setup {
        mode: ToleranceMode::Distance,
        tolerance: rules.promise,
        feature_tolerance: rules.curve_tolerance,
        feature_weight: FEATURE_WEIGHT,
        limits: Limits {
            min_stretch: rules.min_stretch,
            max_size: rules.max_size.clone(),
            max_valence: rules.max_valence,
        },
        may_merge_corners: input.locks.keep.is_empty() && input.locks.only.is_empty(),
    };
    let freedom = resolve_freedom(surface, &input.locks)?;
    Ok(open(surface, &freedom, input.surface, tree, setup)?)
}

fn collapse_rules(rules: &Rules) -> CollapseRules {
    CollapseRules {
        star: StarRules { min_stretch: rules.min_stretch, ..StarRules::default() },
        order: Order::OnSurface,
        priority: Priority::SmallFirst { size: 1.0 },
    }
}

fn end(mut guarded: GuardedMesh<'_>, rules: &Rules) -> Ended {
    let (counts, bound) = (guarded.counts(), guarded.certified_distance(rules.promise));
    Ended { mean: guarded.mean_stretch(), surface: guarded.into_mesh().leave().surface, bound, counts }
}
