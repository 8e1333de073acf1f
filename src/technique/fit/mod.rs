//! Fits of spheres and cylinders to the vertices of a patch: an algebraic start, then Gauss-Newton on the true
//! distance.
//!
//! Every fit reports how far to trust it: residual, extent of the patch, how much of the surface it sees, conditioning,
//! and from these the uncertainty of the radius. A fit that its points do not determine is refused with the reason.
//!
//! Based on: M. Zhang et al.'s trial fits (2009, section 3.4), with the corrections that its equations need: its
//! algebraic distance is about `2R` times the true one and draws small arcs to small radii, and its nine coefficients
//! of a quadric are no cylinder, which has five. The true distances and their derivatives are those of G. Lukács, R.
//! Martin, D. Marshall, Faithful least-squares fitting of spheres, cylinders, cones and tori for reliable segmentation,
//! 1998.
//!
//! Invariants: place and scale of the points change nothing but place and scale of the fit (up to rounding); points on
//! an exact sphere or cylinder give that one within 1e-9 of its radius. Cost: linear in the points, ten rounds at most.

mod cylinder;
pub mod regions;
mod sphere;
#[cfg(test)]
mod tests;

use glam::DVec3;

pub use cylinder::{Cylinder, fit_cylinder};
pub use regions::{FitRegion, fit_regions};
pub use sphere::{Sphere, fit_sphere};

/// Rounds of Gauss-Newton.
const MOST_ROUNDS: usize = 10;

/// A step of this part of the extent ends the rounds.
const CONVERGED: f64 = 1e-13;

/// Radii beyond this many extents are planes.
const FLATTEST: f64 = 100.0;

/// A Jacobian of a worse condition does not determine the fit.
const WORST_CONDITION: f64 = 1e5;

/// How good a fit is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FitQuality {
    /// Points used.
    pub points: usize,
    /// Root mean square of the distances to the fit.
    pub rms: f64,
    /// Largest distance to the fit.
    pub max: f64,
    /// Diameter of the patch: twice the distance of the furthest point from the centroid.
    pub extent: f64,
    /// The largest angle in radians between the fit's normal at a point and the mean one: 0 for a point, π/2 for half
    /// a sphere or cylinder.
    pub opening: f64,
    /// Condition of the Jacobian of the distances, in units of the extent: 1 is best.
    pub condition: f64,
    /// Standard deviation of the radius that the residuals stand for.
    pub radius_deviation: f64,
    /// Rounds of Gauss-Newton.
    pub rounds: usize,
}

/// Why there is no fit.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum FitError {
    /// Fewer points than unknowns need.
    #[error("{got} points do not determine the fit, which needs {need}")]
    TooFewPoints {
        /// As given.
        got: usize,
        /// At least this many.
        need: usize,
    },
    /// A coordinate is no number, or all points coincide.
    #[error("the points have no extent, or are not finite")]
    NoExtent,
    /// The normals do not say where an axis lies: a plane, a sphere, or no directions at all.
    #[error("the normals have no axis: the patch is flat or doubly curved")]
    NoAxis,
    /// The patch is flat as far as its points tell.
    #[error("the patch is flat")]
    Flat,
    /// The points do not determine all unknowns.
    #[error("the points do not determine the fit: the condition is {condition:.0}")]
    IllConditioned {
        /// Of the Jacobian.
        condition: f64,
    },
}

/// What a patch is a part of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Quadric {
    /// A sphere.
    Sphere(Sphere),
    /// A cylinder.
    Cylinder(Cylinder),
}

impl Quadric {
    /// The radius.
    pub fn radius(&self) -> f64 {
        match self {
            Self::Sphere(sphere) => sphere.radius,
            Self::Cylinder(cylinder) => cylinder.radius,
        }
    }

    /// The distance of a point, positive outside.
    pub fn distance(&self, p: DVec3) -> f64 {
        match self {
            Self::Sphere(sphere) => sphere.distance(p),
            Self::Cylinder(cylinder) => cylinder.distance(p),
        }
    }

