//! Merging with positions chosen by the caller: the two ends of an edge, or the three corners of a face at once.
//!
//! The caller asks for a [`Merge`], rates positions by the least stretch that they give, and tries them in its own
//! order; all tests are those of the other edits.

use glam::DVec3;
use smallvec::SmallVec;

use super::collapse::Site;
use super::limits::{StarRules, least_stretch};
use super::mesh::GuardedMesh;
use super::refused::Refused;
use super::tally::Tally;
use crate::mesh::edit::merge_face::{MergeFacePlan, check_merge_face, merge_face};
use crate::mesh::edit::{CollapsePlan, Placement, check_collapse};
use crate::mesh::geometry::{stretch, triangle_size};
use crate::mesh::{EdgeId, FaceId, VertexId};
use crate::technique::quadric::Quadric;

/// A merge that topology and freedom admit. Good until the next plan or edit; the mesh holds its star.
#[derive(Clone, Debug)]
pub struct Merge {
    kind: Kind,
    /// Where the merged vertex may lie.
    pub placement: Placement,
    /// The vertices that become one.
    pub ends: SmallVec<[VertexId; 3]>,
    site: Site,
    rules: StarRules,
    before: Tally,
    age: [u64; 2],
}

#[derive(Clone, Copy, Debug)]
enum Kind {
    Edge(CollapsePlan),
    Face(MergeFacePlan),
}

impl Kind {
    fn placement(&self) -> Placement {
        match self {
            Self::Edge(plan) => plan.placement,
            Self::Face(plan) => plan.placement,
        }
    }

    fn ends(&self) -> SmallVec<[VertexId; 3]> {
        match self {
            Self::Edge(plan) => SmallVec::from_slice(&[plan.removed, plan.kept]),
            Self::Face(plan) => SmallVec::from_slice(&plan.corners),
        }
    }
}

/// Plans.
impl GuardedMesh<'_> {
    /// How the ends of an edge may become one.
    ///
    /// # Errors
    /// The first reason against it wherever the merged vertex lies.
    pub fn plan_edge(&mut self, edge: EdgeId, rules: &StarRules) -> Result<Merge, Refused> {
        let plan = check_collapse(&self.mesh, edge)?;
        let mesh = &self.mesh;
        if plan.new_valence(mesh) > self.most_edges_of_merged(&[plan.removed, plan.kept]) {
            return Err(Refused::Valence);
        }
        let removed = plan.removed_faces(mesh).into_iter().flatten().collect::<SmallVec<[FaceId; 4]>>();
        let star = plan.new_star(mesh).collect::<SmallVec<[_; 16]>>();
        Ok(self.plan_merge(Kind::Edge(plan), &removed, &star, rules))
    }

    /// How the corners of a face may become one.
    ///
    /// # Errors
    /// The first reason against it wherever the merged vertex lies.
    pub fn plan_face(&mut self, face: FaceId, rules: &StarRules) -> Result<Merge, Refused> {
        let plan = check_merge_face(&self.mesh, face)?;
        if plan.new_valence(&self.mesh) > self.most_edges_of_merged(&plan.corners) {
            return Err(Refused::Valence);
        }
        let removed = plan.removed_faces(&self.mesh);
        let star = plan.new_star(&self.mesh).collect::<SmallVec<[_; 16]>>();
        Ok(self.plan_merge(Kind::Face(plan), &removed, &star, rules))
    }

    /// Puts a star into the patch: faces that vanish, and survivors whose first corner is the merged vertex.
    fn plan_merge(
        &mut self,
        kind: Kind,
        removed: &[FaceId],
        star: &[(FaceId, [VertexId; 3])],
        rules: &StarRules,
    ) -> Merge {
        self.patch.clear();
        self.patch.old.extend_from_slice(removed);
        for &(f, corners) in star {
            self.patch.change(f, corners.map(|v| self.mesh.point(v)));
        }
        let mut before = Tally::short_of(rules.mend_below.unwrap_or(0.0));
        for &f in &self.patch.old {
            before.add(self.stretch(f), self.size(f));
        }
        let (placement, ends) = (kind.placement(), kind.ends());
        let site = self.site_of(placement, &ends);
        Merge { kind, placement, ends, site, rules: *rules, before, age: self.patch_age() }
    }

    fn patch_age(&self) -> [u64; 2] {
        [self.age, self.patch.age]
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
}

