//! A part of a larger mesh under guard: what of it may change, so that parts changed at the same time fit together.
//!
//! Faces that are not fixed lie in a box, and the boxes of several parts have no common point. Boxes are convex: what
//! edits put into one of them meets nothing that they put into another. Fixed faces are seen by the tests of every
//! part whose box they reach into.

use glam::DVec3;

use super::patch::Patch;
use crate::mesh::FaceId;
use crate::mesh::geometry::Aabb;

/// What of a part may change.
#[derive(Clone, Debug)]
pub struct Pen {
    /// Faces that may change lie in here, and go on to.
    pub bounds: Aabb,
    /// Whether each face stays as it is.
    pub fixed: Vec<bool>,
    /// What the quadrics of all parts are about.
    pub origin: DVec3,
}

impl Pen {
    /// Whether an edit would change what is fixed, or put faces outside.
    pub(super) fn bars(&self, patch: &Patch) -> bool {
        patch.old.iter().any(|&f| self.is_fixed(f)) || patch.points.iter().flatten().any(|&p| !self.bounds.contains(p))
    }

    /// Whether a face stays as it is.
    pub(super) fn is_fixed(&self, f: FaceId) -> bool {
        self.fixed.get(f.index()).copied().unwrap_or(false)
    }
}
