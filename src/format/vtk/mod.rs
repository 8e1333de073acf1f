//! Legacy VTK.

mod describe;
pub(super) mod model;
