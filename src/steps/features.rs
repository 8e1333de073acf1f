//! Marks sharp edges, rims, borders and corners, which later steps keep.
//!
//! # Algorithm
//! The angle between face normals with hysteresis, of the plain normals or of those that vote tensors have freed of
//! noise; see [`feature`](crate::technique::feature) for the rule for short chains and the trap of coarse cylinders.
//!
//! Based on: J. Canny. A computational approach to edge detection. IEEE Transactions on Pattern Analysis and Machine
//! Intelligence 8(6), 1986, for the hysteresis; D. L. Page, Y. Sun, A. F. Koschan, J. Paik, M. A. Abidi. Normal vector
//! voting: crease detection and curvature estimation on large, noisy meshes. Graphical Models 64, 2002, for the votes.
//!
//! # Invariants
//! - Points and faces stay as they are.
//! - Idempotent: a second run changes nothing.
//!
//! # Cost
//! O(F log F); with votes or curvatures O(F · faces in reach), in parallel.

use std::sync::Arc;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::mesh::geometry::Aabb;
use crate::mesh::{Field, Support, Surface};
use crate::step::{
    Angle, Artifact, InputDef, Inputs, Length, Locks, OutPort, OutputDef, Port, Produced, Step as StepContract,
    StepFailure,
};
use crate::technique::curvature::{mean_edge, principal_curvatures};
use crate::technique::feature::{FeatureRules, Report, mark_features};
use crate::watch::{Cancelled, Watch};

/// How far votes reach by default, in mean edges.
const VOTING_EDGES: f64 = 5.0;
/// The radius of the balls that curvatures are averaged over, in mean edges.
const CURVATURE_EDGES: f64 = 2.5;

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
    /// How sharp edges are found: `"dihedral"` (default), `"normal-voting"` for scans, or `"auto"`.
    pub method: FeatureMethod,
    /// How far votes reach along the surface with `normal-voting`. Length; default 5 mean edges. Sharp edges closer to
    /// each other than this melt into one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub radius: Option<Length>,
    /// Whether the principal curvatures go along as vertex fields `curvature-max` and `curvature-min`, in 1/length and
    /// positive where convex; `max` is the larger magnitude. Averaged over balls of 2.5 mean edges. Default false.
    pub curvature: bool,
    /// Of curves that run alongside each other within this distance only the sharpest is marked: closer pairs would
    /// force slivers between them. Both stay about thin walls and slots. Default 0.1 % of the diagonal; 0 marks all.
    pub min_gap: Length,
}

impl Default for FeaturesParams {
    fn default() -> Self {
        Self {
            angle: Angle(30.0),
            seed_angle: None,
            region_borders: true,
            corner_angle: Angle(45.0),
            method: FeatureMethod::Dihedral,
            radius: None,
            curvature: false,
            min_gap: Length::Percent(0.1),
        }
    }
}

/// How sharp edges are found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum FeatureMethod {
    /// By the angle between the normals of two faces: for CAD tessellations and clean meshes.
    #[default]
    Dihedral,
    /// By the votes of the normals in a neighbourhood: for scans and other noisy, evenly meshed surfaces.
    NormalVoting,
    /// Dihedral, unless a fifth of the sharp edges or more run alongside each other within `min-gap`: then they are the
    /// noise of a scan, and normal voting is used.
    Auto,
}

/// What was marked.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub struct FeaturesStats {
    /// How sharp edges were found; never `auto`.
    pub method: FeatureMethod,
    /// Sharp edges.
    pub sharp_edges: usize,
    /// Of those, edges below `angle` that continue a chain.
    pub grown_edges: usize,
    /// Sharp chains that were dropped as too short.
    pub dropped_chains: usize,
    /// Sharp edges left out because they ran alongside a sharper curve, nearer than `min-gap`.
    pub alongside_edges: usize,
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

/// Why no features were marked.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FeaturesError {
    /// Votes need a neighbourhood.
    #[error("`radius` must be positive, got {0}")]
    BadRadius(f64),
    /// The run was interrupted.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

