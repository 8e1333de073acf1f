//! Cells that are no polygons are cut until they are: several loops, borders that touch themselves, too few nodes.

use super::draft::Draft;
use super::sample::Rope;
use super::strips::border_loops;
use crate::mesh::id::Face;
use crate::mesh::{IdVec, VertexId};
use crate::technique::layout::{NotADisk, Side};

impl Draft<'_> {
    /// Lays a cut through each cell that is no disk; whether there was one that could be cut.
    pub(super) fn mend(&mut self, cell: &IdVec<Face, u32>, bad: &[NotADisk]) -> bool {
        let mut loops: Vec<Vec<Side>> = border_loops(self.ground, cell);
        loops.retain(|sides| bad.iter().any(|b| b.cell == cell[sides[0].face]));
        let mut cut = false;
        for NotADisk { cell: number, .. } in bad {
            let ropes: Vec<Rope> = loops
                .iter()
                .filter(|sides| cell[sides[0].face] == *number)
                .map(|sides| Rope::new(self.ground, sides))
                .collect();
            cut |= self.mend_cell(cell, *number, &ropes);
        }
        cut
    }

    fn mend_cell(&mut self, cell: &IdVec<Face, u32>, number: u32, ropes: &[Rope]) -> bool {
        let before = (self.walls.len(), self.node_count(ropes));
        for rope in ropes {
            self.seed_nodes(rope);
        }
        if let [first, second, ..] = ropes {
            let nodes = |draft: &Self, rope: &Rope| -> Vec<VertexId> {
                rope.vertices.iter().copied().filter(|&v| draft.node[v]).collect()
            };
            let (a, b) = (nodes(self, first), nodes(self, second));
            let halves = a.len().div_ceil(2);
            self.cut_cell(cell, number, &a[..halves], &b);
            self.cut_cell(cell, number, &a[halves..], &b);
        } else if let Some(rope) = ropes.first()
            && let Some((low, high)) = twice(&rope.vertices)
        {
            self.node[rope.vertices[low]] = true;
            let lobe = |range: Vec<usize>, draft: &mut Self| -> Vec<VertexId> {
                let vertices: Vec<VertexId> = range.into_iter().map(|k| rope.vertices[k]).collect();
                let nodes: Vec<VertexId> = vertices.iter().copied().filter(|&v| draft.node[v]).collect();
                if nodes.is_empty() { vertices } else { nodes }
            };
            let n = rope.len();
            let one = lobe((low + 1..high).collect(), self);
            let other = lobe((high + 1..low + n).map(|k| k % n).collect(), self);
            self.cut_cell(cell, number, &one, &other);
        }
        before != (self.walls.len(), self.node_count(ropes))
    }

    fn node_count(&self, ropes: &[Rope]) -> usize {
        ropes.iter().flat_map(|rope| &rope.vertices).filter(|&&v| self.node[v]).count()
    }

    /// At least three nodes on a loop.
    fn seed_nodes(&mut self, rope: &Rope) {
        let nodes = rope.vertices.iter().filter(|&&v| self.node[v]).count();
        for part in nodes..3 {
            let place = rope.place_near(0, rope.length * part as f64 / 3.0);
            self.node[rope.vertices[place]] = true;
        }
    }

    fn cut_cell(&mut self, cell: &IdVec<Face, u32>, number: u32, from: &[VertexId], to: &[VertexId]) {
        let mut finder = std::mem::take(&mut self.finder);
        let ground = self.ground;
        let free = |v: VertexId| {
            let here = || ground.faces_at.of(v).iter().all(|&f| cell[f] == number);
            !self.is_taken(v) && !self.node[v] && !ground.on_rim[v] && here()
        };
        let open = |a, b| cell[a] == number && cell[b] == number;
        let terrain = crate::technique::layout::Terrain {
            free: &free,
            open: &open,
            cost: &|a, b| a.distance(b),
            limit: f64::INFINITY,
            goal: None,
        };
        let path = finder.path(ground, from, |v| to.contains(&v), &terrain);
        self.finder = finder;
        let Some(path) = path else { return };
        for &end in [path.first(), path.last()].into_iter().flatten() {
            self.node[end] = true;
        }
        self.add_wall(&path);
    }
}

/// Two places of the same vertex.
fn twice(vertices: &[VertexId]) -> Option<(usize, usize)> {
    let mut order: Vec<usize> = (0..vertices.len()).collect();
    order.sort_by_key(|&k| (vertices[k], k));
    order.windows(2).find(|w| vertices[w[0]] == vertices[w[1]]).map(|w| (w[0], w[1]))
}
