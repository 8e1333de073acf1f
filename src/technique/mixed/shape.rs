//! How good a face is while it is being made.
//!
//! Everything is a sine or a cosine of corner angles: 1 is best, 0 is flat, below 0 is turned inside out.

use glam::DVec3;

use super::Mixed;
use crate::mesh::geometry::angle;

/// The sine of the corner at `b` between `a` and `c`, seen from `normal`: the corner's scaled Jacobian.
#[inline]
pub fn corner_sine(a: DVec3, b: DVec3, c: DVec3, normal: DVec3) -> f64 {
    let (u, w) = (c - b, a - b);
    let lengths = (u.length_squared() * w.length_squared()).sqrt();
    if lengths > 0.0 { normal.dot(u.cross(w)) / lengths } else { 0.0 }
}

/// The scaled Jacobian of a quad: least corner sine along its centre normal.
#[inline]
pub fn quad_quality(p: [DVec3; 4]) -> f64 {
    let sides = [p[1] - p[0], p[2] - p[1], p[3] - p[2], p[0] - p[3]];
    let normal = (sides[0] - sides[2]).cross(sides[1] - sides[3]);
    let length = normal.length();
    if length <= 0.0 {
        return 0.0;
    }
    let squares = sides.map(DVec3::length_squared);
    let mut least = f64::INFINITY;
    for i in 0..4 {
        let before = (i + 3) % 4;
        let lengths = (squares[before] * squares[i]).sqrt();
        let sine = if lengths > 0.0 { normal.dot(sides[before].cross(sides[i])) / (lengths * length) } else { 0.0 };
        least = least.min(sine);
    }
    least
}

/// By how much a quad is folded: the larger angle between the normals of opposite corners, in radians.
pub fn warp(p: [DVec3; 4]) -> f64 {
    let normal = |i: usize| (p[(i + 1) % 4] - p[i]).cross(p[(i + 3) % 4] - p[i]);
    angle(normal(0), normal(2)).max(angle(normal(1), normal(3)))
}

/// The quality of a triangle: twice its area over its longest sides, 1 for the equilateral one.
#[inline]
pub fn triangle_quality([a, b, c]: [DVec3; 3]) -> f64 {
    let sum = (b - a).length_squared() + (c - b).length_squared() + (a - c).length_squared();
    let area = (b - a).cross(c - a).length();
    if sum > 0.0 { 2.0 * 3.0_f64.sqrt() * area / sum } else { 0.0 }
}

impl Mixed {
    /// The scaled Jacobian of a quad, or the quality of a triangle.
    pub fn quality(&self, f: u32) -> f64 {
        let h = self.first(f);
        let (h1, h2) = (self.next(h), self.next(self.next(h)));
        let h3 = self.next(h2);
        let p = [h, h1, h2].map(|k| self.point(self.origin(k)));
        if h3 == h { triangle_quality(p) } else { quad_quality([p[0], p[1], p[2], self.point(self.origin(h3))]) }
    }

    /// The unit normal of a face at its middle; zero where it has none.
    pub fn face_normal(&self, f: u32) -> DVec3 {
        let h = self.first(f);
        let p = [h, self.next(h), self.next(self.next(h)), self.prev(h)].map(|k| self.point(self.origin(k)));
        (p[2] - p[0]).cross(if p[2] == p[3] { p[2] - p[1] } else { p[3] - p[1] }).normalize_or_zero()
    }

    /// The middle of a face's corners.
    pub fn centre(&self, f: u32) -> DVec3 {
        let (mut sum, mut n) = (DVec3::ZERO, 0.0);
        for h in self.sides(f) {
            sum += self.point(self.origin(h));
            n += 1.0;
        }
        sum / n
    }

    /// The least quality of the faces at `v`.
    pub fn star_quality(&self, v: u32) -> f64 {
        self.faces_at(v).map(|f| self.quality(f)).fold(f64::INFINITY, f64::min)
    }

    /// The angle of the corner at the start of `h` in the face of `h`, in radians.
    pub fn corner_angle(&self, h: u32) -> f64 {
        let at = self.point(self.origin(h));
        let to = self.point(self.target(h));
        let from = self.point(self.origin(self.prev(h)));
        angle(to - at, from - at)
    }
}
