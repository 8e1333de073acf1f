//! Meshes a surface anew: elements of the size and shape asked for, within a certified distance.
//!
//! # Algorithm
//! Rounds of splits, collapses, flips and moves by a field of sizes, one certificate for all of them, smaller sizes
//! where it fails; the work is done by `technique::adaptive`. Poor elements that are left are mended one by one in a
//! guarded mesh.
//!
//! Based on: M. Botsch, L. Kobbelt. A remeshing approach to multiresolution modeling. SGP 2004, and what
//! `technique::adaptive` names.
//!
//! # Invariants
//! - Topology, marked curves and kept elements stay; groups and regions keep their borders.
//! - `distance-bound` is there only where the two-sided distance was certified.
//!
//! # Cost
//! Linear in the faces of input and result, with several closest-point queries for each vertex of the result.
//!
//! # Departures
//! Edits are not certified one by one, as in `improve-quality` and `control-properties`, but all at once. Where no
//! certificate is reached, the statistics say so (`guarded-all-along`) and the surface is meshed as those do.

use std::sync::Arc;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::mesh::geometry::triangle_area;
use crate::mesh::transfer::inherit_fields;
use crate::mesh::{FaceId, LockRules, Surface, resolve_freedom};
use crate::metric::ToleranceMode;
use crate::step::tolerance::{OutOfRange, Tolerance, ToleranceError};
use crate::step::{
    Artifact, InputDef, Inputs, Length, Locks, OutPort, OutputDef, Port, Produced, ResolvedSizing, Sizing, StepFailure,
};
use crate::technique::adaptive::{self, Input, RemeshError as Reason, Report, Rules, Wanted};
use crate::technique::guarded::{Counts, Limits, Recount, SizeField, Violation, diagonal, recount, reference_tree};
use crate::technique::refine::{Flips, MAX_FACES, MaxEdge, refine};
use crate::watch::Watch;

/// Meshes a surface anew with elements of the size and shape asked for, near the surface as it was.
///
/// Use it on a repaired surface with marked features. It takes any tessellation; nothing needs to be refined before.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default, rename_all = "kebab-case")]
pub struct RemeshParams {
    /// Longest side of an element: a length, a field, or lengths by face group. Percents refer to the diagonal of
    /// `from`. Elements get smaller where curvature and narrow strips ask for it. Default 4 %.
    pub max_size: Sizing,
    /// How far the result may lie from `from`, both ways. Default 0.2 % of the diagonal.
    pub tolerance: Length,
    /// How far marked curves may move. Default: half of `tolerance`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub feature_tolerance: Option<Length>,
    /// Least stretch of an element: 1 for the equilateral triangle, 0 for a degenerate one. Default 0.2, the usual
    /// floor for analysis.
    #[schemars(range(min = 0.0, max = 0.95))]
    pub min_stretch: f64,
    /// The mean stretch aimed for: more makes sizes change more slowly along the surface, with more elements. Default
    /// 0.88.
    #[schemars(range(min = 0.0, max = 0.95))]
    pub mean_stretch: f64,
    /// Most edges at a vertex. Default 10.
    #[schemars(range(min = 7))]
    pub max_valence: usize,
    /// The step refuses to begin where the size asks for more faces, and makes no more. Default 20 million.
    #[schemars(range(min = 1))]
    pub max_faces: usize,
}

impl Default for RemeshParams {
    fn default() -> Self {
        Self {
            max_size: Length::Percent(4.0).into(),
            tolerance: Length::Percent(0.2),
            feature_tolerance: None,
            min_stretch: 0.2,
            mean_stretch: 0.88,
            max_valence: 10,
            max_faces: MAX_FACES,
        }
    }
}

/// What remeshing did. Shapes and sizes are counted on the result.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub struct RemeshStats {
    /// Faces of the input.
    pub faces_before: usize,
    /// Faces of the result.
    pub faces_after: usize,
    /// Rounds of edits.
    pub rounds: usize,
    /// How often sizes were lowered because the result lay too far from the input.
    pub lowerings: usize,
    /// What was done in all attempts. Edits are refused only at the end, where each is certified by itself.
    #[serde(flatten)]
    pub counts: Counts,
    /// Whether sizes alone did not do, and every edit was certified by itself.
    pub guarded_all_along: bool,
    /// Least stretch.
    pub min_stretch: f64,
    /// Mean stretch.
    pub mean_stretch: f64,
    /// The same of the faces that touch no marked curve and nothing kept.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mean_stretch_off_curves: Option<f64>,
    /// Longest side, in mesh units.
    pub max_size: f64,
    /// Most edges at a vertex.
    pub max_valence: usize,
    /// Faces that break a threshold.
    pub faces_violating: usize,
    /// Of those, the ones where marked curves meet too sharply or everything is kept.
    pub faces_excused: usize,
    /// The faces that break a threshold, with the cause; the first 64.
    pub violations: Vec<Violation>,
    /// The tolerance in mesh units.
    pub tolerance: f64,
    /// Certified upper bound of the two-sided distance to the input, in mesh units; absent where none was reached.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub distance_bound: Option<f64>,
}

