//! Which edges are tied: groups by the ends of their edges, which are kept and so keep their numbers.

use rustc_hash::FxHashMap;
use smallvec::SmallVec;

use crate::mesh::{EdgeKey, VertexId, edge_key};

/// The copies of an edge, each from the end that corresponds to the first of the others.
pub(super) type Copies = SmallVec<[[VertexId; 2]; 3]>;

/// Which edges are tied.
#[derive(Debug, Default)]
pub(super) struct Ties {
    place: FxHashMap<EdgeKey, usize>,
    groups: Vec<Copies>,
}

impl Ties {
    /// The group of an edge.
    pub(super) fn of(&self, [a, b]: [VertexId; 2]) -> Option<usize> {
        if self.place.is_empty() { None } else { self.place.get(&edge_key(a, b)).copied() }
    }

    /// The copies in a group.
    pub(super) fn copies(&self, group: usize) -> Copies {
        self.groups[group].clone()
    }

    pub(super) fn add(&mut self, copies: Copies) {
        self.place.extend(copies.iter().map(|&[a, b]| (edge_key(a, b), self.groups.len())));
        self.groups.push(copies);
    }

    /// The halves of a group's edges take its place.
    pub(super) fn halve(&mut self, group: usize, made: &[VertexId]) {
        let copies = std::mem::take(&mut self.groups[group]);
        for &[a, b] in &copies {
            self.place.remove(&edge_key(a, b));
        }
        self.add(copies.iter().zip(made).map(|(&[a, _], &m)| [a, m]).collect());
        self.add(copies.iter().zip(made).map(|(&[_, b], &m)| [m, b]).collect());
    }
}
