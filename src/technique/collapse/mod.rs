//! Edge collapse with exchangeable placement and priority on a guarded mesh: the simplification behind quality
//! improvement and property control.
//!
//! The loop of figure 7 of the paper: positions, valid edges, priorities, collapse, until the target is reached or no
//! edge is valid.
//!
//! Based on: H. Date, S. Kanai, T. Kishinami, I. Nishigaki, T. Dohi. High-Quality and Property Controlled Finite
//! Element Mesh Generation From Triangular Meshes using the Multiresolution Technique. JCISE 5(4), 2005, section 5.
//!
//! Invariants: those of [`GuardedMesh`], whose verbs do all that is done here. Equal input gives equal output: ties go
//! to the lowest edge number.
//!
//! Departure: edges are rated when they come to the top of the queue, not whenever their star changes (`queue`); until
//! then an estimate from their length stands for equation 9. On the million triangles of a scan this takes a third of
//! the time, and the mean stretch of the result is higher.
//! Cost: O(F log F), about two ratings a collapse.

mod attempt;
mod bars;
mod placement;
mod priority;
mod queue;

use queue::Queue;

use crate::technique::guarded::GuardedMesh;
use crate::watch::{Cancelled, Watch};

pub use attempt::{CollapseRules, collapse_edge};
pub use bars::{Bars, bar_of};
pub use placement::Order;
pub use priority::Priority;

/// Why simplification stopped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ending {
    /// The number of faces asked for is reached.
    Target,
    /// The mean stretch would fall below the one asked for.
    Mean,
    /// No edge is valid any more.
    Exhausted,
}

/// Where collapses end before no edge is valid any more.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Goal {
    /// When this many faces are left.
    pub faces: usize,
    /// Before the mean stretch falls below this; 0 where it does not matter.
    pub mean_stretch: f64,
}

/// How many collapses pass between two looks at the watch.
const WATCH_EVERY: usize = 512;

/// The part of the faces that goes between two looks at the mean stretch.
const LOOK_AT_MEAN: f64 = 0.005;

/// Collapses valid edges, best first, until the goal is reached or no edge is valid.
pub fn simplify(
    guarded: &mut GuardedMesh<'_>,
    rules: &CollapseRules,
    goal: Goal,
    watch: &Watch,
) -> Result<Ending, Cancelled> {
    let start = guarded.mesh().face_count();
    watch.phase("collapse", Some(start.saturating_sub(goal.faces) as u64));
    let mut queue = Queue::new(guarded, rules, watch)?;
    let mut done = 0_usize;
    let mut look_at = if goal.mean_stretch > 0.0 { start } else { 0 };
    while guarded.mesh().face_count() > goal.faces {
        if guarded.mesh().face_count() <= look_at {
            if guarded.mean_stretch() < goal.mean_stretch {
                return Ok(Ending::Mean);
            }
            look_at = ((1.0 - LOOK_AT_MEAN) * look_at as f64) as usize;
        }
        if queue.collapse_next(guarded, rules).is_none() {
            return Ok(Ending::Exhausted);
        }
        done += 1;
        if done.is_multiple_of(WATCH_EVERY) {
            watch.check()?;
            let left = guarded.mesh().face_count();
            watch.advance((start - left) as u64, || format!("{left} faces left"));
        }
    }
    Ok(Ending::Target)
}
