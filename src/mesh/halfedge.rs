//! The half-edge workshop: the editable form of a surface.
//!
//! A step enters it with a [`Surface`](super::Surface) and the resolved freedom of its elements, edits it through
//! [`edit`](super::edit), and leaves with a surface that carries the same groups, regions, marks, pins and seams.
//! Index-based half-edges in a structure of arrays: M. Mäntylä, *An Introduction to Solid Modeling*, 1988;
//! M. Botsch et al., *OpenMesh*, OpenSG Symposium 2002. Edge `e` owns the half-edges `2e` and `2e + 1`, so the twin of
//! `h` is `h ^ 1`; boundary half-edges have no face and are linked round their loop.
//!
//! Invariants between edits: every live vertex has a fan of faces, its half-edge is the boundary one where there is
//! one; no edge joins the same two vertices twice; every face has three distinct corners. Deleted elements stay as
//! tombstones until the workshop is left, which keeps the order of the survivors.
//! Cost: 12 bytes a half-edge, 5 an edge, 8 a face, 37 a vertex, about 36 bytes a triangle times two.
//! Fields are dropped here, because edits move and merge their elements; see [`transfer`](super::transfer).

mod enter;
mod leave;
mod seams;
#[cfg(test)]
pub(crate) mod tests;

use glam::DVec3;

use self::seams::Seams;
use super::carried::{EdgeMark, Freedom, MarkCause};
use super::classes::{ClassId, Classes};
use super::id::{EdgeId, Face, FaceId, Halfedge, HalfedgeId, IdVec, Vertex, VertexId};
use std::collections::BTreeMap;

pub use enter::{EnterError, NonFan, NonManifoldEdge};
pub use leave::{Left, Renumbering};

/// Stands for "no half-edge", "no face" and "no vertex" in the arrays.
pub(super) const NONE: u32 = u32::MAX;

/// The resolved freedom and the carried mark of an edge in one byte.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct EdgeState(u8);

const FREEDOMS: [Freedom; 3] = [Freedom::Free, Freedom::OnCurve, Freedom::Keep];
const CAUSES: [MarkCause; 5] =
    [MarkCause::Seam, MarkCause::Boundary, MarkCause::Feature, MarkCause::RegionBorder, MarkCause::Locked];

/// Of an [`EdgeState`]: the edge is kept only because it lies on a seam.
const SEAM_ONLY: u8 = 1 << 7;

impl EdgeState {
    /// Bits 0 and 1: resolved freedom. Bits 2 and 3: freedom of the mark. Bits 4 to 6: its cause plus one, 0 without.
    /// Bit 7: [`SEAM_ONLY`].
    pub(super) fn new(freedom: Freedom, mark: Option<EdgeMark>) -> Self {
        let mark = mark.map_or(0, |m| ((m.freedom as u8) << 2) | ((m.cause as u8 + 1) << 4));
        Self(freedom as u8 | mark)
    }

    pub(super) fn freedom(self) -> Freedom {
        FREEDOMS[usize::from(self.0 & 3).min(2)]
    }

    pub(super) fn mark(self) -> Option<EdgeMark> {
        let cause = CAUSES.get(usize::from((self.0 & !SEAM_ONLY) >> 4).checked_sub(1)?)?;
        Some(EdgeMark { freedom: FREEDOMS[usize::from((self.0 >> 2) & 3).min(2)], cause: *cause })
    }

    /// The same of an edge that nothing but a seam keeps.
    pub(super) fn on_seam_only(self) -> Self {
        Self(self.0 | SEAM_ONLY)
    }

    pub(super) fn is_on_seam_only(self) -> bool {
        self.0 & SEAM_ONLY != 0
    }

    /// The state of an edge that two edges became: the stricter freedom, then the first cause.
    pub(super) fn merge(self, other: Self) -> Self {
        let mark = match (self.mark(), other.mark()) {
            (Some(a), Some(b)) if (b.freedom, a.cause) > (a.freedom, b.cause) => Some(b),
            (a, b) => a.or(b),
        };
        let merged = Self::new(self.freedom().max(other.freedom()), mark);
        let keeps = |state: Self| state.freedom() == Freedom::Keep && !state.is_on_seam_only();
        let is_on_seam = self.is_on_seam_only() || other.is_on_seam_only();
        if is_on_seam && !keeps(self) && !keeps(other) { merged.on_seam_only() } else { merged }
    }
}

