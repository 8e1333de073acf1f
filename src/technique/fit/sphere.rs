//! The sphere through a patch.

use glam::DVec3;
use nalgebra::{SMatrix, SVector};

use super::{FLATTEST, FitError, FitQuality, Quadric, Solved, frame, gauss_newton, quality};

/// A sphere.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sphere {
    /// Its centre.
    pub centre: DVec3,
    /// Its radius.
    pub radius: f64,
}

impl Sphere {
    /// The distance of a point, positive outside.
    pub fn distance(&self, p: DVec3) -> f64 {
        (p - self.centre).length() - self.radius
    }

    /// The nearest point.
    pub fn project(&self, p: DVec3) -> Option<DVec3> {
        (p - self.centre).try_normalize().map(|n| self.centre + self.radius * n)
    }
}

/// Fits a sphere: equation 18 of the paper as the start, then the true distances.
///
/// # Errors
/// Fewer than five points, or points that lie in a plane or on a curve.
pub fn fit_sphere(points: &[DVec3]) -> Result<(Sphere, FitQuality), FitError> {
    const NEED: usize = 5;
    if points.len() < NEED {
        return Err(FitError::TooFewPoints { got: points.len(), need: NEED });
    }
    let (origin, reach) = frame(points)?;
    let local: Vec<DVec3> = points.iter().map(|&p| (p - origin) / reach).collect();
    let mut sphere = algebraic(&local)?;
    let solved = refine(&local, &mut sphere)?;
    // Half of the greatest radius in units of the reach, because the extent is twice that.
    if sphere.radius.is_nan() || sphere.radius > 2.0 * FLATTEST || sphere.radius <= 0.0 {
        return Err(FitError::Flat);
    }
    let sphere = Sphere { centre: origin + reach * sphere.centre, radius: reach * sphere.radius };
    Ok((sphere, quality(points, &Quadric::Sphere(sphere), reach, solved)))
}

/// `x² + y² + z² + a·p + a₄ = 0` in the least squares of its left side.
fn algebraic(points: &[DVec3]) -> Result<Sphere, FitError> {
    let mut normal = SMatrix::<f64, 4, 4>::zeros();
    let mut right = SVector::<f64, 4>::zeros();
    for p in points {
        let row = SVector::<f64, 4>::new(p.x, p.y, p.z, 1.0);
        normal += row * row.transpose();
        right -= row * p.length_squared();
    }
    let a = nalgebra::Cholesky::new(normal).ok_or(FitError::Flat)?.solve(&right);
    let centre = -0.5 * DVec3::new(a[0], a[1], a[2]);
    let squared = centre.length_squared() - a[3];
    if squared > 0.0 && squared.is_finite() && squared <= (4.0 * FLATTEST).powi(2) {
        Ok(Sphere { centre, radius: squared.sqrt() })
    } else {
        Err(FitError::Flat)
    }
}

fn refine(points: &[DVec3], sphere: &mut Sphere) -> Result<Solved, FitError> {
    let row = |s: &Sphere, p: DVec3| {
        let from = p - s.centre;
        let length = from.length();
        let n = if length > 0.0 { from / length } else { DVec3::X };
        (length - s.radius, [-n.x, -n.y, -n.z, -1.0])
    };
    gauss_newton(points, sphere, row, |s, d| {
        s.centre += DVec3::new(d[0], d[1], d[2]);
        s.radius += d[3];
    })
}
