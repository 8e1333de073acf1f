//! Cuts a region in two along the line that is as far from one seed as from another, on the surface.
//!
//! A region with several borders is cut through its shortest one: the line leaves that border where another border is
//! nearest, and at the opposite side, because the seeds sit between. Else the seeds are the two faces farthest apart.
//! Both parts are connected and smaller, so cutting on ends at the latest with single faces, which are disks.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap};

use glam::DVec3;

use super::dual::{Dual, NONE};
use crate::mesh::geometry::centroid;
use crate::mesh::{FaceId, Surface};

/// A border of a region: its sides in order, each a face and the length up to the side's middle.
struct Border {
    sides: Vec<(u32, f64)>,
    length: f64,
}

/// Cuts regions; keeps its memory from one cut to the next.
pub(super) struct Halver<'a> {
    surface: &'a Surface,
    dual: &'a Dual,
    inside: Vec<bool>,
    distance: Vec<f64>,
    origin: Vec<u32>,
}

impl<'a> Halver<'a> {
    pub(super) fn new(surface: &'a Surface, dual: &'a Dual) -> Self {
        let n = dual.len();
        Self { surface, dual, inside: vec![false; n], distance: vec![f64::INFINITY; n], origin: vec![NONE; n] }
    }

    /// Both parts of a region; `None` for a single face.
    pub(super) fn halve(&mut self, faces: &[u32]) -> Option<[Vec<u32>; 2]> {
        self.enter(faces);
        let borders = self.borders(faces);
        let seeds = if borders.len() > 1 { self.beside_a_border(faces, &borders) } else { None };
        let seeds = seeds.or_else(|| self.farthest(faces));
        let parts = seeds.and_then(|seeds| self.cut(faces, seeds));
        self.leave(faces);
        parts
    }

    /// Both parts of a region that has no border at all; `None` where it has one.
    pub(super) fn without_border(&mut self, faces: &[u32]) -> Option<[Vec<u32>; 2]> {
        self.enter(faces);
        let closed = self.borders(faces).is_empty();
        self.leave(faces);
        if closed { self.halve(faces) } else { None }
    }

    /// Both parts, grown from these faces.
    pub(super) fn between(&mut self, faces: &[u32], seeds: [u32; 2]) -> Option<[Vec<u32>; 2]> {
        self.enter(faces);
        let parts = self.cut(faces, seeds);
        self.leave(faces);
        parts
    }

    fn enter(&mut self, faces: &[u32]) {
        for &f in faces {
            self.inside[f as usize] = true;
        }
    }

    fn leave(&mut self, faces: &[u32]) {
        for &f in faces {
            self.inside[f as usize] = false;
        }
    }

    fn is_inside(&self, f: u32) -> bool {
        f != NONE && self.inside[f as usize]
    }

    fn centre(&self, f: u32) -> DVec3 {
        centroid(self.surface.corners(FaceId::from_raw(f)))
    }

    /// Distances from the sources over the faces inside, from middle to middle, and the source of each.
    fn spread(&mut self, faces: &[u32], sources: &[u32]) {
        for &f in faces {
            self.distance[f as usize] = f64::INFINITY;
            self.origin[f as usize] = NONE;
        }
        let mut heap = BinaryHeap::new();
        for &source in sources {
            self.distance[source as usize] = 0.0;
            self.origin[source as usize] = source;
            heap.push(Reverse((0_u64, source)));
        }
        while let Some(Reverse((bits, f))) = heap.pop() {
            if f64::from_bits(bits) > self.distance[f as usize] {
                continue;
            }
            let here = self.centre(f);
            let sides = self.dual.all[f as usize];
            for n in sides.into_iter().filter(|&n| n != NONE) {
                if !self.inside[n as usize] {
                    continue;
                }
                let far = self.distance[f as usize] + here.distance(self.centre(n));
                if far < self.distance[n as usize] {
                    self.distance[n as usize] = far;
                    self.origin[n as usize] = self.origin[f as usize];
                    // Distances are not negative, so their bits are in order.
                    heap.push(Reverse((far.to_bits(), n)));
                }
            }
        }
    }

