//! All pairs of triangles that meet outside what they share.
//!
//! # Algorithm
//! Candidates come from a hierarchy of boxes. Boxes cannot tell apart what lies on one spot, so three things are taken
//! out first: triangles with the same corners are looked at once; those at one corner of very many are told apart by
//! the arcs that they cut out of a sphere around it; and of those, the ones at one edge of very many by the direction
//! in which they leave it. Every pair is then decided by the caller's exact test.
//!
//! # Invariants
//! - The pairs are those of the test on all pairs, `i < j`, in order, whatever was taken out.
//! - Where there are more than [`MOST`] pairs, or the boxes of more than a bounded number overlap, looking stops at the
//!   same place on every machine, and the answer says that it is not complete.
//!
//! # Cost
//! O(n log n + pairs) where triangles can be told apart as above; at most a few hundred candidates a triangle else.

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicU64, Ordering};

use rayon::prelude::*;

use super::bvh::{Primitive, Triangle};
use super::predicate::Meeting;
use crate::watch::{Cancelled, Watch};
use finder::Finder;

mod finder;

/// Pairs are listed up to this many.
pub const MOST: usize = 1_000_000;
/// Candidates that any mesh may have, and further ones for each triangle.
const CANDIDATES: (u64, u64) = (1 << 24, 256);
/// Candidates that are looked at again, in order, where there are more.
const AGAIN: u64 = 1 << 22;

/// What was found.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Meetings {
    /// Pairs of triangles, the lower one first, in order, and how they meet.
    pub pairs: Vec<(u32, u32, Meeting)>,
    /// Whether these are all; else there are at least as many.
    pub complete: bool,
    /// Triangles with the same three corners, where there are several; such are no pairs.
    pub copies: Vec<Vec<u32>>,
}

/// The pairs that `test` calls an intersection. The test must not depend on the order of triangles or of their corners,
/// and call triangles with the same corners no intersection.
pub fn meetings(
    triangles: &[Triangle],
    test: impl Fn(Triangle, Triangle) -> Meeting + Sync,
    watch: &Watch,
) -> Result<Meetings, Cancelled> {
    let search = Search { finder: Finder::new(triangles), triangles, test };
    let looked = AtomicU64::new(0);
    let found = AtomicU64::new(0);
    let most = CANDIDATES.0 + CANDIDATES.1 * triangles.len() as u64;
    // Whether a limit is passed does not depend on the order in which the threads get there.
    let is_over = || looked.load(Ordering::Relaxed) > most || found.load(Ordering::Relaxed) > MOST as u64;
    let lists: Vec<Vec<(u32, u32, Meeting)>> = (0..search.finder.len() as u32)
        .into_par_iter()
        .map(|i| {
            let mut list = Vec::new();
            if (i % 256 == 0 && watch.is_cancelled()) || is_over() {
                return list;
            }
            let mut candidates = 0;
            let _ = search.pairs_of(i, &mut list, &mut |_| {
                candidates += 1;
                if candidates % 4096 == 0 && is_over() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
            });
            looked.fetch_add(candidates, Ordering::Relaxed);
            found.fetch_add(list.iter().map(|&(a, b, _)| search.finder.copies(a, b)).sum(), Ordering::Relaxed);
            list
        })
        .collect();
    watch.check()?;
    if is_over() {
        return search.first_pairs(watch);
    }
    let mut pairs = Vec::new();
    for &(a, b, meeting) in lists.iter().flatten() {
        search.finder.expand(a, b, &mut |i, j| pairs.push((i, j, meeting)));
    }
    pairs.sort_unstable();
    Ok(Meetings { pairs, complete: true, copies: search.finder.into_copies() })
}

struct Search<'a, F> {
    finder: Finder,
    triangles: &'a [Triangle],
    test: F,
}

impl<F: Fn(Triangle, Triangle) -> Meeting> Search<'_, F> {
    /// Adds the pairs of a triangle with later ones; both are numbers of the finder. `look` is asked at each candidate
    /// whether to go on, and told how many pairs there are.
    fn pairs_of(
        &self,
        i: u32,
        list: &mut Vec<(u32, u32, Meeting)>,
        look: &mut dyn FnMut(usize) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        let corners = |i: u32| self.triangles[self.finder.original(i) as usize];
        let own = corners(i);
        self.finder.for_each_near(i, own.bounds(), &mut |j| {
            look(list.len())?;
            if j > i {
                let meeting = (self.test)(own, corners(j));
                if meeting.is_intersection() {
                    list.push((i, j, meeting));
                }
            }
            ControlFlow::Continue(())
        })
    }

    /// The pairs of the first triangles, as far as the limits go.
    fn first_pairs(&self, watch: &Watch) -> Result<Meetings, Cancelled> {
        let (mut looked, mut pairs) = (0, Vec::new());
        for i in 0..self.finder.len() as u32 {
            if i % 256 == 0 {
                watch.check()?;
            }
            let mut list = Vec::new();
            let end = self.pairs_of(i, &mut list, &mut |found| {
                looked += 1;
                let is_over = looked > AGAIN || pairs.len() + found >= MOST;
                if is_over { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
            });
            for (a, b, meeting) in list {
                self.finder.expand(a, b, &mut |i, j| {
                    if pairs.len() < MOST {
                        pairs.push((i, j, meeting));
                    }
                });
            }
            if end.is_break() || pairs.len() >= MOST {
                break;
            }
        }
        pairs.sort_unstable();
        Ok(Meetings { pairs, complete: false, copies: Vec::new() })
    }
}

#[cfg(test)]
mod tests;
