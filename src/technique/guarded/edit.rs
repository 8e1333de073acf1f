//! An edit by the vertices it names, so that it can be done on a copy and then on the mesh.

use glam::DVec3;
use smallvec::SmallVec;

use super::refused::Refused;
use crate::mesh::edit::{
    check_collapse, check_flip, check_relocate, check_split, collapse, flip, relocate, slide, split,
};
use crate::mesh::halfedge::{HalfedgeMesh, edge_of};
use crate::mesh::{EdgeId, FaceId, Freedom, VertexId};

/// An edit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Edit {
    /// The ends become one vertex at `to`.
    Collapse {
        /// The ends.
        ends: [VertexId; 2],
        /// Where; on a curve or at a kept vertex what is admitted nearest to it.
        to: DVec3,
    },
    /// The edge becomes the other diagonal.
    Flip {
        /// Its ends.
        ends: [VertexId; 2],
    },
    /// The edge gets a vertex.
    Split {
        /// Its ends.
        ends: [VertexId; 2],
        /// Where.
        at: DVec3,
    },
    /// The vertex goes elsewhere.
    Move {
        /// The vertex.
        vertex: VertexId,
        /// Where to.
        to: DVec3,
    },
}

/// What an edit did.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Done {
    /// Two vertices became one.
    Merged { gone: VertexId, kept: VertexId },
    /// A vertex is new.
    Made(VertexId),
    /// An edge was flipped.
    Flipped,
    /// A vertex was moved.
    Moved,
}

/// The faces that an edit changes or removes.
pub(super) type Touched = SmallVec<[FaceId; 24]>;

impl Edit {
    /// The vertices that it names.
    pub(super) fn named(&self) -> SmallVec<[VertexId; 2]> {
        match *self {
            Self::Collapse { ends, .. } | Self::Flip { ends } | Self::Split { ends, .. } => SmallVec::from(ends),
            Self::Move { vertex, .. } => SmallVec::from_slice(&[vertex]),
        }
    }

    /// The same edit under other numbers; `None` where a vertex has none.
    pub(super) fn renumbered(self, number: impl Fn(VertexId) -> Option<VertexId>) -> Option<Self> {
        let both = |[a, b]: [VertexId; 2]| Some([number(a)?, number(b)?]);
        Some(match self {
            Self::Collapse { ends, to } => Self::Collapse { ends: both(ends)?, to },
            Self::Flip { ends } => Self::Flip { ends: both(ends)? },
            Self::Split { ends, at } => Self::Split { ends: both(ends)?, at },
            Self::Move { vertex, to } => Self::Move { vertex: number(vertex)?, to },
        })
    }

    /// The faces that it changes.
    ///
    /// # Errors
    /// Where topology or freedom forbid it.
    pub(super) fn touched(self, mesh: &HalfedgeMesh) -> Result<Touched, Refused> {
        let mut faces = Touched::new();
        match self {
            Self::Collapse { ends, .. } => {
                check_collapse(mesh, edge(mesh, ends)?)?;
                faces.extend(ends.into_iter().flat_map(|v| mesh.faces_around(v)));
            }
            Self::Flip { ends } => {
                check_flip(mesh, edge(mesh, ends)?)?;
                faces.extend(sides(mesh, ends));
            }
            Self::Split { ends, .. } => {
                check_split(mesh, edge(mesh, ends)?)?;
                faces.extend(sides(mesh, ends));
            }
            Self::Move { vertex, .. } => {
                if mesh.vertex_freedom(vertex) != Freedom::OnCurve {
                    check_relocate(mesh, vertex)?;
                }
                faces.extend(mesh.faces_around(vertex));
            }
        }
        faces.sort_unstable();
        faces.dedup();
        Ok(faces)
    }

    /// Does it.
    ///
    /// # Errors
    /// Where topology or freedom forbid it.
    pub(super) fn apply(self, mesh: &mut HalfedgeMesh) -> Result<Done, Refused> {
        Ok(match self {
            Self::Collapse { ends, to } => {
                let plan = check_collapse(mesh, edge(mesh, ends)?)?;
                collapse(mesh, &plan, to);
                Done::Merged { gone: plan.removed, kept: plan.kept }
            }
            Self::Flip { ends } => {
                let plan = check_flip(mesh, edge(mesh, ends)?)?;
                flip(mesh, &plan);
                Done::Flipped
            }
            Self::Split { ends, at } => {
                let plan = check_split(mesh, edge(mesh, ends)?)?;
                Done::Made(split(mesh, &plan, at))
            }
            Self::Move { vertex, to } => {
                match mesh.vertex_freedom(vertex) {
                    Freedom::OnCurve => slide(mesh, vertex, to),
                    Freedom::Free | Freedom::Keep => relocate(mesh, vertex, to),
                }?;
                Done::Moved
            }
        })
    }
}

fn edge(mesh: &HalfedgeMesh, [a, b]: [VertexId; 2]) -> Result<EdgeId, Refused> {
    mesh.find_halfedge(a, b).map(edge_of).ok_or(Refused::Topology)
}

fn sides(mesh: &HalfedgeMesh, [a, b]: [VertexId; 2]) -> impl Iterator<Item = FaceId> {
    let side = |a, b| mesh.find_halfedge(a, b).and_then(|h| mesh.face(h));
    [side(a, b), side(b, a)].into_iter().flatten()
}
