//! Whether a patch is a piece of a surface of revolution: axis, circles, facing.

use glam::DVec3;

use super::patches::{Patch, Rim};
use crate::mesh::geometry::{area_vector, centroid};
use crate::mesh::{FaceId, Surface, VertexId};
use crate::technique::eigen::symmetric_eigen;

/// A circle in space.
#[derive(Clone, Copy, Debug)]
pub(super) struct Circle {
    pub(super) centre: DVec3,
    pub(super) radius: f64,
    /// The largest distance of a point from it, seen along the axis, as a share of the radius.
    pub(super) error: f64,
}

/// What a ring between two circles looks like along the axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Form {
    /// A cylinder, or nearly so.
    Side,
    /// A chamfer or countersink.
    Cone,
    /// A step or shoulder.
    Flat,
}

/// Where the outside of the material lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Facing {
    /// Towards the axis: a hole.
    In,
    /// Away from the axis: a boss.
    Out,
    /// Neither, or both.
    Mixed,
}

/// A ring of faces about an axis.
#[derive(Clone, Debug)]
pub(super) struct Ring {
    pub(super) axis: DVec3,
    pub(super) centre: DVec3,
    pub(super) circles: Vec<Circle>,
    pub(super) form: Form,
    pub(super) facing: Facing,
}

impl Ring {
    /// The largest diameter of its rims.
    pub(super) fn diameter(&self) -> f64 {
        self.circles.iter().map(|c| 2.0 * c.radius).fold(0.0, f64::max)
    }

    /// The largest error of its rims.
    pub(super) fn error(&self) -> f64 {
        self.circles.iter().map(|c| c.error).fold(0.0, f64::max)
    }
}

/// Normals turned by less than this against the plane across the axis belong to a side: 17 degrees.
pub(super) const SIDE: f64 = 0.3;
/// Normals nearer to the axis than this belong to a step: 18 degrees.
const STEP: f64 = 0.95;

/// Unit normals with areas; faces without area are left out.
fn normals(surface: &Surface, faces: &[FaceId]) -> Vec<(DVec3, f64, DVec3)> {
    let of = |&f: &FaceId| {
        let corners = surface.corners(f);
        let vector = area_vector(corners);
        Some((vector.try_normalize()?, vector.length(), centroid(corners)))
    };
    faces.iter().filter_map(of).collect()
}

/// The axis that the normals of a piece of revolution turn about.
fn axis(normals: &[(DVec3, f64, DVec3)]) -> Option<DVec3> {
    let area: f64 = normals.iter().map(|n| n.1).sum();
    if area <= 0.0 {
        return None;
    }
    let mean = normals.iter().map(|&(n, a, _)| a * n).sum::<DVec3>() / area;
    let mut spread = [0.0; 6];
    for &(n, a, _) in normals {
        let [x, y, z] = (n - mean).to_array();
        for (sum, product) in spread.iter_mut().zip([x * x, x * y, x * z, y * y, y * z, z * z]) {
            *sum += a / area * product;
        }
    }
    let [(_, least), _, (largest, _)] = symmetric_eigen(&spread);
    if largest < 0.01 { mean.try_normalize() } else { Some(least) }
}

/// Describes a patch by its rims; `None` without rims or area.
pub(super) fn ring(surface: &Surface, patch: &Patch) -> Option<Ring> {
    described(surface, patch, |axis| patch.rims.iter().map(|rim| circle(surface, rim, axis)).collect())
}

/// Describes a patch by the one circle through all its vertices, whatever its rims are.
pub(super) fn barrel(surface: &Surface, patch: &Patch) -> Option<Ring> {
    let mut vertices: Vec<VertexId> = patch.faces.iter().flat_map(|&f| surface.faces[f]).collect();
    vertices.sort_unstable();
    vertices.dedup();
    described(surface, patch, |axis| vec![circle_of(vertices.iter().map(|&v| surface.points[v]).collect(), axis)])
}

