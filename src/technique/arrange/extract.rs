//! Which pieces bound solids or are sheets, and which go.

use smallvec::SmallVec;

use super::Piece;
use super::cells::{Complex, Owners, Shell, solid_angle};
use super::exact::NONE;
use super::snap::Mesh;
use crate::mesh::Surface;
use crate::mesh::bvh::Triangle;
use crate::mesh::geometry::Aabb;
use crate::mesh::topology::{Components, EdgeTable, components};

/// A face of the result: nodes, and the face of the mesh that it is a part of.
pub(super) type Chosen = ([u32; 3], u32);

/// What stays, and what goes.
#[derive(Debug, Default)]
pub(super) struct Choice {
    pub(super) kept: Vec<Chosen>,
    /// The body that each face that stays bounds, or [`NONE`].
    pub(super) body: Vec<u32>,
    pub(super) removed: Vec<Chosen>,
}

/// Keeps pieces between inside and outside, looking outward, those between two bodies once for each, and one of each
/// pile of sheets. What is connected with no face that was cut stays.
pub(super) fn choose(complex: &Complex<'_>, owners: &Owners) -> Choice {
    let mut choice = Choice::default();
    for (piece, owners) in complex.pieces.iter().zip(owners) {
        let Some([before, behind]) = *owners else {
            choice.kept.extend(piece.members.iter().map(|&(f, sign)| (looking(piece, sign > 0), f)));
            choice.body.extend(piece.members.iter().map(|(f, _)| complex.body[*f as usize]));
            continue;
        };
        let mut kept: SmallVec<[usize; 2]> = SmallVec::new();
        for (body, along) in
            [(behind, true), (before, false)].into_iter().filter(|side| before != behind && side.0 != NONE)
        {
            let rank = |i: &usize| {
                let (f, sign) = piece.members[*i];
                ((sign > 0) != along, complex.body[f as usize] != body, *i)
            };
            let Some(member) = (0..piece.members.len()).min_by_key(rank) else { continue };
            choice.kept.push((looking(piece, along), piece.members[member].0));
            choice.body.push(body);
            kept.push(member);
        }
        if kept.is_empty()
            && let Some(sheet) = piece.members.iter().position(|(f, _)| complex.body[*f as usize] == NONE)
        {
            let (f, sign) = piece.members[sheet];
            choice.kept.push((looking(piece, sign > 0), f));
            choice.body.push(NONE);
            kept.push(sheet);
        }
        let gone = piece.members.iter().enumerate().filter(|(i, _)| !kept.contains(i));
        choice.removed.extend(gone.map(|(_, &(f, sign))| (looking(piece, sign > 0), f)));
    }
    choice
}

impl Choice {
    /// Lists the faces of each body together, bodies in order, each face where the one is that it is a part of.
    pub(super) fn sort(&mut self, origin: &[u32]) {
        let mut all: Vec<(u32, Chosen)> = self.body.iter().copied().zip(std::mem::take(&mut self.kept)).collect();
        all.sort_by_key(|&(body, (_, f))| (body, origin[f as usize]));
        (self.body, self.kept) = all.into_iter().unzip();
    }
}

fn looking(piece: &Piece, along: bool) -> [u32; 3] {
    let [a, b, c] = piece.corners;
    if along { [a, b, c] } else { [a, c, b] }
}

/// Which faces are part of a closed component.
fn closed_faces(surface: &Surface) -> Vec<bool> {
    let parts = components(surface);
    let mut is_closed = vec![true; parts.count];
    for (_, _, sides) in EdgeTable::new(surface).iter().filter(|(.., sides)| sides.len() != 2) {
        for side in sides {
            is_closed[parts.of_face[side.face] as usize] = false;
        }
    }
    parts.of_face.iter().map(|&part| is_closed[part as usize]).collect()
}

/// The body of each face, or [`NONE`] for sheets: all closed components together, or each by itself with those that
/// bound cavities in it. Bodies are numbered in the order of their first faces.
pub(super) fn body_of_faces(surface: &Surface, apart: bool) -> Vec<u32> {
    let (parts, is_closed) = (components(surface), closed_faces(surface));
    let of_part = if apart { bodies_apart(surface, &parts, &is_closed) } else { vec![0; parts.count] };
    let body = |(&part, &is_closed): (&u32, &bool)| if is_closed { of_part[part as usize] } else { NONE };
    parts.of_face.iter().zip(&is_closed).map(body).collect()
}

/// The body of each closed component: that of the smallest one round it where it bounds a cavity, else its own.
fn bodies_apart(surface: &Surface, parts: &Components, is_closed: &[bool]) -> Vec<u32> {
    let mut shells: Vec<(Aabb, Vec<Triangle>)> = vec![(Aabb::EMPTY, Vec::new()); parts.count];
    for (f, &part) in parts.of_face.enumerate().filter(|(f, _)| is_closed[f.index()]) {
        let (bounds, faces) = &mut shells[part as usize];
        let corners = surface.corners(f);
        *bounds = corners.into_iter().fold(*bounds, Aabb::with);
        faces.push(corners);
    }
    let volume = |(bounds, faces): &(Aabb, Vec<Triangle>)| -> f64 {
        let cone = |corners: &Triangle| {
            let [a, b, c] = corners.map(|p| p - bounds.min);
            a.dot(b.cross(c))
        };
        faces.iter().map(cone).sum()
    };
    let volumes: Vec<f64> = shells.iter().map(volume).collect();
    let around = |cavity: usize| {
        let point = *shells[cavity].1.first()?.first()?;
        let holds = |&outer: &usize| {
            let (bounds, faces) = &shells[outer];
            let angle = || faces.iter().map(|corners| solid_angle(corners.map(|p| p - point))).sum::<f64>();
            volumes[outer] > -volumes[cavity] && bounds.contains(point) && angle() > std::f64::consts::TAU
        };
        (0..parts.count).filter(holds).min_by(|&a, &b| volumes[a].total_cmp(&volumes[b]))
    };
    (0..parts.count)
        .map(|part| (if volumes[part] < 0.0 { around(part).unwrap_or(part) } else { part }) as u32)
        .collect()
}

/// The closed components, with the faces that are left of them.
pub(super) fn shells(surface: &Surface, mesh: &Mesh, body: &[u32]) -> Vec<Shell> {
    let parts = components(surface);
    let empty = |_| Shell { body: NONE, bounds: Aabb::EMPTY, faces: Vec::new() };
    let mut shells: Vec<Shell> = (0..parts.count).map(empty).collect();
    for (f, &origin) in mesh.origin.iter().enumerate().filter(|(_, origin)| body[**origin as usize] != NONE) {
        let shell = &mut shells[parts.of_face.as_slice()[origin as usize] as usize];
        let corners = mesh.triangle(f as u32);
        shell.body = body[origin as usize];
        shell.bounds = corners.into_iter().fold(shell.bounds, Aabb::with);
        shell.faces.push((f as u32, corners));
    }
    shells.retain(|shell| !shell.faces.is_empty());
    shells
}
