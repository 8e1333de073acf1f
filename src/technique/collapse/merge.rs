//! Merging with positions chosen by the caller: the two ends of an edge, or the three corners of a face at once.
//!
//! The same guards as every other edit of the [`Editor`]: thresholds, foldover, certified distance, intersections. The
//! caller asks for a [`Merge`], rates positions by the least stretch that they give, and tries them in its own order.

use glam::DVec3;
use smallvec::SmallVec;

use super::bars::Bar;
use super::editor::{CollapseRules, Editor};
use super::limits::least_stretch;
use super::placement::Site;
use super::priority::Tally;
use crate::mesh::edit::merge_face::{MergeFacePlan, check_merge_face, merge_face};
use crate::mesh::edit::{CollapsePlan, Placement, check_collapse};
use crate::mesh::geometry::{stretch, triangle_size};
use crate::mesh::{EdgeId, FaceId, VertexId};
use crate::technique::quadric::Quadric;

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

impl Editor<'_> {
    /// How the ends of an edge may become one.
    pub fn plan_edge(&mut self, edge: EdgeId, rules: &CollapseRules) -> Option<Merge> {
        let plan = check_collapse(&self.mesh, edge).ok()?;
        let mesh = &self.mesh;
        let allowed = self.limits.max_valence.max(mesh.valence(plan.removed)).max(mesh.valence(plan.kept));
        if plan.new_valence(mesh) > allowed {
            return None;
        }
        let removed = plan.removed_faces(mesh).into_iter().flatten().collect::<SmallVec<[FaceId; 4]>>();
        let star = plan.new_star(mesh).collect::<SmallVec<[_; 16]>>();
        let before = self.fill_patch(&removed, &star, rules);
        let site = self.site_of(plan.placement, &[plan.removed, plan.kept]);
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
        let removed = plan.removed_faces(&self.mesh);
        let star = plan.new_star(&self.mesh).collect::<SmallVec<[_; 16]>>();
        let before = self.fill_patch(&removed, &star, rules);
        let site = self.site_of(plan.placement, &plan.corners);
        let ends = SmallVec::from_slice(&plan.corners);
        Some(Merge { kind: Kind::Face(plan), placement: plan.placement, ends, site, before })
    }

    /// Puts a star into the patch: faces that vanish, and survivors whose first corner is the merged vertex.
    fn fill_patch(&mut self, removed: &[FaceId], star: &[(FaceId, [VertexId; 3])], rules: &CollapseRules) -> Tally {
        self.patch.clear();
        self.patch.old.extend_from_slice(removed);
        for &(f, corners) in star {
            self.patch.old.push(f);
            self.patch.ids.push(f);
            self.patch.points.push(corners.map(|v| self.mesh.point(v)));
        }
        let mut before = Tally::short_of(rules.mend_below.unwrap_or(0.0));
        for &f in &self.patch.old {
            before.add(self.stretch(f), self.size(f));
        }
        before
    }

    /// The planes and lines of all that was merged into these vertices.
    fn quadrics_of(&self, ends: &[VertexId]) -> [Quadric; 2] {
        let (mut planes, mut lines) = (Quadric::default(), Quadric::default());
        for &v in ends {
            planes = planes.plus(self.quadrics.planes(v));
            lines = lines.plus(&self.quadrics.lines(v));
        }
        [planes, lines]
    }

    /// What is known of a place where vertices become one.
    fn site_of(&self, placement: Placement, ends: &[VertexId]) -> Site {
        // The certified distance asks for no planes.
        let [planes, lines] = if self.keeper.is_certified() { [Quadric::default(); 2] } else { self.quadrics_of(ends) };
        let points = [ends[0], ends[ends.len() - 1]].map(|v| self.mesh.point(v));
        // The caller brings the positions: no centroid is asked for.
        Site { placement, ends: points, centroid: DVec3::ZERO, planes, lines, origin: self.quadrics.origin }
    }

    /// The new star's tally with the merged vertex at `p`, where quadrics, thresholds and foldover admit it.
    fn assess_merge(&mut self, merge: &Merge, p: DVec3, rules: &CollapseRules) -> Option<Tally> {
        let (site, before) = (&merge.site, &merge.before);
        if !p.is_finite() || !self.keeper.admits_point(&site.planes, &site.lines, p - site.origin) {
            return None;
        }
        let floor = least_stretch(rules.min_stretch, before.stretch_min);
        let ceiling =
            if self.limits.max_size.is_unlimited() { f64::INFINITY } else { self.limits.ceiling(p, before.size_max) };
        let mut after = Tally::short_of(before.threshold);
        for points in &mut self.patch.points {
            points[0] = p;
            let (shape, size) = (stretch(*points), triangle_size(*points));
            if shape < floor || size > ceiling || shape <= 0.0 {
                return None;
            }
            after.add(shape, size);
        }
        let improves = rules.mend_below.is_none() || after.mends(before);
        let even = after.mean() >= rules.mean_stretch.min(before.mean());
        (improves && even && !self.folds()).then_some(after)
    }

    /// The point of least squared distance to the planes and lines of all that was merged, nearest to `near`; `None`
    /// where freedom fixes the place, the planes leave it far away, or it is that point itself.
    pub fn optimum(&self, merge: &Merge, near: DVec3) -> Option<DVec3> {
        if merge.placement != Placement::Anywhere {
            return None;
        }
        let ([planes, lines], site) = (self.quadrics_of(&merge.ends), &merge.site);
        let x = planes.plus(&lines).optimum(near - site.origin) + site.origin;
        let [p, q] = site.ends;
        // In flat places it is the same point up to rounding, which would only take it off its plane.
        let moved = (x - near).length_squared() / (q - p).length_squared();
        (1e-12..=4.0).contains(&moved).then_some(x)
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
        let p = merge.placement.nearest(p);
        self.assess_merge(merge, p, rules)?;
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
                    self.quadrics.merge(gone, kept);
                }
                self.counts.collapses += 2;
                self.settle();
                Some(kept)
            }
        }
    }
}

impl Editor<'_> {
    /// The first test that refuses the merge at `p`, or none; nothing is done.
    pub(super) fn bar_at(&mut self, merge: &Merge, p: DVec3, rules: &CollapseRules) -> Bar {
        if self.assess_merge(merge, p, rules).is_none() {
            let floor = least_stretch(rules.min_stretch, merge.before.stretch_min);
            for points in &mut self.patch.points {
                points[0] = p;
            }
            let is_poor = self.patch.points.iter().any(|&points| stretch(points) < floor);
            return if is_poor || !self.folds() { Bar::Shape } else { Bar::FoldOver };
        }
        if let Kind::Edge(plan) = &merge.kind
            && !self.curve_admits(plan, p)
        {
            return Bar::Curves;
        }
        let beyond = self.counts.beyond_tolerance;
        if self.patch_admitted() {
            Bar::Nothing
        } else if self.counts.beyond_tolerance > beyond {
            Bar::Tolerance
        } else {
            Bar::Intersection
        }
    }

    /// Sets the least stretch that edits keep, and gives the one that held: for halvings, which make a face worse
    /// before the next one makes both better.
    pub fn set_min_stretch(&mut self, least: f64) -> f64 {
        std::mem::replace(&mut self.limits.min_stretch, least)
    }
}
