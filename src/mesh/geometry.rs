//! Small pure functions on points, segments and triangles.
//!
//! # Robustness
//! Lengths and areas are plain floating-point formulas; no decision about topology may rest on them (see
//! [`predicate`](super::predicate) for exact decisions). Angles come from `atan2` of cross and dot product, which is
//! accurate at 0 and 180 degrees where an arc cosine is not. The closest point of a triangle decides its region by
//! signed areas and not by products of lengths squared: on a sliver of width w, seen from distance h, the error grows
//! with h/w and not with its square. Triangles without area are treated exactly as their edges.
//!
//! # Source
//! Stretch: H. Date, S. Kanai, T. Kishinami, I. Nishigaki, T. Dohi. High-Quality and Property Controlled Finite Element
//! Mesh Generation From Triangular Meshes using the Multiresolution Technique. JCISE 5(4), 2005, section 3.3.

use glam::DVec3;

/// An axis-aligned box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aabb {
    /// Smallest coordinates.
    pub min: DVec3,
    /// Largest coordinates.
    pub max: DVec3,
}

impl Aabb {
    /// The box that holds nothing.
    pub const EMPTY: Self = Self { min: DVec3::INFINITY, max: DVec3::NEG_INFINITY };

    /// The smallest box of these points.
    pub fn of(points: impl IntoIterator<Item = DVec3>) -> Self {
        points.into_iter().fold(Self::EMPTY, Self::with)
    }

    /// This box, grown to hold `point`.
    #[inline]
    #[must_use]
    pub fn with(self, point: DVec3) -> Self {
        Self { min: self.min.min(point), max: self.max.max(point) }
    }

