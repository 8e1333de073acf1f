//! The certificate of the distance: both sides of it, and what they cut and measure with.

mod clip;
mod cover;
mod drift;
mod envelope;
mod target;

pub(super) use cover::Change;
pub(super) use drift::Drift;
pub(super) use envelope::Envelope;
