//! A triangulation of a loop: the smallest bend first, then the smallest area.
//!
//! Barequet, Sharir: Filling gaps in the boundary of a polyhedron. CAGD 12, 1995, with the weight of Liepa: Filling
//! holes in meshes. SGP 2003: dynamic programming over the loop's intervals, O(n³) time and O(n²) memory. Loops beyond
//! [`LARGEST_EXACT`] corners are closed by cutting the best ear again and again.

use std::collections::BTreeSet;

use glam::DVec3;

/// Corners up to which the best triangulation is found; its time grows with the cube.
pub const LARGEST_EXACT: usize = 500;

/// A loop to fill. It runs the way the faces beside it run.
pub struct Loop<'a> {
    /// Its corners.
    pub points: &'a [DVec3],
    /// The normal of the face beside each edge; edge `i` begins at corner `i`.
    pub normals: &'a [DVec3],
    /// Whether an edge between two corners that are not neighbours is free.
    pub is_free: &'a dyn Fn(usize, usize) -> bool,
}

/// Triangles over the corners of a loop.
pub struct Triangulation {
    /// Corners of each triangle, which continue the orientation of the faces beside the loop.
    pub triangles: Vec<[usize; 3]>,
    /// The largest bend at any edge: 1 minus the cosine of the angle between the normals, so 0 is flat and 2 folded.
    pub bend: f64,
    /// The largest bend at the loop itself.
    pub rim_bend: f64,
}

/// The bend of a triangle without area: worse than folded, but better than no triangulation.
const NO_AREA: f64 = 3.0;

