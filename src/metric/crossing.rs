//! Whether the crossings of a mesh are those of its reference, at another resolution.
//!
//! Pairs of faces cannot be compared between meshes of different sizes: where two bodies run through each other,
//! cutting every edge in two makes twice as many pairs along the same curve. What can be compared is where they are,
//! and how long they are. A pair is new when it meets farther than [`APART`] of the reference's diagonal from every
//! place where the reference's faces meet; and all of them are when they are more than [`LONGER`] times as long as the
//! reference's, as where surfaces that graze each other begin to weave.
//!
//! The place of a pair is the segment along which its faces cross, or the polygon in which they overlap, computed in
//! floats: which faces meet is decided exactly elsewhere.

use glam::DVec3;

use super::Subject;
use super::intersection::triangulated;
use crate::mesh::FaceId;
use crate::mesh::bvh::TriangleBvh;
use crate::mesh::geometry::{area_vector, closest_on_triangle};
use crate::mesh::predicate::{Meeting, triangle_triangle};

/// How far from the reference's crossings others may lie, as a share of its diagonal: surfaces that cross at a small
/// angle, each moved by a fifth of a percent, cross elsewhere by several times that.
pub const APART: f64 = 0.01;
/// How many times as long as the reference's they may be.
pub const LONGER: f64 = 2.0;

/// The crossings of a mesh beside those of its reference.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Crossings {
    /// Faces of pairs that meet where no faces of the reference do, in order.
    pub elsewhere: Vec<FaceId>,
    /// Length along which faces cross.
    pub length: f64,
    /// The same of the reference.
    pub reference_length: f64,
    /// How long they may be.
    pub longest: f64,
}

impl Crossings {
    /// Whether no crossing is new.
    pub fn is_old(&self) -> bool {
        self.elsewhere.is_empty() && self.length <= self.longest
    }
}

/// Compares all that meets by place and length; O((n + m) log m) in pairs of the mesh and of the reference.
pub fn compare(subject: &Subject<'_>, reference: &Subject<'_>) -> Crossings {
    compare_places(&places(subject, false), reference)
}

/// Compares what does not only touch with all that meets in the reference.
pub fn compare_crossing(subject: &Subject<'_>, reference: &Subject<'_>) -> Crossings {
    compare_places(&places(subject, true), reference)
}

fn compare_places(ours: &[Place], reference: &Subject<'_>) -> Crossings {
    let theirs = places(reference, false);
    let apart = APART * reference.extent().bounds.diagonal();
    let old = TriangleBvh::new(theirs.iter().flat_map(|place| place.common.fan()).collect());
    let is_old = |&p: &DVec3| old.closest_within(p, apart * apart).is_some();
    let new = ours.iter().filter(|place| !place.common.corners.iter().all(is_old));
    let mut elsewhere: Vec<FaceId> = new.flat_map(|place| place.faces).collect();
    elsewhere.sort_unstable();
    elsewhere.dedup();
    let sum = |places: &[Place]| places.iter().map(|place| place.common.length()).sum::<f64>();
    let reference_length = sum(&theirs);
    Crossings { elsewhere, length: sum(ours), reference_length, longest: LONGER * reference_length + apart }
}

/// What two triangles that meet have in common.
#[derive(Clone, Debug)]
pub struct Common {
    /// Corners of a segment or a convex polygon; at least one.
    corners: Vec<DVec3>,
    /// Whether the triangles lie in one plane.
    is_flat: bool,
}

impl Common {
    /// Of triangles that are known to meet.
    pub fn of(ours: [DVec3; 3], theirs: [DVec3; 3]) -> Self {
        let normal = area_vector(theirs).normalize_or_zero();
        let heights = ours.map(|p| normal.dot(p - theirs[0]));
        let size = ours.iter().chain(&theirs).map(|p| p.distance(ours[0])).fold(0.0, f64::max);
        let is_flat = heights.iter().all(|height| height.abs() <= 1e-9 * size);
        let mut corners = if is_flat { ours.to_vec() } else { section(ours, heights) };
        for side in 0..3 {
            let (from, to) = (theirs[side], theirs[(side + 1) % 3]);
            let inward = normal.cross(to - from).normalize_or_zero();
            corners = clipped(&corners, |p| inward.dot(p - from) + 1e-9 * size);
        }
        if corners.is_empty() {
            // They meet in so little that rounding lost it.
            corners = vec![closest_on_triangle(ours[0], theirs).point];
        }
        Self { corners, is_flat }
    }

    /// Triangles that cover it; a segment is a triangle with a corner twice.
    fn fan(&self) -> impl Iterator<Item = [DVec3; 3]> {
        let last = self.corners.len() - 1;
        (1..last.max(2)).map(move |at| [0, at.min(last), (at + 1).min(last)].map(|corner| self.corners[corner]))
    }

    /// Length of the segment along which they cross; 0 where they lie in one plane.
    pub fn length(&self) -> f64 {
        let others = |a: &DVec3| self.corners.iter().map(|b| a.distance(*b)).fold(0.0, f64::max);
        if self.is_flat { 0.0 } else { self.corners.iter().map(others).fold(0.0, f64::max) }
    }

