//! The guarded mesh: a half-edge mesh whose edits keep the thresholds, the tolerance and the embedding.
//!
//! Each verb has a file of its own beside this one. All go the same way: topology and freedom by [`crate::mesh::edit`],
//! then, cheapest first, shape thresholds, fold-over, the tolerance (quadrics, or the certified distance), and last new
//! self-intersections. An edit that passes is applied at once; one that does not leaves no trace. Stretch and size of
//! every live face are kept up to date beside the mesh. Fields are open to this folder only: nothing else can change
//! the mesh, so the guarantee is one of the type.

use glam::DVec3;
use schemars::JsonSchema;
use serde::Serialize;

use super::certificate::Change;
use super::collision::Collision;
use super::keeper::Keeper;
use super::limits::Limits;
use super::normals::{HAS_NORMAL, agree};
use super::patch::Patch;
use super::pen::Pen;
use super::quadrics::Quadrics;
use super::refused::Refused;
use super::star::{Shape, Star};
use super::ties::Ties;
use crate::mesh::geometry::{area_vector, stretch, triangle_size};
use crate::mesh::halfedge::{HalfedgeMesh, edge_of, twin};
use crate::mesh::{FaceId, Freedom, HalfedgeId, VertexId};
use crate::technique::hierarchy::Recorder;

/// What was done, and why edits were refused: a part of the statistics of steps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub struct Counts {
    /// Edges collapsed.
    pub collapses: usize,
    /// Edges flipped.
    pub flips: usize,
    /// Edges split.
    pub splits: usize,
    /// Vertices moved.
    pub moves: usize,
    /// Edits refused because the surface would have left the tolerance.
    pub refused_by_tolerance: usize,
    /// Edits refused because faces would have intersected.
    pub refused_by_intersection: usize,
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
            refused_by_tolerance: self.refused_by_tolerance + other.refused_by_tolerance,
            refused_by_intersection: self.refused_by_intersection + other.refused_by_intersection,
        }
    }
}

/// A mesh with guards.
#[derive(Debug)]
pub struct GuardedMesh<'a> {
    pub(super) mesh: HalfedgeMesh,
    pub(super) keeper: Keeper<'a>,
    pub(super) limits: Limits,
    pub(super) counts: Counts,
    pub(super) quadrics: Quadrics,
    pub(super) patch: Patch,
    pub(super) star: Star,
    pub(super) shapes: Vec<Shape>,
    pub(super) recorder: Option<Box<Recorder>>,
    pub(super) ties: Ties,
    /// Where this is a part of a larger mesh.
    pub(super) pen: Option<Pen>,
    collision: Collision,
    /// Edits done, to tell plans that are out of date.
    pub(super) age: u64,
}

impl<'a> GuardedMesh<'a> {
    /// A mesh under guard. `feature_weight` is the weight of the sharpest marked edges in the quadrics; `pen` is that
    /// of a part of a larger mesh.
    pub(super) fn new(
        mesh: HalfedgeMesh,
        keeper: Keeper<'a>,
        limits: Limits,
        feature_weight: f64,
        pen: Option<Pen>,
    ) -> Self {
        let mut this = Self {
            collision: Collision::new(&mesh),
            quadrics: Quadrics::new(&mesh, feature_weight, pen.as_ref().map(|pen| pen.origin)),
            shapes: vec![Shape::default(); mesh.face_slots()],
            mesh,
            keeper,
            limits,
            counts: Counts::default(),
            patch: Patch::default(),
            star: Star::default(),
            recorder: None,
            ties: Ties::default(),
            pen,
            age: 0,
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

    /// What was done so far.
    pub fn counts(&self) -> Counts {
        self.counts
    }

    /// The thresholds.
    pub fn limits(&self) -> &Limits {
        &self.limits
    }

    /// Sets the least stretch that edits keep, and gives the one that held: for halvings, which make a face worse
    /// before the next one makes both better.
    pub fn set_min_stretch(&mut self, least: f64) -> f64 {
        std::mem::replace(&mut self.limits.min_stretch, least)
    }

    /// Shows every collapse from now on to `recorder`, which was made with the surface of this mesh.
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
}

/// The tolerance.
impl GuardedMesh<'_> {
    /// The certified bound of the two-sided distance to the reference: `tolerance`, or `None` where the input was
    /// further away somewhere and still is, or where the tolerance is no distance.
    pub fn certified_distance(&mut self, tolerance: f64) -> Option<f64> {
        match &mut self.keeper {
            Keeper::Distance { envelope, .. } => envelope.certifies(&self.mesh, tolerance).then_some(tolerance),
            Keeper::QuadricSum { .. } | Keeper::QuadricRms { .. } => None,
        }
    }

    /// As [`GuardedMesh::certified_distance`], and nearer where the surface began as the reference and every edit told
    /// how far it moved the surface: 0 where there was none.
    pub fn distance_bound(&mut self, tolerance: f64) -> Option<f64> {
        let traced = match &self.keeper {
            Keeper::Distance { envelope, .. } => envelope.traced(&self.mesh),
            Keeper::QuadricSum { .. } | Keeper::QuadricRms { .. } => None,
        };
        traced.or_else(|| self.certified_distance(tolerance))
    }

    /// The point of the reference nearest to `p`, where the tolerance has a reference.
    pub fn project(&self, p: DVec3) -> Option<DVec3> {
        self.keeper.project(p)
    }

    /// As [`GuardedMesh::project`] for many points near `middle`; they stay where there is no reference.
    pub fn project_round(&self, middle: DVec3, points: &mut [DVec3]) {
        self.keeper.project_round(middle, points);
    }

    /// The point of the reference's curves nearest to `p`, where the tolerance has a reference.
    pub fn project_to_curve(&self, p: DVec3) -> Option<DVec3> {
        self.keeper.project_to_curve(p)
    }

    /// Whether the vertex may lie at `p`, as far as quadrics say.
    pub(super) fn quadrics_admit(&self, v: VertexId, p: DVec3) -> bool {
        let (planes, lines) = (self.quadrics.planes(v), self.quadrics.lines(v));
        self.keeper.admits_point(planes, &lines, p - self.quadrics.origin)
    }
}

/// Shapes and curves.
impl GuardedMesh<'_> {
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

