//! The limits of one step: its watch is cancelled when its time is up or its memory too much, and the run goes on.
//!
//! # Invariants
//! - A limit decides whether there is a result, never which: what comes when a limit was passed does not count, since
//!   it may have been cut short.
//! - What was cut off is a failure of its own kind, which is not taken for an interruption of the run.
//! - A step fails by its memory only where it ran alone, so that what it took is known. One that seems to take too much
//!   beside others is stopped, and may try again alone.
//!
//! # Cost
//! One thread for a run, from its first step on, which looks at the steps that run every five milliseconds.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, AtomicU8, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError, Sender};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use super::ledger::Account;
use crate::plan::TaskLimits;
use crate::step::{FailureKind, StepFailure, amount};
use crate::store::Peak;
use crate::watch::Watch;

/// How often the clock looks. Nobody fills much memory in that time, and no limit of time is that short.
const TICK: Duration = Duration::from_millis(5);

/// Which limit was passed first.
const NONE: u8 = 0;
const TIME: u8 = 1;
const MEMORY: u8 = 2;

/// Why there is no result.
pub(super) enum Ended {
    /// The step failed, or was over a limit.
    Failed(StepFailure),
    /// It seemed to take too much memory beside others, and has to run alone to know.
    Crowded,
}

/// Does some work within limits, and tells the most memory that it took, where somebody measures. Time and memory begin
/// when the work does.
pub(super) fn bounded<T>(
    limits: TaskLimits,
    (account, clock): (&Arc<Account>, &Clock),
    watch: &Watch,
    work: &dyn Fn(&Watch) -> Result<T, StepFailure>,
) -> Result<(T, Option<Peak>), Ended> {
    account.restart();
    let stop = Arc::new(AtomicBool::new(false));
    let look = Look { limits, account: Arc::clone(account), start: Instant::now(), passed: AtomicU8::new(NONE), stop };
    let look = Arc::new(look);
    let result = if limits.timeout.is_some() || account.peak().is_some() {
        let _watched = clock.watch(&look).map_err(Ended::Failed)?;
        work(&watch.limited(Arc::clone(&look.stop)))
    } else {
        work(watch)
    };
    // The clock may come late.
    let (passed, peak) = (look.at(), account.peak());
    match (passed, result) {
        // An interruption is one of the run.
        (TIME | MEMORY, Err(failure)) if watch.is_cancelled() => Err(Ended::Failed(failure)),
        (TIME, _) => Err(Ended::Failed(over_time(limits.timeout.unwrap_or_default()))),
        (MEMORY, _) if peak.is_some_and(|peak| !peak.alone) => Err(Ended::Crowded),
        (MEMORY, _) => Err(Ended::Failed(over_memory(limits.memory.unwrap_or_default()))),
        (_, result) => result.map(|value| (value, peak)).map_err(Ended::Failed),
    }
}

/// What the clock looks at, by number.
type Looks = BTreeMap<u64, Arc<Look>>;

/// Looks at the steps that run until it is dropped.
#[derive(Default)]
pub(super) struct Clock {
    looks: Arc<Mutex<(u64, Looks)>>,
    /// Goes with the clock, which ends its thread.
    running: Mutex<Option<Sender<()>>>,
}

impl Clock {
    /// Looks at one more, until what is returned is dropped.
    fn watch(&self, look: &Arc<Look>) -> Result<Watched<'_>, StepFailure> {
        self.start().map_err(|error| {
            let failure = StepFailure::new(FailureKind::TimedOut, format!("cannot watch its limits: {error}"));
            failure.with_help("run fewer tasks at once with --jobs N")
        })?;
        let mut looks = lock(&self.looks);
        looks.0 += 1;
        let number = looks.0;
        looks.1.insert(number, Arc::clone(look));
        Ok(Watched { clock: self, number })
    }

    /// Starts the thread, where it does not run yet.
    fn start(&self) -> std::io::Result<()> {
        let mut running = lock(&self.running);
        if running.is_none() {
            let (sender, end) = mpsc::channel();
            let looks = Arc::clone(&self.looks);
            let tick = move || {
                while end.recv_timeout(TICK) == Err(RecvTimeoutError::Timeout) {
                    for look in lock(&looks).1.values().filter(|look| look.at() != NONE) {
                        look.stop.store(true, Ordering::Relaxed);
                    }
                }
            };
            thread::Builder::new().name("limits".to_owned()).spawn(tick)?;
            *running = Some(sender);
        }
        Ok(())
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A step that the clock looks at.
struct Watched<'a> {
    clock: &'a Clock,
    number: u64,
}

impl Drop for Watched<'_> {
    fn drop(&mut self) {
        lock(&self.clock.looks).1.remove(&self.number);
    }
}

/// Looks whether a limit was passed.
struct Look {
    limits: TaskLimits,
    account: Arc<Account>,
    start: Instant,
    passed: AtomicU8,
    /// Ends the work.
    stop: Arc<AtomicBool>,
}

