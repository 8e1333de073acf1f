//! One face against the other mesh: convex pieces are bounded, and cut where the bound is too loose.

use glam::DVec3;
use smallvec::{SmallVec, smallvec};

use super::{Inside, Target};
use crate::mesh::geometry::{area_vector, closest_on_triangle, triangle_size};

/// When a piece is good enough, and how much work a face may cost.
pub(super) struct Limits<'a> {
    /// A piece with a bound of at most this is not cut.
    accept: f64,
    /// Nor one with a bound that exceeds what the face reaches by at most this.
    slack: f64,
    /// A face that reaches more than this is settled.
    give_up: f64,
    /// A piece of a smaller radius is not cut.
    radius: f64,
    /// What is inside of these bodies does not count.
    hidden: Option<&'a Inside>,
}

/// Pieces for a face that is the whole area, and for any: a large face may lie over all faces of the other mesh, so
/// work goes by area. Keeps the worst case within minutes; a usual face needs one piece, or ten.
const PIECES_BY_AREA: f64 = 40e6;
const FEWEST: usize = 2048;

impl<'a> Limits<'a> {
    pub(super) fn new(accept: f64, slack: f64, give_up: f64, to: &Target) -> Self {
        Self { accept, slack, give_up, radius: 1e-10 * to.bvh.bounds().diagonal(), hidden: None }
    }

    /// The same, where what is inside of bodies does not count.
    pub(super) fn without(self, hidden: Option<&'a Inside>) -> Self {
        Self { hidden, ..self }
    }

    /// Whether a point is inside of the bodies in which nothing counts.
    fn holds(&self, point: DVec3) -> bool {
        self.hidden.is_some_and(|hidden| hidden.holds(point))
    }
}

/// What is known of the largest distance of a face.
#[derive(Clone, Debug, Default)]
pub(super) struct Bound {
    /// Not more than this.
    pub(super) upper: f64,
    /// At least this.
    pub(super) lower: f64,
    /// Where it is reached.
    pub(super) at: DVec3,
    /// The triangles of the other mesh that show `upper`, in no order and each perhaps several times.
    pub(super) by: SmallVec<[u32; 4]>,
}

impl Bound {
    fn reach(&mut self, distance: f64, at: DVec3, limits: &Limits<'_>) {
        if distance > self.lower && (distance <= limits.accept || !limits.holds(at)) {
            (self.lower, self.at) = (distance, at);
        }
    }

    fn settle(&mut self, (upper, by): (f64, u32)) {
        self.upper = self.upper.max(upper);
        if self.by.last() != Some(&by) {
            self.by.push(by);
        }
    }
}

/// A corner of a piece with its nearest triangle of the other mesh.
#[derive(Clone, Copy)]
struct Corner {
    point: DVec3,
    distance_squared: f64,
    nearest: u32,
}

type Piece = SmallVec<[Corner; 6]>;

/// The largest distance over `piece` to triangle `t` of the other mesh: it is reached at a corner.
fn to_triangle(piece: &Piece, to: &Target, t: u32) -> f64 {
    let triangle = to.triangles[t as usize];
    let squared = |c: &Corner| closest_on_triangle(c.point, triangle).distance_squared;
    piece.iter().map(squared).fold(0.0, f64::max).sqrt()
}

/// The best bound by the triangles nearest to the corners, with the one that gives it.
fn bound_by_corners(piece: &Piece, to: &Target) -> (f64, u32) {
    let mut best = (f64::INFINITY, 0);
    for (i, corner) in piece.iter().enumerate() {
        if piece[..i].iter().all(|c| c.nearest != corner.nearest) {
            best = less(best, (to_triangle(piece, to, corner.nearest), corner.nearest));
        }
    }
    best
}

fn less(a: (f64, u32), b: (f64, u32)) -> (f64, u32) {
    if b.0 < a.0 { b } else { a }
}

