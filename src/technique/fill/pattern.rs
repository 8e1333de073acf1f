//! Polygons over the rim of a cavity and some nodes inside: what a cavity is filled with.

use glam::DVec3;
use rustc_hash::FxHashMap;

use crate::mesh::VertexId;

/// A disk of polygons. Nodes `0..rim` lie on the rim, counter-clockwise; those behind lie inside.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Pattern {
    /// Nodes on the rim.
    pub rim: usize,
    /// Where the nodes inside should lie, roughly.
    pub inner: Vec<DVec3>,
    /// Polygons, counter-clockwise.
    pub faces: Vec<Vec<usize>>,
}

impl Pattern {
    /// One polygon over the whole rim.
    pub fn polygon(rim: usize) -> Self {
        Self { rim, inner: Vec::new(), faces: vec![(0..rim).collect()] }
    }

    /// Polygons over the nodes of a rim and others, which lie inside.
    pub fn over(rim: &[VertexId], polygons: &[Vec<VertexId>]) -> Self {
        let mut index: FxHashMap<VertexId, usize> = rim.iter().enumerate().map(|(k, &v)| (v, k)).collect();
        let mut faces = Vec::with_capacity(polygons.len());
        for polygon in polygons {
            let corner = |&node| {
                let next = index.len();
                *index.entry(node).or_insert(next)
            };
            faces.push(polygon.iter().map(corner).collect());
        }
        Self { rim: rim.len(), inner: vec![DVec3::ZERO; index.len() - rim.len()], faces }
    }

    /// Puts each node inside at the mean of its neighbours, the rim held fast.
    pub fn relax(&mut self, rim: &[DVec3]) {
        /// Enough for a hundred nodes inside: what is left is a hundredth of the disk, and they are smoothed later.
        const SWEEPS: usize = 60;
        let (first, neighbours) = self.neighbours();
        let middle = rim.iter().sum::<DVec3>() / rim.len().max(1) as f64;
        self.inner.iter_mut().for_each(|p| *p = middle);
        for _ in 0..SWEEPS {
            for k in 0..self.inner.len() {
                let list = &neighbours[first[k]..first[k + 1]];
                let at = |&n: &usize| if n < self.rim { rim[n] } else { self.inner[n - self.rim] };
                let sum: DVec3 = list.iter().map(at).sum();
                self.inner[k] = sum / list.len().max(1) as f64;
            }
        }
    }

    /// The neighbours of the nodes inside, those of node `k` from the `k`-th place on.
    fn neighbours(&self) -> (Vec<usize>, Vec<usize>) {
        let edges = || {
            let of = |face: &'_ Vec<usize>, k: usize| (face[k], face[(k + 1) % face.len()]);
            let all = self.faces.iter().flat_map(move |face| (0..face.len()).map(move |k| of(face, k)));
            all.filter_map(|(a, b)| Some((a.checked_sub(self.rim)?, b)))
        };
        let mut first = vec![0; self.inner.len() + 1];
        edges().for_each(|(a, _)| first[a + 1] += 1);
        for k in 1..first.len() {
            first[k] += first[k - 1];
        }
        let (mut next, mut neighbours) = (first.clone(), vec![0; first[self.inner.len()]]);
        for (a, b) in edges() {
            neighbours[next[a]] = b;
            next[a] += 1;
        }
        (first, neighbours)
    }
}
