//! Takes faces away where the surface is flat or a fillet, and keeps new vertices on the fillet's true cylinder or
//! sphere.
//!
//! # Algorithm
//! A queue of faces by their shortest side, which counts as longer where the surface turns (the vertex dispersion). The
//! face at its head collapses as a whole or by an edge, by the number of its corners above the dispersion threshold:
//! none, one, two, or all three, where a sphere or cylinder is tried on the neighbourhood and the new vertex goes onto
//! it. The new vertex lies where the aspect ratios round it are best. Before the first edit the spheres and cylinders
//! that the part consists of are recognised whole (`technique::fit::regions`); where all that a merge joins lies on one
//! of them, the new vertex goes onto it without a trial, in any case. Then the faces above `max-aspect` are mended, and
//! the rounds go on until the target holds. At the end flips and small moves make shapes better: vertices on a fit move
//! along it, such in flat areas within their plane, all others along the reference.
//!
//! Based on: Zhang, Wang, Zhou, Li, a paper of 2009 on simplification of finite triangular surface meshes by feature
//! recognition.
//!
//! # Invariants
//! - Topology, marked curves and kept elements stay; no new self-intersection; no face turns over.
//! - In `distance` mode the surface stays within the tolerance of the reference, both ways, at every moment.
//! - A vertex with `fit-kind` above 0 lies on its fit, within 1e-9 of the radius. Flat faces stay exactly flat.
//! - No edit makes a face worse than both `max-aspect` and the worst face that it replaces. Where new vertices in
//!   needles leave more faces above `max-aspect` than there were, or more faces than without any, none are made.
//!
//! # Cost
//! O(F log F).
//!
//! # Departures
//! The corrections of the printed formulas are told where they are used: `technique::{dispersion, aspect_point, fit}`.
//! Beyond these: on real tessellations the paper's trials nearly always fail, because a neighbourhood takes in what
//! lies beside the fillet and merged vertices tell little of it, so fillets are recognised first; smooth borders of
//! flat faces are curves; when the shortest side may not go, the next one below the same length may; in the fourth case
//! both kinds of fit are tried, the paper's first; positions beside the optimised one are tried by the stretch they
//! give; new faces must be good in the first rounds and less so in later ones; flips within planes come first, and
//! needles that no collapse removes get new vertices. The paper does not keep the topology and bounds only the error of
//! projections.

mod cases;
mod insert;
mod mend;
mod queue;
mod report;
mod surfaces;
mod tangent;

use std::sync::Arc;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::mesh::halfedge::EnterError;
use crate::mesh::transfer::inherit_fields;
use crate::mesh::{FreedomError, LockRules, Surface, resolve_freedom};
use crate::metric::ToleranceMode;
use crate::step::{
    Angle, Artifact, InputDef, Inputs, Length, Locks, OutOfRange, OutPort, OutputDef, Port, Produced, REFERENCE, Share,
    StepFailure, Tolerance, ToleranceError,
};
use crate::technique::dispersion::Dispersion;
use crate::technique::fit::regions::{Wanted, fit_regions};
use crate::technique::guarded::{GuardedMesh, Limits, Setup, SizeField, diagonal, open, reference_tree};
use crate::technique::remesh::Refusals;
use crate::watch::{Cancelled, Watch};

use cases::{Bench, Done};
use surfaces::Surfaces;

pub use report::{Fillets, FitKind, Operations, PoorFace, RadiusBin, SimplifyFitStats, Status, Trials};

/// What `tolerance` means.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum FitTolerance {
    /// The largest distance between result and reference, both ways, kept by certified tests.
    #[default]
    Distance,
    /// The Err of the paper: the distance between a vertex projected onto a fit and the plane of what it replaces. It
    /// bounds projections only, and nothing that adds up; fast.
    Plane,
}

/// Which fits are tried.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Fits {
    /// Spheres and cylinders.
    #[default]
    Both,
    /// Spheres only.
    Sphere,
    /// Cylinders only.
    Cylinder,
    /// None: new vertices stay on the collapsed edge or face.
    None,
}

