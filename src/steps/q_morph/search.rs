//! Which attempt the next one starts from, and what it is asked for.
//!
//! Smaller faces in one region change its curves, and with them the regions beside it, for better or worse. So an
//! attempt that is worse than the best is not thrown away at once: a few more go on from it and mend what it made
//! worse. When they come to nothing, the next starts from the best again: still smaller faces are asked of regions that
//! failed once, none of those that failed twice.

use std::cmp::Ordering;

use super::check::{Wish, mean_side, mean_size, smaller};
use super::lack::shortfall;
use super::reuse::Attempt;
use crate::technique::ground::Ground;
use crate::technique::isotropic::Rules;
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
    pub(super) fn places(&mut self, rules: Rules) -> Vec<Wish> {
        if let Some(detour) = &mut self.detour {
            let places = detour.asked.places(&detour.reached, rules);
            if !places.is_empty() {
                return places;
            }
            self.detour = None;
        }
        self.asked.places(&self.best, rules)
    }

    /// Takes in what became of the attempt at those places; `None` where nothing changed.
    pub(super) fn learn(&mut self, next: Option<Attempt>, ground: &Ground<'_>) {
        let (from, asked) = match &self.detour {
            Some(detour) => (&detour.reached, &detour.asked),
            None => (&self.best, &self.asked),
        };
        let onwards = asked.after(&from.by_region, next.as_ref().map(|next| &*next.by_region));
        match (next, &mut self.detour) {
            (Some(next), _) if next.is_better_than(&self.best) => {
                *self = Self { best: next, asked: onwards, detour: None };
            }
            (Some(next), None) => {
                self.asked.blame(&self.best.by_region, Some(&next.by_region), ground);
                self.detour = Some(Detour { reached: next, asked: onwards, steps: 1 });
            }
            (None, None) => self.asked.blame(&self.best.by_region, None, ground),
            // What led here was blamed when the detour began.
            (_, Some(detour)) if detour.steps == DETOUR => self.detour = None,
            (next, Some(detour)) => {
                if let Some(next) = next {
                    detour.reached = next;
                }
                (detour.asked, detour.steps) = (onwards, detour.steps + 1);
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
    /// What was asked for last.
    wishes: Vec<Wish>,
}

impl Asked {
    fn new(regions: usize) -> Self {
        Self { failures: vec![0; regions], regions: vec![false; regions], wishes: Vec::new() }
    }

    /// Where the next attempt should have smaller faces: at faults of sound faces, and at poor faces, whose strips get
    /// more room for good ones. Where one failed, still smaller; not in regions where two did.
    fn places(&mut self, from: &Attempt, rules: Rules) -> Vec<Wish> {
        let mesh = &from.quads;
        let wants = |f: u32| self.failures[mesh.region(f) as usize] < FAILURES;
        let again = |f: u32| libm::pow(AGAIN, f64::from(self.failures[mesh.region(f) as usize]));
        let mut asked = vec![false; self.regions.len()];
        let mut places = Vec::new();
        for fault in from.flaws.faults.iter().filter(|fault| wants(fault.face) && mesh.quality(fault.face) > USEFUL) {
            // Quads may come out larger than they were to be.
            let side = mean_side(mesh, fault.face).min(mean_size(mesh, fault.face));
            let (at, reach, size) = smaller(mesh, fault, side, rules.tolerance);
            places.push((at, reach, again(fault.face) * size));
            asked[mesh.region(fault.face) as usize] = true;
        }
        let poor = mesh.faces().filter(|&f| shortfall(mesh, f) > 0.0);
        for f in poor.chain(from.flaws.crossing.iter().copied()).filter(|&f| wants(f)) {
            // A sliver's sides say nothing about what would do in its place.
            let side = mean_side(mesh, f).max(LEAST_ROOM * mean_size(mesh, f));
            places.push((mesh.centre(f), 1.2 * side, again(f) * ROOM * side));
            asked[mesh.region(f) as usize] = true;
        }
        for (_, _, size) in &mut places {
            *size = size.max(rules.floor);
        }
        // The same wishes lead to the same attempt: where sizes are at the floor, failures do not lower them.
        if places == self.wishes {
            return Vec::new();
        }
        self.wishes.clone_from(&places);
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

    /// Counts a failure, after an attempt that was not better, for the regions asked that did not get better or border
    /// on one that got worse; for all where that is none.
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

    const RULES: Rules = Rules {
        tolerance: 0.1,
        curve_tolerance: 0.1,
        shortest: 0.0,
        least_size: 0.1,
        floor: 1e-3,
        gradation: 0.3,
        most_faces: usize::MAX,
    };

    #[test]
    fn what_got_better_is_asked_for_afresh() {
        let asked = Asked { failures: vec![1, 1, 0, 0], regions: vec![true, true, true, false], wishes: Vec::new() };
        let onwards = asked.after(&[1.0, 1.0, 1.0, 1.0], Some(&[0.5, 2.0, 1.0, 1.0]));
        assert_eq!(onwards.failures, [0, 2, 1, 0], "better, worse, asked in vain, not asked");
        assert_eq!(asked.after(&[1.0; 4], None).failures, [2, 2, 1, 0]);
    }

    /// An attempt that lacks so much in each of its regions, with a poor quad in each.
    fn attempt(by_region: [f64; 2]) -> Attempt {
        let bent = |x: f64| [[0.0, 0.0], [1.0, 0.0], [0.4, 0.3], [0.0, 1.0]].map(|[a, b]| glam::dvec3(x + a, b, 0.0));
        let points: Vec<_> = [bent(0.0), bent(5.0)].concat();
        let mut quads = crate::technique::mixed::Mixed::of_faces(&points, &[&[0, 1, 2, 3], &[4, 5, 6, 7]]).unwrap();
        quads.set_region(1, 1);
        Attempt { quads, lack: by_region.iter().sum(), by_region: by_region.to_vec(), ..Attempt::default() }
    }

    fn learn(search: &mut Search, next: Option<[f64; 2]>) {
        let surface = crate::mesh::Surface::default();
        search.learn(next.map(attempt), &Ground::new(&surface));
    }

    #[test]
    fn a_detour_goes_on_from_worse_attempts_and_is_blamed_once() {
        let mut search = Search::new(attempt([1.0, 1.0]));
        let first = search.places(RULES);
        assert_eq!(first.len(), 2);
        // Worse: the first region got better, the second worse.
        learn(&mut search, Some([0.5, 2.0]));
        assert_eq!(search.from().by_region, [0.5, 2.0], "it goes on from there");
        assert_eq!(search.asked.failures, [0, 1]);
        for _ in 0..2 {
            assert!(!search.places(RULES).is_empty());
            learn(&mut search, Some([0.5, 1.9]));
        }
        assert!(search.detour.is_some());
        search.places(RULES);
        learn(&mut search, Some([0.5, 1.8]));
        assert!(search.detour.is_none(), "three steps are enough");
        assert_eq!(search.from().by_region, [1.0, 1.0], "the best is kept");
        assert_eq!(search.asked.failures, [0, 1], "the detour counts once");
        let second = search.places(RULES);
        assert_eq!(second.len(), 2);
        assert!(second[1].2 < first[1].2, "smaller where it failed");
        learn(&mut search, Some([0.1, 0.2]));
        assert_eq!(search.into_best().by_region, [0.1, 0.2]);
    }

    #[test]
    fn faces_that_others_pass_through_are_to_be_smaller() {
        let square = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(|[x, y]| glam::dvec3(x, y, 0.0));
        let quads = crate::technique::mixed::Mixed::of_faces(&square, &[&[0, 1, 2, 3]]).unwrap();
        let mut crossed = Attempt { quads, lack: 0.1, by_region: vec![0.1], ..Attempt::default() };
        assert!(crossed.is_good());
        crossed.flaws.crossing.push(0);
        assert!(!crossed.is_good() && !crossed.is_fair());
        let places = Search::new(crossed).places(RULES);
        assert_eq!(places, [(glam::dvec3(0.5, 0.5, 0.0), 1.2, ROOM)]);
    }

    #[test]
    fn the_same_is_not_asked_twice() {
        let rules = Rules { least_size: 9.0, floor: 9.0, ..RULES };
        let mut search = Search::new(attempt([1.0, 1.0]));
        assert_eq!(search.places(rules).len(), 2);
        learn(&mut search, None);
        assert!(search.places(rules).is_empty(), "sizes are at the floor");
    }
}
