//! Where two faces meet: the points and segments that both get.
//!
//! Faces in different planes have a segment or a point in common. It ends where an edge of one passes the other, or at
//! a corner of one that lies on the other; both are decided on corners of the grid, and made exactly. Faces in one
//! plane whose insides overlap are not cut by each other here: they are laid out together ([`flat`](super::flat)).

use rayon::prelude::*;
use smallvec::SmallVec;

use super::Fault;
use super::exact::{Corner, Found, Plane, Point, Points, orient, volume};
use super::exact::{Flat, NONE};
use super::snap::{Grid, Mesh};
use crate::mesh::predicate::{Meeting, Sign};

/// A face on the grid.
#[derive(Clone, Copy, Debug)]
pub(super) struct Face {
    pub(super) corners: [Corner; 3],
    /// The numbers of the corners among all points.
    pub(super) points: [u32; 3],
    pub(super) plane: Plane,
}

/// What a face meets.
#[derive(Clone, Debug, Default)]
pub(super) struct Cuts {
    /// Two points, and the touched face whose plane passes through them.
    pub(super) segments: Vec<(u32, u32, u32)>,
    pub(super) points: Vec<u32>,
}

/// Touched faces, numbered among themselves, and what they meet.
#[derive(Debug, Default)]
pub(super) struct Meetings {
    /// The mesh's number of each.
    pub(super) face_of: Vec<u32>,
    pub(super) faces: Vec<Face>,
    pub(super) cuts: Vec<Cuts>,
    /// Pairs that lie on each other.
    pub(super) stacked: Vec<(u32, u32)>,
    pub(super) points: Points,
    /// The point of each vertex of the mesh that is a corner of a touched face.
    pub(super) point_of: Vec<u32>,
}

/// An end of what two faces have in common.
enum End {
    Known(u32),
    New(Found),
}

impl Meetings {
    pub(super) fn new(
        mesh: &Mesh,
        touched: &[bool],
        pairs: &[(u32, u32, Meeting)],
        grid: &Grid,
    ) -> Result<Self, Fault> {
        let mut all = Self::default();
        let mut number_of_face = vec![NONE; mesh.faces.len()];
        all.point_of = vec![NONE; mesh.points.len()];
        for (f, &face) in mesh.faces.iter().enumerate().filter(|(f, _)| touched[*f]) {
            let corners = face.map(|v| grid.corner(mesh.points[v as usize]));
            let points = [0, 1, 2].map(|k| {
                let number = &mut all.point_of[face[k] as usize];
                if *number == NONE {
                    *number = all.points.number(Point::corner(corners[k], face[k]).into());
                }
                *number
            });
            number_of_face[f] = all.faces.len() as u32;
            all.face_of.push(f as u32);
            all.faces.push(Face { corners, points, plane: Plane::of(corners).ok_or(Fault::Inconsistent)? });
        }
        all.cuts = vec![Cuts::default(); all.faces.len()];
        let numbered: Vec<(u32, u32, Meeting)> =
            pairs.iter().map(|&(f, g, m)| (number_of_face[f as usize], number_of_face[g as usize], m)).collect();
        all.cut(&numbered)?;
        Ok(all)
    }

    fn cut(&mut self, pairs: &[(u32, u32, Meeting)]) -> Result<(), Fault> {
        let faces = &self.faces;
        let ends: Vec<SmallVec<[End; 4]>> = pairs
            .par_iter()
            .map(|&(f, g, meeting)| match meeting {
                Meeting::Overlapping | Meeting::Duplicate => SmallVec::new(),
                _ => common(&faces[f as usize], &faces[g as usize]),
            })
            .collect();
        for (&(f, g, meeting), ends) in pairs.iter().zip(ends) {
            if matches!(meeting, Meeting::Overlapping | Meeting::Duplicate) {
                self.stacked.push((f, g));
                continue;
            }
            let mut points: SmallVec<[u32; 4]> = SmallVec::new();
            for end in ends {
                let point = match end {
                    End::Known(point) => point,
                    End::New(found) => self.points.number(found),
                };
                if !points.contains(&point) {
                    points.push(point);
                }
            }
            let is_flat =
                self.faces[g as usize].corners.iter().all(|&c| self.faces[f as usize].plane.side_of_corner(c) == 0);
            for (one, other) in [(f, g), (g, f)] {
                let cuts = &mut self.cuts[one as usize];
                match points[..] {
                    [a, b] if !is_flat => cuts.segments.push((a, b, other)),
                    // Faces side by side in a plane share corners that lie on edges.
                    _ if is_flat || points.len() < 2 => cuts.points.extend_from_slice(&points),
                    _ => return Err(Fault::Inconsistent),
                }
            }
        }
        Ok(())
    }
}

/// The ends of what two faces have in common, some of them twice.
fn common(f: &Face, g: &Face) -> SmallVec<[End; 4]> {
    let mut ends = SmallVec::new();
    for (one, other) in [(f, g), (g, f)] {
        let sides = one.corners.map(|c| other.plane.side_of_corner(c));
        for i in 0..3 {
            let j = (i + 1) % 3;
            if sides[i] == 0 && holds(other, one.corners[i]) {
                ends.push(End::Known(one.points[i]));
            }
            if sides[i] * sides[j] < 0 {
                ends.extend(passage(one.corners[i], one.corners[j], other));
            }
        }
    }
    ends
}

/// Whether a corner in the plane of a face lies on the face.
fn holds(face: &Face, p: Corner) -> bool {
    let (drop, turn) = face.plane.projection();
    let flat = |corner: Corner| Flat::new(&Point::corner(corner, NONE), drop);
    let (corners, p) = (face.corners.map(flat), flat(p));
    (0..3).all(|i| orient(&corners[i], &corners[(i + 1) % 3], &p) * turn >= 0)
}

/// Where an edge with ends on different sides passes a face.
fn passage(p: Corner, q: Corner, face: &Face) -> Option<End> {
    let [a, b, c] = face.corners;
    let sides: [Sign; 3] = [volume([p, q, a, b]), volume([p, q, b, c]), volume([p, q, c, a])];
    if sides.contains(&1) && sides.contains(&-1) {
        return None;
    }
    let corner = (0..3).find(|&i| sides[i] == 0 && sides[(i + 2) % 3] == 0);
    Some(match corner {
        Some(i) => End::Known(face.points[i]),
        None => End::New(Point::on_line(p, q, &face.plane).into()),
    })
}