/// Why remeshing refused.
#[derive(Debug, thiserror::Error)]
pub enum RemeshError {
    /// The tolerance is out of range.
    #[error(transparent)]
    Tolerance(#[from] ToleranceError),
    /// Another parameter is.
    #[error(transparent)]
    OutOfRange(#[from] OutOfRange),
    /// `max-size` asks for more faces than `max-faces` allows.
    #[error("`max-size` asks for at least {least:.3e} faces, above `max-faces` = {most}")]
    TooManyFaces {
        /// Equilateral faces of that side that the area holds.
        least: f64,
        /// `max-faces`.
        most: usize,
    },
    /// A size names a field or group that is not there.
    #[error("max-size: {0}")]
    Size(StepFailure),
    /// See [`Reason`].
    #[error(transparent)]
    Remesh(#[from] Reason),
}

/// Wanted lengths as a part of the longest: edges spread about them by a third.
const OF_UNIFORM: f64 = 0.9;
const OF_VARYING: f64 = 0.65;
/// Sizes are not lowered below these parts of the size and of the tolerance.
const LEAST: [f64; 2] = [0.01, 0.2];
/// The part of the tolerance that is used up before the last edits.
const USED_UP: f64 = 0.97;

/// Remeshes `surface`.
///
/// # Errors
/// See [`RemeshError`]. Thresholds that cannot be reached are no error; the statistics name the faces.
pub fn remesh(
    surface: &Surface,
    params: &RemeshParams,
    locks: &LockRules<'_>,
    watch: &Watch,
) -> Result<(Surface, RemeshStats), RemeshError> {
    check(params)?;
    let rules = rules(surface, params)?;
    // Seams stay as they are from here on; all copies are halved alike beforehand.
    let halved = halved_seams(surface, &rules, locks, watch)?;
    let (base, rules) = match &halved {
        Some(halved) => (halved, self::rules(halved, params)?),
        None => (surface, rules),
    };
    let tree = reference_tree(ToleranceMode::Distance, base);
    let (mut result, report) = adaptive::remesh(&Input { surface: base, locks: *locks }, &tree, &rules, watch)?;
    inherit_fields(surface, &mut result);
    let stats = stats(surface, &result, locks, &rules, &report)?;
    Ok((result, stats))
}

fn check(params: &RemeshParams) -> Result<(), OutOfRange> {
    let shares = [("min-stretch", params.min_stretch), ("mean-stretch", params.mean_stretch)];
    for (name, value) in shares {
        OutOfRange::unless((0.0..=0.95).contains(&value), name, "from 0 to 0.95", value)?;
    }
    OutOfRange::unless(params.max_valence >= 7, "max-valence", "at least 7", params.max_valence as f64)
}

/// What the parameters mean on a surface.
fn rules(surface: &Surface, params: &RemeshParams) -> Result<Rules, RemeshError> {
    let diagonal = diagonal(surface);
    let tolerance = Tolerance {
        mode: ToleranceMode::Distance,
        tolerance: params.tolerance,
        feature_tolerance: params.feature_tolerance,
        feature_weight: 1.0,
    };
    let tolerance = tolerance.resolve(diagonal)?;
    let sizes = params.max_size.resolve(surface, diagonal).map_err(RemeshError::Size)?;
    let least = sizes.least();
    OutOfRange::unless(least > 0.0, "max-size", "above 0", least)?;
    let (size, longest, max_size) = match sizes {
        ResolvedSizing::Uniform(length) => (Wanted::Uniform(OF_UNIFORM * length), length, SizeField::Uniform(length)),
        ResolvedSizing::Corners(values) => {
            let most = values.iter().flatten().copied().fold(0.0, f64::max);
            let of_face = |at: [f64; 3]| OF_VARYING * at.into_iter().fold(f64::INFINITY, f64::min);
            let wanted = Wanted::Faces(values.iter().copied().map(of_face).collect());
            (wanted, most, SizeField::varying(surface, values))
        }
    };
    check_count(surface, params, &size)?;
    Ok(Rules {
        least_size: (LEAST[0] * least).max(LEAST[1] * tolerance.tolerance).min(least),
        size,
        longest,
        max_size,
        promise: tolerance.tolerance,
        tolerance: USED_UP * tolerance.tolerance,
        curve_tolerance: tolerance.feature_tolerance,
        min_stretch: params.min_stretch,
        mean_stretch: params.mean_stretch,
        max_valence: params.max_valence,
        most_faces: params.max_faces,
    })
}

/// Refuses sizes that ask for too many faces: equilateral ones of that side are the largest there may be.
fn check_count(surface: &Surface, params: &RemeshParams, size: &Wanted) -> Result<(), RemeshError> {
    let size_of = |f: FaceId| match size {
        Wanted::Uniform(size) => size / OF_UNIFORM,
        Wanted::Faces(sizes) => sizes[f.index()] / OF_VARYING,
    };
    let equilateral = |side: f64| 0.25 * 3.0_f64.sqrt() * side * side;
    let least: f64 = surface.faces.ids().map(|f| triangle_area(surface.corners(f)) / equilateral(size_of(f))).sum();
    if least > params.max_faces as f64 {
        return Err(RemeshError::TooManyFaces { least, most: params.max_faces });
    }
    Ok(())
}

/// The surface with its edges halved, where it has seams.
fn halved_seams(
    surface: &Surface,
    rules: &Rules,
    locks: &LockRules<'_>,
    watch: &Watch,
) -> Result<Option<Surface>, RemeshError> {
    if surface.carried.seams.is_empty() {
        return Ok(None);
    }
    let most = MaxEdge::Uniform(0.5 * rules.longest);
    let refined = refine(surface, &most, rules.most_faces, Flips::None, locks, watch);
    refined.map(|(refined, _)| Some(refined)).map_err(|error| Reason::Refine(error).into())
}

fn stats(
    surface: &Surface,
    result: &Surface,
    locks: &LockRules<'_>,
    rules: &Rules,
    report: &Report,
) -> Result<RemeshStats, RemeshError> {
    let freedom = resolve_freedom(result, locks).map_err(Reason::Locks)?;
    let max_size = rules.max_size.clone();
    let limits = Limits { min_stretch: rules.min_stretch, max_size, max_valence: rules.max_valence };
    let counted: Recount = recount(result, &freedom, &limits);
    Ok(RemeshStats {
        faces_before: surface.faces.len(),
        faces_after: result.faces.len(),
        rounds: report.rounds,
        lowerings: report.lowerings,
        counts: report.edits,
        guarded_all_along: report.is_guarded_all_along,
        min_stretch: counted.min_stretch,
        mean_stretch: counted.mean_stretch,
        mean_stretch_off_curves: counted.free_mean_stretch,
        max_size: counted.max_size,
        max_valence: counted.max_valence,
        faces_violating: counted.violations.len(),
        faces_excused: counted.excused(),
        violations: counted.violations.into_iter().take(64).collect(),
        tolerance: rules.promise,
        distance_bound: report.bound,
    })
}

impl From<RemeshError> for StepFailure {
    fn from(error: RemeshError) -> Self {
        let message = error.to_string();
        match error {
            RemeshError::Remesh(Reason::Cancelled(cancelled)) => cancelled.into(),
            RemeshError::Remesh(Reason::Enter(_)) => Self::bad_input(message).with_help("run `repair` first"),
            RemeshError::Size(failure) => Self { message, ..failure },
            RemeshError::TooManyFaces { .. } => {
                Self::failed(message).with_help("raise `max-size`, or `max-faces` if that is meant")
            }
            RemeshError::Tolerance(error) => error.into(),
            RemeshError::OutOfRange(error) => error.into(),
            RemeshError::Remesh(Reason::Locks(_) | Reason::Refine(_)) => Self::failed(message),
        }
    }
}

/// The room's entry in the catalog.
#[derive(Debug)]
pub struct Step;

impl crate::step::Step for Step {
    const NAME: &'static str = "remesh";
    const REVISION: u32 = 4;
    const INPUTS: &'static [InputDef] =
        &[InputDef { name: "from", accepts: &[Port::Surface], required: true, doc: "the surface to mesh anew" }];
    const OUTPUTS: &'static [OutputDef] = &[OutputDef { name: "main", port: OutPort::Is(Port::Surface), derive: None }];
    const EDITS: bool = true;
    const CARRIES: &'static str = "groups, regions, marks and seams stay; fields are taken from the nearest point of \
        the surface as it was";
    const EXAMPLE: &'static str = "use = \"remesh\"\nfrom = \"marked\"\nmax-size = \"4%\"\ntolerance = \"0.2%\"\n";

    type Params = RemeshParams;
    type Stats = RemeshStats;

    fn run(
        inputs: &Inputs,
        _output: &str,
        params: &RemeshParams,
        locks: &Locks,
        watch: &Watch,
    ) -> Result<Produced<RemeshStats>, StepFailure> {
        let result = remesh(inputs.surface("from")?, params, &locks.rules(), watch);
        let (surface, stats) = result.map_err(|error| {
            let too_many = matches!(error, RemeshError::TooManyFaces { .. });
            let guess = too_many.then(|| params.max_size.perhaps_meant()).flatten();
            StepFailure::from(error).with_guess(guess)
        })?;
        Ok(Produced { artifact: Artifact::Surface(Arc::new(surface)), stats })
    }
}
