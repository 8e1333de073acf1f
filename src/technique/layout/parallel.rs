//! Edges that join the same two nodes: apart in the layout, one and the same in the mesh that it becomes.

use std::collections::BTreeMap;

use super::Layout;
use crate::mesh::VertexId;
use crate::mesh::carried::{EdgeKey, edge_key};

impl Layout<'_> {
    /// Puts a node on all but the shortest of the paths that join the same two nodes; how many. Cells beside them get a
    /// corner more.
    pub fn part_parallels(&mut self) -> usize {
        let mut paths: BTreeMap<EdgeKey, Vec<(usize, EdgeKey, u32, usize)>> = BTreeMap::new();
        for cell in self.cells().collect::<Vec<_>>() {
            for k in 0..self.ring(cell).len() {
                let path = self.path(cell, k);
                let ends = edge_key(path[0], path[path.len() - 1]);
                let name = path.windows(2).map(|w| edge_key(w[0], w[1])).min().unwrap_or(ends);
                let known = paths.entry(ends).or_default();
                if known.iter().all(|other| other.1 != name) {
                    known.push((path.len(), name, cell, k));
                }
            }
        }
        // Nodes are made on paths that are still the same, since each path is named once.
        let mut middles: Vec<(VertexId, [Option<u32>; 2])> = Vec::new();
        for mut all in paths.into_values().filter(|all| all.len() > 1) {
            all.sort_unstable();
            for (length, _, cell, k) in all.into_iter().skip(1).filter(|path| path.0 > 2) {
                middles.push((self.path(cell, k)[length / 2], [Some(cell), self.beyond(cell, k)]));
            }
        }
        let made = middles.len();
        for (middle, beside) in middles {
            self.make_node(middle, beside);
        }
        made
    }
}
