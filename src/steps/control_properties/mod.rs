//! Simplifies a surface under thresholds for error, shape, size and valence.
//!
//! # Algorithm
//! Phase A changes only what breaks the stretch threshold, until nothing does. Phase B collapses the edges that keep
//! all thresholds C1 to C4, smallest and best first. With `optimize`, rounds of flips, splits and relaxation go in
//! between, under the same tests. Where the mean stretch ends slightly below the one asked for, because the repairs at
//! the end cost more than was allowed for, all is done again with a higher aim, twice at most. Surfaces of hundreds of
//! thousands of faces are first simplified in cells, on all threads ([`crate::technique::cells`]).
//!
//! Based on: H. Date, S. Kanai, T. Kishinami, I. Nishigaki, T. Dohi. High-Quality and Property Controlled Finite
//! Element Mesh Generation From Triangular Meshes using the Multiresolution Technique. JCISE 5(4), 2005, section 5.
//! Based on: H. Date, S. Kanai, T. Kishinami, I. Nishigaki. Mesh Simplification and Adaptive LOD for Finite Element
//! Mesh Generation, 2005, section 4.
//!
//! The output `hierarchy` is the record of pure collapse under the same thresholds, see
//! [`crate::technique::hierarchy`].
//!
//! # Invariants
//! - Topology, marked curves and kept elements stay; no new self-intersection.
//! - No threshold that holds somewhere is broken there.
//! - In `distance` mode the surface stays within the tolerance of the reference, both ways, at every moment.
//!
//! # Cost
//! O(F log F); `distance` costs several times `quadric-rms`.
//!
//! # Departures
//! The collapse engine lists them (`technique::collapse`). The thresholds need not hold on the input.

mod report;

use std::sync::Arc;

pub use report::{ControlPropertiesError, ControlPropertiesStats, Status};
use report::{End, refuse_violations, stats};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::mesh::geometry::triangle_area;
use crate::mesh::transfer::inherit_fields;
use crate::mesh::{FaceId, Hierarchy, LockRules, Surface, resolve_freedom};
use crate::metric::ToleranceMode;
use crate::step::{
    Artifact, InputDef, Inputs, Length, Locks, OutOfRange, OutPort, OutputDef, Port, Produced, REFERENCE,
    ResolvedSizing, Sizing, StepFailure, Tolerance,
};
use crate::technique::cells::{Task, Thinned, thin};
use crate::technique::collapse::{CollapseRules, Ending, Goal, Order, Priority, simplify};
use crate::technique::guarded::{
    Counts, GuardedMesh, Limits, Setup, SizeField, StarRules, diagonal, open, reference_tree,
};
use crate::technique::hierarchy::{Front, extract};
use crate::technique::levels::{HierarchyReport, Recorded, Source, build};
use crate::technique::refine::MAX_FACES;
use crate::technique::remesh::{coarsen, comfortable, raise_stretch};
use crate::watch::{Cancelled, Watch};

/// Simplifies a surface while error, element shape, element size and valence stay within limits.
///
/// Use it on a mesh that is finer than wanted, for example after `subdivide`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default, rename_all = "kebab-case")]
pub struct ControlPropertiesParams {
    /// How far the result may lie from `reference`; see `tolerance-mode` for its meaning and unit. Default 0.2 % of the
    /// reference's diagonal.
    pub tolerance: Length,
    /// What `tolerance` means. Default `"distance"`. In `"quadric-sum"` it is a squared length, given as a number.
    pub tolerance_mode: ToleranceMode,
    /// How far marked curves may move. Default: half of `tolerance` in `distance` mode; other modes do not use it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub feature_tolerance: Option<Length>,
    /// Least stretch of an element: 1 for the equilateral triangle, 0 for a degenerate one. Default 0.2, the usual
    /// floor for analysis, which means angles from 7 to 154 degrees.
    #[schemars(range(min = 0.0, max = 0.95))]
    pub min_stretch: f64,
    /// Collapses end where the mean stretch would fall below this, with a margin for what optimisation gains after
    /// them; where even the most careful ones end lower, it falls no further. Good meshes have 0.88. Default 0: goes on
    /// while every element keeps its thresholds.
    #[schemars(range(min = 0.0, max = 0.95))]
    pub mean_stretch: f64,
    /// Longest side of an element. Default: no limit.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_size: Option<Sizing>,
    /// A `max-size` that asks for more faces than this is refused. Default 20 000 000.
    pub max_faces: usize,
    /// Most edges at a vertex. Default 12; 6 is the mean of any closed mesh, so values below 7 leave little freedom.
    #[schemars(range(min = 6))]
    pub max_valence: usize,
    /// Stops when this many faces are left. Default: goes on until no edge is valid.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub target_faces: Option<usize>,
    /// Weight of the sharpest marked edges in the quadrics that place vertices. Default 100.
    #[schemars(range(min = 0.0))]
    pub feature_weight: f64,
    /// Whether flips, splits and relaxation go in between the collapses. Default: in `distance` mode only; `false` is
    /// the pure collapse of the papers.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub optimize: Option<bool>,
    /// What happens where a threshold cannot be reached: `"report"` names the faces in the statistics, `"error"` lets
    /// the step fail. Default `"report"`.
    pub on_infeasible: OnInfeasible,
}

