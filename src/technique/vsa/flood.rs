//! Growing all regions at once from their seeds, always by the face that fits best.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use super::dual::{Dual, NONE};
use super::proxy::{Shape, Target};

/// Memory of floods, kept from one to the next.
///
/// A face waits with its least error so far and the region that has it; an entry with a larger error is never looked
/// at, because by then the face is taken. So the heap holds plain 8-byte keys, error before face: errors are not
/// negative, and then their bits are in order.
#[derive(Default)]
pub(super) struct Flood {
    heap: BinaryHeap<Reverse<u64>>,
    least: Vec<f32>,
    suitor: Vec<u32>,
}

impl Flood {
    /// The region of each face: the one of the seed whose growth reached it. `labels` is [`NONE`] where none did.
    pub(super) fn run(
        &mut self,
        dual: &Dual,
        shape: &Shape<'_>,
        seeds: &[u32],
        targets: &[Target],
        labels: &mut [u32],
    ) {
        self.heap.clear();
        self.least.clear();
        self.least.resize(dual.len(), f32::INFINITY);
        self.suitor.resize(dual.len(), NONE);
        labels.fill(NONE);
        for (region, &seed) in seeds.iter().enumerate() {
            labels[seed as usize] = region as u32;
        }
        for (region, &seed) in seeds.iter().enumerate() {
            self.court(dual, shape, seed, region as u32, &targets[region], labels);
        }
        while let Some(Reverse(key)) = self.heap.pop() {
            let face = key as u32;
            if labels[face as usize] == NONE {
                let region = self.suitor[face as usize];
                labels[face as usize] = region;
                self.court(dual, shape, face, region, &targets[region as usize], labels);
            }
        }
    }

    /// Offers the neighbours of a face to its region.
    fn court(&mut self, dual: &Dual, shape: &Shape<'_>, face: u32, region: u32, target: &Target, labels: &[u32]) {
        for n in dual.open[face as usize] {
            if n == NONE || labels[n as usize] != NONE {
                continue;
            }
            // What overflowed, or is no number, comes last.
            let error = shape.error(n, target).min(f32::MAX);
            if error < self.least[n as usize] {
                self.least[n as usize] = error;
                self.suitor[n as usize] = region;
                self.heap.push(Reverse(u64::from(error.to_bits()) << 32 | u64::from(n)));
            }
        }
    }
}
