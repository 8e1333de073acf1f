//! Which faces that meet only touch, and which run through each other, by what lies round them.
//!
//! # Algorithm
//! Two triangles alone cannot tell. A ball sunk into a plate by half has edges in the plate's plane: no triangle of it
//! passes through one of the plate, and still the ball does. So a pair that touches along an edge is looked at with the
//! faces on the other side of the edge: where the surface goes on behind the plane, or where the parts of space that
//! two surfaces bound round a common line overlap without one holding the other, the surfaces run through each other.
//! Faces that lie on each other and look against each other are where bodies touch, unless they share a vertex, as
//! those of a surface that is folded onto itself do.
//!
//! # Invariants
//! - All signs are exact. In doubt (more than two faces at an edge, or two that look different ways) a pair counts as
//!   one that runs through: contacts are so for certain, as far as faces on both sides of an edge tell.
//!
//! # Cost
//! O(F log F) where a pair touches or lies on each other, nothing else.

use std::collections::BTreeMap;

use glam::DVec3;
use rayon::prelude::*;

use super::bvh::Triangle;
use super::id::{FaceId, VertexId};
use super::predicate::{Meeting, Sign, orient2d, orient3d, projection};
use super::topology::{EdgeTable, Faces};

/// Triangles over vertices.
struct Triangles<'a> {
    corners: &'a [[VertexId; 3]],
    vertices: usize,
}

impl Faces for Triangles<'_> {
    fn vertex_count(&self) -> usize {
        self.vertices
    }
    fn face_count(&self) -> usize {
        self.corners.len()
    }
    fn corners(&self, face: FaceId) -> &[VertexId] {
        &self.corners[face.index()]
    }
}

/// What is on the other side of an edge.
enum Beyond {
    /// Nothing: a border.
    Nothing,
    /// The third corner of a face that looks the same way.
    Face(DVec3),
    /// More than one face, or one that looks another way.
    Unclear,
}

/// Calls pairs that touch and run through each other `Crossing`, and those that lie on each other as touching bodies do
/// `Touching`. Triangles are given by their corners, which `place` puts somewhere.
pub fn tell_contacts(
    corners: &[[VertexId; 3]],
    place: impl Fn(VertexId) -> DVec3 + Sync,
    pairs: &mut [(u32, u32, Meeting)],
) {
    if pairs.iter().all(|pair| pair.2 == Meeting::Crossing) {
        return;
    }
    let surroundings = Surroundings::new(corners, &place);
    pairs.par_iter_mut().for_each(|(f, g, meeting)| match *meeting {
        Meeting::Touching if surroundings.run_through(*f, *g) => *meeting = Meeting::Crossing,
        Meeting::Overlapping if surroundings.lie_against(*f, *g) => *meeting = Meeting::Touching,
        _ => {}
    });
}

struct Surroundings<'a> {
    corners: &'a [[VertexId; 3]],
    place: &'a (dyn Fn(VertexId) -> DVec3 + Sync),
    edges: EdgeTable,
    /// The same with vertices at one place as one, for files whose faces share none.
    joined: Vec<[VertexId; 3]>,
    joined_edges: EdgeTable,
}

impl<'a> Surroundings<'a> {
    fn new(corners: &'a [[VertexId; 3]], place: &'a (dyn Fn(VertexId) -> DVec3 + Sync)) -> Self {
        let vertices = corners.iter().flatten().map(|v| v.index() + 1).max().unwrap_or(0);
        let mut first: BTreeMap<[u64; 3], VertexId> = BTreeMap::new();
        let key = |v: VertexId| place(v).to_array().map(|x| (x + 0.0).to_bits());
        let joined: Vec<[VertexId; 3]> =
            corners.iter().map(|face| face.map(|v| *first.entry(key(v)).or_insert(v))).collect();
        let edges = EdgeTable::new(&Triangles { corners, vertices });
        let joined_edges = EdgeTable::new(&Triangles { corners: &joined, vertices });
        Self { corners, place, edges, joined, joined_edges }
    }

    fn triangle(&self, f: u32) -> Triangle {
        self.corners[f as usize].map(self.place)
    }

    /// Whether faces in one plane look against each other and share no vertex.
    fn lie_against(&self, f: u32, g: u32) -> bool {
        let (a, b) = (self.triangle(f), self.triangle(g));
        let Some((drop, turn)) = projection(a) else { return false };
        let [p, q, r] = b.map(|p| drop.apply(p));
        let other = &self.corners[g as usize];
        orient2d(p, q, r) != turn && !self.corners[f as usize].iter().any(|v| other.contains(v))
    }

    /// Whether the surfaces of two faces that touch pass through each other there.
    fn run_through(&self, f: u32, g: u32) -> bool {
        [(f, g), (g, f)].into_iter().any(|(f, g)| (0..3).any(|side| self.passes(f, side, g)))
    }

