//! Which edge collapses first: the priority indices of Date et al., JCISE 2005, equations 7 to 9.
//!
//! Departure: equation 9 multiplies two sums, which grows with the valence; here both sums are means, as in the same
//! authors' CAD & Applications 2005 paper, section 4.2.3, so that high-valence vertices are not preferred.

use crate::technique::guarded::Tally;

/// What the choice of the next edge aims at.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Priority {
    /// Quality improvement (equations 7 and 8): the relative gain of `min St · mean St`, over the mean size.
    QualityGain,
    /// Property control (equation 9): the new `min St · mean St`, times the mean of `size / Sz` before.
    SmallFirst {
        /// The size that faces may grow to, or any typical length where there is none.
        size: f64,
    },
}

/// Quality below this is no quality: a star of degenerate faces gains a lot, but a finite lot.
const LEAST_QUALITY: f64 = 1e-9;

/// Least times mean stretch of a star that is fairly good.
const FAIR_QUALITY: f64 = 0.25;

impl Priority {
    /// A cheap stand-in for the index of an edge of this length: what it comes to where the star is even and stays
    /// fairly good; `None` where length says nothing.
    ///
    /// An edge shorter than its star is worth more than its index says, because to collapse it spoils the star least.
    pub fn estimate(self, length: f64) -> Option<f32> {
        match self {
            Self::QualityGain => None,
            Self::SmallFirst { size } => Some((FAIR_QUALITY * size / length.max(f64::MIN_POSITIVE)) as f32),
        }
    }

    /// The index of a collapse that makes the faces `before` into the faces `after`; larger goes first.
    pub fn index(self, before: &Tally, after: &Tally) -> f32 {
        let index = match self {
            Self::QualityGain => {
                let gain = after.quality() / before.quality().max(LEAST_QUALITY);
                gain * before.faces as f64 / before.size_sum
            }
            Self::SmallFirst { size } => size * before.inverse_size_sum / before.faces as f64 * after.quality(),
        };
        index as f32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tally(faces: &[(f64, f64)]) -> Tally {
        let mut tally = Tally::new();
        for &(stretch, size) in faces {
            tally.add(stretch, size);
        }
        tally
    }

    #[test]
    fn the_valence_alone_changes_nothing() {
        let size = 2.0;
        let few = tally(&[(0.5, 1.0); 4]);
        let many = tally(&[(0.5, 1.0); 12]);
        let priority = Priority::SmallFirst { size };
        assert_eq!(priority.index(&few, &few), priority.index(&many, &many));
    }

    #[test]
    fn a_degenerate_star_goes_before_a_good_one() {
        let bad = tally(&[(0.0, 1.0), (0.9, 1.0)]);
        let good = tally(&[(0.9, 1.0), (0.9, 1.0)]);
        let after = tally(&[(0.9, 1.0)]);
        let index = |before| Priority::QualityGain.index(before, &after);
        assert!(index(&bad) > index(&good) && index(&bad).is_finite());
    }

    #[test]
    fn smaller_faces_go_first() {
        let small = tally(&[(0.9, 1.0); 6]);
        let large = tally(&[(0.9, 2.0); 6]);
        for priority in [Priority::QualityGain, Priority::SmallFirst { size: 1.0 }] {
            assert!(priority.index(&small, &small) > priority.index(&large, &large));
        }
    }
}
