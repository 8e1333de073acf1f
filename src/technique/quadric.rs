//! Quadrics: sums of squared distances to planes and lines as one small polynomial, and their minimisers.
//!
//! A quadric is `d(x) = x·A x + 2 b·x + c` (Garland and Heckbert, Surface Simplification Using Quadric Error Metrics,
//! SIGGRAPH 1997). Lines of sharp edges are added as Date et al. do (High-Quality and Property Controlled Finite
//! Element Mesh Generation From Triangular Meshes Using the Multiresolution Technique, JCISE 2005, equations 2 to 4),
//! with the sign that makes `A` of a line the projector `I − d dᵀ` and its constant the squared distance of the origin.
//!
//! Invariants: `d(x) ≥ 0` (tiny negatives from rounding are cut); the trace of a unit-weight plane is 1 and that of a
//! line is twice its weight, so that a mean over planes needs no counter.
//!
//! Departure: planes and lines stay apart, because one weight for both would make the tolerance test depend on it.
//! Coordinates are relative to a local origin that the caller subtracts; far from it the constant would cancel.

use glam::DVec3;

/// Eigenvalues below this part of the largest one count as directions without information: flat parts leave two of
/// them, cylinders one. A patch that turns by 2 degrees has a ratio of about 1e-3.
const RANK_CUT: f64 = 1e-3;

/// A sum of squared distances to planes or lines.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Quadric {
    /// Upper triangle of `A`: xx, xy, xz, yy, yz, zz.
    a: [f64; 6],
    b: DVec3,
    c: f64,
}

impl Quadric {
    /// The squared distance to the plane through `p` with the unit normal `n`.
    pub fn plane(n: DVec3, p: DVec3) -> Self {
        let offset = n.dot(p);
        Self {
            a: [n.x * n.x, n.x * n.y, n.x * n.z, n.y * n.y, n.y * n.z, n.z * n.z],
            b: -offset * n,
            c: offset * offset,
        }
    }

    /// `weight` times the squared distance to the line through `p` with the unit direction `d`.
    pub fn line(d: DVec3, p: DVec3, weight: f64) -> Self {
        let along = d.dot(p);
        let a = [1.0 - d.x * d.x, -d.x * d.y, -d.x * d.z, 1.0 - d.y * d.y, -d.y * d.z, 1.0 - d.z * d.z];
        Self { a: a.map(|x| weight * x), b: weight * (along * d - p), c: weight * (p.length_squared() - along * along) }
    }

    /// Adds another sum.
    pub fn add(&mut self, other: &Self) {
        for (x, y) in self.a.iter_mut().zip(other.a) {
            *x += y;
        }
        self.b += other.b;
        self.c += other.c;
    }

    /// Both sums together.
    #[must_use]
    pub fn plus(mut self, other: &Self) -> Self {
        self.add(other);
        self
    }

    /// `A x`.
    fn times(&self, x: DVec3) -> DVec3 {
        let [xx, xy, xz, yy, yz, zz] = self.a;
        DVec3::new(xx * x.x + xy * x.y + xz * x.z, xy * x.x + yy * x.y + yz * x.z, xz * x.x + yz * x.y + zz * x.z)
    }

    /// The sum of squared distances of `x`, never negative.
    pub fn eval(&self, x: DVec3) -> f64 {
        (x.dot(self.times(x)) + 2.0 * self.b.dot(x) + self.c).max(0.0)
    }

    /// The trace of `A`: the number of planes, or twice the weight of the lines.
    pub fn trace(&self) -> f64 {
        self.a[0] + self.a[3] + self.a[5]
    }

    /// The minimiser that lies nearest to `near`, in the directions that the quadric says something about.
    pub fn optimum(&self, near: DVec3) -> DVec3 {
        let slope = -(self.times(near) + self.b);
        let (values, vectors) = self.eigen();
        let largest = values[0].max(values[1]).max(values[2]);
        let mut x = near;
        if largest > 0.0 {
            for (value, vector) in values.into_iter().zip(vectors) {
                if value > RANK_CUT * largest {
                    x += vector * (vector.dot(slope) / value);
                }
            }
        }
        x
    }

    /// The minimiser on the segment from `p` to `q`, as a parameter from 0 to 1.
    pub fn optimum_on(&self, p: DVec3, q: DVec3) -> f64 {
        let d = q - p;
        let curvature = d.dot(self.times(d));
        let slope = d.dot(self.times(p) + self.b);
        if curvature > 1e-12 * self.trace() * d.length_squared() { (-slope / curvature).clamp(0.0, 1.0) } else { 0.5 }
    }

