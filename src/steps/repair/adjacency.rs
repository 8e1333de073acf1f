//! Which faces meet at which edge, for any triangles, manifold or not.

use crate::mesh::id::{Face, Halfedge};
use crate::mesh::{FaceId, HalfedgeId, IdVec, VertexId};

/// Marks a half-edge without a partner.
pub(super) const NONE: HalfedgeId = HalfedgeId::from_raw(u32::MAX);

/// The partner of each half-edge, or [`NONE`]. Half-edge `3 f + i` runs from corner `i` of face `f` to the next one.
pub(super) type Twins = IdVec<Halfedge, HalfedgeId>;

/// The half-edge that leaves corner `corner` of `face`.
#[inline]
pub(super) fn halfedge(face: FaceId, corner: usize) -> HalfedgeId {
    HalfedgeId::new(3 * face.index() + corner)
}

/// The face of a half-edge.
#[inline]
pub(super) fn face_of(h: HalfedgeId) -> FaceId {
    FaceId::from_raw(h.raw() / 3)
}

/// The corner that a half-edge leaves.
#[inline]
pub(super) fn corner_of(h: HalfedgeId) -> usize {
    (h.raw() % 3) as usize
}

/// The next half-edge of the same face.
#[inline]
pub(super) fn next(h: HalfedgeId) -> HalfedgeId {
    HalfedgeId::from_raw(if h.raw() % 3 == 2 { h.raw() - 2 } else { h.raw() + 1 })
}

/// The previous half-edge of the same face.
#[inline]
pub(super) fn previous(h: HalfedgeId) -> HalfedgeId {
    HalfedgeId::from_raw(if h.raw().is_multiple_of(3) { h.raw() + 2 } else { h.raw() - 1 })
}

/// The vertex that a half-edge leaves.
#[inline]
pub(super) fn tail(faces: &IdVec<Face, [VertexId; 3]>, h: HalfedgeId) -> VertexId {
    faces[face_of(h)][corner_of(h)]
}

/// The vertex that a half-edge enters.
#[inline]
pub(super) fn head(faces: &IdVec<Face, [VertexId; 3]>, h: HalfedgeId) -> VertexId {
    tail(faces, next(h))
}

/// The corner of the face that is not on this half-edge.
#[inline]
pub(super) fn apex(faces: &IdVec<Face, [VertexId; 3]>, h: HalfedgeId) -> VertexId {
    tail(faces, previous(h))
}

/// All half-edges sorted by edge: a bucket for each smaller end, in which the larger ends ascend.
pub(super) struct EdgeTable {
    offsets: Vec<u32>,
    entries: Vec<(VertexId, HalfedgeId)>,
}

impl EdgeTable {
    /// The table of these faces; no face may repeat a corner.
    pub(super) fn new(faces: &IdVec<Face, [VertexId; 3]>, vertices: usize) -> Self {
        let mut offsets = vec![0_u32; vertices + 1];
        for corners in faces {
            for i in 0..3 {
                offsets[corners[i].min(corners[(i + 1) % 3]).index() + 1] += 1;
            }
        }
        for i in 0..vertices {
            offsets[i + 1] += offsets[i];
        }
        let mut cursor = offsets.clone();
        let mut entries = vec![(VertexId::from_raw(0), NONE); 3 * faces.len()];
        for (id, corners) in faces.enumerate() {
            for i in 0..3 {
                let (a, b) = (corners[i], corners[(i + 1) % 3]);
                let place = &mut cursor[a.min(b).index()];
                entries[*place as usize] = (a.max(b), halfedge(id, i));
                *place += 1;
            }
        }
        for window in offsets.windows(2) {
            entries[window[0] as usize..window[1] as usize].sort_unstable();
        }
        Self { offsets, entries }
    }

    /// Each edge once, in ascending order: its ends and its half-edges in face order.
    pub(super) fn edges(&self) -> impl Iterator<Item = (VertexId, VertexId, &[(VertexId, HalfedgeId)])> {
        self.offsets.windows(2).enumerate().flat_map(|(v, window)| {
            self.entries[window[0] as usize..window[1] as usize]
                .chunk_by(|a, b| a.0 == b.0)
                .map(move |group| (VertexId::new(v), group[0].0, group))
        })
    }

    /// Twins across all edges with exactly two faces; other half-edges stay alone.
    pub(super) fn twins(&self) -> Twins {
        let mut twins = IdVec::filled(NONE, self.entries.len());
        for (_, _, group) in self.edges() {
            if let [(_, a), (_, b)] = *group {
                twins[a] = b;
                twins[b] = a;
            }
        }
        twins
    }
}
/// The half-edges that leave the tail of `start`, in order round the vertex, and whether they close to a full ring.
///
/// In an open fan the first half-edge is the one without a twin.
pub(super) fn fan(twins: &Twins, start: HalfedgeId) -> (Vec<HalfedgeId>, bool) {
    let mut first = start;
    // Turn to the border: from the edge that leaves to the edge that leaves in the face across it.
    loop {
        let across = twins[first];
        if across == NONE {
            break;
        }
        first = next(across);
        if first == start {
            break;
        }
    }
    let closed = twins[first] != NONE;
    let mut ring = vec![first];
    let mut here = first;
    loop {
        let across = twins[previous(here)];
        if across == NONE || across == first {
            return (ring, closed);
        }
        ring.push(across);
        here = across;
    }
}
