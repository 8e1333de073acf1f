//! Edges flipped for better shapes and even valences.

use glam::DVec3;

use super::order::scattered;
use super::smooth::worth;
use super::work::{Care, Corners, Work, stretch};
use crate::mesh::edit::{FlipPlan, check_flip, flip};
use crate::mesh::geometry::area_vector;
use crate::mesh::halfedge::{edge_of, halfedge_of, twin};
use crate::mesh::{EdgeId, FaceId, VertexId};

/// Passes over what lies next to the flips of the pass before.
const PASSES: usize = 12;
/// What a flip must gain, so that equal ones do not go to and fro.
const GAIN: f64 = 1e-3;
/// Faces that differ by less than 5 degrees (the cosine) are flat enough for any diagonal.
const FLAT: f64 = 0.9962;
/// The part of the tolerance that other new diagonals may lie off the reference.
const NEAR: f64 = 0.5;
/// A flip towards even valences may leave this part of the least stretch, and needs not leave more than the second,
/// but never less than the third.
const MAY_LEAVE: [f64; 3] = [0.7, 0.45, 0.2];

/// What a flip is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Aim {
    /// The least stretch of the two faces.
    Shape,
    /// Vertices with six edges.
    Valence,
    /// The shapes of both faces, see [`worth`].
    Worth,
}

impl Work<'_> {
    /// Flips all edges that gain.
    pub(super) fn flip_all(&mut self, aim: Aim) -> usize {
        if aim != Aim::Worth {
            return self.flip_from(self.awake_edges(), aim);
        }
        let mut quiet = std::mem::take(&mut self.quiet_edges);
        let restless = quiet.restless(self.awake_edges(), |e| self.state(&self.near_edge(e)));
        let done = self.flip_from(restless.iter().map(|&(e, _)| e).collect(), aim);
        quiet.remember(&restless, |e| self.state(&self.near_edge(e)));
        self.quiet_edges = quiet;
        done
    }

    /// Flips edges of the faces round these vertices, and what lies next to the flips.
    pub(super) fn flip_round(&mut self, vertices: &[VertexId]) {
        let mut edges: Vec<EdgeId> = Vec::new();
        for &v in vertices {
            for h in self.mesh.outgoing(v) {
                edges.extend([edge_of(h), edge_of(self.mesh.next(h))]);
            }
        }
        edges.sort_unstable();
        edges.dedup();
        self.flip_from(edges, Aim::Shape);
    }

    fn flip_from(&mut self, mut waiting: Vec<EdgeId>, aim: Aim) -> usize {
        let mut done = 0;
        for _ in 0..PASSES {
            let mut near = Vec::new();
            let look = |work: &Self, e| work.plan_flip(e, aim);
            self.in_turn(&scattered(waiting), Self::near_edge, look, |work, e, plan| {
                flip(&mut work.mesh, &plan);
                done += 1;
                let h = halfedge_of(e);
                for k in [h, twin(h)] {
                    near.extend([edge_of(work.mesh.next(k)), edge_of(work.mesh.prev(k))]);
                }
            });
            if near.is_empty() {
                break;
            }
            near.sort_unstable();
            near.dedup();
            waiting = near;
        }
        self.tally.flips += done;
        done
    }

    /// The flip of an edge where it gains.
    fn plan_flip(&self, e: EdgeId, aim: Aim) -> Option<FlipPlan> {
        if !self.mesh.edge_is_live(e) {
            return None;
        }
        let plan = check_flip(&self.mesh, e).ok()?;
        let h = halfedge_of(e);
        let old = [self.mesh.face(h)?, self.mesh.face(twin(h))?];
        if !self.valences_admit(&plan) || (aim == Aim::Valence && !self.evens(&plan)) {
            return None;
        }
        let new = plan.new_faces().map(|corners| corners.map(|v| self.point(v)));
        if !gains(old.map(|f| self.quality(f)), new.map(stretch), aim) || self.turns(old, new) {
            return None;
        }
        let [a, b] = plan.apexes.map(|v| self.point(v));
        let is_near = self.stays_near(&plan, old)
            && (self.care != Care::Samples || self.is_near(&old, &new, plan.apexes[0]))
            && a.distance(b) <= self.rules.longest.max(self.length(e));
        is_near.then_some(plan)
    }

    fn valences_admit(&self, plan: &FlipPlan) -> bool {
        let least = |v: VertexId| if self.mesh.is_boundary_vertex(v) { 2 } else { 3 };
        plan.ends.iter().all(|&v| self.mesh.valence(v) > least(v))
            && plan.apexes.iter().all(|&v| self.mesh.valence(v) < self.most_edges(v))
    }

    /// Whether valences come nearer to six, at a rim to four.
    fn evens(&self, plan: &FlipPlan) -> bool {
        let lack = |v: VertexId, change: i64| {
            let even = if self.mesh.is_boundary_vertex(v) { 4 } else { 6 };
            (self.mesh.valence(v) as i64 + change - even).pow(2)
        };
        let sum = |by: i64| {
            let ends: i64 = plan.ends.iter().map(|&v| lack(v, -by)).sum();
            let apexes: i64 = plan.apexes.iter().map(|&v| lack(v, by)).sum();
            ends + apexes
        };
        sum(1) < sum(0)
    }

    /// Whether a new face turns away from both old ones.
    pub(super) fn turns(&self, old: [FaceId; 2], new: [Corners; 2]) -> bool {
        let sum: DVec3 = old.iter().map(|&f| area_vector(self.mesh.corner_points(f)).normalize_or_zero()).sum();
        new.iter().any(|&corners| {
            let normal = area_vector(corners);
            normal.dot(sum) <= std::f64::consts::FRAC_1_SQRT_2 * normal.length() * sum.length()
        })
    }

    /// Whether the new diagonal stays near the reference, or nearer than the old one.
    pub(super) fn stays_near(&self, plan: &FlipPlan, old: [FaceId; 2]) -> bool {
        let [m, n] = old.map(|f| area_vector(self.mesh.corner_points(f)));
        if m.dot(n) >= FLAT * m.length() * n.length() {
            return true;
        }
        let off = |[a, b]: [VertexId; 2]| self.project(0.5 * (self.point(a) + self.point(b)), a).distance_squared;
        let (after, near) = (off(plan.apexes), NEAR * self.rules.tolerance);
        after <= near * near || after <= off(plan.ends)
    }
}

fn gains(were: [f64; 2], are: [f64; 2], aim: Aim) -> bool {
    let (before, after) = (were[0].min(were[1]), are[0].min(are[1]));
    let sum = |of: [f64; 2]| of.map(worth).into_iter().sum::<f64>();
    let [part, enough, least] = MAY_LEAVE;
    match aim {
        Aim::Shape => after > before + GAIN,
        Aim::Worth => sum(are) > sum(were) + GAIN,
        Aim::Valence => after >= (part * before).min(enough) && after >= least,
    }
}
