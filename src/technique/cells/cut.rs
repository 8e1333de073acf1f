//! Boxes of nearly as many vertices each, cut in two again and again along their longest side.

use glam::DVec3;

use crate::mesh::geometry::Aabb;
use crate::mesh::id::Face;
use crate::mesh::{FaceId, IdVec, Surface, VertexId};

/// No cell.
const NONE: u32 = u32::MAX;

/// Which cell each vertex lies in, and which faces may change there.
#[derive(Debug)]
pub(super) struct Cutting {
    /// The boxes of the cells' vertices. No two of them have a common point.
    pub(super) boxes: Vec<Aabb>,
    /// The cell of each vertex.
    of: Vec<u32>,
    /// The cell that a face lies in with all its corners.
    inside: IdVec<Face, u32>,
    /// Whether a face at the vertex lies in no cell.
    is_still: Vec<bool>,
    /// The faces that lie in no cell, in order.
    pub(super) still: Vec<FaceId>,
}

impl Cutting {
    /// Cells of at most `most` vertices where points differ; of two halves the lower one has about `share` of them.
    pub(super) fn new(surface: &Surface, most: usize, share: f64) -> Self {
        let points = surface.points.as_slice();
        let mut of = vec![0_u32; points.len()];
        let mut boxes = Vec::new();
        let mut waiting: Vec<Vec<u32>> = vec![(0..points.len() as u32).collect()];
        while let Some(ids) = waiting.pop() {
            let bounds = Aabb::of(ids.iter().map(|&v| points[v as usize]));
            let halves = if ids.len() > most { halves(points, &ids, bounds, share) } else { None };
            if let Some([lower, upper]) = halves {
                // The lower one is looked at first: cells that follow each other are neighbours.
                waiting.extend([upper, lower]);
                continue;
            }
            for v in ids {
                of[v as usize] = boxes.len() as u32;
            }
            boxes.push(bounds);
        }
        let cell_of = |&[a, b, c]: &[VertexId; 3]| {
            let [a, b, c] = [a, b, c].map(|v| of[v.index()]);
            if a == b && b == c { a } else { NONE }
        };
        let inside: IdVec<Face, u32> = surface.faces.iter().map(cell_of).collect();
        let still: Vec<FaceId> = inside.ids().filter(|&f| inside[f] == NONE).collect();
        let mut is_still = vec![false; points.len()];
        for v in still.iter().flat_map(|&f| surface.faces[f]) {
            is_still[v.index()] = true;
        }
        Self { boxes, of, inside, is_still, still }
    }

    /// The number of cells.
    pub(super) fn len(&self) -> usize {
        self.boxes.len()
    }

    /// The cell of a vertex.
    pub(super) fn cell(&self, v: VertexId) -> usize {
        self.of[v.index()] as usize
    }

    /// The cell in which a face may change.
    pub(super) fn inside(&self, f: FaceId) -> Option<usize> {
        let cell = self.inside[f];
        (cell != NONE).then_some(cell as usize)
    }

    /// Whether a vertex stays, as a face at it does.
    pub(super) fn is_still(&self, v: VertexId) -> bool {
        self.is_still[v.index()]
    }
}

/// Two halves on both sides of a plane with points on one side only, across the longest side that allows it.
fn halves(points: &[DVec3], ids: &[u32], bounds: Aabb, share: f64) -> Option<[Vec<u32>; 2]> {
    let extent = bounds.max - bounds.min;
    let mut axes = [0, 1, 2];
    axes.sort_by(|&a, &b| extent[b].total_cmp(&extent[a]));
    axes.into_iter().find_map(|axis| {
        let at = |v: &u32| points[*v as usize][axis];
        let mut along: Vec<f64> = ids.iter().map(at).collect();
        let place = (share * along.len() as f64) as usize;
        let (_, &mut middle, _) = along.select_nth_unstable_by(place, f64::total_cmp);
        let split = |is_low: &dyn Fn(&u32) -> bool| -> [Vec<u32>; 2] {
            ids.iter().partition::<Vec<u32>, _>(|v| is_low(v)).into()
        };
        let below = split(&|v| at(v) < middle);
        let parts = if below[0].is_empty() { split(&|v| at(v) <= middle) } else { below };
        parts.iter().all(|part| !part.is_empty()).then_some(parts)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boxes_have_no_common_point_even_where_coordinates_repeat() {
        // A grid of three columns, where every coordinate occurs many times, and many equal points.
        let mut surface = Surface::default();
        for i in 0..300 {
            surface.points.push(DVec3::new(f64::from(i % 3), f64::from(i / 30), f64::from(i % 2)));
        }
        for k in 0..298 {
            surface.faces.push([k, k + 1, k + 2].map(VertexId::new));
        }
        for share in [0.5, 0.38] {
            let cutting = Cutting::new(&surface, 20, share);
            assert!(cutting.len() > 10);
            for (i, a) in cutting.boxes.iter().enumerate() {
                assert!(cutting.boxes[..i].iter().all(|b| !a.overlaps(b)), "box {i}");
            }
            for (v, p) in surface.points.enumerate() {
                assert!(cutting.boxes[cutting.cell(v)].contains(*p));
            }
            for (f, corners) in surface.faces.enumerate() {
                let cells = corners.map(|v| cutting.cell(v));
                assert_eq!(cutting.inside(f).is_some(), cells.iter().all(|&c| c == cells[0]));
                assert!(cutting.inside(f).is_some() || corners.iter().all(|&v| cutting.is_still(v)));
            }
        }
    }
}
