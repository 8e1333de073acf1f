//! Openings in flat faces: closed rims with a face flat all round them, whatever lies behind.
//!
//! The side that a rim of one hole shows need not be a ring: bores that cross, or that overlap, have one side in
//! common. Seen from the face that they are drilled into, each is a closed rim all the same.

use glam::DVec3;

use super::cavity::ROUND;
use super::patches::{Patches, Rim};
use super::round::{circle, unroundness};
use crate::mesh::id::Face;
use crate::mesh::{FaceId, IdVec, Surface};

/// Cosine between the rim's plane and the faces round it: at most 37 degrees where the rim is sharp, as on a shaft of
/// 1.7 times the bore; 1 degree else, because the strips of a rounding have smooth rims as well.
const FLAT: [f64; 2] = [0.8, 0.99985];
/// A rim is sharp where the cosine between the faces on both sides is less: 20 degrees.
const SHARP: f64 = 0.94;
/// How far a rim may leave its plane, as a share of its radius.
const UNEVEN: f64 = 0.25;
/// Directions in which the width of a rim that is not round is looked at.
const DIRECTIONS: usize = 64;

/// A rim that bounds a flat face from inside.
#[derive(Clone, Debug)]
pub(super) struct Opening {
    /// The patch round it, and the number of its rim there.
    pub(super) patch: u32,
    pub(super) rim: usize,
    /// The faces beyond the rim.
    pub(super) behind: Vec<FaceId>,
    pub(super) centre: DVec3,
    /// The normal of the face.
    pub(super) normal: DVec3,
    /// The diameter of a round one, else the narrowest width.
    pub(super) width: f64,
    /// The width that counts: that of the side beyond a rounded rim.
    pub(super) bore: f64,
    pub(super) is_round: bool,
    /// Whether what lies beyond the rim faces inwards: a hole, no boss.
    pub(super) is_hole: bool,
}

/// Which rims count as openings.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Rims {
    /// Those that are sharp all round.
    Sharp,
    /// The smooth ends of roundings too.
    Any,
}

/// All openings of the patches.
pub(super) fn openings(surface: &Surface, normals: &IdVec<Face, DVec3>, patches: &Patches, kind: Rims) -> Vec<Opening> {
    let mut found = Vec::new();
    for (number, patch) in patches.all.iter().enumerate() {
        let rims = patch.rims.iter().enumerate();
        found.extend(rims.filter_map(|(k, rim)| opening(surface, normals, (number as u32, k), rim, kind)));
    }
    found
}

fn opening(
    surface: &Surface,
    normals: &IdVec<Face, DVec3>,
    (patch, number): (u32, usize),
    rim: &Rim,
    kind: Rims,
) -> Option<Opening> {
    let behind: Vec<FaceId> = rim.beyond.iter().copied().collect::<Option<_>>()?;
    // A rim from inside runs against the face that it lies in.
    let normal = -around(surface, rim).try_normalize()?;
    let flat = if kind == Rims::Sharp { FLAT[0] } else { FLAT[1] };
    let is_flat = rim.own.iter().all(|&f| normals[f] == DVec3::ZERO || normals[f].dot(normal) >= flat);
    let is_sharp = rim.own.iter().zip(&behind).all(|(&f, &g)| normals[f].dot(normals[g]) < SHARP);
    if !is_flat || (kind == Rims::Sharp && !is_sharp) {
        return None;
    }
    let circle = circle(surface, rim, normal);
    let height = |v: &crate::mesh::VertexId| (surface.points[*v] - circle.centre).dot(normal).abs();
    if rim.vertices.iter().map(height).fold(0.0, f64::max) > UNEVEN * circle.radius {
        return None;
    }
    let is_round = unroundness(surface, rim, circle.centre, normal) <= ROUND;
    if !is_sharp && !is_round {
        // What noise bounds.
        return None;
    }
    let width = if is_round { 2.0 * circle.radius } else { narrowest(surface, rim, normal) };
    let is_hole = inwards(surface, normals, rim, circle.centre, normal) > 0.0;
    Some(Opening { patch, rim: number, behind, centre: circle.centre, normal, width, bore: width, is_round, is_hole })
}

/// Twice the area vector of a rim.
fn around(surface: &Surface, rim: &Rim) -> DVec3 {
    let at = |i: usize| surface.points[rim.vertices[i % rim.vertices.len()]];
    let first = at(0);
    (0..rim.vertices.len()).map(|i| (at(i) - first).cross(at(i + 1) - first)).sum()
}

/// How much the faces beyond a rim face towards the axis through `centre`, summed over its length.
pub(super) fn inwards(surface: &Surface, normals: &IdVec<Face, DVec3>, rim: &Rim, centre: DVec3, axis: DVec3) -> f64 {
    let at = |i: usize| surface.points[rim.vertices[i % rim.vertices.len()]];
    let of = |(i, f): (usize, &Option<FaceId>)| {
        let (a, b) = (at(i), at(i + 1));
        let out = 0.5 * (a + b) - centre;
        let out = (out - axis * out.dot(axis)).normalize_or_zero();
        f.map_or(0.0, |f| -a.distance(b) * normals[f].dot(out))
    };
    rim.beyond.iter().enumerate().map(of).sum()
}

/// The least extent of a rim over directions in its plane.
fn narrowest(surface: &Surface, rim: &Rim, normal: DVec3) -> f64 {
    let (u, v) = normal.any_orthonormal_pair();
    let extent = |k: usize| {
        let (sin, cos) = libm::sincos(std::f64::consts::PI * k as f64 / DIRECTIONS as f64);
        let along = cos * u + sin * v;
        let places = rim.vertices.iter().map(|&w| surface.points[w].dot(along));
        let (low, high) = places.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)));
        high - low
    };
    (0..DIRECTIONS).map(extent).fold(f64::INFINITY, f64::min)
}
