//! Borders that lie beside each other without being joined: what a larger weld length would close.

use glam::DVec3;

use crate::mesh::bvh::{Primitive, TriangleBvh};
use crate::mesh::topology::EdgeTable;
use crate::mesh::{Surface, VertexId};

/// Borders closer than this share of the shorter edges at them belong together, as far as can be told.
const BESIDE: f64 = 0.01;
/// Told where at least this share of the vertices on borders has a neighbour.
const TELLING: f64 = 0.1;

/// What is said of the borders of a repaired surface that lie beside each other; nothing where few do. Copies of a
/// vertex at the very same place were cut apart on purpose, and do not count. O(n log n).
pub(super) fn beside_each_other(surface: &Surface) -> Option<String> {
    let reach = border_vertices(surface);
    let spots: Vec<[DVec3; 3]> = reach.iter().map(|&(vertex, _)| [surface.points[vertex]; 3]).collect();
    let tree = TriangleBvh::new(spots.clone());
    let (mut near, mut gap) = (0_usize, 0.0_f64);
    for (&(_, shortest), spot) in reach.iter().zip(&spots) {
        let mut closest = f64::INFINITY;
        let _ = tree.for_each_in(&spot.bounds().grown(BESIDE * shortest), |_, other| {
            let distance = other[0].distance(spot[0]);
            if distance > 0.0 && distance <= BESIDE * shortest {
                closest = closest.min(distance);
            }
            std::ops::ControlFlow::Continue(())
        });
        if closest.is_finite() {
            near += 1;
            gap = gap.max(closest);
        }
    }
    (near as f64 >= TELLING * reach.len() as f64 && near > 0).then(|| {
        let (all, weld) = (reach.len(), rounded_up(gap));
        format!("{near} of {all} vertices on borders lie within {weld} of another one; weld = {weld} would join them")
    })
}

/// The vertices on borders, each with its shortest border edge.
fn border_vertices(surface: &Surface) -> Vec<(VertexId, f64)> {
    let edges = EdgeTable::new(surface);
    let mut shortest = vec![f64::INFINITY; surface.points.len()];
    for (_, [a, b], _) in edges.iter().filter(|(_, _, sides)| sides.len() == 1) {
        let length = surface.points[a].distance(surface.points[b]);
        for vertex in [a, b] {
            shortest[vertex.index()] = shortest[vertex.index()].min(length);
        }
    }
    let on_border = shortest.into_iter().enumerate().filter(|(_, length)| length.is_finite());
    on_border.map(|(vertex, length)| (VertexId::new(vertex), length)).collect()
}

/// Two significant digits, and no less than the number.
fn rounded_up(number: f64) -> f64 {
    let exponent = libm::log10(number).floor() as i32 - 1;
    let digits = (number / 10_f64.powi(exponent)).ceil();
    format!("{digits}e{exponent}").parse().unwrap_or(number)
}

#[cfg(test)]
mod tests {
    use glam::dvec3;

    use super::*;
    use crate::mesh::{Facet, Soup};
    use crate::step::Length;
    use crate::steps::repair::{RepairParams, repair};
    use crate::watch::Watch;

    /// A square of two triangles, the second moved away by a gap.
    fn halves(gap: f64) -> Soup {
        let points = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, gap], [1.0 - gap, 1.0], [0.0, 1.0]];
        let face = |corners: [u32; 3]| Facet::Tri(corners.map(VertexId::from_raw));
        Soup {
            points: points.iter().map(|&[x, y]| dvec3(x, y, 0.0)).collect::<Vec<_>>().into(),
            faces: vec![face([0, 1, 2]), face([3, 4, 5])].into(),
            ..Soup::default()
        }
    }

    #[test]
    fn a_gap_below_notice_is_told_with_the_weld_that_closes_it() {
        let params = RepairParams::default();
        let (surface, stats) = repair(&halves(1e-3), &params, &Watch::silent()).unwrap();
        assert_eq!(surface.faces.len(), 2);
        let said = &stats.warnings[0];
        let weld = said.rsplit_once("weld = ").unwrap().1.split(' ').next().unwrap();
        let params = RepairParams { weld: Length::Absolute(weld.parse().unwrap()), ..params };
        let (joined, stats) = repair(&halves(1e-3), &params, &Watch::silent()).unwrap();
        assert_eq!((joined.points.len(), stats.warnings.len()), (4, 0), "{said}");
        let (_, apart) = repair(&halves(0.2), &RepairParams::default(), &Watch::silent()).unwrap();
        assert!(apart.warnings.is_empty());
    }

    #[test]
    fn lengths_are_rounded_up() {
        assert_eq!((rounded_up(0.000_234_1), rounded_up(12.0), rounded_up(0.099_01)), (0.000_24, 12.0, 0.1));
    }
}
