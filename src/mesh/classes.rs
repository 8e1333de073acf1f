//! Interned sets of group names: one small number an element instead of a list of groups.
//!
//! A class is a sorted set of labels. Few distinct sets occur in a mesh, so each element stores the number of its set,
//! and the sets are stored once. The number of live elements of each label is kept, so that an edit can ask whether it
//! would remove the last one.

use rustc_hash::FxHashMap;
use smallvec::SmallVec;

/// The number of an interned set. Class 0 is the empty set.
pub type ClassId = u32;

/// A sorted set of labels.
type LabelSet = SmallVec<[u32; 4]>;

/// The sets of one kind of element, with the count of live elements of each label.
#[derive(Clone, Debug)]
pub struct Classes {
    sets: Vec<LabelSet>,
    lookup: FxHashMap<LabelSet, ClassId>,
    alive: Vec<u32>,
}

impl Classes {
    /// The class of no label only; `labels` is how many labels there are.
    pub fn new(labels: usize) -> Self {
        let empty = LabelSet::new();
        let lookup = std::iter::once((empty.clone(), 0)).collect();
        Self { sets: vec![empty], lookup, alive: vec![0; labels] }
    }

    /// The class of this set; `labels` must be sorted and without repeats.
    pub fn intern(&mut self, labels: &[u32]) -> ClassId {
        let set = LabelSet::from_slice(labels);
        if let Some(&class) = self.lookup.get(&set) {
            return class;
        }
        let class = self.sets.len() as ClassId;
        self.sets.push(set.clone());
        self.lookup.insert(set, class);
        class
    }

    /// The class of `class` with one label more.
    pub fn with(&mut self, class: ClassId, label: u32) -> ClassId {
        let mut set = self.sets[class as usize].clone();
        if let Err(place) = set.binary_search(&label) {
            set.insert(place, label);
        }
        self.intern(&set)
    }

    /// The class that has the labels of both.
    pub fn union(&mut self, a: ClassId, b: ClassId) -> ClassId {
        if a == b || b == 0 {
            return a;
        }
        let mut set = self.sets[a as usize].clone();
        set.extend_from_slice(&self.sets[b as usize]);
        set.sort_unstable();
        set.dedup();
        self.intern(&set)
    }

    /// The class of the labels that both have.
    pub fn intersection(&mut self, a: ClassId, b: ClassId) -> ClassId {
        if a == b || a == 0 || b == 0 {
            return if a == b { a } else { 0 };
        }
        let other = &self.sets[b as usize];
        let set: LabelSet = self.sets[a as usize].iter().copied().filter(|l| other.binary_search(l).is_ok()).collect();
        self.intern(&set)
    }

    /// The labels of a class, sorted.
    pub fn labels(&self, class: ClassId) -> &[u32] {
        &self.sets[class as usize]
    }

    /// Counts one more live element of this class.
    pub fn add(&mut self, class: ClassId) {
        for &label in &self.sets[class as usize] {
            self.alive[label as usize] += 1;
        }
    }

    /// Counts one live element of this class less.
    pub fn remove(&mut self, class: ClassId) {
        for &label in &self.sets[class as usize] {
            self.alive[label as usize] -= 1;
        }
    }

    /// A label that would have no live element left if elements of these classes were removed.
    pub fn vanishing(&self, removed: &[ClassId]) -> Option<u32> {
        removed.iter().flat_map(|&class| self.labels(class)).copied().find(|label| {
            let taken = removed.iter().filter(|&&c| self.labels(c).binary_search(label).is_ok()).count();
            self.alive[*label as usize] as usize <= taken
        })
    }
}
