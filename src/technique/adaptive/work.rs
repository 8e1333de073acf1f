//! The mesh at work, what is known of each vertex, and the cheap tests that every edit passes.

use glam::DVec3;
use smallvec::SmallVec;

use super::Rules;
use super::order::Quiet;
use super::reference::{Foot, Reference};
use crate::mesh::geometry::{angle, area_vector, centroid};
use crate::mesh::halfedge::{HalfedgeMesh, edge_of};
use crate::mesh::{EdgeId, FaceId, Freedom, VertexId};
use crate::technique::guarded::Counts;
use crate::technique::sizing::curvature::longest_chord;
use crate::technique::sizing::{Bounds, Sizing};

/// A face below this stretch has no normal to speak of.
const HAS_NORMAL: f64 = 0.02;
/// New faces turn away from the old ones by less than 60 degrees.
const LEAST_TURN_COSINE: f64 = 0.5;
/// Samples of new faces lie within this part of the tolerance.
const NEAR: f64 = 0.85;
/// The part of the curves' tolerance that their chords may use up when sizes are chosen beforehand.
const CURVE_SAGITTA: f64 = 0.8;
const SQRT_12: f64 = 3.464_101_615_137_754_6;

/// Three points.
pub(super) type Corners = [DVec3; 3];

/// Faces of a star.
pub(super) type Faces = SmallVec<[FaceId; 16]>;

/// The stretch of a triangle, as [`crate::mesh::geometry::stretch`] has it, without its care for extreme coordinates.
#[inline]
pub(super) fn stretch([a, b, c]: Corners) -> f64 {
    let (u, v, w) = (b - a, c - a, c - b);
    let (x, y, z) = (u.length(), v.length(), w.length());
    let scale = (x + y + z) * x.max(y).max(z);
    if scale > 0.0 { SQRT_12 * u.cross(v).length() / scale } else { 0.0 }
}

/// Those points of a face that stray first: its middle and those of its sides.
fn samples([a, b, c]: Corners) -> [DVec3; 4] {
    [(a + b + c) / 3.0, 0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a)]
}

/// How edits are tested.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Care {
    /// The needles of the input are cut up: edges may be long as long as they were.
    Needles,
    /// Sizes keep edges near the reference.
    Sizes,
    /// Samples of new faces are held against the reference.
    Samples,
}

/// The mesh at work.
pub(super) struct Work<'a> {
    pub(super) mesh: HalfedgeMesh,
    pub(super) reference: &'a Reference<'a>,
    pub(super) rules: &'a Rules,
    pub(super) sizing: Sizing,
    /// A face of the reference near each vertex.
    pub(super) feet: Vec<FaceId>,
    /// Vertices near which something is to be done.
    awake: Vec<bool>,
    /// Vertices that hold a place of the reference that would be lost else.
    pub(super) pinned: Vec<bool>,
    pub(super) care: Care,
    /// Vertices that have no better place, and edges no better diagonal.
    pub(super) quiet_vertices: Quiet,
    pub(super) quiet_edges: Quiet,
    pub(super) tally: Counts,
}

impl<'a> Work<'a> {
    /// Begins with `mesh`, which was made of the reference.
    pub(super) fn new(mesh: HalfedgeMesh, reference: &'a Reference<'a>, rules: &'a Rules, gradation: f64) -> Self {
        let slots = mesh.vertex_slots();
        let mut feet: Vec<Option<FaceId>> = vec![None; slots];
        for f in mesh.faces() {
            for v in mesh.corners(f) {
                let known = &mut feet[v.index()];
                *known = known.filter(|&k| reference.longest[k] <= reference.longest[f]).or(Some(f));
            }
        }
        let bounds = Bounds { most: rules.size.most(), least: rules.least_size, gradation };
        Self {
            sizing: Sizing::new(bounds, slots),
            feet: feet.into_iter().map(|f| f.unwrap_or(FaceId::new(0))).collect(),
            awake: vec![true; slots],
            pinned: vec![false; slots],
            care: Care::Sizes,
            quiet_vertices: Quiet::default(),
            quiet_edges: Quiet::default(),
            tally: Counts::default(),
            mesh,
            reference,
            rules,
        }
    }

