//! Guarded edits: a workshop whose changes keep the thresholds, the tolerance and the embedding.
//!
//! Topology and freedom are checked by [`crate::mesh::edit`]; then, cheapest first: shape thresholds, foldover, the
//! tolerance (quadrics, or the certified distance), and last new self-intersections. An edit that passes is applied at
//! once; one that does not leaves no trace. Stretch and size of every live face are kept up to date beside the mesh.

use glam::DVec3;

use super::collision::Collision;
use super::envelope::Change;
use super::keeper::Keeper;
use super::limits::{Limits, least_stretch};
use super::placement::{Order, Site};
use super::priority::{Priority, Tally};
use super::quadrics::Quadrics;
use super::star::{Bounds, HAS_NORMAL, LEAST_TURN_COSINE, Shape, Star};
use crate::mesh::edit::{CollapsePlan, check_collapse, collapse};
use crate::mesh::geometry::{area_vector, stretch, triangle_size};
use crate::mesh::halfedge::{HalfedgeMesh, edge_of, twin};
use crate::mesh::{EdgeId, FaceId, Freedom, VertexId};
use crate::technique::hierarchy::Recorder;

/// What a collapse must keep besides tolerance and embedding.
#[derive(Clone, Copy, Debug)]
pub struct CollapseRules {
    /// Least stretch of the new faces; where a face of the old star is below it, no less than that one.
    pub min_stretch: f64,
    /// Least mean stretch of the new faces; where the mean of the old star is below it, no less than that.
    pub mean_stretch: f64,
    /// Where given, the star must come nearer to this stretch: see [`Tally::mends`].
    pub mend_below: Option<f64>,
    /// Candidate order.
    pub order: Order,
    /// The index of an admitted collapse.
    pub priority: Priority,
}

/// What was done, and why edits were refused.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Counts {
    /// Collapses applied.
    pub collapses: usize,
    /// Flips applied.
    pub flips: usize,
    /// Splits applied.
    pub splits: usize,
    /// Vertices moved.
    pub moves: usize,
    /// Edits refused by the certified distance.
    pub beyond_tolerance: usize,
    /// Edits refused because faces would intersect.
    pub collisions: usize,
}

impl Counts {
    /// Edits applied.
    pub fn edits(self) -> usize {
        self.collapses + self.flips + self.splits + self.moves
    }
}

impl std::ops::Add for Counts {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            collapses: self.collapses + other.collapses,
            flips: self.flips + other.flips,
            splits: self.splits + other.splits,
            moves: self.moves + other.moves,
            beyond_tolerance: self.beyond_tolerance + other.beyond_tolerance,
            collisions: self.collisions + other.collisions,
        }
    }
}

/// The faces of one edit.
#[derive(Debug, Default)]
pub(in crate::technique) struct Patch {
    pub(in crate::technique) old: Vec<FaceId>,
    /// Successors: their number where they have one already.
    pub(in crate::technique) ids: Vec<FaceId>,
    pub(in crate::technique) points: Vec<[DVec3; 3]>,
    /// Whether the surface stays the same set of points, up to rounding.
    pub(in crate::technique) is_same: bool,
    old_points: Vec<[DVec3; 3]>,
    beside: Vec<FaceId>,
    beside_points: Vec<[DVec3; 3]>,
}

impl Patch {
    pub(in crate::technique) fn clear(&mut self) {
        self.old.clear();
        self.ids.clear();
        self.points.clear();
        self.is_same = false;
    }
}

/// What became of a collapse.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Attempt {
    /// It is done; this is the merged vertex.
    Collapsed(VertexId),
    /// Cheap tests admit it, with this index, which is less than was asked.
    Postponed(f32),
    /// A test refuses it.
    Refused,
}

/// A workshop with guards.
#[derive(Debug)]
pub struct Editor<'a> {
    pub(in crate::technique) mesh: HalfedgeMesh,
    pub(in crate::technique) keeper: Keeper<'a>,
    pub(in crate::technique) limits: Limits,
    pub(in crate::technique) counts: Counts,
    collision: Collision,
    pub(in crate::technique) quadrics: Quadrics,
    shapes: Vec<Shape>,
    pub(in crate::technique) patch: Patch,
    star: Star,
    recorder: Option<Box<Recorder>>,
}

