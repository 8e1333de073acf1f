//! The shape of quads, by the definitions of Verdict.
//!
//! # Source
//! Knupp, Ernst, Thompson, Stimpson, Pébay. The Verdict geometric quality library, Sandia report SAND2007-1751, 2007.
//! Warpage has the sign of VTK 9.1 and later: the cube of the smaller cosine itself, 1 for a planar quad.

use glam::DVec3;
use rayon::prelude::*;

use crate::mesh::{FaceId, Facet, Soup, geometry};

/// Figures of one quad.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct QuadShape {
    /// Least corner area along the centre normal, divided by the product of its two sides.
    pub scaled_jacobian: f64,
    /// Mean corner area along the centre normal.
    pub area: f64,
    /// Longest side.
    pub longest: f64,
    /// Longest side · perimeter / (4 · |area|).
    pub aspect: f64,
    /// Cube of the smaller cosine between opposite corner normals.
    pub warpage: f64,
    /// Largest angle between opposite corner normals, in degrees.
    pub warp_angle: f64,
    /// |Cosine| between the principal axes.
    pub skew: f64,
    /// Length of the cross derivative / shorter principal axis.
    pub taper: f64,
    /// √2 · shortest side / longer diagonal.
    pub stretch: f64,
    /// Least corner angle in degrees.
    pub min_angle: f64,
    /// Largest corner angle in degrees.
    pub max_angle: f64,
}

fn ratio(above: f64, below: f64, otherwise: f64) -> f64 {
    if below > 0.0 { above / below } else { otherwise }
}

/// Measures one quad.
pub fn quad_shape(p: [DVec3; 4]) -> QuadShape {
    let side: [DVec3; 4] = std::array::from_fn(|i| p[(i + 1) % 4] - p[i]);
    let length = side.map(DVec3::length);
    let axes = [p[1] + p[2] - p[0] - p[3], p[2] + p[3] - p[0] - p[1]];
    let cross_derivative = p[0] - p[1] + p[2] - p[3];
    let normal = axes[0].cross(axes[1]).normalize_or_zero();
    let corner_normal: [DVec3; 4] = std::array::from_fn(|i| side[(i + 3) % 4].cross(side[i]));
    let corner_area = corner_normal.map(|n| normal.dot(n));
    let jacobians: [f64; 4] = std::array::from_fn(|i| ratio(corner_area[i], length[(i + 3) % 4] * length[i], 0.0));
    let unit = corner_normal.map(|n| n / n.length().max(f64::MIN_POSITIVE));
    let cosine = unit[0].dot(unit[2]).min(unit[1].dot(unit[3]));
    let angles: [f64; 4] = std::array::from_fn(|i| {
        let angle = geometry::angle(side[i], -side[(i + 3) % 4]).to_degrees();
        if corner_area[i] < 0.0 { 360.0 - angle } else { angle }
    });
    let least = |v: [f64; 4]| v.into_iter().fold(f64::INFINITY, f64::min);
    let most = |v: [f64; 4]| v.into_iter().fold(f64::NEG_INFINITY, f64::max);
    let area = 0.25 * corner_area.iter().sum::<f64>();
    let axis_length = axes.map(DVec3::length);
    let diagonal = (p[2] - p[0]).length().max((p[3] - p[1]).length());
    QuadShape {
        scaled_jacobian: least(jacobians),
        area,
        longest: most(length),
        aspect: ratio(most(length) * length.iter().sum::<f64>(), 4.0 * area.abs(), f64::INFINITY),
        warpage: cosine * cosine * cosine,
        warp_angle: geometry::angle(unit[0], unit[2]).max(geometry::angle(unit[1], unit[3])).to_degrees(),
        skew: ratio(axes[0].dot(axes[1]).abs(), axis_length[0] * axis_length[1], 0.0),
        taper: ratio(cross_derivative.length(), axis_length[0].min(axis_length[1]), f64::INFINITY),
        stretch: ratio(2.0_f64.sqrt() * least(length), diagonal, 0.0),
        min_angle: least(angles),
        max_angle: most(angles),
    }
}

