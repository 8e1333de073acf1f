//! Split, collapse, flip and move of triangles, each checked before it is kept.

use glam::DVec3;
use smallvec::{SmallVec, smallvec};

use super::Remesher;
use super::adapt::SHARE;
use crate::mesh::geometry::area_vector;
use crate::technique::mixed::{Corners, Mixed, NONE, Place, triangle_quality};

/// Cosine that new faces must keep with the faces they replace.
const TURN: f64 = 0.3;

/// Cosine that a face must have with the surface at its free corners.
const SIDE: f64 = 0.2;

/// Vertices nearer to each other than this part of the size stand in each other's way.
const STACKED: f64 = 0.25;

/// Triangles of poorer shape are flat, but for rounding.
const FLAT: f64 = 1e-7;

fn upright(corners: [DVec3; 3], normal: DVec3) -> bool {
    let vector = area_vector(corners);
    vector.dot(normal) > TURN * vector.length() && triangle_quality(corners) > 1e-6
}

/// Whether a face that was of quality `was` and had the area vector `reference` keeps its side: well-shaped ones within
/// the turn allowed, needles at least not over; those without area have no side.
fn keeps_side(was: f64, reference: DVec3, after: [DVec3; 3]) -> bool {
    if was >= 0.05 {
        return upright(after, reference.normalize_or_zero());
    }
    was < FLAT || area_vector(after).dot(reference) > 0.0
}

impl Remesher<'_, '_> {
    /// Puts a vertex into the edge of `h`. Returns it, or `None` where a new face would be turned.
    pub(super) fn split(&mut self, h: u32, point: DVec3, normal: DVec3, place: Place, size: f64) -> Option<u32> {
        let (a, b) = (self.mesh.origin(h), self.mesh.target(h));
        let arc = self.mesh.arc(h);
        let old: SmallVec<[u32; 2]> =
            [h, h ^ 1].into_iter().map(|k| self.mesh.face(k)).filter(|&f| f != NONE).collect();
        for k in [h, h ^ 1] {
            if self.mesh.face(k) == NONE || arc != NONE {
                continue;
            }
            let apex = self.mesh.point(self.mesh.origin(self.mesh.prev(k)));
            let reference = area_vector(self.mesh.triangle(self.mesh.face(k)));
            let (p, q) = (self.mesh.point(self.mesh.origin(k)), self.mesh.point(self.mesh.target(k)));
            let flat = reference.length_squared() == 0.0;
            let turned = |t| area_vector(t).dot(reference) <= 0.0;
            if !flat && (turned([p, point, apex]) || turned([point, q, apex])) {
                return None;
            }
        }
        self.mesh.begin();
        let v = self.mesh.add_vertex(point, normal, place, size);
        let mut new: SmallVec<[Corners; 4]> = SmallVec::new();
        let mut regions: SmallVec<[u32; 4]> = SmallVec::new();
        for k in [h, h ^ 1] {
            if self.mesh.face(k) != NONE {
                regions.extend([self.mesh.region(self.mesh.face(k)); 2]);
                let apex = self.mesh.origin(self.mesh.prev(k));
                let (p, q) = (self.mesh.origin(k), self.mesh.target(k));
                new.push(smallvec![p, v, apex]);
                new.push(smallvec![v, q, apex]);
            }
        }
        if !replace_in_regions(self.mesh, &old, &new, &regions, None) {
            self.mesh.rollback();
            return None;
        }
        for end in [a, b] {
            if let Some(k) = self.mesh.find(v, end) {
                self.mesh.set_arc(k, arc);
            }
        }
        self.mesh.commit();
        Some(v)
    }

