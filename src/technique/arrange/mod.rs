//! A surface that runs through itself, cut where it does, and what bounds its solid.
//!
//! # Algorithm
//! 1. Corners of faces that meet others go to a grid of integers (`snap`).
//! 2. Every two of these faces get the points and segments that they have in common (`meet`), decided and kept
//!    exactly (`exact`, on integers of fixed width, `wide`).
//! 3. Each face is cut along its segments, faces that lie on each other together (`flat`, `triangulate`).
//! 4. The pieces bound cells of space, each with a winding number (`cells`). Bodies are where it is at least one: the
//!    pieces between inside and outside stay, looking outward, and the others go. Where bodies are to stay apart each
//!    has its own number, a cell is of the first body that it is in, and a piece between two bodies bounds both.
//!    Sheets, which have a border, stay as they are, cut along where they pass through others.
//! 5. Points are rounded to floats, which may let pieces meet again: the caller finds out and goes on with a coarser
//!    grid, so that what is closer than that becomes one.
//!
//! Based on: Q. Zhou, E. Grinspun, D. Zorin, A. Jacobson. Mesh arrangements for solid geometry. SIGGRAPH 2016; the way
//! back to floats on S. Lazard, L. Valque. Removing self-intersections in 3D meshes while preserving floating-point
//! coordinates. SGP 2025.
//!
//! # Invariants
//! - Faces that meet none keep their corners bit for bit. Others move by less than the grid's unit.
//! - Before rounding, no two pieces meet but in common corners and edges, and the bodies' boundary is closed.
//! - Scaled by a power of two the result is the same, scaled.
//!
//! # Cost
//! O(n log n) in faces, and in pieces where faces meet; nothing where they do not.
//!
//! # Departures
//! No crate does this for soups: `manifold-rust`, the closest one, takes closed meshes only, does not mend what
//! rounding breaks, and moves the surface when it cleans up.
//!
//! Points are not kept as trees of what they were made from: on a grid their coordinates fit a few machine words.

use smallvec::SmallVec;

use crate::mesh::Surface;
use crate::mesh::geometry::Aabb;
use crate::watch::{Cancelled, Watch};

mod carry;
mod cells;
mod exact;
mod extract;
mod flat;
mod meet;
mod sets;
mod snap;
#[cfg(test)]
mod tests;
mod triangulate;
mod wide;

pub use carry::Part;
use cells::Complex;
use exact::NONE;
use meet::Meetings;
use snap::{Grid, Mesh};

/// Why there is no result.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Fault {
    /// The run was interrupted.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// Faces meet in more places than can be kept.
    #[error("faces meet in too many places")]
    TooMany,
    /// Computing contradicted itself.
    #[error("pieces do not fit together")]
    Inconsistent,
}

/// Faces that a piece is part of, each with 1 where it looks the same way, else -1.
type Members = SmallVec<[(u32, i8); 2]>;

/// A part of a face, or of several that lie on each other.
#[derive(Clone, Debug)]
struct Piece {
    corners: [u32; 3],
    members: Members,
}

/// A surface without what was inside of it, and this.
#[derive(Clone, Debug, PartialEq)]
pub struct Resolved {
    /// What bounds solids, and sheets: no manifold where they touch themselves.
    pub kept: Part,
    /// Pieces inside of solids, and further ones of those that lie on each other.
    pub removed: Part,
    /// How far a vertex went, at most.
    pub moved: f64,
    /// Faces that were cut or beside others.
    pub touched: usize,
}

/// What becomes of bodies that have a part of space in common.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shared {
    /// All bodies are one.
    United,
    /// It is of the body whose faces come first, and the others end there: each bounds what is left of it.
    First,
}

/// Cuts the faces of a surface that meet others, which are given, and drops what is inside of bodies. The grid has so
/// many bits less than the finest one.
///
/// # Errors
/// [`Fault`]: interrupted, too many meetings, or contradictions.
pub fn resolve(
    surface: &Surface,
    meeting: &[u32],
    shared: Shared,
    coarser: u32,
    watch: &Watch,
) -> Result<Resolved, Fault> {
    let grid = Grid::new(&Aabb::of(surface.points.iter().copied()), coarser);
    let mut mesh = Mesh {
        points: surface.points.as_slice().to_vec(),
        faces: surface.faces.iter().map(|face| face.map(crate::mesh::Id::raw)).collect(),
        origin: (0..surface.faces.len() as u32).collect(),
    };
    let snapped = snap::snap(&mut mesh, meeting, &grid, watch)?;
    let mut meetings = Meetings::new(&mesh, &snapped.touched, &snapped.pairs, &grid)?;
    watch.check()?;
    let cut = flat::cut_faces(&mut meetings, watch)?;
    let body = extract::body_of_faces(surface, shared == Shared::First);
    let complex = assemble(&body, &mesh, &snapped.touched, &meetings, cut, &grid);
    watch.check()?;
    let shells = extract::shells(surface, &mesh, &body);
    let owners = cells::owners(&complex, &shells)?;
    let mut chosen = extract::choose(&complex, &owners);
    if shared == Shared::First {
        chosen.sort(&mesh.origin);
    }
    let part = |faces: &[extract::Chosen]| Part::new(&complex, &mesh.origin, faces, 4.0 * grid.unit);
    Ok(Resolved {
        kept: part(&chosen.kept),
        removed: part(&chosen.removed),
        moved: snapped.moved,
        touched: meetings.faces.len(),
    })
}

/// All pieces, those of faces that meet none among them.
fn assemble<'a>(
    body: &[u32],
    mesh: &Mesh,
    touched: &[bool],
    meetings: &'a Meetings,
    cut: Vec<Piece>,
    grid: &Grid,
) -> Complex<'a> {
    let vertices = mesh.points.len();
    let node = |point: u32| match meetings.points[point].vertex {
        NONE => vertices as u32 + point,
        vertex => vertex,
    };
    let mut pieces: Vec<Piece> = cut;
    for piece in &mut pieces {
        piece.corners = piece.corners.map(node);
        piece.members.iter_mut().for_each(|member| member.0 = meetings.face_of[member.0 as usize]);
    }
    let whole = (0..mesh.faces.len()).filter(|&f| !touched[f]);
    pieces.extend(whole.map(|f| Piece { corners: mesh.faces[f], members: smallvec::smallvec![(f as u32, 1)] }));
    let mut numbers = vec![NONE; mesh.faces.len()];
    meetings.face_of.iter().enumerate().for_each(|(number, &f)| numbers[f as usize] = number as u32);
    let mut places = mesh.points.clone();
    places.extend((0..meetings.points.len() as u32).map(|p| grid.place(meetings.points[p].at)));
    let body = mesh.origin.iter().map(|&f| body[f as usize]).collect();
    Complex { pieces, places, vertices, meetings, touched: numbers, body }
}