/// What the workshop remembers of the surface's names, to give them back when it is left.
#[derive(Clone, Debug, Default)]
pub(super) struct Names {
    pub(super) face_groups: Vec<String>,
    pub(super) edge_groups: Vec<String>,
    pub(super) vertex_groups: Vec<String>,
    /// Region names; region label `r` is face label `face_groups.len() + r`.
    pub(super) regions: Option<Vec<String>>,
}

/// An oriented 2-manifold triangle mesh that can be edited.
#[derive(Clone, Debug)]
pub struct HalfedgeMesh {
    pub(super) points: IdVec<Vertex, DVec3>,
    /// Outgoing half-edge, the boundary one where there is one.
    pub(super) vertex_halfedge: IdVec<Vertex, u32>,
    pub(super) vertex_freedom: IdVec<Vertex, Freedom>,
    pub(super) vertex_class: IdVec<Vertex, ClassId>,
    pub(super) vertex_version: IdVec<Vertex, u32>,
    pub(super) next: IdVec<Halfedge, u32>,
    pub(super) origin: IdVec<Halfedge, u32>,
    pub(super) halfedge_face: IdVec<Halfedge, u32>,
    pub(super) edge_state: IdVec<super::id::Edge, EdgeState>,
    pub(super) edge_class: IdVec<super::id::Edge, ClassId>,
    pub(super) face_halfedge: IdVec<Face, u32>,
    pub(super) face_class: IdVec<Face, ClassId>,
    pub(super) vertex_classes: Classes,
    pub(super) edge_classes: Classes,
    pub(super) face_classes: Classes,
    pub(super) names: Names,
    pub(super) pins: BTreeMap<VertexId, Freedom>,
    pub(super) seams: Seams,
    pub(super) live_vertices: usize,
    pub(super) live_edges: usize,
    pub(super) live_faces: usize,
}

/// Elements: how many there are and which are alive.
impl HalfedgeMesh {
    /// Live vertices.
    pub fn vertex_count(&self) -> usize {
        self.live_vertices
    }

    /// Live edges.
    pub fn edge_count(&self) -> usize {
        self.live_edges
    }

    /// Live faces.
    pub fn face_count(&self) -> usize {
        self.live_faces
    }

    /// Euler characteristic of the live mesh.
    pub fn euler_characteristic(&self) -> i64 {
        self.live_vertices as i64 - self.live_edges as i64 + self.live_faces as i64
    }

    /// One more than the largest vertex number ever used, for arrays beside the workshop.
    pub fn vertex_slots(&self) -> usize {
        self.points.len()
    }

    /// One more than the largest edge number ever used.
    pub fn edge_slots(&self) -> usize {
        self.edge_state.len()
    }

    /// One more than the largest face number ever used.
    pub fn face_slots(&self) -> usize {
        self.face_halfedge.len()
    }

    /// Whether the vertex exists still.
    #[inline]
    pub fn vertex_is_live(&self, v: VertexId) -> bool {
        self.vertex_halfedge[v] != NONE
    }

    /// Whether the edge exists still.
    #[inline]
    pub fn edge_is_live(&self, e: EdgeId) -> bool {
        self.origin[halfedge_of(e)] != NONE
    }

    /// Whether the face exists still.
    #[inline]
    pub fn face_is_live(&self, f: FaceId) -> bool {
        self.face_halfedge[f] != NONE
    }

    /// Live vertices in id order.
    pub fn vertices(&self) -> impl Iterator<Item = VertexId> + '_ {
        self.points.ids().filter(|&v| self.vertex_is_live(v))
    }

    /// Live edges in id order.
    pub fn edges(&self) -> impl Iterator<Item = EdgeId> + '_ {
        self.edge_state.ids().filter(|&e| self.edge_is_live(e))
    }

    /// Live faces in id order.
    pub fn faces(&self) -> impl Iterator<Item = FaceId> + '_ {
        self.face_halfedge.ids().filter(|&f| self.face_is_live(f))
    }
}