    /// Draws the target of `h` into its origin.
    pub(super) fn collapse(&mut self, h: u32) -> bool {
        let (kept, gone) = (self.mesh.origin(h), self.mesh.target(h));
        let on_arc = self.mesh.arc(h) != NONE;
        match self.mesh.place(gone) {
            Place::Node => return false,
            Place::Arc { .. } if !on_arc => return false,
            Place::Arc { .. } | Place::Region(_) => {}
        }
        let apexes: SmallVec<[u32; 2]> = [h, h ^ 1]
            .into_iter()
            .filter(|&k| self.mesh.face(k) != NONE)
            .map(|k| self.mesh.origin(self.mesh.prev(k)))
            .collect();
        if !self.keeps_apexes(h, &apexes) || !self.may_collapse(gone, kept, on_arc) {
            return false;
        }
        let old: SmallVec<[u32; 12]> = self.mesh.faces_at(gone).collect();
        let mut new: SmallVec<[Corners; 12]> = SmallVec::new();
        let mut regions: SmallVec<[u32; 12]> = SmallVec::new();
        for &f in &old {
            let corners = self.mesh.corners(f);
            if !corners.contains(&kept) {
                new.push(corners.iter().map(|&v| if v == gone { kept } else { v }).collect());
                regions.push(self.mesh.region(f));
            }
        }
        if new.is_empty() {
            return false;
        }
        self.mesh.begin();
        if replace_in_regions(self.mesh, &old, &new, &regions, Some((gone, kept))) {
            self.mesh.commit();
            true
        } else {
            self.mesh.rollback();
            false
        }
    }

    /// Whether the corners opposite to an edge allow its collapse: as the only neighbours of both ends, with enough
    /// faces left.
    fn keeps_apexes(&self, h: u32, apexes: &[u32]) -> bool {
        let (kept, gone) = (self.mesh.origin(h), self.mesh.target(h));
        let ring: SmallVec<[u32; 16]> = self.mesh.neighbours(kept).collect();
        let common = self.mesh.neighbours(gone).filter(|w| ring.contains(w)).count();
        // A vertex of three faces is poor, a stack of vertices in nearly one place is worse.
        let least = if self.mesh.length(h) < STACKED * self.mesh.size(kept) { 3 } else { 4 };
        // Two curves must not become one: the region between them would vanish.
        let on_curve = |v: u32, w: u32| self.mesh.find(v, w).is_some_and(|k| self.mesh.arc(k) != NONE);
        common == apexes.len()
            && apexes.iter().all(|&w| {
                let is_thin = self.mesh.place(w).is_free() && self.mesh.valence(w) <= least;
                !(is_thin || on_curve(kept, w) && on_curve(gone, w))
            })
    }

    /// Whether the faces left by a collapse stay upright and their edges short enough.
    fn may_collapse(&self, gone: u32, kept: u32, on_arc: bool) -> bool {
        let to = self.mesh.point(kept);
        let longest = if on_arc { 2.5 } else { 4.0 / 3.0 } * self.mesh.size(kept).max(self.mesh.size(gone));
        for k in self.mesh.star(gone) {
            let face = self.mesh.face(k);
            let other = self.mesh.target(k);
            if other != kept && (self.mesh.point(other) - to).length() > longest.max(self.mesh.length(k)) {
                return false;
            }
            if face == NONE {
                continue;
            }
            let corners = self.mesh.corners(face);
            if corners.contains(&kept) {
                continue;
            }
            let before = [corners[0], corners[1], corners[2]].map(|v| self.mesh.point(v));
            let after: SmallVec<[DVec3; 3]> =
                corners.iter().map(|&v| if v == gone { to } else { self.mesh.point(v) }).collect();
            let after = [after[0], after[1], after[2]];
            let ends = [0, 1, 2].map(|i| if corners[i] == gone { kept } else { corners[i] });
            if !self.may_replace(before, ends, after) {
                return false;
            }
        }
        true
    }

