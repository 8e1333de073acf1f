//! Improves element quality by refining and collapsing.
//!
//! # Algorithm
//! Selective subdivision first, until no edge is longer than `max-edge`: the freedom that collapse needs. Then the
//! collapse that improves its star most, relative to its size, again and again while the tolerance allows. Surfaces of
//! hundreds of thousands of faces are first simplified in cells, on all threads ([`crate::technique::cells`]).
//!
//! Based on: H. Date, S. Kanai, T. Kishinami, I. Nishigaki, T. Dohi. High-Quality and Property Controlled Finite
//! Element Mesh Generation From Triangular Meshes using the Multiresolution Technique. JCISE 5(4), 2005, section 4.
//!
//! # Invariants
//! - Topology, marked curves and kept elements stay; no new self-intersection.
//! - In `distance` mode the surface stays within the tolerance of the reference, both ways, at every moment.
//! - No collapse leaves a face below a stretch of 0.2 where its star had none.
//!
//! # Cost
//! O(F log F) in the faces after refinement; a needle of length `l` gives at least `l / max-edge` of them.
//!
//! # Departures
//! Without `target-faces` the result keeps `max-edge`, since nothing else would stop on flat parts; the floor of 0.2;
//! with `optimize`, flips and relaxation in between.

use std::sync::Arc;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::mesh::halfedge::EnterError;
use crate::mesh::transfer::inherit_fields;
use crate::mesh::{FreedomError, Hierarchy, IdVec, LockRules, Surface, resolve_freedom};
use crate::metric::ToleranceMode;
use crate::step::{
    Artifact, InputDef, Inputs, Length, Locks, OutPort, OutputDef, Port, Produced, REFERENCE, ResolvedSizing, Sizing,
    StepFailure, Tolerance, ToleranceError,
};
use crate::technique::cells::{Task, Thinned, thin};
use crate::technique::collapse::{CollapseRules, Ending, Goal, Order, Priority, simplify};
use crate::technique::guarded::{
    Counts, GuardedMesh, Limits, Setup, SizeField, StarRules, diagonal, open, recount, reference_tree,
};
use crate::technique::hierarchy::{Front, extract};
use crate::technique::levels::{HierarchyReport, Recorded, Source, build};
use crate::technique::refine::{Flips, MAX_FACES, MaxEdge, RefineError, refine};
use crate::technique::remesh::{coarsen, comfortable};
use crate::watch::{Cancelled, Watch};

/// Stretch that collapses do not fall below where their star was above it: the usual floor for analysis.
const FLOOR: f64 = 0.2;

/// Improves element quality: refines to `max-edge`, then collapses what improves the elements most.
///
/// Use it first on tessellations full of slivers; `subdivide` and `control-properties` follow.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default, rename_all = "kebab-case")]
pub struct ImproveQualityParams {
    /// Edges are halved until none is longer; about the size of the elements wanted. Default: no refinement.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_edge: Option<Sizing>,
    /// How far the result may lie from `reference`; see `tolerance-mode` for its meaning and unit. Default 0.2 % of the
    /// reference's diagonal.
    pub tolerance: Length,
    /// What `tolerance` means. Default `"distance"`. In `"quadric-sum"` it is a squared length, given as a number.
    pub tolerance_mode: ToleranceMode,
    /// How far marked curves may move. Default: half of `tolerance` in `distance` mode; other modes do not use it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub feature_tolerance: Option<Length>,
    /// Weight of the sharpest marked edges in the quadrics that place vertices. Default 100.
    #[schemars(range(min = 0.0))]
    pub feature_weight: f64,
    /// Stops when this many faces are left; edges may then grow beyond `max-edge`. Default: goes on until no edge is
    /// valid.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub target_faces: Option<usize>,
    /// Refinement that would make more faces than this is refused. Default 20 million.
    #[schemars(range(min = 4))]
    pub max_faces: usize,
    /// Whether flips, splits and relaxation go in between the collapses. Default: in `distance` mode only; `false` is
    /// the pure collapse of the papers.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub optimize: Option<bool>,
}

impl Default for ImproveQualityParams {
    fn default() -> Self {
        Self {
            max_edge: None,
            tolerance: Length::Percent(0.2),
            tolerance_mode: ToleranceMode::Distance,
            feature_tolerance: None,
            feature_weight: 100.0,
            target_faces: None,
            max_faces: MAX_FACES,
            optimize: None,
        }
    }
}

impl ImproveQualityParams {
    fn tolerance(&self) -> Tolerance {
        Tolerance {
            mode: self.tolerance_mode,
            tolerance: self.tolerance,
            feature_tolerance: self.feature_tolerance,
            feature_weight: self.feature_weight,
        }
    }
}

