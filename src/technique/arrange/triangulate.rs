//! A triangulation of points in a plane that has given segments as edges, decided exactly.
//!
//! # Algorithm
//! Points go one by one into the triangle that holds them, which is found by walking; edges are then flipped towards
//! Delaunay's. A segment that is no edge flips those that cross it until it is one (S. W. Sloan. A fast algorithm for
//! generating constrained Delaunay triangulations. Computers & Structures 47, 1993); where it passes through a point it
//! ends there and goes on. Flips are only made in quads that are strictly convex, exactly; whether one is wanted is
//! decided in floats, because any triangulation is right.
//!
//! # Cost
//! O(n sqrt n) for points in order along an axis; flips are bounded.

use std::collections::VecDeque;

use smallvec::SmallVec;

use super::Fault;
use super::exact::{Flat, NONE, orient};
use crate::mesh::predicate::Sign;

/// A growing triangulation. Edge `i` of a triangle runs from corner `i` to the next.
pub(super) struct Triangulation {
    points: Vec<Flat>,
    pub(super) triangles: Vec<[u32; 3]>,
    across: Vec<[u32; 3]>,
    fixed: Vec<[bool; 3]>,
    /// A triangle at each point.
    at: Vec<u32>,
}

/// Where a point lies.
enum Place {
    In(u32),
    On(u32, usize),
    At(u32),
}

const fn next(i: usize) -> usize {
    (i + 1) % 3
}

impl Triangulation {
    /// One triangle, counter-clockwise.
    pub(super) fn new(corners: &[Flat; 3]) -> Self {
        Self {
            points: corners.to_vec(),
            triangles: vec![[0, 1, 2]],
            across: vec![[NONE; 3]],
            fixed: vec![[false; 3]],
            at: vec![0; 3],
        }
    }

    /// How points turn.
    pub(super) fn orient(&self, a: u32, b: u32, c: u32) -> Sign {
        orient(self.point(a), self.point(b), self.point(c))
    }

    pub(super) fn point(&self, p: u32) -> &Flat {
        &self.points[p as usize]
    }

    /// Adds a point inside the first triangle or on its border; returns its number, that of the one at its place where
    /// there is one.
    pub(super) fn insert(&mut self, point: Flat) -> Result<u32, Fault> {
        let p = self.points.len() as u32;
        self.points.push(point);
        let place = self.locate(p)?;
        if let Place::At(known) = place {
            self.points.pop();
            return Ok(known);
        }
        self.at.push(NONE);
        let mut open = SmallVec::new();
        match place {
            Place::In(t) => self.split_triangle(t, p, &mut open),
            Place::On(t, i) => self.split_edge(t, i, p, &mut open),
            Place::At(_) => {}
        }
        self.legalize(open);
        Ok(p)
    }

    fn locate(&self, p: u32) -> Result<Place, Fault> {
        let mut t = self.at.last().copied().unwrap_or(0);
        // Walks can go round in circles where flips are missing.
        let mut steps = 4 * self.triangles.len() + 16;
        loop {
            let sides: [Sign; 3] = self.sides(t, p);
            match (0..3).find(|&i| sides[i] < 0) {
                Some(i) if self.across[t as usize][i] != NONE && steps > 0 => t = self.across[t as usize][i],
                Some(_) => break,
                None => return Ok(self.place(t, sides)),
            }
            steps -= 1;
        }
        let holds = |&t: &u32| self.sides(t, p).iter().all(|&side| side >= 0);
        let found = (0..self.triangles.len() as u32).find(holds).ok_or(Fault::Inconsistent)?;
        Ok(self.place(found, self.sides(found, p)))
    }

    fn sides(&self, t: u32, p: u32) -> [Sign; 3] {
        let corners = self.triangles[t as usize];
        std::array::from_fn(|i| self.orient(corners[i], corners[next(i)], p))
    }

    fn place(&self, t: u32, sides: [Sign; 3]) -> Place {
        match sides.iter().filter(|&&side| side == 0).count() {
            0 => Place::In(t),
            1 => Place::On(t, sides.iter().position(|&side| side == 0).unwrap_or(0)),
            // The corner between two edges is where the first begins and the last ends.
            _ => Place::At(
                self.triangles[t as usize][(0..3).find(|&i| sides[i] == 0 && sides[(i + 2) % 3] == 0).unwrap_or(0)],
            ),
        }
    }

    /// Writes a triangle; its neighbours and corners get to know of it.
    fn set(&mut self, t: u32, corners: [u32; 3], across: [u32; 3], fixed: [bool; 3]) {
        let at = t as usize;
        if at == self.triangles.len() {
            self.triangles.push(corners);
            self.across.push(across);
            self.fixed.push(fixed);
        } else {
            (self.triangles[at], self.across[at], self.fixed[at]) = (corners, across, fixed);
        }
        for i in 0..3 {
            self.at[corners[i] as usize] = t;
            let other = across[i];
            let is_there = other != NONE && (other as usize) < self.triangles.len();
            if is_there && let Some(j) = self.edge(other, corners[next(i)], corners[i]) {
                self.across[other as usize][j] = t;
            }
        }
    }