    /// Flips an edge where that makes the worse of its faces better.
    pub(super) fn try_flip(&mut self, h: u32) -> bool {
        let t = h ^ 1;
        let (a, b) = (self.mesh.origin(h), self.mesh.target(h));
        let (c, d) = (self.mesh.origin(self.mesh.prev(h)), self.mesh.origin(self.mesh.prev(t)));
        let [p, q, r, s] = [a, b, c, d].map(|v| self.mesh.point(v));
        let before = triangle_quality([p, q, r]).min(triangle_quality([q, p, s]));
        let after = triangle_quality([p, s, r]).min(triangle_quality([s, q, r]));
        if after <= before + 1e-9 || c == d {
            return false;
        }
        let reference = (area_vector([p, q, r]) + area_vector([q, p, s])).normalize_or_zero();
        if !upright([p, s, r], reference) || !upright([s, q, r], reference) {
            return false;
        }
        if !self.fits([a, d, c], [p, s, r], reference) || !self.fits([d, b, c], [s, q, r], reference) {
            return false;
        }
        if self.leaves_surface(h, [p, q], [r, s]) {
            return false;
        }
        let poor = |v| self.mesh.place(v).is_free() && self.mesh.valence(v) <= 4;
        if poor(a)
            || poor(b)
            || self.mesh.valence(a) <= 2
            || self.mesh.valence(b) <= 2
            || self.mesh.find(c, d).is_some()
        {
            return false;
        }
        self.mesh.begin();
        let old = [self.mesh.face(h), self.mesh.face(t)];
        if self.mesh.replace(&old, &[smallvec![a, d, c], smallvec![d, b, c]], None).is_some() {
            self.mesh.commit();
            true
        } else {
            self.mesh.rollback();
            false
        }
    }

    /// Whether a flip takes the middle of its edge away from the surface, by more than chords may be off. Needles from
    /// rim to rim of a bore have no vertex inside that knows where the surface looks: flip by flip, each a small turn,
    /// they would come to span the bore.
    fn leaves_surface(&self, h: u32, before: [DVec3; 2], after: [DVec3; 2]) -> bool {
        let region = self.mesh.region(self.mesh.face(h));
        let off = |[p, q]: [DVec3; 2]| self.ground.project_from(region, 0.5 * (p + q), p).distance_squared;
        let may = SHARE * self.rules.tolerance;
        let after = off(after);
        after > may * may && after > off(before)
    }

    /// Whether a face may become another one: not a poorer needle, not over, and to the side of the surface.
    fn may_replace(&self, before: [DVec3; 3], corners: [u32; 3], after: [DVec3; 3]) -> bool {
        let (was, is) = (triangle_quality(before), triangle_quality(after));
        if was < FLAT && is < FLAT {
            return true;
        }
        let reference = if was < FLAT { DVec3::ZERO } else { area_vector(before) };
        let is_spoilt = is < 0.05 && is < was;
        !is_spoilt && keeps_side(was, reference, after) && self.fits(corners, after, reference)
    }

    /// Whether a face looks to the same side as the surface does at its free corners. Edits check faces against those
    /// that they replace; this keeps many small turns from adding up until a face cuts across the body.
    /// Where the surface has needles, their normals are anyone's guess: a face that looks no further away than the one
    /// `before` passes.
    fn fits(&self, corners: [u32; 3], points: [DVec3; 3], before: DVec3) -> bool {
        let (now, before) = (area_vector(points).normalize_or_zero(), before.normalize_or_zero());
        corners.iter().all(|&v| {
            let normal = self.mesh.normal(v);
            let least = SIDE.min(before.dot(normal) - 1e-9);
            !self.mesh.place(v).is_free() || normal == DVec3::ZERO || now.dot(normal) >= least
        })
    }

    /// Moves a vertex where no face is turned by it.
    pub(super) fn try_move(&mut self, v: u32, to: DVec3, normal: DVec3, place: Place) -> bool {
        let now = self.mesh.normal(v);
        if place.is_free() && now != DVec3::ZERO && normal.dot(now) < TURN {
            return false;
        }
        for f in self.mesh.faces_at(v) {
            let corners = self.mesh.corners(f);
            let ends = [corners[0], corners[1], corners[2]];
            let before = ends.map(|w| self.mesh.point(w));
            let after = [0, 1, 2].map(|i| if ends[i] == v { to } else { before[i] });
            if !self.may_replace(before, ends, after) {
                return false;
            }
        }
        self.mesh.set_point(v, to, normal);
        self.mesh.set_place(v, place);
        true
    }
}

/// As [`Mixed::replace`], where the old faces may lie in several regions: each new face is put into its own.
fn replace_in_regions(
    mesh: &mut Mixed,
    old: &[u32],
    new: &[Corners],
    regions: &[u32],
    moved: Option<(u32, u32)>,
) -> bool {
    let Some(made) = mesh.replace(old, new, moved) else { return false };
    for (f, &region) in made.into_iter().zip(regions) {
        if mesh.region(f) != region {
            mesh.set_region(f, region);
        }
    }
    true
}
