//! Seeds and proxies: flooding, fitting, reseeding, insertion and teleports.

use super::dual::{Dual, NONE, members};
use super::flood::Flood;
use super::proxy::{Moments, Proxy, Shape, Target};
use super::{Partition, Report};
use crate::mesh::geometry::angle;
use crate::mesh::id::FaceId;
use crate::watch::{Cancelled, Watch};

/// Seeds are inserted in rounds, at most this share of the regions there are, at least one. Smaller shares find less
/// error and take longer; one seed a round gains another two percent.
const INSERTED_SHARE: f64 = 0.1;
/// On large meshes seeds are inserted in fewer rounds: a face more is this much more of a share.
const INSERTED_SHARE_PER_FACE: f64 = 1e-6;
/// Rounds of flooding and fitting after each insertion.
const INNER_ITERATIONS: usize = 2;
/// The error has settled when it changes by a smaller share.
const SETTLED: f64 = 1e-3;
/// A region needs another seed if this share of its area turns too far.
const EXCUSED_AREA: f64 = 0.01;
/// Most teleports that are tried, and the most faces that they may flood: on large meshes each takes seconds.
const MOST_TELEPORTS: usize = 100;
const TELEPORTED_FACES: usize = 3_000_000;
/// Teleports into so many of the worst regions may fail one after the other; fewer on large meshes, so that these
/// trials flood no more faces than this each time.
const SKIPPED_REGIONS: usize = 12;
const SKIPPED_FACES: usize = 300_000;
/// More regions than this are never asked for by an angle: noise would make every face its own.
const MOST_REGIONS: usize = 100_000;

/// A partition in the making.
pub(super) struct State<'a> {
    pub(super) dual: &'a Dual,
    pub(super) shape: &'a Shape<'a>,
    flood: Flood,
    pub(super) labels: Vec<u32>,
    pub(super) seeds: Vec<u32>,
    pub(super) proxies: Vec<Proxy>,
    /// Error of each region.
    pub(super) errors: Vec<f64>,
    pub(super) moments: Vec<Moments>,
    pub(super) report: Report,
}

/// A number below `count` that depends on both others: the finaliser of SplitMix64.
fn pick(seed: u64, number: u64, count: usize) -> usize {
    let mut x = seed.wrapping_add(number.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15));
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((x ^ (x >> 31)) % count.max(1) as u64) as usize
}

impl<'a> State<'a> {
    /// One region for each cell.
    pub(super) fn new(dual: &'a Dual, shape: &'a Shape<'a>, seed: u64) -> Self {
        let cells = dual.cells();
        let report = Report { cells: cells.len(), ..Report::default() };
        let mut labels = vec![0; dual.len()];
        let mut seeds = Vec::with_capacity(cells.len());
        for (number, cell) in cells.iter().enumerate() {
            seeds.push(cell[pick(seed, number as u64, cell.len())]);
            for &f in cell {
                labels[f as usize] = number as u32;
            }
        }
        let (flood, proxies, errors, moments) = (Flood::default(), Vec::new(), Vec::new(), Vec::new());
        let mut state = Self { dual, shape, flood, labels, seeds, proxies, errors, moments, report };
        // Regions begin as flat as their seeds: the first flood so draws borders where seeds meet halfway.
        state.fit();
        state.proxies = state.seeds.iter().map(|&f| state.proxy_of_face(f)).collect();
        state
    }

    fn proxy_of_face(&self, face: u32) -> Proxy {
        self.shape.fit(&self.shape.moments(FaceId::from_raw(face))).0
    }

    pub(super) fn targets(&self) -> Vec<Target> {
        self.proxies.iter().map(|proxy| self.shape.target(proxy)).collect()
    }

    pub(super) fn total_error(&self) -> f64 {
        self.errors.iter().sum()
    }

    /// Fits proxies and errors to the labels.
    pub(super) fn fit(&mut self) {
        let mut sums = vec![Moments::default(); self.seeds.len()];
        for (f, &label) in self.labels.iter().enumerate() {
            if let Some(sum) = sums.get_mut(label as usize) {
                *sum = sum.plus(&self.shape.moments(FaceId::new(f)));
            }
        }
        (self.proxies, self.errors) = sums.iter().map(|sum| self.shape.fit(sum)).unzip();
        self.moments = sums;
    }

