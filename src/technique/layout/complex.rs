//! A complex without the mesh that it lies on, so that the mesh can be made finer below it.

use rustc_hash::FxHashSet;

use super::{Ground, Layout};
use crate::mesh::id::{Face, Vertex};
use crate::mesh::{FaceId, IdVec, VertexId};

/// The cells and nodes of a [`Layout`].
#[derive(Clone, Debug, PartialEq)]
pub struct Complex {
    cell: IdVec<Face, u32>,
    count: usize,
    node: IdVec<Vertex, bool>,
    fixed: IdVec<Vertex, bool>,
}

impl Complex {
    /// The complex on a mesh.
    pub fn on<'g>(self, ground: &'g Ground<'g>) -> Layout<'g> {
        Layout::new(ground, self.cell, self.count, self.node, self.fixed).0
    }

    /// Follows a cut: `parents` are the faces that those now are parts of. New vertices come behind the old ones.
    pub fn refine(&mut self, parents: &IdVec<Face, FaceId>, vertices: usize) {
        self.cell = parents.iter().map(|&f| self.cell[f]).collect();
        for marks in [&mut self.node, &mut self.fixed] {
            let mut all: Vec<bool> = marks.iter().copied().collect();
            all.resize(vertices, false);
            *marks = all.into_iter().collect();
        }
    }
}

impl Layout<'_> {
    /// The complex without its mesh.
    pub fn into_complex(self) -> Complex {
        Complex { cell: self.cell, count: self.faces.len(), node: self.node, fixed: self.fixed }
    }

    /// The faces to cut so that paths run from every corner of these cells: all but those that fill a corner alone.
    /// Such a face is then halved from its corner, while cutting it in four would leave it with no edge inside again.
    pub fn tight(&self, cells: &[u32]) -> Vec<FaceId> {
        let mut chosen: Vec<FaceId> = Vec::new();
        for &cell in cells {
            let corners: FxHashSet<VertexId> = self.ring(cell).iter().map(|corner| corner.node).collect();
            let is_alone =
                |v: VertexId| self.ground.faces_at.of(v).iter().filter(|&&f| self.cell[f] == cell).count() == 1;
            let fills = |f: FaceId| self.ground.surface.faces[f].iter().any(|&v| corners.contains(&v) && is_alone(v));
            let rest: Vec<FaceId> = self.faces(cell).iter().copied().filter(|&f| !fills(f)).collect();
            chosen.extend(if rest.is_empty() { self.faces(cell).to_vec() } else { rest });
        }
        chosen.sort_unstable();
        chosen.dedup();
        chosen
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{Soup, Surface};
    use crate::technique::layout::Room;

    /// A fan of four triangles round vertex 0 as one cell, whose corners are all but one of its rim.
    fn fan() -> Surface {
        let at = |k: usize| libm::sincos(k as f64 * std::f64::consts::PI / 4.0);
        let mut points = vec![glam::DVec3::ZERO];
        points.extend((0..5).map(|k| glam::dvec3(at(k).1, at(k).0, 0.0)));
        let v = VertexId::new;
        let faces = (1..5).map(|k| [v(0), v(k), v(k + 1)]).collect();
        Surface { points: points.into(), faces, carried: Soup::default().carried }
    }

    #[test]
    fn a_cut_leaves_an_edge_from_every_corner_and_the_complex_as_it_is() {
        let surface = fan();
        let mut room = Room::new(&surface);
        let marks = |n: usize| -> IdVec<Vertex, bool> { (0..n).map(|_| true).collect() };
        let cells = (0..4).map(|_| 0).collect();
        let mut complex = Complex { cell: cells, count: 1, node: marks(6), fixed: marks(6) };
        let tight = {
            let ground = Ground::new(&room.surface);
            let layout = complex.clone().on(&ground);
            assert_eq!((layout.ring(0).len(), layout.has_exit(0, VertexId::new(1))), (6, false));
            layout.tight(&[0])
        };
        assert_eq!(tight, [FaceId::new(1), FaceId::new(2)], "the others fill corners 1 and 5 alone");
        let parents = room.cut(tight).unwrap().unwrap();
        complex.refine(&parents, room.surface.points.len());
        let ground = Ground::new(&room.surface);
        let layout = complex.on(&ground);
        assert_eq!(layout.ring(0).len(), 6);
        assert!((0..6).all(|k| layout.has_exit(0, VertexId::new(k))));
    }
}
