//! Relocation: a free vertex goes elsewhere. Vertices on curves and kept ones stay. Cost: O(valence).

use glam::DVec3;

use super::Refusal;
use crate::mesh::carried::Freedom;
use crate::mesh::halfedge::HalfedgeMesh;
use crate::mesh::id::VertexId;

/// Whether the vertex may move.
///
/// # Errors
/// [`Refusal::Freedom`] for a vertex that is not free.
pub fn check_relocate(mesh: &HalfedgeMesh, vertex: VertexId) -> Result<(), Refusal> {
    match mesh.vertex_freedom(vertex) {
        Freedom::Free => Ok(()),
        Freedom::OnCurve | Freedom::Keep => Err(Refusal::Freedom { vertex }),
    }
}

/// Moves a vertex if it may move.
///
/// # Errors
/// See [`check_relocate`]; nothing has moved then.
pub fn relocate(mesh: &mut HalfedgeMesh, vertex: VertexId, to: DVec3) -> Result<(), Refusal> {
    check_relocate(mesh, vertex)?;
    mesh.points[vertex] = to;
    mesh.bump_star(vertex);
    Ok(())
}

/// Moves a vertex along its curve. That the new place lies on the curve is the caller's to see to.
///
/// # Errors
/// [`Refusal::Freedom`] for a vertex that is free or kept; nothing has moved then.
pub fn slide(mesh: &mut HalfedgeMesh, vertex: VertexId, to: DVec3) -> Result<(), Refusal> {
    if mesh.vertex_freedom(vertex) != Freedom::OnCurve {
        return Err(Refusal::Freedom { vertex });
    }
    mesh.points[vertex] = to;
    mesh.bump_star(vertex);
    Ok(())
}
