//! Cells laid flat, so that nodes of a new pattern are found on them.

use std::collections::BTreeMap;

use super::Layout;
use crate::mesh::VertexId;
use crate::technique::fill::Flat;

impl Layout<'_> {
    /// Lays cells flat whose rim is given.
    pub(super) fn lay_flat(&self, cells: &[u32], rim: &[VertexId]) -> Flat {
        let mut index: BTreeMap<VertexId, usize> = rim.iter().enumerate().map(|(k, &v)| (v, k)).collect();
        let mut nodes = rim.to_vec();
        let mut faces = Vec::with_capacity(cells.len());
        for &cell in cells {
            let corner = |node: VertexId| {
                *index.entry(node).or_insert_with(|| {
                    nodes.push(node);
                    nodes.len() - 1
                })
            };
            faces.push(self.nodes(cell).into_iter().map(corner).collect::<Vec<_>>());
        }
        let points: Vec<_> = nodes.into_iter().map(|v| self.ground.point(v)).collect();
        Flat::new(&points, rim.len(), faces)
    }
}
