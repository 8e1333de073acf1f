//! Moves inner nodes to the middle of their neighbours and straightens paths, without a change of connectivity.

use super::Memory;
use crate::mesh::VertexId;
use crate::technique::layout::Layout;
use crate::technique::layout::proposal::Proposal;
use crate::watch::{Cancelled, Watch};

impl Layout<'_> {
    /// So many rounds over all inner nodes.
    pub(super) fn relax(&mut self, rounds: usize, memory: &mut Memory, watch: &Watch) -> Result<(), Cancelled> {
        for _ in 0..rounds {
            for node in self.inner_nodes() {
                watch.check()?;
                if !self.is_node(node) {
                    continue;
                }
                let mut cells = self.cells_at(node).to_vec();
                cells.sort_unstable();
                let before = memory.relaxed.insert(node, cells);
                // Straight paths are worth a move by themselves, but only once.
                let is_first = before.is_none();
                if before.as_ref() != memory.relaxed.get(&node) {
                    self.relax_node(node, is_first);
                }
            }
        }
        Ok(())
    }

    /// Nodes inside domains, in rising order.
    pub(super) fn inner_nodes(&self) -> Vec<VertexId> {
        let nodes = self.ground.surface.points.ids();
        nodes.filter(|&v| self.is_node(v) && !self.is_on_border(v)).collect()
    }

    fn relax_node(&mut self, node: VertexId, is_first: bool) {
        /// A move must make up for so much of what shapes lack.
        const WORTH: f64 = 1e-3;
        let cells = self.cells_at(node).to_vec();
        if cells.len() < 3 {
            return;
        }
        if self.rim(&cells).is_none_or(|rim| rim.contains(&node)) {
            return;
        }
        if self.is_settled(node, &cells) {
            return;
        }
        let lack = |layout: &Self, cells: &[u32]| -> f64 {
            let lacks = cells.iter().map(|&c| 1.0 - layout.quality_of(c));
            lacks.map(|l| l * l + if l > 0.95 { 4.0 * l } else { 0.0 }).sum()
        };
        let before = lack(self, &cells);
        let faces = cells.iter().map(|&c| self.nodes(c)).collect();
        let proposal = Proposal { cells, faces };
        let Some(undo) = self.carry_out(&proposal, f64::NEG_INFINITY) else { return };
        if lack(self, &undo.made) > before - if is_first { 0.0 } else { WORTH } {
            self.undo(undo);
        }
    }

    /// Whether the cells at a node are well shaped and it lies in the middle of them.
    fn is_settled(&self, node: VertexId, cells: &[u32]) -> bool {
        let neighbours: Vec<VertexId> = cells
            .iter()
            .filter_map(|&c| {
                let ring = self.ring(c);
                let k = ring.iter().position(|corner| corner.node == node)?;
                Some(ring[(k + 1) % ring.len()].node)
            })
            .collect();
        let at = self.ground.point(node);
        let count = neighbours.len().max(1) as f64;
        let middle = neighbours.iter().map(|&v| self.ground.point(v)).sum::<glam::DVec3>() / count;
        let reach = neighbours.iter().map(|&v| self.ground.point(v).distance(at)).sum::<f64>() / count;
        middle.distance(at) < 0.15 * reach && cells.iter().all(|&c| self.quality_of(c) > 0.85)
    }
}
