//! What earlier decisions found to be within a threshold, so that it need not be looked at again.
//!
//! A triangle of the first mesh is within because some triangles of the second are near enough to all of it. As long as
//! these are there, nothing that changes elsewhere can make it farther. So of two meshes that are compared again and
//! again while one of them changes, only what changed is compared anew, with the same outcome.

use rayon::prelude::*;
use rustc_hash::FxHashMap;
use smallvec::SmallVec;

use super::Target;
use super::piece::Bound;

/// The coordinates of a triangle, hashed: two that differ have the same one time in 10³⁸.
pub(super) type Key = u128;

pub(super) fn key_of(triangle: &[glam::DVec3; 3]) -> Key {
    let mut hasher = blake3::Hasher::new();
    for coordinate in triangle.iter().flat_map(glam::DVec3::to_array) {
        hasher.update(&coordinate.to_le_bytes());
    }
    let mut key = [0; 16];
    hasher.finalize_xof().fill(&mut key);
    Key::from_le_bytes(key)
}

/// See the module. One for each direction between two meshes.
#[derive(Clone, Debug, Default)]
pub struct Memo {
    threshold: f64,
    /// Triangles of the first mesh, each with those of the second that show it to be within.
    within: FxHashMap<Key, SmallVec<[Key; 2]>>,
}

/// A triangle that so many others show to be within is cheaper to look at again.
const MOST_PROOFS: usize = 256;

impl Memo {
    /// Which triangles of a mesh are known to be within of another.
    pub(super) fn known(&mut self, from: &Target, to: &Target, threshold: f64) -> Vec<bool> {
        self.forget(from, threshold);
        let present = to.key_set();
        let holds = |by: &SmallVec<[Key; 2]>| by.iter().all(|key| present.contains(key));
        from.keys().par_iter().map(|key| self.within.get(key).is_some_and(holds)).collect()
    }

    /// Keeps what was found of a triangle, where it is within.
    pub(super) fn learn(&mut self, from: &Target, triangle: usize, bound: &Bound, to: &Target) {
        if bound.upper <= self.threshold && bound.by.len() <= MOST_PROOFS {
            let mut by = bound.by.clone();
            by.sort_unstable();
            by.dedup();
            let by = by.iter().map(|&t| to.keys()[t as usize]).collect();
            self.within.insert(from.keys()[triangle], by);
        }
    }

    /// Forgets what was found for another threshold, and, when there is much of it, what the first mesh no longer has.
    fn forget(&mut self, from: &Target, threshold: f64) {
        /// Times the triangles that there are.
        const MUCH: usize = 4;
        if self.threshold.to_bits() != threshold.to_bits() {
            *self = Self { threshold, ..Self::default() };
        }
        if self.within.len() > MUCH * from.triangles.len() {
            self.within.retain(|key, _| from.key_set().contains(key));
        }
    }
}
