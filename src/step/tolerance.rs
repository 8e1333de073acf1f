//! The tolerance of steps whose edits keep it: as recipes give it, checked, and in mesh units.
//!
//! Unknown keys are refused only by a type that names all keys itself, so the parameters of each step name these keys
//! and hand them over as one [`Tolerance`].

use super::failure::StepFailure;
use super::length::Length;
use super::{InputDef, Port};
use crate::metric::ToleranceMode;

/// The optional input that the tolerance is measured against.
pub const REFERENCE: InputDef = InputDef {
    name: "reference",
    accepts: &[Port::Surface],
    required: false,
    doc: "what the tolerance is measured against; default: `from`",
};

/// A parameter outside its range.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("{name} must be {range}, got {value}")]
pub struct OutOfRange {
    /// The parameter.
    pub name: &'static str,
    /// What it may be.
    pub range: &'static str,
    /// What it is.
    pub value: f64,
}

impl OutOfRange {
    /// Refuses a value that is not as it must be.
    ///
    /// # Errors
    /// Where `holds` is false.
    pub fn unless(holds: bool, name: &'static str, range: &'static str, value: f64) -> Result<(), Self> {
        if holds { Ok(()) } else { Err(Self { name, range, value }) }
    }
}

/// Why a tolerance makes no sense.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum ToleranceError {
    /// A percent has no meaning in this mode.
    #[error("in `quadric-sum` mode `tolerance` is a squared length: a number, not a percent")]
    PercentOfSquare,
    /// A value is out of range.
    #[error(transparent)]
    OutOfRange(#[from] OutOfRange),
}

/// The keys `tolerance`, `tolerance-mode`, `feature-tolerance` and `feature-weight`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tolerance {
    /// What `tolerance` means.
    pub mode: ToleranceMode,
    /// How far the result may lie from the reference.
    pub tolerance: Length,
    /// How far marked curves may move; where it is not given, half of `tolerance`.
    pub feature_tolerance: Option<Length>,
    /// The weight of the sharpest marked edges in the quadrics.
    pub feature_weight: f64,
}

/// A tolerance in mesh units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ResolvedTolerance {
    /// What `tolerance` means.
    pub mode: ToleranceMode,
    /// A length, or in [`ToleranceMode::QuadricSum`] the square of one.
    pub tolerance: f64,
    /// How far marked curves may move.
    pub feature_tolerance: f64,
    /// The weight of the sharpest marked edges in the quadrics.
    pub feature_weight: f64,
}

impl Tolerance {
    /// The tolerance in mesh units; percents refer to `diagonal`.
    ///
    /// # Errors
    /// A percent of a square, a weight or a tolerance out of range.
    pub fn resolve(&self, diagonal: f64) -> Result<ResolvedTolerance, ToleranceError> {
        let Self { mode, feature_weight, .. } = *self;
        let tolerance = match (mode, self.tolerance) {
            (ToleranceMode::QuadricSum, Length::Percent(_)) => return Err(ToleranceError::PercentOfSquare),
            (_, length) => length.resolve(diagonal),
        };
        let is_weight = feature_weight >= 0.0 && feature_weight.is_finite();
        OutOfRange::unless(is_weight, "feature-weight", "finite and not negative", feature_weight)?;
        let may_be_zero = mode != ToleranceMode::Distance && !tolerance.is_nan();
        OutOfRange::unless(tolerance > 0.0 || may_be_zero, "tolerance", "above 0", tolerance)?;
        let feature_tolerance = self.feature_tolerance.map_or(0.5 * tolerance, |length| length.resolve(diagonal));
        Ok(ResolvedTolerance { mode, tolerance, feature_tolerance, feature_weight })
    }
}

impl From<OutOfRange> for StepFailure {
    fn from(error: OutOfRange) -> Self {
        Self::failed(error.to_string())
    }
}

impl From<ToleranceError> for StepFailure {
    fn from(error: ToleranceError) -> Self {
        match error {
            ToleranceError::OutOfRange(error) => error.into(),
            ToleranceError::PercentOfSquare => Self::failed(error.to_string())
                .with_help("give a number in squared mesh units, or use `tolerance-mode = \"quadric-rms\"`"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tolerance(mode: ToleranceMode, tolerance: Length) -> Tolerance {
        Tolerance { mode, tolerance, feature_tolerance: None, feature_weight: 1.0 }
    }

    #[test]
    fn percents_are_of_the_diagonal_and_curves_get_half() {
        let resolved = tolerance(ToleranceMode::Distance, Length::Percent(10.0)).resolve(5.0).unwrap();
        assert_eq!((resolved.tolerance, resolved.feature_tolerance), (0.5, 0.25));
    }

    #[test]
    fn what_makes_no_sense_is_refused_by_name() {
        let square = tolerance(ToleranceMode::QuadricSum, Length::Percent(1.0)).resolve(1.0);
        assert_eq!(square, Err(ToleranceError::PercentOfSquare));
        let nothing = tolerance(ToleranceMode::Distance, Length::Absolute(0.0)).resolve(1.0).unwrap_err();
        assert_eq!(nothing.to_string(), "tolerance must be above 0, got 0");
        assert!(tolerance(ToleranceMode::QuadricRms, Length::Absolute(0.0)).resolve(1.0).is_ok());
        let heavy =
            Tolerance { feature_weight: f64::INFINITY, ..tolerance(ToleranceMode::Distance, Length::Percent(1.0)) };
        assert!(heavy.resolve(1.0).is_err());
    }
}