/// Bounds the largest distance of a face with these corners, each given with its squared distance and nearest triangle.
/// `share` is the face's part of its mesh's area.
pub(super) fn refine(corners: [(DVec3, (f64, u32)); 3], to: &Target, limits: &Limits<'_>, share: f64) -> Bound {
    let most_pieces = FEWEST + (share * PIECES_BY_AREA) as usize;
    let mut bound = Bound { at: corners[0].0, ..Bound::default() };
    let first: Piece = corners
        .iter()
        .map(|&(point, (distance_squared, nearest))| Corner { point, distance_squared, nearest })
        .collect();
    for c in &first {
        bound.reach(c.distance_squared.sqrt(), c.point, limits);
    }
    let mut stack: Vec<Piece> = vec![first];
    let mut seen = 0;
    while let Some(piece) = stack.pop() {
        if bound.lower > limits.give_up {
            break;
        }
        seen += 1;
        let by_corners = bound_by_corners(&piece, to);
        let accept = limits.accept.max(bound.lower + limits.slack);
        if by_corners.0 <= accept {
            bound.settle(by_corners);
            continue;
        }
        let centre = piece.iter().map(|c| c.point).sum::<DVec3>() / piece.len() as f64;
        let radius = piece.iter().map(|c| (c.point - centre).length_squared()).fold(0.0, f64::max).sqrt();
        let near = |c: &Corner| closest_on_triangle(centre, to.triangles[c.nearest as usize]).distance_squared;
        let known = piece.iter().map(near).fold(f64::INFINITY, f64::min);
        let Some(found) = to.bvh.closest_within(centre, known).or_else(|| to.bvh.closest(centre)) else { break };
        bound.reach(found.distance(), centre, limits);
        let by_centre = (found.distance() + radius).min(to_triangle(&piece, to, found.index));
        let best = less(by_corners, (by_centre, found.index));
        let is_hidden = best.0 > accept && limits.holds(centre);
        if is_hidden && found.distance() > radius {
            // As a whole on one side of the other mesh.
            continue;
        }
        if best.0 <= accept || radius <= limits.radius || seen >= most_pieces {
            bound.settle(best);
            continue;
        }
        let parts = if is_hidden {
            halves(&piece, centre, found.index, to)
        } else {
            cut(&piece, (centre, radius), found.index, to, accept)
        };
        for part in parts {
            for c in &part {
                bound.reach(c.distance_squared.sqrt(), c.point, limits);
            }
            stack.push(part);
        }
    }
    bound.upper = bound.upper.max(bound.lower);
    bound
}

/// Cuts a piece along the sides of the prism over triangle `t`, where that separates what `t` bounds from what it does
/// not; else in halves.
fn cut(piece: &Piece, (centre, radius): (DVec3, f64), t: u32, to: &Target, accept: f64) -> SmallVec<[Piece; 4]> {
    let triangle = to.triangles[t as usize];
    let normal = area_vector(triangle);
    let far =
        piece.iter().copied().filter(|c| closest_on_triangle(c.point, triangle).distance_squared > accept * accept);
    let far: Piece = far.collect();
    let mut planes: SmallVec<[(DVec3, DVec3); 3]> = SmallVec::new();
    for i in 0..3 {
        let (a, b) = (triangle[i], triangle[(i + 1) % 3]);
        let outward = (b - a).cross(normal).normalize_or_zero();
        // What lies beyond by rounding only would be cut off again and again.
        if far.iter().any(|c| (c.point - a).dot(outward) > 1e-9 * radius) {
            planes.push((a, outward));
        }
    }
    // The prism helps where it holds the centre, and is not tiny compared with the piece.
    let fits = radius <= 2.0 * triangle_size(triangle);
    let inside = planes.iter().all(|&(a, outward)| (centre - a).dot(outward) < -1e-9 * radius);
    if planes.is_empty() || !fits || !inside {
        return halves(piece, centre, t, to);
    }
    let mut parts = SmallVec::new();
    let mut rest = piece.clone();
    for (a, outward) in planes {
        let (within, beyond) = split(&rest, a, outward, t, to);
        rest = within;
        if beyond.len() >= 3 {
            parts.push(beyond);
        }
    }
    if rest.len() >= 3 {
        parts.push(rest);
    }
    parts
}

/// Cuts a piece in two across its longest extent.
fn halves(piece: &Piece, centre: DVec3, t: u32, to: &Target) -> SmallVec<[Piece; 4]> {
    let farthest = piece.iter().map(|c| c.point - centre);
    let along = farthest.fold(DVec3::ZERO, |m, d| if d.length_squared() > m.length_squared() { d } else { m });
    let (left, right) = split(piece, centre, along.normalize_or_zero(), t, to);
    smallvec![left, right]
}

/// Splits a convex piece by a plane: what lies below, and what lies above. Triangle `t` is near the cut and serves as
/// the first bound of the new corners' queries.
fn split(piece: &Piece, origin: DVec3, normal: DVec3, t: u32, to: &Target) -> (Piece, Piece) {
    let (mut below, mut above) = (Piece::new(), Piece::new());
    for (i, &c) in piece.iter().enumerate() {
        let d = piece[(i + 1) % piece.len()];
        let (hc, hd) = ((c.point - origin).dot(normal), (d.point - origin).dot(normal));
        if hc <= 0.0 {
            below.push(c);
        }
        if hc >= 0.0 {
            above.push(c);
        }
        if hc * hd < 0.0 {
            let point = c.point + (hc / (hc - hd)) * (d.point - c.point);
            let corner = corner_at(point, t, to);
            below.push(corner);
            above.push(corner);
        }
    }
    (below, above)
}

fn corner_at(point: DVec3, t: u32, to: &Target) -> Corner {
    let known = closest_on_triangle(point, to.triangles[t as usize]).distance_squared;
    match to.bvh.closest_within(point, known) {
        Some(found) => Corner { point, distance_squared: found.nearest.distance_squared, nearest: found.index },
        None => Corner { point, distance_squared: known, nearest: t },
    }
}
