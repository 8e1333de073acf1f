//! The shape of triangles: stretch, size, aspect ratio and angles of each.

use glam::DVec3;
use rayon::prelude::*;

use crate::mesh::geometry;
use crate::mesh::{FaceId, Facet, Soup};

/// Figures of each triangle, in order of face id.
#[derive(Clone, Debug, Default)]
pub struct TriangleShapes {
    /// Which faces they are.
    pub faces: Vec<FaceId>,
    /// √12 · inradius / longest side.
    pub stretch: Vec<f64>,
    /// Longest side.
    pub size: Vec<f64>,
    /// Shortest side.
    pub shortest: Vec<f64>,
    /// Sum of the three sides.
    pub perimeter: Vec<f64>,
    /// (√3/2) · longest side / height on it; infinite without area.
    pub aspect: Vec<f64>,
    /// Least angle in degrees.
    pub min_angle: Vec<f64>,
    /// Largest angle in degrees.
    pub max_angle: Vec<f64>,
    /// Height on the longest side / longest side; 0 without area.
    pub flatness: Vec<f64>,
}

struct Figures {
    sides: [f64; 3],
    stretch: f64,
    aspect: f64,
    angles: [f64; 3],
    flatness: f64,
}

fn figures(own: [DVec3; 3]) -> Figures {
    let corners = geometry::rescaled(own).unwrap_or(own);
    let size = geometry::triangle_size(corners);
    let area = geometry::triangle_area(corners);
    Figures {
        sides: geometry::side_lengths(own),
        stretch: geometry::stretch(corners),
        aspect: geometry::aspect_ratio(corners),
        angles: geometry::triangle_angles(corners).map(f64::to_degrees),
        flatness: if size > 0.0 { 2.0 * area / size / size } else { 0.0 },
    }
}

/// Measures all triangles of a mesh.
pub fn triangle_shapes(mesh: &Soup) -> TriangleShapes {
    let triangles: Vec<(FaceId, [DVec3; 3])> = mesh
        .faces
        .enumerate()
        .filter_map(|(id, face)| match face {
            Facet::Tri(corners) => Some((id, corners.map(|v| mesh.points[v]))),
            Facet::Quad(_) => None,
        })
        .collect();
    let all: Vec<Figures> = triangles.par_iter().map(|&(_, corners)| figures(corners)).collect();
    let least = |v: [f64; 3]| v[0].min(v[1]).min(v[2]);
    let most = |v: [f64; 3]| v[0].max(v[1]).max(v[2]);
    TriangleShapes {
        faces: triangles.iter().map(|&(id, _)| id).collect(),
        stretch: all.iter().map(|f| f.stretch).collect(),
        size: all.iter().map(|f| most(f.sides)).collect(),
        shortest: all.iter().map(|f| least(f.sides)).collect(),
        perimeter: all.iter().map(|f| f.sides.iter().sum()).collect(),
        aspect: all.iter().map(|f| f.aspect).collect(),
        min_angle: all.iter().map(|f| least(f.angles)).collect(),
        max_angle: all.iter().map(|f| most(f.angles)).collect(),
        flatness: all.iter().map(|f| f.flatness).collect(),
    }
}

/// The largest stretch that a triangle with an angle of `theta` radians, at most 60 degrees, can have: that of the
/// isosceles one, √3 · sin θ / (1 + sin θ/2).
pub fn best_stretch_with_angle(theta: f64) -> f64 {
    3.0_f64.sqrt() * libm::sin(theta) / (1.0 + libm::sin(theta / 2.0))
}

/// The angle in radians below which no triangle reaches the stretch `threshold`: 7.08 degrees for 0.2.
pub fn angle_of_stretch(threshold: f64) -> f64 {
    let (mut low, mut high) = (0.0, std::f64::consts::FRAC_PI_3);
    // The best stretch grows with the angle; 60 halvings use up the digits.
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if best_stretch_with_angle(middle) < threshold { low = middle } else { high = middle }
    }
    high
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_angle_of_stretch_is_that_of_the_isosceles_triangle() {
        assert!((angle_of_stretch(0.2).to_degrees() - 7.08).abs() < 0.05);
        assert!((best_stretch_with_angle(std::f64::consts::FRAC_PI_3) - 1.0).abs() < 1e-12);
        let theta = angle_of_stretch(0.3);
        let corners = [DVec3::ZERO, DVec3::X, DVec3::new(libm::cos(theta), libm::sin(theta), 0.0)];
        assert!((geometry::stretch(corners) - 0.3).abs() < 1e-12);
    }
}
