//! The nodes that can run, and which of them starts next.
//!
//! # Algorithm
//! By rank: the first task of the plan first, and a file right after the last task that it waits for, so that a case is
//! finished and forgotten before the next one fills the memory. A node that is expected to take more memory than is
//! left waits until others have ended, and lighter ones behind it go first; what runs alone waits for all others. Where
//! nothing runs the first one starts, whatever it takes.
//!
//! # Cost
//! Looking for the next one passes over a bounded number of nodes that have to wait.

use std::collections::{BTreeMap, BTreeSet};

/// So many nodes that have to wait are passed over.
const LOOK_AHEAD: usize = 256;

#[derive(Default)]
pub(super) struct Queue {
    /// Rank and node.
    ready: BTreeSet<(usize, usize)>,
    running: BTreeSet<usize>,
    /// Bytes that ready and running nodes are expected to take.
    weights: BTreeMap<usize, u64>,
    /// Nodes that run alone.
    alone: BTreeSet<usize>,
    /// How often nodes were tried again.
    retried: BTreeMap<usize, u32>,
    /// Bytes that all may take together.
    capacity: Option<u64>,
}

impl Queue {
    pub(super) fn new(capacity: Option<u64>) -> Self {
        Self { capacity, ..Self::default() }
    }

    /// Whether weights matter.
    pub(super) fn weighs(&self) -> bool {
        self.capacity.is_some()
    }

    /// Adds a node that can run.
    pub(super) fn push(&mut self, rank: usize, node: usize, weight: u64) {
        self.ready.insert((rank, node));
        self.weights.insert(node, weight);
    }

    /// Takes the node that starts next beside those that run, where there is one. `settled` is what the program holds
    /// besides.
    pub(super) fn start(&mut self, settled: &dyn Fn() -> u64) -> Option<usize> {
        if self.running.iter().any(|node| self.alone.contains(node)) {
            return None;
        }
        let held = match self.capacity {
            Some(_) if !self.running.is_empty() => {
                let weights = self.running.iter().filter_map(|node| self.weights.get(node));
                weights.fold(settled(), |sum, weight| sum.saturating_add(*weight))
            }
            _ => 0,
        };
        let found = self.ready.iter().take(LOOK_AHEAD).copied().find(|(_, node)| self.may_start(*node, held))?;
        self.ready.remove(&found);
        self.running.insert(found.1);
        Some(found.1)
    }

    fn may_start(&self, node: usize, held: u64) -> bool {
        let weight = self.weights.get(&node).copied().unwrap_or_default();
        let fits = weight == 0 || self.capacity.is_none_or(|capacity| held.saturating_add(weight) <= capacity);
        self.running.is_empty() || fits && !self.alone.contains(&node)
    }

    /// How many run.
    pub(super) fn running(&self) -> usize {
        self.running.len()
    }

    /// Notes that a node has ended.
    pub(super) fn end(&mut self, node: usize) {
        self.running.remove(&node);
        self.weights.remove(&node);
    }

    /// From now on the node runs alone.
    pub(super) fn isolate(&mut self, node: usize) {
        self.alone.insert(node);
    }

    /// How often the node was tried again.
    pub(super) fn retried(&self, node: usize) -> u32 {
        self.retried.get(&node).copied().unwrap_or_default()
    }

    /// Counts one more try, where there are at most `most`.
    pub(super) fn retry(&mut self, node: usize, most: u32) -> bool {
        let retried = self.retried.entry(node).or_default();
        let again = *retried < most;
        *retried += u32::from(again);
        again
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn started(queue: &mut Queue, settled: u64) -> Vec<usize> {
        std::iter::from_fn(|| queue.start(&|| settled)).collect()
    }

    #[test]
    fn what_is_too_heavy_waits_and_lighter_ones_go_first() {
        let mut queue = Queue::new(Some(100));
        for (node, weight) in [(0, 60), (1, 50), (2, 30), (3, 0), (4, 200)] {
            queue.push(node, node, weight);
        }
        assert_eq!(started(&mut queue, 10), [0, 2, 3]);
        queue.end(2);
        assert_eq!(started(&mut queue, 10), [0; 0]);
        queue.end(0);
        assert_eq!(started(&mut queue, 10), [1]);
        queue.end(3);
        queue.end(1);
        // More than all there is starts where nothing runs.
        assert_eq!(started(&mut queue, 10), [4]);
    }

    #[test]
    fn what_runs_alone_has_nothing_beside_it() {
        let mut queue = Queue::new(None);
        queue.isolate(0);
        for node in 0..3 {
            queue.push(node, node, 0);
        }
        assert_eq!(started(&mut queue, 0), [0]);
        queue.end(0);
        queue.push(3, 0, 0);
        assert_eq!(started(&mut queue, 0), [1, 2]);
        queue.end(1);
        assert_eq!((started(&mut queue, 0), queue.running()), (vec![], 1));
        queue.end(2);
        assert_eq!(started(&mut queue, 0), [0]);
    }

    #[test]
    fn tries_are_counted() {
        let mut queue = Queue::new(None);
        assert!(!queue.retry(1, 0));
        assert!(queue.retry(0, 2) && queue.retry(0, 2) && !queue.retry(0, 2));
        assert_eq!((queue.retried(0), queue.retried(1)), (2, 0));
    }
}
