//! Bores that break out at their side: more than half a cylinder, and no ring.

use super::cavity::ROUND;
use super::patches::{Patch, Patches, Rim};
use super::round::{Facing, Form, Ring, ring};
use super::{Reason, Rejected};
use crate::mesh::{FaceId, Surface};

/// The opening takes less than this of the turn, in radians: 150 degrees. Half-round ends of slots and notches are none.
const WIDEST: f64 = 2.618;

/// The bores up to a diameter that are open at their side.
pub(super) fn open_sided(surface: &Surface, patches: &Patches, most: f64) -> Vec<(Vec<FaceId>, Rejected)> {
    let of = |patch: &Patch| {
        let [rim] = &patch.rims[..] else { return None };
        if patch.characteristic != 1 {
            return None;
        }
        let ring = ring(surface, patch)?;
        let is_bore = ring.form == Form::Side
            && ring.facing == Facing::In
            && ring.diameter() <= most
            && ring.error() <= ROUND
            && widest_gap(surface, rim, &ring) <= WIDEST;
        let rejected = Rejected { centre: ring.centre, diameter: ring.diameter(), reason: Reason::CutByOthers };
        is_bore.then(|| (patch.faces.clone(), rejected))
    };
    patches.all.iter().filter_map(of).collect()
}

/// The largest angle about the axis without a vertex of the rim.
fn widest_gap(surface: &Surface, rim: &Rim, ring: &Ring) -> f64 {
    let (u, v) = ring.axis.any_orthonormal_pair();
    let angle = |w: &crate::mesh::VertexId| {
        let off = surface.points[*w] - ring.centre;
        libm::atan2(off.dot(v), off.dot(u))
    };
    let mut angles: Vec<f64> = rim.vertices.iter().map(angle).collect();
    angles.sort_by(f64::total_cmp);
    let round = angles.first().zip(angles.last()).map_or(0.0, |(low, high)| low + std::f64::consts::TAU - high);
    angles.windows(2).map(|pair| pair[1] - pair[0]).fold(round, f64::max)
}