/// What quality improvement did. Shape and size are counted on the result.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub struct ImproveQualityStats {
    /// Whether the number of faces asked for was reached; `true` where none was asked for.
    pub target_reached: bool,
    /// Faces of the input.
    pub faces_before: usize,
    /// Faces after refinement.
    pub faces_refined: usize,
    /// Faces of the result.
    pub faces_after: usize,
    /// What was done after refinement, and what was refused.
    #[serde(flatten)]
    pub counts: Counts,
    /// Least stretch before.
    pub min_stretch_before: f64,
    /// Mean stretch before.
    pub mean_stretch_before: f64,
    /// Least stretch.
    pub min_stretch: f64,
    /// Mean stretch.
    pub mean_stretch: f64,
    /// Longest side, in mesh units.
    pub max_size: f64,
    /// Most edges at a vertex.
    pub max_valence: usize,
    /// The tolerance in mesh units (their square in `quadric-sum` mode).
    pub tolerance: f64,
    /// Certified upper bound of the two-sided distance to `reference`, in mesh units: the tolerance, or less where
    /// every edit told how far it moved the surface, and 0 where there was none. Absent in the quadric modes, and where
    /// the input was further away than the tolerance and could not be brought back.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub distance_bound: Option<f64>,
    /// The finest end, where the output is the hierarchy; all other figures are then those of its coarsest front.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub hierarchy: Option<HierarchyReport>,
}

