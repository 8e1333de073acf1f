//! The quadrics beside the workshop: the planes and lines of the input that each vertex has gathered.

use glam::DVec3;
use rustc_hash::FxHashMap;

use crate::mesh::geometry::{Aabb, area_vector};
use crate::mesh::halfedge::{HalfedgeMesh, halfedge_of, twin};
use crate::mesh::{EdgeId, FaceId, Freedom, VertexId};
use crate::technique::quadric::Quadric;

/// What a vertex has gathered.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Gathered {
    pub(super) planes: Quadric,
    pub(super) lines: Quadric,
}

impl Gathered {
    /// How many planes, each counted once for every vertex that began with it.
    pub fn planes(&self) -> f64 {
        self.planes.trace()
    }
}

/// Plane and line quadrics of the vertices, about a local origin.
#[derive(Debug, Default)]
pub(super) struct Quadrics {
    /// What the quadrics are about.
    pub(super) origin: DVec3,
    /// The weight of the sharpest marked edges.
    feature_weight: f64,
    planes: Vec<Quadric>,
    lines: FxHashMap<VertexId, Quadric>,
}

impl Quadrics {
    /// The quadrics of a fresh mesh, about its middle or another origin. `feature_weight` is the weight of the sharpest
    /// marked edges.
    pub(super) fn new(mesh: &HalfedgeMesh, feature_weight: f64, origin: Option<DVec3>) -> Self {
        let middle = || {
            let bounds = Aabb::of(mesh.vertices().map(|v| mesh.point(v)));
            if bounds.is_empty() { DVec3::ZERO } else { bounds.centre() }
        };
        let origin = origin.unwrap_or_else(middle);
        let mut this = Self { feature_weight, ..Self::default() };
        this.begin(mesh, origin);
        this
    }

    /// Begins anew with the faces and marked edges of `mesh`.
    pub(super) fn begin(&mut self, mesh: &HalfedgeMesh, origin: DVec3) {
        self.origin = origin;
        self.planes = vec![Quadric::default(); mesh.vertex_slots()];
        self.lines.clear();
        for f in mesh.faces() {
            if let Some(plane) = self.plane(mesh, f) {
                for v in mesh.corners(f) {
                    self.planes[v.index()].add(&plane);
                }
            }
        }
        for e in mesh.edges().filter(|&e| mesh.edge_freedom(e) != Freedom::Free) {
            let [a, b] = mesh.ends(e);
            let (p, q) = (mesh.point(a) - origin, mesh.point(b) - origin);
            if let Some(direction) = (q - p).try_normalize() {
                let line = Quadric::line(direction, p, self.feature_weight * sharpness(mesh, e));
                self.lines.entry(a).or_default().add(&line);
                self.lines.entry(b).or_default().add(&line);
            }
        }
    }

    /// Gives a vertex what it had gathered elsewhere, about the same origin.
    pub(super) fn set(&mut self, v: VertexId, gathered: Gathered) {
        self.planes[v.index()] = gathered.planes;
        if gathered.lines != Quadric::default() {
            self.lines.insert(v, gathered.lines);
        }
    }

    fn plane(&self, mesh: &HalfedgeMesh, f: FaceId) -> Option<Quadric> {
        let corners = mesh.corner_points(f).map(|p| p - self.origin);
        area_vector(corners).try_normalize().map(|n| Quadric::plane(n, corners[0]))
    }

    /// The planes gathered at a vertex.
    pub(super) fn planes(&self, v: VertexId) -> &Quadric {
        &self.planes[v.index()]
    }

    /// The lines gathered at a vertex.
    pub(super) fn lines(&self, v: VertexId) -> Quadric {
        if self.lines.is_empty() {
            return Quadric::default();
        }
        self.lines.get(&v).copied().unwrap_or_default()
    }

    /// Gives the planes and lines of a vertex that is gone to the one it became.
    pub(super) fn merge(&mut self, gone: VertexId, kept: VertexId) {
        let planes = self.planes[gone.index()];
        self.planes[kept.index()].add(&planes);
        if let Some(lines) = self.lines.remove(&gone) {
            self.lines.entry(kept).or_default().add(&lines);
        }
    }

    /// Gives a new vertex the planes of the faces round it.
    pub(super) fn found(&mut self, mesh: &HalfedgeMesh, v: VertexId) {
        if v.index() >= self.planes.len() {
            self.planes.resize(v.index() + 1, Quadric::default());
        }
        self.planes[v.index()] = self.around(mesh, v);
    }

    /// The planes of the faces round a vertex as they are now.
    pub(super) fn around(&self, mesh: &HalfedgeMesh, v: VertexId) -> Quadric {
        let mut sum = Quadric::default();
        for f in mesh.faces_around(v) {
            if let Some(plane) = self.plane(mesh, f) {
                sum.add(&plane);
            }
        }
        sum
    }
}

/// Half of 1 − n·m: 0 where flat, 1 where folded; never below 0.05, so that flat marked edges hold too; 1 on rims.
fn sharpness(mesh: &HalfedgeMesh, e: EdgeId) -> f64 {
    let h = halfedge_of(e);
    let normal = |side| mesh.face(side).and_then(|f| area_vector(mesh.corner_points(f)).try_normalize());
    match (normal(h), normal(twin(h))) {
        (Some(m), Some(n)) => (0.5 * (1.0 - m.dot(n))).max(0.05),
        _ => 1.0,
    }
}
