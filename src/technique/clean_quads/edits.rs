//! The edits of the topology of quads.

use smallvec::{SmallVec, smallvec};

use super::{Cleaner, GOOD, valence};
use crate::technique::mixed::{Corners, NONE, Place};

/// Faces to take away, faces to put there, a vertex that another one replaces.
struct Edit {
    old: SmallVec<[u32; 12]>,
    new: SmallVec<[Corners; 12]>,
    moved: Option<(u32, u32)>,
}

/// What to do about a vertex.
#[derive(Clone, Copy)]
enum Kind {
    /// Draw the quad on the left of the half-edge together: its target goes into the corner across.
    Collapse(u32),
    /// Turn the edge of the half-edge by one corner, this way or the other.
    Turn(u32, bool),
    /// Open the origin along two of its edges into a new quad.
    Open(u32, u32),
    /// Put a vertex into the middle of the two quads at an edge, joined to every other of their six corners.
    Fill(u32, bool),
    /// Put a smaller quad into a quad, with a ring of four round it: frees a corner that is flat.
    Pillow(u32),
}

/// A vertex of more edges than this is left to the layers that mesh anew: every edit at it, and at the quads round it,
/// would look at all of them.
const HUB: usize = 64;

impl Cleaner<'_, '_> {
    /// Tries the edits at `v`, those that gain most first. Whether one was kept.
    pub(super) fn best_edit(&mut self, v: u32) -> bool {
        if self.is_at_hub(v) {
            return false;
        }
        let mut kinds: Vec<(f64, usize, Kind)> = Vec::new();
        for (i, kind) in self.kinds(v).into_iter().enumerate() {
            if let Some(gain) = self.gain(kind)
                && gain >= if self.is_rescue { -12.0 } else { 0.0 }
            {
                kinds.push((gain, i, kind));
            }
        }
        kinds.sort_by(|x, y| y.0.total_cmp(&x.0).then(x.1.cmp(&y.1)));
        if !self.is_rescue {
            return kinds.into_iter().take(8).any(|(gain, _, kind)| self.attempt(kind, gain, true).is_some());
        }
        // The one that leaves the best shapes.
        let mut best: Option<(f64, f64, Kind)> = None;
        for (gain, _, kind) in kinds.into_iter().take(24) {
            if let Some(quality) = self.attempt(kind, gain, false)
                && best.is_none_or(|(most, ..)| quality > most)
            {
                best = Some((quality, gain, kind));
                if quality > super::POOR {
                    break;
                }
            }
        }
        best.is_some_and(|(_, gain, kind)| self.attempt(kind, gain, true).is_some())
    }

    /// Whether a face at the vertex has a corner of very many edges.
    fn is_at_hub(&self, v: u32) -> bool {
        let is_hub = |w: u32| self.mesh.star(w).nth(HUB).is_some();
        is_hub(v) || self.mesh.faces_at(v).any(|f| self.mesh.corners(f).into_iter().any(is_hub))
    }

    fn kinds(&self, v: u32) -> Vec<Kind> {
        let mut kinds = Vec::new();
        let star: SmallVec<[u32; 16]> = self.mesh.star(v).collect();
        for &h in &star {
            if self.mesh.face(h) != NONE {
                kinds.push(Kind::Pillow(self.mesh.face(h)));
                // Both diagonals of each quad at the vertex.
                for k in [h, self.mesh.next(h), self.mesh.next(self.mesh.next(h)), self.mesh.prev(h)] {
                    kinds.push(Kind::Collapse(k));
                }
                for k in [h, self.mesh.next(h), self.mesh.next(self.mesh.next(h))] {
                    kinds.push(Kind::Turn(k, true));
                    kinds.push(Kind::Turn(k, false));
                    kinds.push(Kind::Fill(k, true));
                    kinds.push(Kind::Fill(k, false));
                }
            }
        }
        for (i, &h) in star.iter().enumerate() {
            for &k in &star[i + 1..] {
                kinds.push(Kind::Open(h, k));
                kinds.push(Kind::Open(k, h));
            }
        }
        // A neighbour of too many edges may lend one.
        for &h in &star {
            let w = self.mesh.target(h);
            if self.mesh.place(w).is_free() && self.mesh.valence(w) > 4 {
                let around: SmallVec<[u32; 16]> = self.mesh.star(w).collect();
                let n = around.len();
                let at = around.iter().position(|&k| k == h ^ 1).unwrap_or(0);
                for step in 2..n - 1 {
                    kinds.push(Kind::Open(around[at], around[(at + step) % n]));
                    kinds.push(Kind::Open(around[(at + step) % n], around[at]));
                }
            }
        }
        kinds
    }

