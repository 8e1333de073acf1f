//! What property control says: how it ended, counted on the result, and why it refused.

use schemars::JsonSchema;
use serde::Serialize;

use super::{ControlPropertiesInput, ControlPropertiesParams};
use crate::mesh::halfedge::EnterError;
use crate::mesh::{FreedomError, Surface, resolve_freedom};
use crate::step::{OutOfRange, StepFailure, ToleranceError};
use crate::technique::collapse::Ending;
use crate::technique::guarded::{Cause, Counts, Recount, Setup, Threshold, Violation, recount};
use crate::technique::levels::HierarchyReport;
use crate::watch::Cancelled;

/// How it ended, counted on the result.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Status {
    /// All thresholds hold, and no valid edge is left, or none without falling below the mean stretch asked for.
    Satisfied,
    /// All thresholds hold, and the number of faces asked for is reached.
    TargetReached,
    /// A threshold does not hold everywhere, or the number of faces was not reached; `violations` names the faces. Or
    /// the mean stretch ended below the one asked for.
    Stuck,
}

/// What property control did. Every figure is counted on the result.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub struct ControlPropertiesStats {
    /// How it ended.
    pub status: Status,
    /// Faces of the input.
    pub faces_before: usize,
    /// Faces of the result.
    pub faces_after: usize,
    /// What was done, and what was refused.
    #[serde(flatten)]
    pub counts: Counts,
    /// Least stretch.
    pub min_stretch: f64,
    /// Mean stretch.
    pub mean_stretch: f64,
    /// The same of the faces that touch no marked curve and nothing kept, to tell what those cost.
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
    /// Vertices with more edges than allowed.
    pub vertices_over_valence: usize,
    /// The faces that break a threshold, with the cause; the first 64.
    pub violations: Vec<Violation>,
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

/// Why property control refused.
#[derive(Debug, thiserror::Error)]
pub enum ControlPropertiesError {
    /// The tolerance makes no sense.
    #[error(transparent)]
    Tolerance(#[from] ToleranceError),
    /// A threshold is out of range.
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
    /// Thresholds do not hold everywhere, and `on-infeasible` asks for an error then.
    #[error("thresholds break on {faces} faces and {vertices} vertices with too many edges{worst}")]
    Infeasible {
        /// Faces that break a threshold.
        faces: usize,
        /// Vertices with more edges than allowed.
        vertices: usize,
        /// The worst of the faces, with the cause, as text; empty where there is none.
        worst: String,
    },
    /// The mean stretch ended below the one asked for, and `on-infeasible` asks for an error then.
    #[error("the mean stretch is {reached:.4}, below {asked}; it is {free:.4} off marked curves")]
    MeanStretch {
        /// That of the result.
        reached: f64,
        /// `mean-stretch`.
        asked: f64,
        /// That of the faces that touch no marked curve; of all faces where there is none.
        free: f64,
    },
    /// A size names a field or group that is not there.
    #[error("max-size: {0}")]
    Size(StepFailure),
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

/// Fails where a threshold does not hold.
pub(super) fn refuse_violations(
    stats: &ControlPropertiesStats,
    params: &ControlPropertiesParams,
) -> Result<(), ControlPropertiesError> {
    let (faces, vertices) = (stats.faces_violating, stats.vertices_over_valence);
    if faces == 0 && vertices == 0 {
        let (reached, asked) = (stats.mean_stretch, params.mean_stretch);
        let free = stats.mean_stretch_off_curves.unwrap_or(reached);
        return if reached < asked {
            Err(ControlPropertiesError::MeanStretch { reached, asked, free })
        } else {
            Ok(())
        };
    }
    let shapes = stats.violations.iter().filter(|v| v.threshold == Threshold::MinStretch);
    let worst = shapes.min_by(|a, b| a.value.total_cmp(&b.value)).or(stats.violations.first());
    Err(ControlPropertiesError::Infeasible { faces, vertices, worst: worst.map(describe).unwrap_or_default() })
}

fn describe(violation: &Violation) -> String {
    let Violation { face, at: [x, y, z], threshold, value, cause } = violation;
    let threshold = match threshold {
        Threshold::MinStretch => "a stretch",
        Threshold::MaxSize => "a longest side",
    };
    let cause = match cause {
        Cause::CurvesMeet { degrees } => format!("marked curves meet there at {degrees:.2} degrees"),
        Cause::Kept => "its corners are kept".to_owned(),
        Cause::Stuck => "no edit within the tolerances makes it better".to_owned(),
    };
    format!("; the worst is face {face} at ({x}, {y}, {z}) with {threshold} of {value:.4}: {cause}")
}

/// How the work ended.
pub(super) struct End {
    pub(super) ending: Ending,
    pub(super) counts: Counts,
    pub(super) distance_bound: Option<f64>,
}

/// Counts everything on the result.
pub(super) fn stats(
    input: &ControlPropertiesInput<'_>,
    params: &ControlPropertiesParams,
    setup: &Setup,
    result: &Surface,
    end: End,
) -> Result<ControlPropertiesStats, ControlPropertiesError> {
    let freedom = resolve_freedom(result, &input.locks)?;
    let recount = recount(result, &freedom, &setup.limits);
    Ok(ControlPropertiesStats {
        status: status(&recount, end.ending, params),
        faces_before: input.surface.faces.len(),
        faces_after: result.faces.len(),
        counts: end.counts,
        min_stretch: recount.min_stretch,
        mean_stretch: recount.mean_stretch,
        mean_stretch_off_curves: recount.free_mean_stretch,
        max_size: recount.max_size,
        max_valence: recount.max_valence,
        faces_violating: recount.violations.len(),
        faces_excused: recount.excused(),
        vertices_over_valence: recount.over_valence,
        violations: recount.violations.into_iter().take(64).collect(),
        tolerance: setup.tolerance,
        distance_bound: end.distance_bound,
        hierarchy: None,
    })
}

fn status(recount: &Recount, ending: Ending, params: &ControlPropertiesParams) -> Status {
    let holds = recount.violations.is_empty() && recount.over_valence == 0;
    match (holds && recount.mean_stretch >= params.mean_stretch, ending) {
        (true, Ending::Target) => Status::TargetReached,
        (true, Ending::Exhausted | Ending::Mean) if params.target_faces.is_none() => Status::Satisfied,
        (true | false, _) => Status::Stuck,
    }
}

impl From<ControlPropertiesError> for StepFailure {
    fn from(error: ControlPropertiesError) -> Self {
        let message = error.to_string();
        match error {
            ControlPropertiesError::Cancelled(cancelled) => cancelled.into(),
            ControlPropertiesError::Tolerance(error) => error.into(),
            ControlPropertiesError::Size(failure) => Self { message, ..failure },
            ControlPropertiesError::Infeasible { .. } | ControlPropertiesError::MeanStretch { .. } => {
                Self::failed(message).with_help(
                    "relax the threshold, give more tolerance or finer elements, or use `on-infeasible = \"report\"`",
                )
            }
            ControlPropertiesError::TooManyFaces { .. } => {
                Self::failed(message).with_help("raise `max-size`, or `max-faces` if that is meant")
            }
            ControlPropertiesError::NotASurface(_) => Self::bad_input(message).with_help("run `repair` first"),
            ControlPropertiesError::OutOfRange(_) | ControlPropertiesError::Locks(_) => Self::failed(message),
        }
    }
}
