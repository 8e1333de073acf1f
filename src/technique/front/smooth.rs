//! Smoothing round a new quad.

use glam::DVec3;
use smallvec::SmallVec;

use super::Front;
use crate::technique::mixed::{Place, corner_sine};

impl Front<'_, '_> {
    /// Smooths the free vertices among these and their neighbours.
    pub(super) fn smooth_around(&mut self, vertices: &[u32]) {
        let mut all: SmallVec<[u32; 24]> = SmallVec::from_slice(vertices);
        for &v in vertices {
            all.extend(self.mesh.neighbours(v));
        }
        all.sort_unstable();
        all.dedup();
        for v in all {
            let Place::Region(region) = self.mesh.place(v) else { continue };
            let wish = self.wish(v);
            let now = self.mesh.point(v);
            for share in [1.0, 0.4] {
                let foot = self.ground.project_from(region, now.lerp(wish, share), now);
                if self.may_move(v, foot.point, foot.normal) {
                    self.mesh.set_point(v, foot.point, foot.normal);
                    break;
                }
            }
        }
    }

    /// Where a vertex would like to be: the corner that makes its quads parallelograms; without quads, the middle.
    fn wish(&self, v: u32) -> DVec3 {
        let (mut sum, mut count) = (DVec3::ZERO, 0.0);
        let now = self.mesh.point(v);
        let (mut mixed, mut ring, mut spokes) = (false, DVec3::ZERO, 0.0);
        for h in self.mesh.star(v) {
            let face = self.mesh.face(h);
            ring += self.mesh.point(self.mesh.target(h));
            spokes += 1.0;
            if self.mesh.is_triangle(face) {
                mixed = true;
                continue;
            }
            let (right, left) = (self.mesh.target(h), self.mesh.origin(self.mesh.prev(h)));
            let opposite = self.mesh.target(self.mesh.next(h));
            sum += self.mesh.point(right) + self.mesh.point(left) - self.mesh.point(opposite);
            count += 1.0;
        }
        match (count > 0.0, mixed) {
            // A finished vertex: the middle of its neighbours; one at the front: half way to the parallelograms'
            // corner.
            (true, false) | (false, _) => ring / spokes,
            (true, true) => now.lerp(sum / count, 0.5),
        }
    }

    /// Whether no face at `v` is turned, or gets much worse than it is, when `v` moves.
    pub(super) fn may_move(&self, v: u32, to: DVec3, normal: DVec3) -> bool {
        if normal.dot(self.mesh.normal(v)) < 0.5 && self.mesh.normal(v) != DVec3::ZERO {
            // That would be another side of the body.
            return false;
        }
        let at = |w: u32| if w == v { to } else { self.mesh.point(w) };
        self.mesh.faces_at(v).all(|f| {
            let corners = self.mesh.corners(f);
            let n = corners.len();
            let sine = |position: &dyn Fn(u32) -> DVec3| {
                (0..n)
                    .map(|i| {
                        let [a, b, c] = [corners[(i + n - 1) % n], corners[i], corners[(i + 1) % n]].map(position);
                        corner_sine(a, b, c, normal)
                    })
                    .fold(f64::INFINITY, f64::min)
            };
            let after = sine(&at);
            after > 0.15 || after > sine(&|w| self.mesh.point(w))
        })
    }
}
