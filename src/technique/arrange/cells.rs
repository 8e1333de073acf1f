//! The parts of space between pieces, and how often each is inside of bodies.
//!
//! # Algorithm
//! Round an edge the front or back of each piece looks at that of the next one; what looks at each other belongs to one
//! cell. The order round an edge of more than two is that of normals turned about it, which is decided exactly: all are
//! normals of faces through the edge's line. Through a piece the winding number changes by how many bodies' faces lie
//! there and which way they look; each body has a number of its own. One number of each connected set of pieces is
//! measured: the solid angle of all bodies seen from the middle of a piece (A. Jacobson, L. Kavan, O. Sorkine-Hornung.
//! Robust inside-outside segmentation using generalized winding numbers. SIGGRAPH 2013) is the mean of the numbers on
//! its two sides, and must come out as one.

use std::cmp::Ordering;
use std::collections::BTreeMap;

use glam::DVec3;
use rayon::prelude::*;
use smallvec::SmallVec;

use super::exact::{NONE, Plane};
use super::meet::Meetings;
use super::sets::Sets;
use super::{Fault, Piece};
use crate::mesh::geometry::{Aabb, triangle_area};
use crate::mesh::predicate::Sign;

/// A use of an edge by a piece: the lower and the higher node, the piece, and whether it runs from the lower one.
type Use = (u32, u32, u32, bool);

/// Pieces with nodes as corners: vertices of the mesh, then points where faces meet.
pub(super) struct Complex<'a> {
    /// Members are faces of the mesh; pieces of faces that meet none have one.
    pub(super) pieces: Vec<Piece>,
    pub(super) places: Vec<DVec3>,
    /// The vertices among the nodes.
    pub(super) vertices: usize,
    pub(super) meetings: &'a Meetings,
    /// The touched face of each face, or [`NONE`].
    pub(super) touched: Vec<u32>,
    /// The body that each face of the mesh bounds, or [`NONE`] for sheets.
    pub(super) body: Vec<u32>,
}

/// A closed shell as faces, and the body that it bounds, perhaps with others.
pub(super) struct Shell {
    pub(super) body: u32,
    pub(super) bounds: Aabb,
    pub(super) faces: Vec<(u32, [DVec3; 3])>,
}

/// Winding numbers that are not 0, by body.
type Inside = SmallVec<[(u32, i32); 2]>;

fn sum(one: &Inside, other: &Inside) -> Inside {
    let mut all: Inside = one.iter().chain(other).copied().collect();
    all.sort_unstable();
    all.dedup_by(|next, known| {
        let is_same = next.0 == known.0;
        known.1 += if is_same { next.1 } else { 0 };
        is_same
    });
    all.retain(|(_, number)| *number != 0);
    all
}

/// The first body that is before and behind each piece, or [`NONE`]; `None` where no piece that is connected with it
/// was cut.
pub(super) type Owners = Vec<Option<[u32; 2]>>;

/// The bodies at all pieces that are connected with touched faces.
pub(super) fn owners(complex: &Complex<'_>, shells: &[Shell]) -> Result<Owners, Fault> {
    let uses = complex.uses();
    let mut sets = Sets::new(complex.pieces.len());
    for same in groups(&uses) {
        same.windows(2).for_each(|pair| sets.join(pair[0].2, pair[1].2));
    }
    let mut is_met = vec![false; complex.pieces.len()];
    for (p, piece) in complex.pieces.iter().enumerate() {
        let root = sets.find(p as u32) as usize;
        is_met[root] |= complex.touched[piece.members[0].0 as usize] != NONE;
    }
    let is_met: Vec<bool> = (0..complex.pieces.len() as u32).map(|p| is_met[sets.find(p) as usize]).collect();
    let mut sides = Sets::new(2 * complex.pieces.len());
    for same in groups(&uses).filter(|same| is_met[same[0].2 as usize]) {
        let ring = complex.ring(same)?;
        for (at, &one) in ring.iter().enumerate() {
            sides.join(forward(one), forward(ring[(at + 1) % ring.len()]) ^ 1);
        }
    }
    let connected: Vec<Vec<u32>> = sets.members().into_iter().filter(|set| is_met[set[0] as usize]).collect();
    let mut found = vec![None; complex.pieces.len()];
    let mut of_cell: Vec<Option<Inside>> = vec![None; 2 * complex.pieces.len()];
    for set in connected {
        complex.spread(&set, shells, &mut sides, &mut of_cell)?;
        for p in set {
            let owner = |side: u32, sides: &mut Sets| of_cell[sides.find(2 * p + side) as usize].as_ref().map(owner);
            let both = owner(0, &mut sides).zip(owner(1, &mut sides)).ok_or(Fault::Inconsistent)?;
            found[p as usize] = Some([both.0, both.1]);
        }
    }
    Ok(found)
}