/// What the caller may ask about the last plan.
impl GuardedMesh<'_> {
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

    /// Whether the merge at `p` would be refused, and by which test; nothing is done or counted.
    ///
    /// # Errors
    /// The first test against it. A face that is good enough but turns over counts as that, whatever else is wrong.
    pub fn would_merge(&mut self, merge: &Merge, p: DVec3) -> Result<(), Refused> {
        let counts = self.counts;
        let outcome = self.test_merge(merge, p);
        self.counts = counts;
        let Err(Refused::Shape | Refused::Gain | Refused::FoldOver) = outcome else { return outcome };
        for points in &mut self.patch.points {
            points[0] = p;
        }
        let floor = least_stretch(merge.rules.min_stretch, merge.before.stretch_min);
        let is_poor = self.patch.points.iter().any(|&points| stretch(points) < floor);
        Err(if is_poor || !self.folds() { Refused::Shape } else { Refused::FoldOver })
    }
}

/// The verb.
impl GuardedMesh<'_> {
    /// Merges at the admitted position nearest to `wish` where all tests admit that; gives the merged vertex.
    ///
    /// # Errors
    /// The first test that refuses it; nothing is done then.
    pub fn merge(&mut self, merge: &Merge, wish: DVec3) -> Result<VertexId, Refused> {
        let p = merge.placement.nearest(wish);
        self.test_merge(merge, p)?;
        match &merge.kind {
            Kind::Edge(plan) => {
                self.apply_collapse(plan, p);
                Ok(plan.kept)
            }
            Kind::Face(plan) => {
                merge_face(&mut self.mesh, plan, p)?;
                let is_kept = |&v: &VertexId| self.mesh.vertex_is_live(v);
                let kept = plan.corners.into_iter().find(is_kept).ok_or(Refused::Topology)?;
                for gone in plan.corners.into_iter().filter(|&v| v != kept) {
                    self.quadrics.merge(gone, kept);
                }
                self.counts.collapses += 2;
                self.settle();
                Ok(kept)
            }
        }
    }

    /// All tests, the cheap ones first.
    fn test_merge(&mut self, merge: &Merge, p: DVec3) -> Result<(), Refused> {
        if merge.age != self.patch_age() {
            return Err(Refused::Outdated);
        }
        self.assess_merge(merge, p)?;
        if let Kind::Edge(plan) = &merge.kind
            && !self.curve_admits(plan, p)
        {
            return Err(Refused::Curves);
        }
        self.admit_patch()
    }

    /// Whether quadrics, thresholds and fold-over admit the merged vertex at `p`.
    fn assess_merge(&mut self, merge: &Merge, p: DVec3) -> Result<(), Refused> {
        let Merge { site, rules, before, .. } = merge;
        if !p.is_finite() || !self.keeper.admits_point(&site.planes, &site.lines, p - site.origin) {
            return Err(Refused::Tolerance);
        }
        let floor = least_stretch(rules.min_stretch, before.stretch_min);
        let ceiling = self.ceiling(p, before);
        let mut after = Tally::short_of(before.threshold);
        for points in &mut self.patch.points {
            points[0] = p;
            let (shape, size) = (stretch(*points), triangle_size(*points));
            if shape < floor || size > ceiling || shape <= 0.0 {
                return Err(Refused::Shape);
            }
            after.add(shape, size);
        }
        let improves = rules.mend_below.is_none() || after.mends(before);
        let even = after.mean() >= rules.mean_stretch.min(before.mean());
        if !(improves && even) {
            return Err(Refused::Gain);
        }
        if self.folds() { Err(Refused::FoldOver) } else { Ok(()) }
    }
}
