//! The top edge of a quad, recovered by flips.

use glam::{DVec2, DVec3, dvec2};
use smallvec::SmallVec;

use super::Front;
use crate::technique::mixed::NONE;

/// Edges that a top edge may cross.
const CROSSINGS: usize = 24;

/// A plane to look at a neighbourhood in.
pub(super) struct View {
    x: DVec3,
    y: DVec3,
}

impl View {
    /// The plane across a normal.
    pub(super) fn new(normal: DVec3) -> Self {
        let x = normal.any_orthonormal_vector();
        Self { x, y: normal.cross(x) }
    }

    fn flat(&self, p: DVec3) -> DVec2 {
        dvec2(self.x.dot(p), self.y.dot(p))
    }
}

/// Twice the area of a triangle in the plane.
fn area(a: DVec2, b: DVec2, c: DVec2) -> f64 {
    (b - a).perp_dot(c - a)
}

impl Front<'_, '_> {
    /// The half-edge from `from` to `to`, made by flips of triangles where there is none.
    pub(super) fn recover(&mut self, from: u32, to: u32, view: &View) -> Option<u32> {
        if let Some(h) = self.mesh.find(from, to) {
            return Some(h);
        }
        let origin = self.mesh.point(from);
        let flat = |front: &Self, v: u32| view.flat(front.mesh.point(v) - origin);
        let mut crossed = self.crossed(from, to, &flat)?;
        let end = flat(self, to);
        let start = DVec2::ZERO;
        let (mut idle, mut flips) = (0, 0);
        while let Some(h) = crossed.pop_front() {
            let (a, b) = (self.mesh.origin(h), self.mesh.target(h));
            let (c, d) = (self.mesh.origin(self.mesh.prev(h)), self.mesh.origin(self.mesh.prev(h ^ 1)));
            let [p, q, r, s] = [a, b, c, d].map(|v| flat(self, v));
            let scale = 0.02 * ((p - q).length_squared() + (r - s).length_squared());
            let convex = area(p, s, r) > scale && area(s, q, r) > scale;
            if !convex || !self.flip(h) {
                crossed.push_back(h);
                idle += 1;
                if idle > crossed.len() {
                    return None;
                }
                continue;
            }
            idle = 0;
            flips += 1;
            if flips > 3 * CROSSINGS {
                return None;
            }
            let made = self.mesh.find(c, d)?;
            let ends_here = [c, d].iter().any(|v| *v == from || *v == to);
            if !ends_here && area(start, end, r) * area(start, end, s) < 0.0 {
                crossed.push_back(made);
            }
        }
        self.mesh.find(from, to)
    }

    /// The edges between `from` and `to` in the view, or `None` where the way meets what may not be flipped.
    fn crossed(
        &self,
        from: u32,
        to: u32,
        flat: &impl Fn(&Self, u32) -> DVec2,
    ) -> Option<std::collections::VecDeque<u32>> {
        let end = flat(self, to);
        let first = self.mesh.star(from).find_map(|k| {
            let face = self.mesh.face(k);
            if face == NONE || !self.mesh.is_triangle(face) {
                return None;
            }
            let edge = self.mesh.next(k);
            let (p, q) = (flat(self, self.mesh.origin(edge)), flat(self, self.mesh.target(edge)));
            let ahead = area(DVec2::ZERO, p, end) >= 0.0 && area(DVec2::ZERO, q, end) < 0.0;
            (ahead && area(DVec2::ZERO, p, q) > 0.0).then_some(edge)
        })?;
        let mut list: SmallVec<[u32; CROSSINGS]> = SmallVec::new();
        let mut edge = first;
        loop {
            let t = edge ^ 1;
            let face = self.mesh.face(t);
            if self.mesh.arc(edge) != NONE || face == NONE || !self.mesh.is_triangle(face) || list.len() >= CROSSINGS {
                return None;
            }
            list.push(edge);
            let apex = self.mesh.origin(self.mesh.prev(t));
            if apex == to {
                return Some(list.into_iter().collect());
            }
            // The apex left of the way: go on through the edge on its right.
            edge = if area(DVec2::ZERO, end, flat(self, apex)) > 0.0 { self.mesh.next(t) } else { self.mesh.prev(t) };
        }
    }
}
