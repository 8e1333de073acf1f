//! A gate as a task: the checks of the plan, judged by the metrics.

use std::sync::Arc;

use super::node::Finished;
use super::shared::Shared;
use crate::metric::gate::{Check, GateError, GateReport, judge};
use crate::metric::{Measured, Subject};
use crate::plan::TaskId;
use crate::step::StepFailure;
use crate::watch::{Cancelled, Watch};

/// Judges a mesh, compared with `reference` where the checks ask for it.
pub(super) fn evaluate(
    checks: &[Check],
    target: &Measured,
    reference: Option<&Arc<Measured>>,
    watch: &Watch,
) -> Result<GateReport, StepFailure> {
    judge(&Subject::kept(target, reference, watch), checks).map_err(|error| match error {
        GateError::Cancelled(_) => Cancelled.into(),
        other => StepFailure::failed(other.to_string()),
    })
}

/// The mesh of a task that a gate judges or compares with.
pub(super) fn mesh(shared: &Shared<'_>, task: TaskId) -> Result<Arc<Measured>, Finished> {
    if let Some(mesh) = shared.measured(task)? {
        return Ok(mesh);
    }
    let what = shared.artifact(task)?.port();
    Err(Finished::Failed(StepFailure::failed(format!("a gate judges meshes, not {what}"))))
}
