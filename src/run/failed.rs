//! Failures that are remembered, so that what cannot be done is not tried again by every run.
//!
//! A step is pure: what it could not do to these inputs with these parameters, it cannot do the next time either. Its
//! own failures are kept under the key of the task, as results are. What the machine or the clock decides is not: an
//! interruption, a time that was up, too little memory, a panic, which is a fault of ours, and whatever happens outside
//! of the step. A failure counts for the version of the program that met it alone, since another may be able to do
//! more.

use std::time::Instant;

use super::RunOptions;
use super::shared::{Shared, VERSION, recipe_task};
use crate::plan::TaskId;
use crate::step::{FailureKind, StepFailure};
use crate::store::{Entry, Outcome, host};

/// Keeps the failure of a step.
pub(super) fn remember(shared: &Shared<'_>, id: TaskId, failure: &StepFailure, start: Instant) {
    let is_own = match failure.kind {
        FailureKind::BadInput | FailureKind::Failed => true,
        FailureKind::Cancelled | FailureKind::Panicked | FailureKind::TimedOut | FailureKind::OverMemory => false,
    };
    let interrupted = shared.options.cancelled.load(std::sync::atomic::Ordering::Relaxed);
    if let (true, false, Some((key, record)), Ok(json)) =
        (is_own, interrupted, shared.key(id), serde_json::to_value(failure))
    {
        let label = &shared.plan.node(id).label;
        let entry = Entry {
            version: VERSION.to_owned(),
            host: host(),
            task: recipe_task(&shared.options.name, label),
            record: record.fields,
            outcome: Outcome::Failure(json),
            stats: serde_json::Value::Null,
            seconds: start.elapsed().as_secs_f64(),
            memory: None,
        };
        shared.publish(&key, &entry);
    }
}

/// The failure that an entry holds, where it still counts.
pub(super) fn recall(entry: &Entry, options: &RunOptions) -> Option<StepFailure> {
    let Outcome::Failure(json) = &entry.outcome else { return None };
    if options.retry_failed || entry.version != VERSION {
        return None;
    }
    let mut failure: StepFailure = serde_json::from_value(json.clone()).ok()?;
    let again = "It failed so in an earlier run; `--retry-failed` tries again.";
    failure.help = Some(failure.help.map_or_else(|| again.to_owned(), |help| format!("{help}. {again}")));
    Some(failure)
}
