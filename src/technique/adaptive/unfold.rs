//! Folds undone: faces that look another way than the reference below them.
//!
//! Edits are tested against the faces that they replace. Where those have turned over already, as they do where a small
//! thing was meshed too coarsely, that test keeps the fold. Here faces are held against the reference itself, and a
//! vertex moves or vanishes where that leaves fewer turned ones.

use glam::DVec3;
use smallvec::SmallVec;

use super::smooth::Place;
use super::work::{Corners, Faces, Work, stretch};
use crate::mesh::edit::{CollapsePlan, check_collapse};
use crate::mesh::geometry::{area_vector, centroid};
use crate::mesh::halfedge::edge_of;
use crate::mesh::{FaceId, Freedom, VertexId};

/// A face has turned whose normal and that of the reference below its middle have no larger cosine.
const TURNED: f64 = 0.1;
/// Edits leave no face below this stretch.
const SPOILT: f64 = 0.02;
/// Passes over the surroundings of what was found.
const PASSES: usize = 4;

/// What is done about a vertex of a turned face.
enum Cure {
    Move { at: DVec3, foot: FaceId },
    Collapse { plan: CollapsePlan, end: VertexId },
}

impl Work<'_> {
    /// Undoes folds round these vertices as far as single edits can.
    pub(super) fn unfold(&mut self, found: impl Iterator<Item = VertexId>) {
        let mut vertices: Vec<VertexId> = found.filter(|&v| self.mesh.vertex_is_live(v)).collect();
        vertices.extend(vertices.clone().into_iter().flat_map(|v| self.mesh.neighbours(v).collect::<Vec<_>>()));
        vertices.sort_unstable();
        vertices.dedup();
        for _ in 0..PASSES {
            let mut done = 0;
            for &v in &vertices {
                if !self.mesh.vertex_is_live(v) || self.mesh.vertex_freedom(v) == Freedom::Keep {
                    continue;
                }
                if let Some(cure) = self.cure(v) {
                    done += 1;
                    self.apply(v, cure);
                }
            }
            if done == 0 {
                break;
            }
        }
    }

    fn apply(&mut self, v: VertexId, cure: Cure) {
        match cure {
            Cure::Move { at, foot } => {
                self.go_to(v, Place { at, foot });
                self.wake(v);
            }
            Cure::Collapse { plan, end } => {
                self.collapse_to(&plan, end);
                self.tally.collapses += 1;
            }
        }
    }

    /// The edit at a vertex that leaves the fewest turned faces, if fewer than there are.
    fn cure(&self, v: VertexId) -> Option<Cure> {
        let around: Faces = self.mesh.faces_around(v).collect();
        let before = around.iter().filter(|&&f| self.has_turned(self.mesh.corner_points(f), v)).count();
        if before == 0 {
            return None;
        }
        let mut best: Option<(i64, f64, Cure)> = None;
        let mut offer = |gain: i64, least: f64, cure: Cure| {
            let is_better = best.as_ref().is_none_or(|&(most, shape, _)| (gain, least) > (most, shape));
            if gain > 0 && least > SPOILT && is_better {
                best = Some((gain, least, cure));
            }
        };
        if self.mesh.vertex_freedom(v) == Freedom::Free && !self.mesh.is_boundary_vertex(v) {
            let foot = self.project(self.point(v), v);
            let new: SmallVec<[Corners; 16]> = around.iter().map(|&f| self.moved(f, v, foot.point)).collect();
            let (turned, least) = self.judge(&new, v);
            offer(before as i64 - turned, least, Cure::Move { at: foot.point, foot: foot.face });
        }
        for h in self.mesh.outgoing(v) {
            let Ok(plan) = check_collapse(&self.mesh, edge_of(h)) else { continue };
            let end = self.mesh.target(h);
            if let Some((gain, least)) = self.gain_of_collapse(&plan, end) {
                offer(gain, least, Cure::Collapse { plan, end });
            }
        }
        best.map(|(_, _, cure)| cure)
    }

    /// How many turned faces fewer there are after a collapse to one of its ends, and the least stretch then.
    fn gain_of_collapse(&self, plan: &CollapsePlan, end: VertexId) -> Option<(i64, f64)> {
        let at = self.point(end);
        let may = !self.pinned[plan.kept.index()] && !self.pinned[plan.removed.index()];
        if !may || plan.placement.nearest(at) != at || !self.curve_admits(plan, at) {
            return None;
        }
        let mut old: Faces = plan.removed_faces(&self.mesh).into_iter().flatten().collect();
        let mut new: SmallVec<[Corners; 16]> = SmallVec::new();
        for (f, corners) in plan.new_star(&self.mesh) {
            old.push(f);
            new.push(corners.map(|v| if v == plan.kept { at } else { self.point(v) }));
        }
        let was: SmallVec<[Corners; 16]> = old.iter().map(|&f| self.mesh.corner_points(f)).collect();
        let (turned, least) = self.judge(&new, plan.kept);
        Some((self.judge(&was, plan.kept).0 - turned, least))
    }

    /// How many faces have turned, and the least stretch.
    fn judge(&self, faces: &[Corners], beside: VertexId) -> (i64, f64) {
        let turned = faces.iter().filter(|&&face| self.has_turned(face, beside)).count();
        (turned as i64, faces.iter().map(|&face| stretch(face)).fold(1.0, f64::min))
    }

    fn has_turned(&self, face: Corners, beside: VertexId) -> bool {
        let vector = area_vector(face);
        let below = self.reference.normal(self.project(centroid(face), beside).face);
        vector.dot(below) <= TURNED * vector.length()
    }
}
