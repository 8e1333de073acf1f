//! How much work there may be, so that every part comes to an end.
//!
//! Work is counted in faces: those that an attempt makes, and those of every piece that is drawn anew. Both cost about
//! the same for a face. The limit is a function of the first triangles, never of the clock, so that results are the
//! same on every machine.

use std::cell::Cell;

/// Faces that any part may cost.
const ALWAYS: u64 = 250_000;
/// How often all faces of a large part may be made.
const TIMES: u64 = 4;

/// Triangles that any part may have at first.
pub(super) const FEW: usize = 40_000;
/// How many times the faces that the size asks for curves and narrow strips may make of them.
pub(super) const LOWERED: f64 = 12.0;

/// What quads may lack for one of them, and of how many more that counts: beyond it so many are broken that no more
/// work mends them.
const HOPELESS: f64 = 0.05;
const BESIDE: f64 = 10_000.0;

/// Whether so many quads that lack so much together are beyond all mending.
pub(super) fn is_hopeless(lack: f64, faces: usize) -> bool {
    lack > HOPELESS * (BESIDE + faces as f64)
}

/// How many triangles there may be at first, where the size asks for so many faces.
pub(super) fn most_triangles(wanted: f64) -> usize {
    FEW.saturating_add((LOWERED * wanted) as usize)
}

/// Faces that may still be made.
#[derive(Clone, Debug)]
pub(super) struct Budget {
    left: Cell<u64>,
}

impl Budget {
    /// For a part of so many triangles.
    pub(super) fn of(triangles: usize) -> Self {
        Self { left: Cell::new(ALWAYS.max(TIMES * triangles as u64)) }
    }

    /// Notes work that is done.
    pub(super) fn spend(&self, faces: usize) {
        self.left.set(self.left.get().saturating_sub(faces as u64));
    }

    /// How many faces may still be made.
    #[cfg(test)]
    pub(super) fn left(&self) -> u64 {
        self.left.get()
    }

    /// Whether nothing more should be begun.
    pub(super) fn is_spent(&self) -> bool {
        self.left.get() == 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn some_broken_quads_are_mended_and_hundreds_are_not() {
        assert!(!is_hopeless(10.0, 1), "one broken quad");
        assert!(!is_hopeless(300.0, 1_000));
        assert!(is_hopeless(2_300.0, 4_000));
        assert!(!is_hopeless(2_300.0, 100_000));
    }

    #[test]
    fn large_parts_may_be_made_four_times_over() {
        let budget = Budget::of(1_000_000);
        for _ in 0..3 {
            budget.spend(1_000_000);
            assert!(!budget.is_spent());
        }
        budget.spend(1_000_001);
        assert!(budget.is_spent());
        let small = Budget::of(12);
        small.spend(249_999);
        assert!(!small.is_spent());
    }
}