/// Simplifies moulded and filleted parts: takes faces away on flat areas and fillets, and keeps fillets round.
///
/// Use it where a tessellation spends its faces on fillets that an analysis does not need. Vertices on a fillet carry
/// its radius as the field `fit-radius`, and `fit-kind`: 1 on a sphere, 2 on a cylinder, 0 elsewhere.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default, rename_all = "kebab-case")]
pub struct SimplifyFitParams {
    /// The share of faces to take away. Default 50 %. Not together with `target-faces`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub remove: Option<Share>,
    /// The number of faces to leave. Default: by `remove`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub target_faces: Option<usize>,
    /// How far the result may lie from `reference`; see `tolerance-mode`. Default 0.1 % of the reference's diagonal.
    pub tolerance: Length,
    /// What `tolerance` means. Default `"distance"`.
    pub tolerance_mode: FitTolerance,
    /// How far marked curves may move. Default: `tolerance`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub feature_tolerance: Option<Length>,
    /// Which mean of the angles at a vertex is its dispersion. Default `"rms"`; `"std"` is the paper's, which is zero
    /// on straight creases.
    pub dispersion: Dispersion,
    /// Vertices with a larger dispersion lie on a feature or a fillet. In degrees, default 4: facets of a fillet turn
    /// by twice as much.
    pub dispersion_threshold: Angle,
    /// How much longer sides count where the surface turns: `exp(k-m · dispersion)`, dispersion in radians. Default 1,
    /// range 0 to 3; 0 is by length alone.
    #[schemars(range(min = 0.0, max = 3.0))]
    pub k_m: f64,
    /// Flat areas: sides shorter than `k1 · L0` go, where `L0` is the shortest edge to be expected at the target.
    /// Default 1.5.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub k1: f64,
    /// Beside features: sides shorter than `k2 · L0` go. Default 0.75.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub k2: f64,
    /// On fillets: sides shorter than `k3 · L0` go. Default 0.5.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub k3: f64,
    /// Faces up to this aspect ratio collapse as a whole, others by their shortest edge. Default 3; 1 is equilateral.
    #[schemars(range(min = 1.0))]
    pub fine_aspect: f64,
    /// Which surfaces are fitted. Default `"both"`.
    pub fit: Fits,
    /// Faces above this aspect ratio are mended, at least 2; no edit makes new ones. Default 20, the paper's measure of
    /// quality.
    #[schemars(range(min = 2.0))]
    pub max_aspect: f64,
    /// Longest side of a face: no edit makes a longer one. What is longer already is left; `refine` first to halve it.
    /// Default: no limit.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_size: Option<Length>,
    /// Whether the smooth edges of flat faces are kept as curves, so that flat faces stay flat. Default `true`.
    pub keep_flat: bool,
}

impl Default for SimplifyFitParams {
    fn default() -> Self {
        Self {
            remove: None,
            target_faces: None,
            tolerance: Length::Percent(0.1),
            tolerance_mode: FitTolerance::Distance,
            feature_tolerance: None,
            dispersion: Dispersion::Rms,
            dispersion_threshold: Angle(4.0),
            k_m: 1.0,
            k1: 1.5,
            k2: 0.75,
            k3: 0.5,
            fine_aspect: 3.0,
            fit: Fits::Both,
            max_aspect: 20.0,
            max_size: None,
            keep_flat: true,
        }
    }
}

impl SimplifyFitParams {
    fn tolerance(&self) -> Tolerance {
        let mode = match self.tolerance_mode {
            FitTolerance::Distance => ToleranceMode::Distance,
            FitTolerance::Plane => ToleranceMode::QuadricRms,
        };
        let feature_tolerance = Some(self.feature_tolerance.unwrap_or(self.tolerance));
        Tolerance { mode, tolerance: self.tolerance, feature_tolerance, feature_weight: 1.0 }
    }

    fn wanted_regions(&self, tolerance: f64) -> Wanted {
        Wanted {
            spheres: matches!(self.fit, Fits::Both | Fits::Sphere),
            cylinders: matches!(self.fit, Fits::Both | Fits::Cylinder),
            near: surfaces::EXACT * tolerance,
        }
    }
}