impl Loop<'_> {
    /// The unit normal of the triangle over corners `i < m < k`, or `None` without area.
    fn normal(&self, i: usize, m: usize, k: usize) -> Option<DVec3> {
        let [a, b, c] = [k, m, i].map(|corner| self.points[corner]);
        (b - a).cross(c - a).try_normalize()
    }

    fn area(&self, i: usize, m: usize, k: usize) -> f64 {
        let [a, b, c] = [i, m, k].map(|corner| self.points[corner]);
        0.5 * (b - a).cross(c - a).length()
    }

    /// The best triangulation found, or `None` when every one needs an edge that is not free.
    pub fn triangulate(&self) -> Option<Triangulation> {
        let triangles = if self.points.len() <= LARGEST_EXACT { self.best() } else { self.ears() }?;
        Some(self.describe(triangles))
    }

    fn best(&self) -> Option<Vec<[usize; 3]>> {
        let count = self.points.len();
        let mut table = Table::new(count);
        for span in 2..count {
            for i in 0..count - span {
                let k = i + span;
                if (i, k) != (0, count - 1) && !(self.is_free)(i, k) {
                    continue;
                }
                let mut best = ((f64::INFINITY, f64::INFINITY), 0);
                for m in i + 1..k {
                    // Of equal ones the lowest stays. Most are worse already without the triangle between.
                    let weight = self.weigh(&table, i, m, k, best.0.0);
                    if let Some(weight) = weight.filter(|weight| *weight < best.0) {
                        best = (weight, m);
                    }
                }
                if best.1 > 0 {
                    table.set(i, k, best.0, best.1);
                }
            }
        }
        table.triangles(count)
    }

    /// The largest bend and the area of the triangulation of `i..=k` that has the triangle over `i`, `m`, `k`; `None`
    /// when there is none, or when it bends more than `limit`.
    fn weigh(&self, table: &Table, i: usize, m: usize, k: usize, limit: f64) -> Option<(f64, f64)> {
        let (left, right) = (table.get(i, m)?, table.get(m, k)?);
        let mut bend = left.0.max(right.0);
        if bend > limit {
            return None;
        }
        match self.normal(i, m, k) {
            None => bend = bend.max(NO_AREA),
            Some(normal) => {
                for (from, to) in [(i, m), (m, k)] {
                    bend = bend.max(self.beside(table, from, to).map_or(NO_AREA, |other| 1.0 - normal.dot(other)));
                }
                if (i, k) == (0, self.points.len() - 1) {
                    bend = bend.max(1.0 - normal.dot(self.normals[k]));
                }
            }
        }
        Some((bend, left.1 + right.1 + self.area(i, m, k)))
    }

    /// The normal across the chord: of the face beside the loop, or of the triangle chosen there.
    fn beside(&self, table: &Table, from: usize, to: usize) -> Option<DVec3> {
        if to == from + 1 { Some(self.normals[from]) } else { self.normal(from, table.middle(from, to), to) }
    }

    /// Cuts the ear that bends least and is sharpest until three corners are left.
    fn ears(&self) -> Option<Vec<[usize; 3]>> {
        let count = self.points.len();
        let mut next: Vec<usize> = (0..count).map(|i| (i + 1) % count).collect();
        let mut previous: Vec<usize> = (0..count).map(|i| (i + count - 1) % count).collect();
        // The normal across the edge from each corner to its next one.
        let mut across = self.normals.to_vec();
        let mut queue = BTreeSet::new();
        let mut costs = vec![0_u64; count];
        for i in 0..count {
            costs[i] = self.ear_cost(&across, previous[i], i, next[i]);
            queue.insert((costs[i], i));
        }
        let mut triangles = Vec::with_capacity(count - 2);
        while triangles.len() + 3 < count + 1 {
            let (_, tip) = queue
                .iter()
                .copied()
                .find(|&(_, i)| triangles.len() + 3 == count || (self.is_free)(previous[i], next[i]))?;
            queue.remove(&(costs[tip], tip));
            let (before, after) = (previous[tip], next[tip]);
            triangles.push([after, tip, before]);
            across[before] = self.ear_normal(before, tip, after).unwrap_or(across[before]);
            (next[before], previous[after]) = (after, before);
            for i in [before, after] {
                queue.remove(&(costs[i], i));
                costs[i] = self.ear_cost(&across, previous[i], i, next[i]);
                queue.insert((costs[i], i));
            }
        }
        Some(triangles)
    }

    fn ear_normal(&self, before: usize, tip: usize, after: usize) -> Option<DVec3> {
        let [a, b, c] = [after, tip, before].map(|corner| self.points[corner]);
        (b - a).cross(c - a).try_normalize()
    }

    /// Bits of a positive number: bend plus opening angle in half turns.
    fn ear_cost(&self, across: &[DVec3], before: usize, tip: usize, after: usize) -> u64 {
        let bend = self
            .ear_normal(before, tip, after)
            .map_or(NO_AREA, |normal| (1.0 - normal.dot(across[before])).max(1.0 - normal.dot(across[tip])));
        let [a, b, c] = [before, tip, after].map(|corner| self.points[corner]);
        let opening = crate::mesh::geometry::angle(a - b, c - b) / std::f64::consts::PI;
        (bend.max(0.0) + opening).to_bits()
    }

    fn describe(&self, triangles: Vec<[usize; 3]>) -> Triangulation {
        let count = self.points.len();
        let normal = |t: [usize; 3]| {
            let [a, b, c] = t.map(|corner| self.points[corner]);
            (b - a).cross(c - a).try_normalize()
        };
        let mut sides: Vec<([usize; 2], Option<DVec3>)> =
            (0..count).map(|i| (sorted(i, (i + 1) % count), Some(self.normals[i]))).collect();
        for &t in &triangles {
            sides.extend((0..3).map(|i| (sorted(t[i], t[(i + 1) % 3]), normal(t))));
        }
        sides.sort_by_key(|(edge, _)| *edge);
        let (mut bend, mut rim_bend) = (0.0_f64, 0.0_f64);
        for pair in sides.chunk_by(|a, b| a.0 == b.0) {
            let Some((first, second)) = pair.first().zip(pair.get(1)) else { continue };
            let here = first.1.zip(second.1).map_or(NO_AREA, |(n, m)| 1.0 - n.dot(m));
            bend = bend.max(here);
            let [i, j] = first.0;
            if j == i + 1 || (i == 0 && j == count - 1) {
                rim_bend = rim_bend.max(here);
            }
        }
        Triangulation { triangles, bend, rim_bend }
    }
}

fn sorted(a: usize, b: usize) -> [usize; 2] {
    if a < b { [a, b] } else { [b, a] }
}

/// The best weight and middle corner of each interval.
struct Table {
    count: usize,
    cells: Vec<(f64, f64, u16)>,
}

impl Table {
    fn new(count: usize) -> Self {
        let mut table = Self { count, cells: vec![(f64::NAN, 0.0, 0); count * count] };
        for i in 0..count - 1 {
            table.cells[i * count + i + 1] = (0.0, 0.0, 0);
        }
        table
    }

    fn get(&self, i: usize, k: usize) -> Option<(f64, f64)> {
        let (bend, area, _) = self.cells[i * self.count + k];
        (!bend.is_nan()).then_some((bend, area))
    }

    fn set(&mut self, i: usize, k: usize, (bend, area): (f64, f64), middle: usize) {
        self.cells[i * self.count + k] = (bend, area, middle as u16);
    }

    fn middle(&self, i: usize, k: usize) -> usize {
        usize::from(self.cells[i * self.count + k].2)
    }

    fn triangles(&self, count: usize) -> Option<Vec<[usize; 3]>> {
        self.get(0, count - 1)?;
        let mut triangles = Vec::with_capacity(count - 2);
        let mut open = vec![(0, count - 1)];
        while let Some((i, k)) = open.pop() {
            if k > i + 1 {
                let m = self.middle(i, k);
                triangles.push([k, m, i]);
                open.extend([(i, m), (m, k)]);
            }
        }
        Some(triangles)
    }
}
