//! Disjoint sets of numbers.

/// Sets that can be joined.
pub(super) struct Sets {
    parent: Vec<u32>,
}

impl Sets {
    /// One set for each number below `count`.
    pub(super) fn new(count: usize) -> Self {
        Self { parent: (0..count as u32).collect() }
    }

    /// The lowest number of a set.
    pub(super) fn find(&mut self, mut x: u32) -> u32 {
        while self.parent[x as usize] != x {
            let up = self.parent[self.parent[x as usize] as usize];
            self.parent[x as usize] = up;
            x = up;
        }
        x
    }

    pub(super) fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.find(a), self.find(b));
        self.parent[a.max(b) as usize] = a.min(b);
    }

    /// The members of each set, in order; sets in the order of their first.
    pub(super) fn members(&mut self) -> Vec<Vec<u32>> {
        let mut at = vec![u32::MAX; self.parent.len()];
        let mut sets: Vec<Vec<u32>> = Vec::new();
        for x in 0..self.parent.len() as u32 {
            let root = self.find(x) as usize;
            if at[root] == u32::MAX {
                at[root] = sets.len() as u32;
                sets.push(Vec::new());
            }
            sets[at[root] as usize].push(x);
        }
        sets
    }
}
