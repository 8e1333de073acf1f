//! A quad-dominant mesh made of a surface, and which of that surface's faces each element stands for.

use serde::{Deserialize, Serialize};

use super::id::{Face, FaceId, IdVec};
use super::soup::Soup;

/// Quads, perhaps with some triangles: oriented and manifold, perhaps with boundary. The steps that make it see to it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Quads {
    /// Points, elements and what they carry.
    pub mesh: Soup,
    /// What each element covers, where the step that made it knows.
    pub cover: Option<Cover>,
}

/// A partition of a surface's faces among the elements of a [`Quads`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Cover {
    /// The [`shape_hash`](super::Surface::shape_hash) of the covered surface.
    pub surface: [u8; 32],
    /// Where that surface was too coarse: its faces that were cut in four before it was covered, round by round, each
    /// round numbered as the round before left them. Empty where it was fine enough.
    pub cuts: Vec<Vec<FaceId>>,
    /// For each element the faces it covers, in rising order; every face of the surface, after these cuts, occurs once.
    pub faces: IdVec<Face, Vec<FaceId>>,
}
