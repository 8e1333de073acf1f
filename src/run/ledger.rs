//! Who holds how much memory: what the program has allocated, divided among the jobs that run.
//!
//! # Algorithm
//! A meter tells how many bytes the program has allocated and not freed. Whoever looks at it books the difference to
//! the last look: growth in equal parts to the jobs that run, shrinkage from each in proportion to what it holds. What
//! a job leaves behind, its result, belongs to nobody.
//!
//! # Invariants
//! - While one job runs alone, all that is booked to it is its own, up to what is allocated and freed between two
//!   looks.
//! - While several run, their shares are estimates, but the sum of them is what the program has grown by: where each is
//!   within its limit, all of them together are within the sum of their limits.
//! - Nothing here affects a result.
//!
//! # Cost
//! A look is one lock and a pass over the jobs that run.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use crate::store::Peak;

/// Tells how many bytes the program has allocated and not freed.
pub type Meter = fn() -> u64;

/// The accounts of the jobs that run.
pub(super) struct Ledger {
    meter: Option<Meter>,
    books: Mutex<Books>,
}

#[derive(Default)]
struct Books {
    last: u64,
    accounts: BTreeMap<usize, Share>,
}

#[derive(Clone, Copy, Debug)]
struct Share {
    held: u64,
    peak: Peak,
}

impl Ledger {
    pub(super) fn new(meter: Option<Meter>) -> Self {
        Self { meter, books: Mutex::default() }
    }

    /// Opens the account of a job; nodes run once at a time, so that their numbers tell jobs apart.
    pub(super) fn open(self: &Arc<Self>, job: usize) -> Account {
        let mut books = self.look();
        let alone = books.accounts.is_empty();
        for share in books.accounts.values_mut() {
            share.peak.alone = false;
        }
        books.accounts.insert(job, Share { held: 0, peak: Peak { bytes: 0, alone } });
        drop(books);
        Account { ledger: Arc::clone(self), job }
    }

    /// What the program holds that belongs to no job that runs.
    pub(super) fn settled(&self) -> u64 {
        let books = self.look();
        let held = books.accounts.values().map(|share| share.held).sum();
        books.last.saturating_sub(held)
    }

    /// Books what has changed since the last look.
    fn look(&self) -> MutexGuard<'_, Books> {
        let mut books = self.books.lock().unwrap_or_else(PoisonError::into_inner);
        let now = self.meter.map_or(0, |meter| meter());
        books.book(now);
        books
    }
}

impl Books {
    fn book(&mut self, now: u64) {
        let (grown, shrunk) = (now.saturating_sub(self.last), self.last.saturating_sub(now));
        self.last = now;
        let (jobs, held) = (self.accounts.len() as u64, self.accounts.values().map(|share| share.held).sum::<u64>());
        let mut rest = if jobs > 0 { grown % jobs } else { 0 };
        for share in self.accounts.values_mut() {
            if grown > 0 {
                share.held += grown / jobs + u64::from(rest > 0);
                rest = rest.saturating_sub(1);
            } else if held > 0 {
                let part = u128::from(shrunk.min(held)) * u128::from(share.held) / u128::from(held);
                share.held -= part as u64;
            }
            share.peak.bytes = share.peak.bytes.max(share.held);
        }
    }
}

/// The account of a job; closed when it is dropped.
pub(super) struct Account {
    ledger: Arc<Ledger>,
    job: usize,
}

impl Account {
    /// Begins anew: what was booked so far, such as the inputs that were loaded, was there before the work.
    pub(super) fn restart(&self) {
        let mut books = self.ledger.look();
        let alone = books.accounts.len() == 1;
        if let Some(share) = books.accounts.get_mut(&self.job) {
            *share = Share { held: 0, peak: Peak { bytes: 0, alone } };
        }
    }

    /// The most that was booked since the beginning; `None` where nobody measures.
    pub(super) fn peak(&self) -> Option<Peak> {
        self.ledger.meter?;
        self.ledger.look().accounts.get(&self.job).map(|share| share.peak)
    }
}

impl Drop for Account {
    fn drop(&mut self) {
        self.ledger.look().accounts.remove(&self.job);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Books with accounts of these jobs.
    fn books(jobs: &[usize]) -> Books {
        let mut books = Books::default();
        for job in jobs {
            books.accounts.insert(*job, Share { held: 0, peak: Peak { bytes: 0, alone: jobs.len() == 1 } });
        }
        books
    }

    fn held(books: &Books) -> Vec<u64> {
        books.accounts.values().map(|share| share.held).collect()
    }

    #[test]
    fn what_one_job_alone_takes_is_booked_exactly() {
        let mut books = books(&[7]);
        for now in [100, 350, 50, 200] {
            books.book(now);
        }
        assert_eq!(held(&books), [200]);
        assert_eq!(books.accounts[&7].peak, Peak { bytes: 350, alone: true });
    }

    #[test]
    fn shares_add_up_to_what_the_program_has_grown_by() {
        let mut books = books(&[1, 2, 3]);
        let mut most = 0;
        for now in [100, 101, 5000, 700, 701, 3, 0, 12] {
            books.book(now);
            most = most.max(now);
            let sum: u64 = held(&books).iter().sum();
            assert!(sum >= now && sum <= now + 2 * 8, "{sum} for {now}");
        }
        assert_eq!(books.accounts.values().map(|share| share.peak.bytes).sum::<u64>(), most);
    }

    #[test]
    fn what_was_there_before_belongs_to_nobody() {
        static METER: std::sync::atomic::AtomicU64 = std::sync::atomic::AtomicU64::new(1000);
        let set = |bytes| METER.store(bytes, std::sync::atomic::Ordering::Relaxed);
        let ledger = Arc::new(Ledger::new(Some(|| METER.load(std::sync::atomic::Ordering::Relaxed))));
        let first = ledger.open(0);
        set(1500);
        assert_eq!((first.peak().unwrap(), ledger.settled()), (Peak { bytes: 500, alone: true }, 1000));
        first.restart();
        set(1600);
        assert_eq!(first.peak().unwrap(), Peak { bytes: 100, alone: true });
        let second = ledger.open(1);
        set(2000);
        assert_eq!(first.peak().unwrap(), Peak { bytes: 300, alone: false });
        assert_eq!(second.peak().unwrap(), Peak { bytes: 200, alone: false });
        drop((first, second));
        assert_eq!(ledger.settled(), 2000);
        assert_eq!(Arc::new(Ledger::new(None)).open(0).peak(), None);
    }
}