    /// Eigenvalues and unit eigenvectors of `A`, by cyclic Jacobi rotations.
    fn eigen(&self) -> ([f64; 3], [DVec3; 3]) {
        let [xx, xy, xz, yy, yz, zz] = self.a;
        let mut m = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]];
        let mut v = [DVec3::X, DVec3::Y, DVec3::Z];
        let scale = self.trace().abs();
        // Jacobi converges quadratically; six sweeps are far more than three by three needs.
        for _ in 0..6 {
            if m[0][1].abs() + m[0][2].abs() + m[1][2].abs() <= 1e-14 * scale {
                break;
            }
            for (p, q) in [(0, 1), (0, 2), (1, 2)] {
                rotate(&mut m, &mut v, p, q);
            }
        }
        ([m[0][0], m[1][1], m[2][2]], v)
    }
}

/// One Jacobi rotation, which makes `m[p][q]` zero.
fn rotate(m: &mut [[f64; 3]; 3], v: &mut [DVec3; 3], p: usize, q: usize) {
    let off = m[p][q];
    if off == 0.0 {
        return;
    }
    let theta = (m[q][q] - m[p][p]) / (2.0 * off);
    let sign = if theta >= 0.0 { 1.0 } else { -1.0 };
    let t = sign / (theta.abs() + (theta * theta + 1.0).sqrt());
    let cos = 1.0 / (t * t + 1.0).sqrt();
    let sin = t * cos;
    let r = 3 - p - q;
    let (rp, rq) = (m[r][p], m[r][q]);
    m[p][p] -= t * off;
    m[q][q] += t * off;
    m[p][q] = 0.0;
    m[q][p] = 0.0;
    m[r][p] = cos * rp - sin * rq;
    m[p][r] = m[r][p];
    m[r][q] = sin * rp + cos * rq;
    m[q][r] = m[r][q];
    let (vp, vq) = (v[p], v[q]);
    v[p] = cos * vp - sin * vq;
    v[q] = sin * vp + cos * vq;
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn vector() -> impl Strategy<Value = DVec3> {
        (-1.0..1.0, -1.0..1.0, -1.0..1.0f64).prop_map(|(x, y, z)| DVec3::new(x, y, z))
    }

    fn unit() -> impl Strategy<Value = DVec3> {
        vector().prop_filter("not too short", |v| v.length() > 0.1).prop_map(DVec3::normalize)
    }

    proptest! {
        #[test]
        fn equals_the_distances_added_one_by_one(
            planes in prop::collection::vec((unit(), vector()), 1..8),
            lines in prop::collection::vec((unit(), vector(), 0.0..10.0f64), 0..4),
            x in vector(),
        ) {
            let mut quadric = Quadric::default();
            let mut sum = 0.0;
            for (n, p) in planes {
                quadric.add(&Quadric::plane(n, p));
                sum += n.dot(x - p) * n.dot(x - p);
            }
            for (d, p, w) in lines {
                quadric.add(&Quadric::line(d, p, w));
                sum += w * (x - p).cross(d).length_squared();
            }
            prop_assert!((quadric.eval(x) - sum).abs() < 1e-12 * (1.0 + sum));
        }

        #[test]
        fn nothing_near_the_optimum_is_lower(
            planes in prop::collection::vec((unit(), vector()), 3..8),
            step in vector(),
        ) {
            let mut quadric = Quadric::default();
            for (n, p) in planes {
                quadric.add(&Quadric::plane(n, p));
            }
            let (values, _) = quadric.eigen();
            let least = values.into_iter().fold(f64::INFINITY, f64::min);
            prop_assume!(least > 2.0 * RANK_CUT * quadric.trace());
            let best = quadric.optimum(DVec3::ZERO);
            prop_assert!(quadric.eval(best) <= quadric.eval(best + 1e-3 * step) + 1e-12);
        }
    }

    #[test]
    fn a_flat_quadric_moves_only_along_its_normal() {
        let quadric = Quadric::plane(DVec3::Z, DVec3::ZERO);
        let x = quadric.optimum(DVec3::new(3.0, -2.0, 5.0));
        assert!((x - DVec3::new(3.0, -2.0, 0.0)).length() < 1e-14);
    }

    #[test]
    fn three_planes_meet_in_their_point() {
        let corner = DVec3::new(1.0, 2.0, 3.0);
        let mut quadric = Quadric::plane(DVec3::X, corner);
        quadric.add(&Quadric::plane(DVec3::Y, corner));
        quadric.add(&Quadric::plane(DVec3::Z, corner));
        assert!((quadric.optimum(DVec3::ZERO) - corner).length() < 1e-14);
        assert_eq!(quadric.trace(), 3.0);
    }

    #[test]
    fn the_trace_of_a_line_is_twice_its_weight() {
        let line = Quadric::line(DVec3::new(0.6, 0.8, 0.0), DVec3::ONE, 7.0);
        assert!((line.trace() - 14.0).abs() < 1e-12);
    }
}
