//! The cylinder through a patch.

use glam::DVec3;
use nalgebra::{SMatrix, SVector};

use super::{FLATTEST, FitError, FitQuality, Quadric, Solved, frame, gauss_newton, quality};
use crate::technique::eigen::symmetric_eigen;

/// A circular cylinder without ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cylinder {
    /// The point of the axis nearest to the centroid of what was fitted.
    pub point: DVec3,
    /// Unit direction of the axis.
    pub axis: DVec3,
    /// The radius.
    pub radius: f64,
}

impl Cylinder {
    /// From the axis to a point, at right angles.
    pub(super) fn radial(&self, p: DVec3) -> DVec3 {
        let from = p - self.point;
        from - self.axis * from.dot(self.axis)
    }

    /// The distance of a point, positive outside.
    pub fn distance(&self, p: DVec3) -> f64 {
        self.radial(p).length() - self.radius
    }

    /// The nearest point.
    pub fn project(&self, p: DVec3) -> Option<DVec3> {
        let radial = self.radial(p);
        let n = radial.try_normalize()?;
        Some(p - radial + self.radius * n)
    }
}

/// How many times further the normals must spread across the axis than along it.
const AXIS_RATIO: f64 = 5.0;

/// The least spread of normals, as a share of the greatest: an arc of about 5 degrees.
const LEAST_SPREAD: f64 = 5e-4;

/// Fits a cylinder to points, with the area vectors of the faces between them, which tell the axis.
///
/// # Errors
/// Fewer than six points, normals without an axis, points that lie in a plane or on a line.
pub fn fit_cylinder(points: &[DVec3], area_vectors: &[DVec3]) -> Result<(Cylinder, FitQuality), FitError> {
    const NEED: usize = 6;
    if points.len() < NEED {
        return Err(FitError::TooFewPoints { got: points.len(), need: NEED });
    }
    let (origin, reach) = frame(points)?;
    let axis = axis_of(area_vectors)?;
    let local: Vec<DVec3> = points.iter().map(|&p| (p - origin) / reach).collect();
    let mut cylinder = algebraic(&local, axis)?;
    let solved = refine(&local, &mut cylinder)?;
    if cylinder.radius.is_nan() || cylinder.radius > 2.0 * FLATTEST || cylinder.radius <= 0.0 {
        return Err(FitError::Flat);
    }
    let foot = cylinder.point - cylinder.axis * cylinder.point.dot(cylinder.axis);
    let (point, radius) = (origin + reach * foot, reach * cylinder.radius);
    let cylinder = Cylinder { point, radius, ..cylinder };
    Ok((cylinder, quality(points, &Quadric::Cylinder(cylinder), reach, solved)))
}

/// The cylinder through points along a known axis, a unit vector.
///
/// # Errors
/// Points that lie in a plane along the axis.
pub(super) fn cylinder_along(points: &[DVec3], axis: DVec3) -> Result<Cylinder, FitError> {
    let (origin, reach) = frame(points)?;
    let local: Vec<DVec3> = points.iter().map(|&p| (p - origin) / reach).collect();
    let cylinder = algebraic(&local, axis)?;
    Ok(Cylinder { point: origin + reach * cylinder.point, radius: reach * cylinder.radius, axis })
}

/// The direction that all normals are nearly at right angles to.
fn axis_of(area_vectors: &[DVec3]) -> Result<DVec3, FitError> {
    let mut m = [0.0; 6];
    let mut total = 0.0;
    for vector in area_vectors {
        let area = vector.length();
        if area > 0.0 && area.is_finite() {
            let n = *vector / area;
            for (entry, value) in m.iter_mut().zip([n.x * n.x, n.x * n.y, n.x * n.z, n.y * n.y, n.y * n.z, n.z * n.z]) {
                *entry += area * value;
            }
            total += area;
        }
    }
    if total <= 0.0 {
        return Err(FitError::NoAxis);
    }
    let [(along, axis), (across, _), (most, _)] = symmetric_eigen(&m.map(|x| x / total));
    let is_axis = across > AXIS_RATIO * along.max(0.0) && across > LEAST_SPREAD * most;
    if is_axis { Ok(axis) } else { Err(FitError::NoAxis) }
}

/// The circle through the points seen along the axis.
fn algebraic(points: &[DVec3], axis: DVec3) -> Result<Cylinder, FitError> {
    let (e1, e2) = axis.any_orthonormal_pair();
    let mut normal = SMatrix::<f64, 3, 3>::zeros();
    let mut right = SVector::<f64, 3>::zeros();
    for p in points {
        let (u, v) = (p.dot(e1), p.dot(e2));
        let row = SVector::<f64, 3>::new(u, v, 1.0);
        normal += row * row.transpose();
        right -= row * (u * u + v * v);
    }
    let a = nalgebra::Cholesky::new(normal).ok_or(FitError::Flat)?.solve(&right);
    let point = -0.5 * (a[0] * e1 + a[1] * e2);
    let squared = point.length_squared() - a[2];
    if squared > 0.0 && squared.is_finite() && squared <= (4.0 * FLATTEST).powi(2) {
        Ok(Cylinder { point, axis, radius: squared.sqrt() })
    } else {
        Err(FitError::Flat)
    }
}

/// Unknowns: a shift of the axis in the plane across it, its tilt about the same directions, and the radius.
fn refine(points: &[DVec3], cylinder: &mut Cylinder) -> Result<Solved, FitError> {
    let row = |c: &Cylinder, p: DVec3| {
        let (e1, e2) = c.axis.any_orthonormal_pair();
        let radial = c.radial(p);
        let length = radial.length();
        let n = if length > 0.0 { radial / length } else { e1 };
        let along = (p - c.point).dot(c.axis);
        let (g1, g2) = (n.dot(e1), n.dot(e2));
        (length - c.radius, [-g1, -g2, -along * g1, -along * g2, -1.0])
    };
    gauss_newton(points, cylinder, row, |c, d| {
        let (e1, e2) = c.axis.any_orthonormal_pair();
        c.point += d[0] * e1 + d[1] * e2;
        c.axis = (c.axis + d[2] * e1 + d[3] * e2).normalize();
        c.radius += d[4];
    })
}
