//! Puts a quad into the place of the triangles between its four sides.

use glam::DVec3;
use smallvec::{SmallVec, smallvec};

use super::Front;
use super::top::View;
use crate::technique::mixed::{NONE, quad_quality};

/// Triangles that a quad may swallow.
const SWALLOW: usize = 40;
/// The shortest side of a new quad, as a part of the size there.
const TINY: f64 = 0.4;
/// A new quad must not be worse than this.
const LEAST: f64 = 0.08;

impl Front<'_, '_> {
    /// Makes a quad on the front edge `h`. `None` where it cannot be had; then the transaction must be undone.
    pub(super) fn form(&mut self, h: u32, shy: bool) -> Option<u32> {
        let (a, b) = (self.mesh.origin(h), self.mesh.target(h));
        let h_length = self.mesh.length(h);
        let c = self.side(h, true, None, shy)?;
        let mut d = self.side(h, false, Some(c), shy)?;
        let mut c = c;
        if c == d {
            // The left side is given by the front: the right one has to give way.
            c = self.side(h, true, Some(d), true)?;
            if c == d {
                return None;
            }
            d = self.side(h, false, Some(c), shy)?;
        }
        let distinct = c != d && c != a && d != b && c != b && d != a;
        if !distinct || self.mesh.find(b, c).is_none() || self.mesh.find(d, a).is_none() {
            return None;
        }
        let normal = self.view_normal(h, &[a, b, c, d]);
        self.recover(c, d, &View::new(normal))?;
        let swallowed = self.flood(h, [a, b, c, d])?;
        let made = self.mesh.replace(&swallowed, &[smallvec![a, b, c, d]], None)?;
        let quad = made[0];
        let points = [a, b, c, d].map(|v| self.mesh.point(v));
        let face_normal = self.mesh.face_normal(quad);
        let fits = |v: &u32| !self.mesh.place(*v).is_free() || face_normal.dot(self.mesh.normal(*v)) > 0.35;
        let upright = face_normal.dot(normal) > 0.3 && [a, b, c, d].iter().all(fits);
        if self.is_tiny(points, h_length, &[c, d])
            || quad_quality(points) < LEAST
            || !upright
            || !self.stars_are_sound(&[a, b, c, d])
        {
            return None;
        }
        Some(quad)
    }

    /// Whether a side is much shorter than asked for: rows of ever smaller quads would never close.
    fn is_tiny(&self, p: [DVec3; 4], base: f64, top: &[u32]) -> bool {
        let shortest = (1..4).map(|i| (p[(i + 1) % 4] - p[i]).length()).fold(f64::INFINITY, f64::min);
        let size = top.iter().map(|&v| self.mesh.size(v)).fold(f64::INFINITY, f64::min);
        shortest < TINY * size.min(2.0 * base)
    }

    /// The mean normal of the triangles at the front's side of these vertices.
    pub(super) fn view_normal(&self, h: u32, vertices: &[u32]) -> DVec3 {
        let region = self.mesh.region(self.mesh.face(h));
        let mut sum = DVec3::ZERO;
        for &v in vertices {
            for f in self.mesh.faces_at(v) {
                if self.mesh.region(f) == region && self.mesh.is_triangle(f) {
                    sum += crate::mesh::geometry::area_vector(self.mesh.triangle(f));
                }
            }
        }
        sum.normalize_or(self.mesh.face_normal(self.mesh.face(h)))
    }

    /// The triangles on the left of `h` inside the loop, or `None` where the way out is open or a node lies inside.
    pub(super) fn flood<const N: usize>(&self, h: u32, ring: [u32; N]) -> Option<SmallVec<[u32; 8]>> {
        let is_side = |k: u32| {
            let (from, to) = (self.mesh.origin(k), self.mesh.target(k));
            (0..N).any(|i| ring[i] == from && ring[(i + 1) % N] == to)
        };
        let mut found: SmallVec<[u32; 8]> = smallvec![self.mesh.face(h)];
        let mut at = 0;
        while at < found.len() {
            for k in self.mesh.sides(found[at]) {
                if is_side(k) {
                    continue;
                }
                let across = self.mesh.face(k ^ 1);
                let inside = !ring.contains(&self.mesh.origin(k));
                if across == NONE
                    || self.mesh.arc(k) != NONE
                    || !self.mesh.is_triangle(across)
                    || (inside && !self.mesh.place(self.mesh.origin(k)).is_free())
                    || found.len() > SWALLOW
                {
                    return None;
                }
                if !found.contains(&across) {
                    found.push(across);
                }
            }
            at += 1;
        }
        Some(found)
    }

    /// Whether the stars of these vertices are proper and none of their triangles is turned.
    pub(super) fn stars_are_sound(&self, vertices: &[u32]) -> bool {
        vertices.iter().all(|&v| {
            self.mesh.is_proper(v, 2)
                && self.mesh.faces_at(v).all(|f| {
                    let reference = self.reference(f);
                    reference == DVec3::ZERO || self.mesh.face_normal(f).dot(reference) > 0.0
                })
        })
    }

    /// The surface normal at a face as its free corners know it; zero where none does.
    pub(super) fn reference(&self, f: u32) -> DVec3 {
        let mut sum = DVec3::ZERO;
        for h in self.mesh.sides(f) {
            let v = self.mesh.origin(h);
            if self.mesh.place(v).is_free() {
                sum += self.mesh.normal(v);
            }
        }
        sum.normalize_or_zero()
    }
}