fn described(surface: &Surface, patch: &Patch, circles: impl FnOnce(DVec3) -> Vec<Circle>) -> Option<Ring> {
    let normals = normals(surface, &patch.faces);
    let axis = axis(&normals)?;
    let circles = circles(axis);
    if circles.is_empty() {
        return None;
    }
    let centre = circles.iter().map(|c| c.centre).sum::<DVec3>() / circles.len() as f64;
    let area: f64 = normals.iter().map(|n| n.1).sum();
    let along = normals.iter().map(|&(n, a, _)| a * n.dot(axis).abs()).sum::<f64>() / area;
    let form = if along < SIDE {
        Form::Side
    } else if along > STEP {
        Form::Flat
    } else {
        Form::Cone
    };
    let inward = |n: DVec3, at: DVec3| {
        let out = at - centre;
        -n.dot((out - axis * out.dot(axis)).normalize_or_zero())
    };
    let (mut least, mut most) = (f64::INFINITY, f64::NEG_INFINITY);
    for &(n, _, at) in &normals {
        least = least.min(inward(n, at));
        most = most.max(inward(n, at));
    }
    let facing = match (least, most) {
        (least, _) if least > 0.1 => Facing::In,
        (_, most) if most < -0.1 => Facing::Out,
        _ => Facing::Mixed,
    };
    Some(Ring { axis, centre, circles, form, facing })
}

/// How much nearer to the centre the nearest middle of a rim's edges is than its farthest vertex, as a share of that
/// distance: tells a polygon from a circle, whether or not its sides are divided.
pub(super) fn unroundness(surface: &Surface, rim: &Rim, centre: DVec3, axis: DVec3) -> f64 {
    let at = |i: usize| surface.points[rim.vertices[i % rim.vertices.len()]];
    let aside = |p: DVec3| (p - centre - axis * (p - centre).dot(axis)).length();
    let (mut least, mut most) = (f64::INFINITY, 0.0_f64);
    for i in 0..rim.vertices.len() {
        least = least.min(aside(at(i))).min(aside(0.5 * (at(i) + at(i + 1))));
        most = most.max(aside(at(i)));
    }
    if most > 0.0 { 1.0 - least / most } else { f64::INFINITY }
}

/// The circle nearest to a rim seen along the axis.
pub(super) fn circle(surface: &Surface, rim: &Rim, axis: DVec3) -> Circle {
    circle_of(rim.vertices.iter().map(|&w| surface.points[w]).collect(), axis)
}

/// The circle nearest to points seen along the axis (Kåsa's linear least squares).
fn circle_of(points: Vec<DVec3>, axis: DVec3) -> Circle {
    let (u, v) = axis.any_orthonormal_pair();
    let count = points.len() as f64;
    let mean = points.iter().sum::<DVec3>() / count;
    let flat: Vec<(f64, f64)> = points.iter().map(|&p| ((p - mean).dot(u), (p - mean).dot(v))).collect();
    let (mut uu, mut uv, mut vv, mut ru, mut rv) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for &(x, y) in &flat {
        let squared = x * x + y * y;
        uu += x * x;
        uv += x * y;
        vv += y * y;
        ru += 0.5 * squared * x;
        rv += 0.5 * squared * y;
    }
    let determinant = uu * vv - uv * uv;
    let (a, b) = if determinant > 1e-12 * (uu + vv) * (uu + vv) {
        ((ru * vv - rv * uv) / determinant, (rv * uu - ru * uv) / determinant)
    } else {
        (0.0, 0.0)
    };
    let radius = (a * a + b * b + (uu + vv) / count).sqrt();
    let off = |&(x, y): &(f64, f64)| (libm::hypot(x - a, y - b) - radius).abs();
    let worst = flat.iter().map(off).fold(0.0, f64::max);
    let error = if radius > 0.0 { worst / radius } else { f64::INFINITY };
    Circle { centre: mean + a * u + b * v, radius, error }
}