    /// The smallest box that holds both.
    #[inline]
    #[must_use]
    pub fn union(self, other: Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// The box, grown by `margin` on all sides.
    #[must_use]
    pub fn grown(self, margin: f64) -> Self {
        Self { min: self.min - margin, max: self.max + margin }
    }

    /// Whether it holds nothing.
    pub fn is_empty(&self) -> bool {
        self.min.x > self.max.x
    }

    /// Whether the two closed boxes have a common point.
    #[inline]
    pub fn overlaps(&self, other: &Self) -> bool {
        self.min.cmple(other.max).all() && other.min.cmple(self.max).all()
    }

    /// Whether the point lies in the closed box.
    pub fn contains(&self, point: DVec3) -> bool {
        self.min.cmple(point).all() && point.cmple(self.max).all()
    }

    /// The length of its diagonal; 0 when empty.
    pub fn diagonal(&self) -> f64 {
        if self.is_empty() { 0.0 } else { (self.max - self.min).length() }
    }

    /// Its centre.
    pub fn centre(&self) -> DVec3 {
        0.5 * self.min + 0.5 * self.max
    }

    /// Half its surface.
    #[inline]
    pub fn half_area(&self) -> f64 {
        let d = self.max - self.min;
        d.x * d.y + d.y * d.z + d.z * d.x
    }

    /// The squared distance from `point`; 0 inside.
    ///
    /// Rounding is monotone, so that it never exceeds `(point - q).length_squared()` for a point `q` of the box: a
    /// search that passes over boxes farther than the best found so far loses nothing.
    #[inline]
    pub fn distance_squared(&self, point: DVec3) -> f64 {
        (self.min - point).max(point - self.max).max(DVec3::ZERO).length_squared()
    }
}

/// Twice the area, along the normal of `a b c` seen counter-clockwise.
#[inline]
pub fn area_vector([a, b, c]: [DVec3; 3]) -> DVec3 {
    (b - a).cross(c - a)
}

/// The area of a triangle, by the cross product: Heron's formula cancels on slivers.
#[inline]
pub fn triangle_area(corners: [DVec3; 3]) -> f64 {
    0.5 * area_vector(corners).length()
}

/// The unit normal of a triangle; `None` when it has no area.
///
/// The cross product is taken between the two shortest sides, where the relative rounding error is least.
pub fn triangle_normal([a, b, c]: [DVec3; 3]) -> Option<DVec3> {
    let (ab, bc, ca) = (b - a, c - b, a - c);
    let lengths = [ab.length_squared(), bc.length_squared(), ca.length_squared()];
    let longest = lengths.iter().copied().fold(0.0, f64::max);
    let normal = if lengths[0] == longest {
        bc.cross(ca)
    } else if lengths[1] == longest {
        ca.cross(ab)
    } else {
        ab.cross(bc)
    };
    // Scale first: the square of a small area may underflow.
    let scale = normal.abs().max_element();
    (scale > 0.0 && scale.is_finite()).then(|| (normal / scale).normalize())
}

/// The lengths of the sides: `bc`, `ca`, `ab`, each opposite to the corner of the same place.
#[inline]
pub fn side_lengths([a, b, c]: [DVec3; 3]) -> [f64; 3] {
    [(c - b).length(), (a - c).length(), (b - a).length()]
}

/// The size of a triangle: its longest side.
#[inline]
pub fn triangle_size(corners: [DVec3; 3]) -> f64 {
    let [a, b, c] = side_lengths(corners);
    a.max(b).max(c)
}

/// The triangle moved to the origin and scaled by a power of two, where squares and products of its sides would leave
/// the range of floats; `None` elsewhere. What does not depend on place and size is the same of it.
pub fn rescaled([a, b, c]: [DVec3; 3]) -> Option<[DVec3; 3]> {
    let (u, v) = (b - a, c - a);
    let most = u.abs().max(v.abs()).max_element();
    if most == 0.0 || !most.is_finite() || (1e-70..1e70).contains(&most) {
        return None;
    }
    // In two steps, since the power itself may be out of range.
    let half = libm::exp2(-libm::floor(0.5 * libm::log2(most)));
    Some([DVec3::ZERO, u * half * half, v * half * half])
}

/// Stretch: √12 · inradius / longest side; 1 for the equilateral triangle, 0 without area.
#[inline]
pub fn stretch(corners: [DVec3; 3]) -> f64 {
    let [a, b, c] = side_lengths(corners);
    let longest = a.max(b).max(c);
    let s = (a + b + c) / 2.0;
    let area = triangle_area(corners);
    // Beyond these its square, of which it is the root, has lost digits.
    if !(1e-140..1e140).contains(&area)
        && let Some(scaled) = rescaled(corners)
    {
        return stretch(scaled);
    }
    if s > 0.0 { 12.0_f64.sqrt() * (area / s) / longest } else { 0.0 }
}

/// The aspect ratio (√3/2) · longest side / height on it; 1 for the equilateral triangle, infinite without area.
#[inline]
pub fn aspect_ratio(corners: [DVec3; 3]) -> f64 {
    let longest = triangle_size(corners);
    let height = if longest > 0.0 { 2.0 * triangle_area(corners) / longest } else { 0.0 };
    if height > 0.0 { 3.0_f64.sqrt() / 2.0 * longest / height } else { f64::INFINITY }
}

/// The angle between two vectors in radians, from 0 to π; 0 where one is zero.
#[inline]
pub fn angle(u: DVec3, v: DVec3) -> f64 {
    // Adding zero turns a negative zero, as of a side without length, into zero.
    libm::atan2(u.cross(v).length(), u.dot(v) + 0.0)
}

/// The angles at the three corners in radians.
pub fn triangle_angles([a, b, c]: [DVec3; 3]) -> [f64; 3] {
    [angle(b - a, c - a), angle(c - b, a - b), angle(a - c, b - c)]
}

/// The centroid of a triangle.
#[inline]
pub fn centroid([a, b, c]: [DVec3; 3]) -> DVec3 {
    (a + b + c) / 3.0
}

/// A point of a primitive nearest to a query.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nearest {
    /// The point.
    pub point: DVec3,
    /// Its barycentric coordinates: not negative, of sum 1; the last is 0 on a segment.
    pub weights: [f64; 3],
    /// The squared distance from the query.
    pub distance_squared: f64,
}

