//! An edit by the vertices it touches, so that it can be done on a copy and then in the workshop.

use glam::DVec3;
use smallvec::SmallVec;

use crate::mesh::edit::{
    check_collapse, check_flip, check_relocate, check_split, collapse, flip, relocate, slide, split,
};
use crate::mesh::halfedge::{HalfedgeMesh, edge_of};
use crate::mesh::{EdgeId, FaceId, Freedom, VertexId};

/// An edit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Edit {
    /// The ends become one vertex at `to`.
    Collapse { ends: [VertexId; 2], to: DVec3 },
    /// The edge becomes the other diagonal.
    Flip { ends: [VertexId; 2] },
    /// The edge gets a vertex.
    Split { ends: [VertexId; 2], at: DVec3 },
    /// The vertex goes elsewhere.
    Move { vertex: VertexId, to: DVec3 },
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
    /// The same edit under other numbers.
    pub(super) fn renumbered(self, number: impl Fn(VertexId) -> VertexId) -> Self {
        match self {
            Self::Collapse { ends, to } => Self::Collapse { ends: ends.map(number), to },
            Self::Flip { ends } => Self::Flip { ends: ends.map(number) },
            Self::Split { ends, at } => Self::Split { ends: ends.map(number), at },
            Self::Move { vertex, to } => Self::Move { vertex: number(vertex), to },
        }
    }

    /// The vertex that it moves.
    pub(super) fn vertex(self) -> Option<VertexId> {
        match self {
            Self::Move { vertex, .. } => Some(vertex),
            Self::Collapse { .. } | Self::Flip { .. } | Self::Split { .. } => None,
        }
    }

    /// The faces that it changes; `None` where topology or freedom forbid it.
    pub(super) fn touched(self, mesh: &HalfedgeMesh) -> Option<Touched> {
        let mut faces = Touched::new();
        match self {
            Self::Collapse { ends, .. } => {
                check_collapse(mesh, edge(mesh, ends)?).ok()?;
                faces.extend(ends.into_iter().flat_map(|v| mesh.faces_around(v)));
            }
            Self::Flip { ends } => {
                check_flip(mesh, edge(mesh, ends)?).ok()?;
                faces.extend(sides(mesh, ends));
            }
            Self::Split { ends, .. } => {
                check_split(mesh, edge(mesh, ends)?).ok()?;
                faces.extend(sides(mesh, ends));
            }
            Self::Move { vertex, .. } => {
                if mesh.vertex_freedom(vertex) != Freedom::OnCurve {
                    check_relocate(mesh, vertex).ok()?;
                }
                faces.extend(mesh.faces_around(vertex));
            }
        }
        faces.sort_unstable();
        faces.dedup();
        Some(faces)
    }

    /// Does it; `None` where topology or freedom forbid it.
    pub(super) fn apply(self, mesh: &mut HalfedgeMesh) -> Option<Done> {
        Some(match self {
            Self::Collapse { ends, to } => {
                let plan = check_collapse(mesh, edge(mesh, ends)?).ok()?;
                collapse(mesh, &plan, to);
                Done::Merged { gone: plan.removed, kept: plan.kept }
            }
            Self::Flip { ends } => {
                let plan = check_flip(mesh, edge(mesh, ends)?).ok()?;
                flip(mesh, &plan);
                Done::Flipped
            }
            Self::Split { ends, at } => {
                let plan = check_split(mesh, edge(mesh, ends)?).ok()?;
                Done::Made(split(mesh, &plan, at))
            }
            Self::Move { vertex, to } => {
                match mesh.vertex_freedom(vertex) {
                    Freedom::OnCurve => slide(mesh, vertex, to),
                    Freedom::Free | Freedom::Keep => relocate(mesh, vertex, to),
                }
                .ok()?;
                Done::Moved
            }
        })
    }
}

fn edge(mesh: &HalfedgeMesh, [a, b]: [VertexId; 2]) -> Option<EdgeId> {
    mesh.find_halfedge(a, b).map(edge_of)
}

fn sides(mesh: &HalfedgeMesh, [a, b]: [VertexId; 2]) -> impl Iterator<Item = FaceId> {
    let side = |a, b| mesh.find_halfedge(a, b).and_then(|h| mesh.face(h));
    [side(a, b), side(b, a)].into_iter().flatten()
}
