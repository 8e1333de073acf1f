//! Edits looked at ahead, on all threads.
//!
//! Passes look at many edges or vertices and change few. What an edit looks at are the stars of some vertices, which
//! have versions: so a part of the list is decided on in parallel, then done one after the other, and what lies next to
//! something done meanwhile is decided on again. The outcome is that of one thread, whatever their number.

use rayon::prelude::*;
use smallvec::SmallVec;

use super::work::Work;
use crate::mesh::halfedge::{halfedge_of, twin};
use crate::mesh::{EdgeId, VertexId};

/// The vertices whose stars are looked at.
pub(super) type Near = SmallVec<[VertexId; 4]>;

/// Those and their versions.
type Stamp = SmallVec<[(VertexId, u32); 4]>;

/// The parts of a list, which are at least so long: more would have less to decide on again, and more to wait for.
const PARTS: usize = 16;
const LEAST: usize = 128;

impl Work<'_> {
    /// What the stars of vertices are like: another number whenever one of them changes.
    pub(super) fn state(&self, near: &[VertexId]) -> u64 {
        near.iter().map(|&v| u64::from(self.mesh.version(v))).sum()
    }

    /// Goes through a list: `look` decides what is to be done from the stars of the vertices `near`, and `act` does it.
    pub(super) fn in_turn<T: Copy + Sync, P: Send>(
        &mut self,
        items: &[T],
        near: impl Fn(&Self, T) -> Near + Sync,
        look: impl Fn(&Self, T) -> Option<P> + Sync,
        mut act: impl FnMut(&mut Self, T, P),
    ) {
        let is_alone = rayon::current_num_threads() == 1 || items.len() < LEAST;
        for part in items.chunks((items.len() / PARTS).max(LEAST)) {
            let ahead = |&item: &T| self.stamp(&near(self, item)).map(|stamp| (stamp, look(self, item)));
            let mut known: Vec<Option<(Stamp, Option<P>)>> =
                if is_alone { Vec::new() } else { part.par_iter().with_min_len(8).map(ahead).collect() };
            for (place, &item) in part.iter().enumerate() {
                let known = known.get_mut(place).and_then(Option::take);
                let plan = match known {
                    Some((stamp, plan)) if self.stamp(&near(self, item)).as_ref() == Some(&stamp) => plan,
                    _ => look(self, item),
                };
                if let Some(plan) = plan {
                    act(self, item, plan);
                }
            }
        }
    }

    /// What tells whether stars have changed. Nothing does on a seam, where other copies count.
    fn stamp(&self, near: &[VertexId]) -> Option<Stamp> {
        near.iter().map(|&v| self.mesh.seam(v).is_none().then(|| (v, self.mesh.version(v)))).collect()
    }

    /// The corners of both faces at an edge; none of one that is gone.
    pub(super) fn near_edge(&self, e: EdgeId) -> Near {
        if !self.mesh.edge_is_live(e) {
            return Near::new();
        }
        let h = halfedge_of(e);
        let apexes = [h, twin(h)].into_iter().filter_map(|side| self.mesh.apex(side));
        self.mesh.ends(e).into_iter().chain(apexes).collect()
    }
}
