//! A gate as a task: the checks of the plan, judged by the metrics.

use std::sync::Arc;

use crate::mesh::Soup;
use crate::metric::gate::{Check, GateError, GateReport, evaluate as judge};
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
    judge_soup(&task.checks, &*mesh(target)?, reference, watch)
}

/// Judges a mesh that is no artifact, as a file has it.
pub(super) fn judge_soup(
    checks: &[Check],
    target: &Soup,
    reference: Option<&Artifact>,
    watch: &Watch,
) -> Result<GateReport, StepFailure> {
    let reference = reference.map(mesh).transpose()?;
    judge(target, reference.as_deref(), checks, watch).map_err(|error| match error {
        GateError::Cancelled(_) => Cancelled.into(),
        other => StepFailure::failed(other.to_string()),
    })
}

fn mesh(artifact: &Artifact) -> Result<Arc<Soup>, StepFailure> {
    artifact.to_soup().ok_or_else(|| StepFailure::failed(format!("a gate judges meshes, not {}", artifact.port())))
}
