//! Mends cells that are inverted, or nearly so, between straight edges, whatever surface they hold: their nodes move,
//! and where that does not help the cells round them are cut another way.

use glam::DVec3;

use super::local::proposals;
use crate::mesh::VertexId;
use crate::technique::fill::Pattern;
use crate::technique::layout::Layout;

use crate::watch::{Cancelled, Watch};

/// Cells of less quality are mended.
const POOR: f64 = 0.1;

impl Layout<'_> {
    /// Mends poor cells; how many changes that took.
    pub(super) fn untangle(&mut self, watch: &Watch) -> Result<usize, Cancelled> {
        /// What a round moved may make room for the next cell.
        const ROUNDS: usize = 4;
        let mut total = 0;
        for _ in 0..ROUNDS {
            let mut poor: Vec<(f64, u32)> = self.cells().map(|c| (self.straight_quality(c), c)).collect();
            poor.retain(|cell| cell.0 < POOR);
            poor.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            let mut changes = 0;
            for (_, cell) in poor {
                watch.check()?;
                if self.exists(cell) && self.straight_quality(cell) < POOR {
                    changes += usize::from(self.shift_one(cell) || self.cut_otherwise(cell));
                }
            }
            total += changes;
            if changes == 0 {
                break;
            }
        }
        Ok(total)
    }

    /// Moves one of the nodes of a cell.
    fn shift_one(&mut self, cell: u32) -> bool {
        self.nodes(cell).into_iter().any(|node| self.shift(node))
    }

    fn straight_quality(&self, cell: u32) -> f64 {
        self.straight(&self.nodes(cell), self.area(cell).normalize_or_zero())
    }

    /// The quality of a cell along the normal of its patch, or of a quad along its own where that is less: between
    /// straight edges a quad that spans a bend may be inverted, which the patch that it holds does not tell.
    fn straight(&self, nodes: &[VertexId], normal: DVec3) -> f64 {
        let quality = self.quality(nodes, normal);
        let &[a, b, c, d] = nodes else { return quality };
        let [a, b, c, d] = [a, b, c, d].map(|v| self.ground.point(v));
        let own = (b + c - a - d).cross(c + d - a - b).normalize_or_zero();
        quality.min(self.quality(nodes, own))
    }

    fn least(&self, cells: &[u32]) -> f64 {
        cells.iter().map(|&c| self.straight_quality(c)).fold(f64::INFINITY, f64::min)
    }

    /// Moves a node to where the worst cell round it is best, inside or along the rim of the surface.
    fn shift(&mut self, node: VertexId) -> bool {
        /// A move must bring so much.
        const WORTH: f64 = 0.02;
        /// Places tried in the mesh.
        const TRIES: usize = 3;
        let mut cells = self.cells_at(node).to_vec();
        cells.sort_unstable();
        let is_rim = self.ground.on_rim[node];
        let is_one = cells.iter().all(|&c| self.domain(c) == self.domain(cells[0]));
        if self.fixed[node] || !is_one || self.is_on_border(node) && !is_rim {
            return false;
        }
        let Some(rim) = self.rim(&cells).filter(|rim| rim.contains(&node) == is_rim) else { return false };
        let before = self.least(&cells);
        let mut ranked: Vec<(f64, VertexId)> =
            self.places(node, &cells).into_iter().map(|v| (self.worst_with(&cells, node, v), v)).collect();
        ranked.retain(|place| place.0 > before + WORTH);
        ranked.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        ranked.into_iter().take(TRIES).any(|(_, place)| {
            let (rim, pattern) = self.moved(&cells, &rim, node, place);
            let Some(undo) = self.fill(&cells, &rim, &pattern, f64::NEG_INFINITY) else { return false };
            let is_better = self.least(&undo.made) > before + WORTH / 2.0;
            if !is_better {
                self.undo(undo);
            }
            is_better
        })
    }

    /// The cells round a node with it elsewhere.
    fn moved(&self, cells: &[u32], rim: &[VertexId], node: VertexId, place: VertexId) -> (Vec<VertexId>, Pattern) {
        let rings: Vec<Vec<VertexId>> = cells.iter().map(|&c| self.nodes(c)).collect();
        let mut pattern = self.pattern(rim, &rings, None);
        pattern.inner.fill(self.ground.point(place));
        (rim.iter().map(|&v| if v == node { place } else { v }).collect(), pattern)
    }

    /// The quality of the worst of some cells if `node` lay at `place`.
    fn worst_with(&self, cells: &[u32], node: VertexId, place: VertexId) -> f64 {
        let quality = |&c: &u32| {
            let ring: Vec<VertexId> = self.nodes(c).into_iter().map(|v| if v == node { place } else { v }).collect();
            self.straight(&ring, self.area(c).normalize_or_zero())
        };
        cells.iter().map(quality).fold(f64::INFINITY, f64::min)
    }

    /// Where a node may go: vertices inside its cells, some from everywhere, or on the rim between its neighbours
    /// there.
    fn places(&self, node: VertexId, cells: &[u32]) -> Vec<VertexId> {
        /// Vertices looked at.
        const MOST: usize = 300;
        let mut all: Vec<VertexId> = if self.ground.on_rim[node] {
            let paths = cells.iter().flat_map(|&c| (0..self.ring(c).len()).map(move |k| (c, k)));
            let rim = paths.filter(|&(c, k)| self.beyond(c, k).is_none()).map(|(c, k)| self.path(c, k));
            let own = rim.filter(|path| path.first() == Some(&node) || path.last() == Some(&node));
            own.flat_map(|path| path[1..path.len() - 1].to_vec()).collect()
        } else {
            cells.iter().flat_map(|&c| self.faces(c)).flat_map(|&f| self.ground.surface.faces[f]).collect()
        };
        let is_within = |v: VertexId| self.ground.faces_at.of(v).iter().all(|&f| cells.contains(&self.cell[f]));
        all.sort_unstable();
        all.dedup();
        all.retain(|&v| !self.node[v] && (self.ground.on_rim[node] || !self.ground.on_rim[v]) && is_within(v));
        let step = all.len().div_ceil(MOST).max(1);
        all.into_iter().step_by(step).collect()
    }

    /// Cuts a cell and its surroundings another way, though it may leave more irregular nodes.
    fn cut_otherwise(&mut self, cell: u32) -> bool {
        /// What that may cost, in irregular nodes.
        const MOST: f64 = 3.0;
        let mut ranked: Vec<_> = proposals(self, cell).into_iter().map(|p| (self.gain(&p), p)).collect();
        ranked.retain(|(gain, proposal)| *gain <= MOST && proposal.cells.contains(&cell));
        ranked.sort_by(|a, b| a.0.total_cmp(&b.0));
        ranked.into_iter().any(|(_, proposal)| {
            let Some(undo) = self.carry_out(&proposal, POOR) else { return false };
            let is_better = self.least(&undo.made) >= POOR;
            if !is_better {
                self.undo(undo);
            }
            is_better
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::id::{Face, Vertex};
    use crate::mesh::{IdVec, Surface};
    use crate::technique::layout::Ground;

    const N: u32 = 16;

    fn id(x: u32, y: u32) -> VertexId {
        VertexId::from_raw(y * (N + 1) + x)
    }

    #[test]
    fn a_node_that_inverts_a_quad_moves_back_among_its_cells() {
        // A square of four cells, whose common node lies so far out that one of them is inverted between straight
        // edges.
        let points = (0..=N).flat_map(|y| (0..=N).map(move |x| glam::dvec3(f64::from(x), f64::from(y), 0.0))).collect();
        let corners = (0..N * N).map(|i| (i % N, i / N));
        let corners = corners.map(|(x, y)| [id(x, y), id(x + 1, y), id(x + 1, y + 1), id(x, y + 1)]);
        let faces = corners.flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
        let surface = Surface { points, faces, ..Surface::default() };
        let ground = Ground::new(&surface);
        let cell: IdVec<Face, u32> = (0..2 * N * N).map(|f| (f / 2 % N) / 8 + 2 * (f / 2 / N / 8)).collect();
        let mut node: IdVec<Vertex, bool> = IdVec::filled(false, ground.surface.points.len());
        [0, 8, 16].iter().flat_map(|&y| [0, 8, 16].map(|x| id(x, y))).for_each(|v| node[v] = true);
        let fixed = IdVec::filled(false, node.len());
        let (mut layout, bad) = Layout::new(&ground, cell, 4, node, fixed);
        assert_eq!(bad, []);
        let cells: Vec<u32> = layout.cells().collect();
        let rim = layout.rim(&cells).expect("a square");
        let (rim, pattern) = layout.moved(&cells, &rim, id(8, 8), id(14, 13));
        layout.fill(&cells, &rim, &pattern, f64::NEG_INFINITY).expect("there is room");
        let cells: Vec<u32> = layout.cells().collect();
        assert!(layout.least(&cells) < 0.0, "inverted at first: {}", layout.least(&cells));
        assert!(layout.untangle(&Watch::silent()).unwrap() > 0);
        let cells: Vec<u32> = layout.cells().collect();
        assert_eq!(cells.len(), 4);
        assert!(layout.least(&cells) >= POOR, "{}", layout.least(&cells));
    }
}