    /// Puts each seed where its region fits best.
    fn reseed(&mut self) {
        let targets = self.targets();
        let mut best = vec![f32::INFINITY; self.seeds.len()];
        for (f, &label) in self.labels.iter().enumerate() {
            let badness = self.shape.eccentricity(f as u32, &targets[label as usize]);
            if badness < best[label as usize] {
                best[label as usize] = badness;
                self.seeds[label as usize] = f as u32;
            }
        }
    }

    /// One round: flood, fit, reseed; the error afterwards.
    fn iterate(&mut self) -> f64 {
        let targets = self.targets();
        self.flood.run(self.dual, self.shape, &self.seeds, &targets, &mut self.labels);
        self.fit();
        self.reseed();
        self.report.iterations += 1;
        self.total_error()
    }

    /// Rounds until the error settles; keeps the best of them.
    pub(super) fn settle(&mut self, iterations: usize, watch: &Watch) -> Result<(), Cancelled> {
        let mut best = (self.total_error(), self.labels.clone(), self.seeds.clone());
        let mut before = f64::INFINITY;
        for _ in 0..iterations {
            watch.check()?;
            let error = self.iterate();
            if error < best.0 {
                best = (error, self.labels.clone(), self.seeds.clone());
            }
            self.report.has_settled = (before - error).abs() <= SETTLED * error;
            if self.report.has_settled {
                break;
            }
            before = error;
        }
        (_, self.labels, self.seeds) = best;
        self.fit();
        Ok(())
    }

    /// Inserts seeds into the regions of largest error until there are enough.
    pub(super) fn grow_to(&mut self, count: usize, watch: &Watch) -> Result<(), Cancelled> {
        while self.seeds.len() < count {
            watch.check()?;
            let share = INSERTED_SHARE.max(INSERTED_SHARE_PER_FACE * self.dual.len() as f64);
            let most = ((share * self.seeds.len() as f64) as usize).clamp(1, count - self.seeds.len());
            let mut order: Vec<usize> = (0..self.seeds.len()).collect();
            order.sort_by(|&a, &b| self.errors[b].total_cmp(&self.errors[a]).then(a.cmp(&b)));
            let worst = self.worst_faces();
            let new: Vec<u32> = order.into_iter().filter_map(|r| worst[r]).take(most).collect();
            if new.is_empty() {
                break;
            }
            self.insert(&new);
            for _ in 0..INNER_ITERATIONS {
                self.iterate();
            }
            watch.advance(self.seeds.len() as u64, || format!("{} regions", self.seeds.len()));
        }
        Ok(())
    }

    /// Inserts a seed into each region that turns too far until there is none.
    pub(super) fn grow_until(&mut self, angle: f64, watch: &Watch) -> Result<(), Cancelled> {
        loop {
            for _ in 0..=INNER_ITERATIONS {
                watch.check()?;
                self.iterate();
            }
            let worst = self.worst_faces();
            let bent = self.bent(angle);
            let new: Vec<u32> = bent.into_iter().filter_map(|r| worst[r]).collect();
            if new.is_empty() || self.seeds.len() + new.len() > MOST_REGIONS.max(self.report.cells) {
                return Ok(());
            }
            self.insert(&new);
            watch.advance(self.seeds.len() as u64, || format!("{} regions", self.seeds.len()));
        }
    }

    /// The face of each region with the largest error that is not its seed.
    fn worst_faces(&self) -> Vec<Option<u32>> {
        let targets = self.targets();
        let mut worst = vec![(0.0, None); self.seeds.len()];
        for (f, &label) in self.labels.iter().enumerate() {
            let error = self.shape.error(f as u32, &targets[label as usize]);
            if error > worst[label as usize].0 && self.seeds[label as usize] != f as u32 {
                worst[label as usize] = (error, Some(f as u32));
            }
        }
        worst.into_iter().map(|(_, face)| face).collect()
    }

    /// Regions of which more than the excused share turns by more than `limit`.
    fn bent(&self, limit: f64) -> Vec<usize> {
        let mut beyond = vec![0.0; self.seeds.len()];
        for (f, &label) in self.labels.iter().enumerate() {
            let f = FaceId::new(f);
            if angle(self.shape.normals[f], self.proxies[label as usize].normal) > limit {
                beyond[label as usize] += self.shape.area(f);
            }
        }
        (0..self.seeds.len()).filter(|&r| beyond[r] > EXCUSED_AREA * self.moments[r].area).collect()
    }

