//! One collapse of an edge by rules: the first of the candidate positions that all tests admit.

use super::placement::Order;
use super::priority::Priority;
use crate::mesh::{EdgeId, VertexId};
use crate::technique::guarded::{GuardedMesh, StarRules};

/// How collapses are chosen, and what each must keep.
#[derive(Clone, Copy, Debug)]
pub struct CollapseRules {
    /// What the new star must keep.
    pub star: StarRules,
    /// Candidate order.
    pub order: Order,
    /// The index of an admitted collapse.
    pub priority: Priority,
}

/// What became of a collapse.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Attempt {
    /// It is done; this is the merged vertex.
    Collapsed(VertexId),
    /// Cheap tests admit it, with this index, which is less than was asked.
    Postponed(f32),
    /// A test refuses it.
    Refused,
}

/// A cheap stand-in for [`rate`]; `None` where the priority has none.
pub(super) fn estimate(guarded: &GuardedMesh<'_>, edge: EdgeId, rules: &CollapseRules) -> Option<f32> {
    let mesh = guarded.mesh();
    let [a, b] = mesh.ends(edge).map(|v| mesh.point(v));
    rules.priority.estimate(a.distance(b))
}

/// The index of the edge's collapse where cheap tests admit one; `None` where not.
pub(super) fn rate(guarded: &mut GuardedMesh<'_>, edge: EdgeId, rules: &CollapseRules) -> Option<f32> {
    let plan = guarded.plan_collapse(edge, &rules.star).ok()?;
    let place = rules.order.candidates(plan.site()).find_map(|p| guarded.place(&plan, p).ok())?;
    Some(rules.priority.index(&place.before, &place.after))
}

/// Collapses the edge where all tests admit it; the first candidate that passes wins.
pub fn collapse_edge(guarded: &mut GuardedMesh<'_>, edge: EdgeId, rules: &CollapseRules) -> Option<VertexId> {
    match collapse_from(guarded, edge, rules, f32::NEG_INFINITY) {
        Attempt::Collapsed(merged) => Some(merged),
        Attempt::Postponed(_) | Attempt::Refused => None,
    }
}

/// Collapses the edge where all tests admit it and its index is at least `least`.
pub(super) fn collapse_from(guarded: &mut GuardedMesh<'_>, edge: EdgeId, rules: &CollapseRules, least: f32) -> Attempt {
    let Ok(plan) = guarded.plan_collapse(edge, &rules.star) else { return Attempt::Refused };
    let site = plan.site();
    let mut last = None;
    for wish in rules.order.candidates(site) {
        let at = site.placement.nearest(wish);
        if last == Some(at) {
            continue;
        }
        let Ok(place) = guarded.place(&plan, wish) else { continue };
        if last.is_none() {
            let index = rules.priority.index(&place.before, &place.after);
            if index < least {
                return Attempt::Postponed(index);
            }
        }
        last = Some(at);
        if let Ok(merged) = guarded.collapse(&plan, &place) {
            return Attempt::Collapsed(merged);
        }
    }
    Attempt::Refused
}
