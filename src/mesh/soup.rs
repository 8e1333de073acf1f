//! Faces as a file gives them: any topology, triangles and quads mixed.

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::carried::Carried;
use super::id::{Face, IdVec, Vertex, VertexId};

/// A triangle or a quad.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub enum Facet {
    /// Three corners, counter-clockwise seen from outside.
    Tri([VertexId; 3]),
    /// Four corners in order round the face.
    Quad([VertexId; 4]),
}

impl Facet {
    /// The corners in order.
    #[inline]
    pub fn corners(&self) -> &[VertexId] {
        match self {
            Self::Tri(c) => c,
            Self::Quad(c) => c,
        }
    }

    /// The corners in order, for change.
    #[inline]
    pub fn corners_mut(&mut self) -> &mut [VertexId] {
        match self {
            Self::Tri(c) => c,
            Self::Quad(c) => c,
        }
    }
}

/// Points and faces of any topology. Coordinates are finite and corners are in range: readers see to it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Soup {
    /// Coordinates, all finite.
    pub points: IdVec<Vertex, DVec3>,
    /// Faces.
    pub faces: IdVec<Face, Facet>,
    /// Groups, regions, marks, seams, fields.
    pub carried: Carried,
}
