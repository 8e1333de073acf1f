//! Edge collapse with exchangeable placement, validity and priority: the simplification behind quality improvement and
//! property control.
//!
//! The loop of figure 7 of the paper: positions, valid edges, priorities, collapse, until the target is reached or no
//! edge is valid.
//!
//! Based on: H. Date, S. Kanai, T. Kishinami, I. Nishigaki, T. Dohi. High-Quality and Property Controlled Finite Element
//! Mesh Generation From Triangular Meshes using the Multiresolution Technique. JCISE 5(4), 2005, section 5.
//!
//! Invariants: every accepted collapse keeps thresholds ([`limits`]), tolerance ([`keeper`]), topology and freedom
//! ([`crate::mesh::edit`]) and makes no new self-intersection ([`collision`]). Equal input gives equal output: ties go
//! to the lowest edge number.
//!
//! Departure: edges are rated when they come to the top of the queue, not whenever their star changes (`queue`); until
//! then an estimate from their length stands for equation 9. On the million triangles of a scan this takes a third of
//! the time, and the mean stretch of the result is higher.
//! Cost: O(F log F), about two ratings a collapse.

mod boxes;
mod clip;
pub mod collision;
mod corners;
mod cover;
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
mod star;
mod target;

use queue::Queue;

use crate::watch::{Cancelled, Watch};

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
    /// No edge is valid any more.
    Exhausted,
}

/// How many collapses pass between two looks at the watch.
const WATCH_EVERY: usize = 512;

/// Collapses valid edges, best first, until `target` faces are left or no edge is valid.
pub fn simplify(
    editor: &mut Editor<'_>,
    rules: &CollapseRules,
    target: usize,
    watch: &Watch,
) -> Result<Ending, Cancelled> {
    let start = editor.mesh().face_count();
    watch.phase("collapse", Some(start.saturating_sub(target) as u64));
    let mut queue = Queue::new(editor, rules, watch)?;
    let mut done = 0_usize;
    while editor.mesh().face_count() > target {
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
