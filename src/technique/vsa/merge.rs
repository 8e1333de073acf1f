//! Merges of neighbours, and borders without teeth.

use super::dual::{NONE, adjacent, members};
use super::grow::State;
use crate::mesh::geometry::angle;
use crate::mesh::id::FaceId;
use crate::watch::{Cancelled, Watch};

/// Regions of fewer faces than this, or a smaller share of the area, are merged away where an angle asks for regions.
const SMALL_FACES: usize = 8;
const SMALL_AREA: f64 = 0.002;
/// A face may change its region to straighten a border if its error grows by no more than this factor.
const SMOOTHING_LOSS: f32 = 1.1;
/// Rounds over the borders; the second finds next to nothing.
const SMOOTHING_ROUNDS: usize = 3;

impl State<'_> {
    /// Neighbours with what merging them would add to the error, least first.
    pub(super) fn merges(&self) -> Vec<(f64, [u32; 2])> {
        let loss = |[a, b]: [u32; 2]| {
            let [a, b] = [a as usize, b as usize];
            let (_, merged) = self.shape.fit(&self.moments[a].plus(&self.moments[b]));
            merged - self.errors[a] - self.errors[b]
        };
        let mut pairs: Vec<(f64, [u32; 2])> =
            adjacent(self.dual, &self.labels).into_iter().map(|pair| (loss(pair), pair)).collect();
        pairs.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        pairs
    }

    /// Merges neighbours whose faces together turn by no more than `limit` from their common proxy.
    pub(super) fn merge_planes(&mut self, limit: f64, watch: &Watch) -> Result<(), Cancelled> {
        loop {
            watch.check()?;
            let faces = members(&self.labels, self.seeds.len());
            let is_one = |[a, b]: [u32; 2]| {
                let [a, b] = [a as usize, b as usize];
                let (proxy, _) = self.shape.fit(&self.moments[a].plus(&self.moments[b]));
                let mut all = faces[a].iter().chain(&faces[b]);
                all.all(|&f| angle(self.shape.normals[FaceId::from_raw(f)], proxy.normal) <= limit)
            };
            let mut target: Vec<u32> = (0..self.seeds.len() as u32).collect();
            let mut touched = vec![false; self.seeds.len()];
            for (_, [a, b]) in self.merges() {
                if !touched[a as usize] && !touched[b as usize] && is_one([a, b]) {
                    target[b as usize] = a;
                    touched[a as usize] = true;
                    touched[b as usize] = true;
                }
            }
            if self.apply(&target) == 0 {
                return Ok(());
            }
        }
    }

    /// Merges small regions into the neighbour that loses least, where their normals differ by no more than `limit`.
    pub(super) fn merge_small(&mut self, limit: f64) {
        loop {
            let mut faces = vec![0; self.seeds.len()];
            for &label in &self.labels {
                faces[label as usize] += 1;
            }
            let least = SMALL_AREA * self.moments.iter().map(|m| m.area).sum::<f64>();
            let is_small = |r: u32| faces[r as usize] < SMALL_FACES || self.moments[r as usize].area < least;
            let mut target: Vec<u32> = (0..self.seeds.len() as u32).collect();
            let mut touched = vec![false; self.seeds.len()];
            for (_, [a, b]) in self.merges() {
                let turn = angle(self.proxies[a as usize].normal, self.proxies[b as usize].normal);
                if (is_small(a) || is_small(b)) && turn <= limit && !touched[a as usize] && !touched[b as usize] {
                    target[b as usize] = a;
                    touched[a as usize] = true;
                    touched[b as usize] = true;
                }
            }
            if self.apply(&target) == 0 {
                return;
            }
        }
    }

    /// Gives the regions their targets, closes gaps in the numbers and fits anew; returns how many merged.
    fn apply(&mut self, target: &[u32]) -> usize {
        let mut new_of = vec![NONE; target.len()];
        let mut kept = Vec::new();
        for (region, &to) in target.iter().enumerate() {
            if region as u32 == to {
                new_of[region] = kept.len() as u32;
                kept.push(self.seeds[region]);
            }
        }
        let merged = target.len() - kept.len();
        for label in &mut self.labels {
            *label = new_of[target[*label as usize] as usize];
        }
        self.seeds = kept;
        self.report.merged += merged;
        self.fit();
        merged
    }

    /// Moves faces that stick out of their region, with two of three sides in another, where they fit there too.
    ///
    /// The regions stay connected and keep their shape: what is added lies with all corners on its new region, and
    /// what is taken hung on one side.
    pub(super) fn smooth_borders(&mut self) {
        let targets = self.targets();
        for _ in 0..SMOOTHING_ROUNDS {
            let mut moved = 0;
            for f in 0..self.dual.len() as u32 {
                let own = self.labels[f as usize];
                let Some(other) = self.majority(f) else { continue };
                let [here, there] = [own, other].map(|r| self.shape.error(f, &targets[r as usize]));
                if there <= SMOOTHING_LOSS * here {
                    self.labels[f as usize] = other;
                    moved += 1;
                }
            }
            self.report.moved_faces += moved;
            if moved == 0 {
                break;
            }
        }
        self.fit();
    }

    /// The other region beyond two of a face's sides, if the third side is its own region's.
    fn majority(&self, f: u32) -> Option<u32> {
        let own = self.labels[f as usize];
        let sides = self.dual.all[f as usize].map(|n| if n == NONE { NONE } else { self.labels[n as usize] });
        let open = self.dual.open[f as usize];
        let k = sides.iter().position(|&r| r == own)?;
        let [a, b] = [sides[(k + 1) % 3], sides[(k + 2) % 3]];
        let free = open[(k + 1) % 3] != NONE && open[(k + 2) % 3] != NONE;
        (a == b && a != own && a != NONE && free).then_some(a)
    }
}
