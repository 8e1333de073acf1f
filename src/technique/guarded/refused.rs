//! Why an edit is refused.

use crate::mesh::edit::Refusal;

/// The first test that is against an edit, in the order of the tests where one has several.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, thiserror::Error)]
pub enum Refused {
    /// The plan was made before the last edit or plan.
    #[error("the plan is out of date")]
    Outdated,
    /// The surface would change its topology, or there is no such element.
    #[error("the surface would change its topology")]
    Topology,
    /// Marked curves, their corners, seams, groups, regions or locks stay.
    #[error("marked, grouped or locked elements stay")]
    Features,
    /// A vertex would have too many edges.
    #[error("a vertex would have too many edges")]
    Valence,
    /// More faces would change than a transaction holds, or others than those of the part that is worked on.
    #[error("too many faces would change at once")]
    Extent,
    /// All thresholds hold, but the edit does not gain what was asked of it.
    #[error("the edit gains too little")]
    Gain,
    /// A face would be worse than the least stretch and than what was there, or too large.
    #[error("a face would be too poor or too large")]
    Shape,
    /// A face would turn over, or too far.
    #[error("a face would turn over")]
    FoldOver,
    /// A marked curve would move too far.
    #[error("a marked curve would move too far")]
    Curves,
    /// The surface would leave the tolerance.
    #[error("the surface would leave the tolerance")]
    Tolerance,
    /// Faces would intersect.
    #[error("faces would intersect")]
    Intersection,
}

impl From<Refusal> for Refused {
    fn from(refusal: Refusal) -> Self {
        match refusal {
            Refusal::Boundary | Refusal::LinkCondition { .. } | Refusal::FourFaces | Refusal::DuplicateEdge { .. } => {
                Self::Topology
            }
            Refusal::Freedom { .. }
            | Refusal::MarkedEdge { .. }
            | Refusal::CurveLink { .. }
            | Refusal::GroupBorder { .. }
            | Refusal::GroupVanishes => Self::Features,
        }
    }
}
