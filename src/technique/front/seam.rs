//! Closes a narrow wedge between two front edges: their far nodes become one.

use smallvec::{SmallVec, smallvec};

use super::Front;
use super::top::View;
use crate::technique::mixed::{Corners, NONE, Place};

/// Front edges that differ more in length are not seamed.
const RATIO: f64 = 2.5;

impl Front<'_, '_> {
    /// Joins the origin of `first` and the target of `second`, which meet in a node. Edges on curves stay.
    pub(super) fn seam(&mut self, first: u32, second: u32) -> bool {
        let (x, n, y) = (self.mesh.origin(first), self.mesh.target(first), self.mesh.target(second));
        let (p, q) = (self.mesh.length(first), self.mesh.length(second));
        let on_curve = self.mesh.arc(first) != NONE || self.mesh.arc(second) != NONE;
        let borders = [first, second].iter().any(|&h| self.mesh.face(h ^ 1) == NONE);
        let [free_x, free_y] = [x, y].map(|v| self.mesh.place(v).is_free());
        let apart = free_x && free_y && self.mesh.normal(x).dot(self.mesh.normal(y)) < 0.5;
        if apart || on_curve || borders || !(free_x || free_y) || x == y || p > RATIO * q || q > RATIO * p {
            return false;
        }
        self.mesh.begin();
        let Some(kept) = self.close(second, x, n, y) else {
            self.mesh.rollback();
            return false;
        };
        self.mesh.commit();
        self.smooth_around(&[kept, n]);
        let star: Vec<u32> = self.mesh.star(kept).flat_map(|k| [k, k ^ 1]).collect();
        let level = self.level(first);
        for k in star {
            if self.mesh.face(k) != NONE && self.is_front(k) {
                let level = self.level(k).max(level);
                self.wait(k, level);
            }
        }
        true
    }

    fn close(&mut self, second: u32, x: u32, n: u32, y: u32) -> Option<u32> {
        let normal = self.view_normal(second, &[x, n, y]);
        self.recover(y, x, &View::new(normal))?;
        let swallowed = self.flood(second, [n, y, x])?;
        let made = self.mesh.replace(&swallowed, &[smallvec![n, y, x]], None)?;
        let (gone, kept) = if self.mesh.place(x).is_free() { (x, y) } else { (y, x) };
        let old: SmallVec<[u32; 12]> = self.mesh.faces_at(gone).collect();
        let mut new: SmallVec<[Corners; 12]> = SmallVec::new();
        for &f in &old {
            if f != made[0] {
                let corners = self.mesh.corners(f);
                let moved: Corners = corners.iter().map(|&v| if v == gone { kept } else { v }).collect();
                // The triangle across the edge between both nodes vanishes with it.
                let both = moved.iter().filter(|&&v| v == kept).count() > 1;
                if both && corners.len() == 3 {
                    continue;
                }
                new.push(moved);
            }
        }
        let middle = 0.5 * (self.mesh.point(x) + self.mesh.point(y));
        self.mesh.replace(&old, &new, Some((gone, kept)))?;
        if let Place::Region(region) = self.mesh.place(kept) {
            let foot = self.ground.project(region, middle);
            self.mesh.set_point(kept, foot.point, foot.normal);
        }
        let sound = self.mesh.faces_at(kept).all(|f| self.mesh.quality(f) > 0.02);
        let ring: SmallVec<[u32; 12]> = self.mesh.neighbours(kept).collect();
        (sound && self.stars_are_sound(&[kept]) && self.stars_are_sound(&ring)).then_some(kept)
    }
}
