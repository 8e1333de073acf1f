//! Which attempt the next one starts from, and what it is asked for.
//!
//! Smaller faces in one region change its curves, and with them the regions beside it, for better or worse. So an attempt
//! that is worse than the best is not thrown away at once: a few more go on from it and mend what it made worse. When they
//! come to nothing, the next starts from the best again: still smaller faces are asked of regions that failed once, none of
//! those that failed twice.

use std::cmp::Ordering;

use super::check::{Wish, mean_side, mean_size, smaller};
use super::lack::shortfall;
use super::reuse::Attempt;
use crate::technique::ground::Ground;
use crate::technique::mixed::NONE;

/// How many attempts go on from one that is worse than the best.
const DETOUR: usize = 3;
/// Faces below this shape are not worth smaller ones for the sake of distance.
const USEFUL: f64 = 0.2;
/// A region is left alone after so many attempts that did not make it better, or others worse for its sake.
const FAILURES: u8 = 2;
/// The part of the size that the second of them asks for.
const AGAIN: f64 = 0.75;
/// The sides of faces in the place of a poor one, as a part of its own.
const ROOM: f64 = 0.7;
/// Where those are shorter than this part of the size asked for there, that part counts in their stead.
const LEAST_ROOM: f64 = 0.35;

/// The best attempt so far, and those that went on from it.
pub(super) struct Search {
    best: Attempt,
    asked: Asked,
    detour: Option<Detour>,
}

/// Attempts beyond one that is worse than the best.
struct Detour {
    /// The last one.
    reached: Attempt,
    asked: Asked,
    /// How many there were.
    steps: usize,
}

impl Search {
    pub(super) fn new(first: Attempt) -> Self {
        let asked = Asked::new(first.by_region.len());
        Self { best: first, asked, detour: None }
    }

    pub(super) fn into_best(self) -> Attempt {
        self.best
    }

    /// What the next attempt starts from.
    pub(super) fn from(&self) -> &Attempt {
        self.detour.as_ref().map_or(&self.best, |detour| &detour.reached)
    }

    /// Where the next attempt should have smaller faces; nowhere where no more should be made.
    pub(super) fn places(&mut self, tolerance: f64) -> Vec<Wish> {
        if let Some(detour) = &mut self.detour {
            let places = detour.asked.places(&detour.reached, tolerance);
            if !places.is_empty() {
                return places;
            }
            self.detour = None;
        }
        self.asked.places(&self.best, tolerance)
    }

    /// Takes in what became of the attempt at those places; `None` where nothing changed.
    pub(super) fn learn(&mut self, next: Option<Attempt>, ground: &Ground<'_>) {
        let (from, asked, steps) = match &self.detour {
            Some(detour) => (&detour.reached, &detour.asked, detour.steps),
            None => (&self.best, &self.asked, 0),
        };
        let onwards = asked.after(&from.by_region, next.as_ref().map(|next| &*next.by_region));
        match next {
            Some(next) if next.is_better_than(&self.best) => {
                *self = Self { best: next, asked: onwards, detour: None };
            }
            Some(next) if steps < DETOUR => {
                if steps == 0 {
                    self.asked.blame(&self.best.by_region, Some(&next.by_region), ground);
                }
                self.detour = Some(Detour { reached: next, asked: onwards, steps: steps + 1 });
            }
            _ => {
                self.asked.blame(&self.best.by_region, None, ground);
                self.detour = None;
            }
        }
    }
}

/// What to ask of the next attempt, by what became of those before.
#[derive(Clone)]
struct Asked {
    /// By region, how often an attempt did not make it better, or others worse for its sake.
    failures: Vec<u8>,
    /// The regions that the attempt asked for is to make better.
    regions: Vec<bool>,
}

impl Asked {
    fn new(regions: usize) -> Self {
        Self { failures: vec![0; regions], regions: vec![false; regions] }
    }

    /// Where the next attempt should have smaller faces: at faults of sound faces, and at poor faces, whose strips get
    /// more room for good ones. Where one failed, still smaller; not in regions where two did.
    fn places(&mut self, from: &Attempt, tolerance: f64) -> Vec<Wish> {
        let mesh = &from.quads;
        let wants = |f: u32| self.failures[mesh.region(f) as usize] < FAILURES;
        let again = |f: u32| libm::pow(AGAIN, f64::from(self.failures[mesh.region(f) as usize]));
        let mut asked = vec![false; self.regions.len()];
        let mut places = Vec::new();
        for fault in from.faults.iter().filter(|fault| wants(fault.face) && mesh.quality(fault.face) > USEFUL) {
            // Quads may come out larger than they were to be.
            let side = mean_side(mesh, fault.face).min(mean_size(mesh, fault.face));
            let (at, reach, size) = smaller(mesh, fault, side, tolerance);
            places.push((at, reach, again(fault.face) * size));
            asked[mesh.region(fault.face) as usize] = true;
        }
        for f in mesh.faces().filter(|&f| wants(f) && shortfall(mesh, f) > 0.0) {
            // A sliver's sides say nothing about what would do in its place.
            let side = mean_side(mesh, f).max(LEAST_ROOM * mean_size(mesh, f));
            places.push((mesh.centre(f), 1.2 * side, again(f) * ROOM * side));
            asked[mesh.region(f) as usize] = true;
        }
        self.regions = asked;
        places
    }

    /// What to ask after an attempt, if one goes on from there.
    fn after(&self, before: &[f64], after: Option<&[f64]>) -> Self {
        let mut next = self.clone();
        for (r, failures) in next.failures.iter_mut().enumerate() {
            match after.map(|after| after[r].total_cmp(&before[r])) {
                Some(Ordering::Less) => *failures = 0,
                Some(Ordering::Greater) => *failures += 1,
                Some(Ordering::Equal) | None => *failures += u8::from(self.regions[r]),
            }
        }
        next
    }

    /// Counts a failure, after an attempt that was not better, for the regions asked that did not get better or border on one
    /// that got worse; for all where that is none.
    fn blame(&mut self, before: &[f64], after: Option<&[f64]>, ground: &Ground<'_>) {
        let is_worse = |r: usize| after.is_some_and(|after| after[r] > before[r]);
        let mut spoils = vec![false; before.len()];
        for sides in ground.beside.iter().filter(|sides| !sides.contains(&NONE)) {
            let [r, s] = sides.map(|region| region as usize);
            spoils[r] |= is_worse(s);
            spoils[s] |= is_worse(r);
        }
        let is_better = |r: usize| after.is_some_and(|after| after[r] < before[r]);
        let asked: Vec<usize> = (0..before.len()).filter(|&r| self.regions[r]).collect();
        let nobody = !asked.iter().any(|&r| spoils[r] || !is_better(r));
        for r in asked {
            self.failures[r] += u8::from(nobody || spoils[r] || !is_better(r));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_got_better_is_asked_for_afresh() {
        let asked = Asked { failures: vec![1, 1, 0, 0], regions: vec![true, true, true, false] };
        let onwards = asked.after(&[1.0, 1.0, 1.0, 1.0], Some(&[0.5, 2.0, 1.0, 1.0]));
        assert_eq!(onwards.failures, [0, 2, 1, 0], "better, worse, asked in vain, not asked");
        assert_eq!(asked.after(&[1.0; 4], None).failures, [2, 2, 1, 0]);
    }
}
