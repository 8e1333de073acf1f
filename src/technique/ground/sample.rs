//! Where the vertices of a new mesh lie on a curve.

use super::Curve;

/// Fine steps that the density of vertices is summed over.
const STEPS: usize = 96;
/// How often steps are made smaller until the chords are close enough.
const ROUNDS: usize = 16;
/// A piece with no more points of the curve inside has a bend, not a round.
const FEW: usize = 4;
/// Nearer to the end of its piece than this part of it, a bend gets no vertex.
const CLOSE: f64 = 0.2;

/// Lengths from the start of `curve`, ends included, of vertices about `size` apart, with chords within `tolerance`.
///
/// `sizes` gives the distance asked for along the curve, as pairs of place and size in rising order. At least `least`
/// pieces are made, so that a closed curve stays a polygon. No piece gets shorter than `floor` for the sake of the
/// tolerance.
pub fn sample(curve: &Curve, sizes: &[(f64, f64)], tolerance: f64, least: usize, floor: f64) -> Vec<f64> {
    let length = curve.length();
    let steps = STEPS.max(curve.points.len().min(4096));
    let step = length / steps as f64;
    let mut wish: Vec<f64> = (0..=steps).map(|i| interpolate(sizes, i as f64 * step).min(length)).collect();
    // Bends that get a vertex of their own.
    let mut bends: Vec<f64> = Vec::new();
    let mut places = spread_between(&wish, length, least, &bends);
    for _ in 0..ROUNDS {
        let mut changed = false;
        for pair in places.windows(2) {
            let (sag, at, inside) = curve.bend(pair[0], pair[1]);
            let piece = pair[1] - pair[0];
            if sag <= tolerance || piece < 1.3 * floor {
                continue;
            }
            let nearer = (at - pair[0]).min(pair[1] - at);
            if inside <= FEW && nearer > (CLOSE * piece).max(0.7 * floor) {
                bends.push(at);
                changed = true;
                continue;
            }
            // Between what a round curve needs, the square root, and what a bend does.
            let factor = libm::pow(tolerance / sag, 0.7).clamp(0.4, 0.92);
            let first = (pair[0] / step).floor() as usize;
            let last = ((pair[1] / step).ceil() as usize).min(steps);
            // Of the wish itself: pieces are whole, and may stay as long as before.
            for w in &mut wish[first..=last] {
                let shorter = (factor * w.min(piece)).max(0.8 * floor).min(*w);
                changed |= shorter < *w;
                *w = shorter;
            }
        }
        if !changed {
            break;
        }
        bends.sort_by(f64::total_cmp);
        grade(&mut wish, 0.3 * step);
        places = spread_between(&wish, length, least, &bends);
    }
    places
}

/// Places from bend to bend, each spread on its own.
fn spread_between(wish: &[f64], length: f64, least: usize, bends: &[f64]) -> Vec<f64> {
    if bends.is_empty() {
        return spread(wish, length, least);
    }
    let step = length / (wish.len() - 1) as f64;
    let value = |at: f64| {
        let i = ((at / step) as usize).min(wish.len() - 2);
        wish[i] + (wish[i + 1] - wish[i]) * (at / step - i as f64).clamp(0.0, 1.0)
    };
    let parts = bends.len() + 1;
    let mut places = vec![0.0];
    for i in 0..parts {
        let from = if i == 0 { 0.0 } else { bends[i - 1] };
        let to = bends.get(i).copied().unwrap_or(length);
        let fine = STEPS.max(wish.len() / parts);
        let part: Vec<f64> = (0..=fine).map(|k| value(from + (to - from) * k as f64 / fine as f64)).collect();
        places.extend(spread(&part, to - from, least.div_ceil(parts)).iter().skip(1).map(|at| from + at));
        if let Some(end) = places.last_mut() {
            *end = to;
        }
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
