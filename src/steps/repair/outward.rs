//! Closed components look outward, and those inside an odd number of others inward: they bound cavities.
//!
//! Inside means the whole surface: a component that meets another one anywhere is not inside it, and looks outward.
//! Where bodies that touch stay apart it may have corners on the other one, as what fills a part of a cavity has.
//! Nothing in a file tells a cavity from debris within the material, whichever way its faces look: both count as
//! cavities, so that the inside of the result is well defined, and `keep-components` drops what is too small to be
//! meant.

use std::cell::OnceCell;
use std::ops::ControlFlow;

use glam::DVec3;
use robust::{Coord, Coord3D, orient2d, orient3d};

use super::adjacency::Twins;
use super::draft::Draft;
use super::orient::turn;
use crate::mesh::bvh::{Primitive, TriangleBvh};
use crate::mesh::geometry::Aabb;
use crate::mesh::id::Face;
use crate::mesh::predicate::{segment_triangle, triangle_triangle};
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
pub(super) fn orient_outward(draft: &mut Draft, twins: &mut Twins, parts: &[Part], may_touch: bool) -> (u64, u64) {
    let mut chosen: IdVec<Face, bool> = IdVec::filled(false, draft.faces.len());
    let (mut turned, mut cavities) = (0, 0);
    let bodies: Vec<Body> = parts.iter().filter(|part| part.closed).map(Body::new).collect();
    for (i, &Body { part, .. }) in bodies.iter().enumerate() {
        let is_cavity = depth(draft, &bodies, i, may_touch) % 2 == 1;
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

/// A closed component, with its tree of faces once somebody asks for it.
struct Body<'a> {
    part: &'a Part,
    tree: OnceCell<TriangleBvh>,
}

impl<'a> Body<'a> {
    fn new(part: &'a Part) -> Self {
        Self { part, tree: OnceCell::new() }
    }

    fn tree(&self, draft: &Draft) -> &TriangleBvh {
        self.tree.get_or_init(|| TriangleBvh::new(self.part.faces.iter().map(|&f| draft.corners(f)).collect()))
    }

    fn has_box_around(&self, inner: &Part) -> bool {
        let outer = self.part;
        outer.low.cmple(inner.low).all()
            && inner.high.cmple(outer.high).all()
            && (outer.low != inner.low || outer.high != inner.high)
    }

    /// Whether a point is on this body's surface.
    fn is_at(&self, draft: &Draft, point: DVec3) -> bool {
        let visit = |_, corners: &[DVec3; 3]| {
            let is_here = segment_triangle([point; 2], *corners);
            if is_here { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        };
        self.tree(draft).for_each_in(&Aabb::of([point]), visit).is_break()
    }

    /// Whether no face of the component meets this body's surface.
    fn is_apart_from(&self, draft: &Draft, inner: &Part) -> bool {
        let tree = self.tree(draft);
        inner.faces.iter().all(|&f| {
            let mine = draft.corners(f);
            let visit = |_, other: &[DVec3; 3]| {
                if triangle_triangle(mine, *other).is_intersection() {
                    ControlFlow::Break(())
                } else {
                    ControlFlow::Continue(())
                }
            };
            tree.for_each_in(&mine.bounds(), visit).is_continue()
        })
    }
}

/// Vertices of a component tried first: bodies that run through each other nearly always have vertices on both sides.
const PROBES: usize = 24;

/// How many closed components contain this one.
fn depth(draft: &Draft, bodies: &[Body<'_>], which: usize, may_touch: bool) -> usize {
    let inner = bodies[which].part;
    let stride = inner.faces.len().div_ceil(PROBES).max(1);
    let stride = if may_touch { 1 } else { stride };
    let probes: Vec<DVec3> = inner.faces.iter().step_by(stride).map(|&f| draft.points[draft.faces[f][0]]).collect();
    let contains = |outer: &Body<'_>| {
        let holds = |&p: &DVec3| is_inside(draft, outer, p);
        let mut beside = probes.iter().filter(|p| !may_touch || !outer.is_at(draft, **p)).peekable();
        outer.has_box_around(inner) && beside.peek().is_some() && beside.all(holds) && outer.is_apart_from(draft, inner)
    };
    bodies.iter().enumerate().filter(|&(i, outer)| i != which && contains(outer)).count()
}

/// Whether a vertical ray from `point` leaves the body an odd number of times. A point on the surface is outside.
///
/// The faces are taken as half-open in the plane, so that a ray through an edge or a vertex counts once, and the side
/// of the point is decided exactly.
fn is_inside(draft: &Draft, body: &Body<'_>, point: DVec3) -> bool {
    let ray = Aabb::of([point, point.with_z(body.part.high.z)]);
    let mut crossings = 0_usize;
    let visit = |_, &corners: &[DVec3; 3]| match crosses(corners, point) {
        None => ControlFlow::Break(()),
        Some(is_crossing) => {
            crossings += usize::from(is_crossing);
            ControlFlow::Continue(())
        }
    };
    body.tree(draft).for_each_in(&ray, visit).is_continue() && crossings % 2 == 1
}

/// Whether the ray upwards from the point meets the triangle, or `None` when the point is on it.
fn crosses(corners: [DVec3; 3], point: DVec3) -> Option<bool> {
    if corners.iter().all(|c| c.z < point.z) || !is_under(corners, point) {
        return Some(false);
    }
    let [a, b, c] = corners.map(|p| Coord3D { x: p.x, y: p.y, z: p.z });
    let side = orient3d(a, b, c, Coord3D { x: point.x, y: point.y, z: point.z });
    // Positive means below a face that is counter-clockwise seen from above.
    let facing = orient2d(flat(corners[0]), flat(corners[1]), flat(corners[2]));
    (side != 0.0).then_some((side > 0.0) == (facing > 0.0))
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
