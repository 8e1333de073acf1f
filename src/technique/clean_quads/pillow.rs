//! Pillowing: a ring of quads between some quads and all others.
//!
//! The quads, a disk, shrink, and each edge of their rim gets a quad between where it was and where it is now. That
//! makes faces smaller at one place and nowhere else, on curves too: one that runs into the disk gets a vertex more for
//! each end.
//!
//! Based on: S. A. Mitchell, T. J. Tautges. Pillowing doublets: refining a mesh to ensure that faces share at most one
//! edge. 4th International Meshing Roundtable, 1995.

use rustc_hash::{FxHashMap, FxHashSet};
use smallvec::smallvec;

use super::Cleaner;
use crate::technique::mixed::{Corners, Mixed, NONE, Place};

/// Where the rim goes: this part of the way to the middles of the faces inside.
const INWARDS: f64 = 0.5;
/// The same along a curve, as a part of its edge.
const ALONG: f64 = 1.0 / 3.0;

/// A vertex of the rim, and where it goes.
struct Shifted {
    vertex: u32,
    /// The rim's next edge, as a side of a face inside.
    side: u32,
    /// The side that leaves the vertex along the curve that runs inwards from it.
    curve: Option<u32>,
}

/// The rim of some faces, counter-clockwise; `None` unless they are a disk of quads whose rim meets itself nowhere, and
/// of which at most one curve leaves each vertex of the rim inwards.
fn rim(mesh: &Mixed, faces: &[u32], inside: &FxHashSet<u32>) -> Option<Vec<Shifted>> {
    let mut sides: FxHashMap<u32, Shifted> = FxHashMap::default();
    let mut vertices: FxHashSet<u32> = FxHashSet::default();
    let mut inner = 0;
    for &f in faces {
        if mesh.is_triangle(f) {
            return None;
        }
        for h in mesh.sides(f) {
            let vertex = mesh.origin(h);
            vertices.insert(vertex);
            if inside.contains(&mesh.face(h ^ 1)) {
                inner += 1;
            } else if sides.insert(vertex, Shifted { vertex, side: h, curve: None }).is_some() {
                return None;
            }
        }
    }
    // Euler: faces - edges + vertices = 1.
    if inside.len() + vertices.len() != inner / 2 + sides.len() + 1 {
        return None;
    }
    let start = sides.keys().copied().min()?;
    let mut ring = Vec::with_capacity(sides.len());
    let mut at = start;
    while let Some(mut shifted) = sides.remove(&at) {
        let is_inner = |h: &u32| inside.contains(&mesh.face(*h)) && inside.contains(&mesh.face(h ^ 1));
        let mut curves = mesh.star(at).filter(|h| is_inner(h) && mesh.arc(*h) != NONE);
        shifted.curve = curves.next();
        if curves.next().is_some() {
            return None;
        }
        at = mesh.target(shifted.side);
        ring.push(shifted);
    }
    (at == start && sides.is_empty()).then_some(ring)
}

impl Cleaner<'_, '_> {
    /// Pillows some faces within an open transaction and smooths there. Returns the vertices that may have moved;
    /// `None` where it cannot be done, and the transaction must be rolled back.
    pub(super) fn pillow_about(&mut self, faces: &[u32]) -> Option<Vec<u32>> {
        let inside: FxHashSet<u32> = faces.iter().copied().collect();
        let ring = rim(self.mesh, faces, &inside)?;
        let crossed = self.inner_arcs(faces, &inside);
        let (mut moved, mut stubs) = (FxHashMap::default(), Vec::new());
        for shifted in &ring {
            let copy = self.shifted(shifted, &inside)?;
            moved.insert(shifted.vertex, copy);
            stubs.extend(shifted.curve.map(|h| (shifted.vertex, copy, self.mesh.arc(h))));
        }
        let now = |v: u32| moved.get(&v).copied().unwrap_or(v);
        let mut new: Vec<Corners> = Vec::new();
        let mut regions: Vec<u32> = Vec::new();
        for &f in faces {
            new.push(self.mesh.corners(f).into_iter().map(now).collect());
            regions.push(self.mesh.region(f));
        }
        for shifted in &ring {
            let (a, b) = (shifted.vertex, self.mesh.target(shifted.side));
            new.push(smallvec![a, b, now(b), now(a)]);
            regions.push(self.mesh.region(self.mesh.face(shifted.side)));
        }
        let made = self.mesh.replace(faces, &new, None)?;
        for (&f, &region) in made.iter().zip(&regions) {
            self.mesh.set_region(f, region);
        }
        for (a, b, arc) in crossed.into_iter().map(|(a, b, arc)| (now(a), now(b), arc)).chain(stubs) {
            let h = self.mesh.find(a, b)?;
            self.mesh.set_arc(h, arc);
        }
        let touched = self.corners_of(&made);
        self.relax(&touched, 3);
        self.search_at(&touched);
        Some(touched)
    }

    /// The edges inside that are on curves.
    fn inner_arcs(&self, faces: &[u32], inside: &FxHashSet<u32>) -> Vec<(u32, u32, u32)> {
        let sides = faces.iter().flat_map(|&f| self.mesh.sides(f));
        let on_curve =
            sides.filter(|&h| self.mesh.arc(h) != NONE && h & 1 == 0 && inside.contains(&self.mesh.face(h ^ 1)));
        on_curve.map(|h| (self.mesh.origin(h), self.mesh.target(h), self.mesh.arc(h))).collect()
    }

    /// A vertex of the rim where it goes; `None` where that is on another side of the body.
    fn shifted(&mut self, shifted: &Shifted, inside: &FxHashSet<u32>) -> Option<u32> {
        let mesh = &*self.mesh;
        let (v, size) = (shifted.vertex, mesh.size(shifted.vertex));
        if let Some(h) = shifted.curve {
            let arc = mesh.arc(h);
            let [from, to] = self.ground.ends_on(mesh, h);
            let at = from + ALONG * (to - from);
            let point = self.ground.curves[arc as usize].at(at);
            return Some(self.mesh.add_vertex(point, glam::DVec3::ZERO, Place::Arc { arc, at }, size));
        }
        let (mut sum, mut n) = (glam::DVec3::ZERO, 0.0);
        for f in mesh.faces_at(v).filter(|f| inside.contains(f)) {
            sum += mesh.centre(f);
            n += 1.0;
        }
        let region = mesh.region(mesh.face(shifted.side));
        let start = mesh.point(v);
        let foot = self.ground.project_from(region, start.lerp(sum / n, INWARDS), start);
        let is_near = self.is_near(v, foot.normal);
        is_near.then(|| self.mesh.add_vertex(foot.point, foot.normal, Place::Region(region), size))
    }
}
