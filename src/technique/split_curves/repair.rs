//! Flips beside the new edges that make thin faces better and leave the surface as it is.

use std::collections::BTreeSet;

use crate::mesh::edit::{check_flip, flip};
use crate::mesh::geometry::{area_vector, stretch};
use crate::mesh::halfedge::EnterError;
use crate::mesh::{EdgeId, FreedomError, HalfedgeMesh, LockRules, Surface, resolve_freedom};

/// Two faces count as one plane if their quadrilateral, cut either way, differs in area by less than this share: the
/// share is half the square of the angle between them, so this is a thousandth of a degree.
const FLAT: f64 = 1e-10;
/// A flip must raise the worse face by this factor, so that rounding never flips back and forth.
const GAIN: f64 = 1.0 + 1e-6;

/// Why the surface cannot be repaired.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RepairError {
    /// It is no surface.
    #[error(transparent)]
    NotASurface(#[from] EnterError),
    /// Its groups contradict each other.
    #[error(transparent)]
    Freedom(#[from] FreedomError),
}

/// Flips edges of flat pairs of faces at the vertices from number `first` on while the worse face gets better; marked
/// edges, groups and regions stay. Faces keep their numbers. Returns how many were flipped.
///
/// # Errors
/// See [`RepairError`].
pub fn flip_beside(surface: &mut Surface, first: usize) -> Result<usize, RepairError> {
    let freedom = resolve_freedom(surface, &LockRules::default())?;
    let mut mesh = HalfedgeMesh::new(surface, &freedom)?;
    let is_beside = |mesh: &HalfedgeMesh, e: EdgeId| {
        let apexes = check_flip(mesh, e).map_or([None; 2], |plan| plan.apexes.map(Some));
        mesh.ends(e).into_iter().map(Some).chain(apexes).flatten().any(|v| v.index() >= first)
    };
    let mut waiting: BTreeSet<EdgeId> = mesh.edges().filter(|&e| is_beside(&mesh, e)).collect();
    let mut flips = 0;
    while let Some(e) = waiting.pop_first() {
        let Ok(plan) = check_flip(&mesh, e) else { continue };
        if gains(&mesh, &plan) {
            flip(&mut mesh, &plan);
            flips += 1;
            let around = plan.ends.into_iter().chain(plan.apexes).flat_map(|v| mesh.outgoing(v).collect::<Vec<_>>());
            waiting.extend(around.map(crate::mesh::halfedge::edge_of).filter(|&f| f != e && is_beside(&mesh, f)));
        }
    }
    for f in surface.faces.ids() {
        surface.faces[f] = mesh.corners(f);
    }
    Ok(flips)
}

/// Whether both diagonals make the same flat quadrilateral, and the other one has the better worst face.
fn gains(mesh: &HalfedgeMesh, plan: &crate::mesh::edit::FlipPlan) -> bool {
    let ([i, j], [c, d]) = (plan.ends, plan.apexes);
    let at = |corners: [crate::mesh::VertexId; 3]| corners.map(|v| mesh.point(v));
    let (old, new) = ([at([i, j, c]), at([j, i, d])], plan.new_faces().map(at));
    let area = |faces: &[[glam::DVec3; 3]; 2]| faces.iter().map(|f| area_vector(*f).length()).sum::<f64>();
    let whole = (area_vector(old[0]) + area_vector(old[1])).length();
    let flat = |faces| area(faces) <= (1.0 + FLAT) * whole;
    let worst = |faces: &[[glam::DVec3; 3]; 2]| stretch(faces[0]).min(stretch(faces[1]));
    whole > 0.0 && flat(&old) && flat(&new) && worst(&new) > GAIN * worst(&old)
}