/// Figures of each quad, in order of face id.
#[derive(Clone, Debug, Default)]
pub struct QuadShapes {
    /// Which faces they are.
    pub faces: Vec<FaceId>,
    /// Their figures.
    pub shapes: Vec<QuadShape>,
}

impl QuadShapes {
    /// One figure of all quads.
    pub fn column(&self, figure: impl Fn(&QuadShape) -> f64) -> Vec<f64> {
        self.shapes.iter().map(figure).collect()
    }
}

/// Measures all quads of a mesh.
pub fn quad_shapes(mesh: &Soup) -> QuadShapes {
    let quads: Vec<(FaceId, [DVec3; 4])> = mesh
        .faces
        .enumerate()
        .filter_map(|(id, face)| match face {
            Facet::Quad(corners) => Some((id, corners.map(|v| mesh.points[v]))),
            Facet::Tri(_) => None,
        })
        .collect();
    QuadShapes {
        faces: quads.iter().map(|&(id, _)| id).collect(),
        shapes: quads.par_iter().map(|&(_, corners)| quad_shape(corners)).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::dvec3;

    fn near(left: f64, right: f64) {
        assert!((left - right).abs() < 1e-12, "{left} is not {right}");
    }

    #[test]
    fn the_unit_square_is_perfect() {
        let q = quad_shape([DVec3::ZERO, DVec3::X, dvec3(1.0, 1.0, 0.0), DVec3::Y]);
        for one in [q.scaled_jacobian, q.area, q.aspect, q.warpage, q.stretch] {
            near(one, 1.0);
        }
        for zero in [q.skew, q.taper, q.warp_angle, q.min_angle - 90.0, q.max_angle - 90.0] {
            near(zero, 0.0);
        }
    }

    #[test]
    fn a_rectangle_of_two_to_one() {
        let q = quad_shape([DVec3::ZERO, 2.0 * DVec3::X, dvec3(2.0, 1.0, 0.0), DVec3::Y]);
        near(q.scaled_jacobian, 1.0);
        near(q.aspect, 1.5);
        near(q.stretch, (2.0_f64 / 5.0).sqrt());
        near(q.skew, 0.0);
    }

    #[test]
    fn a_rhombus_of_60_degrees() {
        let (x, y) = (0.5, 0.75_f64.sqrt());
        let q = quad_shape([DVec3::ZERO, DVec3::X, dvec3(1.0 + x, y, 0.0), dvec3(x, y, 0.0)]);
        near(q.scaled_jacobian, 0.75_f64.sqrt());
        near(q.skew, 0.5);
        near(q.min_angle, 60.0);
        near(q.max_angle, 120.0);
    }

    #[test]
    fn a_bow_tie_is_inverted_and_an_arrow_has_a_reflex_corner() {
        let bow = quad_shape([DVec3::ZERO, DVec3::X, DVec3::Y, dvec3(1.0, 1.0, 0.0)]);
        assert!(bow.scaled_jacobian <= 0.0);
        let arrow = quad_shape([DVec3::ZERO, 4.0 * DVec3::X, dvec3(1.0, 1.0, 0.0), 4.0 * DVec3::Y]);
        assert!(arrow.scaled_jacobian < 0.0 && arrow.max_angle > 180.0);
    }

    #[test]
    fn a_folded_quad_is_warped() {
        let q = quad_shape([DVec3::ZERO, DVec3::X, dvec3(1.0, 1.0, 1.0), DVec3::Y]);
        assert!(q.warpage < 0.5 && q.warp_angle > 30.0);
        let point = quad_shape([DVec3::ONE; 4]);
        assert!(point.scaled_jacobian == 0.0 && point.aspect.is_infinite());
    }
}