/// The half-edge of an edge that leaves the end it was made with first.
#[inline]
pub fn halfedge_of(e: EdgeId) -> HalfedgeId {
    HalfedgeId::from_raw(e.raw() << 1)
}

/// The edge a half-edge belongs to.
#[inline]
pub fn edge_of(h: HalfedgeId) -> EdgeId {
    EdgeId::from_raw(h.raw() >> 1)
}

/// The other side of the edge.
#[inline]
pub fn twin(h: HalfedgeId) -> HalfedgeId {
    HalfedgeId::from_raw(h.raw() ^ 1)
}

/// Walking.
impl HalfedgeMesh {
    /// The half-edge after `h` round its face or boundary loop.
    #[inline]
    pub fn next(&self, h: HalfedgeId) -> HalfedgeId {
        HalfedgeId::from_raw(self.next[h])
    }

    /// The half-edge before `h`. On a boundary loop this walks round the origin of `h`.
    #[inline]
    pub fn prev(&self, h: HalfedgeId) -> HalfedgeId {
        if self.halfedge_face[h] != NONE {
            return self.next(self.next(h));
        }
        let mut incoming = twin(h);
        while self.halfedge_face[incoming] != NONE {
            incoming = twin(self.next(incoming));
        }
        incoming
    }

    /// Where `h` starts.
    #[inline]
    pub fn origin(&self, h: HalfedgeId) -> VertexId {
        VertexId::from_raw(self.origin[h])
    }

    /// Where `h` ends.
    #[inline]
    pub fn target(&self, h: HalfedgeId) -> VertexId {
        self.origin(twin(h))
    }

    /// The face left of `h`; `None` on a boundary.
    #[inline]
    pub fn face(&self, h: HalfedgeId) -> Option<FaceId> {
        let face = self.halfedge_face[h];
        (face != NONE).then(|| FaceId::from_raw(face))
    }

    /// The corner opposite `h` in its face.
    #[inline]
    pub fn apex(&self, h: HalfedgeId) -> Option<VertexId> {
        (self.halfedge_face[h] != NONE).then(|| self.target(self.next(h)))
    }

    /// The ends of an edge.
    #[inline]
    pub fn ends(&self, e: EdgeId) -> [VertexId; 2] {
        let h = halfedge_of(e);
        [self.origin(h), self.target(h)]
    }

    /// A half-edge of a face.
    #[inline]
    pub fn face_halfedge(&self, f: FaceId) -> HalfedgeId {
        HalfedgeId::from_raw(self.face_halfedge[f])
    }

    /// The corners of a face, counter-clockwise.
    #[inline]
    pub fn corners(&self, f: FaceId) -> [VertexId; 3] {
        let h = self.face_halfedge(f);
        let n = self.next(h);
        [self.origin(h), self.origin(n), self.target(n)]
    }

    /// The coordinates of a face's corners.
    #[inline]
    pub fn corner_points(&self, f: FaceId) -> [DVec3; 3] {
        self.corners(f).map(|v| self.points[v])
    }

    /// An outgoing half-edge of a vertex: the boundary one where there is one.
    #[inline]
    pub fn vertex_halfedge(&self, v: VertexId) -> HalfedgeId {
        HalfedgeId::from_raw(self.vertex_halfedge[v])
    }