    fn edit(&mut self, kind: Kind) -> Option<Edit> {
        match kind {
            Kind::Collapse(h) => Some(self.collapse(h)),
            Kind::Turn(h, left) => Some(self.turn(h, left)),
            Kind::Open(h, k) => self.open(h, k),
            Kind::Fill(h, left) => Some(self.fill(h, left)),
            Kind::Pillow(f) => Some(self.pillow(f)),
        }
    }

    /// By how much an edit lowers the misfit, by valences alone; `None` where it cannot be done.
    fn gain(&self, kind: Kind) -> Option<f64> {
        let m = &self.mesh;
        let quad = |f: u32| f != NONE && !m.is_triangle(f);
        let change = |v: u32, by: f64| -> f64 {
            if self.is_free(v) {
                let d = m.valence(v) as f64 - 4.0;
                return d * d - (d + by) * (d + by);
            }
            self.bound_change(v, by)
        };
        match kind {
            Kind::Collapse(h) => {
                let f = m.face(h);
                if !quad(f) {
                    return None;
                }
                let (b, gone) = (m.origin(h), m.target(h));
                let (d, kept) = (m.target(m.next(h)), m.origin(m.prev(h)));
                if !self.is_free(gone) {
                    return None;
                }
                let before = self.misfit(gone) + self.misfit(kept);
                let (vg, vk) = (m.valence(gone) as f64, m.valence(kept) as f64);
                let after = if self.is_free(kept) {
                    (vg + vk - 6.0).powi(2)
                } else {
                    // The quads of the one that goes come into the sector, without the one drawn together.
                    self.misfit(kept) - self.bound_change(kept, vg - 2.0)
                };
                Some(before - after + change(b, -1.0) + change(d, -1.0))
            }
            Kind::Turn(h, left) => {
                let (f, g) = (m.face(h), m.face(h ^ 1));
                if !quad(f) || !quad(g) || m.arc(h) != NONE {
                    return None;
                }
                let (a, b) = (m.origin(h), m.target(h));
                let (p, q) = if left {
                    (m.target(m.next(h)), m.target(m.next(h ^ 1)))
                } else {
                    (m.origin(m.prev(h)), m.origin(m.prev(h ^ 1)))
                };
                Some(change(a, -1.0) + change(b, -1.0) + change(p, 1.0) + change(q, 1.0))
            }
            Kind::Fill(h, left) => {
                let (f, g) = (m.face(h), m.face(h ^ 1));
                if !quad(f) || !quad(g) || m.arc(h) != NONE {
                    return None;
                }
                let loser = if left { m.target(h) } else { m.origin(h) };
                let [p, q] = if left {
                    [m.target(m.next(h)), m.origin(m.prev(h ^ 1))]
                } else {
                    [m.target(m.next(h ^ 1)), m.origin(m.prev(h))]
                };
                Some(change(loser, -1.0) + change(p, 1.0) + change(q, 1.0) - 1.0)
            }
            Kind::Pillow(f) => {
                let flat = m.sides(f).any(|h| m.corner_angle(h) > 2.6 && !self.is_free(m.origin(h)));
                if !quad(f) || !flat {
                    return None;
                }
                Some(m.sides(f).map(|h| change(m.origin(h), 1.0)).sum::<f64>() - 4.0)
            }
            Kind::Open(h, k) => {
                let v = m.origin(h);
                if !self.is_free(v) || m.arc(h) != NONE || m.arc(k) != NONE {
                    return None;
                }
                let between = self.between(h, k)? as f64;
                let rest = m.valence(v) as f64 - between;
                let (one, other) = (between + 1.0 - 4.0, rest + 1.0 - 4.0);
                if between < 2.0 || rest < 2.0 {
                    return None;
                }
                let parts = self.misfit(v) - one * one - other * other;
                Some(parts + change(m.target(h), 1.0) + change(m.target(k), 1.0))
            }
        }
    }

    /// What the misfit of a bound vertex loses when the sector of most misfit gets `by` quads more.
    fn bound_change(&self, v: u32, by: f64) -> f64 {
        // Sectors are few and the edit touches one: judging the whole star by its inner sector is exact on plain curve
        // vertices seen from one side only, and errs on the safe side else, because the edit is measured again.
        let gain = |(quads, angle): (f64, f64)| valence::cost(quads, angle) - valence::cost(quads + by, angle);
        let best = valence::sectors(self.mesh, v).into_iter().map(gain).fold(f64::NEG_INFINITY, f64::max);
        if best.is_finite() { best } else { 0.0 }
    }