    /// Which edge of a triangle runs from one point to another.
    fn edge(&self, t: u32, from: u32, to: u32) -> Option<usize> {
        let corners = self.triangles[t as usize];
        (0..3).find(|&i| corners[i] == from && corners[next(i)] == to)
    }

    /// Corners, neighbours and marks from one edge on.
    fn turned(&self, t: u32, i: usize) -> ([u32; 3], [u32; 3], [bool; 3]) {
        let order = [i, next(i), next(next(i))];
        let at = t as usize;
        (order.map(|k| self.triangles[at][k]), order.map(|k| self.across[at][k]), order.map(|k| self.fixed[at][k]))
    }

    fn split_triangle(&mut self, t: u32, p: u32, open: &mut Open) {
        let ([a, b, c], across, fixed) = self.turned(t, 0);
        let [u, v] = [0, 1].map(|k| self.triangles.len() as u32 + k);
        self.set(t, [a, b, p], [across[0], u, v], [fixed[0], false, false]);
        self.set(u, [b, c, p], [across[1], v, t], [fixed[1], false, false]);
        self.set(v, [c, a, p], [across[2], t, u], [fixed[2], false, false]);
        open.extend([(t, a, b), (u, b, c), (v, c, a)]);
    }

    fn split_edge(&mut self, t: u32, i: usize, p: u32, open: &mut Open) {
        let ([a, b, c], [beyond, right, left], [mark, mark_right, mark_left]) = self.turned(t, i);
        let fresh = self.triangles.len() as u32;
        let other = (beyond != NONE).then(|| self.edge(beyond, b, a)).flatten();
        let far = if other.is_some() { fresh + 1 } else { NONE };
        let turned = other.map(|j| self.turned(beyond, j));
        self.set(t, [a, p, c], [far, fresh, left], [mark, false, mark_left]);
        self.set(fresh, [p, b, c], [beyond, right, t], [mark, mark_right, false]);
        open.extend([(fresh, b, c), (t, c, a)]);
        if let Some(([_, _, d], [_, right, left], [_, mark_right, mark_left])) = turned {
            // Right of b to a: from a to d; left: from d to b.
            self.set(beyond, [b, p, d], [fresh, far, left], [mark, false, mark_left]);
            self.set(far, [p, a, d], [t, right, beyond], [mark, mark_right, false]);
            self.across[t as usize][0] = far;
            open.extend([(far, a, d), (beyond, d, b)]);
        }
    }

    /// Flips an edge whose two triangles make a strictly convex quad; says whether they do.
    fn flip(&mut self, t: u32, i: usize) -> bool {
        let u = self.across[t as usize][i];
        let ([a, b, c], [_, bc, ca], [_, mark_bc, mark_ca]) = self.turned(t, i);
        let Some(j) = self.edge(u, b, a) else { return false };
        let ([_, _, d], [_, ad, db], [_, mark_ad, mark_db]) = self.turned(u, j);
        if self.orient(a, d, c) <= 0 || self.orient(d, b, c) <= 0 {
            return false;
        }
        self.set(t, [a, d, c], [ad, u, ca], [mark_ad, false, mark_ca]);
        self.set(u, [d, b, c], [db, bc, t], [mark_db, mark_bc, false]);
        true
    }

    /// Flips edges until each is Delaunay's or fixed, or the work is more than it should be.
    fn legalize(&mut self, mut open: Open) {
        let mut left = 64 * open.len() + 4 * self.triangles.len();
        while let Some((t, a, b)) = open.pop() {
            let Some(i) = self.edge(t, a, b) else { continue };
            let u = self.across[t as usize][i];
            if u == NONE || self.fixed[t as usize][i] || left == 0 {
                continue;
            }
            let Some(j) = self.edge(u, b, a) else { continue };
            let (c, d) = (self.triangles[t as usize][next(next(i))], self.triangles[u as usize][next(next(j))]);
            if self.is_in_circle([a, b, c], d) && self.flip(t, i) {
                left -= 1;
                open.extend([(t, c, a), (t, a, d), (u, d, b), (u, b, c)]);
            }
        }
    }

    /// Whether a point lies well inside the circle round a triangle, as far as floats can tell.
    fn is_in_circle(&self, triangle: [u32; 3], d: u32) -> bool {
        let [a, b, c] = triangle.map(|p| self.point(p).at - self.point(d).at);
        let [lift_a, lift_b, lift_c] = [a, b, c].map(glam::DVec2::length_squared);
        let terms = [lift_a * b.perp_dot(c), lift_b * c.perp_dot(a), lift_c * a.perp_dot(b)];
        terms.iter().sum::<f64>() > 1e-9 * terms.iter().map(|term| term.abs()).sum::<f64>()
    }

    /// Flips all edges that are not fixed towards Delaunay's.
    pub(super) fn improve(&mut self) {
        let edges = |(t, corners): (usize, &[u32; 3])| {
            let corners = *corners;
            (0..3).map(move |i| (t as u32, corners[i], corners[next(i)]))
        };
        let open: Open = self.triangles.iter().enumerate().flat_map(edges).filter(|&(_, a, b)| a < b).collect();
        self.legalize(open);
    }