    pub(super) fn point(&self, v: VertexId) -> DVec3 {
        self.mesh.point(v)
    }

    /// The edge length wanted for an edge.
    pub(super) fn size_of(&self, e: EdgeId) -> f64 {
        let [a, b] = self.mesh.ends(e);
        0.5 * (self.sizing.at(a) + self.sizing.at(b))
    }

    pub(super) fn length(&self, e: EdgeId) -> f64 {
        let [a, b] = self.mesh.ends(e);
        self.point(a).distance(self.point(b))
    }

    pub(super) fn project(&self, p: DVec3, beside: VertexId) -> Foot {
        self.reference.project(p, self.feet[beside.index()])
    }

    pub(super) fn quality(&self, f: FaceId) -> f64 {
        stretch(self.mesh.corner_points(f))
    }

    /// The mean stretch of all faces.
    pub(super) fn mean(&self) -> f64 {
        self.mesh.faces().map(|f| self.quality(f)).sum::<f64>() / self.mesh.face_count().max(1) as f64
    }

    /// The corners of a face, were a vertex at `p`.
    pub(super) fn moved(&self, f: FaceId, v: VertexId, p: DVec3) -> Corners {
        self.mesh.corners(f).map(|w| if w == v { p } else { self.point(w) })
    }

    /// The least stretch round a vertex, were it at `p`.
    pub(super) fn least_at(&self, v: VertexId, p: DVec3) -> f64 {
        self.mesh.faces_around(v).map(|f| stretch(self.moved(f, v, p))).fold(1.0, f64::min)
    }

    /// The sum of the area vectors round a vertex.
    pub(super) fn normal_at(&self, v: VertexId) -> DVec3 {
        self.mesh.faces_around(v).map(|f| area_vector(self.mesh.corner_points(f))).sum()
    }

    /// Whether a new face in the place of `old` turns too far: against that where it has a normal, else against all of
    /// the good ones replaced with it.
    pub(super) fn folds(&self, old: FaceId, all: &[FaceId], new: Corners) -> bool {
        let normal = area_vector(new);
        let agrees = |f: FaceId| {
            let other = area_vector(self.mesh.corner_points(f));
            let scale = (normal.length_squared() * other.length_squared()).sqrt();
            scale > 0.0 && normal.dot(other) >= LEAST_TURN_COSINE * scale
        };
        if self.quality(old) >= HAS_NORMAL {
            return !agrees(old);
        }
        let good: Faces = all.iter().copied().filter(|&f| self.quality(f) >= HAS_NORMAL).collect();
        if good.is_empty() {
            let sum: DVec3 = all.iter().map(|&f| area_vector(self.mesh.corner_points(f))).sum();
            return normal.dot(sum) <= 0.0;
        }
        !good.into_iter().any(agrees)
    }

    /// The largest squared distance of the samples of a face.
    fn stray(&self, face: Corners, beside: VertexId) -> f64 {
        samples(face).into_iter().map(|p| self.project(p, beside).distance_squared).fold(0.0, f64::max)
    }

    /// Whether new faces lie near the reference by samples, or where samples are always asked, nearer than those that
    /// they replace.
    pub(super) fn is_near(&self, old: &[FaceId], new: &[Corners], beside: VertexId) -> bool {
        let (squared, hint) = ((NEAR * self.rules.tolerance).powi(2), self.feet[beside.index()]);
        let is_within = |p: DVec3| self.reference.is_within(p, hint, squared);
        if new.iter().all(|&face| samples(face).into_iter().all(is_within)) {
            return true;
        }
        if self.care != Care::Samples {
            return false;
        }
        let after = new.iter().map(|&face| self.stray(face, beside)).fold(0.0, f64::max);
        old.iter().any(|&f| self.stray(self.mesh.corner_points(f), beside) >= after)
    }

