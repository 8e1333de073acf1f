//! Fewer triangles that look the same: quadric edge collapse for pictures and screens, on any triangles.
//!
//! # Algorithm
//! Each vertex sums the squared distances to the planes of its faces and to the lines of its rims and marked edges
//! ([`super::quadric`]). The edge whose better end or middle costs least is collapsed, again and again, until few
//! enough faces are left. A small share of the squared edge length is added to the cost, so that flat parts are thinned
//! evenly. Collapses that would turn a face over or pinch the mesh are refused.
//!
//! Unlike [`super::collapse`] it holds no tolerance and needs no manifold: it is for showing a mesh, not for computing
//! with it.
//!
//! # Invariants
//! - Every face of the result is a face of the input whose corners have moved; [`Decimated::origin`] names it.
//! - Equal input gives equal output; ties go to the lowest vertex numbers.
//! - No face of the result has a corner twice.
//!
//! # Cost
//! O(F log F) time; about 300 bytes a face.
//!
//! Based on: M. Garland, P. S. Heckbert. Surface Simplification Using Quadric Error Metrics. SIGGRAPH 1997.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use glam::DVec3;
use smallvec::SmallVec;

use super::quadric::Quadric;
use crate::mesh::geometry::{Aabb, area_vector, triangle_normal};

/// Weight of rims and marked edges against one plane.
const LINE_WEIGHT: f64 = 10.0;
/// The part of the squared edge length that is added to the cost.
const LENGTH_SHARE: f64 = 1e-4;
/// Faces may turn by at most about 78 degrees in one collapse.
const LEAST_TURN_COSINE: f64 = 0.2;

/// No vertex.
pub const NONE: u32 = u32::MAX;

/// A mesh with fewer faces.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Decimated {
    /// Coordinates.
    pub points: Vec<DVec3>,
    /// Corners.
    pub faces: Vec<[u32; 3]>,
    /// The face of the input that each face once was, in rising order.
    pub origin: Vec<u32>,
    /// The new vertex that each vertex of the input went into; [`NONE`] where no face is left of it.
    pub vertex: Vec<u32>,
}

/// Collapses edges until at most `target` faces are left, or no collapse is admitted any more. `lines` are edges whose
/// course matters, as pairs of vertices.
pub fn decimate(points: &[DVec3], faces: &[[u32; 3]], lines: &[[u32; 2]], target: usize) -> Decimated {
    let mut work = Work::new(points, faces, lines);
    while work.live > target {
        let Some(Reverse(item)) = work.heap.pop() else { break };
        if work.is_current(&item) && work.admits(item.ends, work.best(item.ends).1) {
            work.collapse(item.ends);
        }
    }
    work.finish()
}

/// An edge that waits for its collapse; ordered by cost, then by its ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Item {
    /// The bits of a cost that is not negative order as the cost does.
    cost: u64,
    ends: [u32; 2],
    /// The stamps of its ends when it was rated.
    stamps: [u32; 2],
}

struct Work {
    points: Vec<DVec3>,
    /// Subtracted in the quadrics, which would cancel far from the origin.
    centre: DVec3,
    faces: Vec<[u32; 3]>,
    alive: Vec<bool>,
    live: usize,
    around: Vec<SmallVec<[u32; 8]>>,
    quadrics: Vec<Quadric>,
    /// Raised whenever a vertex or its quadric changes.
    stamp: Vec<u32>,
    parent: Vec<u32>,
    heap: BinaryHeap<Reverse<Item>>,
}

impl Work {
    fn new(points: &[DVec3], faces: &[[u32; 3]], lines: &[[u32; 2]]) -> Self {
        let alive: Vec<bool> = faces.iter().map(|&[a, b, c]| a != b && b != c && c != a).collect();
        let mut around = vec![SmallVec::new(); points.len()];
        for (face, corners) in faces.iter().enumerate().filter(|(face, _)| alive[*face]) {
            for &v in corners {
                around[v as usize].push(face as u32);
            }
        }
        let mut work = Self {
            points: points.to_vec(),
            centre: Aabb::of(points.iter().copied()).centre(),
            faces: faces.to_vec(),
            live: alive.iter().filter(|alive| **alive).count(),
            alive,
            around,
            quadrics: vec![Quadric::default(); points.len()],
            stamp: vec![0; points.len()],
            parent: (0..points.len() as u32).collect(),
            heap: BinaryHeap::new(),
        };
        let edges = work.sum_quadrics(lines);
        for ends in edges {
            work.wait(ends);
        }
        work
    }

