//! Criteria as texts: tables of a recipe or of a file of their own, and the files of other programs.
//!
//! A table names metrics of elements ([`crate::metric::element`]), each with its levels ideal, good, warn, fail and
//! worst, a `weight`, and whether it is `on`. It may have `params` of its own, which its expressions use, so that one
//! file serves every size of element. What the levels mean is told in [`crate::metric::gate::criteria`].

pub mod import;
mod read;

pub use read::{LEVEL_KEYS, OWN_KEYS, read};