fn owner(inside: &Inside) -> u32 {
    inside.iter().find(|(_, number)| *number >= 1).map_or(NONE, |&(body, _)| body)
}

fn groups(uses: &[Use]) -> impl Iterator<Item = &[Use]> {
    uses.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1))
}

/// The side of a piece that one comes to when turning on about the edge from its lower to its higher node: the front
/// where it runs along.
fn forward(edge: Use) -> u32 {
    2 * edge.2 + u32::from(!edge.3)
}

impl Complex<'_> {
    fn uses(&self) -> Vec<Use> {
        let mut uses: Vec<Use> = Vec::with_capacity(3 * self.pieces.len());
        for (p, piece) in self.pieces.iter().enumerate() {
            let [a, b, c] = piece.corners;
            uses.extend([(a, b), (b, c), (c, a)].map(|(a, b)| (a.min(b), a.max(b), p as u32, a < b)));
        }
        uses.par_sort_unstable();
        uses
    }

    fn point(&self, node: u32) -> &super::exact::Point {
        let number = node.checked_sub(self.vertices as u32).unwrap_or_else(|| self.meetings.point_of[node as usize]);
        &self.meetings.points[number]
    }

    /// The normal of a touched piece, as a plane and a sign.
    fn normal(&self, piece: u32) -> (&Plane, Sign) {
        let (face, sign) = self.pieces[piece as usize].members[0];
        (&self.meetings.faces[self.touched[face as usize] as usize].plane, sign)
    }

    /// The uses of an edge in order round it.
    fn ring(&self, same: &[Use]) -> Result<Vec<Use>, Fault> {
        let mut ring = same.to_vec();
        if ring.len() < 3 {
            return Ok(ring);
        }
        if ring.iter().any(|one| self.touched[self.pieces[one.2 as usize].members[0].0 as usize] == NONE) {
            return Err(Fault::Inconsistent);
        }
        // Turning about the edge as coordinates ascend along it.
        let ascends = self.point(same[0].0).compare(self.point(same[0].1)).is_lt();
        let first = ring[0];
        let mut is_double = false;
        ring[1..].sort_by(|&a, &b| {
            let order = self.half(first, a, ascends).cmp(&self.half(first, b, ascends));
            order.then_with(|| self.turn(a, b, ascends).cmp(&0).reverse())
        });
        for pair in ring.windows(2) {
            is_double |= self.turn(pair[0], pair[1], ascends) == 0 && self.dot(pair[0], pair[1]) > 0;
        }
        if is_double { Err(Fault::Inconsistent) } else { Ok(ring) }
    }

    /// Whether turning by less than half a circle takes one use to the other.
    fn turn(&self, a: Use, b: Use, ascends: bool) -> Sign {
        let ((plane, sign), (other, other_sign)) = (self.normal(a.2), self.normal(b.2));
        let along = |one: Use| if one.3 { 1 } else { -1 };
        let direction = if ascends { 1 } else { -1 };
        plane.turn(other) * sign * other_sign * along(a) * along(b) * direction
    }

    fn dot(&self, a: Use, b: Use) -> Sign {
        let ((plane, sign), (other, other_sign)) = (self.normal(a.2), self.normal(b.2));
        let agrees = if plane.agrees_with(other) { 1 } else { -1 };
        agrees * sign * other_sign * if a.3 == b.3 { 1 } else { -1 }
    }

    /// 0 for uses less than half a circle on from the first one, 1 for others.
    fn half(&self, first: Use, one: Use, ascends: bool) -> u8 {
        match self.turn(first, one, ascends).cmp(&0) {
            Ordering::Greater => 0,
            Ordering::Less => 1,
            Ordering::Equal => u8::from(self.dot(first, one) < 0),
        }
    }

    /// How much higher winding numbers are behind a piece than before it.
    fn step(&self, piece: u32) -> Inside {
        let members = self.pieces[piece as usize].members.iter();
        let steps = members.map(|&(f, sign)| (self.body[f as usize], i32::from(sign)));
        sum(&steps.filter(|(body, _)| *body != NONE).collect(), &Inside::new())
    }

    pub(super) fn corners(&self, piece: u32) -> [DVec3; 3] {
        self.pieces[piece as usize].corners.map(|node| self.places[node as usize])
    }

    /// Numbers all cells at a connected set of pieces.
    fn spread(
        &self,
        set: &[u32],
        shells: &[Shell],
        sides: &mut Sets,
        of_cell: &mut [Option<Inside>],
    ) -> Result<(), Fault> {
        let mut steps: Vec<(u32, u32, Inside)> = Vec::with_capacity(2 * set.len());
        for &p in set {
            let (front, back, step) = (sides.find(2 * p), sides.find(2 * p + 1), self.step(p));
            let turned = step.iter().map(|&(body, number)| (body, -number)).collect();
            steps.extend([(front, back, step), (back, front, turned)]);
        }
        steps.sort_unstable();
        steps.dedup();
        let (first, inside) = self.measured(set, shells)?;
        let start = sides.find(2 * first);
        of_cell[start as usize] = Some(inside);
        let mut open = vec![start];
        while let Some(cell) = open.pop() {
            let inside = of_cell[cell as usize].clone().ok_or(Fault::Inconsistent)?;
            let from = steps.partition_point(|step| step.0 < cell);
            for (_, other, step) in steps[from..].iter().take_while(|step| step.0 == cell) {
                let there = sum(&inside, step);
                match &of_cell[*other as usize] {
                    None => {
                        of_cell[*other as usize] = Some(there);
                        open.push(*other);
                    }
                    Some(known) if *known != there => return Err(Fault::Inconsistent),
                    Some(_) => {}
                }
            }
        }
        Ok(())
    }

    /// A piece, and the winding numbers before it: the first of the largest ones where the measure is beyond doubt.
    fn measured(&self, set: &[u32], shells: &[Shell]) -> Result<(u32, Inside), Fault> {
        let mut by_size: Vec<(f64, u32)> = set.iter().map(|&p| (triangle_area(self.corners(p)), p)).collect();
        by_size.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        let tried = by_size.iter().take(TRIES).map(|&(_, piece)| piece);
        let mut certain = tried.filter_map(|piece| Some((piece, self.before(piece, shells)?)));
        certain.next().ok_or(Fault::Inconsistent)
    }

    /// The winding numbers before a piece, as measured; `None` in doubt.
    fn before(&self, piece: u32, shells: &[Shell]) -> Option<Inside> {
        let middle = self.corners(piece).iter().sum::<DVec3>() / 3.0;
        let own = &self.pieces[piece as usize].members;
        let seen = |shell: &Shell| {
            let others = shell.faces.iter().filter(|(f, _)| own.iter().all(|(member, _)| member != f));
            others.map(|(_, corners)| solid_angle(corners.map(|p| p - middle))).sum::<f64>()
        };
        let step = self.step(piece);
        let mut angles: BTreeMap<u32, f64> = step.iter().map(|&(body, _)| (body, 0.0)).collect();
        for shell in shells.iter().filter(|shell| shell.bounds.contains(middle)) {
            *angles.entry(shell.body).or_default() += seen(shell);
        }
        let mut inside = Inside::new();
        for (body, angle) in angles {
            let own = step.iter().find(|own| own.0 == body).map_or(0, |own| own.1);
            let number = angle / (4.0 * std::f64::consts::PI) - 0.5 * f64::from(own);
            if (number - number.round()).abs() >= DOUBT {
                return None;
            }
            inside.push((body, number.round() as i32));
        }
        inside.retain(|(_, number)| *number != 0);
        Some(inside)
    }
}

/// Pieces that are tried.
const TRIES: usize = 16;
/// How far a measured winding number may be off an integer.
const DOUBT: f64 = 0.01;

/// The solid angle of a triangle seen from the origin, above 0 from behind (A. Van Oosterom, J. Strackee. The solid
/// angle of a plane triangle. IEEE Trans. Biomed. Eng. 30(2), 1983).
pub(super) fn solid_angle([a, b, c]: [DVec3; 3]) -> f64 {
    let [x, y, z] = [a, b, c].map(DVec3::length);
    let below = x * y * z + a.dot(b) * z + b.dot(c) * x + c.dot(a) * y;
    2.0 * libm::atan2(a.dot(b.cross(c)), below)
}
