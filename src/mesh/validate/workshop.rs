//! Defects of the half-edge workshop: what an edit may have broken.

use crate::mesh::carried::Freedom;
use crate::mesh::halfedge::{HalfedgeMesh, NONE, edge_of, twin};
use crate::mesh::id::{EdgeId, FaceId, HalfedgeId, VertexId};

/// One thing wrong with a workshop: a fault of the kernel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum WorkshopDefect {
    /// `next` leads to a dead half-edge, to another origin or to another face.
    #[error("half-edge {halfedge} has a wrong next one")]
    BrokenLoop {
        /// The half-edge.
        halfedge: HalfedgeId,
    },
    /// A face's loop does not have three different corners.
    #[error("face {face} is no triangle")]
    NoTriangle {
        /// The face.
        face: FaceId,
    },
    /// A vertex's half-edge is dead, starts elsewhere, or is not the boundary one.
    #[error("vertex {vertex} has a wrong half-edge")]
    WrongVertexHalfedge {
        /// The vertex.
        vertex: VertexId,
    },
    /// Turning round a vertex does not reach all its half-edges, or a neighbour comes twice.
    #[error("the star of vertex {vertex} is no fan")]
    NoFan {
        /// The vertex.
        vertex: VertexId,
    },
    /// A strict edge ends at a looser vertex.
    #[error("edge {edge} is stricter than an end of it")]
    LooseEnd {
        /// The edge.
        edge: EdgeId,
    },
    /// The counts kept differ from the elements there are.
    #[error("the counts are wrong")]
    WrongCounts,
}

/// All defects of a workshop; none, unless the kernel has a fault.
pub fn validate_workshop(mesh: &HalfedgeMesh) -> Vec<WorkshopDefect> {
    let mut defects = Vec::new();
    let mut outgoing = vec![0_usize; mesh.vertex_slots()];
    for h in mesh.next.ids().filter(|&h| mesh.edge_is_live(edge_of(h))) {
        outgoing[mesh.origin(h).index()] += 1;
        let next = mesh.next[h];
        let is_good = next != NONE && mesh.origin[HalfedgeId::from_raw(next)] == mesh.origin[twin(h)] && {
            mesh.halfedge_face[HalfedgeId::from_raw(next)] == mesh.halfedge_face[h]
        };
        if !is_good {
            defects.push(WorkshopDefect::BrokenLoop { halfedge: h });
        }
    }
    if !defects.is_empty() {
        return defects;
    }
    faces(mesh, &mut defects);
    for v in mesh.vertices() {
        star(mesh, v, outgoing[v.index()], &mut defects);
    }
    for e in mesh.edges() {
        let freedom = mesh.edge_freedom(e);
        if freedom != Freedom::Free && mesh.ends(e).iter().any(|&v| mesh.vertex_freedom(v) < freedom) {
            defects.push(WorkshopDefect::LooseEnd { edge: e });
        }
    }
    let counts = (mesh.vertices().count(), mesh.edges().count(), mesh.faces().count());
    if counts != (mesh.vertex_count(), mesh.edge_count(), mesh.face_count()) {
        defects.push(WorkshopDefect::WrongCounts);
    }
    defects
}

fn faces(mesh: &HalfedgeMesh, defects: &mut Vec<WorkshopDefect>) {
    for f in mesh.faces() {
        let h = mesh.face_halfedge(f);
        let [a, b, c] = mesh.corners(f);
        let is_triangle = mesh.next(mesh.next(mesh.next(h))) == h && a != b && b != c && c != a;
        if !is_triangle || mesh.face(h) != Some(f) {
            defects.push(WorkshopDefect::NoTriangle { face: f });
        }
    }
}

fn star(mesh: &HalfedgeMesh, v: VertexId, outgoing: usize, defects: &mut Vec<WorkshopDefect>) {
    let first = mesh.vertex_halfedge(v);
    let rims = mesh.outgoing(v).take(outgoing + 1).filter(|&h| mesh.face(h).is_none()).count();
    let begins_right = mesh.origin(first) == v && (rims == 0 || mesh.face(first).is_none());
    if !begins_right {
        defects.push(WorkshopDefect::WrongVertexHalfedge { vertex: v });
    }
    let mut neighbours: Vec<VertexId> = mesh.outgoing(v).take(outgoing + 1).map(|h| mesh.target(h)).collect();
    let reached = neighbours.len();
    neighbours.sort_unstable();
    neighbours.dedup();
    if reached != outgoing || neighbours.len() != reached || rims > 1 {
        defects.push(WorkshopDefect::NoFan { vertex: v });
    }
}