    /// The neighbours of a vertex along its curve, where it lies on one.
    pub(super) fn curve_neighbours(&self, v: VertexId) -> Option<[VertexId; 2]> {
        let on = self.mesh.outgoing(v).filter(|&h| self.mesh.edge_freedom(edge_of(h)) != Freedom::Free);
        let ends: SmallVec<[VertexId; 4]> = on.map(|h| self.mesh.target(h)).collect();
        match ends[..] {
            [a, b] => Some([a, b]),
            _ => None,
        }
    }

    /// Room for what is known of a new vertex in the middle of an edge.
    pub(super) fn found(&mut self, v: VertexId, ends: [VertexId; 2], apart: f64, limit: f64, foot: FaceId) {
        self.sizing.found(v, ends, apart, limit);
        if self.feet.len() <= v.index() {
            self.feet.resize(v.index() + 1, foot);
            self.awake.resize(v.index() + 1, true);
            self.pinned.resize(v.index() + 1, false);
        }
        self.feet[v.index()] = foot;
        self.awake[v.index()] = true;
    }

    /// Whether an edge has an end that is awake.
    pub(super) fn wakes(&self, e: EdgeId) -> bool {
        self.mesh.ends(e).into_iter().any(|v| self.awake[v.index()])
    }

    pub(super) fn awake_edges(&self) -> Vec<EdgeId> {
        self.mesh.edges().filter(|&e| self.wakes(e)).collect()
    }

    /// The awake vertices that may move.
    pub(super) fn awake_vertices(&self) -> Vec<VertexId> {
        self.mesh.vertices().filter(|v| self.awake[v.index()] && !self.pinned[v.index()]).collect()
    }

    /// Wakes a vertex and its neighbours.
    pub(super) fn wake(&mut self, v: VertexId) {
        self.awake[v.index()] = true;
        for w in self.mesh.neighbours(v) {
            self.awake[w.index()] = true;
        }
    }

    /// Most edges that a vertex may have; what the other copies of one on a seam have counts.
    pub(super) fn most_edges(&self, v: VertexId) -> usize {
        self.rules.max_valence.saturating_sub(self.mesh.valence_elsewhere(v))
    }

    /// Lets sizes grow so much over a unit of length from here on, everywhere.
    pub(super) fn begin(&mut self, gradation: f64) {
        self.sizing.grow_by(gradation);
        self.set_sizes();
        self.awake.fill(true);
    }

    /// Sets all sizes anew.
    pub(super) fn set_sizes(&mut self) {
        let mut sizing = self.sizing.clone();
        sizing.set(&self.mesh, |v| self.limit(v));
        self.sizing = sizing;
    }

    /// Lowers sizes, and wakes those vertices only whose sizes change by it.
    pub(super) fn lower(&mut self, wishes: &[(VertexId, f64)]) {
        self.set_sizes();
        let before = self.sizing.clone();
        for &(v, size) in wishes {
            self.sizing.lower(v, size);
        }
        self.set_sizes();
        self.awake.fill(false);
        for v in self.sizing.changed(&self.mesh, &before) {
            self.wake(v);
        }
    }

    /// What was asked for on the faces beside a curve, where that differs from face to face.
    fn wanted_beside(&self, v: VertexId) -> f64 {
        if self.rules.size.is_uniform() {
            return f64::INFINITY;
        }
        let below = |f: FaceId| self.project(centroid(self.mesh.corner_points(f)), v).face;
        self.mesh.faces_around(v).map(|f| self.rules.size.at(below(f))).fold(f64::INFINITY, f64::min)
    }

    /// What the reference and the bend of a curve allow at a vertex. The foot of a vertex on a curve lies on any of the
    /// faces there; those beside it ask for themselves.
    fn limit(&self, v: VertexId) -> f64 {
        if self.mesh.vertex_freedom(v) == Freedom::Free {
            return self.reference.longest[self.feet[v.index()]];
        }
        let wanted = self.wanted_beside(v);
        let Some([a, b]) = self.curve_neighbours(v) else { return wanted };
        let [u, w] = [self.point(v) - self.point(a), self.point(b) - self.point(v)];
        longest_chord(angle(u, w), [u.length(), w.length()], CURVE_SAGITTA * self.rules.curve_tolerance).min(wanted)
    }
}