    /// The faces counter-clockwise from `h` to `k`.
    fn between(&self, h: u32, k: u32) -> Option<usize> {
        let star: SmallVec<[u32; 16]> = self.mesh.star(self.mesh.origin(h)).collect();
        let n = star.len();
        let (i, j) = (star.iter().position(|&x| x == h)?, star.iter().position(|&x| x == k)?);
        Some((j + n - i) % n)
    }

    fn collapse(&self, h: u32) -> Edit {
        let f = self.mesh.face(h);
        let (gone, kept) = (self.mesh.target(h), self.mesh.origin(self.mesh.prev(h)));
        let mut edit = Edit { old: SmallVec::new(), new: SmallVec::new(), moved: Some((gone, kept)) };
        for g in self.mesh.faces_at(gone) {
            edit.old.push(g);
            if g != f {
                let corners = self.mesh.corners(g);
                edit.new.push(corners.iter().map(|&v| if v == gone { kept } else { v }).collect());
            }
        }
        edit
    }

    fn turn(&self, h: u32, left: bool) -> Edit {
        let m = &self.mesh;
        let t = h ^ 1;
        let at = |k: u32| m.origin(k);
        let (a, b) = (at(h), at(t));
        let (c, d) = (m.target(m.next(h)), m.origin(m.prev(h)));
        let (e, f) = (m.target(m.next(t)), m.origin(m.prev(t)));
        // Round the hexagon: a e f b c d.
        let new = if left {
            smallvec![smallvec![e, f, b, c], smallvec![c, d, a, e]]
        } else {
            smallvec![smallvec![f, b, c, d], smallvec![d, a, e, f]]
        };
        Edit { old: smallvec![m.face(h), m.face(t)], new, moved: None }
    }

    fn fill(&mut self, h: u32, left: bool) -> Edit {
        let m = &self.mesh;
        let t = h ^ 1;
        let (a, b) = (m.origin(h), m.origin(t));
        let (c, d) = (m.target(m.next(h)), m.origin(m.prev(h)));
        let (e, f) = (m.target(m.next(t)), m.origin(m.prev(t)));
        let old = smallvec![m.face(h), m.face(t)];
        let region = m.region(m.face(h));
        let point = 0.5 * (m.point(a) + m.point(b));
        let size = m.size(a);
        let foot = self.ground.project_from(region, point, m.point(a));
        let x = self.mesh.add_vertex(foot.point, foot.normal, Place::Region(region), size);
        let new = if left {
            smallvec![smallvec![a, e, f, x], smallvec![f, b, c, x], smallvec![c, d, a, x]]
        } else {
            smallvec![smallvec![e, f, b, x], smallvec![b, c, d, x], smallvec![d, a, e, x]]
        };
        Edit { old, new, moved: None }
    }

    fn pillow(&mut self, f: u32) -> Edit {
        let outer = self.mesh.corners(f);
        let (region, centre) = (self.mesh.region(f), self.mesh.centre(f));
        let mut inner = Corners::new();
        for &v in &outer {
            let at = self.mesh.point(v);
            let foot = self.ground.project_from(region, at.lerp(centre, 0.5), at);
            let size = self.mesh.size(v);
            inner.push(self.mesh.add_vertex(foot.point, foot.normal, Place::Region(region), size));
        }
        let ring = (0..4).map(|i| smallvec![outer[i], outer[(i + 1) % 4], inner[(i + 1) % 4], inner[i]]);
        let new = ring.chain(std::iter::once(inner.clone())).collect();
        Edit { old: smallvec![f], new, moved: None }
    }

    fn open(&mut self, h: u32, k: u32) -> Option<Edit> {
        let v = self.mesh.origin(h);
        let Place::Region(region) = self.mesh.place(v) else { return None };
        let star: SmallVec<[u32; 16]> = self.mesh.star(v).collect();
        let n = star.len();
        let i = star.iter().position(|&x| x == h)?;
        let between = self.between(h, k)?;
        let mut middle = glam::DVec3::ZERO;
        let upper: SmallVec<[u32; 8]> = (0..between).map(|s| self.mesh.face(star[(i + s) % n])).collect();
        for &f in &upper {
            middle += self.mesh.centre(f);
        }
        let point = self.mesh.point(v).lerp(middle / between as f64, 0.4);
        let foot = self.ground.project_from(region, point, self.mesh.point(v));
        let size = self.mesh.size(v);
        let w = self.mesh.add_vertex(foot.point, foot.normal, Place::Region(region), size);
        let mut edit = Edit { old: SmallVec::new(), new: SmallVec::new(), moved: None };
        for &f in &upper {
            edit.old.push(f);
            let corners = self.mesh.corners(f);
            edit.new.push(corners.iter().map(|&x| if x == v { w } else { x }).collect());
        }
        // The new quad lies between both halves; only the upper one changes its faces.
        edit.new.push(smallvec![v, self.mesh.target(h), w, self.mesh.target(k)]);
        Some(edit)
    }

