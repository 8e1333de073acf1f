//! Integers of a fixed number of words, for signs that floats cannot tell.
//!
//! Two's complement, the lowest word first. Arithmetic wraps; callers choose widths that hold their results, which
//! follow from the number of bits of the grid (see [`exact`](super::exact)).

use std::ops::{Add, Neg, Sub};

use crate::mesh::predicate::Sign;

/// An integer of `64 N` bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Wide<const N: usize>([u64; N]);

/// The prime of [`Wide::residue`]: `2^61 - 1`.
pub(super) const PRIME: u64 = (1 << 61) - 1;

impl<const N: usize> Wide<N> {
    /// The same number in two words or more.
    pub(super) fn new(value: i128) -> Self {
        let mut words = [if value < 0 { u64::MAX } else { 0 }; N];
        words[0] = value as u64;
        words[1] = (value >> 64) as u64;
        Self(words)
    }

    pub(super) fn sign(&self) -> Sign {
        match (self.is_negative(), self.0 == [0; N]) {
            (true, _) => -1,
            (_, true) => 0,
            _ => 1,
        }
    }

    fn is_negative(&self) -> bool {
        self.0[N - 1] >> 63 == 1
    }

    fn word(&self, at: usize) -> u64 {
        if at < N {
            self.0[at]
        } else if self.is_negative() {
            u64::MAX
        } else {
            0
        }
    }

    /// The product, where it fits `N` words.
    pub(super) fn product<const A: usize, const B: usize>(a: &Wide<A>, b: &Wide<B>) -> Self {
        let mut words = [0_u64; N];
        for i in 0..N {
            let left = a.word(i);
            if left == 0 {
                continue;
            }
            let mut carry = 0_u128;
            for j in 0..N - i {
                let sum = u128::from(left) * u128::from(b.word(j)) + u128::from(words[i + j]) + carry;
                words[i + j] = sum as u64;
                carry = sum >> 64;
            }
        }
        Self(words)
    }

    fn magnitude(self) -> Self {
        if self.is_negative() { -self } else { self }
    }

    /// The nearest float, but for the last bit.
    pub(super) fn to_f64(self) -> f64 {
        let magnitude = self.magnitude();
        let Some(top) = (0..N).rev().find(|&at| magnitude.0[at] != 0) else { return 0.0 };
        let shift = magnitude.0[top].leading_zeros();
        let below = if top > 0 && shift > 0 { magnitude.0[top - 1] >> (64 - shift) } else { 0 };
        let leading = (magnitude.0[top] << shift) | below;
        let value = libm::ldexp(leading as f64, 64 * top as i32 - shift as i32);
        if self.is_negative() { -value } else { value }
    }

    /// What is left of the number after division by [`PRIME`].
    pub(super) fn residue(self) -> u64 {
        // 2^64 leaves 8.
        let fold = |rest: u64, &word: &u64| ((u128::from(rest) * 8 + u128::from(word)) % u128::from(PRIME)) as u64;
        let rest = self.magnitude().0.iter().rev().fold(0, fold);
        if self.is_negative() && rest != 0 { PRIME - rest } else { rest }
    }
}

/// The product of two residues.
pub(super) fn times(a: u64, b: u64) -> u64 {
    (u128::from(a) * u128::from(b) % u128::from(PRIME)) as u64
}

/// The residue that gives 1 with this one, which is not 0: by Fermat, a power.
pub(super) fn inverse(residue: u64) -> u64 {
    let (mut result, mut square, mut exponent) = (1, residue, PRIME - 2);
    while exponent > 0 {
        if exponent & 1 == 1 {
            result = times(result, square);
        }
        square = times(square, square);
        exponent >>= 1;
    }
    result
}

impl<const N: usize> Add for Wide<N> {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        let mut carry = false;
        Self(std::array::from_fn(|at| {
            let (sum, over) = self.0[at].overflowing_add(other.0[at]);
            let (sum, again) = sum.overflowing_add(u64::from(carry));
            carry = over || again;
            sum
        }))
    }
}

impl<const N: usize> Neg for Wide<N> {
    type Output = Self;
    fn neg(self) -> Self {
        let mut one = [0; N];
        one[0] = 1;
        Self(self.0.map(|word| !word)) + Self(one)
    }
}

impl<const N: usize> Sub for Wide<N> {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn arithmetic_is_that_of_machine_integers(a in any::<i64>(), b in any::<i64>(), c in any::<i64>()) {
            let [x, y, z] = [a, b, c].map(|v| Wide::<4>::new(i128::from(v)));
            let exact = i128::from(a) * i128::from(b) - i128::from(c);
            let found = Wide::<4>::product(&x, &y) - z;
            prop_assert_eq!(found, Wide::new(exact));
            prop_assert_eq!(found.sign(), exact.signum() as Sign);
            prop_assert!((found.to_f64() - exact as f64).abs() <= 1e-15 * (exact as f64).abs());
            prop_assert_eq!(i128::from(found.residue()), exact.rem_euclid(i128::from(PRIME)));
            // (x y) z = x (y z) in six words.
            let left = Wide::<6>::product(&Wide::<6>::product(&x, &y), &z);
            prop_assert_eq!(left, Wide::product(&x, &Wide::<6>::product(&z, &y)));
        }

        #[test]
        fn an_inverse_gives_one(a in 1..PRIME) {
            prop_assert_eq!(times(a, inverse(a)), 1);
        }
    }
}
