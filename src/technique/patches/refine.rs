//! Which patches get more spans: those that are not good enough, as long as more spans help.

use super::FitRules;

/// How far a patch is from what it should be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Fault {
    /// Largest distance between the patch and the mesh, both ways; mesh units.
    pub(super) error: f64,
    /// Largest angle between planes along its smooth seams; degrees.
    pub(super) angle: f64,
}

/// The spans of each patch in both directions, powers of two, so that knots of neighbours are nested.
#[derive(Clone, Debug)]
pub(super) struct Spans {
    counts: Vec<usize>,
    /// The faults before the last doubling, until its outcome is known.
    tried: Vec<Option<Fault>>,
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

    /// Takes back what did not help and doubles the spans of what is not good enough; whether anything changed.
    ///
    /// A doubling that was taken back is not tried again, so that this ends: vertices of a coarse mesh have folds between
    /// them that a patch of more spans follows, and curves that its neighbours must follow then.
    pub(super) fn refine(&mut self, faults: &[Fault], samples: &[usize], rules: &FitRules) -> bool {
        let mut changed = false;
        for (e, now) in faults.iter().enumerate() {
            if let Some(before) = self.tried[e].take()
                && !helps(before, *now, rules)
            {
                self.counts[e] /= 2;
                self.is_settled[e] = true;
                changed = true;
                continue;
            }
            if !self.is_settled[e] && self.has_room(e, samples[e], rules) && Self::wants(*now, rules) {
                self.tried[e] = Some(*now);
                self.counts[e] *= 2;
                changed = true;
            }
        }
        changed
    }

    /// With fewer vertices than control points there would be nothing to go by.
    fn has_room(&self, e: usize, samples: usize, rules: &FitRules) -> bool {
        let spans = self.counts[e];
        2 * spans <= rules.max_spans && (2 * spans + 1) * (2 * spans + 1) <= samples
    }

    /// More spans follow the facets of a coarse mesh more closely, so bends ask for none.
    fn wants(now: Fault, rules: &FitRules) -> bool {
        now.error > rules.tolerance
    }
}

fn is_bent(fault: Fault, rules: &FitRules) -> bool {
    rules.smooth.is_some_and(|most| fault.angle > most)
}

/// Whether a patch beyond the tolerance is within it now, or clearly better and not bent for that.
fn helps(before: Fault, now: Fault, rules: &FitRules) -> bool {
    /// Of what it was.
    const BETTER: f64 = 0.8;
    let is_smooth = !is_bent(now, rules) || now.angle <= before.angle;
    now.error <= rules.tolerance || now.error <= BETTER * before.error && is_smooth
}

#[cfg(test)]
mod tests {
    use super::*;

    const RULES: FitRules = FitRules { tolerance: 1.0, max_spans: 8, fairness: 1e-6, density: 4, smooth: Some(2.0) };

    #[test]
    fn what_does_not_help_is_taken_back_and_not_tried_again() {
        let mut spans = Spans::new(2);
        let bad = Fault { error: 3.0, angle: 1.0 };
        let good = Fault { error: 0.5, angle: 1.0 };
        assert!(spans.refine(&[bad, good], &[1_000, 1_000], &RULES));
        assert_eq!(spans.counts(), [2, 1]);
        assert!(spans.refine(&[bad, good], &[1_000, 1_000], &RULES));
        assert_eq!(spans.counts(), [1, 1]);
        assert!(!spans.refine(&[bad, good], &[1_000, 1_000], &RULES));
    }

    #[test]
    fn what_helps_goes_on_to_the_most_spans_or_the_vertices_there_are() {
        let mut spans = Spans::new(2);
        let fault = |error| Fault { error, angle: 90.0 };
        for error in [50.0, 20.0, 8.0, 3.0] {
            spans.refine(&[fault(error); 2], &[1_000, 20], &RULES);
        }
        assert_eq!(spans.counts(), [8, 2]);
    }
}
