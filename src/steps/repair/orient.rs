//! Consistent orientation: neighbours agree, and the larger part of each component keeps the direction it came with.

use super::adjacency::{NONE, Twins, corner_of, face_of, halfedge, tail};
use super::draft::{Draft, normal};
use crate::mesh::id::Face;
use crate::mesh::{FaceId, HalfedgeId, IdVec};

/// The result of the walk over the faces.
pub(super) struct Oriented {
    /// Faces that were turned round.
    pub(super) flipped: u64,
    /// Edges whose faces cannot agree; the surface is cut there.
    pub(super) conflicts: Vec<HalfedgeId>,
    /// The component of each face, numbered by lowest face.
    pub(super) component: IdVec<Face, u32>,
}

/// Turns faces round until neighbours agree, and separates those that cannot (as in a Möbius strip).
///
/// The walk goes breadth first from the lowest face of each component, neighbours in the order of their numbers, so
/// that the place of a cut depends on the faces' order only.
pub(super) fn orient(draft: &mut Draft, twins: &mut Twins) -> Oriented {
    let (component, mut turned, order) = walk(draft, twins);
    keep_majority(draft, &component, &mut turned, &order);
    let mut conflicts = Vec::new();
    for h in twins.ids() {
        let t = twins[h];
        if t != NONE && h < t && is_conflict(draft, h, t) != (turned[face_of(h)] != turned[face_of(t)]) {
            conflicts.push(h);
        }
    }
    for &h in &conflicts {
        let t = twins[h];
        twins[h] = NONE;
        twins[t] = NONE;
    }
    let flipped = turned.iter().filter(|&&t| t).count() as u64;
    if flipped > 0 {
        turn(draft, twins, &turned);
    }
    let conflicts = conflicts.into_iter().map(|h| if turned[face_of(h)] { mirror(h) } else { h }).collect();
    Oriented { flipped, conflicts, component }
}

/// Whether two faces run along their common edge in the same direction.
fn is_conflict(draft: &Draft, h: HalfedgeId, t: HalfedgeId) -> bool {
    tail(&draft.faces, h) == tail(&draft.faces, t)
}

/// The component of each face, whether it looks the other way than the component's first face, and the faces in the
/// order of the walk.
fn walk(draft: &Draft, twins: &Twins) -> (IdVec<Face, u32>, IdVec<Face, bool>, Vec<FaceId>) {
    const UNSEEN: u32 = u32::MAX;
    let mut component = IdVec::filled(UNSEEN, draft.faces.len());
    let mut turned = IdVec::filled(false, draft.faces.len());
    let mut order = Vec::with_capacity(draft.faces.len());
    let mut components = 0;
    for start in draft.faces.ids() {
        if component[start] != UNSEEN {
            continue;
        }
        let mut done = order.len();
        component[start] = components;
        order.push(start);
        while done < order.len() {
            let face = order[done];
            done += 1;
            let mut around = [0, 1, 2].map(|i| {
                let h = halfedge(face, i);
                (if twins[h] == NONE { FaceId::from_raw(u32::MAX) } else { face_of(twins[h]) }, h)
            });
            around.sort_unstable();
            for (neighbour, h) in around {
                if twins[h] != NONE && component[neighbour] == UNSEEN {
                    component[neighbour] = components;
                    turned[neighbour] = turned[face] != is_conflict(draft, h, twins[h]);
                    order.push(neighbour);
                }
            }
        }
        components += 1;
    }
    (component, turned, order)
}

/// Turns the smaller part, by area, of each component; of equal parts the one without the first face.
fn keep_majority(draft: &Draft, component: &IdVec<Face, u32>, turned: &mut IdVec<Face, bool>, order: &[FaceId]) {
    for part in order.chunk_by(|&a, &b| component[a] == component[b]) {
        if part.iter().all(|&f| !turned[f]) {
            continue;
        }
        let balance: f64 =
            part.iter().map(|&f| normal(draft.corners(f)).length() * if turned[f] { -1.0 } else { 1.0 }).sum();
        if balance < 0.0 {
            for &f in part {
                turned[f] = !turned[f];
            }
        }
    }
}

/// Turns every chosen face round its first corner; twins follow.
pub(super) fn turn(draft: &mut Draft, twins: &mut Twins, chosen: &IdVec<Face, bool>) {
    for (face, corners) in draft.faces.ids().zip(draft.faces.iter_mut()) {
        if chosen[face] {
            corners.swap(1, 2);
        }
    }
    let renamed = |h: HalfedgeId| if h != NONE && chosen[face_of(h)] { mirror(h) } else { h };
    let old = twins.clone();
    for h in old.ids() {
        twins[renamed(h)] = renamed(old[h]);
    }
}

/// The number of a half-edge after its face was turned round its first corner.
fn mirror(h: HalfedgeId) -> HalfedgeId {
    halfedge(face_of(h), 2 - corner_of(h))
}
