//! Long edges halved, on the reference.

use super::work::Work;
use crate::mesh::edit::{check_split, split};
use crate::mesh::{EdgeId, VertexId};

/// Edges longer than so many times the size are halved.
pub(super) const LONG: f64 = 4.0 / 3.0;
/// Most passes over all long edges: each at least halves what is too long.
pub(super) const PASSES: usize = 16;
/// A point on the reference is not worth faces whose shape is below this part of what it would be on the edge.
const SPOILT: f64 = 0.3;

impl Work<'_> {
    /// How many times longer than it may be an edge is.
    fn excess(&self, e: EdgeId) -> f64 {
        let length = self.length(e);
        (length / (LONG * self.size_of(e))).max(length / self.rules.longest)
    }

    /// Halves long edges, longest first, in so many passes with flips in between. Returns how many.
    pub(super) fn split_long(&mut self, passes: usize) -> usize {
        let mut done = 0;
        for _ in 0..passes {
            let mut long: Vec<(f64, EdgeId)> = Vec::new();
            for e in self.mesh.edges().filter(|&e| self.wakes(e)) {
                let excess = self.excess(e);
                if excess > 1.0 {
                    long.push((excess, e));
                }
            }
            long.sort_by(|x, y| y.0.total_cmp(&x.0).then(x.1.cmp(&y.1)));
            let mut made = Vec::new();
            for (_, e) in long {
                if self.mesh.face_count() < self.rules.most_faces && self.excess(e) > 1.0 {
                    made.extend(self.split_edge(e));
                }
            }
            if made.is_empty() {
                break;
            }
            done += made.len();
            self.flip_round(&made);
        }
        self.tally.splits += done;
        done
    }

    /// Halves an edge. Its new vertex lies on the curve or on the surface where that does not spoil the faces.
    pub(super) fn split_edge(&mut self, e: EdgeId) -> Option<VertexId> {
        let plan = check_split(&self.mesh, e).ok()?;
        let [p, q] = plan.ends.map(|v| self.point(v));
        let middle = 0.5 * (p + q);
        let foot = self.project(middle, plan.ends[0]);
        let limit = match (plan.is_curve, self.rules.size.is_uniform()) {
            (false, _) => self.reference.longest[foot.face],
            (true, true) => f64::INFINITY,
            // The foot lies on either of the faces beside the curve.
            (true, false) => plan.ends.map(|v| self.sizing.at(v)).into_iter().fold(0.0, f64::max),
        };
        let v = split(&mut self.mesh, &plan, middle);
        self.found(v, plan.ends, p.distance(q), limit, foot.face);
        if plan.is_curve {
            if let Some(to) = self.reference.curves.project(middle) {
                self.slide_to(v, to, 0.0);
            }
        } else if foot.distance_squared > 0.0 && self.reference.normal(foot.face).dot(self.normal_at(v)) > 0.0 {
            let least = SPOILT * self.least_at(v, middle);
            self.move_to(v, foot.point, foot.face, least);
        }
        Some(v)
    }
}
