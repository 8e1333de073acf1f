//! Merging with positions chosen by the caller: the two ends of an edge, or the three corners of a face at once.
//!
//! The same guards as every other edit of the [`Editor`]: thresholds, foldover, certified distance, intersections. The
//! caller asks for a [`Merge`], rates positions by the least stretch that they give, and tries them in its own order.

use glam::DVec3;
use smallvec::SmallVec;

use super::editor::{CollapseRules, Editor};
use super::placement::Site;
use super::priority::Tally;
use crate::mesh::edit::merge_face::{MergeFacePlan, check_merge_face, merge_face};
use crate::mesh::edit::{CollapsePlan, Placement, check_collapse};
use crate::mesh::geometry::stretch;
use crate::mesh::{EdgeId, FaceId, VertexId};

/// A merge that topology and freedom admit. Valid until the next edit; the editor holds its star.
#[derive(Clone, Debug)]
pub struct Merge {
    kind: Kind,
    /// Where the merged vertex may lie.
    pub placement: Placement,
    /// The vertices that become one.
    pub ends: SmallVec<[VertexId; 3]>,
    site: Site,
    before: Tally,
}

#[derive(Clone, Copy, Debug)]
enum Kind {
    Edge(CollapsePlan),
    Face(MergeFacePlan),
}

impl Merge {
    /// Least stretch of the star as it is.
    pub fn stretch_before(&self) -> f64 {
        self.before.stretch_min
    }
}

impl Editor<'_> {
    /// How the ends of an edge may become one.
    pub fn plan_edge(&mut self, edge: EdgeId, rules: &CollapseRules) -> Option<Merge> {
        let plan = check_collapse(&self.mesh, edge).ok()?;
        let (site, before) = self.prepare_collapse(&plan, rules)?;
        let ends = SmallVec::from_slice(&[plan.removed, plan.kept]);
        Some(Merge { kind: Kind::Edge(plan), placement: plan.placement, ends, site, before })
    }

    /// How the corners of a face may become one.
    pub fn plan_face(&mut self, face: FaceId, rules: &CollapseRules) -> Option<Merge> {
        let plan = check_merge_face(&self.mesh, face).ok()?;
        let valences = plan.corners.map(|v| self.mesh.valence(v));
        let allowed = valences.into_iter().fold(self.limits.max_valence, usize::max);
        if plan.new_valence(&self.mesh) > allowed {
            return None;
        }
        let mut before = Tally::short_of(rules.mend_below.unwrap_or(0.0));
        self.patch.clear();
        self.patch.old.extend(plan.removed_faces(&self.mesh));
        for (f, corners) in plan.new_star(&self.mesh) {
            self.patch.old.push(f);
            self.patch.ids.push(f);
            self.patch.corners.push(corners);
            self.patch.points.push(corners.map(|v| self.mesh.point(v)));
        }
        for &f in &self.patch.old {
            before.add(self.stretch(f), self.size(f));
        }
        let site = self.site_of(plan.placement, &plan.corners);
        let ends = SmallVec::from_slice(&plan.corners);
        Some(Merge { kind: Kind::Face(plan), placement: plan.placement, ends, site, before })
    }

    /// The edges round the star of the last plan, opposite to the merged vertex.
    pub fn rim(&self) -> impl Iterator<Item = [DVec3; 2]> + Clone + '_ {
        self.patch.points.iter().map(|points| [points[1], points[2]])
    }

    /// The least stretch of the last plan's new faces with the merged vertex at `p`.
    pub fn stretch_at(&self, p: DVec3) -> f64 {
        self.rim().map(|[a, b]| stretch([p, a, b])).fold(1.0, f64::min)
    }

    /// Merges at `p` where all tests admit that; the merge must be the last one planned.
    pub fn try_merge(&mut self, merge: &Merge, p: DVec3, rules: &CollapseRules) -> Option<VertexId> {
        self.assess(merge.placement, &merge.site, &merge.before, p, rules)?;
        let p = merge.placement.nearest(p);
        match &merge.kind {
            Kind::Edge(plan) => {
                if !(self.curve_admits(plan, p) && self.patch_admitted()) {
                    return None;
                }
                self.apply_collapse(plan, p);
                Some(plan.kept)
            }
            Kind::Face(plan) => {
                if !self.patch_admitted() {
                    return None;
                }
                merge_face(&mut self.mesh, plan, p).ok()?;
                let kept = plan.corners.into_iter().find(|&v| self.mesh.vertex_is_live(v))?;
                for gone in plan.corners.into_iter().filter(|&v| v != kept) {
                    self.merge_quadrics(gone, kept);
                }
                self.counts.collapses += 2;
                self.settle();
                Some(kept)
            }
        }
    }
}

impl Editor<'_> {
    /// Sets the least stretch that edits keep, and gives the one that held: for halvings, which make a face worse before
    /// the next one makes both better.
    pub fn set_min_stretch(&mut self, least: f64) -> f64 {
        std::mem::replace(&mut self.limits.min_stretch, least)
    }
}