/// What happens where thresholds cannot be reached.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum OnInfeasible {
    /// The statistics name the faces, the cause, and what was reached.
    #[default]
    Report,
    /// The step fails.
    Error,
}

impl Default for ControlPropertiesParams {
    fn default() -> Self {
        Self {
            tolerance: Length::Percent(0.2),
            tolerance_mode: ToleranceMode::Distance,
            feature_tolerance: None,
            min_stretch: 0.2,
            mean_stretch: 0.0,
            max_size: None,
            max_faces: MAX_FACES,
            max_valence: 12,
            target_faces: None,
            feature_weight: 100.0,
            optimize: None,
            on_infeasible: OnInfeasible::Report,
        }
    }
}

impl ControlPropertiesParams {
    fn tolerance(&self) -> Tolerance {
        Tolerance {
            mode: self.tolerance_mode,
            tolerance: self.tolerance,
            feature_tolerance: self.feature_tolerance,
            feature_weight: self.feature_weight,
        }
    }
}

/// A mean stretch that is missed by less is aimed for again.
const SLIGHTLY: f64 = 0.01;
/// How much higher then: by what was missed, and a little, and if that does not do, more.
const SPARES: [f64; 2] = [2e-4, 2e-3];

/// What property control works on.
#[derive(Clone, Copy, Debug)]
pub struct ControlPropertiesInput<'a> {
    /// The surface to simplify.
    pub surface: &'a Surface,
    /// What the tolerance is measured against.
    pub reference: &'a Surface,
    /// What must stay.
    pub locks: LockRules<'a>,
}

/// Simplifies `input.surface` under thresholds.
///
/// # Errors
/// [`ControlPropertiesError`]: parameters, groups or fields that do not fit the surface. Thresholds that cannot be
/// reached are no error; the statistics name the faces.
pub fn control_properties(
    input: ControlPropertiesInput<'_>,
    params: &ControlPropertiesParams,
    watch: &Watch,
) -> Result<(Surface, ControlPropertiesStats), ControlPropertiesError> {
    let freedom = resolve_freedom(input.surface, &input.locks)?;
    let tree = reference_tree(params.tolerance_mode, input.reference);
    let setup = setup(&input, params, diagonal(input.reference))?;
    let thinned = thinned(&input, params, &setup, watch)?;
    let freedom = thinned.as_ref().map_or(Ok(freedom), |thinned| resolve_freedom(&thinned.surface, &input.locks))?;
    let simplified = |mean_stretch: f64| -> Result<(Surface, ControlPropertiesStats), ControlPropertiesError> {
        let surface = thinned.as_ref().map_or(input.surface, |thinned| &thinned.surface);
        let mut guarded = open(surface, &freedom, input.reference, &tree, setup.clone())?;
        if let Some(thinned) = &thinned {
            thinned.hand_over(&mut guarded);
        }
        let ending = run_phases(&mut guarded, params, mean_stretch, watch)?;
        let counts = guarded.counts() + thinned.as_ref().map_or_else(Counts::default, |thinned| thinned.counts);
        let distance_bound = guarded.distance_bound(setup.tolerance);
        let mut result = guarded.into_mesh().leave().surface;
        inherit_fields(input.surface, &mut result);
        let stats = stats(&input, params, &setup, &result, End { ending, counts, distance_bound })?;
        Ok((result, stats))
    };
    let (mut result, mut stats) = simplified(params.mean_stretch)?;
    for spare in SPARES {
        let is_coarser = stats.faces_after < stats.faces_before;
        let Some(higher) = higher_mean(params, stats.mean_stretch, is_coarser, spare) else { break };
        let again = simplified(higher)?;
        if again.1.mean_stretch >= params.mean_stretch {
            (result, stats) = again;
        }
    }
    match params.on_infeasible {
        OnInfeasible::Error => refuse_violations(&stats, params)?,
        OnInfeasible::Report => {}
    }
    Ok((result, stats))
}

