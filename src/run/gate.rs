//! A gate as a task: the checks of the plan, judged by the metrics.

use crate::metric::gate::{GateError, GateReport, evaluate as judge};
use crate::plan::GateTask;
use crate::step::{Artifact, StepFailure};
use crate::watch::{Cancelled, Watch};

/// Judges a mesh, compared with `reference` where the checks ask for it.
pub(super) fn evaluate(
    task: &GateTask,
    target: &Artifact,
    reference: Option<&Artifact>,
    watch: &Watch,
) -> Result<GateReport, StepFailure> {
    let mesh = |artifact: &Artifact| {
        artifact.to_soup().ok_or_else(|| StepFailure::failed(format!("a gate judges meshes, not {}", artifact.port())))
    };
    let target = mesh(target)?;
    let reference = reference.map(mesh).transpose()?;
    judge(&target, reference.as_deref(), &task.checks, watch).map_err(|error| match error {
        GateError::Cancelled(_) => Cancelled.into(),
        other => StepFailure::failed(other.to_string()),
    })
}
