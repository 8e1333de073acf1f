//! The sharp corners of regions: each gets its quad before anything else.
//!
//! Between two curves that meet in a sharp angle a row of quads can only end in a triangle. Two rows can start there,
//! from a kite with a corner of its own ahead of the chord; so sharp corners are given their kites first.

use smallvec::smallvec;

use super::Front;
use super::top::View;
use crate::technique::mixed::{Place, quad_quality};

/// Corners below this angle, in radians, are wedges.
const WEDGE: f64 = 1.05;

impl Front<'_, '_> {
    /// Puts a kite into every sharp corner between two curves.
    pub(super) fn fill_wedges(&mut self) {
        for h in 0..self.mesh.halfedge_slots() {
            if !self.mesh.is_halfedge(h) || !self.is_front(h) {
                continue;
            }
            let (after, angle) = self.after(h);
            if angle < WEDGE && self.is_bound(h) && self.is_bound(after) && after != h {
                self.mesh.begin();
                if self.kite(h, after) {
                    self.mesh.commit();
                    self.report.quads += 1;
                } else {
                    self.mesh.rollback();
                }
            }
        }
    }

    fn is_bound(&self, h: u32) -> bool {
        self.mesh.arc(h) != crate::technique::mixed::NONE
    }

    /// Makes the quad between `first`, which ends in the corner, and `second`, which starts there.
    fn kite(&mut self, first: u32, second: u32) -> bool {
        let (b, n, a) = (self.mesh.origin(first), self.mesh.target(first), self.mesh.target(second));
        let normal = self.view_normal(second, &[b, n, a]);
        let region = self.mesh.region(self.mesh.face(second));
        let Some(chord) = self.recover(a, b, &View::new(normal)) else { return false };
        let Some(swallowed) = self.flood(second, [n, a, b]) else { return false };
        let across = self.mesh.face(chord ^ 1);
        if self.is_bound(chord) || across == crate::technique::mixed::NONE || !self.mesh.is_triangle(across) {
            return false;
        }
        let far = self.mesh.origin(self.mesh.prev(chord ^ 1));
        let [pa, pb, pn] = [a, b, n].map(|v| self.mesh.point(v));
        let middle = 0.5 * (pa + pb);
        let foot = self.ground.project(region, middle);
        let size = 0.5 * (self.mesh.size(a) + self.mesh.size(b));
        let x = self.mesh.add_vertex(foot.point, foot.normal, Place::Region(region), size);
        let mut old = swallowed;
        old.push(across);
        if self.mesh.replace(&old, &[smallvec![n, a, x, b], smallvec![x, a, far], smallvec![b, x, far]], None).is_none()
        {
            return false;
        }
        // As far ahead as the triangles there allow, at most to where the kite has its best shape.
        let ahead = (middle - pn).normalize_or_zero() * (pa - pb).length();
        for share in [0.5, 0.35, 0.2, 0.1] {
            let foot = self.ground.project(region, middle + share * ahead);
            if self.may_move(x, foot.point, foot.normal) {
                self.mesh.set_point(x, foot.point, foot.normal);
                break;
            }
        }
        quad_quality([n, a, x, b].map(|v| self.mesh.point(v))) > 0.05 && self.stars_are_sound(&[n, a, b, x])
    }
}