impl<'a> Editor<'a> {
    /// A guarded workshop. `feature_weight` is the weight of the sharpest marked edges in the quadrics.
    pub fn new(mesh: HalfedgeMesh, keeper: Keeper<'a>, limits: Limits, feature_weight: f64) -> Self {
        let mut this = Self {
            collision: Collision::new(&mesh),
            quadrics: Quadrics::new(&mesh, feature_weight),
            shapes: vec![Shape::default(); mesh.face_slots()],
            mesh,
            keeper,
            limits,
            counts: Counts::default(),
            patch: Patch::default(),
            star: Star::default(),
            recorder: None,
        };
        let faces: Vec<FaceId> = this.mesh.faces().collect();
        for f in faces {
            let corners = this.mesh.corner_points(f);
            this.remember_shape(f, corners);
        }
        this
    }

    /// The mesh as it stands.
    pub fn mesh(&self) -> &HalfedgeMesh {
        &self.mesh
    }

    /// See [`Keeper::project`].
    pub fn project(&self, p: DVec3) -> Option<DVec3> {
        self.keeper.project(p)
    }

    /// What was done so far.
    pub fn counts(&self) -> Counts {
        self.counts
    }

    /// The thresholds.
    pub fn limits(&self) -> &Limits {
        &self.limits
    }

    /// The certified bound of the two-sided distance to the reference: `tolerance`, or `None` where the input was
    /// further away somewhere and still is, or where the tolerance is no distance.
    pub fn certified_distance(&mut self, tolerance: f64) -> Option<f64> {
        match &mut self.keeper {
            Keeper::Distance { envelope, .. } => envelope.certifies(&self.mesh, tolerance).then_some(tolerance),
            Keeper::QuadricSum { .. } | Keeper::QuadricRms { .. } => None,
        }
    }

    /// As [`Editor::certified_distance`], and nearer where the surface began as the reference and every edit told how
    /// far it moved the surface: 0 where there was none.
    pub fn distance_bound(&mut self, tolerance: f64) -> Option<f64> {
        let traced = match &self.keeper {
            Keeper::Distance { envelope, .. } => envelope.traced(&self.mesh),
            Keeper::QuadricSum { .. } | Keeper::QuadricRms { .. } => None,
        };
        traced.or_else(|| self.certified_distance(tolerance))
    }

    /// Shows every collapse from now on to `recorder`, which was made with the surface of this workshop.
    pub fn record(&mut self, recorder: Recorder) {
        self.recorder = Some(Box::new(recorder));
    }

    /// Whether collapses are recorded.
    pub fn is_recording(&self) -> bool {
        self.recorder.is_some()
    }

    /// Ends the record.
    pub fn take_recorder(&mut self) -> Option<Recorder> {
        self.recorder.take().map(|recorder| *recorder)
    }

    /// Ends the work.
    pub fn into_mesh(self) -> HalfedgeMesh {
        self.mesh
    }

    /// The mean stretch of all live faces; 1 where there are none. O(F).
    pub fn mean_stretch(&self) -> f64 {
        let sum: f64 = self.mesh.faces().map(|f| self.stretch(f)).sum();
        let count = self.mesh.face_count();
        if count == 0 { 1.0 } else { sum / count as f64 }
    }

    /// The stretch of a live face.
    #[inline]
    pub fn stretch(&self, f: FaceId) -> f64 {
        f64::from(self.shapes[f.index()].stretch)
    }

    /// The size of a live face.
    #[inline]
    pub fn size(&self, f: FaceId) -> f64 {
        f64::from(self.shapes[f.index()].size)
    }

    fn remember_shape(&mut self, f: FaceId, corners: [DVec3; 3]) {
        if f.index() >= self.shapes.len() {
            self.shapes.resize(f.index() + 1, Shape::default());
        }
        self.shapes[f.index()] = Shape { stretch: stretch(corners) as f32, size: triangle_size(corners) as f32 };
    }

    /// A cheap stand-in for [`Editor::rate_collapse`]; `None` where the priority has none.
    pub fn estimate_collapse(&self, edge: EdgeId, rules: &CollapseRules) -> Option<f32> {
        let [a, b] = self.mesh.ends(edge).map(|v| self.mesh.point(v));
        rules.priority.estimate(a.distance(b))
    }

    /// The index of the edge's collapse where cheap tests admit one; `None` where not.
    pub fn rate_collapse(&mut self, edge: EdgeId, rules: &CollapseRules) -> Option<f32> {
        let plan = check_collapse(&self.mesh, edge).ok()?;
        let site = self.prepare_collapse(&plan, rules)?;
        let found = site.candidates(rules.order).find_map(|p| self.assess(&plan, &site, p, rules));
        found.map(|after| rules.priority.index(&self.star.before, &after))
    }