    /// The neighbours of a vertex along its only curve.
    pub fn curve_neighbours(&self, v: VertexId) -> Option<[VertexId; 2]> {
        let is_curve = |h: &HalfedgeId| self.mesh.edge_freedom(edge_of(*h)) != Freedom::Free;
        let mut ends = self.mesh.outgoing(v).filter(is_curve).map(|h| self.mesh.target(h));
        let pair = [ends.next()?, ends.next()?];
        ends.next().is_none().then_some(pair)
    }

    /// Most edges that a vertex may have; what the other copies of one on a seam have counts.
    pub(super) fn most_edges(&self, v: VertexId) -> usize {
        self.limits.max_valence.saturating_sub(self.mesh.valence_elsewhere(v))
    }

    /// The same of the vertex that some become: no fewer than one of them has, though on a seam no more than that one.
    pub(super) fn most_edges_of_merged(&self, vertices: &[VertexId]) -> usize {
        let on_seam = vertices.iter().copied().find(|&v| self.mesh.seam(v).is_some());
        if let Some(v) = on_seam {
            return self.most_edges(v).max(self.mesh.valence(v));
        }
        vertices.iter().map(|&v| self.mesh.valence(v)).fold(self.limits.max_valence, usize::max)
    }

    fn remember_shape(&mut self, f: FaceId, corners: [DVec3; 3]) {
        if f.index() >= self.shapes.len() {
            self.shapes.resize(f.index() + 1, Shape::default());
        }
        self.shapes[f.index()] = Shape { stretch: stretch(corners) as f32, size: triangle_size(corners) as f32 };
    }
}

/// The tests that all verbs share, and what follows an edit.
impl GuardedMesh<'_> {
    /// Whether a face of the patch turns too far: against itself where it has a normal, else against the old star.
    pub(super) fn folds(&self) -> bool {
        let patch = &self.patch;
        let normal_of = |f: FaceId| area_vector(self.mesh.corner_points(f));
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

    /// The costly tests: certified distance both ways, then self-intersection.
    pub(super) fn admit_patch(&mut self) -> Result<(), Refused> {
        let mut patch = std::mem::take(&mut self.patch);
        let admitted = self.costly_tests(&mut patch);
        self.patch = patch;
        match admitted {
            Err(Refused::Tolerance) => self.counts.refused_by_tolerance += 1,
            Err(Refused::Intersection) => self.counts.refused_by_intersection += 1,
            Err(_) | Ok(()) => {}
        }
        admitted
    }

    fn costly_tests(&mut self, patch: &mut Patch) -> Result<(), Refused> {
        if self.pen.as_ref().is_some_and(|pen| pen.bars(patch)) {
            return Err(Refused::Extent);
        }
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
                return Err(Refused::Tolerance);
            }
            is_sheet = envelope.is_sheet();
        }
        let (mesh, collision) = (&self.mesh, &mut self.collision);
        let hits = if patch.is_same {
            collision.hits_more(mesh, &patch.old, |f| mesh.corner_points(f), &patch.points)
        } else {
            collision.hits(mesh, &patch.old, &patch.points, is_sheet)
        };
        if hits { Err(Refused::Intersection) } else { Ok(()) }
    }

    /// After an edit was applied: everything beside the mesh follows. The patch's `ids` must name all new faces.
    pub(super) fn settle(&mut self) {
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
        self.age += 1;
    }
}
