//! Progress and cancellation of a running step. Nothing here ever affects a result.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// The run was interrupted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("cancelled")]
pub struct Cancelled;

/// Receives progress; the command line draws bars, tests collect, a library user may ignore.
pub trait Progress: Send + Sync {
    /// A phase began. `total` is the amount of work where it is known.
    fn phase(&self, name: &str, total: Option<u64>);
    /// `done` of the phase's work is finished; `figure` is a short text such as `12 480 faces left`.
    fn advance(&self, done: u64, figure: &str);
}

/// Handed to every step: report progress here, and ask here whether to go on.
#[derive(Clone, Default)]
pub struct Watch {
    progress: Option<Arc<dyn Progress>>,
    cancelled: Arc<AtomicBool>,
    expired: Option<Arc<AtomicBool>>,
}

impl std::fmt::Debug for Watch {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Watch").field("cancelled", &self.is_cancelled()).finish_non_exhaustive()
    }
}

impl Watch {
    /// A watch that nobody looks at and that is never cancelled.
    pub fn silent() -> Self {
        Self::default()
    }

    /// A watch that reports to `progress` and is cancelled when `cancelled` becomes true.
    pub fn new(progress: Arc<dyn Progress>, cancelled: Arc<AtomicBool>) -> Self {
        Self { progress: Some(progress), cancelled, expired: None }
    }

    /// The same watch, cancelled too when `expired` becomes true: the time of one task is up, and the run goes on.
    #[must_use]
    pub fn limited(&self, expired: Arc<AtomicBool>) -> Self {
        Self { expired: Some(expired), ..self.clone() }
    }

    /// A watch that nobody looks at and that is cancelled when this one is: for one of many parts of a phase.
    #[must_use]
    pub fn quiet(&self) -> Self {
        Self { progress: None, ..self.clone() }
    }

    /// Whether somebody wants the step to stop.
    #[inline]
    pub fn is_cancelled(&self) -> bool {
        let is_set = |flag: &Arc<AtomicBool>| flag.load(Ordering::Relaxed);
        is_set(&self.cancelled) || self.expired.as_ref().is_some_and(is_set)
    }

    /// `Err(Cancelled)` once the run was interrupted. Call it at least every few milliseconds of work.
    #[inline]
    pub fn check(&self) -> Result<(), Cancelled> {
        if self.is_cancelled() { Err(Cancelled) } else { Ok(()) }
    }

    /// Begins a phase of `total` units of work, where that is known.
    pub fn phase(&self, name: &str, total: Option<u64>) {
        if let Some(progress) = &self.progress {
            progress.phase(name, total);
        }
    }

    /// Reports the work done in this phase. The figure is only made when somebody looks.
    pub fn advance(&self, done: u64, figure: impl FnOnce() -> String) {
        if let Some(progress) = &self.progress {
            progress.advance(done, &figure());
        }
    }
}