    /// The outgoing half-edges of a live vertex, clockwise seen from outside, the boundary one first.
    pub fn outgoing(&self, v: VertexId) -> Outgoing<'_> {
        self.outgoing_from(self.vertex_halfedge(v))
    }

    /// The outgoing half-edges of the origin of `h`, clockwise seen from outside, `h` first.
    pub fn outgoing_from(&self, h: HalfedgeId) -> Outgoing<'_> {
        Outgoing { mesh: self, first: h, at: Some(h) }
    }

    /// The neighbours of a vertex, clockwise seen from outside.
    pub fn neighbours(&self, v: VertexId) -> impl Iterator<Item = VertexId> + '_ {
        self.outgoing(v).map(|h| self.target(h))
    }

    /// The faces round a vertex, clockwise seen from outside.
    pub fn faces_around(&self, v: VertexId) -> impl Iterator<Item = FaceId> + '_ {
        self.outgoing(v).filter_map(|h| self.face(h))
    }

    /// The number of neighbours.
    pub fn valence(&self, v: VertexId) -> usize {
        self.outgoing(v).count()
    }

    /// Whether a vertex lies on a rim.
    #[inline]
    pub fn is_boundary_vertex(&self, v: VertexId) -> bool {
        self.halfedge_face[self.vertex_halfedge(v)] == NONE
    }

    /// Whether an edge lies on a rim.
    #[inline]
    pub fn is_boundary_edge(&self, e: EdgeId) -> bool {
        let h = halfedge_of(e);
        self.halfedge_face[h] == NONE || self.halfedge_face[twin(h)] == NONE
    }

    /// The half-edge from `a` to `b`, where they are neighbours.
    pub fn find_halfedge(&self, a: VertexId, b: VertexId) -> Option<HalfedgeId> {
        self.outgoing(a).find(|&h| self.target(h) == b)
    }

    /// The boundary half-edges, one a loop: each the lowest of its loop, in order.
    pub fn boundary_loops(&self) -> Vec<HalfedgeId> {
        let mut seen = vec![false; self.next.len()];
        let mut loops = Vec::new();
        for h in self.next.ids() {
            if self.origin[h] == NONE || self.halfedge_face[h] != NONE || seen[h.index()] {
                continue;
            }
            loops.push(h);
            let mut at = h;
            while !seen[at.index()] {
                seen[at.index()] = true;
                at = self.next(at);
            }
        }
        loops
    }
}

/// See [`HalfedgeMesh::outgoing`].
#[derive(Clone, Debug)]
pub struct Outgoing<'a> {
    mesh: &'a HalfedgeMesh,
    first: HalfedgeId,
    at: Option<HalfedgeId>,
}

impl Iterator for Outgoing<'_> {
    type Item = HalfedgeId;

    #[inline]
    fn next(&mut self) -> Option<HalfedgeId> {
        let h = self.at?;
        let following = self.mesh.next(twin(h));
        self.at = (following != self.first).then_some(following);
        Some(h)
    }
}

/// What elements carry.
impl HalfedgeMesh {
    /// The coordinates of a vertex.
    #[inline]
    pub fn point(&self, v: VertexId) -> DVec3 {
        self.points[v]
    }

    /// All coordinates by vertex slot; those of deleted vertices mean nothing.
    pub fn points(&self) -> &IdVec<Vertex, DVec3> {
        &self.points
    }

    /// How far edits may change a vertex.
    #[inline]
    pub fn vertex_freedom(&self, v: VertexId) -> Freedom {
        self.vertex_freedom[v]
    }

    /// How far edits may change an edge.
    #[inline]
    pub fn edge_freedom(&self, e: EdgeId) -> Freedom {
        self.edge_state[e].freedom()
    }

    /// Whether an edge is kept only because it lies on a seam: it may be split if all its copies are.
    pub fn is_on_seam_only(&self, e: EdgeId) -> bool {
        self.edge_state[e].is_on_seam_only()
    }

    /// The carried mark of an edge.
    pub fn edge_mark(&self, e: EdgeId) -> Option<EdgeMark> {
        self.edge_state[e].mark()
    }

    /// The class of a face: faces with equal groups and region have equal classes.
    #[inline]
    pub fn face_class(&self, f: FaceId) -> ClassId {
        self.face_class[f]
    }

    /// Whether a vertex or an edge at it belongs to a group of its own kind.
    pub fn is_grouped(&self, v: VertexId) -> bool {
        self.vertex_class[v] != 0 || self.outgoing(v).any(|h| self.edge_class[edge_of(h)] != 0)
    }

    /// Changes whenever the star of the vertex changes.
    #[inline]
    pub fn version(&self, v: VertexId) -> u32 {
        self.vertex_version[v]
    }

    #[inline]
    pub(super) fn bump(&mut self, v: VertexId) {
        self.vertex_version[v] = self.vertex_version[v].wrapping_add(1);
    }

    /// Bumps a vertex and its neighbours.
    pub(super) fn bump_star(&mut self, v: VertexId) {
        self.bump(v);
        let first = self.vertex_halfedge(v);
        let mut h = first;
        loop {
            let neighbour = self.target(h);
            self.bump(neighbour);
            h = self.next(twin(h));
            if h == first {
                break;
            }
        }
    }
}