/// A large surface simplified in cells, where nothing but the number of faces says how far.
fn thinned(
    input: &ControlPropertiesInput<'_>,
    params: &ControlPropertiesParams,
    setup: &Setup,
    watch: &Watch,
) -> Result<Option<Thinned>, ControlPropertiesError> {
    let ControlPropertiesInput { surface, reference, locks } = *input;
    if params.mean_stretch > 0.0 && !optimises(params) {
        return Ok(None);
    }
    let rules = if optimises(params) { comfortable(&rules(params), params.mean_stretch > 0.0) } else { rules(params) };
    let faces = params.target_faces.unwrap_or(0);
    thin(&Task { surface, reference, locks, setup, rules: &rules, faces }, watch)
}

/// The mean stretch to ask for where coarsening has gone too far by little: how much repairs and the last rounds cost
/// is only known when they are done. `None` where all is well, or more faces would not help.
fn higher_mean(params: &ControlPropertiesParams, reached: f64, is_coarser: bool, spare: f64) -> Option<f64> {
    let missed = params.mean_stretch - reached;
    let may = optimises(params) && params.target_faces.is_none() && is_coarser;
    (may && missed > 0.0 && missed < SLIGHTLY).then_some(params.mean_stretch + missed + spare)
}

/// Mends and optimises `input.surface` as [`control_properties`] does before it simplifies, then records every collapse
/// that keeps the thresholds. The statistics are those of the coarsest front.
///
/// # Errors
/// As [`control_properties`].
pub fn record_properties(
    input: ControlPropertiesInput<'_>,
    params: &ControlPropertiesParams,
    watch: &Watch,
) -> Result<(Hierarchy, ControlPropertiesStats), ControlPropertiesError> {
    let tree = reference_tree(params.tolerance_mode, input.reference);
    let setup = setup(&input, params, diagonal(input.reference))?;
    let ControlPropertiesInput { surface, reference, locks } = input;
    let source = Source { surface, reference, tree: &tree, locks };
    let recorded: Recorded = build::<ControlPropertiesError>(source, &setup, &rules(params), optimises(params), watch)?;
    let coarsest = extract(&Front::coarsest(&recorded.hierarchy));
    let end = End { ending: Ending::Exhausted, counts: recorded.counts, distance_bound: recorded.distance_bound };
    // A record goes down to where no edge is valid, past any count and mean.
    let unlimited = ControlPropertiesParams { target_faces: None, mean_stretch: 0.0, ..params.clone() };
    let mut stats = stats(&input, &unlimited, &setup, &coarsest, end)?;
    stats.hierarchy = Some(HierarchyReport::of(&recorded.hierarchy));
    Ok((recorded.hierarchy, stats))
}

fn rules(params: &ControlPropertiesParams) -> CollapseRules {
    CollapseRules {
        star: StarRules { min_stretch: params.min_stretch, ..StarRules::default() },
        order: Order::of(params.tolerance_mode),
        priority: Priority::SmallFirst { size: 1.0 },
    }
}

fn optimises(params: &ControlPropertiesParams) -> bool {
    params.optimize.unwrap_or(params.tolerance_mode == ToleranceMode::Distance)
}

fn run_phases(
    guarded: &mut GuardedMesh<'_>,
    params: &ControlPropertiesParams,
    mean_stretch: f64,
    watch: &Watch,
) -> Result<Ending, Cancelled> {
    let rules = rules(params);
    let goal = Goal { faces: params.target_faces.unwrap_or(0), mean_stretch };
    raise_stretch(guarded, params.min_stretch, &rules, watch)?;
    if !optimises(params) {
        return simplify(guarded, &rules, goal, watch);
    }
    coarsen(guarded, &rules, goal, watch)
}

fn setup(
    input: &ControlPropertiesInput<'_>,
    params: &ControlPropertiesParams,
    diagonal: f64,
) -> Result<Setup, ControlPropertiesError> {
    for (name, value) in [("min-stretch", params.min_stretch), ("mean-stretch", params.mean_stretch)] {
        OutOfRange::unless((0.0..=0.95).contains(&value), name, "from 0 to 0.95", value)?;
    }
    OutOfRange::unless(params.max_valence >= 6, "max-valence", "at least 6", params.max_valence as f64)?;
    let tolerance = params.tolerance().resolve(diagonal)?;
    let max_size = max_size(input.surface, params, diagonal)?;
    let limits = Limits { min_stretch: params.min_stretch, max_size, max_valence: params.max_valence };
    Ok(Setup {
        mode: tolerance.mode,
        tolerance: tolerance.tolerance,
        feature_tolerance: tolerance.feature_tolerance,
        feature_weight: tolerance.feature_weight,
        limits,
        may_merge_corners: !input.locks.name_elements(),
    })
}

