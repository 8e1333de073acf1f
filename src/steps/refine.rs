//! Halves edges until none is longer than a limit.
//!
//! # Algorithm
//! Midpoints of all edges that are too long, and the faces between them cut to match, in rounds; the work is done by
//! `technique::refine`. With `flips`, edges between faces of one plane are flipped before the first round and after
//! each where that makes the least angle of the two faces larger.
//!
//! Based on: H. Date, S. Kanai, T. Kishinami, I. Nishigaki, T. Dohi. High-Quality and Property Controlled Finite
//! Element Mesh Generation From Triangular Meshes using the Multiresolution Technique. JCISE 5(4), 2005, section 4.1.
//!
//! # Invariants
//! - Shape, area, volume and Euler characteristic stay. With `flips` the surface moves by no more than coordinates in
//!   single precision are rounded, and the statistics tell how far.
//! - No edge of the result is longer than its limit, except kept edges and the few that they force, which the
//!   statistics count.
//!
//! # Cost
//! Linear in the faces made, times the logarithm of the longest edge over the limit.
//!
//! # Departures
//! The paper only halves. The flat faces of CAD programs are fans of needles, and each needle would be cut to pieces of
//! its own: eight times the faces on a ring of 448 needles, nearly all of them still thin.

use std::sync::Arc;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::mesh::Surface;
use crate::mesh::geometry::Aabb;
use crate::step::{
    Artifact, FailureKind, InputDef, Inputs, Length, Locks, OutPort, OutputDef, Port, Produced, ResolvedSizing, Sizing,
    Step as StepContract, StepFailure,
};
use crate::technique::refine::{self, Flips, MaxEdge, RefineError as Reason};
use crate::watch::Watch;

/// Halves the edges that are too long, without changing the shape.
///
/// Elements get smaller, not better: see `flips`, or use `improve-quality` or `control-properties` afterwards.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct RefineParams {
    /// Longest edge: a length, a field, or lengths by face group. Percents refer to the diagonal of `from`.
    pub max_edge: Sizing,
    /// The step fails before it begins if the result would have more faces. Default 20 million.
    #[serde(default = "max_faces")]
    #[schemars(range(min = 1))]
    pub max_faces: usize,
    /// Whether edges between faces of one plane are flipped where that makes the least angle larger: the needles of
    /// flat faces give way to fewer and better ones. The surface moves by no more than coordinates in single precision
    /// are rounded, marks and groups stay, and vertex fields are linear over the new faces. Default false.
    #[serde(default)]
    pub flips: bool,
}

fn max_faces() -> usize {
    refine::MAX_FACES
}

impl Default for RefineParams {
    fn default() -> Self {
        Self { max_edge: Length::Percent(2.0).into(), max_faces: max_faces(), flips: false }
    }
}

/// What refining did.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub struct RefineStats {
    /// Faces before.
    pub faces_before: usize,
    /// Faces after.
    pub faces: usize,
    /// Rounds of halving.
    pub rounds: usize,
    /// Edges halved in all rounds.
    pub halved_edges: usize,
    /// The longest edge of the result, in mesh units.
    pub longest_edge: f64,
    /// Edges of the result above the limit: kept ones, and those that kept ones force.
    pub edges_above_limit: usize,
    /// Edges flipped in all rounds.
    pub flips: usize,
    /// The largest distance between the diagonals of a pair of faces that was flipped, in mesh units.
    pub largest_shift: f64,
}

/// Why refining refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RefineError {
    /// The lengths cannot be had on this surface.
    #[error(transparent)]
    Size(StepFailure),
    /// See [`Reason`].
    #[error(transparent)]
    Refine(#[from] Reason),
}

/// Refines `surface`.
///
/// # Errors
/// See [`RefineError`].
pub fn refine(
    surface: &Surface,
    params: &RefineParams,
    locks: &Locks,
    watch: &Watch,
) -> Result<(Surface, RefineStats), RefineError> {
    let diagonal = Aabb::of(surface.points.iter().copied()).diagonal();
    let max_edge = match params.max_edge.resolve(surface, diagonal).map_err(RefineError::Size)? {
        ResolvedSizing::Uniform(length) => MaxEdge::Uniform(length),
        ResolvedSizing::Corners(corners) => MaxEdge::Corners(corners.into()),
    };
    let flips = if params.flips { Flips::Flat } else { Flips::None };
    let (result, report) = refine::refine(surface, &max_edge, params.max_faces, flips, &locks.rules(), watch)?;
    let stats = RefineStats {
        faces_before: surface.faces.len(),
        faces: result.faces.len(),
        rounds: report.rounds,
        halved_edges: report.halved,
        longest_edge: report.longest,
        edges_above_limit: report.long_edges,
        flips: report.flips,
        largest_shift: report.largest_shift,
    };
    Ok((result, stats))
}

impl From<RefineError> for StepFailure {
    fn from(error: RefineError) -> Self {
        let message = error.to_string();
        match error {
            RefineError::Size(failure) => failure,
            RefineError::Refine(Reason::Cancelled(cancelled)) => cancelled.into(),
            RefineError::Refine(Reason::TooManyFaces { .. }) => {
                Self::failed(message).with_help("raise `max-edge`, or raise `max-faces` if there is memory for it")
            }
            RefineError::Refine(Reason::Locks(_) | Reason::BadLimit(_) | Reason::Flips(_)) => {
                Self::new(FailureKind::BadInput, message)
            }
        }
    }
}

/// The room's entry in the catalog.
#[derive(Debug)]
pub struct Step;

impl StepContract for Step {
    const NAME: &'static str = "refine";
    const REVISION: u32 = 1;
    const INPUTS: &'static [InputDef] =
        &[InputDef { name: "from", accepts: &[Port::Surface], required: true, doc: "the surface to refine" }];
    const OUTPUTS: &'static [OutputDef] = &[OutputDef { name: "main", port: OutPort::Is(Port::Surface), derive: None }];
    const EDITS: bool = true;
    const CARRIES: &'static str = "groups, regions, marks and seams are inherited by the parts; a midpoint joins the \
        vertex groups of both its ends; vertex fields are linear, face fields as in the parent";
    const EXAMPLE: &'static str = "use = \"refine\"\nfrom = \"clean\"\nmax-edge = \"5%\"\n";

    type Params = RefineParams;
    type Stats = RefineStats;

    fn run(
        inputs: &Inputs,
        _output: &str,
        params: &RefineParams,
        locks: &Locks,
        watch: &Watch,
    ) -> Result<Produced<RefineStats>, StepFailure> {
        let refined = refine(inputs.surface("from")?, params, locks, watch);
        let (surface, stats) = refined.map_err(|error| {
            let too_many = matches!(error, RefineError::Refine(Reason::TooManyFaces { .. }));
            let guess = too_many.then(|| params.max_edge.perhaps_meant()).flatten();
            StepFailure::from(error).with_guess(guess)
        })?;
        Ok(Produced { artifact: Artifact::Surface(Arc::new(surface)), stats })
    }
}