    /// Does an edit, smooths, and keeps it if it gained and is to be kept. The least quality it came to if it gained.
    fn attempt(&mut self, kind: Kind, gain: f64, keep: bool) -> Option<f64> {
        self.mesh.begin();
        let Some(edit) = self.edit(kind) else {
            self.mesh.rollback();
            return None;
        };
        let ring = self.corners_of(&edit.old);
        let before = self.judge(&ring);
        if !self.is_rescue && gain < 1e-9 && before.1 >= GOOD {
            // It could only win by shapes, and those are good.
            self.mesh.rollback();
            return None;
        }
        if self.mesh.replace(&edit.old, &edit.new, edit.moved).is_none() {
            self.mesh.rollback();
            return None;
        }
        let mut touched: Vec<u32> = ring.iter().copied().filter(|&v| self.mesh.is_vertex(v)).collect();
        touched.extend(edit.new.iter().flatten().copied());
        touched.sort_unstable();
        touched.dedup();
        if !touched.iter().all(|&v| self.mesh.is_proper(v, 3)) {
            self.mesh.rollback();
            return None;
        }
        if !self.is_rescue && self.misfits(&touched) >= before.0 + 1e-9 {
            // Smoothing will not change that.
            self.mesh.rollback();
            return None;
        }
        if let Some((_, kept)) = edit.moved {
            self.centre_between(kept);
        }
        self.relax(&touched, 3);
        if self.is_rescue {
            self.search_at(&touched);
        }
        let after = self.judge(&touched);
        let fewer = after.0 < before.0 - 1e-9;
        let good = after.1 >= GOOD || after.1 > before.1;
        let better = after.0 < before.0 + 1e-9 && before.1 < GOOD && after.1 > before.1 + 0.05;
        // A face that is no use at all is worth any valence, a poor one a few.
        let price = if before.1 < 0.2 { 12.0 } else { 4.0 };
        let rescued = self.is_rescue && after.1 > before.1 + 0.05 && after.0 < before.0 + price;
        let gained = (!self.is_rescue && ((fewer && good) || better)) || rescued;
        if gained && keep {
            self.mesh.commit();
            self.note_change(&touched);
        } else {
            self.mesh.rollback();
        }
        gained.then_some(after.1)
    }

    /// The sum of misfits and the least quality at these vertices.
    pub(super) fn judge(&self, vertices: &[u32]) -> (f64, f64) {
        let least =
            self.faces_at_any(vertices).into_iter().map(|f| self.sound_quality(f)).fold(f64::INFINITY, f64::min);
        (self.misfits(vertices), least)
    }

    /// The faces at some vertices, in rising order.
    pub(super) fn faces_at_any(&self, vertices: &[u32]) -> SmallVec<[u32; 64]> {
        let mut faces: SmallVec<[u32; 64]> = vertices.iter().flat_map(|&v| self.mesh.faces_at(v)).collect();
        faces.sort_unstable();
        faces.dedup();
        faces
    }

    pub(super) fn misfits(&self, vertices: &[u32]) -> f64 {
        vertices.iter().map(|&v| self.misfit(v)).sum()
    }

    pub(super) fn corners_of(&self, faces: &[u32]) -> Vec<u32> {
        let mut all: Vec<u32> = faces.iter().flat_map(|&f| self.mesh.corners(f)).collect();
        all.sort_unstable();
        all.dedup();
        all
    }

    /// Merges the two quads at an inner vertex of two edges.
    pub(super) fn take_out_doublet(&mut self, v: u32) -> bool {
        let faces: SmallVec<[u32; 2]> = self.mesh.faces_at(v).collect();
        let &[f, g] = &faces[..] else { return false };
        if self.mesh.is_triangle(f) || self.mesh.is_triangle(g) {
            return false;
        }
        let h = self.mesh.out(v);
        let (f, g) = if self.mesh.face(h) == f { (f, g) } else { (g, f) };
        let (c, x, a) = (self.mesh.target(h), self.mesh.target(self.mesh.next(h)), self.mesh.origin(self.mesh.prev(h)));
        let k = self.mesh.prev(h) ^ 1;
        let y = self.mesh.target(self.mesh.next(k));
        self.mesh.begin();
        let done = self.mesh.replace(&[f, g], &[smallvec![c, x, a, y]], None).is_some()
            && [c, x, a, y].iter().all(|&w| self.mesh.is_proper(w, 2));
        if done {
            self.mesh.commit();
            self.note_change(&[c, x, a, y]);
        } else {
            self.mesh.rollback();
        }
        done
    }
}
