//! Finds every defect of a mesh and returns them as data.
//!
//! A soup may have any topology, so its topological defects are findings; in a surface each is a fault of whoever made
//! it. Defects come in a fixed order: points, faces, edges, vertices, then what the mesh carries.
//! Cost: O(n log n).

mod carried;
#[cfg(test)]
mod tests;
mod topology;
mod workshop;

use super::carried::{SeamId, Support};
use super::id::{FaceId, VertexId};
use super::soup::Soup;
use super::surface::Surface;

pub use workshop::{WorkshopDefect, validate_workshop};

/// What a group holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GroupKind {
    /// Faces.
    Faces,
    /// Edges.
    Edges,
    /// Vertices.
    Vertices,
}

/// One thing wrong with a mesh.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Defect {
    /// A coordinate is infinite or not a number.
    #[error("vertex {vertex} has a coordinate that is not finite")]
    NonFinitePoint {
        /// The vertex.
        vertex: VertexId,
    },
    /// A face names a vertex that does not exist.
    #[error("face {face} has the corner {corner}, which does not exist")]
    CornerOutOfRange {
        /// The face.
        face: FaceId,
        /// The missing vertex.
        corner: VertexId,
    },
    /// A face has the same corner twice.
    #[error("face {face} has the corner {corner} twice")]
    RepeatedCorner {
        /// The face.
        face: FaceId,
        /// The lowest such corner.
        corner: VertexId,
    },
    /// Faces have the same corners, in whatever order.
    #[error("{} faces have the same corners: {faces:?}", faces.len())]
    DuplicateFaces {
        /// The faces.
        faces: Vec<FaceId>,
    },
    /// More than two faces share an edge.
    #[error("{} faces meet at the edge {} {}", faces.len(), ends[0], ends[1])]
    NonManifoldEdge {
        /// The ends of the edge.
        ends: [VertexId; 2],
        /// The faces.
        faces: Vec<FaceId>,
    },
    /// Two faces run along their common edge in the same direction.
    #[error("faces {} and {} are oriented against each other", faces[0], faces[1])]
    InconsistentOrientation {
        /// The ends of the edge.
        ends: [VertexId; 2],
        /// The faces.
        faces: [FaceId; 2],
    },
    /// The faces round a vertex form several fans.
    #[error("the faces at vertex {vertex} form {fans} fans")]
    NonFanVertex {
        /// The vertex.
        vertex: VertexId,
        /// How many fans.
        fans: usize,
    },
    /// No face uses the vertex.
    #[error("no face uses vertex {vertex}")]
    UnusedVertex {
        /// The vertex.
        vertex: VertexId,
    },
    /// A group's members are not sorted, or one comes twice.
    #[error("the members of group `{name}` are not sorted without repeats")]
    UnsortedGroup {
        /// What it holds.
        kind: GroupKind,
        /// Its name.
        name: String,
    },
    /// A group names an element that does not exist.
    #[error("group `{name}` has {count} members that do not exist")]
    GroupMembersMissing {
        /// What it holds.
        kind: GroupKind,
        /// Its name.
        name: String,
        /// How many.
        count: usize,
    },
    /// Not one region label a face.
    #[error("{labels} region labels for {faces} faces")]
    RegionLabelCount {
        /// Labels there are.
        labels: usize,
        /// Faces there are.
        faces: usize,
    },
    /// A region label without a name.
    #[error("face {face} has the region label {label}, which has no name")]
    UnknownRegion {
        /// The face.
        face: FaceId,
        /// Its label.
        label: u32,
    },
    /// A field does not have one value a component and element.
    #[error("field `{name}` has {found} values and should have {expected}")]
    FieldLength {
        /// Its name.
        name: String,
        /// Where it sits.
        support: Support,
        /// Values it should have.
        expected: usize,
        /// Values it has.
        found: usize,
    },
    /// Fields are not sorted by support and name, or one comes twice.
    #[error("the fields are not sorted without repeats")]
    UnsortedFields,
    /// A mark on what is no edge of the mesh.
    #[error("a mark sits on {} {}, which is no edge", ends[0], ends[1])]
    MarkWithoutEdge {
        /// The ends of the mark.
        ends: [VertexId; 2],
    },
    /// A pin on a vertex that does not exist.
    #[error("a pin sits on vertex {vertex}, which does not exist")]
    PinWithoutVertex {
        /// The vertex.
        vertex: VertexId,
    },
    /// A point of a curve on what is no vertex or edge of the mesh, or at no place inside its edge.
    #[error("point {point} of curve {curve} lies on no vertex and inside no edge")]
    CurveOffTheSurface {
        /// The curve's number.
        curve: usize,
        /// The point's number.
        point: usize,
    },
    /// Neighbouring points of a curve that share no face.
    #[error("curve {curve} leaves the surface between its points {point} and the next")]
    CurveLeavesTheSurface {
        /// The curve's number.
        curve: usize,
        /// The number of the point before.
        point: usize,
    },
    /// A seam id that only one vertex has, or that a missing vertex has.
    #[error("vertex {vertex} has the seam id {}, which no other vertex has", seam.0)]
    SeamWithoutPartner {
        /// The vertex.
        vertex: VertexId,
        /// Its seam.
        seam: SeamId,
    },
}

/// All defects of a soup.
pub fn validate_soup(soup: &Soup) -> Vec<Defect> {
    let mut defects = Vec::new();
    topology::points(&soup.points, &mut defects);
    let edges = topology::validate(soup, &mut defects);
    carried::validate(&soup.carried, soup, edges.as_ref(), &mut defects);
    defects
}

/// All defects of a surface; none, if it keeps its promise.
pub fn validate_surface(surface: &Surface) -> Vec<Defect> {
    let mut defects = Vec::new();
    topology::points(&surface.points, &mut defects);
    let edges = topology::validate(surface, &mut defects);
    carried::validate(&surface.carried, surface, edges.as_ref(), &mut defects);
    defects
}
