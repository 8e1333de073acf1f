//! Vertices on seams: the copies of one point of the model.

use std::collections::BTreeMap;

use smallvec::SmallVec;

use super::HalfedgeMesh;
use crate::mesh::{SeamId, VertexId};

/// The copies of one point.
type Copies = SmallVec<[VertexId; 3]>;

/// Which vertices are copies of one point. Those never vanish.
#[derive(Clone, Debug, Default)]
pub(in crate::mesh) struct Seams {
    of: BTreeMap<VertexId, SeamId>,
    copies: BTreeMap<SeamId, Copies>,
}

impl Seams {
    /// The seams of a surface.
    pub(super) fn new(of: &BTreeMap<VertexId, SeamId>) -> Self {
        let mut copies: BTreeMap<SeamId, Copies> = BTreeMap::new();
        for (&v, &seam) in of {
            copies.entry(seam).or_default().push(v);
        }
        Self { of: of.clone(), copies }
    }

    pub(super) fn iter(&self) -> impl Iterator<Item = (VertexId, SeamId)> + '_ {
        self.of.iter().map(|(&v, &seam)| (v, seam))
    }

    pub(in crate::mesh) fn contains(&self, v: VertexId) -> bool {
        self.of.contains_key(&v)
    }

    /// Puts vertices on a new seam.
    pub(in crate::mesh) fn add(&mut self, copies: &[VertexId]) {
        let next = SeamId(self.copies.keys().next_back().map_or(0, |seam| seam.0 + 1));
        self.of.extend(copies.iter().map(|&v| (v, next)));
        self.copies.insert(next, copies.into());
    }
}

impl HalfedgeMesh {
    /// The seam a vertex lies on.
    pub fn seam(&self, v: VertexId) -> Option<SeamId> {
        self.seams.of.get(&v).copied()
    }

    /// Edges at the other copies of a vertex on a seam that are no copies of its own edges: the point of the model has
    /// these too. O(edges at the copies).
    pub fn valence_elsewhere(&self, v: VertexId) -> usize {
        let Some(seam) = self.seam(v) else { return 0 };
        let mut known: SmallVec<[SeamId; 4]> = self.neighbours(v).filter_map(|w| self.seam(w)).collect();
        let mut elsewhere = 0;
        for &copy in self.seams.copies[&seam].iter().filter(|&&copy| copy != v) {
            for beyond in self.neighbours(copy).map(|w| self.seam(w)) {
                if beyond.is_some_and(|id| known.contains(&id)) {
                    continue;
                }
                known.extend(beyond);
                elsewhere += 1;
            }
        }
        elsewhere
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use crate::mesh::halfedge::HalfedgeMesh;
    use crate::mesh::{IdVec, LockRules, SeamId, Surface, VertexId, resolve_freedom};

    #[test]
    fn a_point_of_a_seam_has_the_edges_of_all_its_copies_once() {
        // Two triangles that share an edge as copies: 0-1 and 3-4.
        let points = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 0], [1, 0, 0], [0, 0, 1]];
        let mut surface = Surface {
            points: points.map(|p| DVec3::from(p.map(f64::from))).into_iter().collect(),
            faces: IdVec::from(vec![[0, 1, 2].map(VertexId::new), [4, 3, 5].map(VertexId::new)]),
            ..Surface::default()
        };
        surface.carried.seams = [(0, 0), (3, 0), (1, 1), (4, 1)].map(|(v, s)| (VertexId::new(v), SeamId(s))).into();
        let freedom = resolve_freedom(&surface, &LockRules::default()).unwrap();
        let mesh = HalfedgeMesh::new(&surface, &freedom).unwrap();
        let elsewhere: Vec<usize> = mesh.vertices().map(|v| mesh.valence_elsewhere(v)).collect();
        assert_eq!(elsewhere, [1, 1, 0, 1, 1, 0]);
    }
}
