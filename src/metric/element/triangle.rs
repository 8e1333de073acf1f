//! Shape of one triangle.

use glam::DVec3;

use super::scaled;
use crate::mesh::geometry;

type Corners = [DVec3; 3];

/// A function of the scaled triangle, not a number where it has no area to speak of.
fn of_shape(p: Corners, value: impl Fn(Corners) -> f64) -> f64 {
    scaled(p).filter(|p| geometry::triangle_area(*p) > 0.0).map_or(f64::NAN, value)
}

fn angles(p: Corners) -> [f64; 3] {
    geometry::triangle_angles(p).map(f64::to_degrees)
}

pub(super) fn area(p: Corners) -> f64 {
    geometry::triangle_area(p)
}

pub(super) fn characteristic_length(p: Corners) -> f64 {
    let longest = super::length::longest(p);
    of_shape(p, |p| {
        longest * 2.0 * geometry::triangle_area(p) / geometry::triangle_size(p) / geometry::triangle_size(p)
    })
}

pub(super) fn aspect_ratio(p: Corners) -> f64 {
    of_shape(p, geometry::aspect_ratio)
}

pub(super) fn stretch(p: Corners) -> f64 {
    of_shape(p, geometry::stretch)
}

pub(super) fn min_angle(p: Corners) -> f64 {
    of_shape(p, |p| angles(p).into_iter().fold(f64::INFINITY, f64::min))
}

pub(super) fn max_angle(p: Corners) -> f64 {
    of_shape(p, |p| angles(p).into_iter().fold(0.0, f64::max))
}

pub(super) fn equiangle_skew(p: Corners) -> f64 {
    of_shape(p, |p| {
        let angles = angles(p);
        let (least, most) = (angles.into_iter().fold(180.0, f64::min), angles.into_iter().fold(0.0, f64::max));
        ((most - 60.0) / 120.0).max((60.0 - least) / 60.0)
    })
}

pub(super) fn skew(p: Corners) -> f64 {
    of_shape(p, |p| {
        let at = |i: usize| {
            let (own, next, last) = (p[i], p[(i + 1) % 3], p[(i + 2) % 3]);
            let median = 0.5 * (next + last) - own;
            // The midpoints of the sides beside the corner differ by half of the side opposite.
            acute(median, next - last)
        };
        90.0 - at(0).min(at(1)).min(at(2))
    })
}

/// The angle between two lines, 0 to 90 degrees.
pub(super) fn acute(u: DVec3, v: DVec3) -> f64 {
    let angle = geometry::angle(u, v).to_degrees();
    angle.min(180.0 - angle)
}
