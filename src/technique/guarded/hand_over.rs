//! What vertices have gathered in quadrics, taken from part to whole, and from whole to part.

use glam::DVec3;

use super::mesh::GuardedMesh;
use super::quadrics::Gathered;
use crate::mesh::VertexId;

impl GuardedMesh<'_> {
    /// What a vertex has gathered, about the pen's origin.
    pub fn gathered(&self, v: VertexId) -> Gathered {
        Gathered { planes: *self.quadrics.planes(v), lines: self.quadrics.lines(v) }
    }

    /// Goes on with what these vertices had gathered elsewhere, about `origin`; others begin with their faces.
    pub fn take_over(&mut self, origin: DVec3, known: impl Iterator<Item = (VertexId, Gathered)>) {
        if self.quadrics.origin != origin {
            self.quadrics.begin(&self.mesh, origin);
        }
        for (v, gathered) in known {
            self.quadrics.set(v, gathered);
        }
    }
}
