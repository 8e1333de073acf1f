//! An indexed heap: items by number, each at most once, largest priority first.
//!
//! A 4-ary heap with a table of positions, so that an item's priority can be changed or the item removed in place. No
//! stale entry ever waits in it, unlike a heap with versions. Equal priorities leave in the order of their numbers, so
//! that the sequence never depends on history. Cost: `O(log n)` a change, 12 bytes an item.

const ABSENT: u32 = u32::MAX;
const ARITY: usize = 4;

#[derive(Clone, Copy, Debug)]
struct Entry {
    priority: f32,
    item: u32,
}

impl Entry {
    /// Whether this entry leaves before `other`.
    #[inline]
    fn before(self, other: Self) -> bool {
        self.priority > other.priority || (self.priority == other.priority && self.item < other.item)
    }
}

/// Items ordered by priority, largest first, ties by the lower number.
#[derive(Clone, Debug, Default)]
pub struct IndexedHeap {
    entries: Vec<Entry>,
    position: Vec<u32>,
}

impl IndexedHeap {
    /// An empty heap for items `0..capacity`; larger numbers make it grow.
    pub fn with_items(capacity: usize) -> Self {
        Self { entries: Vec::new(), position: vec![ABSENT; capacity] }
    }

    /// Number of items waiting.
    pub fn len(&self) -> usize {
        self.entries.len()
    }

    /// Whether nothing waits.
    pub fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    /// Whether the item waits.
    pub fn contains(&self, item: u32) -> bool {
        self.position.get(item as usize).is_some_and(|&at| at != ABSENT)
    }

    /// The priority of an item that waits.
    pub fn priority(&self, item: u32) -> Option<f32> {
        let at = *self.position.get(item as usize)?;
        (at != ABSENT).then(|| self.entries[at as usize].priority)
    }

    /// Adds the item, or changes its priority. A priority that is not a number counts as the lowest.
    pub fn set(&mut self, item: u32, priority: f32) {
        let priority = if priority.is_nan() { f32::NEG_INFINITY } else { priority };
        if item as usize >= self.position.len() {
            self.position.resize(item as usize + 1, ABSENT);
        }
        let entry = Entry { priority, item };
        let at = self.position[item as usize];
        if at == ABSENT {
            self.entries.push(entry);
            self.rise(self.entries.len() - 1, entry);
        } else {
            let at = at as usize;
            let was = self.entries[at];
            if entry.before(was) { self.rise(at, entry) } else { self.sink(at, entry) }
        }
    }

    /// Takes the item out, where it waits.
    pub fn remove(&mut self, item: u32) {
        if !self.contains(item) {
            return;
        }
        let at = self.position[item as usize] as usize;
        self.position[item as usize] = ABSENT;
        let Some(last) = self.entries.pop() else { return };
        if at == self.entries.len() {
            return;
        }
        if at > 0 && last.before(self.entries[(at - 1) / ARITY]) { self.rise(at, last) } else { self.sink(at, last) }
    }

    /// The item that leaves next, with its priority.
    pub fn peek(&self) -> Option<(u32, f32)> {
        self.entries.first().map(|e| (e.item, e.priority))
    }

    /// Takes out the item of the largest priority.
    pub fn pop(&mut self) -> Option<(u32, f32)> {
        let top = self.peek()?;
        self.remove(top.0);
        Some(top)
    }

    fn put(&mut self, at: usize, entry: Entry) {
        self.entries[at] = entry;
        self.position[entry.item as usize] = at as u32;
    }

    fn rise(&mut self, mut at: usize, entry: Entry) {
        while at > 0 {
            let parent = (at - 1) / ARITY;
            if !entry.before(self.entries[parent]) {
                break;
            }
            self.put(at, self.entries[parent]);
            at = parent;
        }
        self.put(at, entry);
    }

    fn sink(&mut self, mut at: usize, entry: Entry) {
        loop {
            let first = ARITY * at + 1;
            let end = (first + ARITY).min(self.entries.len());
            let mut best = first;
            for child in first + 1..end {
                if self.entries[child].before(self.entries[best]) {
                    best = child;
                }
            }
            if first >= end || !self.entries[best].before(entry) {
                break;
            }
            self.put(at, self.entries[best]);
            at = best;
        }
        self.put(at, entry);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::collections::BTreeMap;

    #[test]
    fn equal_priorities_leave_by_number() {
        let mut heap = IndexedHeap::with_items(4);
        for item in [3, 1, 2, 0] {
            heap.set(item, 1.0);
        }
        let order: Vec<u32> = std::iter::from_fn(|| heap.pop()).map(|(item, _)| item).collect();
        assert_eq!(order, [0, 1, 2, 3]);
    }

    proptest! {
        #[test]
        fn agrees_with_a_sorted_map(changes in prop::collection::vec((0u32..32, prop::option::of(-4i8..4)), 0..200)) {
            let mut heap = IndexedHeap::with_items(8);
            let mut map = BTreeMap::new();
            for (item, priority) in changes {
                if let Some(p) = priority {
                    heap.set(item, f32::from(p));
                    map.insert(item, p);
                } else {
                    heap.remove(item);
                    map.remove(&item);
                }
                prop_assert_eq!(heap.len(), map.len());
            }
            let mut expected: Vec<(u32, i8)> = map.into_iter().collect();
            expected.sort_by_key(|&(item, p)| (-i32::from(p), item));
            let got: Vec<u32> = std::iter::from_fn(|| heap.pop()).map(|(item, _)| item).collect();
            prop_assert_eq!(got, expected.into_iter().map(|(item, _)| item).collect::<Vec<_>>());
        }
    }
}
