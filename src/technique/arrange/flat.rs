//! Faces cut along what they meet, plane by plane.
//!
//! # Algorithm
//! A face that lies on no other is laid out alone, faces that lie on each other in one plane together, so that what
//! they have in common is cut alike. Every segment has a second plane through it: that of the face that it is shared
//! with, or for an edge of a face one that stands on it. Which segments cross is then a matter of sides of planes, and
//! where they do, the point where three planes meet. All points and segments go into one constrained triangulation.
//!
//! # Cost
//! A sweep along one axis over the boxes of segments, then that of the triangulation. In parallel over planes.

use glam::DVec2;
use rayon::prelude::*;
use smallvec::smallvec;

use super::exact::{Flat, Found, Plane, Point, Points, orient};
use super::meet::{Face, Meetings};
use super::triangulate::Triangulation;
use super::{Fault, Members, Piece};
use crate::mesh::bvh::Bvh;
use crate::mesh::geometry::Aabb;
use crate::mesh::predicate::{Drop, Sign};
use crate::watch::Watch;

/// Points where faces meet, of any mesh and further ones for each face, beyond which looking stops.
const POINTS: (usize, usize) = (1 << 20, 16);

/// Faces that are laid out together, in order.
struct Layout {
    members: Vec<u32>,
    plane: Plane,
    drop: Drop,
    turn: Sign,
    segments: Vec<Segment>,
}

#[derive(Clone, Copy)]
struct Segment {
    ends: [u32; 2],
    /// Passes through it, across the plane of the layout.
    across: Plane,
}

/// Cuts all faces; pieces have numbers of points as corners, and of touched faces as members.
pub(super) fn cut_faces(meetings: &mut Meetings, watch: &Watch) -> Result<Vec<Piece>, Fault> {
    let layouts: Vec<Layout> = groups(meetings).into_par_iter().map(|members| Layout::new(members, meetings)).collect();
    let most = POINTS.0 + POINTS.1 * meetings.faces.len();
    let crossings: Vec<Vec<(usize, usize, Found)>> =
        layouts.par_iter().map(|layout| layout.crossings(&meetings.points, most, watch)).collect::<Result<_, _>>()?;
    if crossings.iter().map(Vec::len).sum::<usize>() + meetings.points.len() > most {
        return Err(Fault::TooMany);
    }
    let extra: Vec<Vec<u32>> = crossings
        .into_iter()
        .map(|found| found.into_iter().map(|(.., point)| meetings.points.number(point)).collect())
        .collect();
    watch.check()?;
    let meetings = &*meetings;
    let pieces: Vec<Vec<Piece>> = layouts
        .par_iter()
        .zip(extra)
        .map(|(layout, extra)| layout.pieces(&extra, meetings, watch))
        .collect::<Result<_, _>>()?;
    Ok(pieces.into_iter().flatten().collect())
}

/// Faces that lie on each other, directly or by others; groups in the order of their first face.
fn groups(meetings: &Meetings) -> Vec<Vec<u32>> {
    let mut sets = super::sets::Sets::new(meetings.faces.len());
    meetings.stacked.iter().for_each(|&(f, g)| sets.join(f, g));
    sets.members()
}

impl Layout {
    fn new(members: Vec<u32>, meetings: &Meetings) -> Self {
        let face = |f: u32| -> &Face { &meetings.faces[f as usize] };
        let plane = face(members[0]).plane;
        let (drop, turn) = plane.projection();
        let mut segments = Vec::new();
        for &f in &members {
            let cuts = &meetings.cuts[f as usize].segments;
            segments.extend(cuts.iter().map(|&(a, b, other)| Segment { ends: [a, b], across: face(other).plane }));
            for i in (0..3).filter(|_| members.len() > 1) {
                let (corners, points, j) = (face(f).corners, face(f).points, (i + 1) % 3);
                let across = Plane::along(drop, corners[i], corners[j]);
                segments.push(Segment { ends: [points[i], points[j]], across });
            }
        }
        Self { members, plane, drop, turn, segments }
    }

    fn is_alone(&self) -> bool {
        self.members.len() == 1
    }

    /// Pairs of segments that cross in their insides, and where.
    fn crossings(&self, points: &Points, most: usize, watch: &Watch) -> Result<Vec<(usize, usize, Found)>, Fault> {
        // Floats of points are off by less.
        let margin = DVec2::splat(1e-6);
        let boxes: Vec<(DVec2, DVec2)> = self
            .segments
            .iter()
            .map(|s| s.ends.map(|p| self.drop.apply(points[p].at)))
            .map(|[a, b]| (a.min(b) - margin, a.max(b) + margin))
            .collect();
        let mut order: Vec<usize> = (0..boxes.len()).collect();
        order.sort_by(|&i, &j| boxes[i].0.x.total_cmp(&boxes[j].0.x).then(i.cmp(&j)));
        let mut found = Vec::new();
        for (at, &i) in order.iter().enumerate() {
            if at % 1024 == 0 {
                watch.check()?;
            }
            for &j in order[at + 1..].iter().take_while(|&&j| boxes[j].0.x <= boxes[i].1.x) {
                let is_near = boxes[j].0.y <= boxes[i].1.y && boxes[i].0.y <= boxes[j].1.y;
                if is_near && self.do_cross(i, j, points) {
                    let planes = [&self.plane, &self.segments[i].across, &self.segments[j].across];
                    found.push((i, j, Point::of_planes(planes).into()));
                }
            }
            if found.len() > most {
                return Err(Fault::TooMany);
            }
        }
        Ok(found)
    }

    fn do_cross(&self, i: usize, j: usize, points: &Points) -> bool {
        let is_through = |i: usize, j: usize| {
            let [a, b] = self.segments[i].ends.map(|p| self.segments[j].across.side(&points[p]));
            a * b < 0
        };
        is_through(i, j) && is_through(j, i)
    }