    /// Sums planes and lines at the vertices; gives all edges in order.
    fn sum_quadrics(&mut self, lines: &[[u32; 2]]) -> Vec<[u32; 2]> {
        let mut sides = Vec::with_capacity(3 * self.live);
        for (face, &[a, b, c]) in self.faces.iter().enumerate().filter(|(face, _)| self.alive[*face]) {
            let corners = [a, b, c].map(|v| self.points[v as usize]);
            if let Some(normal) = triangle_normal(corners) {
                let plane = Quadric::plane(normal, corners[0] - self.centre);
                for v in [a, b, c] {
                    self.quadrics[v as usize].add(&plane);
                }
            }
            debug_assert!(self.alive[face]);
            sides.extend([[a.min(b), a.max(b)], [b.min(c), b.max(c)], [c.min(a), c.max(a)]]);
        }
        sides.sort_unstable();
        let rims: Vec<[u32; 2]> =
            sides.chunk_by(|a, b| a == b).filter(|group| group.len() == 1).map(|group| group[0]).collect();
        for &[a, b] in rims.iter().chain(lines) {
            let (p, q) = (self.points[a as usize], self.points[b as usize]);
            if let Some(direction) = (q - p).try_normalize() {
                let line = Quadric::line(direction, p - self.centre, LINE_WEIGHT);
                self.quadrics[a as usize].add(&line);
                self.quadrics[b as usize].add(&line);
            }
        }
        sides.dedup();
        sides
    }

    /// The cheapest of both ends and the middle, with its cost.
    fn best(&self, [a, b]: [u32; 2]) -> (f64, DVec3) {
        let (p, q) = (self.points[a as usize], self.points[b as usize]);
        let sum = self.quadrics[a as usize].plus(&self.quadrics[b as usize]);
        let length = LENGTH_SHARE * (q - p).length_squared();
        let mut best = (f64::INFINITY, p);
        for x in [0.5 * (p + q), p, q] {
            let cost = sum.eval(x - self.centre) + length;
            if cost < best.0 {
                best = (cost, x);
            }
        }
        best
    }

    fn wait(&mut self, ends: [u32; 2]) {
        let stamps = ends.map(|v| self.stamp[v as usize]);
        self.heap.push(Reverse(Item { cost: self.best(ends).0.to_bits(), ends, stamps }));
    }

    fn is_current(&self, item: &Item) -> bool {
        item.ends.map(|v| self.stamp[v as usize]) == item.stamps
    }

    fn neighbours(&self, v: u32) -> SmallVec<[u32; 16]> {
        let faces = self.around[v as usize].iter().flat_map(|&f| self.faces[f as usize]);
        let mut all: SmallVec<[u32; 16]> = faces.filter(|&w| w != v).collect();
        all.sort_unstable();
        all.dedup();
        all
    }

    /// Whether merging both ends at `x` pinches nothing and turns no face over.
    fn admits(&self, [a, b]: [u32; 2], x: DVec3) -> bool {
        let shared = self.around[a as usize].iter().filter(|&&f| self.faces[f as usize].contains(&b)).count();
        let (of_a, of_b) = (self.neighbours(a), self.neighbours(b));
        let common = of_a.iter().filter(|v| of_b.binary_search(v).is_ok()).count();
        // Opposite corners of the shared faces are the only vertices that both may know; four faces are a tetrahedron.
        if shared == 0 || common != shared || self.live <= 4 {
            return false;
        }
        let keeps_side = |v: u32, other: u32| {
            self.around[v as usize].iter().map(|&f| self.faces[f as usize]).filter(|c| !c.contains(&other)).all(|c| {
                let before = area_vector(c.map(|w| self.points[w as usize]));
                let after = area_vector(c.map(|w| if w == v { x } else { self.points[w as usize] }));
                before == DVec3::ZERO || before.dot(after) > LEAST_TURN_COSINE * before.length() * after.length()
            })
        };
        keeps_side(a, b) && keeps_side(b, a)
    }

