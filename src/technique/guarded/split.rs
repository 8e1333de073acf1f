//! Split of an edge: a new vertex halves it and its faces.

use glam::DVec3;
use smallvec::SmallVec;

use super::limits::least_stretch;
use super::mesh::GuardedMesh;
use super::normals::LEAST_TURN_COSINE;
use super::refused::Refused;
use crate::mesh::edit::{Placement, SplitPlan, check_split, split};
use crate::mesh::geometry::{area_vector, closest_on_segment, stretch};
use crate::mesh::halfedge::{edge_of, halfedge_of, twin};
use crate::mesh::{EdgeId, FaceId, Freedom, VertexId};

/// What a split may leave of a stretch that is below the threshold already.
const SPLIT_LOSS: f64 = 0.25;

impl GuardedMesh<'_> {
    /// Splits the edge at `at`, on a curve at its nearest point, where all tests admit it and no face falls below the
    /// least stretch. Where one is there already, the halves may be a little worse, since more can be done with them;
    /// not beside kept edges, where nothing can, and the losses of single splits multiply. A tied edge is split with
    /// all that it is tied to. Gives the new vertex.
    ///
    /// # Errors
    /// The first test that refuses it; nothing is done then.
    pub fn split(&mut self, edge: EdgeId, at: DVec3) -> Result<VertexId, Refused> {
        if let Some(group) = self.ties.of(self.mesh.ends(edge)) {
            return self.split_tied(group, edge, at);
        }
        let plan = check_split(&self.mesh, edge)?;
        let [p, q] = plan.ends.map(|v| self.mesh.point(v));
        let at = if plan.is_curve { Placement::Segment(p, q).nearest(at) } else { at };
        self.fill_split(&[(plan, at)])?;
        self.admit_split()?;
        let v = split(&mut self.mesh, &plan, at);
        self.follow_split(&[v]);
        Ok(v)
    }

    /// Puts the halves of the faces at the edges into the patch.
    pub(super) fn fill_split(&mut self, plans: &[(SplitPlan, DVec3)]) -> Result<(), Refused> {
        self.patch.clear();
        let first_new = self.mesh.face_slots();
        let mut later: SmallVec<[(FaceId, [DVec3; 3]); 4]> = SmallVec::new();
        let mut is_same = true;
        for &(plan, at) in plans {
            let [p, q] = plan.ends.map(|v| self.mesh.point(v));
            is_same &= closest_on_segment(at, [p, q]).distance_squared <= 1e-24 * p.distance_squared(q);
            let h = halfedge_of(plan.edge);
            for side in [h, twin(h)] {
                let (Some(face), Some(apex)) = (self.mesh.face(side), self.mesh.apex(side)) else { continue };
                if self.mesh.valence(apex) >= self.most_edges(apex) {
                    return Err(Refused::Valence);
                }
                if self.patch.old.contains(&face) {
                    return Err(Refused::Topology);
                }
                let ends = [self.mesh.origin(side), self.mesh.target(side)];
                let mut near = [ends[0], ends[1], apex].map(|v| self.mesh.point(v));
                let mut far = near;
                near[1] = at;
                far[0] = at;
                // The half at the first end keeps the face's number.
                let (kept, new) = if ends[0] == plan.ends[0] { (near, far) } else { (far, near) };
                self.patch.change(face, kept);
                later.push((FaceId::new(first_new + later.len()), new));
            }
        }
        for (id, points) in later {
            self.patch.succeed(id, points);
        }
        self.patch.is_same = is_same;
        Ok(())
    }

    /// All tests of a split that fills the patch.
    pub(super) fn admit_split(&mut self) -> Result<(), Refused> {
        if !self.split_keeps_stretch() {
            return Err(Refused::Shape);
        }
        if self.split_folds() {
            return Err(Refused::FoldOver);
        }
        self.admit_patch()
    }

    /// What follows a split that was done.
    pub(super) fn follow_split(&mut self, made: &[VertexId]) {
        for &v in made {
            self.quadrics.found(&self.mesh, v);
        }
        self.counts.splits += made.len();
        self.settle();
    }

    /// Whether an edge of the face must stay as it is, so that nothing can be mended there.
    fn is_beside_kept(&self, face: FaceId) -> bool {
        let first = self.mesh.face_halfedge(face);
        let sides = [first, self.mesh.next(first), self.mesh.prev(first)];
        sides.iter().any(|&side| self.mesh.edge_freedom(edge_of(side)) == Freedom::Keep)
    }

    fn split_keeps_stretch(&self) -> bool {
        let before = self.patch.old.iter().map(|&f| self.stretch(f)).fold(f64::INFINITY, f64::min);
        let limit = self.limits.min_stretch;
        let floor = least_stretch(limit, before);
        let may_lose = floor < limit && !self.patch.old.iter().any(|&face| self.is_beside_kept(face));
        let floor = if may_lose { SPLIT_LOSS * floor } else { floor };
        self.patch.points.iter().all(|points| stretch(*points) >= floor)
    }

    fn split_folds(&self) -> bool {
        let patch = &self.patch;
        let count = patch.old.len();
        patch.points.iter().enumerate().any(|(at, points)| {
            let old = area_vector(self.mesh.corner_points(patch.old[at % count]));
            let new = area_vector(*points);
            let scale = (old.length_squared() * new.length_squared()).sqrt();
            old.length_squared() > 0.0 && new.dot(old) < LEAST_TURN_COSINE * scale
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::keeper::Keeper;
    use super::super::limits::{Limits, SizeField};
    use super::*;
    use crate::mesh::halfedge::tests::{enter, surface};

    /// Two faces over an edge, and a third one so near that a new corner beside the edge would lie past it.
    fn split_under(ceiling: [[f64; 3]; 3]) -> Result<VertexId, Refused> {
        let low = [[0.0; 3], [1.0, 0.0, 0.0], [0.5, 1.0, 0.0], [0.5, -1.0, 0.0]];
        let mesh = enter(&surface(&[&low[..], &ceiling].concat(), &[[0, 1, 2], [1, 0, 3], [4, 5, 6]]));
        let shared = mesh.edges().find(|&e| !mesh.is_boundary_edge(e)).expect("the two faces share an edge");
        let limits = Limits { min_stretch: 0.0, max_size: SizeField::Uniform(f64::INFINITY), max_valence: 9 };
        let mut guarded = GuardedMesh::new(mesh, Keeper::QuadricRms { most: 1.0 }, limits, 1.0, None);
        guarded.split(shared, DVec3::new(0.5, 0.0, 1e-13))
    }

    #[test]
    fn a_rounded_corner_does_not_pierce_the_other_side() {
        let above = |z: f64| [[0.4, -0.1, z], [2.0, -0.1, z], [0.5, 0.2, z]];
        assert_eq!(split_under(above(1e-14)), Err(Refused::Intersection));
        assert!(split_under(above(1e-12)).is_ok(), "out of reach");
        let through = [[0.4, 0.1, -1.0], [0.6, 0.1, -1.0], [0.5, 0.1, 1.0]];
        assert!(split_under(through).is_ok(), "the faces met before");
    }
}