/// Why quality improvement refused.
#[derive(Debug, thiserror::Error)]
pub enum ImproveQualityError {
    /// The tolerance makes no sense.
    #[error(transparent)]
    Tolerance(#[from] ToleranceError),
    /// A size names a field or group that is not there.
    #[error("max-edge: {0}")]
    Size(StepFailure),
    /// Refinement refused.
    #[error(transparent)]
    Refine(#[from] RefineError),
    /// A lock names a group that is not there.
    #[error(transparent)]
    Locks(#[from] FreedomError),
    /// The input is no surface.
    #[error(transparent)]
    NotASurface(#[from] EnterError),
    /// The run was interrupted.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

/// What quality improvement works on.
#[derive(Clone, Copy, Debug)]
pub struct ImproveQualityInput<'a> {
    /// The surface to improve.
    pub surface: &'a Surface,
    /// What the tolerance is measured against.
    pub reference: &'a Surface,
    /// What must stay.
    pub locks: LockRules<'a>,
}

/// Improves `input.surface`.
///
/// # Errors
/// [`ImproveQualityError`]: parameters, groups or fields that do not fit the surface, or too fine a `max-edge`.
pub fn improve_quality(
    input: ImproveQualityInput<'_>,
    params: &ImproveQualityParams,
    watch: &Watch,
) -> Result<(Surface, ImproveQualityStats), ImproveQualityError> {
    let scale = diagonal(input.reference);
    let sizing = params.max_edge.as_ref().map(|size| size.resolve(input.surface, scale)).transpose();
    let sizing = sizing.map_err(ImproveQualityError::Size)?;
    let refined = refine_surface(&input, sizing.as_ref(), params.max_faces, watch)?;
    let surface = refined.as_ref().unwrap_or(input.surface);
    let freedom = resolve_freedom(surface, &input.locks)?;
    let setup = setup(&input, params, sizing, scale)?;
    let tree = reference_tree(params.tolerance_mode, input.reference);
    let thinned = thinned(surface, &input, params, &setup, watch)?;
    let mut guarded = match &thinned {
        None => open(surface, &freedom, input.reference, &tree, setup.clone())?,
        Some(thinned) => {
            let freedom = resolve_freedom(&thinned.surface, &input.locks)?;
            let mut guarded = open(&thinned.surface, &freedom, input.reference, &tree, setup.clone())?;
            thinned.hand_over(&mut guarded);
            guarded
        }
    };
    let ending = run_phases(&mut guarded, params, watch)?;
    let counts = guarded.counts() + thinned.as_ref().map_or_else(Counts::default, |thinned| thinned.counts);
    let distance_bound = if lies_on_reference(&input) && counts.edits() == 0 {
        // Refinement alone leaves the surface the same set of points.
        guarded.distance_bound(setup.tolerance).map(|_| 0.0)
    } else {
        guarded.distance_bound(setup.tolerance)
    };
    let mut result = guarded.into_mesh().leave().surface;
    inherit_fields(surface, &mut result);
    let target_reached = params.target_faces.is_none() || ending == Ending::Target;
    let end = End { target_reached, faces_refined: surface.faces.len(), counts, distance_bound };
    let stats = stats(&input, &setup, &result, end)?;
    Ok((result, stats))
}

/// A large surface simplified in cells on the way to fewer faces.
fn thinned(
    surface: &Surface,
    input: &ImproveQualityInput<'_>,
    params: &ImproveQualityParams,
    setup: &Setup,
    watch: &Watch,
) -> Result<Option<Thinned>, ImproveQualityError> {
    let rules = if optimises(params) { comfortable(&rules(params), false) } else { rules(params) };
    let faces = params.target_faces.unwrap_or(0);
    thin(&Task { surface, reference: input.reference, locks: input.locks, setup, rules: &rules, faces }, watch)
}

/// Whether the surface is its own reference.
fn lies_on_reference(input: &ImproveQualityInput<'_>) -> bool {
    let ImproveQualityInput { surface, reference, .. } = input;
    surface.faces == reference.faces && surface.points == reference.points
}

/// Refines, mends and optimises `input.surface`, then records every collapse that the tolerance allows. The statistics
/// are those of the coarsest front.
///
/// # Errors
/// As [`improve_quality`].
pub fn record_quality(
    input: ImproveQualityInput<'_>,
    params: &ImproveQualityParams,
    watch: &Watch,
) -> Result<(Hierarchy, ImproveQualityStats), ImproveQualityError> {
    let scale = diagonal(input.reference);
    let sizing = params.max_edge.as_ref().map(|size| size.resolve(input.surface, scale)).transpose();
    let sizing = sizing.map_err(ImproveQualityError::Size)?;
    let refined = refine_surface(&input, sizing.as_ref(), params.max_faces, watch)?;
    let surface = refined.as_ref().unwrap_or(input.surface);
    let setup = setup(&input, params, None, scale)?;
    let tree = reference_tree(params.tolerance_mode, input.reference);
    let source = Source { surface, reference: input.reference, tree: &tree, locks: input.locks };
    let recorded: Recorded = build::<ImproveQualityError>(source, &setup, &rules(params), optimises(params), watch)?;
    let coarsest = extract(&Front::coarsest(&recorded.hierarchy));
    let end = End {
        target_reached: true,
        faces_refined: surface.faces.len(),
        counts: recorded.counts,
        distance_bound: recorded.distance_bound,
    };
    let mut stats = stats(&input, &setup, &coarsest, end)?;
    stats.hierarchy = Some(HierarchyReport::of(&recorded.hierarchy));
    Ok((recorded.hierarchy, stats))
}

/// How the work ended.
struct End {
    target_reached: bool,
    faces_refined: usize,
    counts: Counts,
    distance_bound: Option<f64>,
}

/// Counts shape and size on the result.
fn stats(
    input: &ImproveQualityInput<'_>,
    setup: &Setup,
    result: &Surface,
    end: End,
) -> Result<ImproveQualityStats, ImproveQualityError> {
    let before = recount(input.surface, &resolve_freedom(input.surface, &input.locks)?, &setup.limits);
    let after = recount(result, &resolve_freedom(result, &input.locks)?, &setup.limits);
    Ok(ImproveQualityStats {
        target_reached: end.target_reached,
        faces_before: input.surface.faces.len(),
        faces_refined: end.faces_refined,
        faces_after: result.faces.len(),
        counts: end.counts,
        min_stretch_before: before.min_stretch,
        mean_stretch_before: before.mean_stretch,
        min_stretch: after.min_stretch,
        mean_stretch: after.mean_stretch,
        max_size: after.max_size,
        max_valence: after.max_valence,
        tolerance: setup.tolerance,
        distance_bound: end.distance_bound,
        hierarchy: None,
    })
}

fn rules(params: &ImproveQualityParams) -> CollapseRules {
    CollapseRules {
        star: StarRules { min_stretch: FLOOR, ..StarRules::default() },
        order: Order::of(params.tolerance_mode),
        priority: Priority::QualityGain,
    }
}

fn optimises(params: &ImproveQualityParams) -> bool {
    params.optimize.unwrap_or(params.tolerance_mode == ToleranceMode::Distance)
}

fn run_phases(
    guarded: &mut GuardedMesh<'_>,
    params: &ImproveQualityParams,
    watch: &Watch,
) -> Result<Ending, Cancelled> {
    let rules = rules(params);
    let goal = Goal { faces: params.target_faces.unwrap_or(0), ..Goal::default() };
    if optimises(params) { coarsen(guarded, &rules, goal, watch) } else { simplify(guarded, &rules, goal, watch) }
}

/// Selective subdivision; `None` where nothing was asked for.
fn refine_surface(
    input: &ImproveQualityInput<'_>,
    sizing: Option<&ResolvedSizing>,
    max_faces: usize,
    watch: &Watch,
) -> Result<Option<Surface>, RefineError> {
    let limit = match sizing {
        None => return Ok(None),
        Some(ResolvedSizing::Uniform(length)) => MaxEdge::Uniform(*length),
        Some(ResolvedSizing::Corners(values)) => MaxEdge::Corners(IdVec::from(values.clone())),
    };
    let (surface, _) = refine(input.surface, &limit, max_faces, Flips::None, &input.locks, watch)?;
    Ok(Some(surface))
}

fn setup(
    input: &ImproveQualityInput<'_>,
    params: &ImproveQualityParams,
    sizing: Option<ResolvedSizing>,
    diagonal: f64,
) -> Result<Setup, ImproveQualityError> {
    let tolerance = params.tolerance().resolve(diagonal)?;
    let max_size = match sizing {
        Some(ResolvedSizing::Uniform(length)) if params.target_faces.is_none() => SizeField::Uniform(length),
        Some(ResolvedSizing::Corners(values)) if params.target_faces.is_none() => {
            SizeField::varying(input.surface, values)
        }
        None | Some(_) => SizeField::Uniform(f64::INFINITY),
    };
    Ok(Setup {
        mode: tolerance.mode,
        tolerance: tolerance.tolerance,
        feature_tolerance: tolerance.feature_tolerance,
        feature_weight: tolerance.feature_weight,
        // Quality improvement has no valence limit of its own; this one keeps fans of hundreds of faces away.
        limits: Limits { min_stretch: FLOOR, max_size, max_valence: 12 },
        may_merge_corners: !input.locks.name_elements(),
    })
}

impl From<ImproveQualityError> for StepFailure {
    fn from(error: ImproveQualityError) -> Self {
        let message = error.to_string();
        match error {
            ImproveQualityError::Cancelled(cancelled)
            | ImproveQualityError::Refine(RefineError::Cancelled(cancelled)) => cancelled.into(),
            ImproveQualityError::Tolerance(error) => error.into(),
            ImproveQualityError::Size(failure) => Self { message, ..failure },
            ImproveQualityError::NotASurface(_) => Self::bad_input(message).with_help("run `repair` first"),
            ImproveQualityError::Refine(RefineError::TooManyFaces { .. }) => {
                Self::failed(message).with_help("give a larger `max-edge`, or a larger `max-faces` if that is meant")
            }
            ImproveQualityError::Refine(_) | ImproveQualityError::Locks(_) => Self::failed(message),
        }
    }
}

/// The failure, with what was perhaps meant by a size that makes too many faces.
fn failure(error: ImproveQualityError, params: &ImproveQualityParams) -> StepFailure {
    let too_many = matches!(error, ImproveQualityError::Refine(RefineError::TooManyFaces { .. }));
    let guess = params.max_edge.as_ref().filter(|_| too_many).and_then(Sizing::perhaps_meant);
    StepFailure::from(error).with_guess(guess)
}

/// The room's entry in the catalog.
pub struct Step;

impl crate::step::Step for Step {
    const NAME: &'static str = "improve-quality";
    const REVISION: u32 = 19;
    const INPUTS: &'static [InputDef] = &[
        InputDef { name: "from", accepts: &[Port::Surface], required: true, doc: "the surface to improve" },
        REFERENCE,
    ];
    const OUTPUTS: &'static [OutputDef] = &[
        OutputDef { name: "main", port: OutPort::Is(Port::Surface), derive: None },
        OutputDef { name: "hierarchy", port: OutPort::Is(Port::Hierarchy), derive: None },
    ];
    const EDITS: bool = true;
    const CARRIES: &'static str =
        "Maps groups, regions, marks, pins and seams; takes fields from the nearest points of `from`.";
    const EXAMPLE: &'static str =
        "use = \"improve-quality\"\nfrom = \"clean\"\nmax-edge = \"2%\"\ntolerance = \"0.2%\"\n";

    type Params = ImproveQualityParams;
    type Stats = ImproveQualityStats;

    fn run(
        inputs: &Inputs,
        output: &str,
        params: &ImproveQualityParams,
        locks: &Locks,
        watch: &Watch,
    ) -> Result<Produced<ImproveQualityStats>, StepFailure> {
        let surface = inputs.surface("from")?;
        let reference = inputs.surface_opt("reference")?.unwrap_or(surface);
        let input = ImproveQualityInput { surface, reference, locks: locks.rules() };
        if output == "hierarchy" {
            let (hierarchy, stats) = record_quality(input, params, watch).map_err(|error| failure(error, params))?;
            return Ok(Produced { artifact: Artifact::Hierarchy(Arc::new(hierarchy)), stats });
        }
        let (surface, stats) = improve_quality(input, params, watch).map_err(|error| failure(error, params))?;
        Ok(Produced { artifact: Artifact::Surface(Arc::new(surface)), stats })
    }
}
