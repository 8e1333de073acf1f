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
//! Departure: after a collapse only the edges at the merged vertex are rated at once; edges further out that wait in
//! the heap are rated when they come to its top. Sizes only grow, so a waiting rating is nearly always too high, and
//! the order is the printed one up to the rare edge whose rating rose.
//! Cost: O(F log F), about 20 ratings a collapse.

pub mod collision;
mod corners;
pub mod editor;
pub mod envelope;
pub mod keeper;
pub mod limits;
pub mod merge;
pub mod placement;
pub mod priority;
pub mod quadrics;
pub mod session;

use crate::mesh::{EdgeId, VertexId};
use crate::technique::heap::IndexedHeap;
use crate::watch::{Cancelled, Watch};

pub use editor::{CollapseRules, Counts, Editor};
pub use envelope::Envelope;
pub use keeper::{Curves, Keeper};
pub use limits::{Limits, SizeField};
pub use merge::Merge;
pub use placement::Order;
pub use priority::Priority;

use crate::mesh::halfedge::edge_of;

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
        let Some(edge) = queue.pop_valid(editor, rules) else { return Ok(Ending::Exhausted) };
        done += 1;
        if done.is_multiple_of(WATCH_EVERY) {
            watch.check()?;
            let left = editor.mesh().face_count();
            watch.advance((start - left) as u64, || format!("{left} faces left"));
        }
        if let Some(merged) = editor.try_collapse(edge, rules) {
            queue.refresh(editor, rules, merged);
        }
    }
    Ok(Ending::Target)
}

/// Edges that wait for their collapse.
struct Queue {
    heap: IndexedHeap,
    /// Edges whose star has changed since they were rated.
    stale: Vec<bool>,
    edges: Vec<EdgeId>,
}

impl Queue {
    fn new(editor: &mut Editor<'_>, rules: &CollapseRules, watch: &Watch) -> Result<Self, Cancelled> {
        let slots = editor.mesh().edge_slots();
        let mut heap = IndexedHeap::with_items(slots);
        for edge in (0..slots).map(EdgeId::new) {
            if edge.index().is_multiple_of(4096) {
                watch.check()?;
            }
            if !editor.mesh().edge_is_live(edge) {
                continue;
            }
            if let Some(index) = editor.rate_collapse(edge, rules) {
                heap.set(edge.raw(), index);
            }
        }
        Ok(Self { heap, stale: vec![false; slots], edges: Vec::new() })
    }

    /// The best edge whose rating is up to date.
    fn pop_valid(&mut self, editor: &mut Editor<'_>, rules: &CollapseRules) -> Option<EdgeId> {
        while let Some((item, _)) = self.heap.pop() {
            let edge = EdgeId::from_raw(item);
            if !editor.mesh().edge_is_live(edge) {
                continue;
            }
            if !std::mem::take(&mut self.stale[edge.index()]) {
                return Some(edge);
            }
            let Some(index) = editor.rate_collapse(edge, rules) else { continue };
            if self.heap.peek().is_none_or(|(_, next)| index >= next) {
                return Some(edge);
            }
            self.heap.set(item, index);
        }
        None
    }

    /// Rates the edges whose star the collapse into `merged` has changed.
    fn refresh(&mut self, editor: &mut Editor<'_>, rules: &CollapseRules, merged: VertexId) {
        let mesh = editor.mesh();
        self.edges.clear();
        self.edges.extend(mesh.outgoing(merged).map(edge_of));
        let inner = self.edges.len();
        for v in mesh.neighbours(merged) {
            self.edges.extend(mesh.outgoing(v).map(edge_of));
        }
        for (place, edge) in std::mem::take(&mut self.edges).iter().enumerate() {
            if place >= inner && self.heap.contains(edge.raw()) {
                self.stale[edge.index()] = true;
                continue;
            }
            self.stale[edge.index()] = false;
            match editor.rate_collapse(*edge, rules) {
                Some(index) => self.heap.set(edge.raw(), index),
                None => self.heap.remove(edge.raw()),
            }
        }
    }
}