/// The longest side allowed, where that does not ask for too many faces.
fn max_size(
    surface: &Surface,
    params: &ControlPropertiesParams,
    diagonal: f64,
) -> Result<SizeField, ControlPropertiesError> {
    let Some(sizing) = &params.max_size else { return Ok(SizeField::Uniform(f64::INFINITY)) };
    let sizes = sizing.resolve(surface, diagonal).map_err(ControlPropertiesError::Size)?;
    let least = sizes.least();
    OutOfRange::unless(least > 0.0, "max-size", "above 0", least)?;
    let size_of = |f: FaceId| match &sizes {
        ResolvedSizing::Uniform(length) => *length,
        ResolvedSizing::Corners(values) => values[f.index()].into_iter().sum::<f64>() / 3.0,
    };
    // Equilateral faces of that side are the largest there may be.
    let equilateral = |side: f64| 0.25 * 3.0_f64.sqrt() * side * side;
    let least_faces: f64 =
        surface.faces.ids().map(|f| triangle_area(surface.corners(f)) / equilateral(size_of(f))).sum();
    if least_faces > params.max_faces as f64 {
        return Err(ControlPropertiesError::TooManyFaces { least: least_faces, most: params.max_faces });
    }
    Ok(match sizes {
        ResolvedSizing::Uniform(length) => SizeField::Uniform(length),
        ResolvedSizing::Corners(values) => SizeField::varying(surface, values),
    })
}

/// The failure, with what was perhaps meant by a size that makes too many faces.
fn failure(error: ControlPropertiesError, params: &ControlPropertiesParams) -> StepFailure {
    let too_many = matches!(error, ControlPropertiesError::TooManyFaces { .. });
    let guess = params.max_size.as_ref().filter(|_| too_many).and_then(Sizing::perhaps_meant);
    StepFailure::from(error).with_guess(guess)
}

/// The room's entry in the catalog.
pub struct Step;

impl crate::step::Step for Step {
    const NAME: &'static str = "control-properties";
    const REVISION: u32 = 20;
    const INPUTS: &'static [InputDef] = &[
        InputDef { name: "from", accepts: &[Port::Surface], required: true, doc: "the surface to simplify" },
        REFERENCE,
    ];
    const OUTPUTS: &'static [OutputDef] = &[
        OutputDef { name: "main", port: OutPort::Is(Port::Surface), derive: None },
        OutputDef { name: "hierarchy", port: OutPort::Is(Port::Hierarchy), derive: None },
    ];
    const EDITS: bool = true;
    const CARRIES: &'static str =
        "Maps groups, regions, marks, pins and seams; takes fields from the nearest points of `from`.";
    const EXAMPLE: &'static str = "use = \"control-properties\"\nfrom = \"clean\"\nmin-stretch = 0.2\nmax-size = \"4%\"\nmax-valence = 10\ntolerance = \"0.2%\"\n";

    type Params = ControlPropertiesParams;
    type Stats = ControlPropertiesStats;

    fn run(
        inputs: &Inputs,
        output: &str,
        params: &ControlPropertiesParams,
        locks: &Locks,
        watch: &Watch,
    ) -> Result<Produced<ControlPropertiesStats>, StepFailure> {
        let surface = inputs.surface("from")?;
        let reference = inputs.surface_opt("reference")?.unwrap_or(surface);
        let input = ControlPropertiesInput { surface, reference, locks: locks.rules() };
        if output == "hierarchy" {
            let (hierarchy, stats) = record_properties(input, params, watch).map_err(|error| failure(error, params))?;
            return Ok(Produced { artifact: Artifact::Hierarchy(Arc::new(hierarchy)), stats });
        }
        let (surface, stats) = control_properties(input, params, watch).map_err(|error| failure(error, params))?;
        Ok(Produced { artifact: Artifact::Surface(Arc::new(surface)), stats })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mean_is_aimed_for_again_only_where_it_was_missed_by_little() {
        let params = ControlPropertiesParams { mean_stretch: 0.88, ..ControlPropertiesParams::default() };
        let higher = higher_mean(&params, 0.878, true, SPARES[0]).unwrap();
        assert!(higher > 0.882 && higher < 0.883, "{higher}");
        assert_eq!(higher_mean(&params, 0.8801, true, SPARES[0]), None, "reached");
        assert_eq!(higher_mean(&params, 0.8, true, SPARES[0]), None, "out of reach");
        assert_eq!(higher_mean(&params, 0.878, false, SPARES[0]), None, "nothing was taken away");
        let count = ControlPropertiesParams { target_faces: Some(100), ..params };
        assert_eq!(higher_mean(&count, 0.878, true, SPARES[0]), None, "a number of faces was asked for");
    }
}