    /// Collapses the edge where all tests admit it; the first candidate that passes wins.
    pub fn try_collapse(&mut self, edge: EdgeId, rules: &CollapseRules) -> Option<VertexId> {
        match self.collapse_from(edge, rules, f32::NEG_INFINITY) {
            Attempt::Collapsed(merged) => Some(merged),
            Attempt::Postponed(_) | Attempt::Refused => None,
        }
    }

    /// Collapses the edge where all tests admit it and its index is at least `least`.
    pub fn collapse_from(&mut self, edge: EdgeId, rules: &CollapseRules, least: f32) -> Attempt {
        let Ok(plan) = check_collapse(&self.mesh, edge) else { return Attempt::Refused };
        let Some(site) = self.prepare_collapse(&plan, rules) else { return Attempt::Refused };
        let mut last = None;
        for p in site.candidates(rules.order) {
            let p = plan.placement.nearest(p);
            if last == Some(p) {
                continue;
            }
            let Some(after) = self.assess(&plan, &site, p, rules) else { continue };
            if last.is_none() {
                let index = rules.priority.index(&self.star.before, &after);
                if index < least {
                    return Attempt::Postponed(index);
                }
            }
            last = Some(p);
            if self.admit_collapse(&plan, p) {
                return Attempt::Collapsed(plan.kept);
            }
        }
        Attempt::Refused
    }

    /// Applies a collapse that cheap tests admit where the costly ones do too.
    fn admit_collapse(&mut self, plan: &CollapsePlan, p: DVec3) -> bool {
        if !self.curve_admits(plan, p) {
            return false;
        }
        self.patch.clear();
        self.patch.old.extend(self.star.old_faces());
        for (face, points) in self.star.new_faces(p) {
            self.patch.ids.push(face);
            self.patch.points.push(points);
        }
        let admitted = self.patch_admitted();
        if admitted {
            self.apply_collapse(plan, p);
        }
        admitted
    }

    /// Gathers the star of the edge, where topology and valence allow its collapse.
    fn prepare_collapse(&mut self, plan: &CollapsePlan, rules: &CollapseRules) -> Option<Site> {
        let (tallest, valence) = self.star.walk(&self.mesh, plan);
        if valence > self.limits.max_valence.max(tallest) || self.star.is_empty() {
            return None;
        }
        let ends = [self.mesh.point(plan.removed), self.mesh.point(plan.kept)];
        self.star.measure(&self.mesh, &self.shapes, ends, rules.mend_below.unwrap_or(0.0));
        Some(Site {
            placement: plan.placement,
            ends,
            centroid: self.star.centroid()?,
            planes: self.quadrics.planes(plan.removed).plus(self.quadrics.planes(plan.kept)),
            lines: self.quadrics.lines(plan.removed).plus(&self.quadrics.lines(plan.kept)),
            origin: self.quadrics.origin,
        })
    }

    /// The new star's tally with the merged vertex at `p`, where quadrics, thresholds and foldover admit it.
    fn assess(&mut self, plan: &CollapsePlan, site: &Site, p: DVec3, rules: &CollapseRules) -> Option<Tally> {
        let p = plan.placement.nearest(p);
        if !p.is_finite() || !self.keeper.admits_point(&site.planes, &site.lines, p - site.origin) {
            return None;
        }
        let before = self.star.before;
        let floor = least_stretch(rules.min_stretch, before.stretch_min);
        let ceiling =
            if self.limits.max_size.is_unlimited() { f64::INFINITY } else { self.limits.ceiling(p, before.size_max) };
        let after = self.star.assess(&self.mesh, p, Bounds { floor, ceiling })?;
        let improves = rules.mend_below.is_none() || after.mends(&before);
        let even = after.mean() >= rules.mean_stretch.min(before.mean());
        (improves && even).then_some(after)
    }

