//! What a tolerance bounds: the word that recipes and guarded edits share.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What a tolerance means.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum ToleranceMode {
    /// The sum of squared distances to the planes of all faces merged so far: the measure of the papers. A squared
    /// length, so a plain number; it grows with the density of the input.
    QuadricSum,
    /// The root mean square of the distances to those planes: a length. Fast, and no bound of the distance.
    QuadricRms,
    /// The largest distance between result and reference, both ways, kept by certified tests: a length.
    #[default]
    Distance,
}
