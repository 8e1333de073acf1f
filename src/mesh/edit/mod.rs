//! Edits of the workshop: collapse, flip, split and relocate, each checked before it is applied.
//!
//! A check reads the star of an edge and answers with a plan or a [`Refusal`]; applying a plan that was checked on the
//! mesh as it is cannot fail. Topology and freedom are enforced here, for every caller; geometry (quality, tolerance,
//! foldover) is the caller's. All checks and edits cost O(star) and allocate only for stars of more than 16 vertices.

pub mod collapse;
pub mod flip;
pub mod merge_face;
pub mod relocate;
pub mod split;
#[cfg(test)]
mod tests;

use super::id::{EdgeId, VertexId};

pub use collapse::{CollapsePlan, Placement, Ring, check_collapse, collapse};
pub use flip::{FlipPlan, check_flip, flip};
pub use relocate::{check_relocate, relocate, slide};
pub use split::{SplitPlan, check_split, check_split_of_copy, split, split_copies};

/// Why an edit is not done.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Refusal {
    /// A vertex outside the edge's triangles is joined to both ends: the result would be no 2-manifold.
    #[error("vertex {common} is joined to both ends of the edge")]
    LinkCondition {
        /// The vertex in between.
        common: VertexId,
    },
    /// Both ends lie on rims and the edge does not: the result would pinch the surface.
    #[error("the edge joins two rims through the inside")]
    Boundary,
    /// The closed component has only four faces, or the open one only one.
    #[error("the component has no faces to spare")]
    FourFaces,
    /// A vertex or edge may not change in this way.
    #[error("vertex {vertex} may not change in this way")]
    Freedom {
        /// The stricter vertex.
        vertex: VertexId,
    },
    /// The edge itself is marked.
    #[error("edge {edge} is marked")]
    MarkedEdge {
        /// The edge.
        edge: EdgeId,
    },
    /// A marked curve would be folded onto itself or onto another one.
    #[error("the curve through edge {edge} would lose a side")]
    CurveLink {
        /// The edge.
        edge: EdgeId,
    },
    /// The edge that the flip makes exists.
    #[error("the edge between {} and {} exists", ends[0], ends[1])]
    DuplicateEdge {
        /// Its ends.
        ends: [VertexId; 2],
    },
    /// The faces of the edge belong to different groups or regions.
    #[error("edge {edge} is the border of a group or region")]
    GroupBorder {
        /// The edge.
        edge: EdgeId,
    },
    /// The last element of a group or region would go.
    #[error("a group or region would lose its last element")]
    GroupVanishes,
}