    fn insert(&mut self, faces: &[u32]) {
        for &face in faces {
            self.seeds.push(face);
            self.proxies.push(self.proxy_of_face(face));
            self.report.inserted += 1;
        }
    }

    /// Merges the neighbours that lose least and seeds the worst region instead, as long as that lowers the error.
    pub(super) fn teleport(&mut self, watch: &Watch) -> Result<(), Cancelled> {
        let mut skipped = 0;
        let most_skipped = (SKIPPED_FACES / self.dual.len().max(1)).clamp(1, SKIPPED_REGIONS);
        let most = (TELEPORTED_FACES / self.dual.len().max(1)).clamp(1, MOST_TELEPORTS);
        for _ in 0..most.min(self.seeds.len()) {
            watch.check()?;
            let before = (self.total_error(), self.labels.clone(), self.seeds.clone());
            let was_tried = self.try_teleport(skipped);
            if was_tried && self.total_error() < before.0 * (1.0 - SETTLED) {
                self.report.teleports += 1;
                skipped = 0;
                continue;
            }
            (_, self.labels, self.seeds) = before;
            self.fit();
            skipped += 1;
            if !was_tried || skipped > most_skipped {
                break;
            }
        }
        Ok(())
    }

    /// A teleport into the region of largest error but so many.
    fn try_teleport(&mut self, skipped: usize) -> bool {
        let pairs = self.merges();
        let worst_faces = self.worst_faces();
        let mut order: Vec<usize> = (0..self.seeds.len()).filter(|&r| worst_faces[r].is_some()).collect();
        order.sort_by(|&a, &b| self.errors[b].total_cmp(&self.errors[a]).then(a.cmp(&b)));
        let Some(&worst) = order.get(skipped) else { return false };
        let apart = |pair: &&(f64, [u32; 2])| !pair.1.contains(&(worst as u32));
        let (Some(&(loss, [kept, gone])), Some(face)) = (pairs.iter().find(apart), worst_faces[worst]) else {
            return false;
        };
        if loss >= 0.5 * self.errors[worst] {
            return false;
        }
        let merged = self.moments[kept as usize].plus(&self.moments[gone as usize]);
        self.proxies[kept as usize] = self.shape.fit(&merged).0;
        self.seeds[gone as usize] = face;
        self.proxies[gone as usize] = self.proxy_of_face(face);
        // The worst region begins anew where it differs most from the seed it lost, or that may fence its own in.
        let target = self.shape.target(&self.proxies[gone as usize]);
        let own = (0..self.labels.len() as u32).filter(|&f| self.labels[f as usize] == worst as u32 && f != face);
        let error = |f: u32| self.shape.error(f, &target);
        if let Some(other) = own.max_by(|&a, &b| error(a).total_cmp(&error(b)).then(b.cmp(&a))) {
            self.seeds[worst] = other;
            self.proxies[worst] = self.proxy_of_face(other);
        }
        for _ in 0..=2 * INNER_ITERATIONS {
            self.iterate();
        }
        true
    }

    /// The partition, its labels numbered by their lowest face.
    pub(super) fn finish(mut self) -> Partition {
        let mut new_of = vec![NONE; self.seeds.len()];
        let mut count = 0;
        for label in &mut self.labels {
            let new = &mut new_of[*label as usize];
            if *new == NONE {
                *new = count;
                count += 1;
            }
            *label = *new;
        }
        self.seeds = vec![NONE; count as usize];
        self.fit();
        let bend = |(f, label): (usize, &u32)| {
            angle(self.shape.normals[FaceId::new(f)], self.proxies[*label as usize].normal).to_degrees()
        };
        self.report.worst_angle = self.labels.iter().enumerate().map(bend).fold(0.0, f64::max);
        self.report.error = self.total_error();
        let disk = |faces: &Vec<u32>| super::dual::euler_characteristic(self.shape.surface(), faces) == 1;
        self.report.non_disks = members(&self.labels, count as usize).iter().filter(|faces| !disk(faces)).count();
        Partition { labels: self.labels.into(), proxies: self.proxies, report: self.report }
    }
}
