//! Pattern search for the best point of a unit cube in few evaluations.
//!
//! Each coordinate in turn is moved by its own step, in the direction that last helped; a step that helps is kept, and
//! one that helps in neither direction is halved. Where the figure of merit grows one way and a limit is met somewhere
//! on it, which is how sizes and tolerances behave, this bisects towards the limit.
//!
//! # Invariants
//! - No point is evaluated twice, and no more points than allowed.
//! - The best point is the feasible one of the best merit, of equals the first; without a feasible one, the point that
//!   misses its limits least.
//!
//! Based on: R. Hooke, T. A. Jeeves. "Direct Search" Solution of Numerical and Statistical Problems. Journal of the ACM
//! 8(2), 1961.

/// How good a point is; less is better in both.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
pub struct Merit {
    /// How much its limits are missed; 0 when all hold.
    pub violation: f64,
    /// What is made small.
    pub objective: f64,
}

impl Merit {
    fn beats(self, other: Self) -> bool {
        let (a, b) = (self.violation.max(0.0), other.violation.max(0.0));
        a < b || (a == b && self.objective < other.objective)
    }
}

/// Steps shorter than this part of the range are not worth an evaluation.
const SHORTEST: f64 = 0.02;

/// Searches from `start`; `evaluate` gives the merit of a point, or `None` to end the search. Returns the best point.
pub fn search(
    start: &[f64],
    evaluations: usize,
    evaluate: &mut dyn FnMut(&[f64]) -> Option<Merit>,
) -> Option<(Vec<f64>, Merit)> {
    let mut search = Search { seen: Vec::new(), left: evaluations, evaluate };
    let mut best = start.to_vec();
    let mut merit = search.look(&best)?;
    let mut axes = vec![Axis { step: 0.5, sign: 1.0, doubts: 2 }; start.len()];
    while axes.iter().any(|axis| axis.step >= SHORTEST) {
        for (axis, Axis { step, sign, doubts }) in axes.iter_mut().enumerate() {
            if *step < SHORTEST {
                continue;
            }
            let mut helped = false;
            // A direction that helped is worth two shorter steps before the other one is tried.
            let turns: &[f64] = if *doubts < 2 { &[*sign] } else { &[*sign, -*sign] };
            for &turn in turns {
                let mut point = best.clone();
                point[axis] = (point[axis] + turn * *step).clamp(0.0, 1.0);
                if search.knows(&point) {
                    continue;
                }
                let Some(found) = search.look(&point) else { return Some((best, merit)) };
                if found.beats(merit) {
                    (best, merit, *sign, *doubts, helped) = (point, found, turn, 0, true);
                    break;
                }
            }
            if !helped {
                *step *= 0.5;
                *doubts += 1;
            }
        }
    }
    Some((best, merit))
}

/// How a coordinate is moved next.
#[derive(Clone, Copy)]
struct Axis {
    step: f64,
    sign: f64,
    /// How often in a row its direction did not help.
    doubts: u32,
}

struct Search<'a> {
    seen: Vec<Vec<f64>>,
    left: usize,
    evaluate: &'a mut dyn FnMut(&[f64]) -> Option<Merit>,
}

impl Search<'_> {
    fn knows(&self, point: &[f64]) -> bool {
        let close = |a: &[f64]| a.iter().zip(point).all(|(a, b)| (a - b).abs() < SHORTEST / 4.0);
        self.seen.iter().any(|seen| close(seen))
    }

    fn look(&mut self, point: &[f64]) -> Option<Merit> {
        if self.left == 0 {
            return None;
        }
        self.left -= 1;
        self.seen.push(point.to_vec());
        (self.evaluate)(point)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Less is better towards the corner (1, 1), up to a limit on the sum.
    fn found(evaluations: usize) -> (Vec<f64>, Merit, usize) {
        let mut count = 0;
        let (point, merit) = search(&[0.3, 0.4], evaluations, &mut |point| {
            count += 1;
            let violation = (point[0] + 0.2 * point[1] - 0.8).max(0.0);
            Some(Merit { violation, objective: -point[0] - 0.1 * point[1] })
        })
        .unwrap();
        (point, merit, count)
    }

    #[test]
    fn it_finds_the_limit_in_few_evaluations_and_gets_better_with_more() {
        let (_, few, count) = found(12);
        assert!(count <= 12 && few.violation == 0.0 && few.objective < -0.6, "{few:?}");
        let (_, many, _) = found(60);
        assert!(many.violation == 0.0 && many.objective <= few.objective && many.objective < -0.68, "{many:?}");
    }

    #[test]
    fn from_outside_the_limits_it_comes_in_first() {
        let (point, merit) = search(&[0.95], 12, &mut |point| {
            Some(Merit { violation: (point[0] - 0.25).max(0.0), objective: -point[0] })
        })
        .unwrap();
        assert!(merit.violation == 0.0 && point[0] > 0.15, "{point:?}");
    }

    #[test]
    fn one_evaluation_is_the_start() {
        assert_eq!(search(&[0.5], 1, &mut |_| Some(Merit { violation: 1.0, objective: 0.0 })).unwrap().0, [0.5]);
        assert_eq!(search(&[0.5], 0, &mut |_| None), None);
    }
}
