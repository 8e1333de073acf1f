//! An oriented 2-manifold triangle mesh, perhaps with boundary: what the steps work on.

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::carried::Carried;
use super::id::{Face, FaceId, IdVec, Vertex, VertexId};
use super::soup::{Facet, Soup};

/// An oriented 2-manifold triangle mesh. Only `repair` makes one from a soup; every step keeps it one.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Surface {
    /// Coordinates, all finite; every vertex is used by a face.
    pub points: IdVec<Vertex, DVec3>,
    /// Corners of each face, counter-clockwise seen from outside.
    pub faces: IdVec<Face, [VertexId; 3]>,
    /// Groups, regions, marks, seams, fields.
    pub carried: Carried,
}

impl Surface {
    /// The coordinates of a face's corners.
    #[inline]
    pub fn corners(&self, face: FaceId) -> [DVec3; 3] {
        self.faces[face].map(|v| self.points[v])
    }

    /// A hash of points and faces, whatever the mesh carries: what a [`Cover`](super::Cover) names its surface by.
    ///
    /// Little endian, bit for bit; equal on every machine.
    pub fn shape_hash(&self) -> [u8; 32] {
        let mut hasher = blake3::Hasher::new();
        hasher.update(&(self.points.len() as u64).to_le_bytes());
        for point in &self.points {
            hasher.update(&point.to_array().map(f64::to_le_bytes).concat());
        }
        for corners in &self.faces {
            hasher.update(&corners.map(|v| v.raw().to_le_bytes()).concat());
        }
        *hasher.finalize().as_bytes()
    }

    /// The same mesh as a soup: what writers and metrics take.
    pub fn to_soup(&self) -> Soup {
        Soup {
            points: self.points.clone(),
            faces: self.faces.iter().map(|&c| Facet::Tri(c)).collect(),
            carried: self.carried.clone(),
        }
    }
}
