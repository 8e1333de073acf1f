//! Fits smooth surfaces to coarse quads: bicubic B-spline patches with common boundary curves.
//!
//! # Algorithm
//! Curves over the common paths of elements come first, by least squares with both ends fixed; then the patches inside,
//! by least squares over the covered vertices, and places on the faces where there are none, each by the area around
//! it, with a thin-plate term and corrected parameters that start from mean value coordinates. Patches beyond the
//! tolerance get twice the spans and more, where that helps. With `g1` both patches of a smooth seam are drawn into
//! common tangent planes, as far as the tolerance allows, and get more spans where their seams still bend by more than
//! two degrees. The work is done by `technique::patches`.
//!
//! Based on: T. Itoh, A. Yamada, T. Furuhata, K. Inoue, K. Shimada. Rough Quadrilateralation of Triangular Meshes via
//! Belt-like Subregioning for Surface Reconstruction. IBM Research Report RT0354, 2000, section 4, which fits patches
//! by least squares too, by a method published in Japanese only.
//!
//! # Invariants
//! - Neighbours share their boundary curve, so that there is no gap; the tessellation is conforming.
//! - Errors are measured on the result, at every covered vertex against all patches.
//!
//! # Cost
//! Per patch and round linear in its vertices, and cubic in its control points, of which there are few.
//!
//! # Departures
//! Triangles get a patch of which one side is a point. Patches are written as JSON with knots and control points.

use std::sync::Arc;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::mesh::geometry::Aabb;
use crate::mesh::{Patches, Quads, Surface};
use crate::metric::summary;
use crate::step::{
    Artifact, InputDef, Inputs, Length, Locks, OutPort, OutputDef, Port, Produced, Step as StepContract, StepFailure,
};
use crate::technique::patches::{FitError, FitRules, FrameError, fit_patches as fit};
use crate::watch::Watch;

/// Fits bicubic B-spline patches to the faces that each of some coarse quads covers.
///
/// The main output is the patches: write them as `.json`, or their tessellation to any mesh format. The output `quads`
/// is the tessellation as a quad mesh of its own.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default, rename_all = "kebab-case")]
pub struct FitPatchesParams {
    /// A patch farther from the surface, or the surface from it, gets more spans. Default 0.2 % of the surface's
    /// diagonal.
    pub tolerance: Length,
    /// Most spans of a patch in each direction. Default 8; 1 is a single Bezier patch.
    #[schemars(range(min = 1, max = 32))]
    pub max_spans: usize,
    /// Weight of the thin-plate term against the vertices. Default 1e-6, which decides only what the vertices leave
    /// open.
    #[schemars(range(min = 0.0))]
    pub fairness: f64,
    /// Elements of the tessellation along each side of a patch. Default 4.
    #[schemars(range(min = 1, max = 256))]
    pub density: usize,
    /// Whether patches get common tangent planes along smooth seams, to within 2 degrees. Smooth are seams without a
    /// marked edge where the surface bends by less than 20 degrees. The tolerance comes first where a patch cannot hold
    /// both; such seams are counted. Default false.
    pub g1: bool,
}

/// Tangent planes of a smooth seam that differ by more than this are counted, and with `g1` refined; degrees.
const SMOOTH: f64 = 2.0;

impl Default for FitPatchesParams {
    fn default() -> Self {
        Self { tolerance: Length::Percent(0.2), max_spans: 8, fairness: 1e-6, density: 4, g1: false }
    }
}

/// What was fitted. Errors are in mesh units.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub struct FitPatchesStats {
    /// Patches.
    pub patches: usize,
    /// Of those, patches over triangles.
    pub triangles: usize,
    /// Control points of all patches.
    pub control_points: usize,
    /// Largest distance between patches and surface, both ways: of covered vertices from the patches, and of 17 by 17
    /// places of each patch from the surface.
    pub max_error: f64,
    /// Root of the mean square of the patches' errors.
    pub rms_error: f64,
    /// The tolerance in mesh units.
    pub tolerance: f64,
    /// Patches beyond the tolerance, with all spans that they may have.
    pub patches_beyond: usize,
    /// Seams where the surface is smooth.
    pub smooth_seams: usize,
    /// Largest angle between tangent planes along a smooth seam; degrees.
    pub max_seam_angle: f64,
    /// Smooth seams of more than 2 degrees.
    pub seams_beyond: usize,
}

/// Why nothing was fitted.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FitPatchesError {
    /// A parameter is out of range.
    #[error("{name} must be {range}, got {value}")]
    OutOfRange {
        /// The parameter.
        name: &'static str,
        /// What it may be.
        range: &'static str,
        /// What it is.
        value: f64,
    },
    /// See [`FitError`].
    #[error(transparent)]
    Fit(#[from] FitError),
}

