//! Which pieces bound solids or are sheets, and which go.

use super::Piece;
use super::cells::{Body, Complex, Windings};
use super::snap::Mesh;
use crate::mesh::Surface;
use crate::mesh::geometry::Aabb;
use crate::mesh::topology::{EdgeTable, components};

/// A face of the result: nodes, and the face of the mesh that it is a part of.
pub(super) type Chosen = ([u32; 3], u32);

/// What stays, and what goes.
#[derive(Debug, Default)]
pub(super) struct Choice {
    pub(super) kept: Vec<Chosen>,
    pub(super) removed: Vec<Chosen>,
}

/// Keeps pieces between inside and outside, looking outward, and one of each pile of sheets. What is connected with no
/// face that was cut stays.
pub(super) fn choose(complex: &Complex<'_>, windings: &Windings) -> Choice {
    let mut choice = Choice::default();
    for (piece, winding) in complex.pieces.iter().zip(windings) {
        let Some([before, behind]) = *winding else {
            choice.kept.extend(piece.members.iter().map(|&(f, sign)| (looking(piece, sign > 0), f)));
            continue;
        };
        let stays = match (before >= 1, behind >= 1) {
            (false, true) => Some(true),
            (true, false) => Some(false),
            _ => None,
        };
        let of_sign = |along: bool| piece.members.iter().find(|(_, sign)| (*sign > 0) == along);
        let sheet = piece.members.iter().find(|(f, _)| !complex.is_solid[*f as usize]);
        let kept = match (stays, sheet) {
            (Some(along), _) => of_sign(along).or(piece.members.first()).map(|member| (along, member)),
            (None, Some(member)) => Some((member.1 > 0, member)),
            (None, None) => None,
        };
        choice.kept.extend(kept.map(|(along, member)| (looking(piece, along), member.0)));
        let gone = piece.members.iter().filter(|&member| kept.is_none_or(|(_, stays)| stays != member));
        choice.removed.extend(gone.map(|&(f, sign)| (looking(piece, sign > 0), f)));
    }
    choice
}

fn looking(piece: &Piece, along: bool) -> [u32; 3] {
    let [a, b, c] = piece.corners;
    if along { [a, b, c] } else { [a, c, b] }
}

/// Which faces are part of a closed component.
pub(super) fn closed_faces(surface: &Surface) -> Vec<bool> {
    let parts = components(surface);
    let mut is_closed = vec![true; parts.count];
    for (_, _, sides) in EdgeTable::new(surface).iter().filter(|(.., sides)| sides.len() != 2) {
        for side in sides {
            is_closed[parts.of_face[side.face] as usize] = false;
        }
    }
    parts.of_face.iter().map(|&part| is_closed[part as usize]).collect()
}

/// The closed components, with the faces that are left of them.
pub(super) fn bodies(surface: &Surface, mesh: &Mesh) -> Vec<Body> {
    let (parts, is_closed) = (components(surface), closed_faces(surface));
    let mut bodies: Vec<Body> = (0..parts.count).map(|_| Body { bounds: Aabb::EMPTY, faces: Vec::new() }).collect();
    for (f, &origin) in mesh.origin.iter().enumerate().filter(|(_, origin)| is_closed[**origin as usize]) {
        let body = &mut bodies[parts.of_face.as_slice()[origin as usize] as usize];
        let corners = mesh.triangle(f as u32);
        body.bounds = corners.into_iter().fold(body.bounds, Aabb::with);
        body.faces.push((f as u32, corners));
    }
    bodies.retain(|body| !body.faces.is_empty());
    bodies
}
