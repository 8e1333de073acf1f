//! Relocation of a vertex: a free one anywhere, one on a curve along it.

use glam::DVec3;

use super::gain::Gain;
use super::keeper::Keeper;
use super::mesh::GuardedMesh;
use super::refused::Refused;
use crate::mesh::edit::{relocate, slide};
use crate::mesh::{Freedom, VertexId};

impl GuardedMesh<'_> {
    /// Moves a vertex, on a curve along it, where all tests admit it and it gains.
    ///
    /// # Errors
    /// The first test that refuses it; nothing is done then.
    pub fn relocate(&mut self, v: VertexId, to: DVec3, gain: Gain) -> Result<(), Refused> {
        match self.mesh.vertex_freedom(v) {
            Freedom::Keep => return Err(Refused::Features),
            Freedom::OnCurve if !self.may_slide(v, to) => return Err(Refused::Curves),
            Freedom::Free if !self.quadrics_admit(v, to) => return Err(Refused::Tolerance),
            Freedom::Free | Freedom::OnCurve => {}
        }
        if !to.is_finite() {
            return Err(Refused::Shape);
        }
        self.patch.clear();
        for f in self.mesh.faces_around(v) {
            let corners = self.mesh.corners(f);
            self.patch.change(f, corners.map(|w| if w == v { to } else { self.mesh.point(w) }));
        }
        let before = self.tally(&self.patch.old, gain);
        self.gains(&before, gain)?;
        if self.folds() {
            return Err(Refused::FoldOver);
        }
        self.admit_patch()?;
        match self.mesh.vertex_freedom(v) {
            Freedom::OnCurve => slide(&mut self.mesh, v, to),
            Freedom::Free | Freedom::Keep => relocate(&mut self.mesh, v, to),
        }?;
        self.counts.moves += 1;
        self.settle();
        Ok(())
    }

    /// Whether the curve through the vertex stays near the reference's curves when it goes to `to`.
    fn may_slide(&self, v: VertexId, to: DVec3) -> bool {
        let Keeper::Distance { curves, .. } = &self.keeper else { return false };
        self.curve_neighbours(v).is_some_and(|ends| ends.iter().all(|&w| curves.admit([to, self.mesh.point(w)])))
    }
}
