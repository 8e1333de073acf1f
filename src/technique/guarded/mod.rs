//! A mesh under guard: every edit that passes keeps thresholds, tolerance, topology, freedom and embedding.
//!
//! [`GuardedMesh`] is the one door: collapse, flip, split, relocate, merge, and transactions of several edits, each
//! admitted as a whole or [`Refused`] with its reason. Nothing outside this folder reaches the mesh but through these
//! verbs, so the guarantee rests on this folder alone: thresholds (`limits`), the tolerance (`keeper`, with the
//! certified two-sided distance in `certificate`), new self-intersections (`collision`), and topology and freedom by
//! [`crate::mesh::edit`]. What is worth doing, and in which order, is for others to say.

mod boxes;
mod certificate;
mod collapse;
mod collision;
mod copy_out;
mod corners;
mod edit;
mod flip;
mod gain;
mod hand_over;
mod keeper;
mod limits;
mod merge;
mod mesh;
mod normals;
mod open;
mod patch;
mod pen;
mod quadrics;
mod recount;
mod refused;
mod relocate;
mod split;
mod star;
mod tally;
mod tie;
mod ties;
mod transaction;

pub use collapse::{Collapse, Place, Site};
pub use edit::Edit;
pub use gain::Gain;
pub use keeper::Curves;
pub use limits::{Limits, SizeField, StarRules};
pub use merge::Merge;
pub use mesh::{Counts, GuardedMesh};
pub use open::{Setup, diagonal, open, open_part, reference_tree};
pub use pen::Pen;
pub use quadrics::Gathered;
pub use recount::{Cause, Recount, Threshold, Violation, cause, recount};
pub use refused::Refused;
pub use tally::Tally;
pub use transaction::{Draft, Trial};
