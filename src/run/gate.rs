//! A gate as a task: the checks of the plan, judged by the metrics.

use std::sync::Arc;

use super::node::Finished;
use super::shared::Shared;
use crate::metric::gate::criteria::{self, CriteriaError};
use crate::metric::gate::{GateError, GateReport, judge};
use crate::metric::{Measured, Subject};
use crate::plan::{GateTask, TaskId};
use crate::step::StepFailure;
use crate::watch::{Cancelled, Watch};

/// Judges a mesh by checks or by criteria, compared with `reference` where they ask for it.
pub(super) fn evaluate(
    task: &GateTask,
    target: &Measured,
    reference: Option<&Arc<Measured>>,
    watch: &Watch,
) -> Result<GateReport, StepFailure> {
    let subject = Subject::kept(target, reference, watch);
    let Some(criteria) = &task.criteria else {
        return judge(&subject, &task.checks).map_err(|error| match error {
            GateError::Cancelled(_) => Cancelled.into(),
            other => StepFailure::failed(other.to_string()),
        });
    };
    match criteria::judge(&subject, criteria) {
        Ok((report, row)) => Ok(GateReport { rows: vec![row], criteria: Some(report) }),
        Err(CriteriaError::Cancelled(_)) => Err(Cancelled.into()),
        Err(other) => Err(StepFailure::failed(other.to_string())),
    }
}

/// The mesh of a task that a gate judges or compares with.
pub(super) fn mesh(shared: &Shared<'_>, task: TaskId) -> Result<Arc<Measured>, Finished> {
    if let Some(mesh) = shared.measured(task)? {
        return Ok(mesh);
    }
    let what = shared.artifact(task)?.port();
    Err(Finished::Failed(StepFailure::failed(format!("a gate judges meshes, not {what}"))))
}