impl From<FeaturesError> for StepFailure {
    fn from(error: FeaturesError) -> Self {
        match error {
            FeaturesError::Cancelled(cancelled) => cancelled.into(),
            FeaturesError::BadRadius(_) => {
                Self::failed(error.to_string()).with_help("leave `radius` out for 5 mean edges")
            }
        }
    }
}

/// Marks the features of `surface`.
///
/// # Errors
/// See [`FeaturesError`].
pub fn features(
    surface: &Surface,
    params: &FeaturesParams,
    watch: &Watch,
) -> Result<(Surface, FeaturesStats), FeaturesError> {
    let angle = params.angle.0;
    let rules = FeatureRules {
        angle,
        seed_angle: params.seed_angle.map_or((angle + 10.0).min(180.0), |seed| seed.0),
        corner_angle: params.corner_angle.0,
        region_borders: params.region_borders,
        voting_radius: (params.method == FeatureMethod::NormalVoting)
            .then(|| voting_radius(surface, params))
            .transpose()?,
        gap: params.min_gap.resolve(Aabb::of(surface.points.iter().copied()).diagonal()),
    };
    watch.phase("marking features", None);
    let (mut marked, mut report) = mark_features(surface, &rules, watch)?;
    let mut method = params.method;
    if method == FeatureMethod::Auto {
        method = FeatureMethod::Dihedral;
        if is_noise(&report) {
            method = FeatureMethod::NormalVoting;
            let rules = FeatureRules { voting_radius: Some(voting_radius(surface, params)?), ..rules };
            (marked, report) = mark_features(surface, &rules, watch)?;
        }
    }
    if params.curvature {
        watch.phase("curvature", None);
        store_curvature(&mut marked, watch)?;
    }
    Ok((marked, FeaturesStats { method, ..stats(&report, angle) }))
}

/// Sharp edges that run alongside each other are rare on parts, and the rule in noise; so few say nothing.
fn is_noise(report: &Report) -> bool {
    report.alongside_edges >= 50 && 4 * report.alongside_edges >= report.sharp_edges
}

fn voting_radius(surface: &Surface, params: &FeaturesParams) -> Result<f64, FeaturesError> {
    let diagonal = Aabb::of(surface.points.iter().copied()).diagonal();
    let radius = params.radius.map_or_else(|| VOTING_EDGES * mean_edge(surface), |length| length.resolve(diagonal));
    if radius > 0.0 { Ok(radius) } else { Err(FeaturesError::BadRadius(radius)) }
}

/// Adds the principal curvatures as vertex fields.
fn store_curvature(surface: &mut Surface, watch: &Watch) -> Result<(), Cancelled> {
    let radius = CURVATURE_EDGES * mean_edge(surface);
    let all = principal_curvatures(surface, radius, watch)?;
    let field = |name: &str, values| Field { name: name.to_owned(), support: Support::Vertex, components: 1, values };
    surface.carried.set_field(field("curvature-max", all.iter().map(|p| p.max.0).collect()));
    surface.carried.set_field(field("curvature-min", all.iter().map(|p| p.min.0).collect()));
    Ok(())
}

fn stats(report: &Report, angle: f64) -> FeaturesStats {
    FeaturesStats {
        method: FeatureMethod::Dihedral,
        sharp_edges: report.sharp_edges,
        grown_edges: report.grown_edges,
        dropped_chains: report.dropped_chains,
        alongside_edges: report.alongside_edges,
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
    const REVISION: u32 = 6;
    const INPUTS: &'static [InputDef] =
        &[InputDef { name: "from", accepts: &[Port::Surface], required: true, doc: "the surface to mark" }];
    const OUTPUTS: &'static [OutputDef] = &[OutputDef { name: "main", port: OutPort::Is(Port::Surface), derive: None }];
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
        watch.check()?;
        let (marked, stats) = features(surface, params, watch)?;
        Ok(Produced { artifact: Artifact::Surface(Arc::new(marked)), stats })
    }
}
