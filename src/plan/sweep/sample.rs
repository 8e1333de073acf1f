//! Latin-hypercube samples: `n` points of which every axis sees each of its `n` equal parts exactly once.
//!
//! Each axis is cut into `n` parts of equal length; a random permutation of the parts is drawn for each axis, and a
//! random place within each part. The same seed gives the same points on every machine.
//!
//! Based on: M. D. McKay, R. J. Beckman, W. J. Conover. A Comparison of Three Methods for Selecting Values of Input
//! Variables in the Analysis of Output from a Computer Code. Technometrics 21(2), 1979.

/// SplitMix64: one addition and a few shifts a number, and the same ones everywhere.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// 0 to less than 1.
    fn unit(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// 0 to less than `bound`; the bias of the product is below 2^-40 for the bounds in use.
    fn below(&mut self, bound: usize) -> usize {
        ((u128::from(self.next()) * bound as u128) >> 64) as usize
    }
}

/// `n` points with one coordinate, 0 to less than 1, for each of `axes` axes.
pub(super) fn latin_hypercube(n: usize, axes: usize, seed: u64) -> Vec<Vec<f64>> {
    let mut random = Random(seed);
    let mut points = vec![Vec::with_capacity(axes); n];
    for _ in 0..axes {
        let mut parts: Vec<usize> = (0..n).collect();
        for last in (1..n).rev() {
            parts.swap(last, random.below(last + 1));
        }
        for (point, part) in points.iter_mut().zip(parts) {
            point.push((part as f64 + random.unit()) / n as f64);
        }
    }
    points
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_part_of_every_axis_is_met_once() {
        let points = latin_hypercube(17, 3, 42);
        for axis in 0..3 {
            let mut parts: Vec<usize> = points.iter().map(|point| (point[axis] * 17.0) as usize).collect();
            parts.sort_unstable();
            assert_eq!(parts, (0..17).collect::<Vec<_>>());
        }
        assert_eq!(points, latin_hypercube(17, 3, 42));
        assert_ne!(points, latin_hypercube(17, 3, 43));
    }
}