    /// Merges the second end into the first.
    fn collapse(&mut self, [kept, gone]: [u32; 2]) {
        self.points[kept as usize] = self.best([kept, gone]).1;
        let quadric = self.quadrics[gone as usize];
        self.quadrics[kept as usize].add(&quadric);
        self.parent[gone as usize] = kept;
        self.stamp[gone as usize] += 1;
        self.stamp[kept as usize] += 1;
        for face in std::mem::take(&mut self.around[gone as usize]) {
            let corners = &mut self.faces[face as usize];
            if corners.contains(&kept) {
                self.alive[face as usize] = false;
                self.live -= 1;
                for v in corners.iter().filter(|v| **v != gone) {
                    self.around[*v as usize].retain(|f| *f != face);
                }
            } else {
                corners.iter_mut().filter(|v| **v == gone).for_each(|v| *v = kept);
                self.around[kept as usize].push(face);
            }
        }
        for v in self.neighbours(kept) {
            self.wait([kept.min(v), kept.max(v)]);
        }
    }

    fn finish(mut self) -> Decimated {
        let mut new = vec![NONE; self.points.len()];
        let mut result = Decimated::default();
        for (face, corners) in self.faces.iter().enumerate().filter(|(face, _)| self.alive[*face]) {
            result.faces.push(corners.map(|v| {
                let slot = &mut new[v as usize];
                if *slot == NONE {
                    *slot = result.points.len() as u32;
                    result.points.push(self.points[v as usize]);
                }
                *slot
            }));
            result.origin.push(face as u32);
        }
        // A vertex only ever goes into one that stays longer, so the chain ends; halving it keeps it short.
        result.vertex = (0..self.parent.len() as u32)
            .map(|v| {
                let mut root = v;
                while self.parent[root as usize] != root {
                    let above = self.parent[self.parent[root as usize] as usize];
                    self.parent[root as usize] = above;
                    root = above;
                }
                new[root as usize]
            })
            .collect();
        result
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A square of `n` by `n` cells, raised along the middle to a ridge.
    fn roof(n: u32) -> (Vec<DVec3>, Vec<[u32; 3]>) {
        let at = |i: u32, j: u32| j * (n + 1) + i;
        let mut points = Vec::new();
        let mut faces = Vec::new();
        for j in 0..=n {
            for i in 0..=n {
                let height = f64::from(i.min(n - i)) * 0.5;
                points.push(DVec3::new(f64::from(i), f64::from(j), height));
                if i < n && j < n {
                    faces.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
                    faces.push([at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
                }
            }
        }
        (points, faces)
    }

    fn area(points: &[DVec3], faces: &[[u32; 3]]) -> f64 {
        faces.iter().map(|c| area_vector(c.map(|v| points[v as usize])).length() / 2.0).sum()
    }

    #[test]
    fn a_roof_keeps_its_ridge_and_its_rims() {
        let (points, faces) = roof(20);
        let result = decimate(&points, &faces, &[], 40);
        assert!(result.faces.len() <= 40);
        let (before, after) = (area(&points, &faces), area(&result.points, &result.faces));
        assert!((after / before - 1.0).abs() < 1e-9, "{before} became {after}");
        assert!(result.origin.windows(2).all(|pair| pair[0] < pair[1]));
        assert!(result.vertex.iter().filter(|v| **v != NONE).all(|v| (*v as usize) < result.points.len()));
    }

    #[test]
    fn a_closed_mesh_stays_closed_and_what_is_degenerate_does_no_harm() {
        let points = (0..8).map(|i| DVec3::new(f64::from(i & 1), f64::from(i >> 1 & 1), f64::from(i >> 2))).collect();
        let points: Vec<DVec3> = points;
        let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let mut faces: Vec<[u32; 3]> = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
        faces.push([1, 1, 2]);
        let result = decimate(&points, &faces, &[], 0);
        let mut sides: Vec<[u32; 2]> = Vec::new();
        for &[a, b, c] in &result.faces {
            sides.extend([[a, b], [b, c], [c, a]]);
        }
        assert!(!sides.is_empty() && sides.iter().all(|&[a, b]| sides.contains(&[b, a])));
        assert_eq!(decimate(&points, &faces, &[], 12).faces.len(), 12);
        assert_eq!(decimate(&[], &[], &[], 5), Decimated::default());
    }

    #[test]
    fn marked_lines_stay_where_they_are() {
        let (points, faces) = roof(20);
        // A zigzag across one flat side.
        let lines: Vec<[u32; 2]> = (1..8).map(|j| [j * 21 + 2 + j % 2, (j + 1) * 21 + 2 + (j + 1) % 2]).collect();
        let result = decimate(&points, &faces, &lines, 120);
        let kept = |v: u32| result.points[result.vertex[v as usize] as usize].distance(points[v as usize]) < 1e-9;
        assert!(lines.iter().flatten().filter(|v| kept(**v)).count() >= lines.len());
    }
}