    /// Area of the polygon in which they lie on each other; 0 where they cross.
    pub fn area(&self) -> f64 {
        if self.is_flat { 0.5 * self.fan().map(area_vector).sum::<DVec3>().length() } else { 0.0 }
    }

    /// The mean of its corners.
    pub fn middle(&self) -> DVec3 {
        self.corners.iter().sum::<DVec3>() / self.corners.len() as f64
    }
}

/// Where two faces meet.
struct Place {
    faces: [FaceId; 2],
    common: Common,
}

fn places(subject: &Subject<'_>, only_crossing: bool) -> Vec<Place> {
    let mesh = subject.mesh();
    let cut = triangulated(mesh);
    let coordinates = cut.coordinates(mesh);
    let triangles = |face: FaceId| {
        let first = cut.origin.partition_point(|&origin| origin < face);
        let end = cut.origin.partition_point(|&origin| origin <= face);
        &coordinates[first..end]
    };
    let mut found = Vec::new();
    for &(a, b, _) in subject.intersections().pairs.iter().filter(|pair| !only_crossing || pair.2 != Meeting::Touching)
    {
        for &ours in triangles(a) {
            for &theirs in triangles(b) {
                if triangle_triangle(ours, theirs).is_intersection() {
                    found.push(Place { faces: [a, b], common: Common::of(ours, theirs) });
                }
            }
        }
    }
    found
}

/// Where a triangle passes through a plane, from the heights of its corners over that.
fn section(triangle: [DVec3; 3], heights: [f64; 3]) -> Vec<DVec3> {
    let mut points = Vec::new();
    for at in 0..3 {
        let (a, b) = (at, (at + 1) % 3);
        if heights[a] == 0.0 {
            points.push(triangle[a]);
        } else if (heights[a] < 0.0) != (heights[b] < 0.0) && heights[b] != 0.0 {
            points.push(triangle[a].lerp(triangle[b], heights[a] / (heights[a] - heights[b])));
        }
    }
    points
}

/// The part of a convex polygon or segment where `inside` is not negative.
fn clipped(corners: &[DVec3], inside: impl Fn(DVec3) -> f64) -> Vec<DVec3> {
    let mut kept = Vec::new();
    for (at, &a) in corners.iter().enumerate() {
        let b = corners[(at + 1) % corners.len()];
        let (here, next) = (inside(a), inside(b));
        if here >= 0.0 {
            kept.push(a);
        }
        if (here < 0.0) != (next < 0.0) {
            kept.push(a.lerp(b, here / (here - next)));
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use glam::dvec3;

    use super::*;
    use crate::mesh::{Facet, Soup, VertexId};
    use crate::watch::Watch;

    /// Two square sheets of so many squares a side: one in the plane `z = 0`, one moved and turned by the function.
    fn sheets(count: u32, second: impl Fn(f64, f64) -> DVec3) -> Soup {
        let mut soup = Soup::default();
        let first = |x: f64, y: f64| dvec3(x, y, 0.0);
        for sheet in [&first as &dyn Fn(f64, f64) -> DVec3, &second] {
            let base = soup.points.len() as u32;
            for at in 0..(count + 1) * (count + 1) {
                let part = |n: u32| f64::from(n) / f64::from(count);
                soup.points.push(sheet(part(at % (count + 1)), part(at / (count + 1))));
            }
            for at in 0..count * count {
                let corner =
                    |dx: u32, dy: u32| VertexId::from_raw(base + (at / count + dy) * (count + 1) + at % count + dx);
                soup.faces.push(Facet::Tri([corner(0, 0), corner(1, 0), corner(1, 1)]));
                soup.faces.push(Facet::Tri([corner(0, 0), corner(1, 1), corner(0, 1)]));
            }
        }
        soup
    }

    fn compared(ours: &Soup, theirs: &Soup) -> Crossings {
        let watch = Watch::silent();
        compare(&Subject::new(ours, None, &watch), &Subject::new(theirs, None, &watch))
    }

    #[test]
    fn refinement_makes_no_new_crossing_and_moving_does() {
        let upright = |at: f64| move |x: f64, y: f64| dvec3(at, x, y - 0.503);
        let (coarse, fine) = (sheets(3, upright(0.31)), sheets(17, upright(0.31)));
        let found = compared(&fine, &coarse);
        assert!(found.is_old(), "{found:?}");
        assert!((found.length - 1.0).abs() < 1e-6 && (found.reference_length - 1.0).abs() < 1e-6, "{found:?}");
        let moved = compared(&sheets(17, upright(0.36)), &coarse);
        assert!(!moved.is_old() && moved.elsewhere.len() > 17, "{moved:?}");
        assert!(compared(&sheets(17, upright(0.312)), &coarse).is_old());
    }

    #[test]
    fn sheets_that_lie_on_each_other_are_compared_by_area() {
        let on = |x: f64, y: f64| dvec3(0.5 + x, 0.25 + y, 0.0);
        let coarse = sheets(1, on);
        assert!(compared(&sheets(9, on), &coarse).is_old());
        let farther = |x: f64, y: f64| dvec3(0.4 + x, 0.25 + y, 0.0);
        assert!(!compared(&sheets(9, farther), &coarse).is_old());
    }
}