/// The point of segment `a b` nearest to `p`. It lies in the segment's box, also after rounding: see
/// [`Aabb::distance_squared`].
#[inline]
pub fn closest_on_segment(p: DVec3, [a, b]: [DVec3; 2]) -> Nearest {
    let d = b - a;
    let squared = d.length_squared();
    let t = if squared > 0.0 { ((p - a).dot(d) / squared).clamp(0.0, 1.0) } else { 0.0 };
    let point = if t == 1.0 { b } else { (a + t * d).max(a.min(b)).min(a.max(b)) };
    Nearest { point, weights: [1.0 - t, t, 0.0], distance_squared: (p - point).length_squared() }
}

/// Triangles thinner than this, relative to their longest side, are treated as their edges. Far below the spacing of
/// coordinates that came from single precision, so that only triangles without area fall under it.
const THIN: f64 = 1e-13;

/// The point of the closed triangle nearest to `p`.
///
/// Where `p` lies over the triangle it is the foot on its plane; else it lies on an edge that `p` sees from outside. It
/// lies in the triangle's box, also after rounding: see [`Aabb::distance_squared`].
#[inline]
pub fn closest_on_triangle(p: DVec3, [a, b, c]: [DVec3; 3]) -> Nearest {
    let (ab, ac, ap) = (b - a, c - a, p - a);
    let normal = ab.cross(ac);
    let squared = normal.length_squared();
    let size = ab.length_squared().max(ac.length_squared());
    let thin = squared <= (THIN * THIN) * size * size;
    let v = ap.cross(ac).dot(normal);
    let w = ab.cross(ap).dot(normal);
    let u = squared - v - w;
    if !thin && u >= 0.0 && v >= 0.0 && w >= 0.0 {
        let (v, w) = (v / squared, w / squared);
        let point = (a + (v * ab + w * ac)).max(a.min(b).min(c)).min(a.max(b).max(c));
        let weights = [(1.0 - v - w).max(0.0), v, w];
        return Nearest { point, weights, distance_squared: (p - point).length_squared() };
    }
    let mut best = Nearest { point: a, weights: [1.0, 0.0, 0.0], distance_squared: f64::INFINITY };
    let mut consider = |near: Nearest, place: [usize; 2]| {
        if near.distance_squared < best.distance_squared {
            let mut weights = [0.0; 3];
            weights[place[0]] = near.weights[0];
            weights[place[1]] = near.weights[1];
            best = Nearest { weights, ..near };
        }
    };
    if thin || w < 0.0 {
        consider(closest_on_segment(p, [a, b]), [0, 1]);
    }
    if thin || u < 0.0 {
        consider(closest_on_segment(p, [b, c]), [1, 2]);
    }
    if thin || v < 0.0 {
        consider(closest_on_segment(p, [c, a]), [2, 0]);
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::dvec3;

    fn near(left: f64, right: f64) {
        assert!((left - right).abs() <= 1e-12 * right.abs().max(1.0), "{left} is not {right}");
    }

    const RIGHT: [DVec3; 3] = [DVec3::ZERO, DVec3::new(3.0, 0.0, 0.0), DVec3::new(0.0, 4.0, 0.0)];

    #[test]
    fn shape_does_not_depend_on_size() {
        for scale in [1e-300, 1e-150, 1e-80, 1e80, 1e160, 1e300] {
            let corners = RIGHT.map(|p| scale * p);
            near(stretch(corners), stretch(RIGHT));
            let scaled = rescaled(corners).expect("it is out of range");
            assert!(scaled.iter().all(|p| p.abs().max_element() < 8.0));
            near(aspect_ratio(scaled), aspect_ratio(RIGHT));
        }
        assert_eq!(rescaled(RIGHT), None);
    }

    #[test]
    fn a_3_4_5_triangle_has_known_figures() {
        near(triangle_area(RIGHT), 6.0);
        near(stretch(RIGHT), 12.0_f64.sqrt() / 5.0);
        near(aspect_ratio(RIGHT), 3.0_f64.sqrt() / 2.0 * 5.0 / 2.4);
        near(triangle_angles(RIGHT).iter().sum::<f64>(), std::f64::consts::PI);
        assert_eq!(triangle_normal(RIGHT), Some(DVec3::Z));
    }

    #[test]
    fn the_equilateral_triangle_has_stretch_and_aspect_ratio_one() {
        let t = [DVec3::X, DVec3::Y, DVec3::Z];
        near(stretch(t), 1.0);
        near(aspect_ratio(t), 1.0);
    }

    #[test]
    fn a_triangle_without_area_has_stretch_zero_and_no_normal() {
        let t = [DVec3::ZERO, DVec3::X, 2.0 * DVec3::X];
        assert_eq!(stretch(t), 0.0);
        assert_eq!(aspect_ratio(t), f64::INFINITY);
        assert_eq!(triangle_normal(t), None);
        assert_eq!(stretch([DVec3::ONE; 3]), 0.0);
    }

    #[test]
    fn needles_and_caps_follow_their_asymptotics() {
        let theta: f64 = 1e-3;
        let needle = [DVec3::ZERO, DVec3::X, dvec3(libm::cos(theta), libm::sin(theta), 0.0)];
        assert!((stretch(needle) / (3.0_f64.sqrt() * theta) - 1.0).abs() < 1e-3);
        let cap = [DVec3::ZERO, DVec3::X, dvec3(0.5, 1e-4, 0.0)];
        assert!((stretch(cap) / (3.0_f64.sqrt() * 1e-4) - 1.0).abs() < 1e-3);
    }

    #[test]
    fn the_closest_point_falls_in_face_edge_or_corner() {
        let face = closest_on_triangle(dvec3(1.0, 1.0, 2.0), RIGHT);
        assert!((face.point - dvec3(1.0, 1.0, 0.0)).length() < 1e-15);
        near(face.distance_squared, 4.0);
        let edge = closest_on_triangle(dvec3(1.0, -1.0, 0.0), RIGHT);
        assert!((edge.point - dvec3(1.0, 0.0, 0.0)).length() < 1e-15);
        let corner = closest_on_triangle(dvec3(5.0, -1.0, 0.0), RIGHT);
        assert_eq!((corner.point, corner.weights), (RIGHT[1], [0.0, 1.0, 0.0]));
    }

    #[test]
    fn a_flat_triangle_is_its_edges() {
        let flat = [DVec3::ZERO, DVec3::X, 3.0 * DVec3::X];
        let near_end = closest_on_triangle(dvec3(2.0, 1.0, 0.0), flat);
        assert_eq!(near_end.point, dvec3(2.0, 0.0, 0.0));
        near(near_end.distance_squared, 1.0);
        near(near_end.weights.iter().sum(), 1.0);
        assert_eq!(closest_on_triangle(DVec3::X, [DVec3::ZERO; 3]).distance_squared, 1.0);
    }

    #[test]
    fn boxes_measure_distance_and_overlap() {
        let cube = Aabb::of([DVec3::ZERO, DVec3::ONE]);
        assert_eq!(cube.distance_squared(dvec3(2.0, 0.5, -1.0)), 2.0);
        assert!(cube.overlaps(&Aabb::of([DVec3::ONE, 2.0 * DVec3::ONE])));
        assert!(!cube.overlaps(&Aabb::EMPTY));
        near(cube.diagonal(), 3.0_f64.sqrt());
        assert_eq!(Aabb::EMPTY.diagonal(), 0.0);
    }
}
