//! How long edges should be: wishes from several sources at the vertices of a mesh, the least of which counts, graded
//! along its edges.
//!
//! Curvature is a source ([`curvature`]); what a recipe asks for and what a certificate has found to be too coarse are
//! others. Sizes stay between a least and a largest one, and none exceeds a neighbour's by more than the gradation
//! times the way there.
//!
//! # Cost
//! Grading takes O(V log V).

pub mod curvature;

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use smallvec::SmallVec;

use crate::mesh::VertexId;
use crate::mesh::halfedge::HalfedgeMesh;

/// Between which lengths sizes stay, and how fast they grow.
#[derive(Clone, Copy, Debug)]
pub struct Bounds {
    /// The largest size.
    pub most: f64,
    /// The least size.
    pub least: f64,
    /// How much the size may grow over a unit of length.
    pub gradation: f64,
}

/// Edge lengths wanted at the vertices of a mesh.
#[derive(Clone, Debug)]
pub struct Sizing {
    bounds: Bounds,
    sizes: Vec<f64>,
    /// What was asked for by [`Sizing::lower`]; infinite where nothing was.
    lowered: Vec<f64>,
}

/// Sizes that are lowered by less do not count as changed: grading lowers many a little.
const CHANGE: f64 = 0.97;

impl Sizing {
    /// The largest size at so many vertices.
    pub fn new(bounds: Bounds, slots: usize) -> Self {
        Self { bounds, sizes: vec![bounds.most; slots], lowered: vec![f64::INFINITY; slots] }
    }

    /// Between which lengths sizes stay.
    pub fn bounds(&self) -> Bounds {
        self.bounds
    }

    /// From the next [`Sizing::set`] on, sizes grow so much over a unit of length.
    pub fn grow_by(&mut self, gradation: f64) {
        self.bounds.gradation = gradation;
    }

    /// The size at a vertex.
    #[inline]
    pub fn at(&self, v: VertexId) -> f64 {
        self.sizes[v.index()]
    }

    /// What was asked for at a vertex by [`Sizing::lower`].
    pub fn lowered(&self, v: VertexId) -> f64 {
        self.lowered[v.index()]
    }

    /// Makes room for a new vertex between two others, `apart` from each other, where other sources allow `limit`.
    pub fn found(&mut self, v: VertexId, [a, b]: [VertexId; 2], apart: f64, limit: f64) {
        let step = 0.5 * self.bounds.gradation * apart;
        let lowered = self.lowered(a).max(self.lowered(b));
        let size = (self.at(a) + step).min(self.at(b) + step).min(limit).min(lowered).max(self.bounds.least);
        if self.sizes.len() <= v.index() {
            self.sizes.resize(v.index() + 1, self.bounds.most);
            self.lowered.resize(v.index() + 1, f64::INFINITY);
        }
        (self.sizes[v.index()], self.lowered[v.index()]) = (size, lowered);
    }

    /// A vertex that two have become asks for what either did.
    pub fn merged(&mut self, kept: VertexId, removed: VertexId) {
        self.sizes[kept.index()] = self.at(kept).min(self.at(removed));
        self.lowered[kept.index()] = self.lowered(kept).min(self.lowered(removed));
    }

    /// Asks for a smaller size at a vertex. Takes effect with the next [`Sizing::set`].
    pub fn lower(&mut self, v: VertexId, to: f64) {
        self.lowered[v.index()] = self.lowered(v).min(to.max(self.bounds.least));
    }

    /// Sets all sizes to what the other sources allow at each vertex and what was asked for there, graded.
    pub fn set(&mut self, mesh: &HalfedgeMesh, limit: impl Fn(VertexId) -> f64) {
        for v in mesh.vertices() {
            let size = limit(v).min(self.lowered(v));
            self.sizes[v.index()] = size.clamp(self.bounds.least, self.bounds.most);
        }
        self.grade(mesh);
    }

    /// The vertices whose sizes are much smaller than `before`.
    pub fn changed(&self, mesh: &HalfedgeMesh, before: &Self) -> Vec<VertexId> {
        mesh.vertices().filter(|&v| self.at(v) < CHANGE * before.at(v)).collect()
    }

    /// Lets no size exceed a neighbour's by more than the gradation allows.
    fn grade(&mut self, mesh: &HalfedgeMesh) {
        // Bits of non-negative floats have their order.
        let mut heap: BinaryHeap<Reverse<(u64, VertexId)>> =
            mesh.vertices().map(|v| Reverse((self.at(v).to_bits(), v))).collect();
        while let Some(Reverse((bits, v))) = heap.pop() {
            let size = f64::from_bits(bits);
            if size > self.at(v) {
                continue;
            }
            let around: SmallVec<[VertexId; 12]> = mesh.neighbours(v).collect();
            for w in around {
                let limit = size + self.bounds.gradation * mesh.point(v).distance(mesh.point(w));
                if limit < self.at(w) {
                    self.sizes[w.index()] = limit;
                    heap.push(Reverse((limit.to_bits(), w)));
                }
            }
        }
    }
}