/// Why simplification with fits refused.
#[derive(Debug, thiserror::Error)]
pub enum SimplifyFitError {
    /// Two ways to say how far to go.
    #[error("`remove` and `target-faces` both say how many faces to leave")]
    TwoTargets,
    /// A parameter is out of range.
    #[error(transparent)]
    OutOfRange(#[from] OutOfRange),
    /// The tolerance makes no sense.
    #[error(transparent)]
    Tolerance(#[from] ToleranceError),
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

/// What simplification with fits works on.
#[derive(Clone, Copy, Debug)]
pub struct SimplifyFitInput<'a> {
    /// The surface to simplify.
    pub surface: &'a Surface,
    /// What the tolerance is measured against.
    pub reference: &'a Surface,
    /// What must stay.
    pub locks: LockRules<'a>,
}

/// Rounds of mending and simplification after it.
const MOST_MENDINGS: usize = 5;

/// Searches for what single edits do not mend, and mending after each.
const MOST_SEARCHES: usize = 3;

/// Times that what is left is collapsed whatever its case, and polished.
const MOST_ENDINGS: usize = 3;

/// Rounds of flips and relaxation at the end.
const POLISH_ROUNDS: usize = 8;

/// Simplifies `input.surface`.
///
/// # Errors
/// [`SimplifyFitError`]: parameters or groups that do not fit. A target that cannot be reached is no error; the
/// statistics say so.
pub fn simplify_fit(
    input: SimplifyFitInput<'_>,
    params: &SimplifyFitParams,
    watch: &Watch,
) -> Result<(Surface, SimplifyFitStats), SimplifyFitError> {
    let mut plan = Plan::new(&input, params)?;
    let made = simplified(&input, params, &plan, watch)?;
    let needles = made.1.faces_above_aspect;
    let makes_needles = needles > report::needles(input.surface, params.max_aspect);
    if !makes_needles && made.0.faces.len() <= input.surface.faces.len() {
        return Ok(made);
    }
    // Bars and sheets thousands of times as long as thick: new vertices are many, or make more needles than there were.
    plan.may_insert = false;
    let mut other = simplified(&input, params, &plan, watch)?;
    other.1.without_new_vertices = true;
    Ok(if makes_needles || other.1.faces_above_aspect <= needles { other } else { made })
}

/// One run from the surface to the result with its statistics.
fn simplified(
    input: &SimplifyFitInput<'_>,
    params: &SimplifyFitParams,
    plan: &Plan,
    watch: &Watch,
) -> Result<(Surface, SimplifyFitStats), SimplifyFitError> {
    let (surface, smooth_edges) = marked(input.surface, params, plan.tolerance);
    // Only where the reference tells its own curves it must tell the smooth ones too.
    let shares = std::ptr::eq(input.surface, input.reference);
    let other = (!shares && !input.reference.carried.marks.is_empty())
        .then(|| marked(input.reference, params, plan.tolerance).0);
    let reference = if shares { &surface } else { other.as_ref().unwrap_or(input.reference) };
    let freedom = resolve_freedom(&surface, &input.locks)?;
    let tree = reference_tree(plan.setup.mode, reference);
    let mut guarded = open(&surface, &freedom, reference, &tree, plan.setup.clone())?;
    let mut fits = Surfaces::new(guarded.mesh().vertex_slots(), plan.tolerance);
    let done = run(&mut guarded, &mut fits, params, plan, watch)?;
    let counts = guarded.counts();
    let is_short = guarded.mesh().face_count() > plan.target;
    let barred = is_short.then(|| report::bars(&mut guarded, plan.setup.limits.min_stretch));
    let distance_bound = guarded.distance_bound(plan.tolerance);
    let on_fit = |v| report::on_fit(&fits, guarded.mesh().point(v), v);
    let on_fits: Vec<_> = guarded.mesh().vertices().map(on_fit).collect();
    let mut result = guarded.into_mesh().leave().surface;
    let freedom = resolve_freedom(&result, &input.locks)?;
    let least = least_stretch_of(params.max_aspect);
    let quality = report::quality(&result, &freedom, params.max_aspect, least);
    tangent::without_smooth_lines(&mut result);
    inherit_fields(input.surface, &mut result);
    report::set_fields(&mut result, &on_fits);
    let holds = result.faces.len() <= plan.target && quality.faces_above_aspect == quality.excused_faces;
    let stats = SimplifyFitStats {
        status: if holds { Status::TargetReached } else { Status::Stuck },
        faces_before: input.surface.faces.len(),
        target_faces: plan.target,
        removed: 1.0 - result.faces.len() as f64 / input.surface.faces.len().max(1) as f64,
        operations: report::operations(&done, counts),
        spheres: Trials { tried: fits.tried[0], accepted: fits.accepted[0] },
        cylinders: Trials { tried: fits.tried[1], accepted: fits.accepted[1] },
        fillets: done.fillets,
        vertices_on_fits: on_fits.iter().flatten().count(),
        radii: report::histogram(on_fits.into_iter().flatten()),
        largest_projection: done.largest_projection,
        refused_by_tolerance: counts.refused_by_tolerance,
        refused_by_intersection: counts.refused_by_intersection,
        barred,
        smooth_edges,
        tolerance: plan.tolerance,
        distance_bound,
        ..quality
    };
    Ok((result, stats))
}

/// The loop of the paper, then mending and the loop again until the target holds on good faces.
fn run(
    guarded: &mut GuardedMesh<'_>,
    fits: &mut Surfaces,
    params: &SimplifyFitParams,
    plan: &Plan,
    watch: &Watch,
) -> Result<Done, Cancelled> {
    let limit = plan.setup.limits.min_stretch;
    let is_plane = params.tolerance_mode == FitTolerance::Plane;
    let mut bench = Bench {
        dispersion: vec![0.0; guarded.mesh().vertex_slots()],
        guarded,
        params,
        surfaces: fits,
        done: Done::default(),
        may_insert: plan.may_insert,
        most_tried: cases::MOST_TRIED,
        plane_tolerance: is_plane.then_some(plan.tolerance),
    };
    insert::flip_within_planes(&mut bench, watch)?;
    let regions = fit_regions(bench.guarded.mesh(), params.wanted_regions(plan.tolerance), watch)?;
    bench.surfaces.know(bench.guarded.mesh(), &regions);
    bench.done.fillets = report::fillets(&regions);
    bench.update_all();
    let mut reached = queue::simplify(&mut bench, plan.target, watch)?;
    let mut left = usize::MAX;
    for _ in 0..MOST_MENDINGS {
        let before = left;
        left = mend::mend(&mut bench, limit, watch)?;
        bench.update_all();
        reached = queue::simplify(&mut bench, plan.target, watch)?;
        if left == 0 || left >= before {
            break;
        }
    }
    end(&mut bench, reached, plan, watch)?;
    Ok(bench.done)
}

/// What the loop of the paper leaves: faces above the target, poor shapes, and single faces above the aspect ratio.
fn end(bench: &mut Bench<'_, '_>, mut reached: bool, plan: &Plan, watch: &Watch) -> Result<(), Cancelled> {
    let limit = plan.setup.limits.min_stretch;
    let mut refusals = Refusals::default();
    for _ in 0..MOST_ENDINGS {
        let before = bench.guarded.mesh().face_count();
        reached = reached || queue::exhaust(bench, plan.target, watch)?;
        mend::polish(bench, POLISH_ROUNDS, &mut refusals, watch)?;
        if reached || bench.guarded.mesh().face_count() == before {
            break;
        }
    }
    for _ in 0..MOST_SEARCHES {
        if mend::mend_by_search(bench, limit, watch)? == 0 {
            break;
        }
        // The few that are left get vertices after all, and the faces that this costs go elsewhere.
        mend::mend(bench, limit, watch)?;
        bench.update_all();
        if !queue::simplify(bench, plan.target, watch)? {
            queue::exhaust(bench, plan.target, watch)?;
        }
    }
    Ok(())
}

/// What the parameters come to on this input.
struct Plan {
    target: usize,
    tolerance: f64,
    setup: Setup,
    /// Whether needles may get new vertices.
    may_insert: bool,
}

impl Plan {
    fn new(input: &SimplifyFitInput<'_>, params: &SimplifyFitParams) -> Result<Self, SimplifyFitError> {
        let target = match (params.remove, params.target_faces) {
            (Some(_), Some(_)) => return Err(SimplifyFitError::TwoTargets),
            (None, Some(target)) => target,
            (remove, None) => {
                let Share(gone) = remove.unwrap_or(Share(0.5));
                // A hair more than half a face, so that 75 % of 16 are 12 whatever the rounding.
                (input.surface.faces.len() as f64 * (1.0 - gone) + 1e-6).floor() as usize
            }
        };
        check(params)?;
        let diagonal = diagonal(input.reference);
        let tolerance = params.tolerance().resolve(diagonal)?;
        let is_plane = params.tolerance_mode == FitTolerance::Plane;
        let max_size = params.max_size.map_or(f64::INFINITY, |length| length.resolve(diagonal));
        OutOfRange::unless(max_size > 0.0, "max-size", "above 0", max_size)?;
        let limits = Limits {
            min_stretch: least_stretch_of(params.max_aspect),
            max_size: SizeField::Uniform(max_size),
            // Halving must not be stopped by the fans of a tessellation; merges have a limit of their own.
            max_valence: usize::MAX,
        };
        let setup = Setup {
            mode: tolerance.mode,
            // Nothing but projections is bounded in plane mode.
            tolerance: if is_plane { f64::INFINITY } else { tolerance.tolerance },
            feature_tolerance: tolerance.feature_tolerance,
            feature_weight: tolerance.feature_weight,
            limits,
            may_merge_corners: !input.locks.name_elements(),
        };
        Ok(Self { target, tolerance: tolerance.tolerance, setup, may_insert: true })
    }
}

/// The stretch that excludes larger aspect ratios: height over longest side is at least half an inradius over it.
fn least_stretch_of(max_aspect: f64) -> f64 {
    1.5 / max_aspect
}

fn check(params: &SimplifyFitParams) -> Result<(), OutOfRange> {
    let within = |name, range, value: f64, [least, most]: [f64; 2]| {
        OutOfRange::unless((least..=most).contains(&value), name, range, value)
    };
    within("k-m", "from 0 to 3", params.k_m, [0.0, 3.0])?;
    within("k1", "from 0 to 10", params.k1, [0.0, 10.0])?;
    within("k2", "from 0 to 10", params.k2, [0.0, 10.0])?;
    within("k3", "from 0 to 10", params.k3, [0.0, 10.0])?;
    within("fine-aspect", "at least 1", params.fine_aspect, [1.0, f64::INFINITY])?;
    within("max-aspect", "at least 2", params.max_aspect, [2.0, f64::INFINITY])
}

fn marked(surface: &Surface, params: &SimplifyFitParams, tolerance: f64) -> (Surface, usize) {
    if params.keep_flat { tangent::with_smooth_lines(surface, tolerance) } else { (surface.clone(), 0) }
}

impl From<SimplifyFitError> for StepFailure {
    fn from(error: SimplifyFitError) -> Self {
        let message = error.to_string();
        match error {
            SimplifyFitError::Cancelled(cancelled) => cancelled.into(),
            SimplifyFitError::TwoTargets => Self::failed(message).with_help("give one of them"),
            SimplifyFitError::NotASurface(_) => Self::bad_input(message).with_help("run `repair` first"),
            SimplifyFitError::Tolerance(error) => error.into(),
            SimplifyFitError::OutOfRange(_) | SimplifyFitError::Locks(_) => Self::failed(message),
        }
    }
}

/// The room's entry in the catalog.
pub struct Step;

impl crate::step::Step for Step {
    const NAME: &'static str = "simplify-fit";
    const REVISION: u32 = 10;
    const INPUTS: &'static [InputDef] = &[
        InputDef { name: "from", accepts: &[Port::Surface], required: true, doc: "the surface to simplify" },
        REFERENCE,
    ];
    const OUTPUTS: &'static [OutputDef] = &[OutputDef { name: "main", port: OutPort::Is(Port::Surface), derive: None }];
    const EDITS: bool = true;
    const CARRIES: &'static str = "Maps groups, regions, marks, pins and seams; takes fields from the nearest points of \
        `from`; adds the vertex fields `fit-kind` and `fit-radius`.";
    const EXAMPLE: &'static str = "use = \"simplify-fit\"\nfrom = \"clean\"\nremove = \"50%\"\ntolerance = \"0.1%\"\n";

    type Params = SimplifyFitParams;
    type Stats = SimplifyFitStats;

    fn run(
        inputs: &Inputs,
        _output: &str,
        params: &SimplifyFitParams,
        locks: &Locks,
        watch: &Watch,
    ) -> Result<Produced<SimplifyFitStats>, StepFailure> {
        let surface = inputs.surface("from")?;
        let reference = inputs.surface_opt("reference")?.unwrap_or(surface);
        let input = SimplifyFitInput { surface, reference, locks: locks.rules() };
        let (surface, stats) = simplify_fit(input, params, watch)?;
        Ok(Produced { artifact: Artifact::Surface(Arc::new(surface)), stats })
    }
}
