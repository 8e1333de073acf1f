//! The limit of time of one step: its watch is cancelled when the time is up, and the run goes on.
//!
//! # Invariants
//! - A limit decides whether there is a result, never which: what comes after the time is up does not count, since it
//!   may have been cut short.
//! - What was cut off is a failure of its own kind, which is not taken for an interruption of the run.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::thread;
use std::time::{Duration, Instant};

use crate::step::{FailureKind, StepFailure};
use crate::watch::Watch;

/// Does some work, for at most `timeout` where there is one. The time begins when the work does.
pub(super) fn timed<T>(
    timeout: Option<Duration>,
    watch: &Watch,
    work: &dyn Fn(&Watch) -> Result<T, StepFailure>,
) -> Result<T, StepFailure> {
    let Some(timeout) = timeout else { return work(watch) };
    let expired = Arc::new(AtomicBool::new(false));
    let (ended, end) = mpsc::channel::<()>();
    let flag = Arc::clone(&expired);
    let clock = move || {
        // The sender goes when the work has ended.
        if end.recv_timeout(timeout) == Err(RecvTimeoutError::Timeout) {
            flag.store(true, Ordering::Relaxed);
        }
    };
    thread::Builder::new().name("timer".to_owned()).spawn(clock).map_err(|error| {
        let message = format!("cannot watch its time: {error}");
        StepFailure::new(FailureKind::TimedOut, message).with_help("run fewer tasks at once with --jobs N")
    })?;
    let start = Instant::now();
    let result = work(&watch.limited(Arc::clone(&expired)));
    drop(ended);
    // The thread of the clock may come late.
    match (expired.load(Ordering::Relaxed) || start.elapsed() > timeout, result) {
        // An interruption is one of the run.
        (true, Err(failure)) if watch.is_cancelled() => Err(failure),
        (true, _) => Err(over(timeout)),
        (false, result) => result,
    }
}

fn over(timeout: Duration) -> StepFailure {
    let message = format!("took longer than its limit of {}", text(timeout));
    StepFailure::new(FailureKind::TimedOut, message).with_help(
        "raise `timeout` in [limits], or in [limits.steps] for this step alone; or ask for less: larger sizes, a looser \
         tolerance, a mesh of fewer faces",
    )
}

fn text(time: Duration) -> String {
    let seconds = time.as_secs_f64();
    if seconds < 120.0 { format!("{seconds} s") } else { format!("{} min", (seconds / 6.0).round() / 10.0) }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Works until it is told to stop.
    fn endless(watch: &Watch) -> Result<(), StepFailure> {
        loop {
            watch.check()?;
            thread::yield_now();
        }
    }

    #[test]
    fn what_is_over_its_limit_fails_and_says_what_to_change() {
        let failure = timed(Some(Duration::from_millis(1)), &Watch::silent(), &endless).unwrap_err();
        assert_eq!(failure.kind, FailureKind::TimedOut);
        assert!(failure.message.contains("0.001 s") && failure.help.unwrap().contains("[limits]"));
    }

    #[test]
    fn what_ends_is_kept_and_an_interrupted_run_stays_one() {
        let long = Some(Duration::from_secs(3001));
        assert_eq!(timed(long, &Watch::silent(), &|_| Ok(7)), Ok(7));
        let silent: Arc<dyn crate::watch::Progress> = Arc::new(super::super::Silent);
        let watch = Watch::new(silent, Arc::new(AtomicBool::new(true)));
        assert_eq!(timed(long, &watch, &endless).unwrap_err().kind, FailureKind::Cancelled);
        let wrong = |_: &Watch| Err::<(), _>(StepFailure::failed("no"));
        assert_eq!(timed(long, &Watch::silent(), &wrong).unwrap_err().kind, FailureKind::Failed);
        // A result that comes too late is none.
        let late = |watch: &Watch| endless(watch).or(Ok(()));
        assert_eq!(
            timed(Some(Duration::from_millis(1)), &Watch::silent(), &late).unwrap_err().kind,
            FailureKind::TimedOut
        );
    }
}
