//! Face collapse: the three corners of a face become one vertex, in one transaction.
//!
//! It is the collapse of one side and then of the edge that the two others became; both must be admitted before the
//! first is done. Topology: the link conditions of both, the second one on the mesh as the first leaves it, read off
//! the stars as they are. Only inner faces with at most one corner that is not free: others are left to edge collapse.
//! Invariants and freedom as in [`mod@super::collapse`]. Cost: O(valence).

use super::collapse::{CollapsePlan, Placement, Ring, check_collapse, collapse};
use super::{EdgeId, Refusal};
use crate::mesh::carried::Freedom;
use crate::mesh::halfedge::{HalfedgeMesh, edge_of, twin};
use crate::mesh::id::{FaceId, HalfedgeId, VertexId};
use glam::DVec3;
use smallvec::SmallVec;

/// A face collapse that topology and freedom admit. Valid until the stars of its corners change.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MergeFacePlan {
    /// The face.
    pub face: FaceId,
    /// Its corners; the last one stays.
    pub corners: [VertexId; 3],
    /// The collapse of the edge between the first two.
    pub first: CollapsePlan,
    /// Where the merged vertex may lie.
    pub placement: Placement,
}

/// Whether the face may collapse, and how.
///
/// # Errors
/// The first reason against it.
pub fn check_merge_face(mesh: &HalfedgeMesh, face: FaceId) -> Result<MergeFacePlan, Refusal> {
    let start = mesh.face_halfedge(face);
    let sides = [start, mesh.next(start), mesh.prev(start)];
    // The strictest corner is opposite the side that goes first; of equals the lowest.
    let rank = |h: &HalfedgeId| {
        let v = mesh.origin(mesh.prev(*h));
        (mesh.vertex_freedom(v), std::cmp::Reverse(v))
    };
    let [a, b, c] = sides;
    let h = [a, b, c].into_iter().max_by_key(|h| rank(h)).unwrap_or(a);
    let corners = [mesh.origin(h), mesh.target(h), mesh.origin(mesh.prev(h))];
    for v in corners {
        if mesh.is_boundary_vertex(v) {
            return Err(Refusal::Boundary);
        }
    }
    for v in [corners[0], corners[1]] {
        if mesh.vertex_freedom(v) != Freedom::Free || has_mark(mesh, v) {
            return Err(Refusal::Freedom { vertex: v });
        }
    }
    check_links(mesh, h, corners)?;
    check_groups(mesh, &sides, corners)?;
    let first = check_collapse(mesh, edge_of(h))?;
    let placement = match mesh.vertex_freedom(corners[2]) {
        Freedom::Free => Placement::Anywhere,
        Freedom::OnCurve | Freedom::Keep => Placement::Fixed(mesh.point(corners[2])),
    };
    Ok(MergeFacePlan { face, corners, first, placement })
}

fn has_mark(mesh: &HalfedgeMesh, v: VertexId) -> bool {
    mesh.outgoing(v).any(|h| mesh.edge_mark(edge_of(h)).is_some())
}

/// The second link condition, before the first collapse: `(N(i) ∪ N(j)) ∩ N(k)` are the two apexes beyond `jk` and
/// `ki`.
fn check_links(mesh: &HalfedgeMesh, h: HalfedgeId, corners: [VertexId; 3]) -> Result<(), Refusal> {
    let beyond = |side: HalfedgeId| mesh.apex(twin(side));
    let [third, second, first] = [beyond(h), beyond(mesh.next(h)), beyond(mesh.prev(h))];
    let (Some(first), Some(second), Some(third)) = (first, second, third) else { return Err(Refusal::Boundary) };
    let apexes = [first, second, third];
    if first == second || second == third || third == first {
        return Err(Refusal::LinkCondition { common: first });
    }
    // Each apex loses one edge and must keep three; the three corners lose their common ones.
    if apexes.iter().any(|&v| mesh.outgoing(v).nth(if mesh.is_boundary_vertex(v) { 2 } else { 3 }).is_none()) {
        return Err(Refusal::FourFaces);
    }
    let round: Ring = mesh.neighbours(corners[2]).collect();
    for v in [corners[0], corners[1]] {
        for common in mesh.neighbours(v) {
            if round.contains(&common) && !corners.contains(&common) && common != first && common != second {
                return Err(Refusal::LinkCondition { common });
            }
        }
    }
    Ok(())
}

/// No group or region may lose its last element.
fn check_groups(mesh: &HalfedgeMesh, sides: &[HalfedgeId; 3], corners: [VertexId; 3]) -> Result<(), Refusal> {
    let own = mesh.face(sides[0]);
    let beyond = sides.iter().filter_map(|&side| mesh.face(twin(side)));
    let faces: SmallVec<[u32; 4]> = own.into_iter().chain(beyond).map(|f| mesh.face_class[f]).collect();
    let edges = sides.map(|side| mesh.edge_class[edge_of(side)]);
    let vertices = [corners[0], corners[1]].map(|v| mesh.vertex_class[v]);
    let vanishes = mesh.face_classes.vanishing(&faces).is_some()
        || mesh.edge_classes.vanishing(&edges).is_some()
        || mesh.vertex_classes.vanishing(&vertices).is_some();
    if vanishes { Err(Refusal::GroupVanishes) } else { Ok(()) }
}

impl MergeFacePlan {
    /// The faces that vanish: the face itself and its three neighbours.
    pub fn removed_faces(&self, mesh: &HalfedgeMesh) -> SmallVec<[FaceId; 4]> {
        let h = mesh.face_halfedge(self.face);
        let sides = [h, mesh.next(h), mesh.prev(h)];
        std::iter::once(self.face).chain(sides.into_iter().filter_map(|side| mesh.face(twin(side)))).collect()
    }

    /// The faces that stay, each with its corners from the merged vertex on.
    pub fn new_star<'a>(&'a self, mesh: &'a HalfedgeMesh) -> impl Iterator<Item = (FaceId, [VertexId; 3])> + 'a {
        let removed = self.removed_faces(mesh);
        self.corners.into_iter().flat_map(move |v| {
            let removed = removed.clone();
            mesh.outgoing(v).filter_map(move |out| {
                let face = mesh.face(out)?;
                let next = mesh.next(out);
                let star = [self.corners[2], mesh.origin(next), mesh.target(next)];
                (!removed.contains(&face)).then_some((face, star))
            })
        })
    }

    /// The valence of the merged vertex.
    pub fn new_valence(&self, mesh: &HalfedgeMesh) -> usize {
        // Each corner brings its edges but two; each apex beyond a side is counted twice.
        self.corners.iter().map(|&v| mesh.valence(v) - 2).sum::<usize>() - 3
    }
}

/// Collapses as planned, into the admitted position nearest to `wish`. Returns the two collapses as they were done.
pub fn merge_face(mesh: &mut HalfedgeMesh, plan: &MergeFacePlan, wish: DVec3) -> Result<(), Refusal> {
    let wish = plan.placement.nearest(wish);
    let [i, j, k] = plan.corners;
    debug_assert_eq!(check_merge_face(mesh, plan.face).as_ref(), Ok(plan), "the plan is out of date");
    collapse(mesh, &plan.first, wish);
    let merged = if plan.first.removed == i { j } else { i };
    let edge: EdgeId = edge_of(mesh.find_halfedge(merged, k).ok_or(Refusal::LinkCondition { common: k })?);
    let second = check_collapse(mesh, edge)?;
    collapse(mesh, &second, wish);
    Ok(())
}
