//! Closed components look outward, and those inside an odd number of others inward: they bound cavities.

use glam::DVec3;
use robust::{Coord, Coord3D, orient2d, orient3d};

use super::adjacency::Twins;
use super::draft::Draft;
use super::orient::turn;
use crate::mesh::id::Face;
use crate::mesh::{FaceId, IdVec};

/// What is known of a component of the draft.
#[derive(Clone, Debug)]
pub(super) struct Part {
    /// Its faces in ascending order.
    pub(super) faces: Vec<FaceId>,
    /// Whether it has no border.
    pub(super) closed: bool,
    /// The lowest corner of its bounding box.
    pub(super) low: DVec3,
    /// The highest corner of its bounding box.
    pub(super) high: DVec3,
    /// Its area.
    pub(super) area: f64,
}

/// Turns the components that look the wrong way; returns how many, and how many closed ones bound a cavity.
pub(super) fn orient_outward(draft: &mut Draft, twins: &mut Twins, parts: &[Part]) -> (u64, u64) {
    let mut chosen: IdVec<Face, bool> = IdVec::filled(false, draft.faces.len());
    let (mut turned, mut cavities) = (0, 0);
    for (i, part) in parts.iter().enumerate().filter(|(_, part)| part.closed) {
        let is_cavity = depth(draft, parts, i) % 2 == 1;
        cavities += u64::from(is_cavity);
        let volume = volume(draft, part);
        if (volume < 0.0) != is_cavity && volume != 0.0 {
            turned += 1;
            part.faces.iter().for_each(|&f| chosen[f] = true);
        }
    }
    if turned > 0 {
        turn(draft, twins, &chosen);
    }
    (turned, cavities)
}

/// Six times the signed volume, about the middle of the component: far from the origin the terms would swamp it.
fn volume(draft: &Draft, part: &Part) -> f64 {
    let middle = part.low.midpoint(part.high);
    part.faces
        .iter()
        .map(|&f| {
            let [a, b, c] = draft.corners(f).map(|p| p - middle);
            a.dot(b.cross(c))
        })
        .sum()
}

/// Vertices of a component that must all be inside another one for it to count as nested. Bodies that run through each
/// other have vertices on both sides.
const PROBES: usize = 24;

/// How many closed components contain this one.
fn depth(draft: &Draft, parts: &[Part], which: usize) -> usize {
    let inner = &parts[which];
    let stride = inner.faces.len().div_ceil(PROBES).max(1);
    let probes: Vec<DVec3> = inner.faces.iter().step_by(stride).map(|&f| draft.points[draft.faces[f][0]]).collect();
    let contains = |outer: &Part| {
        outer.closed
            && outer.low.cmple(inner.low).all()
            && inner.high.cmple(outer.high).all()
            && (outer.low != inner.low || outer.high != inner.high)
            && probes.iter().all(|&p| is_inside(draft, outer, p))
    };
    parts.iter().enumerate().filter(|&(i, outer)| i != which && contains(outer)).count()
}

/// Whether a vertical ray from `point` leaves the component an odd number of times. A point on the surface is outside.
///
/// The faces are taken as half-open in the plane, so that a ray through an edge or a vertex counts once, and the side
/// of the point is decided exactly.
fn is_inside(draft: &Draft, part: &Part, point: DVec3) -> bool {
    let mut crossings = 0_usize;
    for &face in &part.faces {
        let corners = draft.corners(face);
        if corners.iter().all(|c| c.z < point.z) || !is_under(corners, point) {
            continue;
        }
        let [a, b, c] = corners.map(|p| Coord3D { x: p.x, y: p.y, z: p.z });
        let side = orient3d(a, b, c, Coord3D { x: point.x, y: point.y, z: point.z });
        if side == 0.0 {
            return false;
        }
        // Positive means below a face that is counter-clockwise seen from above.
        let facing = orient2d(flat(corners[0]), flat(corners[1]), flat(corners[2]));
        crossings += usize::from((side > 0.0) == (facing > 0.0));
    }
    crossings % 2 == 1
}

fn flat(p: DVec3) -> Coord<f64> {
    Coord { x: p.x, y: p.y }
}

/// Whether the point is within the triangle seen along z: an odd number of its edges lies to the right.
fn is_under(corners: [DVec3; 3], point: DVec3) -> bool {
    let mut inside = false;
    for i in 0..3 {
        let (a, b) = (corners[i], corners[(i + 1) % 3]);
        if (a.y > point.y) == (b.y > point.y) {
            continue;
        }
        // Order the ends, so that the two faces of an edge take the same decision.
        let (low, high) = if a.y < b.y { (a, b) } else { (b, a) };
        inside ^= orient2d(flat(low), flat(high), flat(point)) > 0.0;
    }
    inside
}
