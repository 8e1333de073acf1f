//! Which patches get more spans: those too far from the mesh, as long as more spans help, and those whose seams bend.

use std::collections::BTreeSet;

use super::FitRules;
use crate::mesh::patches::Seam;

/// Seams that bend by more degrees are edges of the shape, which more spans do not level.
const CREASE: f64 = 45.0;

/// The spans of each patch in both directions, powers of two, so that knots of neighbours are nested.
#[derive(Clone, Debug)]
pub(super) struct Spans {
    counts: Vec<usize>,
    /// The spans and the error before the last doublings, until their outcome is known.
    tried: Vec<Option<(usize, f64)>>,
    is_settled: Vec<bool>,
}

impl Spans {
    /// One span each.
    pub(super) fn new(patches: usize) -> Self {
        Self { counts: vec![1; patches], tried: vec![None; patches], is_settled: vec![false; patches] }
    }

    /// The spans of each patch.
    pub(super) fn counts(&self) -> &[usize] {
        &self.counts
    }

    /// Doubles the spans of what is not good enough, and takes back what did not help; whether anything changed.
    ///
    /// A bend or a ripple needs several times the spans before they help at all, so doublings go on while there is
    /// room. What was taken back is not tried again, so that this ends: vertices of a coarse mesh have folds between
    /// them that a patch of more spans follows, and curves that its neighbours must follow then.
    pub(super) fn refine(&mut self, errors: &[f64], samples: &[usize], rules: &FitRules) -> bool {
        let mut changed = false;
        for (e, &now) in errors.iter().enumerate() {
            if self.is_settled[e] {
                continue;
            }
            let before = self.tried[e].filter(|&(_, before)| !helps(before, now, rules));
            if self.has_room(e, samples[e], rules) && now > rules.tolerance {
                self.tried[e] = Some(before.unwrap_or((self.counts[e], now)));
                self.counts[e] *= 2;
                changed = true;
            } else if let Some((spans, _)) = before {
                self.counts[e] = spans;
                self.is_settled[e] = true;
                changed = true;
            }
        }
        changed
    }

    /// Gives patches whose smooth seams bend too much the spans that common planes take; whether any got more.
    ///
    /// Along a seam the plane turns with the curve on it and with both patches, and a cubic cannot follow both of its
    /// sides and the samples too. What leaves the tolerance for it is taken back by [`Self::refine`].
    pub(super) fn level(&mut self, seams: &[Seam], errors: &[f64], samples: &[usize], rules: &FitRules) -> bool {
        let Some(limit) = rules.smooth else { return false };
        let steep = seams.iter().filter(|seam| seam.is_smooth && seam.angle > limit && seam.angle < CREASE);
        let patches: BTreeSet<usize> = steep.flat_map(|seam| seam.patches).map(|patch| patch as usize).collect();
        let mut changed = false;
        for e in patches {
            if !self.is_settled[e] && errors[e] <= rules.tolerance && self.has_room(e, samples[e], rules) {
                self.tried[e] = Some((self.counts[e], errors[e]));
                self.counts[e] *= 2;
                changed = true;
            }
        }
        changed
    }

    /// With fewer samples than control points there would be nothing to go by.
    fn has_room(&self, e: usize, samples: usize, rules: &FitRules) -> bool {
        let spans = self.counts[e];
        2 * spans <= rules.max_spans && (2 * spans + 1) * (2 * spans + 1) <= samples
    }
}

/// Whether a patch beyond the tolerance is within it now, or clearly better.
fn helps(before: f64, now: f64, rules: &FitRules) -> bool {
    /// Of what it was.
    const BETTER: f64 = 0.8;
    now <= rules.tolerance || now <= BETTER * before
}

#[cfg(test)]
mod tests {
    use super::*;

    const RULES: FitRules = FitRules { tolerance: 1.0, max_spans: 8, fairness: 1e-6, density: 4, smooth: Some(2.0) };

    #[test]
    fn what_no_doubling_helps_is_taken_back_and_not_tried_again() {
        let mut spans = Spans::new(2);
        let mut counts = Vec::new();
        while spans.refine(&[3.0, 0.5], &[1_000, 1_000], &RULES) {
            counts.push(spans.counts().to_vec());
        }
        assert_eq!(counts, [[2, 1], [4, 1], [8, 1], [1, 1]]);
    }

    #[test]
    fn what_a_later_doubling_helps_stays() {
        let mut spans = Spans::new(1);
        for error in [3.0, 2.9, 0.9] {
            spans.refine(&[error], &[1_000], &RULES);
        }
        assert_eq!(spans.counts(), [4]);
        assert!(!spans.refine(&[0.9], &[1_000], &RULES));
    }

    #[test]
    fn patches_beside_a_steep_smooth_seam_get_more_spans() {
        let seam = |patches, angle, is_smooth| Seam { patches, angle, is_smooth };
        let seams =
            [seam([0, 1], 3.0, true), seam([1, 2], 1.9, true), seam([3, 4], 30.0, false), seam([4, 5], 60.0, true)];
        let mut spans = Spans::new(6);
        let samples = [1_000, 20, 1_000, 1_000, 1_000, 1_000];
        while spans.level(&seams, &[0.5; 6], &samples, &RULES) {}
        assert_eq!(spans.counts(), [8, 2, 1, 1, 1, 1]);
    }

    #[test]
    fn spans_for_a_seam_that_cost_the_tolerance_are_taken_back() {
        let seams = [Seam { patches: [0, 1], angle: 3.0, is_smooth: true }];
        let rules = FitRules { max_spans: 2, ..RULES };
        let mut spans = Spans::new(2);
        assert!(spans.level(&seams, &[0.5; 2], &[1_000; 2], &rules));
        assert!(spans.refine(&[1.5, 0.5], &[1_000; 2], &rules));
        assert_eq!(spans.counts(), [1, 2]);
        assert!(!spans.level(&seams, &[0.5; 2], &[1_000; 2], &rules));
    }

    #[test]
    fn what_helps_goes_on_to_the_most_spans_or_the_samples_there_are() {
        let mut spans = Spans::new(2);
        for error in [50.0, 20.0, 8.0, 3.0] {
            spans.refine(&[error; 2], &[1_000, 20], &RULES);
        }
        assert_eq!(spans.counts(), [8, 2]);
    }
}