    /// Whether a face of the patch turns too far: against itself where it has a normal, else against the old star.
    pub(in crate::technique) fn folds(&self) -> bool {
        let patch = &self.patch;
        let normal_of = |f: FaceId| area_vector(self.mesh.corner_points(f));
        let agree = |m: DVec3, n: DVec3| {
            let scale = (m.length_squared() * n.length_squared()).sqrt();
            scale > 0.0 && m.dot(n) >= LEAST_TURN_COSINE * scale
        };
        let is_good = |f: FaceId| self.stretch(f) >= HAS_NORMAL;
        patch.ids.iter().zip(&patch.points).any(|(&f, points)| {
            let normal = area_vector(*points);
            if is_good(f) {
                return !agree(normal, normal_of(f));
            }
            let mut good = patch.old.iter().filter(|&&g| is_good(g)).peekable();
            if good.peek().is_some() {
                return !good.any(|&g| agree(normal, normal_of(g)));
            }
            normal.dot(patch.old.iter().map(|&g| normal_of(g)).sum()) <= 0.0
        })
    }

    /// Whether the curve through the edge stays near the reference's curves.
    pub(super) fn curve_admits(&self, plan: &CollapsePlan, p: DVec3) -> bool {
        let Keeper::Distance { curves, .. } = &self.keeper else { return true };
        if self.mesh.edge_freedom(edge_of(plan.halfedge)) != Freedom::OnCurve {
            return true;
        }
        let edge = edge_of(plan.halfedge);
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

    /// The costly tests: certified distance both ways, then self-intersection.
    pub(in crate::technique) fn patch_admitted(&mut self) -> bool {
        let mut patch = std::mem::take(&mut self.patch);
        let admitted = self.costly_tests(&mut patch);
        self.patch = patch;
        admitted
    }

    fn costly_tests(&mut self, patch: &mut Patch) -> bool {
        let mut is_sheet = false;
        if let Keeper::Distance { envelope, .. } = &mut self.keeper {
            patch.beside.clear();
            for &f in &patch.old {
                let first = self.mesh.face_halfedge(f);
                for h in [first, self.mesh.next(first), self.mesh.prev(first)] {
                    let other = self.mesh.face(twin(h)).filter(|g| !patch.old.contains(g));
                    patch.beside.extend(other);
                }
            }
            patch.beside_points.clear();
            patch.beside_points.extend(patch.beside.iter().map(|&f| self.mesh.corner_points(f)));
            patch.old_points.clear();
            patch.old_points.extend(patch.old.iter().map(|&f| self.mesh.corner_points(f)));
            let change = Change {
                old: &patch.old,
                was: &patch.old_points,
                new: &patch.points,
                beside: &patch.beside_points,
                is_same: patch.is_same,
            };
            if !envelope.admits(&change) {
                self.counts.beyond_tolerance += 1;
                return false;
            }
            is_sheet = envelope.is_sheet();
        }
        let (mesh, collision) = (&self.mesh, &mut self.collision);
        let hits = if patch.is_same {
            collision.hits_more(mesh, &patch.old, |f| mesh.corner_points(f), &patch.points)
        } else {
            collision.hits(mesh, &patch.old, &patch.points, is_sheet)
        };
        self.counts.collisions += usize::from(hits);
        !hits
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

    /// After an edit was applied: everything beside the mesh follows. The patch's `ids` must name all new faces.
    pub(in crate::technique) fn settle(&mut self) {
        let mut patch = std::mem::take(&mut self.patch);
        if let Keeper::Distance { envelope, .. } = &mut self.keeper {
            let successors = patch.ids.len();
            patch.ids.extend_from_slice(&patch.beside);
            envelope.commit(&patch.old, &patch.ids);
            patch.ids.truncate(successors);
        }
        let sibling = patch.old[0];
        for &f in patch.old.iter().filter(|&&f| !self.mesh.face_is_live(f)) {
            self.collision.forget(f);
        }
        for (&f, &points) in patch.ids.iter().zip(&patch.points) {
            self.remember_shape(f, points);
            self.collision.update(f, self.mesh.corners(f), points, sibling);
        }
        self.collision.tidy(&self.mesh);
        self.patch = patch;
    }

    /// Gives a vertex that a split has made the planes of the faces it was made in.
    pub(in crate::technique) fn found_quadric(&mut self, v: VertexId) {
        self.quadrics.found(&self.mesh, v);
    }

    /// Whether the vertex may lie at `p`, as far as quadrics say.
    pub(in crate::technique) fn quadrics_admit(&self, v: VertexId, p: DVec3) -> bool {
        let (planes, lines) = (self.quadrics.planes(v), self.quadrics.lines(v));
        self.keeper.admits_point(planes, &lines, p - self.quadrics.origin)
    }
}
