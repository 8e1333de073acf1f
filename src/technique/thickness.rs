//! How thick the walls of a closed part are, looked at from sampled faces.
//!
//! A ray goes inward from the middle of a face to the first face that it meets from inside. Only the middles of up to
//! two thousand faces are asked, evenly over the faces' numbers, each for its area: enough to tell that a part is a
//! sheet, not to find its one thin spot. O(n log n).

use crate::mesh::bvh::{Ray, TriangleBvh};
use crate::mesh::geometry::{centroid, triangle_area, triangle_normal};
use crate::mesh::{FaceId, Surface};

/// Faces that are asked.
const SAMPLES: usize = 2000;

/// Walls thinner than a length.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ThinWalls {
    /// The thinnest that was found.
    pub thinnest: f64,
    /// Their share of the area asked.
    pub share: f64,
}

/// The walls thinner than `length`; `None` where no ray meets one.
pub fn thinner_than(surface: &Surface, length: f64) -> Option<ThinWalls> {
    let tree = TriangleBvh::of_surface(surface);
    let stride = surface.faces.len().div_ceil(SAMPLES).max(1);
    let (mut all, mut thin, mut thinnest) = (0.0, 0.0, f64::INFINITY);
    for face in (0..surface.faces.len()).step_by(stride).map(FaceId::new) {
        let corners = surface.corners(face);
        let Some(normal) = triangle_normal(corners) else { continue };
        let area = triangle_area(corners);
        all += area;
        // The face itself is met from its front, if at all; what is met from behind bounds the wall.
        let hit = tree.first_hit(&Ray { origin: centroid(corners) - 1e-9 * length * normal, direction: -normal });
        if let Some(hit) = hit.filter(|hit| !hit.front && hit.index as usize != face.index() && hit.t < length) {
            thin += area;
            thinnest = thinnest.min(hit.t);
        }
    }
    (thin > 0.0).then(|| ThinWalls { thinnest, share: thin / all })
}

#[cfg(test)]
mod tests {
    use glam::dvec3;

    use super::*;
    use crate::mesh::VertexId;

    /// A box of this height on a unit square.
    fn plate(height: f64) -> Surface {
        let corner = |at: u32| dvec3(f64::from(at & 1), f64::from(at >> 1 & 1), f64::from(at >> 2) * height);
        let faces = [[0, 2, 1], [1, 2, 3], [4, 5, 6], [5, 7, 6], [0, 1, 4], [1, 5, 4], [2, 6, 3], [3, 6, 7], [0, 4, 2]];
        let more = [[2, 4, 6], [1, 3, 5], [3, 7, 5]];
        let faces = faces.into_iter().chain(more).map(|face| face.map(VertexId::from_raw));
        Surface {
            points: (0..8).map(corner).collect::<Vec<_>>().into(),
            faces: faces.collect::<Vec<_>>().into(),
            ..Surface::default()
        }
    }

    #[test]
    fn a_sheet_is_thin_nearly_everywhere_and_a_block_nowhere() {
        let thin = thinner_than(&plate(0.01), 0.02).unwrap();
        assert!((thin.thinnest - 0.01).abs() < 1e-9 && thin.share > 0.9, "{thin:?}");
        assert_eq!(thinner_than(&plate(0.5), 0.02), None);
        // Seen from outside, nothing is a wall.
        let mut inside_out = plate(0.01);
        inside_out.faces.iter_mut().for_each(|face| face.swap(0, 1));
        assert_eq!(thinner_than(&inside_out, 0.02), None);
    }
}