    /// The nearest point; `None` for centre and axis, which have no nearest one.
    pub fn project(&self, p: DVec3) -> Option<DVec3> {
        match self {
            Self::Sphere(sphere) => sphere.project(p),
            Self::Cylinder(cylinder) => cylinder.project(p),
        }
    }

    /// The outward unit normal at the point nearest to `p`.
    pub fn normal(&self, p: DVec3) -> Option<DVec3> {
        match self {
            Self::Sphere(sphere) => (p - sphere.centre).try_normalize(),
            Self::Cylinder(cylinder) => cylinder.radial(p).try_normalize(),
        }
    }
}

/// The centroid, and the largest distance from it.
fn frame(points: &[DVec3]) -> Result<(DVec3, f64), FitError> {
    let centre = points.iter().sum::<DVec3>() / points.len() as f64;
    let reach = points.iter().map(|p| p.distance_squared(centre)).fold(0.0, f64::max).sqrt();
    if reach > 0.0 && reach.is_finite() { Ok((centre, reach)) } else { Err(FitError::NoExtent) }
}

/// The parts of a quality that both kinds share. `scaled` deviations are those of the fit to points of reach 1.
fn quality(points: &[DVec3], quadric: &Quadric, reach: f64, solved: Solved) -> FitQuality {
    let count = points.len() as f64;
    let (mut sum, mut max) = (0.0, 0.0_f64);
    let mut mean = DVec3::ZERO;
    for &p in points {
        let d = quadric.distance(p);
        sum += d * d;
        max = max.max(d.abs());
        mean += quadric.normal(p).unwrap_or(DVec3::ZERO);
    }
    let widest = points.iter().filter_map(|&p| quadric.normal(p)).map(|n| crate::mesh::geometry::angle(n, mean));
    let spare = (count - solved.unknowns as f64).max(1.0);
    FitQuality {
        points: points.len(),
        rms: (sum / count).sqrt(),
        max,
        extent: 2.0 * reach,
        opening: widest.fold(0.0, f64::max),
        condition: solved.condition,
        radius_deviation: (sum / spare * solved.radius_variance).sqrt(),
        rounds: solved.rounds,
    }
}

/// What the last normal equations say.
#[derive(Clone, Copy, Debug)]
struct Solved {
    unknowns: usize,
    condition: f64,
    /// The entry of the inverse of JᵀJ that belongs to the radius; without a unit, as radius and distances share
    /// theirs.
    radius_variance: f64,
    rounds: usize,
}

/// Gauss-Newton on `N` unknowns, of which the last is the radius: `row` gives the residual of a point and its
/// derivatives, `step` applies a correction.
fn gauss_newton<const N: usize, T>(
    points: &[DVec3],
    start: &mut T,
    row: impl Fn(&T, DVec3) -> (f64, [f64; N]),
    step: impl Fn(&mut T, &[f64; N]),
) -> Result<Solved, FitError> {
    let mut rounds = 0;
    loop {
        let mut normal = nalgebra::SMatrix::<f64, N, N>::zeros();
        let mut right = nalgebra::SVector::<f64, N>::zeros();
        for &p in points {
            let (residual, derivatives) = row(start, p);
            let derivatives = nalgebra::SVector::<f64, N>::from(derivatives);
            normal += derivatives * derivatives.transpose();
            right -= derivatives * residual;
        }
        let ill = FitError::IllConditioned { condition: f64::INFINITY };
        let cholesky = nalgebra::Cholesky::new(normal).ok_or(ill)?;
        let correction = cholesky.solve(&right);
        if !correction.iter().all(|x| x.is_finite()) {
            return Err(ill);
        }
        let size = correction.amax();
        if size <= CONVERGED || rounds == MOST_ROUNDS {
            let inverse = cholesky.inverse();
            // The Frobenius norms bound the spectral ones within the number of unknowns: enough to tell good from bad.
            let condition = (normal.norm() * inverse.norm() / N as f64).sqrt().max(1.0);
            if condition > WORST_CONDITION {
                return Err(FitError::IllConditioned { condition });
            }
            let radius_variance = inverse[(N - 1, N - 1)];
            return Ok(Solved { unknowns: N, condition, radius_variance, rounds });
        }
        rounds += 1;
        step(start, &correction.into());
    }
}
