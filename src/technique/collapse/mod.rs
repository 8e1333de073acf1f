//! Edge collapse with exchangeable placement, validity and priority: the simplification behind quality improvement and
//! property control.
//!
//! The loop of figure 7 of the paper: positions, valid edges, priorities, collapse, until the target is reached or no
//! edge is valid.
//!
//! Based on: H. Date, S. Kanai, T. Kishinami, I. Nishigaki, T. Dohi. High-Quality and Property Controlled Finite
//! Element Mesh Generation From Triangular Meshes using the Multiresolution Technique. JCISE 5(4), 2005, section 5.
//!
//! Invariants: every accepted collapse keeps thresholds ([`limits`]), tolerance ([`keeper`]), topology and freedom
//! ([`crate::mesh::edit`]) and makes no new self-intersection ([`collision`]). Equal input gives equal output: ties go
//! to the lowest edge number.
//!
//! Departure: edges are rated when they come to the top of the queue, not whenever their star changes (`queue`); until
//! then an estimate from their length stands for equation 9. On the million triangles of a scan this takes a third of
//! the time, and the mean stretch of the result is higher.
//! Cost: O(F log F), about two ratings a collapse.

mod bars;
mod boxes;
mod clip;
pub mod collision;
mod corners;
mod cover;
mod drift;
pub mod editor;
pub mod envelope;
pub mod keeper;
pub mod limits;
pub mod merge;
pub mod placement;
pub mod priority;
pub mod quadrics;
mod queue;
pub mod session;
pub(in crate::technique) mod star;
mod target;

use queue::Queue;

use crate::watch::{Cancelled, Watch};

pub use bars::{Bar, Bars};
pub use editor::{Attempt, CollapseRules, Counts, Editor};
pub use envelope::Envelope;
pub use keeper::{Curves, Keeper};
pub use limits::{Limits, SizeField};
pub use merge::Merge;
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
    editor: &mut Editor<'_>,
    rules: &CollapseRules,
    goal: Goal,
    watch: &Watch,
) -> Result<Ending, Cancelled> {
    let start = editor.mesh().face_count();
    watch.phase("collapse", Some(start.saturating_sub(goal.faces) as u64));
    let mut queue = Queue::new(editor, rules, watch)?;
    let mut done = 0_usize;
    let mut look_at = if goal.mean_stretch > 0.0 { start } else { 0 };
    while editor.mesh().face_count() > goal.faces {
        if editor.mesh().face_count() <= look_at {
            if editor.mean_stretch() < goal.mean_stretch {
                return Ok(Ending::Mean);
            }
            look_at = ((1.0 - LOOK_AT_MEAN) * look_at as f64) as usize;
        }
        if queue.collapse_next(editor, rules).is_none() {
            return Ok(Ending::Exhausted);
        }
        done += 1;
        if done.is_multiple_of(WATCH_EVERY) {
            watch.check()?;
            let left = editor.mesh().face_count();
            watch.advance((start - left) as u64, || format!("{left} faces left"));
        }
    }
    Ok(Ending::Target)
}
