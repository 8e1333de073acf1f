//! Which patches get more spans: those that are not good enough, as long as more spans help.

use super::FitRules;

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
    /// A bend or a ripple needs several times the spans before they help at all, so doublings go on while there is room.
    /// What was taken back is not tried again, so that this ends: vertices of a coarse mesh have folds between them that a
    /// patch of more spans follows, and curves that its neighbours must follow then.
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
    fn what_helps_goes_on_to_the_most_spans_or_the_samples_there_are() {
        let mut spans = Spans::new(2);
        for error in [50.0, 20.0, 8.0, 3.0] {
            spans.refine(&[error; 2], &[1_000, 20], &RULES);
        }
        assert_eq!(spans.counts(), [8, 2]);
    }
}
