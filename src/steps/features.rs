//! Marks sharp edges, rims, borders and corners, which later steps keep.
//!
//! # Algorithm
//! The angle between face normals with hysteresis; see [`feature`](crate::technique::feature) for the rule for short
//! chains and the trap of coarse cylinders.
//!
//! Based on: J. Canny. A computational approach to edge detection. IEEE Transactions on Pattern Analysis and Machine
//! Intelligence 8(6), 1986, for the hysteresis.
//!
//! # Invariants
//! - Points and faces stay as they are.
//! - Idempotent: a second run changes nothing.
//!
//! # Cost
//! O(F log F).

use std::sync::Arc;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::mesh::Surface;
use crate::step::{
    Angle, Artifact, InputDef, Inputs, Locks, OutPort, OutputDef, Port, Produced, Step as StepContract, StepFailure,
};
use crate::technique::feature::{FeatureRules, Report, mark_features};
use crate::watch::Watch;

/// Marks the edges and corners that give a part its shape, so that later steps keep them.
///
/// Use it after `repair` and before any step that moves vertices. Marks of an earlier `features` step are replaced.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default, rename_all = "kebab-case")]
pub struct FeaturesParams {
    /// An edge is sharp if the normals of its faces differ by at least this angle, in degrees. Default 30. It should
    /// be more than 1.5 times the angle between the facets of a coarse cylinder or fillet; the statistics warn.
    pub angle: Angle,
    /// Each connected set of sharp edges needs one of at least this angle, in degrees. Default: `angle` plus 10.
    /// Equal to `angle`, every edge counts for itself.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub seed_angle: Option<Angle>,
    /// Whether borders between regions and between face groups are marked too. Default true.
    pub region_borders: bool,
    /// A curve that turns by more than this angle has a corner, which later steps keep exactly. Degrees, default 45.
    pub corner_angle: Angle,
}

impl Default for FeaturesParams {
    fn default() -> Self {
        Self { angle: Angle(30.0), seed_angle: None, region_borders: true, corner_angle: Angle(45.0) }
    }
}

/// What was marked.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub struct FeaturesStats {
    /// Sharp edges.
    pub sharp_edges: usize,
    /// Of those, edges below `angle` that continue a chain.
    pub grown_edges: usize,
    /// Sharp chains that were dropped as too short.
    pub dropped_chains: usize,
    /// Edges on rims.
    pub rim_edges: usize,
    /// Edges on borders of regions or face groups that are neither sharp nor on a rim.
    pub border_edges: usize,
    /// Curves: from corner to corner, or closed.
    pub curves: usize,
    /// Corners.
    pub corners: usize,
    /// Length of all curves, in mesh units.
    pub curve_length: f64,
    /// The usual angle between the facets of smooth areas in degrees; absent where no angle stands out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub facet_angle: Option<f64>,
    /// Whether `angle` is not more than 1.5 times `facet-angle`, so that facets may be taken for features.
    pub angle_is_doubtful: bool,
}

/// Marks the features of `surface`.
pub fn features(surface: &Surface, params: &FeaturesParams) -> (Surface, FeaturesStats) {
    let angle = params.angle.0;
    let rules = FeatureRules {
        angle,
        seed_angle: params.seed_angle.map_or((angle + 10.0).min(180.0), |seed| seed.0),
        corner_angle: params.corner_angle.0,
        region_borders: params.region_borders,
    };
    let (marked, report) = mark_features(surface, &rules);
    (marked, stats(&report, angle))
}

fn stats(report: &Report, angle: f64) -> FeaturesStats {
    FeaturesStats {
        sharp_edges: report.sharp_edges,
        grown_edges: report.grown_edges,
        dropped_chains: report.dropped_chains,
        rim_edges: report.rim_edges,
        border_edges: report.border_edges,
        curves: report.curves,
        corners: report.corners,
        curve_length: report.length,
        facet_angle: report.facet_angle,
        angle_is_doubtful: report.facet_angle.is_some_and(|facets| angle <= 1.5 * facets),
    }
}

/// The room's entry in the catalog.
#[derive(Debug)]
pub struct Step;

impl StepContract for Step {
    const NAME: &'static str = "features";
    const REVISION: u32 = 1;
    const INPUTS: &'static [InputDef] =
        &[InputDef { name: "from", accepts: &[Port::Surface], required: true, doc: "the surface to mark" }];
    const OUTPUTS: &'static [OutputDef] = &[OutputDef { name: "main", port: OutPort::Is(Port::Surface) }];
    const CARRIES: &'static str = "everything; marks of an earlier run and the pins on them are replaced";
    const EXAMPLE: &'static str = "use = \"features\"\nfrom = \"clean\"\nangle = 30\n";

    type Params = FeaturesParams;
    type Stats = FeaturesStats;

    fn run(
        inputs: &Inputs,
        _output: &str,
        params: &FeaturesParams,
        _locks: &Locks,
        watch: &Watch,
    ) -> Result<Produced<FeaturesStats>, StepFailure> {
        let surface = inputs.surface("from")?;
        watch.phase("marking features", None);
        watch.check()?;
        let (marked, stats) = features(surface, params);
        Ok(Produced { artifact: Artifact::Surface(Arc::new(marked)), stats })
    }
}
