//! Where the vertex of a star gives its faces an aspect ratio of one, in the least squares of Zhang et al. 2009.
//!
//! For each rim edge the distance from its midpoint `c` should be the height `h = √3/2 · l` of the equilateral triangle
//! on it: `|X − c|² = h²`. Of these equations (8 and 9 of the paper) the mean is subtracted, which makes them linear,
//! without the arbitrary one that the paper subtracts (10). The printed signs of the lengths are wrong, and so is the
//! height: `α = √3/2`. The point then is sought on the edge or face that collapses by constrained least squares of `A X
//! = Y`: the paper puts the edge into the solution (12), which is solved already, and which is singular where the rim
//! is flat.

use glam::DVec3;

/// `√3/2`: height over side of the equilateral triangle.
const HEIGHT: f64 = 0.866_025_403_784_438_6;

/// The normal equations of a rim, about the mean of its midpoints.
#[derive(Clone, Copy, Debug, Default)]
pub struct AspectPoint {
    origin: DVec3,
    /// Rows of AᵀA.
    m: [DVec3; 3],
    /// AᵀY.
    w: DVec3,
}

impl AspectPoint {
    /// The equations of rim edges.
    pub fn new(rim: impl Iterator<Item = [DVec3; 2]> + Clone) -> Self {
        let (mut count, mut origin) = (0.0, DVec3::ZERO);
        for [a, b] in rim.clone() {
            origin += 0.5 * (a + b);
            count += 1.0;
        }
        if count == 0.0 {
            return Self::default();
        }
        origin /= count;
        let wanted = |[a, b]: [DVec3; 2]| {
            let c = 0.5 * (a + b) - origin;
            (c, 0.5 * (c.length_squared() - HEIGHT * HEIGHT * (b - a).length_squared()))
        };
        let mean = rim.clone().map(|edge| wanted(edge).1).sum::<f64>() / count;
        let mut this = Self { origin, ..Self::default() };
        for (c, y) in rim.map(wanted) {
            this.m[0] += c.x * c;
            this.m[1] += c.y * c;
            this.m[2] += c.z * c;
            this.w += (y - mean) * c;
        }
        this
    }

    fn times(&self, v: DVec3) -> DVec3 {
        DVec3::new(self.m[0].dot(v), self.m[1].dot(v), self.m[2].dot(v))
    }

    /// The unconstrained solution (12), where the rim determines one.
    pub fn anywhere(&self) -> Option<DVec3> {
        let rows = self.m.map(|row| row.to_array());
        let matrix = nalgebra::Matrix3::from_fn(|i, j| rows[i][j]);
        let solved = nalgebra::Cholesky::new(matrix)?.solve(&nalgebra::Vector3::new(self.w.x, self.w.y, self.w.z));
        let x = DVec3::new(solved[0], solved[1], solved[2]);
        x.is_finite().then_some(self.origin + x)
    }

    /// The least squares on the segment: its parameter, from 0 at `a` to 1 at `b`; the middle where all are equal.
    pub fn on_segment(&self, a: DVec3, b: DVec3) -> f64 {
        let along = b - a;
        let curvature = along.dot(self.times(along));
        if curvature <= 1e-14 * (self.m[0].x + self.m[1].y + self.m[2].z) * along.length_squared() {
            return 0.5;
        }
        (along.dot(self.w - self.times(a - self.origin)) / curvature).clamp(0.0, 1.0)
    }

    /// The least squares on the triangle.
    pub fn on_triangle(&self, [a, b, c]: [DVec3; 3]) -> DVec3 {
        let (u, v) = (b - a, c - a);
        let (mu, mv) = (self.times(u), self.times(v));
        let (uu, uv, vv) = (u.dot(mu), u.dot(mv), v.dot(mv));
        let rest = self.w - self.times(a - self.origin);
        let (ru, rv) = (u.dot(rest), v.dot(rest));
        let determinant = uu * vv - uv * uv;
        if determinant > 1e-12 * uu * vv {
            let (s, t) = ((ru * vv - rv * uv) / determinant, (rv * uu - ru * uv) / determinant);
            if s >= 0.0 && t >= 0.0 && s + t <= 1.0 {
                return a + s * u + t * v;
            }
        }
        let sides = [[a, b], [b, c], [c, a]].map(|[p, q]| p + self.on_segment(p, q) * (q - p));
        let [first, second, third] = sides.map(|p| (self.excess(p), p));
        let best = if second.0 < first.0 { second } else { first };
        if third.0 < best.0 { third.1 } else { best.1 }
    }

    /// `|A X − Y|²` up to a constant.
    fn excess(&self, p: DVec3) -> f64 {
        let x = p - self.origin;
        x.dot(self.times(x)) - 2.0 * x.dot(self.w)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::dvec3;

    /// A closed rim whose edges all see `apex` as the tip of an equilateral triangle, as far as their median tells.
    fn rim(apex: DVec3, bend: f64) -> Vec<[DVec3; 2]> {
        let lengths = [1.0, 1.3, 0.8, 1.1, 0.9, 1.2];
        let edge = |(i, l): (usize, &f64)| {
            let (sin, cos) = libm::sincos(i as f64);
            let out = dvec3(cos, sin, bend * (i % 3) as f64).normalize();
            let along = out.any_orthonormal_vector();
            let middle = apex + HEIGHT * l * out;
            [middle - 0.5 * l * along, middle + 0.5 * l * along]
        };
        lengths.iter().enumerate().map(edge).collect()
    }

    #[test]
    fn an_exact_apex_is_recovered() {
        let apex = dvec3(3.0, -1.0, 2.0);
        let rim = rim(apex, 0.4);
        let point = AspectPoint::new(rim.iter().copied());
        assert!(point.anywhere().unwrap().distance(apex) < 1e-12);
        let (a, b) = (apex - dvec3(0.1, 0.2, 0.1), apex + dvec3(0.3, 0.6, 0.3));
        assert!((point.on_segment(a, b) - 0.25).abs() < 1e-12);
        let corners = [apex - dvec3(0.2, 0.1, 0.0), apex + dvec3(0.3, 0.0, 0.1), apex + dvec3(0.1, 0.3, -0.1)];
        let centre = (corners[0] + corners[1] + corners[2]) / 3.0;
        assert!(point.on_triangle(corners.map(|p| p + apex - centre)).distance(apex) < 1e-12);
    }

    #[test]
    fn a_flat_rim_is_no_obstacle() {
        let apex = dvec3(3.0, -1.0, 2.0);
        let point = AspectPoint::new(rim(apex, 0.0).into_iter());
        let (a, b) = (apex - DVec3::X, apex + DVec3::X);
        assert!((point.on_segment(a, b) - 0.5).abs() < 1e-12);
        assert_eq!(point.on_segment(apex, apex), 0.5);
        // An edge at right angles to the plane: no point of it is better than another.
        assert_eq!(point.on_segment(apex, apex + DVec3::Z), 0.5);
    }

    #[test]
    fn outside_the_triangle_the_best_point_of_its_sides_is_taken() {
        let apex = dvec3(3.0, -1.0, 2.0);
        let point = AspectPoint::new(rim(apex, 0.4).into_iter());
        let corners = [apex + dvec3(1.0, -1.0, 0.0), apex + dvec3(2.0, 0.0, 0.0), apex + dvec3(1.0, 1.0, 0.0)];
        let found = point.on_triangle(corners);
        assert!((found.x - apex.x - 1.0).abs() < 1e-12 && point.excess(found) <= point.excess(corners[0]));
    }
}
