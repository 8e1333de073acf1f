//! What a cavity in a mesh of quads can be filled with, and where the new nodes lie.
//!
//! [`Outline`] finds quads over a loop of nodes with as few irregular nodes as its corners allow; [`Flat`] lays what
//! the cavity holds flat, so that nodes of the new [`Pattern`] are found on it.
//!
//! Based on: G. Bunin. Non-local topological clean-up. 15th International Meshing Roundtable, 2006.

mod flat;
mod outline;
mod pattern;

pub use flat::Flat;
pub use outline::{Cut, Faces, Outline};
pub use pattern::Pattern;

use crate::mesh::VertexId;

/// A node of a filling that is not there yet.
pub fn new_node(number: usize) -> VertexId {
    VertexId::from_raw(u32::MAX - 1 - number as u32)
}

/// Whether a node is one that is not there yet.
pub fn is_new(v: VertexId) -> bool {
    v.raw() > u32::MAX / 2
}
