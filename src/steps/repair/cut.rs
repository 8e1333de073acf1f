//! Cutting: every vertex gets one copy for each fan of faces that meet there.

use super::adjacency::{EdgeTable, NONE, Twins, corner_of, face_of, halfedge, head, next, previous, tail};
use super::draft::Draft;
use crate::mesh::id::Vertex;
use crate::mesh::{HalfedgeId, IdVec, VertexId, edge_key};

/// What cutting added.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Cut {
    /// Copies of vertices.
    pub(super) copies: u64,
    /// Vertices at which more than one fan met.
    pub(super) vertices: u64,
    /// Edges between two vertices that are joined by another edge as well; they were split in the middle.
    pub(super) split_edges: u64,
}

/// Makes a manifold of consistently oriented faces that are joined by `twins` only.
///
/// The fan of the lowest face keeps the vertex. Where two edges still run between the same two vertices, as in a
/// sheet that touches itself along one edge, all of them get a vertex in the middle.
pub(super) fn cut(draft: &mut Draft, twins: &mut Twins, after_pairing: bool) -> Cut {
    let mut cut = separate_fans(draft, twins);
    if after_pairing {
        cut.split_edges = split_double_edges(draft, twins);
    }
    cut
}

/// One vertex a fan; the copies are numbered in the order of their lowest corners.
fn separate_fans(draft: &mut Draft, twins: &Twins) -> Cut {
    let mut cut = Cut::default();
    let mut claimed: IdVec<Vertex, bool> = IdVec::filled(false, draft.points.len());
    let mut copied: IdVec<Vertex, bool> = IdVec::filled(false, draft.points.len());
    let mut seen = vec![false; twins.len()];
    for start in twins.ids() {
        if seen[start.index()] {
            continue;
        }
        let vertex = tail(&draft.faces, start);
        let is_copy = std::mem::replace(&mut claimed[vertex], true);
        let owner = if is_copy {
            cut.copies += 1;
            cut.vertices += u64::from(!std::mem::replace(&mut copied[vertex], true));
            draft.copy_vertex(vertex)
        } else {
            vertex
        };
        visit_fan(twins, start, |h| {
            seen[h.index()] = true;
            if is_copy {
                draft.faces[face_of(h)][corner_of(h)] = owner;
            }
        });
    }
    cut
}

/// Calls `visit` with every half-edge that leaves the tail of `start` in its fan, without allocating.
fn visit_fan(twins: &Twins, start: HalfedgeId, mut visit: impl FnMut(HalfedgeId)) {
    visit(start);
    let mut here = start;
    while twins[previous(here)] != NONE {
        here = twins[previous(here)];
        if here == start {
            return;
        }
        visit(here);
    }
    here = start;
    while twins[here] != NONE {
        here = next(twins[here]);
        visit(here);
    }
}

/// Splits all edges that share both ends with another edge; returns how many.
fn split_double_edges(draft: &mut Draft, twins: &mut Twins) -> u64 {
    let mut split = 0;
    loop {
        let double = double_edges(draft, twins);
        if double.is_empty() {
            return split;
        }
        // Splitting a face renumbers its other half-edges: edges at such a face wait for the next round.
        let mut touched = vec![false; draft.faces.len()];
        for edges in double {
            let sides = edges.iter().flat_map(|&h| [h, twins[h]]).filter(|&h| h != NONE);
            let faces: Vec<usize> = sides.map(|h| face_of(h).index()).collect();
            // A face that is not in the list is the new half of one that was split.
            if faces.iter().any(|&f| touched.get(f).is_none_or(|&is_touched| is_touched)) {
                continue;
            }
            for f in faces {
                touched[f] = true;
            }
            let [a, b] = [tail(&draft.faces, edges[0]), head(&draft.faces, edges[0])];
            let middle = draft.new_vertex(draft.points[a].midpoint(draft.points[b]), &[a, b]);
            draft.splits.entry(edge_key(draft.root[a], draft.root[b])).or_default().push(middle);
            for (i, h) in edges.into_iter().enumerate() {
                let vertex = if i == 0 { middle } else { draft.copy_vertex(middle) };
                split_edge(draft, twins, h, vertex);
                split += 1;
            }
        }
    }
}

/// Sets of edges with the same two ends, one half-edge each.
fn double_edges(draft: &Draft, twins: &Twins) -> Vec<Vec<HalfedgeId>> {
    let table = EdgeTable::new(&draft.faces, draft.points.len());
    let edges = table.edges().map(|(_, _, group)| {
        group.iter().map(|&(_, h)| h).filter(|&h| twins[h] == NONE || h < twins[h]).collect::<Vec<HalfedgeId>>()
    });
    edges.filter(|edges| edges.len() > 1).collect()
}

/// Puts `vertex` on the edge of `h`; the faces there become two each. `h` still leaves its tail afterwards.
pub(super) fn split_edge(draft: &mut Draft, twins: &mut Twins, h: HalfedgeId, vertex: VertexId) {
    let t = twins[h];
    let front = split_side(draft, twins, h, vertex);
    if t == NONE {
        return;
    }
    let back = split_side(draft, twins, t, vertex);
    // `h` and `t` were cut short at the new vertex: each now meets the far half of the other.
    join(twins, h, back);
    join(twins, t, front);
}

/// Splits one face; returns the half-edge from the new vertex to the old head.
fn split_side(draft: &mut Draft, twins: &mut Twins, h: HalfedgeId, vertex: VertexId) -> HalfedgeId {
    let (face, i) = (face_of(h), corner_of(h));
    let [head, apex] = [draft.faces[face][(i + 1) % 3], draft.faces[face][(i + 2) % 3]];
    let side = twins[next(h)];
    let added = draft.push_face([vertex, head, apex], draft.origin[face]);
    for _ in 0..3 {
        twins.push(NONE);
    }
    draft.faces[face][(i + 1) % 3] = vertex;
    if side != NONE {
        join(twins, halfedge(added, 1), side);
    }
    join(twins, halfedge(added, 2), next(h));
    twins[halfedge(added, 0)] = NONE;
    twins[h] = NONE;
    halfedge(added, 0)
}

/// Makes two half-edges partners.
pub(super) fn join(twins: &mut Twins, a: HalfedgeId, b: HalfedgeId) {
    twins[a] = b;
    twins[b] = a;
}
