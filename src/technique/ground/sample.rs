//! Where the vertices of a new mesh lie on a curve.

use super::Curve;

/// Fine steps that the density of vertices is summed over.
const STEPS: usize = 96;
/// How often steps are made smaller until the chords are close enough.
const ROUNDS: usize = 6;

/// Lengths from the start of `curve`, ends included, of vertices about `size` apart, with chords within `tolerance`.
///
/// `sizes` gives the distance asked for along the curve, as pairs of place and size in rising order. At least `least`
/// pieces are made, so that a closed curve stays a polygon.
pub fn sample(curve: &Curve, sizes: &[(f64, f64)], tolerance: f64, least: usize) -> Vec<f64> {
    let length = curve.length();
    let steps = STEPS.max(curve.points.len().min(4096));
    let step = length / steps as f64;
    let mut wish: Vec<f64> = (0..=steps).map(|i| interpolate(sizes, i as f64 * step).min(length)).collect();
    let mut places = spread(&wish, length, least);
    for _ in 0..ROUNDS {
        let mut changed = false;
        for pair in places.windows(2) {
            let sag = curve.sag(pair[0], pair[1]);
            if sag > tolerance {
                let factor = (tolerance / sag).sqrt().clamp(0.4, 0.95);
                let first = (pair[0] / step).floor() as usize;
                let last = ((pair[1] / step).ceil() as usize).min(steps);
                let limit = factor * (pair[1] - pair[0]);
                wish[first..=last].iter_mut().for_each(|w| *w = w.min(limit));
                changed = true;
            }
        }
        if !changed {
            break;
        }
        grade(&mut wish, 0.3 * step);
        places = spread(&wish, length, least);
    }
    places
}

/// No wish larger than its neighbour's plus `rise`.
fn grade(wish: &mut [f64], rise: f64) {
    for i in 1..wish.len() {
        wish[i] = wish[i].min(wish[i - 1] + rise);
    }
    for i in (1..wish.len()).rev() {
        wish[i - 1] = wish[i - 1].min(wish[i] + rise);
    }
}

fn interpolate(sizes: &[(f64, f64)], at: f64) -> f64 {
    let i = sizes.partition_point(|&(s, _)| s < at);
    match (i.checked_sub(1).map(|j| sizes[j]), sizes.get(i)) {
        (Some((s, a)), Some(&(t, b))) if t > s => a + (b - a) * (at - s) / (t - s),
        (_, Some(&(_, b))) => b,
        (Some((_, a)), None) => a,
        (None, None) => f64::INFINITY,
    }
}

/// Places with equal shares of the sum of 1/wish.
fn spread(wish: &[f64], length: f64, least: usize) -> Vec<f64> {
    let steps = wish.len() - 1;
    let step = length / steps as f64;
    let mut sum = vec![0.0];
    for pair in wish.windows(2) {
        sum.push(sum[sum.len() - 1] + step * 2.0 / (pair[0] + pair[1]));
    }
    let total = sum[steps];
    let pieces = (total.round() as usize).max(least).clamp(1, 1_000_000);
    let mut places = vec![0.0];
    let mut i = 0;
    for k in 1..pieces {
        let want = total * k as f64 / pieces as f64;
        while i + 1 < steps && sum[i + 1] < want {
            i += 1;
        }
        let t = ((want - sum[i]) / (sum[i + 1] - sum[i]).max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
        places.push((i as f64 + t) * step);
    }
    places.push(length);
    places
}

/// Lets `pieces` be another number than the sizes ask for: the same places, spread anew.
pub(crate) fn respread(sizes: &[(f64, f64)], length: f64, pieces: usize) -> Vec<f64> {
    let steps = STEPS.max(8 * pieces);
    let step = length / steps as f64;
    let wish: Vec<f64> = (0..=steps).map(|i| interpolate(sizes, i as f64 * step)).collect();
    let scale = {
        let sum: f64 = wish.windows(2).map(|w| step * 2.0 / (w[0] + w[1])).sum();
        sum / pieces as f64
    };
    let wish: Vec<f64> = wish.into_iter().map(|w| w * scale).collect();
    spread(&wish, length, pieces)
}
