//! Edge flip: the shared edge of two triangles becomes the other diagonal of their quadrilateral.
//!
//! Refused on rims, on marked or grouped edges, on borders of groups and regions, and where the new edge exists.
//! Whether the quadrilateral is flat and convex enough is the caller's to judge. Cost: O(valence).

use super::Refusal;
use crate::mesh::carried::Freedom;
use crate::mesh::halfedge::{HalfedgeMesh, edge_of, halfedge_of, twin};
use crate::mesh::id::{EdgeId, VertexId};

/// A flip that topology and freedom admit. Valid until the stars of the four vertices change.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FlipPlan {
    /// The edge.
    pub edge: EdgeId,
    /// Its ends, which the flip parts.
    pub ends: [VertexId; 2],
    /// The corners opposite it, left one first, which the flip joins.
    pub apexes: [VertexId; 2],
}

impl FlipPlan {
    /// The corners of the two triangles after the flip.
    pub fn new_faces(&self) -> [[VertexId; 3]; 2] {
        let ([i, j], [c, d]) = (self.ends, self.apexes);
        [[d, c, i], [c, d, j]]
    }
}

/// Whether the edge may be flipped.
///
/// # Errors
/// The first reason against it.
pub fn check_flip(mesh: &HalfedgeMesh, edge: EdgeId) -> Result<FlipPlan, Refusal> {
    let h = halfedge_of(edge);
    let (Some(left), Some(right)) = (mesh.face(h), mesh.face(twin(h))) else {
        return Err(Refusal::Boundary);
    };
    if mesh.edge_freedom(edge) != Freedom::Free || mesh.edge_mark(edge).is_some() || mesh.edge_class[edge] != 0 {
        return Err(Refusal::MarkedEdge { edge });
    }
    if mesh.face_class(left) != mesh.face_class(right) {
        return Err(Refusal::GroupBorder { edge });
    }
    let ends = [mesh.origin(h), mesh.target(h)];
    let apexes = [mesh.target(mesh.next(h)), mesh.target(mesh.next(twin(h)))];
    if apexes[0] == apexes[1] || mesh.find_halfedge(apexes[0], apexes[1]).is_some() {
        return Err(Refusal::DuplicateEdge { ends: apexes });
    }
    Ok(FlipPlan { edge, ends, apexes })
}

/// Flips as planned.
pub fn flip(mesh: &mut HalfedgeMesh, plan: &FlipPlan) {
    debug_assert_eq!(check_flip(mesh, plan.edge).as_ref(), Ok(plan), "the plan is out of date");
    let h = halfedge_of(plan.edge);
    let t = twin(h);
    let (a, x) = (mesh.next(h), mesh.next(t));
    let (b, y) = (mesh.next(a), mesh.next(x));
    let ([i, j], [c, d]) = (plan.ends, plan.apexes);
    let (left, right) = (mesh.halfedge_face[h], mesh.halfedge_face[t]);
    for cycle in [[h, b, x], [t, y, a]] {
        for k in 0..3 {
            mesh.next[cycle[k]] = cycle[(k + 1) % 3].raw();
        }
    }
    mesh.origin[h] = d.raw();
    mesh.origin[t] = c.raw();
    mesh.halfedge_face[x] = left;
    mesh.halfedge_face[a] = right;
    for (face, side) in [(left, h), (right, t)] {
        mesh.face_halfedge[crate::mesh::id::FaceId::from_raw(face)] = side.raw();
    }
    for (vertex, gone, stay) in [(i, h, x), (j, t, a)] {
        if mesh.vertex_halfedge[vertex] == gone.raw() {
            mesh.vertex_halfedge[vertex] = stay.raw();
        }
    }
    for v in [i, j, c, d] {
        mesh.bump(v);
    }
    debug_assert_eq!(edge_of(h), plan.edge);
}
