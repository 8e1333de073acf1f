//! Vertex dispersion: how far the faces round a vertex turn away from its normal.
//!
//! Zhang et al. 2009, equations 1 to 6. Printed is the standard deviation of the angles between the vertex normal and
//! the normals of its faces. That is zero on a straight crease and on the corner of a cube, where all angles are
//! equal: the feature is missed where it is cleanest. So the root mean square is the default: zero on a plane, 45
//! degrees on a crease of 90, 54.7 on the corner of a cube.
//! Cost: O(valence), without allocation.

use glam::DVec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use smallvec::SmallVec;

use crate::mesh::VertexId;
use crate::mesh::geometry::{angle, area_vector};
use crate::mesh::halfedge::HalfedgeMesh;

/// Which mean of the angles is meant.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Dispersion {
    /// The root mean square of the angles: zero only on planes.
    #[default]
    Rms,
    /// The standard deviation of the angles, as printed: zero also on straight creases and even corners.
    Std,
}

/// The dispersion in radians of faces with these area vectors; a right angle where they have no common direction.
pub fn dispersion(area_vectors: &[DVec3], kind: Dispersion) -> f64 {
    let sum: DVec3 = area_vectors.iter().sum();
    let total: f64 = area_vectors.iter().map(|n| n.length()).sum();
    // NaN must land here too.
    if total.is_nan() || sum.length() <= 1e-12 * total {
        return if total == 0.0 { 0.0 } else { std::f64::consts::FRAC_PI_2 };
    }
    let (mut count, mut mean, mut squares) = (0.0, 0.0, 0.0);
    for n in area_vectors.iter().filter(|n| n.length_squared() > 0.0) {
        let theta = angle(sum, *n);
        count += 1.0;
        mean += theta;
        squares += theta * theta;
    }
    mean /= count;
    match kind {
        Dispersion::Rms => (squares / count).sqrt(),
        Dispersion::Std => (squares / count - mean * mean).max(0.0).sqrt(),
    }
}

/// The dispersion of a vertex of the workshop.
pub fn vertex_dispersion(mesh: &HalfedgeMesh, v: VertexId, kind: Dispersion) -> f64 {
    let vectors: SmallVec<[DVec3; 16]> = mesh.faces_around(v).map(|f| area_vector(mesh.corner_points(f))).collect();
    dispersion(&vectors, kind)
}

/// Equation 6: the shortest side as the queue sees it, longer where the surface turns: `exp(k_m · A) · shortest`.
pub fn amended_length(shortest: f64, dispersion: f64, k_m: f64) -> f64 {
    libm::exp(k_m * dispersion) * shortest
}

#[cfg(test)]
mod tests {
    use super::*;

    fn degrees(vectors: &[DVec3], kind: Dispersion) -> f64 {
        dispersion(vectors, kind).to_degrees()
    }

    #[test]
    fn a_plane_has_none() {
        for kind in [Dispersion::Rms, Dispersion::Std] {
            assert_eq!(degrees(&[DVec3::Z, 3.0 * DVec3::Z, 0.5 * DVec3::Z], kind), 0.0);
        }
    }

    #[test]
    fn a_right_angled_edge_has_half_of_it_or_by_the_printed_formula_none() {
        let edge = [DVec3::Z, DVec3::Z, DVec3::X, DVec3::X];
        assert!((degrees(&edge, Dispersion::Rms) - 45.0).abs() < 1e-12);
        assert!(degrees(&edge, Dispersion::Std) < 1e-5);
    }

    #[test]
    fn the_corner_of_a_cube_is_the_angle_of_its_diagonal() {
        let corner = [DVec3::X, DVec3::Y, DVec3::Z];
        let expected = libm::acos(1.0 / 3.0_f64.sqrt()).to_degrees();
        assert!((degrees(&corner, Dispersion::Rms) - expected).abs() < 1e-12);
        assert!(degrees(&corner, Dispersion::Std) < 1e-5);
    }

    #[test]
    fn faces_that_cancel_are_a_right_angle_and_none_at_all_are_flat() {
        assert_eq!(degrees(&[DVec3::Z, -DVec3::Z], Dispersion::Rms), 90.0);
        assert_eq!(degrees(&[DVec3::ZERO], Dispersion::Rms), 0.0);
    }

    #[test]
    fn a_crease_counts_as_more_than_twice_as_long() {
        assert!((amended_length(1.0, 45.0_f64.to_radians(), 1.0) - 2.193).abs() < 1e-3);
        assert_eq!(amended_length(1.0, 1.0, 0.0), 1.0);
    }
}