    /// The triangles round a point, each with the place of the point among its corners.
    fn fan(&self, p: u32) -> SmallVec<[(u32, usize); 12]> {
        let mut fan = SmallVec::new();
        let place = |t: u32| self.triangles[t as usize].iter().position(|&corner| corner == p).unwrap_or(0);
        let start = self.at[p as usize];
        let mut t = start;
        while t != NONE {
            fan.push((t, place(t)));
            t = self.across[t as usize][(place(t) + 2) % 3];
            if t == start {
                return fan;
            }
        }
        t = self.across[start as usize][place(start)];
        while t != NONE {
            fan.push((t, place(t)));
            t = self.across[t as usize][place(t)];
        }
        fan
    }

    /// Marks an edge on both sides.
    fn fix(&mut self, t: u32, i: usize) {
        let (a, b) = (self.triangles[t as usize][i], self.triangles[t as usize][next(i)]);
        self.fixed[t as usize][i] = true;
        let other = self.across[t as usize][i];
        if other != NONE
            && let Some(j) = self.edge(other, b, a)
        {
            self.fixed[other as usize][j] = true;
        }
    }

    /// Makes the segment between two points an edge, or several where it passes through points.
    pub(super) fn constrain(&mut self, a: u32, b: u32) -> Result<(), Fault> {
        let mut from = a;
        let mut left = self.points.len() + 1;
        while from != b {
            left = left.checked_sub(1).ok_or(Fault::Inconsistent)?;
            from = self.advance(from, b)?;
        }
        Ok(())
    }

    /// The first part of a segment, to its first point; returns this.
    fn advance(&mut self, from: u32, to: u32) -> Result<u32, Fault> {
        let ahead = self.point(from).compare(self.point(to));
        for (t, i) in self.fan(from) {
            let ([_, p, q], ..) = self.turned(t, i);
            let is_hit =
                |r: u32| r == to || (self.orient(from, to, r) == 0 && self.point(from).compare(self.point(r)) == ahead);
            if is_hit(p) {
                self.fix(t, i);
                return Ok(p);
            }
            if is_hit(q) {
                self.fix(t, (i + 2) % 3);
                return Ok(q);
            }
            if self.orient(from, to, p) < 0 && self.orient(from, to, q) > 0 {
                return self.cut_through(from, to, (t, next(i)));
            }
        }
        Err(Fault::Inconsistent)
    }

    /// Makes the segment an edge as far as its first point, beginning with the first edge that it crosses.
    fn cut_through(&mut self, from: u32, to: u32, first: (u32, usize)) -> Result<u32, Fault> {
        let (mut crossed, mut here) = (VecDeque::new(), first);
        let end = loop {
            let ([p, q, _], [other, ..], [mark, ..]) = self.turned(here.0, here.1);
            if mark || other == NONE {
                return Err(Fault::Inconsistent);
            }
            crossed.push_back((p, q));
            let j = self.edge(other, q, p).ok_or(Fault::Inconsistent)?;
            let r = self.triangles[other as usize][next(next(j))];
            let side = if r == to { 0 } else { self.orient(from, to, r) };
            match side {
                0 => break r,
                // From q to p, p to r, r to q: the segment goes on between r and whichever is on the other side.
                1 => here = (other, next(j)),
                _ => here = (other, next(next(j))),
            }
        };
        self.flip_away(from, end, crossed)?;
        let (t, i) = self.find(from, end).ok_or(Fault::Inconsistent)?;
        self.fix(t, i);
        Ok(end)
    }

    fn flip_away(&mut self, from: u32, end: u32, mut crossed: VecDeque<(u32, u32)>) -> Result<(), Fault> {
        let mut left = 16 * crossed.len() * crossed.len() + 64;
        while let Some((p, q)) = crossed.pop_front() {
            left = left.checked_sub(1).ok_or(Fault::Inconsistent)?;
            let (t, i) = self.find(p, q).ok_or(Fault::Inconsistent)?;
            let c = self.triangles[t as usize][next(next(i))];
            if !self.flip(t, i) {
                crossed.push_back((p, q));
                continue;
            }
            // The new edge runs from the far corner d to c; t is a, d, c now.
            let d = self.triangles[t as usize].into_iter().find(|&x| x != p && x != c).unwrap_or(p);
            let is_apart = [c, d].iter().all(|&x| x != from && x != end);
            if is_apart && self.orient(from, end, c) * self.orient(from, end, d) < 0 {
                crossed.push_back((d, c));
            }
        }
        Ok(())
    }

    /// The triangle with the edge from one point to another.
    fn find(&self, from: u32, to: u32) -> Option<(u32, usize)> {
        self.fan(from).into_iter().find(|&(t, i)| self.triangles[t as usize][next(i)] == to)
    }
}

/// Edges to look at: a triangle that has the edge from one point to another.
type Open = SmallVec<[(u32, u32, u32); 16]>;
