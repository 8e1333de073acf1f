//! Changing the resolution of a surface: recording collapses, and moving a front through the vertex forest.
//!
//! A *front* is a set of nodes, exactly one on each path from a root to a leaf; its nodes are the vertices of a mesh.
//! Splitting a node replaces it by its children, merging does the reverse.
//!
//! Based on: H. Date, S. Kanai, T. Kishinami, I. Nishigaki. *Mesh simplification and adaptive LOD for finite element
//! mesh generation*, Computer-Aided Design and Applications, 2005, section 5; H. Hoppe, *View-dependent refinement of
//! progressive meshes*, SIGGRAPH 1997.
//!
//! # Why every front is a mesh
//! A split or merge is legal when its nodes and its whole ring are on the front. Every triangle a collapse makes
//! contains the new vertex, and a later collapse that touches such a triangle collapses the vertex or a ring node. So
//! "all on the front" says that no collapse that depends on this one is applied, or that all those it depends on are;
//! each reachable front is closed under that order and is the mesh that a replay of its merges gives. Only triangles
//! that occurred when the collapses were recorded appear, which is why thresholds of stretch and size that held then
//! hold on every front, and the valence of a vertex never exceeds what it was when the vertex came to be. Fold-over
//! between two neighbouring triangles and distance are *not* inherited: callers measure them on what they extract.
//!
//! # Invariants
//! - The finest front is the input bit for bit; split and merge undo each other.
//! - Euler characteristic and boundary loops are the same on every front.

mod criteria;
mod extract;
mod front;
mod record;

pub use criteria::{Density, Thresholds, curvature_thresholds, region_thresholds};
pub use extract::extract;
pub use front::Front;
pub use record::Recorder;

#[cfg(test)]
mod tests;