    /// The face farthest from the sources, of equals the lowest.
    fn farthest_from(&mut self, faces: &[u32], source: u32) -> u32 {
        self.spread(faces, &[source]);
        let mut best = source;
        for &f in faces {
            if self.distance[f as usize].is_finite() && self.distance[f as usize] > self.distance[best as usize] {
                best = f;
            }
        }
        best
    }

    /// Two faces about as far apart as any.
    fn farthest(&mut self, faces: &[u32]) -> Option<[u32; 2]> {
        let a = self.farthest_from(faces, *faces.first()?);
        let b = self.farthest_from(faces, a);
        if a == b { faces.iter().find(|&&f| f != a).map(|&f| [a, f]) } else { Some([a, b]) }
    }

    /// The parts of the faces nearer to each seed; what neither reaches stays with the first.
    fn cut(&mut self, faces: &[u32], seeds: [u32; 2]) -> Option<[Vec<u32>; 2]> {
        if seeds[0] == seeds[1] {
            return None;
        }
        self.spread(faces, &seeds);
        let (leaves, stays): (Vec<u32>, Vec<u32>) = faces.iter().partition(|&&f| self.origin[f as usize] == seeds[1]);
        (!leaves.is_empty() && !stays.is_empty()).then_some([stays, leaves])
    }

    /// The borders of the faces inside, each as a loop of sides, shortest first.
    fn borders(&self, faces: &[u32]) -> Vec<Border> {
        let mut next: BTreeMap<u32, Vec<(u32, u32)>> = BTreeMap::new();
        for &f in faces {
            let corners = self.surface.faces[FaceId::from_raw(f)];
            for k in 0..3 {
                if !self.is_inside(self.dual.all[f as usize][k]) {
                    next.entry(corners[k].raw()).or_default().push((corners[(k + 1) % 3].raw(), f));
                }
            }
        }
        let point = |v: u32| self.surface.points[crate::mesh::VertexId::from_raw(v)];
        let mut borders = Vec::new();
        while let Some((&start, _)) = next.first_key_value() {
            let mut border = Border { sides: Vec::new(), length: 0.0 };
            let mut at = start;
            while let Some(sides) = next.get_mut(&at) {
                let Some((to, f)) = sides.pop() else { break };
                if sides.is_empty() {
                    next.remove(&at);
                }
                let side = point(at).distance(point(to));
                border.sides.push((f, border.length + 0.5 * side));
                border.length += side;
                at = to;
            }
            if border.sides.is_empty() {
                break;
            }
            borders.push(border);
        }
        borders.sort_by(|a, b| a.length.total_cmp(&b.length).then(a.sides[0].0.cmp(&b.sides[0].0)));
        borders
    }

    /// Seeds a quarter round the shortest border from where another border is nearest.
    fn beside_a_border(&mut self, faces: &[u32], borders: &[Border]) -> Option<[u32; 2]> {
        let (hole, others) = borders.split_first()?;
        let sources: Vec<u32> = hole.sides.iter().map(|side| side.0).collect();
        self.spread(faces, &sources);
        let reached = others.iter().flat_map(|border| &border.sides).map(|side| side.0);
        let nearest =
            reached.min_by(|&a, &b| self.distance[a as usize].total_cmp(&self.distance[b as usize]).then(a.cmp(&b)))?;
        let from = self.origin[nearest as usize];
        let start = hole.sides.iter().find(|side| side.0 == from)?.1;
        let at = |share: f64| {
            let place = (start + share * hole.length) % hole.length;
            let away = |x: f64| (x - place).abs().min(hole.length - (x - place).abs());
            hole.sides.iter().min_by(|a, b| away(a.1).total_cmp(&away(b.1))).map(|side| side.0)
        };
        let (a, b) = (at(0.25)?, at(0.75)?);
        (a != b).then_some([a, b])
    }
}
