//! Vertices with too many edges relieved of some.
//!
//! A fan of many faces, as in the bottom of a small hole, cannot lose edges by flips alone where the vertices about it
//! have to stay. So a spoke is halved, and the middle takes over spokes beside it.

use super::work::{Work, stretch};
use crate::mesh::edit::{FlipPlan, check_flip, flip};
use crate::mesh::halfedge::{edge_of, twin};
use crate::mesh::{EdgeId, FaceId, Freedom, HalfedgeId, VertexId};

/// Spokes that are tried at each vertex.
const SPOKES: usize = 6;
/// New faces reach this part more than the least stretch asked for, or what was there.
const BETTER: f64 = 1.25;

impl Work<'_> {
    /// Brings vertices with more edges than allowed down to that where it can be done with good faces.
    pub(super) fn relieve(&mut self) {
        let above = |work: &Self, v: VertexId| work.mesh.valence(v) > work.most_edges(v);
        let full: Vec<VertexId> = self.mesh.vertices().filter(|&v| above(self, v)).collect();
        for v in full {
            for _ in 0..SPOKES {
                if !above(self, v) {
                    break;
                }
                let Some(middle) = self.longest_spoke_of(v).and_then(|e| self.split_edge(e)) else { break };
                self.tally.splits += 1;
                while above(self, v) && self.take_over(v, middle) {}
            }
        }
    }

    /// The longest edge at a vertex that no curve runs along and that may be halved.
    fn longest_spoke_of(&self, v: VertexId) -> Option<EdgeId> {
        let spokes = self.mesh.outgoing(v).map(edge_of).filter(|&e| self.mesh.edge_freedom(e) == Freedom::Free);
        spokes.max_by(|&x, &y| self.length(x).total_cmp(&self.length(y)).then(y.cmp(&x)))
    }

    /// Turns the better of the spokes beside that to `middle` into an edge of `middle`; whether it could be done.
    fn take_over(&mut self, v: VertexId, middle: VertexId) -> bool {
        let Some(h) = self.mesh.find_halfedge(v, middle) else { return false };
        let beside = [self.mesh.prev(h), self.mesh.next(twin(h))];
        let best =
            beside.into_iter().filter_map(|spoke| self.worth_of_turning(spoke)).max_by(|x, y| x.0.total_cmp(&y.0));
        let Some((_, plan)) = best else { return false };
        flip(&mut self.mesh, &plan);
        self.tally.flips += 1;
        self.wake(middle);
        true
    }

    /// The least stretch of the two faces after a flip, where that does.
    fn worth_of_turning(&self, spoke: HalfedgeId) -> Option<(f64, FlipPlan)> {
        let old: [FaceId; 2] = [self.mesh.face(spoke)?, self.mesh.face(twin(spoke))?];
        let plan = check_flip(&self.mesh, edge_of(spoke)).ok()?;
        let room = plan.apexes.iter().all(|&w| self.mesh.valence(w) < self.most_edges(w));
        let new = plan.new_faces().map(|corners| corners.map(|w| self.point(w)));
        let least = new.map(stretch).into_iter().fold(1.0, f64::min);
        let before = old.map(|f| self.quality(f)).into_iter().fold(1.0, f64::min);
        let is_good = least >= (BETTER * self.rules.min_stretch).min(before);
        (room && is_good && !self.turns(old, new) && self.stays_near(&plan, old)).then_some((least, plan))
    }
}