/// Fits patches to what the elements of `quads` cover of `surface`.
///
/// # Errors
/// See [`FitPatchesError`].
pub fn fit_patches(
    surface: &Surface,
    quads: &Quads,
    params: &FitPatchesParams,
    watch: &Watch,
) -> Result<(Patches, FitPatchesStats), FitPatchesError> {
    let check = |name, range, value: f64, holds: bool| {
        if holds { Ok(()) } else { Err(FitPatchesError::OutOfRange { name, range, value }) }
    };
    let tolerance = params.tolerance.resolve(Aabb::of(surface.points.iter().copied()).diagonal());
    check("max-spans", "from 1 to 32", params.max_spans as f64, (1..=32).contains(&params.max_spans))?;
    check("density", "from 1 to 256", params.density as f64, (1..=256).contains(&params.density))?;
    check(
        "fairness",
        "finite and not negative",
        params.fairness,
        params.fairness >= 0.0 && params.fairness.is_finite(),
    )?;
    let smooth = params.g1.then_some(SMOOTH);
    let FitPatchesParams { max_spans, fairness, density, .. } = *params;
    let rules = FitRules { tolerance, max_spans, fairness, density, smooth };
    let patches = fit(surface, quads, &rules, watch)?;
    let stats = stats(&patches, tolerance);
    Ok((patches, stats))
}

fn stats(patches: &Patches, tolerance: f64) -> FitPatchesStats {
    let all = &patches.patches;
    let errors: Vec<f64> = all.iter().map(|p| p.rms_error).collect();
    let smooth: Vec<f64> = patches.seams.iter().filter(|s| s.is_smooth).map(|s| s.angle).collect();
    FitPatchesStats {
        patches: all.len(),
        triangles: all.iter().filter(|p| p.is_triangle).count(),
        control_points: all.iter().map(|p| p.controls.len()).sum(),
        max_error: all.iter().map(|p| p.max_error).fold(0.0, f64::max),
        rms_error: summary::rms(&errors).unwrap_or(0.0),
        tolerance,
        patches_beyond: all.iter().filter(|p| p.max_error > tolerance).count(),
        smooth_seams: smooth.len(),
        max_seam_angle: smooth.iter().copied().fold(0.0, f64::max),
        seams_beyond: smooth.iter().filter(|&&a| a > SMOOTH).count(),
    }
}

impl From<FitPatchesError> for StepFailure {
    fn from(error: FitPatchesError) -> Self {
        let message = error.to_string();
        match error {
            FitPatchesError::OutOfRange { .. } => Self::failed(message),
            FitPatchesError::Fit(FitError::Cancelled(cancelled)) => cancelled.into(),
            FitPatchesError::Fit(FitError::Frame(FrameError::NoCover)) => {
                Self::bad_input(message).with_help("use the quads of `rough-quads`")
            }
            FitPatchesError::Fit(FitError::Frame(_)) => {
                Self::bad_input(message).with_help("give as `surface` the step that `rough-quads` had as `from`")
            }
        }
    }
}

/// The room's entry in the catalog.
#[derive(Debug)]
pub struct Step;

impl StepContract for Step {
    const NAME: &'static str = "fit-patches";
    const REVISION: u32 = 8;
    const INPUTS: &'static [InputDef] = &[
        InputDef { name: "from", accepts: &[Port::Quads], required: true, doc: "coarse quads with what they cover" },
        InputDef {
            name: "surface",
            accepts: &[Port::Surface],
            required: true,
            doc: "the surface that the quads were made of; another one is an error",
        },
    ];
    const OUTPUTS: &'static [OutputDef] = &[
        OutputDef { name: "main", port: OutPort::Is(Port::Patches), derive: None },
        OutputDef { name: "quads", port: OutPort::Is(Port::Quads), derive: Some(tessellation) },
    ];
    const CARRIES: &'static str = "nothing; the tessellation's field `patch` tells the patch of each element";
    const EXAMPLE: &'static str =
        "use = \"fit-patches\"\nfrom = \"rough\"\nsurface = \"sheet\"\ntolerance = \"0.2%\"\n";

    type Params = FitPatchesParams;
    type Stats = FitPatchesStats;

    fn run(
        inputs: &Inputs,
        _output: &str,
        params: &FitPatchesParams,
        _locks: &Locks,
        watch: &Watch,
    ) -> Result<Produced<FitPatchesStats>, StepFailure> {
        let quads = inputs.require("from")?.as_quads()?;
        let (patches, stats) = fit_patches(inputs.surface("surface")?, quads, params, watch)?;
        Ok(Produced { artifact: Artifact::Patches(Arc::new(patches)), stats })
    }
}

fn tessellation(patches: &Artifact) -> Option<Artifact> {
    let Artifact::Patches(patches) = patches else { return None };
    Some(Artifact::Quads(Arc::new(Quads { mesh: patches.tessellation.clone(), cover: None })))
}
