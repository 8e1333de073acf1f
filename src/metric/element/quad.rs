//! Shape of one quad.

use glam::DVec3;

use super::scaled;
use super::triangle::acute;
use crate::metric::quad_shape::{QuadShape, quad_shape};

type Corners = [DVec3; 4];

/// A function of the scaled quad, not a number where that has no extent.
fn of_shape(p: Corners, value: impl Fn(Corners) -> f64) -> f64 {
    scaled(p).map_or(f64::NAN, value)
}

/// A figure of the scaled quad, not a number where it is none or has no area.
fn figure(p: Corners, value: impl Fn(&QuadShape) -> f64) -> f64 {
    of_shape(p, |p| {
        let shape = quad_shape(p);
        let value = value(&shape);
        if value.is_finite() && shape.area.abs() > 0.0 { value } else { f64::NAN }
    })
}

/// The least value; not a number where one is none.
fn least(values: impl IntoIterator<Item = f64>) -> f64 {
    values.into_iter().fold(f64::INFINITY, |least: f64, next| if next.is_nan() { next } else { least.min(next) })
}

/// Area vectors of the four triangles round the centre, twice as long.
fn round_centre(p: Corners) -> [DVec3; 4] {
    let centre = 0.25 * (p[0] + p[1] + p[2] + p[3]);
    std::array::from_fn(|i| (p[i] - centre).cross(p[(i + 1) % 4] - centre))
}

pub(super) fn area(p: Corners) -> f64 {
    let triangle = |i: usize, j: usize, k: usize| crate::mesh::geometry::triangle_area([p[i], p[j], p[k]]);
    0.5 * (triangle(0, 1, 2) + triangle(0, 2, 3) + triangle(0, 1, 3) + triangle(1, 2, 3))
}

pub(super) fn characteristic_length(p: Corners) -> f64 {
    let longest = super::length::longest(p);
    of_shape(p, |p| {
        let scaled = super::length::longest(p);
        longest * area(p) / scaled / scaled
    })
}

pub(super) fn aspect_ratio(p: Corners) -> f64 {
    figure(p, |shape| shape.aspect)
}

pub(super) fn stretch(p: Corners) -> f64 {
    figure(p, |shape| shape.stretch)
}

pub(super) fn min_angle(p: Corners) -> f64 {
    figure(p, |shape| shape.min_angle)
}

pub(super) fn max_angle(p: Corners) -> f64 {
    figure(p, |shape| shape.max_angle)
}

pub(super) fn warp_angle(p: Corners) -> f64 {
    figure(p, |shape| shape.warp_angle)
}

pub(super) fn scaled_jacobian(p: Corners) -> f64 {
    figure(p, |shape| shape.scaled_jacobian)
}

pub(super) fn equiangle_skew(p: Corners) -> f64 {
    figure(p, |shape| ((shape.max_angle - 90.0) / 90.0).max((90.0 - shape.min_angle) / 90.0))
}

pub(super) fn skew(p: Corners) -> f64 {
    figure(p, |_| 0.0) + of_shape(p, |p| 90.0 - acute(p[1] + p[2] - p[0] - p[3], p[2] + p[3] - p[0] - p[1]))
}

pub(super) fn jacobian(p: Corners) -> f64 {
    of_shape(p, |p| {
        let normal = (p[1] + p[2] - p[0] - p[3]).cross(p[2] + p[3] - p[0] - p[1]).normalize_or_zero();
        let place = 1.0 / 3.0_f64.sqrt();
        let determinant = |(x, y): (f64, f64)| {
            let along = (1.0 - y) * (p[1] - p[0]) + (1.0 + y) * (p[2] - p[3]);
            let across = (1.0 - x) * (p[3] - p[0]) + (1.0 + x) * (p[2] - p[1]);
            along.cross(across).dot(normal)
        };
        let all = [(-place, -place), (place, -place), (place, place), (-place, place)].map(determinant);
        let most = all.into_iter().fold(0.0, f64::max);
        if most > 0.0 { least(all) / most } else { f64::NAN }
    })
}

pub(super) fn taper(p: Corners) -> f64 {
    of_shape(p, |p| {
        let corner = |i: usize| crate::mesh::geometry::triangle_area([p[(i + 3) % 4], p[i], p[(i + 1) % 4]]);
        let half = 0.5 * area(p);
        if half > 0.0 { 1.0 - least((0..4).map(corner)) / half } else { f64::NAN }
    })
}

pub(super) fn flatness(p: Corners) -> f64 {
    of_shape(p, |p| {
        let parts = round_centre(p);
        let (sum, total) = (parts.iter().sum::<DVec3>().length(), parts.iter().map(|part| part.length()).sum::<f64>());
        if total > 0.0 { sum / total } else { f64::NAN }
    })
}

pub(super) fn twist(p: Corners) -> f64 {
    of_shape(p, |p| {
        let parts = round_centre(p);
        let normal = parts.iter().sum::<DVec3>().normalize_or(DVec3::NAN);
        least(parts.iter().filter_map(|part| part.try_normalize()).map(|part| part.dot(normal)))
    })
}

pub(super) fn triangle_twist(p: Corners) -> f64 {
    of_shape(p, |p| {
        let normals: Vec<DVec3> = round_centre(p).iter().filter_map(|part| part.try_normalize()).collect();
        match normals.len() {
            0 => f64::NAN,
            count => least((0..count).map(|i| normals[i].dot(normals[(i + 1) % count]))),
        }
    })
}