impl Look {
    /// The limit that was passed first, now or before.
    fn at(&self) -> u8 {
        let peak = self.account.peak();
        let found = if self.limits.timeout.is_some_and(|timeout| self.start.elapsed() > timeout) {
            TIME
        } else if self.limits.memory.zip(peak).is_some_and(|(memory, peak)| peak.bytes > memory) {
            MEMORY
        } else {
            NONE
        };
        match self.passed.compare_exchange(NONE, found, Ordering::Relaxed, Ordering::Relaxed) {
            Ok(_) => found,
            Err(before) => before,
        }
    }
}

fn over_time(timeout: Duration) -> StepFailure {
    let message = format!("took longer than its limit of {}", time_text(timeout));
    StepFailure::new(FailureKind::TimedOut, message).with_help(help("timeout"))
}

fn over_memory(memory: u64) -> StepFailure {
    let message = format!("took more memory than its limit of {}", amount::text(memory));
    StepFailure::new(FailureKind::OverMemory, message).with_help(help("memory"))
}

fn help(key: &str) -> String {
    format!(
        "raise `{key}` in [limits], or in [limits.steps] for this step alone; or ask for less: larger sizes, a looser \
         tolerance, a mesh of fewer faces"
    )
}

fn time_text(time: Duration) -> String {
    let seconds = time.as_secs_f64();
    if seconds < 120.0 { format!("{seconds} s") } else { format!("{} min", (seconds / 6.0).round() / 10.0) }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::AtomicU64;

    use super::super::ledger::{Ledger, Meter};
    use super::*;

    /// Works until it is told to stop.
    fn endless(watch: &Watch) -> Result<(), StepFailure> {
        loop {
            watch.check()?;
            thread::yield_now();
        }
    }

    fn time(timeout: Duration) -> TaskLimits {
        TaskLimits { timeout: Some(timeout), ..TaskLimits::default() }
    }

    fn account(meter: Option<Meter>) -> Arc<Account> {
        Arc::new(Arc::new(Ledger::new(meter)).open(0))
    }

    /// The same with a clock of its own.
    fn bounded<T>(
        limits: TaskLimits,
        account: &Arc<Account>,
        watch: &Watch,
        work: &dyn Fn(&Watch) -> Result<T, StepFailure>,
    ) -> Result<(T, Option<Peak>), Ended> {
        super::bounded(limits, (account, &Clock::default()), watch, work)
    }

    fn failure<T>(ended: Result<(T, Option<Peak>), Ended>) -> StepFailure {
        match ended {
            Err(Ended::Failed(failure)) => failure,
            Err(Ended::Crowded) => panic!("nothing else runs"),
            Ok(_) => panic!("it came to an end"),
        }
    }

    #[test]
    fn what_is_over_its_time_fails_and_says_what_to_change() {
        let short = time(Duration::from_millis(1));
        let failed = failure(bounded(short, &account(None), &Watch::silent(), &endless));
        assert_eq!(failed.kind, FailureKind::TimedOut);
        assert!(failed.message.contains("0.001 s") && failed.help.unwrap().contains("[limits]"));
        // A result that comes too late is none.
        let late = |watch: &Watch| endless(watch).or(Ok(()));
        assert_eq!(failure(bounded(short, &account(None), &Watch::silent(), &late)).kind, FailureKind::TimedOut);
    }

    #[test]
    fn what_ends_is_kept_and_an_interrupted_run_stays_one() {
        let long = time(Duration::from_secs(3001));
        let kept = bounded(long, &account(None), &Watch::silent(), &|_| Ok(7));
        assert!(matches!(kept, Ok((7, None))));
        let silent: Arc<dyn crate::watch::Progress> = Arc::new(super::super::Silent);
        let watch = Watch::new(silent, Arc::new(AtomicBool::new(true)));
        assert_eq!(failure(bounded(long, &account(None), &watch, &endless)).kind, FailureKind::Cancelled);
        let wrong = |_: &Watch| Err::<(), _>(StepFailure::failed("no"));
        assert_eq!(failure(bounded(long, &account(None), &Watch::silent(), &wrong)).kind, FailureKind::Failed);
    }

    static TAKEN: AtomicU64 = AtomicU64::new(0);

    #[test]
    fn what_takes_too_much_memory_fails_alone_and_is_crowded_beside_others() {
        let ledger = Arc::new(Ledger::new(Some(|| TAKEN.load(Ordering::Relaxed))));
        let limits = TaskLimits { memory: Some(1000), ..TaskLimits::default() };
        let own = Arc::new(ledger.open(0));
        let take = |bytes| {
            move |watch: &Watch| {
                TAKEN.fetch_add(bytes, Ordering::Relaxed);
                endless(watch)
            }
        };
        let failed = failure(bounded(limits, &own, &Watch::silent(), &take(1001)));
        assert_eq!(failed.kind, FailureKind::OverMemory);
        assert!(failed.message.contains("1.0 kB") && failed.help.unwrap().contains("`memory`"));
        // What was there before does not count, and a peak is told.
        let within = |_: &Watch| {
            TAKEN.fetch_add(1000, Ordering::Relaxed);
            Ok(())
        };
        let kept = bounded(limits, &own, &Watch::silent(), &within);
        assert!(matches!(kept, Ok(((), Some(Peak { bytes: 1000, alone: true })))));
        let _other = ledger.open(1);
        assert!(matches!(bounded(limits, &own, &Watch::silent(), &take(2002)), Err(Ended::Crowded)));
    }
}
