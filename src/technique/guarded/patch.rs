//! The faces of one edit: those that it replaces and their successors, in lists that are used again.

use glam::DVec3;

use crate::mesh::FaceId;

/// The faces of one edit.
#[derive(Debug, Default)]
pub(super) struct Patch {
    /// The faces replaced.
    pub(super) old: Vec<FaceId>,
    /// Successors: their number where they have one already.
    pub(super) ids: Vec<FaceId>,
    /// Their corners.
    pub(super) points: Vec<[DVec3; 3]>,
    /// Whether the surface stays the same set of points, up to rounding.
    pub(super) is_same: bool,
    pub(super) old_points: Vec<[DVec3; 3]>,
    /// Faces next to those replaced.
    pub(super) beside: Vec<FaceId>,
    pub(super) beside_points: Vec<[DVec3; 3]>,
    /// How often it was begun anew, to tell plans that are out of date.
    pub(super) age: u64,
}

impl Patch {
    /// Begins another edit.
    pub(super) fn clear(&mut self) {
        self.old.clear();
        self.ids.clear();
        self.points.clear();
        self.is_same = false;
        self.age += 1;
    }

    /// Adds a face that stays with other corners.
    pub(super) fn change(&mut self, face: FaceId, points: [DVec3; 3]) {
        self.old.push(face);
        self.succeed(face, points);
    }

    /// Adds a successor.
    pub(super) fn succeed(&mut self, face: FaceId, points: [DVec3; 3]) {
        self.ids.push(face);
        self.points.push(points);
    }
}
