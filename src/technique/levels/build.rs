//! Making a hierarchy: the surface as good as its thresholds ask, then collapses alone, all of them recorded.
//!
//! What a front shows was seen while recording, so thresholds hold on every front if they hold on the finest one. That
//! is why faces that break the least stretch are mended *before* the record begins.

use crate::mesh::bvh::TriangleBvh;
use crate::mesh::halfedge::EnterError;
use crate::mesh::transfer::inherit_fields;
use crate::mesh::{FreedomError, Hierarchy, LockRules, Surface, resolve_freedom};
use crate::technique::collapse::{CollapseRules, Goal, simplify};
use crate::technique::curvature::{Principal, mean_edge, principal_curvatures};
use crate::technique::guarded::{Counts, Setup, open};
use crate::technique::hierarchy::Recorder;
use crate::technique::remesh::{coarsen_purely, optimise, raise_stretch};
use crate::watch::{Cancelled, Watch};

/// Curvatures are averaged over balls of this many mean edges.
const CURVATURE_RADIUS: f64 = 2.5;

/// Rounds of flips and relaxation before the record begins.
const ROUNDS: usize = 8;

/// What a hierarchy is made of.
#[derive(Clone, Copy, Debug)]
pub struct Source<'a> {
    /// The surface before simplification.
    pub surface: &'a Surface,
    /// What the tolerance is measured against.
    pub reference: &'a Surface,
    /// The boxes over the reference, see [`crate::technique::guarded::reference_tree`].
    pub tree: &'a TriangleBvh,
    /// What must stay.
    pub locks: LockRules<'a>,
}

/// A hierarchy and what was done for it.
#[derive(Clone, Debug)]
pub struct Recorded {
    /// The hierarchy.
    pub hierarchy: Hierarchy,
    /// Edits before the record and in it.
    pub counts: Counts,
    /// The certified distance of the coarsest front, see [`crate::technique::guarded::GuardedMesh::distance_bound`].
    pub distance_bound: Option<f64>,
}

/// Mends faces below the least stretch, optimises where asked, then records collapses until no edge is valid.
///
/// With `optimise_first`, collapses that leave good faces come first, so that medium resolutions are made of those.
///
/// # Errors
/// A lock that names no group, a surface that is no oriented 2-manifold, an interrupted run.
pub fn build<E>(
    source: Source<'_>,
    setup: &Setup,
    rules: &CollapseRules,
    optimise_first: bool,
    watch: &Watch,
) -> Result<Recorded, E>
where
    E: From<FreedomError> + From<EnterError> + From<Cancelled>,
{
    let Source { surface, reference, tree, locks } = source;
    let freedom = resolve_freedom(surface, &locks)?;
    let mut guarded = open(surface, &freedom, reference, tree, setup.clone())?;
    raise_stretch(&mut guarded, rules.star.min_stretch, rules, watch)?;
    if optimise_first {
        optimise(&mut guarded, ROUNDS, watch)?;
        raise_stretch(&mut guarded, rules.star.min_stretch, rules, watch)?;
    }
    let before = guarded.counts();
    let mut finest = guarded.into_mesh().leave().surface;
    inherit_fields(surface, &mut finest);
    watch.phase("curvature", None);
    let curvature = principal_curvatures(&finest, CURVATURE_RADIUS * mean_edge(&finest), watch)?;
    let curvature = curvature.iter().map(Principal::largest).collect();

    let freedom = resolve_freedom(&finest, &locks)?;
    let mut guarded = open(&finest, &freedom, reference, tree, setup.clone())?;
    guarded.record(Recorder::new(finest.clone(), curvature));
    if optimise_first {
        coarsen_purely(&mut guarded, rules, watch)?;
    } else {
        simplify(&mut guarded, rules, Goal::default(), watch)?;
    }
    let hierarchy = guarded.take_recorder().map(Recorder::finish).unwrap_or_default();
    let distance_bound = guarded.distance_bound(setup.tolerance);
    Ok(Recorded { hierarchy, counts: before + guarded.counts(), distance_bound })
}
