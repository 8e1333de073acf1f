//! Cuts every face into four similar ones.
//!
//! # Algorithm
//! All edges are halved, and each face becomes the one between its midpoints and three at its corners; the work is done
//! by `technique::refine`.
//!
//! Based on: H. Date, S. Kanai, T. Kishinami, I. Nishigaki, T. Dohi. High-Quality and Property Controlled Finite
//! Element Mesh Generation From Triangular Meshes using the Multiresolution Technique. JCISE 5(4), 2005, section 5.1.
//!
//! # Invariants
//! - Shape, area, volume and Euler characteristic stay.
//! - Without kept edges each round makes four times as many faces; stretch and angles stay, sizes halve.
//!
//! # Cost
//! Linear in the faces made.

use std::sync::Arc;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::mesh::Surface;
use crate::step::{
    Artifact, FailureKind, InputDef, Inputs, Locks, OutPort, OutputDef, Port, Produced, Step as StepContract,
    StepFailure,
};
use crate::technique::refine::{self, RefineError, Refinement};
use crate::watch::Watch;

/// Cuts every face into four similar ones, so that later steps have vertices to choose from.
///
/// Not for reaching a size: `refine` halves only the edges that are too long.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default, rename_all = "kebab-case")]
pub struct SubdivideParams {
    /// How many times; each time there are four times as many faces. Default 1, range 0 to 12.
    #[schemars(range(min = 0, max = 12))]
    pub times: u32,
    /// The step fails before it begins if the result would have more faces. Default 20 million.
    #[schemars(range(min = 1))]
    pub max_faces: usize,
}

impl Default for SubdivideParams {
    fn default() -> Self {
        Self { times: 1, max_faces: refine::MAX_FACES }
    }
}

/// What subdividing did.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub struct SubdivideStats {
    /// Faces before.
    pub faces_before: usize,
    /// Faces after.
    pub faces: usize,
    /// Edges halved in all rounds.
    pub halved_edges: usize,
    /// The longest edge of the result, in mesh units.
    pub longest_edge: f64,
}

/// Why subdividing refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SubdivideError {
    /// `times` is out of range.
    #[error("times must be at most 12, got {0}")]
    TooManyTimes(u32),
    /// See [`RefineError`].
    #[error(transparent)]
    Refine(#[from] RefineError),
}

/// Subdivides `surface`.
///
/// # Errors
/// See [`SubdivideError`].
pub fn subdivide(
    surface: &Surface,
    params: &SubdivideParams,
    locks: &Locks,
    watch: &Watch,
) -> Result<(Surface, SubdivideStats), SubdivideError> {
    if params.times > 12 {
        return Err(SubdivideError::TooManyTimes(params.times));
    }
    let (result, report) = refine::subdivide(surface, params.times, params.max_faces, &locks.rules(), watch)?;
    let stats = stats(surface, &result, report);
    Ok((result, stats))
}

fn stats(before: &Surface, after: &Surface, report: Refinement) -> SubdivideStats {
    SubdivideStats {
        faces_before: before.faces.len(),
        faces: after.faces.len(),
        halved_edges: report.halved,
        longest_edge: report.longest,
    }
}

impl From<SubdivideError> for StepFailure {
    fn from(error: SubdivideError) -> Self {
        let message = error.to_string();
        match error {
            SubdivideError::Refine(RefineError::Cancelled(cancelled)) => cancelled.into(),
            SubdivideError::Refine(RefineError::TooManyFaces { .. }) => {
                Self::failed(message).with_help("lower `times`, or raise `max-faces` if there is memory for it")
            }
            SubdivideError::Refine(RefineError::Locks(_) | RefineError::BadLimit(_) | RefineError::Flips(_))
            | SubdivideError::TooManyTimes(_) => Self::new(FailureKind::BadInput, message),
        }
    }
}

/// The room's entry in the catalog.
#[derive(Debug)]
pub struct Step;

impl StepContract for Step {
    const NAME: &'static str = "subdivide";
    const REVISION: u32 = 1;
    const INPUTS: &'static [InputDef] =
        &[InputDef { name: "from", accepts: &[Port::Surface], required: true, doc: "the surface to subdivide" }];
    const OUTPUTS: &'static [OutputDef] = &[OutputDef { name: "main", port: OutPort::Is(Port::Surface), derive: None }];
    const EDITS: bool = true;
    const CARRIES: &'static str = "groups, regions, marks and seams are inherited by the parts; a midpoint joins the \
        vertex groups of both its ends; vertex fields are linear, face fields as in the parent";
    const EXAMPLE: &'static str = "use = \"subdivide\"\nfrom = \"clean\"\ntimes = 1\n";

    type Params = SubdivideParams;
    type Stats = SubdivideStats;

    fn run(
        inputs: &Inputs,
        _output: &str,
        params: &SubdivideParams,
        locks: &Locks,
        watch: &Watch,
    ) -> Result<Produced<SubdivideStats>, StepFailure> {
        let (surface, stats) = subdivide(inputs.surface("from")?, params, locks, watch)?;
        Ok(Produced { artifact: Artifact::Surface(Arc::new(surface)), stats })
    }
}
