//! Hierarchies from surfaces, and surfaces from hierarchies: what the steps on both ends share.
//!
//! [`build`] mends, optimises and records; [`extract_measured`] cuts a mesh and says what it is worth.
//!
//! Based on: H. Date, S. Kanai, T. Kishinami, I. Nishigaki. Mesh Simplification and Adaptive LOD for Finite Element
//! Mesh Generation, 2005, section 5. The forest itself and its fronts are in [`crate::technique::hierarchy`].

mod build;
mod polish;
mod report;

pub use build::{Recorded, Source, build};
pub use polish::PolishReport;
pub use report::{FrontReport, HierarchyReport, extract_measured};