    /// Whether a surface passes through that of another face at an edge that lies in the face's plane.
    fn passes(&self, f: u32, side: usize, g: u32) -> bool {
        let (own, other) = (self.triangle(f), self.triangle(g));
        let [p, q, tip] = [0, 1, 2].map(|k| own[(side + k) % 3]);
        let over = |x: DVec3| orient3d(other[0], other[1], other[2], x);
        let leaves = over(tip);
        if leaves == 0 || over(p) != 0 || over(q) != 0 {
            return false;
        }
        match contact([p, q], other) {
            Contact::Little => false,
            Contact::Inside => match self.beyond(f, side) {
                Beyond::Nothing => false,
                Beyond::Unclear => true,
                // A face that lies on the other one: bodies touch there, and are apart where the next is before it.
                Beyond::Face(next) => over(next) == -leaves || (over(next) == 0 && leaves < 0),
            },
            Contact::Along(edge) => {
                let apex = other[(edge + 2) % 3];
                match (self.beyond(f, side), self.beyond(g, edge)) {
                    (Beyond::Nothing, _) | (_, Beyond::Nothing) => false,
                    (Beyond::Face(next), Beyond::Face(far)) => {
                        let along = (other[(edge + 1) % 3] - other[edge]).dot(q - p) > 0.0;
                        let theirs = if along { [far, apex] } else { [apex, far] };
                        Axis([p, q]).interleave([next, tip], theirs)
                    }
                    _ => true,
                }
            }
        }
    }

    /// What is on the other side of a face's edge.
    fn beyond(&self, f: u32, side: usize) -> Beyond {
        for (edges, corners) in [(&self.edges, self.corners), (&self.joined_edges, &self.joined[..])] {
            let [a, b] = [0, 1].map(|k| corners[f as usize][(side + k) % 3]);
            let Some(edge) = edges.find([a.min(b), a.max(b)]) else { return Beyond::Unclear };
            match edges.sides(edge) {
                [_] => {}
                [one, two] if one.is_forward != two.is_forward => {
                    let next = if one.face.raw() == f { two } else { one };
                    let tip = corners[next.face.index()][(usize::from(next.side) + 2) % 3];
                    return Beyond::Face((self.place)(tip));
                }
                _ => return Beyond::Unclear,
            }
        }
        Beyond::Nothing
    }
}

/// What an edge in the plane of a triangle has in common with it.
enum Contact {
    /// A point, or nothing.
    Little,
    /// A segment through its inside.
    Inside,
    /// A part of an edge.
    Along(usize),
}

fn contact(ends: [DVec3; 2], triangle: Triangle) -> Contact {
    let Some((drop, turn)) = projection(triangle) else { return Contact::Little };
    let [p, q] = ends.map(|x| drop.apply(x));
    let t = triangle.map(|x| drop.apply(x));
    let sides = |i: usize| [p, q].map(|x| orient2d(t[i], t[(i + 1) % 3], x) * turn);
    let across = t.map(|x| orient2d(p, q, x));
    if across.contains(&1) && across.contains(&-1) && (0..3).all(|i| sides(i).contains(&1)) {
        return Contact::Inside;
    }
    let along = (0..3).find(|&i| {
        let (from, to) = (t[i], t[(i + 1) % 3]);
        // On one line all coordinates have the same order, or are the same.
        let overlap =
            |x: [f64; 2], y: [f64; 2]| x[0].max(x[1]).min(y[0].max(y[1])) - x[0].min(x[1]).max(y[0].min(y[1]));
        sides(i) == [0, 0] && (overlap([p.x, q.x], [from.x, to.x]) > 0.0 || overlap([p.y, q.y], [from.y, to.y]) > 0.0)
    });
    along.map_or(Contact::Little, Contact::Along)
}

/// A line, about which half-planes are turned by what they hold.
struct Axis([DVec3; 2]);

impl Axis {
    /// 1 where turning by less than half a circle takes one half-plane to the other, −1 for turning back, else 0.
    fn turn(&self, a: DVec3, b: DVec3) -> Sign {
        orient3d(self.0[0], self.0[1], a, b)
    }

    /// Whether half-planes of one plane are the same one.
    fn is_same(&self, a: DVec3, b: DVec3) -> bool {
        let [p, q] = self.0;
        let Some((drop, turn)) = projection([p, q, a]) else { return true };
        let [p, q, b] = [p, q, b].map(|x| drop.apply(x));
        orient2d(p, q, b) == turn
    }

    /// Whether a half-plane is passed, before its end, when turning from the first to the second.
    fn holds(&self, [from, to]: [DVec3; 2], x: DVec3) -> bool {
        match self.turn(from, to) {
            1 => self.turn(from, x) > 0 && self.turn(x, to) > 0,
            -1 => self.turn(to, x) < 0 || self.turn(x, from) < 0,
            _ => self.turn(from, x) > 0,
        }
    }

    /// Whether two parts of space, each from one half-plane to another one, overlap and neither holds the other.
    fn interleave(&self, ours: [DVec3; 2], theirs: [DVec3; 2]) -> bool {
        let is_shut = |[a, b]: [DVec3; 2]| self.turn(a, b) == 0 && self.is_same(a, b);
        is_shut(ours) || is_shut(theirs) || self.holds(ours, theirs[0]) != self.holds(ours, theirs[1])
    }
}
