//! A triangulation that lives on the surface: edges are straight lines across faces, known by their lengths and by the
//! directions in which they leave their ends.
//!
//! N. Sharp, Y. Soliman, K. Crane, *Navigating intrinsic triangulations*, ACM Transactions on Graphics 38(4), 2019:
//! each half-edge has the angle from a first half-edge at its origin, and a flip finds the new angles from those beside
//! it. Half-edges are numbered as in the workshop: `2e` and `2e + 1` are the sides of edge `e`.

use std::f64::consts::PI;

use glam::DVec2;

use crate::mesh::halfedge::{edge_of, halfedge_of, twin};
use crate::mesh::id::{Edge, Halfedge, Vertex};
use crate::mesh::{EdgeId, HalfedgeId, HalfedgeMesh, IdVec, VertexId};

/// A quad flatter than this at a corner is not flipped: sine of the angle left, relative.
const FLAT: f64 = 1e-9;

/// The intrinsic triangulation.
#[derive(Clone, Debug)]
pub(super) struct Intrinsic {
    next: IdVec<Halfedge, HalfedgeId>,
    origin: IdVec<Halfedge, VertexId>,
    has_face: IdVec<Halfedge, bool>,
    length: IdVec<Edge, f64>,
    /// From the vertex's first half-edge counter-clockwise, below `around`.
    direction: IdVec<Halfedge, f64>,
    around: IdVec<Vertex, f64>,
}

/// The angle between two sides of a triangle, opposite the third.
fn corner(a: f64, b: f64, opposite: f64) -> f64 {
    let cosine = (a * a + b * b - opposite * opposite) / (2.0 * a * b);
    if cosine.is_nan() { 0.0 } else { libm::acos(cosine.clamp(-1.0, 1.0)) }
}

impl Intrinsic {
    /// The surface's own triangulation.
    pub(super) fn new(mesh: &HalfedgeMesh) -> Self {
        let halfedges = || (0..2 * mesh.edge_slots()).map(HalfedgeId::new);
        let length = |e: EdgeId| {
            let [a, b] = mesh.ends(e).map(|v| mesh.point(v));
            a.distance(b)
        };
        let mut made = Self {
            next: halfedges().map(|h| mesh.next(h)).collect(),
            origin: halfedges().map(|h| mesh.origin(h)).collect(),
            has_face: halfedges().map(|h| mesh.face(h).is_some()).collect(),
            length: (0..mesh.edge_slots()).map(|e| length(EdgeId::new(e))).collect(),
            direction: IdVec::filled(0.0, 2 * mesh.edge_slots()),
            around: IdVec::filled(0.0, mesh.vertex_slots()),
        };
        for v in mesh.vertices() {
            let mut angle = 0.0;
            for h in first_to_last(mesh, v) {
                made.direction[h] = angle;
                angle += if made.has_face[h] { made.angle(h) } else { 0.0 };
            }
            made.around[v] = angle;
        }
        made
    }

    pub(super) fn next(&self, h: HalfedgeId) -> HalfedgeId {
        self.next[h]
    }

    fn prev(&self, h: HalfedgeId) -> HalfedgeId {
        self.next[self.next[h]]
    }

    pub(super) fn target(&self, h: HalfedgeId) -> VertexId {
        self.origin[twin(h)]
    }

    pub(super) fn origin(&self, h: HalfedgeId) -> VertexId {
        self.origin[h]
    }

    pub(super) fn length(&self, h: HalfedgeId) -> f64 {
        self.length[edge_of(h)]
    }

    pub(super) fn direction(&self, h: HalfedgeId) -> f64 {
        self.direction[h]
    }

    /// The next half-edge out of the same vertex, counter-clockwise; the half-edge must have a face.
    pub(super) fn turned(&self, h: HalfedgeId) -> HalfedgeId {
        twin(self.prev(h))
    }

    /// The angle of the face left of `h` at its origin.
    pub(super) fn angle(&self, h: HalfedgeId) -> f64 {
        corner(self.length(h), self.length(self.prev(h)), self.length(self.next[h]))
    }

    /// The angle from one half-edge counter-clockwise to another out of the same vertex.
    pub(super) fn wedge(&self, from: HalfedgeId, to: HalfedgeId) -> f64 {
        let (mut angle, mut h) = (0.0, from);
        while h != to && self.has_face[h] {
            angle += self.angle(h);
            h = self.turned(h);
        }
        angle
    }

    /// The angle of both faces at the far end of `h`.
    pub(super) fn far_angle(&self, h: HalfedgeId) -> f64 {
        self.angle(self.next[h]) + self.angle(twin(h))
    }

    /// Replaces an edge by the other diagonal of its quad, where that is convex.
    pub(super) fn flip(&mut self, e: EdgeId) -> bool {
        let h = halfedge_of(e);
        let t = twin(h);
        if !self.has_face[h] || !self.has_face[t] {
            return false;
        }
        let (hn, hp, tn, tp) = (self.next[h], self.prev(h), self.next[t], self.prev(t));
        // The edge lies on the x axis, from the origin.
        let base = self.length(h);
        let apex = |side: f64, beside: f64, beyond: f64| {
            let x = (beside * beside - beyond * beyond + base * base) / (2.0 * base);
            DVec2::new(x, side * (beside * beside - x * x).max(0.0).sqrt())
        };
        let up = apex(1.0, self.length(hp), self.length(hn));
        let down = apex(-1.0, self.length(tn), self.length(tp));
        let x = up.x + (down.x - up.x) * up.y / (up.y - down.y);
        if !(x > FLAT * base && x < (1.0 - FLAT) * base) {
            return false;
        }
        let (i, j) = (self.origin[h], self.origin[t]);
        let (k, l) = (self.origin[hp], self.origin[tp]);
        debug_assert!(self.origin[tn] == i && self.origin[hn] == j);
        for (from, to) in [(h, hp), (hp, tn), (tn, h), (t, tp), (tp, hn), (hn, t)] {
            self.next[from] = to;
        }
        self.origin[h] = l;
        self.origin[t] = k;
        self.length[e] = up.distance(down);
        self.direction[h] = self.beyond(tp, l);
        self.direction[t] = self.beyond(hp, k);
        true
    }

    /// The direction one corner further round `v`.
    fn beyond(&self, h: HalfedgeId, v: VertexId) -> f64 {
        let angle = self.direction[h] + self.angle(h);
        if angle >= self.around[v] { (angle - self.around[v]).max(0.0) } else { angle }
    }
}

/// The half-edges out of a vertex, counter-clockwise; on a rim from the first with a face to the one without.
pub(super) fn first_to_last(mesh: &HalfedgeMesh, v: VertexId) -> Vec<HalfedgeId> {
    let mut ring: Vec<HalfedgeId> = mesh.outgoing(v).collect();
    // The workshop goes clockwise, and begins on a rim with the half-edge that has no face.
    ring.reverse();
    if !mesh.is_boundary_vertex(v) {
        ring.rotate_right(1);
    }
    ring
}

/// Whether an angle is as good as straight.
pub(super) fn is_straight(angle: f64) -> bool {
    angle.is_nan() || angle >= PI - 1e-6
}
