//! Takes a mesh of the number of faces wanted from a hierarchy.
//!
//! The recorded collapses are done in their order until one more would leave fewer faces than asked for.
//!
//! Based on: H. Date, S. Kanai, T. Kishinami, I. Nishigaki. Mesh Simplification and Adaptive LOD for Finite Element
//! Mesh Generation, 2005, section 5. Based on: H. Hoppe. Progressive meshes, SIGGRAPH 1996.
//!
//! # Invariants
//! - Without `polish`, every face was seen while the hierarchy was recorded, so thresholds hold if they hold at the
//!   finest.
//! - The share `"100%"` is the finest mesh bit for bit.
//!
//! # Cost
//! Linear; the reported distance costs more than the mesh.

use std::sync::Arc;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::mesh::{Hierarchy, Surface};
use crate::step::{
    Artifact, InputDef, Inputs, Locks, OutPort, OutputDef, Port, Produced, Share, Step as StepContract, StepFailure,
};
use crate::technique::hierarchy::Front;
use crate::technique::levels::{FrontReport, extract_measured};
use crate::watch::{Cancelled, Watch};

/// Takes a mesh of the number of faces wanted from a hierarchy.
///
/// Give either `faces` or `share`. One recorded hierarchy serves any number of these steps.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default, rename_all = "kebab-case")]
pub struct ResolutionParams {
    /// The least number of faces; the result has as many or one or two more.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub faces: Option<usize>,
    /// The same as a share of the finest mesh's faces, such as `"25%"`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub share: Option<Share>,
    /// Betters the mesh by flips and relaxation, each certified: stretch, size and valence stay within what the mesh
    /// has without it, and so does the distance from the finest mesh, which is itself off the reference of its
    /// simplification. Its faces then are no longer those that were recorded. Default false.
    pub polish: bool,
}

/// What came out.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub struct ResolutionStats {
    /// Whether the hierarchy reaches the number of faces: not if it is finer or coarser than any of its meshes.
    pub target_reached: bool,
    /// The mesh.
    pub front: FrontReport,
}

/// Why there is no mesh.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum ResolutionError {
    /// Neither or both were given.
    #[error("give either `faces` or `share`")]
    NotOne,
    /// The run was interrupted.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

/// Takes a mesh from `hierarchy`.
///
/// # Errors
/// See [`ResolutionError`]. A number of faces that the hierarchy does not reach is no error.
pub fn resolution(
    hierarchy: &Hierarchy,
    params: &ResolutionParams,
    watch: &Watch,
) -> Result<(Surface, ResolutionStats), ResolutionError> {
    let finest = hierarchy.finest.faces.len();
    let wanted = match (params.faces, params.share) {
        (Some(faces), None) => faces,
        (None, Some(share)) => (share.0 * finest as f64).round() as usize,
        (None, None) | (Some(_), Some(_)) => return Err(ResolutionError::NotOne),
    };
    let front = Front::with_faces(hierarchy, wanted);
    // A collapse takes at most two faces.
    let target_reached = front.face_count() >= wanted && front.face_count() <= wanted.saturating_add(1);
    let (mesh, report) = extract_measured(&front, params.polish, watch)?;
    Ok((mesh, ResolutionStats { target_reached, front: report }))
}

impl From<ResolutionError> for StepFailure {
    fn from(error: ResolutionError) -> Self {
        match error {
            ResolutionError::Cancelled(cancelled) => cancelled.into(),
            ResolutionError::NotOne => Self::failed(error.to_string()).with_help("for example share = \"25%\""),
        }
    }
}

/// The room's entry in the catalog.
#[derive(Debug)]
pub struct Step;

impl StepContract for Step {
    const NAME: &'static str = "resolution";
    const REVISION: u32 = 4;
    const INPUTS: &'static [InputDef] = &[InputDef {
        name: "from",
        accepts: &[Port::Hierarchy],
        required: true,
        doc: "a hierarchy, such as `fe.hierarchy` of a simplification step `fe`",
    }];
    const OUTPUTS: &'static [OutputDef] = &[OutputDef { name: "main", port: OutPort::Is(Port::Surface), derive: None }];
    const CARRIES: &'static str =
        "Maps groups, regions, marks, pins and seams; takes fields from the nearest points of the finest mesh.";
    const EXAMPLE: &'static str = "use = \"resolution\"\nfrom = \"fe.hierarchy\"\nshare = \"25%\"\n";

    type Params = ResolutionParams;
    type Stats = ResolutionStats;

    fn run(
        inputs: &Inputs,
        _output: &str,
        params: &ResolutionParams,
        _locks: &Locks,
        watch: &Watch,
    ) -> Result<Produced<ResolutionStats>, StepFailure> {
        let (surface, stats) = resolution(inputs.hierarchy("from")?, params, watch)?;
        Ok(Produced { artifact: Artifact::Surface(Arc::new(surface)), stats })
    }
}
