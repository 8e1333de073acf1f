//! Lengths of the sides of a face, and how far they lie from a reference.

use glam::DVec3;

use super::scaled;
use crate::mesh::bvh::TriangleBvh;

fn sides<const N: usize>(p: [DVec3; N]) -> [f64; N] {
    std::array::from_fn(|i| p[(i + 1) % N].distance(p[i]))
}

fn least<const N: usize>(values: [f64; N]) -> f64 {
    values.into_iter().fold(f64::INFINITY, f64::min)
}

fn most<const N: usize>(values: [f64; N]) -> f64 {
    values.into_iter().fold(0.0, f64::max)
}

pub(super) fn shortest<const N: usize>(p: [DVec3; N]) -> f64 {
    least(sides(p))
}

pub(super) fn longest<const N: usize>(p: [DVec3; N]) -> f64 {
    most(sides(p))
}

pub(super) fn edge_ratio<const N: usize>(p: [DVec3; N]) -> f64 {
    let Some(p) = scaled(p) else { return f64::NAN };
    let (least, most) = (least(sides(p)), most(sides(p)));
    if least > 0.0 { most / least } else { f64::NAN }
}

/// The largest distance from the midpoint of a side to the reference.
pub(super) fn chordal_deviation(corners: &[DVec3], reference: &TriangleBvh) -> f64 {
    let count = corners.len();
    let middle = |i: usize| 0.5 * corners[i] + 0.5 * corners[(i + 1) % count];
    let distance = |p: DVec3| reference.closest(p).map_or(f64::NAN, |closest| closest.distance());
    (0..count).map(middle).map(distance).fold(0.0, |most: f64, next| if next.is_nan() { next } else { most.max(next) })
}
