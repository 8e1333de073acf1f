//! Bores and bosses of which a part is missing: they break out at their side, or others cut into it, and are no rings.
//!
//! What is left of one is a piece of a cylinder with straight edges along its axis. It is told only, not removed.

use glam::DVec3;

use super::cavity::ROUND;
use super::patches::{Patch, Patches};
use super::round::{Facing, Form, Ring, barrel};
use super::{Kind, Reason, Rejected};
use crate::mesh::geometry::centroid;
use crate::mesh::id::Face;
use crate::mesh::topology::EdgeTable;
use crate::mesh::{EdgeId, FaceId, IdVec, Surface};

/// Sine between an edge and the axis that it runs along.
const ALONG: f64 = 0.3;
/// Edges along the axis are this long together, as a share of the diameter, where a side is open.
const OPEN: f64 = 0.1;
/// An edge is sharp where the cosine between the faces on both sides is less: 20 degrees.
const SHARP: f64 = 0.94;
/// The largest part of the turn that is missing, in radians: 240 degrees with sharp edges at the gap; 150 degrees else,
/// because half-round ends of slots and the roundings of corners go on smoothly.
const WIDEST: [f64; 2] = [4.189, 2.618];

/// The patches of a surface, looked at for pieces of cylinders.
pub(super) struct OpenSides<'a> {
    surface: &'a Surface,
    edges: &'a EdgeTable,
    sides: IdVec<Face, [EdgeId; 3]>,
    normals: &'a IdVec<Face, DVec3>,
    patches: &'a Patches,
}

/// The edges where a patch ends.
#[derive(Default)]
struct Border {
    /// The length of those along the axis, and whether all of them are sharp.
    along: f64,
    is_sharp: bool,
    /// The length of the others, and how much of it lies in a hollow.
    across: f64,
    hollow: f64,
}

impl<'a> OpenSides<'a> {
    pub(super) fn new(
        surface: &'a Surface,
        edges: &'a EdgeTable,
        normals: &'a IdVec<Face, DVec3>,
        patches: &'a Patches,
    ) -> Self {
        let sides = edges.edges_of_triangles(surface.faces.len());
        Self { surface, edges, sides, normals, patches }
    }

    /// The pieces up to a diameter, with their faces.
    pub(super) fn find(&self, most: f64, kinds: &[Kind]) -> Vec<(Vec<FaceId>, Rejected)> {
        let of = |(number, patch): (usize, &Patch)| {
            let ring = barrel(self.surface, patch)?;
            let is_wanted = match ring.facing {
                Facing::In => kinds.contains(&Kind::ThroughHoles) || kinds.contains(&Kind::BlindHoles),
                Facing::Out => kinds.contains(&Kind::Bosses),
                Facing::Mixed => false,
            };
            let is_round = ring.form == Form::Side && ring.diameter() <= most && ring.error() <= ROUND;
            if !is_wanted || !is_round || !self.is_open(number as u32, patch, &ring) {
                return None;
            }
            let rejected = Rejected { centre: ring.centre, diameter: ring.diameter(), reason: Reason::CutByOthers };
            Some((patch.faces.clone(), rejected))
        };
        self.patches.all.iter().enumerate().filter_map(of).collect()
    }

    /// Whether a part of the turn is missing, but not too much of it, and a boss stands on something.
    fn is_open(&self, number: u32, patch: &Patch, ring: &Ring) -> bool {
        let border = self.border(number, patch, ring);
        let stands = ring.facing == Facing::In || border.hollow >= 0.25 * border.across;
        let widest = if border.is_sharp { WIDEST[0] } else { WIDEST[1] };
        border.along >= OPEN * ring.diameter() && stands && self.widest_gap(patch, ring) <= widest
    }

    fn border(&self, number: u32, patch: &Patch, ring: &Ring) -> Border {
        let mut border = Border { is_sharp: true, ..Border::default() };
        for &f in &patch.faces {
            for e in self.sides[f] {
                let beyond = self.edges.sides(e).iter().map(|side| side.face).find(|&g| g != f);
                if beyond.is_some_and(|g| self.patches.of_face[g] == number) {
                    continue;
                }
                let [a, b] = self.edges.key(e).map(|v| self.surface.points[v]);
                let length = a.distance(b);
                if (b - a).cross(ring.axis).length() <= ALONG * length {
                    border.along += length;
                    border.is_sharp &= beyond.is_none_or(|g| self.normals[f].dot(self.normals[g]) < SHARP);
                } else {
                    border.across += length;
                    let rises = |g| self.normals[f].dot(centroid(self.surface.corners(g)) - a) > 0.0;
                    border.hollow += if beyond.is_some_and(rises) { length } else { 0.0 };
                }
            }
        }
        border
    }

    /// The largest angle about the axis without a vertex.
    fn widest_gap(&self, patch: &Patch, ring: &Ring) -> f64 {
        let (u, v) = ring.axis.any_orthonormal_pair();
        let angle = |p: DVec3| libm::atan2((p - ring.centre).dot(v), (p - ring.centre).dot(u));
        let mut angles: Vec<f64> = patch.faces.iter().flat_map(|&f| self.surface.corners(f)).map(angle).collect();
        angles.sort_by(f64::total_cmp);
        let round = angles.first().zip(angles.last()).map_or(0.0, |(low, high)| low + std::f64::consts::TAU - high);
        angles.windows(2).map(|pair| pair[1] - pair[0]).fold(round, f64::max)
    }
}
