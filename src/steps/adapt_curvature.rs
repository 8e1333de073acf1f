//! Takes a mesh from a hierarchy that is the finer the more the surface bends.
//!
//! From a coarse front, nodes whose elements are larger than `largest · (1 − min(κ / κ_p, 1))^gamma` are split, with
//! whatever must be split before them, until no face has a longer side than any of its vertices asks for.
//!
//! Based on: H. Date, S. Kanai, T. Kishinami, I. Nishigaki. Mesh Simplification and Adaptive LOD for Finite Element
//! Mesh Generation, 2005, section 5.3.1.
//!
//! # Invariants
//! Without `polish`, every face was seen while the hierarchy was recorded, so thresholds hold if they hold at the
//! finest.
//!
//! # Cost
//! O(n log n) in the nodes above the result; the reported distance costs more.
//!
//! # Departures
//! `κ_p` is a percentile of the curvatures, not the largest, which one spike decides. The paper compares the mean size
//! of a vertex's faces when it was made; here the longest side of every face counts as it is in the result.

use std::sync::Arc;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::mesh::geometry::Aabb;
use crate::mesh::{Hierarchy, Surface};
use crate::step::{
    Artifact, InputDef, Inputs, Length, Locks, OutPort, OutputDef, Port, Produced, Resolution, Share,
    Step as StepContract, StepFailure,
};
use crate::technique::hierarchy::{Front, curvature_thresholds};
use crate::technique::levels::{FrontReport, extract_measured};
use crate::watch::{Cancelled, Watch};

/// Takes a mesh from a hierarchy that is the finer the more the surface bends.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default, rename_all = "kebab-case")]
pub struct AdaptCurvatureParams {
    /// The mesh to refine from: a number of faces or a percent of the finest mesh's. Default: the coarsest one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub base: Option<Resolution>,
    /// Element size where the surface is flat; percents refer to the diagonal. Default: the largest of `base`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub largest: Option<Length>,
    /// Elements are not made smaller than this by curvature; percents refer to the diagonal. Default 0: as small as
    /// there are, where the curvature is that of `percentile` or more.
    pub smallest: Length,
    /// The share of the vertices whose curvature counts in proportion; beyond it elements are smallest. Default 95 %.
    pub percentile: Share,
    /// How sizes fall with curvature: 1 in proportion, above 1 faster, below 1 later. Default 1.
    #[schemars(range(min = 0.01, max = 100.0))]
    pub gamma: f64,
    /// Betters the mesh by flips and relaxation, each certified: stretch, size and valence stay within what the mesh
    /// has without it, and so does the distance from the finest mesh, which is itself off the reference of its
    /// simplification. Its faces then are no longer those that were recorded. Default false.
    pub polish: bool,
}

impl Default for AdaptCurvatureParams {
    fn default() -> Self {
        Self {
            base: None,
            largest: None,
            smallest: Length::Absolute(0.0),
            percentile: Share(0.95),
            gamma: 1.0,
            polish: false,
        }
    }
}

/// What came out.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub struct AdaptCurvatureStats {
    /// Faces of the mesh to refine from.
    pub base_faces: usize,
    /// Element size where the surface is flat, in mesh units.
    pub largest: f64,
    /// Vertices of the finest mesh at whose place a face has a longer side than their curvature asks for: one of the
    /// finest mesh. Those that ask for the smallest faces there are do not count.
    pub vertices_coarser: usize,
    /// The mesh.
    pub front: FrontReport,
}

/// Why there is no mesh.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum AdaptCurvatureError {
    /// The exponent is out of range.
    #[error("gamma must be from 0.01 to 100, got {0}")]
    Gamma(f64),
    /// The hierarchy has no curvature.
    #[error("the hierarchy was recorded without curvature")]
    NoCurvature,
    /// The run was interrupted.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

/// Takes a mesh from `hierarchy`.
///
/// # Errors
/// See [`AdaptCurvatureError`].
pub fn adapt_curvature(
    hierarchy: &Hierarchy,
    params: &AdaptCurvatureParams,
    watch: &Watch,
) -> Result<(Surface, AdaptCurvatureStats), AdaptCurvatureError> {
    if !(0.01..=100.0).contains(&params.gamma) {
        return Err(AdaptCurvatureError::Gamma(params.gamma));
    }
    if hierarchy.curvature.len() != hierarchy.node_count() {
        return Err(AdaptCurvatureError::NoCurvature);
    }
    let finest = &hierarchy.finest;
    let mut front = Front::base(hierarchy, params.base.map(|base| base.faces(finest.faces.len())));
    let base_faces = front.face_count();
    let diagonal = Aabb::of(finest.points.iter().copied()).diagonal();
    let of_base = || front.longest_sides().iter().copied().fold(0.0, f64::max);
    let largest = params.largest.map_or_else(of_base, |length| length.resolve(diagonal));
    let smallest = params.smallest.resolve(diagonal);
    let mut thresholds = curvature_thresholds(hierarchy, largest, params.percentile.0, params.gamma);
    for size in &mut thresholds {
        *size = size.max(smallest);
    }
    watch.phase("refine", None);
    front.refine_faces_to(&thresholds, watch)?;
    // A size of 0 asks for the smallest faces there are.
    let wish = |leaf| if thresholds[leaf] > 0.0 { thresholds[leaf] } else { f64::INFINITY };
    let (vertices_coarser, _) = front.coarser(wish);
    let (mesh, report) = extract_measured(&front, params.polish, watch)?;
    Ok((mesh, AdaptCurvatureStats { base_faces, largest, vertices_coarser, front: report }))
}

impl From<AdaptCurvatureError> for StepFailure {
    fn from(error: AdaptCurvatureError) -> Self {
        match error {
            AdaptCurvatureError::Cancelled(cancelled) => cancelled.into(),
            AdaptCurvatureError::Gamma(_) => Self::failed(error.to_string()),
            AdaptCurvatureError::NoCurvature => Self::bad_input(error.to_string()),
        }
    }
}

/// The room's entry in the catalog.
#[derive(Debug)]
pub struct Step;

impl StepContract for Step {
    const NAME: &'static str = "adapt-curvature";
    const REVISION: u32 = 5;
    const INPUTS: &'static [InputDef] = &[InputDef {
        name: "from",
        accepts: &[Port::Hierarchy],
        required: true,
        doc: "a hierarchy, such as `fe.hierarchy` of a simplification step `fe`",
    }];
    const OUTPUTS: &'static [OutputDef] = &[OutputDef { name: "main", port: OutPort::Is(Port::Surface), derive: None }];
    const CARRIES: &'static str =
        "Maps groups, regions, marks, pins and seams; takes fields from the nearest points of the finest mesh.";
    const EXAMPLE: &'static str =
        "use = \"adapt-curvature\"\nfrom = \"fe.hierarchy\"\nbase = \"10%\"\nsmallest = \"0.5%\"\n";

    type Params = AdaptCurvatureParams;
    type Stats = AdaptCurvatureStats;

    fn run(
        inputs: &Inputs,
        _output: &str,
        params: &AdaptCurvatureParams,
        _locks: &Locks,
        watch: &Watch,
    ) -> Result<Produced<AdaptCurvatureStats>, StepFailure> {
        let (surface, stats) = adapt_curvature(inputs.hierarchy("from")?, params, watch)?;
        Ok(Produced { artifact: Artifact::Surface(Arc::new(surface)), stats })
    }
}
