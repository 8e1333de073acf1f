//! The order of collapses: edges by their index, rated only when they are about to be the best.
//!
//! A waiting edge holds what its index was, or an estimate from its length. The edge on top is rated: it collapses
//! where its index is not below what the next one holds, else it goes back with the index. After a collapse the edges
//! of the merged vertex get new estimates, those further out keep what they have, and refused ones come back at a lower
//! place, so that a neighbourhood that changes often does not rate them each time. No edge is forgotten: when the queue
//! is empty, every live edge was refused with its star as it is.
//!
//! While a hierarchy is recorded every edge waits with its index proper instead: estimates let neighbours collapse one
//! after the other, which is as good for the result, but chains the levels of one place to those of another.
//!
//! Estimates are kept to an eighth of an octave. Edges of the same step leave by number, which is by place: one
//! collapse finds in the cache what the one before it has read.

use super::attempt::{Attempt, CollapseRules, collapse_from, estimate, rate};
use crate::mesh::halfedge::edge_of;
use crate::mesh::{EdgeId, VertexId};
use crate::technique::guarded::GuardedMesh;
use crate::technique::heap::IndexedHeap;
use crate::watch::{Cancelled, Watch};

/// Refused edges whose star has changed come back this far below the index of the moment.
const COME_BACK: f32 = 0.75;

/// Edges that wait for their collapse.
pub(super) struct Queue {
    heap: IndexedHeap,
    /// Edges that do not wait because a test refused them.
    refused: Vec<bool>,
    edges: Vec<EdgeId>,
    /// The index of the edge that left last.
    now: f32,
    /// Whether edges wait with their index, not with an estimate.
    is_exact: bool,
}

impl Queue {
    pub(super) fn new(guarded: &mut GuardedMesh<'_>, rules: &CollapseRules, watch: &Watch) -> Result<Self, Cancelled> {
        let slots = guarded.mesh().edge_slots();
        let mut this = Self {
            heap: IndexedHeap::with_items(slots),
            refused: vec![false; slots],
            edges: Vec::new(),
            now: f32::INFINITY,
            is_exact: guarded.is_recording(),
        };
        for edge in (0..slots).map(EdgeId::new) {
            if edge.index().is_multiple_of(4096) {
                watch.check()?;
            }
            if guarded.mesh().edge_is_live(edge) {
                this.enter(guarded, rules, edge);
            }
        }
        Ok(this)
    }

    /// Collapses the best edge. `None` when no edge is valid.
    pub(super) fn collapse_next(&mut self, guarded: &mut GuardedMesh<'_>, rules: &CollapseRules) -> Option<VertexId> {
        while let Some((item, index)) = self.heap.pop() {
            let edge = EdgeId::from_raw(item);
            if !guarded.mesh().edge_is_live(edge) {
                continue;
            }
            self.now = index;
            let next = self.heap.peek().map_or(f32::NEG_INFINITY, |(_, next)| next);
            match collapse_from(guarded, edge, rules, next) {
                Attempt::Collapsed(merged) => {
                    self.follow(guarded, rules, merged);
                    return Some(merged);
                }
                Attempt::Postponed(index) => self.heap.set(item, self.step(index)),
                Attempt::Refused => self.refused[edge.index()] = true,
            }
        }
        None
    }

    /// Steps of an eighth of an octave, rounded down.
    fn step(&self, index: f32) -> f32 {
        if self.is_exact { index } else { f32::from_bits(index.to_bits() & 0xFFF0_0000) }
    }

    /// Lets an edge wait with an estimate, or where there is none with its index.
    fn enter(&mut self, guarded: &mut GuardedMesh<'_>, rules: &CollapseRules, edge: EdgeId) {
        let estimated = if self.is_exact { None } else { estimate(guarded, edge, rules) };
        let index = estimated.or_else(|| rate(guarded, edge, rules));
        self.refused[edge.index()] = index.is_none();
        match index {
            Some(index) => self.heap.set(edge.raw(), self.step(index)),
            None => self.heap.remove(edge.raw()),
        }
    }

    /// Tells of the collapse into `merged`, which has changed the stars of the edges round it.
    fn follow(&mut self, guarded: &mut GuardedMesh<'_>, rules: &CollapseRules, merged: VertexId) {
        let mesh = guarded.mesh();
        self.edges.clear();
        for spoke in mesh.outgoing(merged) {
            self.edges.push(edge_of(spoke));
            for out in mesh.outgoing(mesh.target(spoke)) {
                let edge = edge_of(out);
                if !std::mem::take(&mut self.refused[edge.index()]) {
                    continue;
                }
                if self.is_exact {
                    self.edges.push(edge);
                } else {
                    self.heap.set(edge.raw(), self.step(COME_BACK * self.now));
                }
            }
        }
        let edges = std::mem::take(&mut self.edges);
        for &edge in &edges {
            self.enter(guarded, rules, edge);
        }
        // Its room is used again.
        self.edges = edges;
    }
}
