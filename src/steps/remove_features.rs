//! Removes holes and bosses below a diameter, which an analysis does not need.
//!
//! # Algorithm
//! The marks of `features` say where faces end; rings of faces between circles are the sides of holes and bosses. Their
//! faces go, their rims are filled without new vertices, and each fill is refined and improved alone; see
//! `technique::defeature`. Bores that cross have no ring of their own: they are found as the openings of flat faces,
//! and go together, as do bores and bosses with their roundings, whose openings end where the flat face does. A bore or
//! boss of which a part is missing is listed, from a third of the turn on.
//!
//! Based on: H. Date, S. Kanai, T. Kishinami, I. Nishigaki, T. Dohi. High-Quality and Property Controlled Finite
//! Element Mesh Generation From Triangular Meshes using the Multiresolution Technique. JCISE 5(4), 2005, section 6.3.2.
//!
//! # Invariants
//! - Faces that belong to no removed feature, and the vertices of rims, stay as they are.
//! - The surface stays an oriented manifold without new self-intersections; a through hole raises the Euler
//!   characteristic by 2, a blind hole or a boss leaves it, crossing bores with `n` openings raise it by `2 n - 2`.
//! - A flat rim gets a flat fill.
//!
//! # Cost
//! O(F log F), and O(n³) for a rim of n edges.

use std::sync::Arc;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::mesh::geometry::{Aabb, stretch};
use crate::mesh::{FreedomError, Surface};
use crate::step::{
    Artifact, FailureKind, InputDef, Inputs, Length, Locks, OutPort, OutputDef, Port, Produced, Step as StepContract,
    StepFailure,
};
use crate::technique::defeature::{self, DefeatureError, Kind, Reason, Rejected, Removed};
use crate::watch::{Cancelled, Watch};

/// Features listed in the statistics; all are counted.
const LISTED: usize = 500;

/// Removes through holes, blind holes and bosses below a diameter, and fills their place.
///
/// Use it after `features`, whose marks it needs: without marks it finds nothing. Chamfers, roundings, countersinks and
/// counterbores go with their hole, and bores that cross go together; slots and other openings that are not round stay,
/// and so do bores that break out at their side. What stays is listed with its place and the reason.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct RemoveFeaturesParams {
    /// Features up to this diameter are removed; of a stepped hole its widest step counts, up to three times the hole's
    /// width, chamfers and roundings do not: a hole in the floor of a wider pocket is a feature of its own. Percents
    /// refer to the diagonal of `from`.
    pub max_diameter: Length,
    /// What is removed: `"through-holes"`, `"blind-holes"`, `"bosses"`. Default: both sorts of holes.
    #[serde(default = "holes")]
    pub kinds: Vec<Kind>,
}

fn holes() -> Vec<Kind> {
    vec![Kind::ThroughHoles, Kind::BlindHoles]
}

/// One removed feature.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub struct RemovedFeature {
    /// What it was.
    pub kind: Kind,
    /// The middle of its rims.
    pub centre: [f64; 3],
    /// The direction of its axis.
    pub axis: [f64; 3],
    /// The diameter of its widest side, in mesh units.
    pub diameter: f64,
    /// Bores that it consisted of: several where they crossed, which go together.
    pub bores: usize,
    /// Faces taken out.
    pub faces_removed: usize,
    /// Faces of its fills.
    pub faces_added: usize,
}

/// One side of a hole or boss that stays.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub struct RejectedFeature {
    /// The middle of its rims.
    pub centre: [f64; 3],
    /// The largest diameter of its rims, or of the circles nearest to them, in mesh units; the narrowest width of an
    /// opening that is nowhere near round.
    pub diameter: f64,
    /// Why it stays.
    pub reason: Reason,
}

/// What was removed and what was not.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub struct RemoveFeaturesStats {
    /// Faces before.
    pub faces_before: usize,
    /// Faces after.
    pub faces: usize,
    /// Through holes removed.
    pub through_holes: usize,
    /// Blind holes removed.
    pub blind_holes: usize,
    /// Bosses removed.
    pub bosses: usize,
    /// Features left for a reason other than their size.
    pub refused: usize,
    /// The removed features, in the order of removal; the first 500.
    pub removed: Vec<RemovedFeature>,
    /// What looked like a feature and stays; the first 500.
    pub rejected: Vec<RejectedFeature>,
    /// Mean stretch of the result.
    pub mean_stretch: f64,
}

