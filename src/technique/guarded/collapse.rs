//! Collapse of an edge: the caller names positions for the merged vertex and takes the first that it likes.
//!
//! The star of the edge is walked once for all positions ([`super::star`]). A position that the cheap tests admit
//! becomes a [`Place`] with the shape that it gives, by which the caller may choose; only a place can be collapsed to,
//! and then the costly tests decide.

use glam::DVec3;

use super::keeper::Keeper;
use super::limits::{StarRules, least_stretch};
use super::mesh::GuardedMesh;
use super::refused::Refused;
use super::star::Bounds;
use super::tally::Tally;
use crate::mesh::edit::{CollapsePlan, Placement, check_collapse, collapse};
use crate::mesh::halfedge::{edge_of, twin};
use crate::mesh::{EdgeId, Freedom, VertexId};
use crate::technique::quadric::Quadric;

/// Where vertices become one, and what is known there.
#[derive(Clone, Copy, Debug)]
pub struct Site {
    /// Where the merged vertex may lie.
    pub placement: Placement,
    /// The positions of its ends: the vanishing one and the kept one.
    pub ends: [DVec3; 2],
    /// The centroid of the ring.
    pub centroid: DVec3,
    /// Planes of both ends, about `origin`; empty where nothing asks for them.
    pub planes: Quadric,
    /// Lines of both ends, about `origin`; empty where nothing asks for them.
    pub lines: Quadric,
    /// The local origin of the quadrics.
    pub origin: DVec3,
}

/// A collapse that topology, freedom and valence admit. Good until the next edit or plan.
#[derive(Clone, Copy, Debug)]
pub struct Collapse {
    plan: CollapsePlan,
    site: Site,
    rules: StarRules,
    age: [u64; 2],
}

impl Collapse {
    /// What is known of the place.
    pub fn site(&self) -> &Site {
        &self.site
    }
}

/// A position of the merged vertex that the cheap tests admit. Good as long as its [`Collapse`].
#[derive(Clone, Copy, Debug)]
pub struct Place {
    at: DVec3,
    /// The star before.
    pub before: Tally,
    /// The star after.
    pub after: Tally,
    age: [u64; 2],
}

impl Place {
    /// The position.
    pub fn at(&self) -> DVec3 {
        self.at
    }
}

impl GuardedMesh<'_> {
    /// How the ends of an edge may become one, at positions that the caller chooses.
    ///
    /// # Errors
    /// The first reason against any collapse of the edge.
    pub fn plan_collapse(&mut self, edge: EdgeId, rules: &StarRules) -> Result<Collapse, Refused> {
        let plan = check_collapse(&self.mesh, edge)?;
        let valence = self.star.walk(&self.mesh, &plan);
        if valence > self.most_edges_of_merged(&[plan.removed, plan.kept]) || self.star.is_empty() {
            return Err(Refused::Valence);
        }
        let ends = [self.mesh.point(plan.removed), self.mesh.point(plan.kept)];
        self.star.measure(&self.mesh, &self.shapes, ends, rules.mend_below.unwrap_or(0.0));
        let site = Site {
            placement: plan.placement,
            ends,
            centroid: self.star.centroid().ok_or(Refused::Topology)?,
            planes: self.quadrics.planes(plan.removed).plus(self.quadrics.planes(plan.kept)),
            lines: self.quadrics.lines(plan.removed).plus(&self.quadrics.lines(plan.kept)),
            origin: self.quadrics.origin,
        };
        Ok(Collapse { plan, site, rules: *rules, age: self.star_age() })
    }

    fn star_age(&self) -> [u64; 2] {
        [self.age, self.star.age]
    }

    /// The shape that the merged vertex gives at the admitted position nearest to `wish`, where quadrics, thresholds
    /// and fold-over admit it.
    ///
    /// # Errors
    /// The first test that is against the position.
    pub fn place(&mut self, merge: &Collapse, wish: DVec3) -> Result<Place, Refused> {
        if merge.age != self.star_age() {
            return Err(Refused::Outdated);
        }
        let Collapse { site, rules, age, .. } = merge;
        let at = site.placement.nearest(wish);
        if !at.is_finite() || !self.keeper.admits_point(&site.planes, &site.lines, at - site.origin) {
            return Err(Refused::Tolerance);
        }
        let before = self.star.before;
        let floor = least_stretch(rules.min_stretch, before.stretch_min);
        let after = self.star.assess(&self.mesh, at, Bounds { floor, ceiling: self.ceiling(at, &before) })?;
        let improves = rules.mend_below.is_none() || after.mends(&before);
        let even = after.mean() >= rules.mean_stretch.min(before.mean());
        if improves && even { Ok(Place { at, before, after, age: *age }) } else { Err(Refused::Gain) }
    }

    /// The longest side that a new face at `p` may have.
    pub(super) fn ceiling(&self, p: DVec3, before: &Tally) -> f64 {
        if self.limits.max_size.is_unlimited() { f64::INFINITY } else { self.limits.ceiling(p, before.size_max) }
    }

    /// Collapses to a place where the costly tests admit it too; gives the merged vertex.
    ///
    /// # Errors
    /// The test that refuses it; nothing is done then.
    pub fn collapse(&mut self, merge: &Collapse, place: &Place) -> Result<VertexId, Refused> {
        if merge.age != self.star_age() || place.age != merge.age {
            return Err(Refused::Outdated);
        }
        let (plan, at) = (&merge.plan, place.at);
        if !self.curve_admits(plan, at) {
            return Err(Refused::Curves);
        }
        self.patch.clear();
        self.patch.old.extend(self.star.old_faces());
        for (face, points) in self.star.new_faces(at) {
            self.patch.succeed(face, points);
        }
        self.admit_patch()?;
        self.apply_collapse(plan, at);
        Ok(plan.kept)
    }

    /// Whether the curve through the edge stays near the reference's curves.
    pub(super) fn curve_admits(&self, plan: &CollapsePlan, p: DVec3) -> bool {
        let Keeper::Distance { curves, .. } = &self.keeper else { return true };
        let edge = edge_of(plan.halfedge);
        if self.mesh.edge_freedom(edge) != Freedom::OnCurve {
            return true;
        }
        [plan.halfedge, twin(plan.halfedge)].into_iter().all(|h| {
            self.mesh
                .outgoing_from(h)
                .filter(|&out| edge_of(out) != edge && self.mesh.edge_freedom(edge_of(out)) != Freedom::Free)
                .all(|out| {
                    // At a kept corner other curves end; they do not move.
                    let at = self.mesh.point(self.mesh.origin(out));
                    at == p || curves.admit([p, self.mesh.point(self.mesh.target(out))])
                })
        })
    }

    pub(super) fn apply_collapse(&mut self, plan: &CollapsePlan, p: DVec3) {
        if let Some(recorder) = &mut self.recorder {
            recorder.collapse(&self.mesh, plan, p);
        }
        collapse(&mut self.mesh, plan, p);
        self.quadrics.merge(plan.removed, plan.kept);
        self.counts.collapses += 1;
        self.settle();
    }
}
