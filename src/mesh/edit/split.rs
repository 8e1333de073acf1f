//! Edge split: a new vertex on an edge halves it and its faces.
//!
//! The halves inherit mark, freedom and groups of the edge, the new faces the classes of theirs; the new vertex is as
//! free as the edge and joins the vertex groups that both ends belong to. Refused on kept edges only; those of a seam
//! are split with all their copies, and the new vertices are on one seam again.
//! Invariants: Euler characteristic, rims, curves, groups. Cost: O(1), and O(valence) at a rim.

use glam::DVec3;
use smallvec::SmallVec;

use super::Refusal;
use crate::mesh::carried::Freedom;
use crate::mesh::halfedge::{EdgeState, HalfedgeMesh, NONE, halfedge_of, twin};
use crate::mesh::id::{EdgeId, FaceId, HalfedgeId, VertexId};

/// A split that freedom admits. Valid until the stars of the edge's ends change.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SplitPlan {
    /// The edge.
    pub edge: EdgeId,
    /// Its ends: the edge keeps the first one.
    pub ends: [VertexId; 2],
    /// Whether the new vertex must lie on the edge.
    pub is_curve: bool,
}

/// Whether the edge may be split.
///
/// # Errors
/// [`Refusal::MarkedEdge`] for a kept edge.
pub fn check_split(mesh: &HalfedgeMesh, edge: EdgeId) -> Result<SplitPlan, Refusal> {
    match mesh.edge_freedom(edge) {
        Freedom::Keep => Err(Refusal::MarkedEdge { edge }),
        freedom => Ok(SplitPlan { edge, ends: mesh.ends(edge), is_curve: freedom == Freedom::OnCurve }),
    }
}

/// Whether the edge may be split if all its copies are: as [`check_split`], and what only a seam keeps.
///
/// # Errors
/// [`Refusal::MarkedEdge`] for an edge that something else keeps.
pub fn check_split_of_copy(mesh: &HalfedgeMesh, edge: EdgeId) -> Result<SplitPlan, Refusal> {
    if mesh.is_on_seam_only(edge) {
        return Ok(SplitPlan { edge, ends: mesh.ends(edge), is_curve: true });
    }
    check_split(mesh, edge)
}

/// Splits as planned at `wish`; on a curve at the point of the edge nearest to it. Returns the new vertex.
pub fn split(mesh: &mut HalfedgeMesh, plan: &SplitPlan, wish: DVec3) -> VertexId {
    debug_assert_eq!(check_split(mesh, plan.edge).as_ref(), Ok(plan), "the plan is out of date");
    let [i, j] = plan.ends;
    let at = if plan.is_curve { super::Placement::Segment(mesh.point(i), mesh.point(j)).nearest(wish) } else { wish };
    halve(mesh, plan, at)
}

/// Splits all copies of an edge, each at its point, which lies on it: that is the caller's to see to, and that these
/// are all copies. Where they are of a seam, the new vertices are on a new seam. Returns those, in order.
pub fn split_copies(mesh: &mut HalfedgeMesh, copies: &[(SplitPlan, DVec3)]) -> SmallVec<[VertexId; 3]> {
    let made: SmallVec<[VertexId; 3]> = copies.iter().map(|(plan, at)| halve(mesh, plan, *at)).collect();
    let is_on_seam = copies.iter().all(|(plan, _)| plan.ends.iter().all(|v| mesh.seams.contains(*v)));
    if is_on_seam {
        mesh.seams.add(&made);
    }
    made
}

fn halve(mesh: &mut HalfedgeMesh, plan: &SplitPlan, at: DVec3) -> VertexId {
    let [i, j] = plan.ends;
    let class = mesh.vertex_classes.intersection(mesh.vertex_class[i], mesh.vertex_class[j]);
    let m = mesh.add_vertex(at, mesh.edge_freedom(plan.edge), class);
    let h = halfedge_of(plan.edge);
    let t = twin(h);
    let before = mesh.prev(t);
    let half = mesh.add_edge([m, j], mesh.edge_state[plan.edge], mesh.edge_class[plan.edge]);
    let n = halfedge_of(half);
    mesh.origin[t] = m.raw();
    if mesh.vertex_halfedge[j] == t.raw() {
        mesh.vertex_halfedge[j] = twin(n).raw();
    }
    mesh.vertex_halfedge[m] = if mesh.face(t).is_none() { t.raw() } else { n.raw() };
    mesh.halve_left(h, n);
    mesh.halve_right(t, twin(n), before);
    for v in [Some(i), Some(j), mesh.apex(h), mesh.apex(t)].into_iter().flatten() {
        mesh.bump(v);
    }
    m
}

impl HalfedgeMesh {
    /// The face left of `h = i→m`, which was `i→j`, keeps `i`; a new one gets `n = m→j`.
    fn halve_left(&mut self, h: HalfedgeId, n: HalfedgeId) {
        let Some(face) = self.face(h) else {
            self.next[n] = self.next[h];
            self.next[h] = n.raw();
            return;
        };
        let a = self.next(h);
        let b = self.next(a);
        let k = halfedge_of(self.add_edge([self.origin(n), self.origin(b)], EdgeState::default(), 0));
        self.link_face(face, [h, k, b]);
        let new = self.add_face(face);
        self.link_face(new, [n, a, twin(k)]);
    }

    /// The face left of `t = m→i`, which was `j→i`, keeps `i`; a new one gets `nt = j→m`.
    fn halve_right(&mut self, t: HalfedgeId, nt: HalfedgeId, before: HalfedgeId) {
        let Some(face) = self.face(t) else {
            self.next[before] = nt.raw();
            self.next[nt] = t.raw();
            return;
        };
        let x = self.next(t);
        let y = self.next(x);
        let l = halfedge_of(self.add_edge([self.origin(y), self.origin(t)], EdgeState::default(), 0));
        self.link_face(face, [t, x, l]);
        let new = self.add_face(face);
        self.link_face(new, [nt, twin(l), y]);
    }

    fn add_vertex(&mut self, at: DVec3, freedom: Freedom, class: u32) -> VertexId {
        let v = self.points.push(at);
        self.vertex_halfedge.push(NONE);
        self.vertex_freedom.push(freedom);
        self.vertex_class.push(class);
        self.vertex_version.push(0);
        self.vertex_classes.add(class);
        self.live_vertices += 1;
        v
    }

    fn add_edge(&mut self, ends: [VertexId; 2], state: EdgeState, class: u32) -> EdgeId {
        let edge = self.edge_state.push(state);
        self.edge_class.push(class);
        self.edge_classes.add(class);
        for end in ends {
            self.origin.push(end.raw());
            self.next.push(NONE);
            self.halfedge_face.push(NONE);
        }
        self.live_edges += 1;
        edge
    }

    /// A face of the class of `like`.
    fn add_face(&mut self, like: FaceId) -> FaceId {
        let class = self.face_class[like];
        self.face_class.push(class);
        self.face_classes.add(class);
        self.live_faces += 1;
        self.face_halfedge.push(NONE)
    }

    fn link_face(&mut self, face: FaceId, cycle: [HalfedgeId; 3]) {
        for k in 0..3 {
            self.next[cycle[k]] = cycle[(k + 1) % 3].raw();
            self.halfedge_face[cycle[k]] = face.raw();
        }
        self.face_halfedge[face] = cycle[0].raw();
    }
}