/// Why nothing was removed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RemoveFeaturesError {
    /// Nothing could be below it.
    #[error("`max-diameter` must be positive, got {0}")]
    BadDiameter(f64),
    /// A lock names a group that is not there.
    #[error(transparent)]
    Locks(#[from] FreedomError),
    /// The run was interrupted.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

impl From<DefeatureError> for RemoveFeaturesError {
    fn from(error: DefeatureError) -> Self {
        match error {
            DefeatureError::Locks(locks) => Self::Locks(locks),
            DefeatureError::Cancelled(cancelled) => Self::Cancelled(cancelled),
        }
    }
}

impl From<RemoveFeaturesError> for StepFailure {
    fn from(error: RemoveFeaturesError) -> Self {
        match error {
            RemoveFeaturesError::Cancelled(cancelled) => cancelled.into(),
            RemoveFeaturesError::Locks(_) => Self::new(FailureKind::BadInput, error.to_string()),
            RemoveFeaturesError::BadDiameter(_) => {
                Self::failed(error.to_string()).with_help("give a length such as `5` or `\"2%\"`")
            }
        }
    }
}

/// Removes the small features of `surface`.
///
/// # Errors
/// See [`RemoveFeaturesError`].
pub fn remove_features(
    surface: &Surface,
    params: &RemoveFeaturesParams,
    locks: &Locks,
    watch: &Watch,
) -> Result<(Surface, RemoveFeaturesStats), RemoveFeaturesError> {
    let diagonal = Aabb::of(surface.points.iter().copied()).diagonal();
    let most = params.max_diameter.resolve(diagonal);
    if most.is_nan() || most <= 0.0 {
        return Err(RemoveFeaturesError::BadDiameter(most));
    }
    let (result, report) = defeature::remove_features(surface, most, &params.kinds, &locks.rules(), watch)?;
    let count = |kind: Kind| report.removed.iter().filter(|r| r.kind == kind).map(|r| r.bores).sum();
    let sum: f64 = result.faces.ids().map(|f| stretch(result.corners(f))).sum();
    let stats = RemoveFeaturesStats {
        faces_before: surface.faces.len(),
        faces: result.faces.len(),
        through_holes: count(Kind::ThroughHoles),
        blind_holes: count(Kind::BlindHoles),
        bosses: count(Kind::Bosses),
        refused: report.rejected.iter().filter(|r| !r.reason.is_size()).count(),
        removed: report.removed.iter().take(LISTED).map(removed).collect(),
        rejected: report.rejected.iter().take(LISTED).map(rejected).collect(),
        mean_stretch: sum / result.faces.len().max(1) as f64,
    };
    Ok((result, stats))
}

fn removed(feature: &Removed) -> RemovedFeature {
    RemovedFeature {
        kind: feature.kind,
        centre: feature.centre.to_array(),
        axis: feature.axis.to_array(),
        diameter: feature.diameter,
        bores: feature.bores,
        faces_removed: feature.faces_removed,
        faces_added: feature.faces_added,
    }
}

fn rejected(feature: &Rejected) -> RejectedFeature {
    RejectedFeature { centre: feature.centre.to_array(), diameter: feature.diameter, reason: feature.reason }
}

/// The room's entry in the catalog.
#[derive(Debug)]
pub struct Step;

impl StepContract for Step {
    const NAME: &'static str = "remove-features";
    const REVISION: u32 = 11;
    const INPUTS: &'static [InputDef] = &[InputDef {
        name: "from",
        accepts: &[Port::Surface],
        required: true,
        doc: "the surface, with the marks of `features`",
    }];
    const OUTPUTS: &'static [OutputDef] = &[OutputDef { name: "main", port: OutPort::Is(Port::Surface), derive: None }];
    const EDITS: bool = true;
    const CARRIES: &'static str = "everything; fills take groups and region from most of their rim and fields from the \
        nearest place; marks of rims that are smooth now are dropped";
    const EXAMPLE: &'static str = "use = \"remove-features\"\nfrom = \"marked\"\nmax-diameter = \"3%\"\n";

    type Params = RemoveFeaturesParams;
    type Stats = RemoveFeaturesStats;

    fn run(
        inputs: &Inputs,
        _output: &str,
        params: &RemoveFeaturesParams,
        locks: &Locks,
        watch: &Watch,
    ) -> Result<Produced<RemoveFeaturesStats>, StepFailure> {
        let (surface, stats) = remove_features(inputs.surface("from")?, params, locks, watch)?;
        Ok(Produced { artifact: Artifact::Surface(Arc::new(surface)), stats })
    }
}
