//! In which order elements are looked at, and which need not be looked at again.

use crate::mesh::{EdgeId, VertexId};

/// An element by its number.
pub(super) trait Numbered: Copy + Ord {
    fn number(self) -> usize;
}

impl Numbered for EdgeId {
    fn number(self) -> usize {
        self.index()
    }
}

impl Numbered for VertexId {
    fn number(self) -> usize {
        self.index()
    }
}

/// The elements in an order in which neighbours are far from each other.
pub(super) fn scattered<T: Numbered>(mut items: Vec<T>) -> Vec<T> {
    // By the golden ratio: an odd factor, so that no two numbers fall together.
    items.sort_unstable_by_key(|item| ((item.number() as u32).wrapping_mul(0x9E37_79B9), *item));
    items
}

/// Which elements were looked at in vain: what their stars were like then, by number.
#[derive(Clone, Debug, Default)]
pub(super) struct Quiet(Vec<u64>);

impl Quiet {
    /// Those of the elements whose stars are not as they were then, with what they are like now.
    pub(super) fn restless<T: Numbered>(&self, items: Vec<T>, state: impl Fn(T) -> u64) -> Vec<(T, u64)> {
        let is_known = |&(item, now): &(T, u64)| self.0.get(item.number()) == Some(&now);
        items.into_iter().map(|item| (item, state(item))).filter(|known| !is_known(known)).collect()
    }

    /// Remembers those whose stars have stayed as they were: nothing was done there.
    pub(super) fn remember<T: Numbered>(&mut self, items: &[(T, u64)], state: impl Fn(T) -> u64) {
        for &(item, before) in items.iter().filter(|&&(item, before)| state(item) == before) {
            if self.0.len() <= item.number() {
                self.0.resize(item.number() + 1, u64::MAX);
            }
            self.0[item.number()] = before;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbours_are_far_apart() {
        let order = scattered((0..1000).map(EdgeId::new).collect());
        let mut places = vec![0_i64; 1000];
        order.iter().enumerate().for_each(|(place, e)| places[e.index()] = place as i64);
        assert!(places.windows(2).all(|pair| (pair[0] - pair[1]).abs() > 100));
    }
}