    fn pieces(&self, crossings: &[u32], meetings: &Meetings, watch: &Watch) -> Result<Vec<Piece>, Fault> {
        watch.check()?;
        let cuts = |f: u32| &meetings.cuts[f as usize];
        let is_whole = self.is_alone() && self.segments.is_empty() && cuts(self.members[0]).points.is_empty();
        if is_whole {
            let corners = meetings.faces[self.members[0] as usize].points;
            return Ok(vec![Piece { corners, members: smallvec![(self.members[0], 1)] }]);
        }
        let mut needed: Vec<u32> = crossings.to_vec();
        needed.extend(self.segments.iter().flat_map(|s| s.ends));
        for &f in &self.members {
            needed.extend(cuts(f).points.iter().chain(&meetings.faces[f as usize].points));
        }
        needed.sort_unstable();
        needed.dedup();
        let drawn = self.triangulate(needed, meetings)?;
        let mut pieces = Vec::new();
        let owners = Owners::new(self, &drawn, meetings);
        for &triangle in &drawn.mesh.triangles {
            let members = owners.of(triangle);
            if !members.is_empty() {
                let [a, b, c] = triangle.map(|p| drawn.number[p as usize]);
                let corners = if self.turn > 0 { [a, b, c] } else { [a, c, b] };
                pieces.push(Piece { corners, members });
            }
        }
        Ok(pieces)
    }

    /// The triangulation of these points, in order, with all segments.
    fn triangulate(&self, needed: Vec<u32>, meetings: &Meetings) -> Result<Drawn, Fault> {
        let flat = |p: u32| Flat::new(&meetings.points[p], self.drop);
        let mut number;
        let mut local = vec![super::exact::NONE; needed.len()];
        let mut mesh;
        if self.is_alone() {
            let mut corners = meetings.faces[self.members[0] as usize].points;
            if self.turn < 0 {
                corners.swap(1, 2);
            }
            mesh = Triangulation::new(&corners.map(flat));
            number = corners.to_vec();
        } else {
            // Far around the grid.
            let far = 1_i64 << (super::exact::BITS + 4);
            mesh = Triangulation::new(&[(-far, -far), (far, -far), (0, far)].map(|(u, v)| Flat::of_integers(u, v)));
            number = vec![super::exact::NONE; 3];
        }
        let mut order: Vec<usize> = (0..needed.len()).collect();
        let key = |i: usize| self.drop.apply(meetings.points[needed[i]].at);
        order.sort_by(|&i, &j| key(i).x.total_cmp(&key(j).x).then(key(i).y.total_cmp(&key(j).y)).then(i.cmp(&j)));
        for i in order {
            local[i] = mesh.insert(flat(needed[i]))?;
            if local[i] as usize == number.len() {
                number.push(needed[i]);
            }
        }
        let at = |p: u32| local[needed.binary_search(&p).unwrap_or(0)];
        for segment in &self.segments {
            mesh.constrain(at(segment.ends[0]), at(segment.ends[1]))?;
        }
        mesh.improve();
        Ok(Drawn { mesh, number })
    }
}

/// A triangulation, and the numbers of its points among all.
struct Drawn {
    mesh: Triangulation,
    number: Vec<u32>,
}

/// Which members of a layout a triangle is a piece of.
struct Owners<'a> {
    drawn: &'a Drawn,
    /// Member, its corners counter-clockwise, and whether it looks as the first one.
    faces: Vec<(u32, [Flat; 3], i8)>,
    tree: Bvh<Aabb>,
    is_alone: bool,
}

impl<'a> Owners<'a> {
    fn new(layout: &Layout, drawn: &'a Drawn, meetings: &Meetings) -> Self {
        let flats = |f: u32| -> (u32, [Flat; 3], i8) {
            let face = &meetings.faces[f as usize];
            let sign = if face.plane.agrees_with(&layout.plane) { 1 } else { -1 };
            let mut corners = face.points.map(|p| Flat::new(&meetings.points[p], layout.drop));
            if sign * layout.turn < 0 {
                corners.swap(1, 2);
            }
            (f, corners, sign)
        };
        let faces: Vec<(u32, [Flat; 3], i8)> = layout.members.iter().map(|&f| flats(f)).collect();
        let bounds = |corners: &[Flat; 3]| Aabb::of(corners.iter().map(|p| p.at.extend(0.0))).grown(1e-6);
        let tree = Bvh::new(faces.iter().map(|(_, corners, _)| bounds(corners)).collect());
        Self { drawn, faces, tree, is_alone: layout.is_alone() }
    }

    /// The members, each with 1 where it looks the same way as the layout, else with -1.
    fn of(&self, triangle: [u32; 3]) -> Members {
        let all = || self.faces.iter().map(|&(f, _, sign)| (f, sign));
        if self.is_alone {
            return all().collect();
        }
        if triangle.iter().any(|&p| p < 3) {
            return Members::new();
        }
        let corners = triangle.map(|p| self.drawn.mesh.point(p));
        let middle = (corners[0].at + corners[1].at + corners[2].at) / 3.0;
        // No edge of a member passes through the triangle: it is inside as a whole or not at all.
        let holds =
            |face: &[Flat; 3]| (0..3).all(|i| corners.iter().all(|p| orient(&face[i], &face[(i + 1) % 3], p) >= 0));
        let near = self.tree.in_box(&Aabb::of([middle.extend(0.0)]));
        near.into_iter()
            .map(|i| &self.faces[i as usize])
            .filter(|(_, face, _)| holds(face))
            .map(|&(f, _, sign)| (f, sign))
            .collect()
    }
}
