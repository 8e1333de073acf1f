//! Sizes: lowered where they prove too large, and graded.

use super::Remesher;
use crate::technique::mixed::{NONE, Place};

/// The part of the tolerance that chords of triangles may use: quads made of them lie farther away.
pub(super) const SHARE: f64 = 0.4;

impl Remesher<'_, '_> {
    /// Lowers sizes where chords leave the surface, and where two curves are nearer than the size. Whether it did.
    pub(super) fn lower_sizes(&mut self) -> bool {
        let tolerance = SHARE * self.rules.tolerance;
        let mut wishes: Vec<(u32, f64)> = Vec::new();
        for h in self.mesh.edges() {
            if !self.is_inner(h) {
                continue;
            }
            let ends = [self.mesh.origin(h), self.mesh.target(h)];
            let length = self.mesh.length(h);
            let middle = 0.5 * (self.mesh.point(ends[0]) + self.mesh.point(ends[1]));
            let off = self
                .ground
                .project_from(self.mesh.region(self.mesh.face(h)), middle, self.mesh.point(ends[0]))
                .distance_squared
                .sqrt();
            if off > tolerance {
                let factor = (tolerance / off).sqrt().max(0.5);
                wishes.extend(ends.map(|v| (v, factor * length.min(self.mesh.size(v)))));
            }
            if self.is_gap(h) {
                wishes.extend(ends.map(|v| (v, length)));
            }
        }
        let mut lowered = false;
        for (v, size) in wishes {
            let size = size.max(self.rules.least_size);
            if size < 0.93 * self.mesh.size(v) {
                self.mesh.set_size(v, size);
                lowered = true;
            }
        }
        lowered
    }

    /// Whether an edge crosses a strip between two curves, not a corner where they meet.
    fn is_gap(&self, h: u32) -> bool {
        let bound = |v: u32| !self.mesh.place(v).is_free();
        if !bound(self.mesh.origin(h)) || !bound(self.mesh.target(h)) {
            return false;
        }
        let cuts_corner = |k: u32| {
            let face = self.mesh.face(k);
            if face == NONE {
                return false;
            }
            self.mesh.arc(self.mesh.next(k)) != NONE
                && self.mesh.arc(self.mesh.prev(k)) != NONE
                && self.mesh.corner_angle(self.mesh.prev(k)) < 2.6
                && self.mesh.place(self.mesh.origin(self.mesh.prev(k))) == Place::Node
        };
        !cuts_corner(h) && !cuts_corner(h ^ 1)
    }

    /// Lets no size exceed a neighbour's by more than the gradation allows.
    pub(super) fn grade(&mut self) {
        let mut heap = std::collections::BinaryHeap::new();
        for v in self.mesh.vertices() {
            heap.push(std::cmp::Reverse((Key(self.mesh.size(v)), v)));
        }
        while let Some(std::cmp::Reverse((Key(size), v))) = heap.pop() {
            if size > self.mesh.size(v) {
                continue;
            }
            let around: smallvec::SmallVec<[u32; 12]> = self.mesh.star(v).collect();
            for h in around {
                let (w, limit) = (self.mesh.target(h), size + self.rules.gradation * self.mesh.length(h));
                if limit < self.mesh.size(w) {
                    self.mesh.set_size(w, limit);
                    heap.push(std::cmp::Reverse((Key(limit), w)));
                }
            }
        }
    }
}

/// A number with a total order.
#[derive(PartialEq)]
struct Key(f64);
impl Eq for Key {}
impl PartialOrd for Key {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}
impl Ord for Key {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.0.total_cmp(&other.0)
    }
}
