//! The side edges of a quad: reused, chosen, swapped or split.

use glam::{DVec2, DVec3, dvec2};
use smallvec::{SmallVec, smallvec};

use super::Front;
use crate::technique::mixed::{NONE, Place};

/// How far an edge may be off the wanted direction.
const SWING: f64 = std::f64::consts::FRAC_PI_6;

/// The edges at one end of a base edge, from the base edge to the next front edge.
pub(super) struct Fan {
    /// The node.
    pub(super) at: u32,
    /// The other ends of the edges, with their angle from the base edge.
    pub(super) spokes: SmallVec<[(u32, f64); 12]>,
}

impl Fan {
    /// The whole angle of the front at the node.
    pub(super) fn angle(&self) -> f64 {
        self.spokes[self.spokes.len() - 1].1
    }

    /// The other end of the next front edge.
    pub(super) fn last(&self) -> u32 {
        self.spokes[self.spokes.len() - 1].0
    }
}

impl Front<'_, '_> {
    /// The fan at the target (`right`) or the origin of a base edge.
    pub(super) fn fan(&self, h: u32, right: bool) -> Fan {
        let mut spokes: SmallVec<[(u32, f64); 12]> = SmallVec::new();
        let mut angle = 0.0;
        if right {
            spokes.push((self.mesh.origin(h), 0.0));
            let mut k = self.mesh.next(h);
            loop {
                angle += self.mesh.corner_angle(k);
                spokes.push((self.mesh.target(k), angle));
                if self.is_front(k) || spokes.len() > 100 {
                    break;
                }
                k = self.mesh.next(k ^ 1);
            }
            return Fan { at: self.mesh.target(h), spokes };
        }
        spokes.push((self.mesh.target(h), 0.0));
        let mut k = h;
        loop {
            angle += self.mesh.corner_angle(k);
            let incoming = self.mesh.prev(k);
            spokes.push((self.mesh.origin(incoming), angle));
            if self.is_front(incoming) || spokes.len() > 100 {
                break;
            }
            k = incoming ^ 1;
        }
        Fan { at: self.mesh.origin(h), spokes }
    }

    /// The top node of one side of the quad on `h`; it is joined to the base node by an edge when this returns.
    ///
    /// `taken` is the other side's top node. `shy` avoids nodes of the front and existing edges far off.
    pub(super) fn side(&mut self, h: u32, right: bool, taken: Option<u32>, shy: bool) -> Option<u32> {
        let fan = self.fan(h, right);
        let total = fan.angle();
        if total < super::SIDE {
            return Some(fan.last());
        }
        let parts = (total / std::f64::consts::FRAC_PI_2).round().max(2.0);
        let wanted = total / parts;
        let base = self.mesh.length(h);
        let ahead = (self.mesh.point(fan.last()) - self.mesh.point(fan.at)).length();
        let size = self.mesh.size(fan.at);
        let length = (0.5 * (base + ahead)).clamp(0.75 * size, 1.4 * size);
        let reach = if shy { 0.6 * SWING } else { SWING };
        let picked = self
            .choose(&fan, wanted, reach, taken, h, shy)
            .or_else(|| self.swap(&fan, wanted, length, taken, h, shy))
            .or_else(|| self.cut(&fan, wanted))
            .or_else(|| self.choose(&fan, wanted, 2.0 * SWING, taken, h, shy))?;
        self.place(h, right, wanted, length, fan.at, picked);
        Some(picked)
    }

    /// The existing edge nearest to the wanted direction.
    fn choose(&self, fan: &Fan, wanted: f64, reach: f64, taken: Option<u32>, h: u32, shy: bool) -> Option<u32> {
        let inner = &fan.spokes[1..fan.spokes.len() - 1];
        let off = |angle: f64| (angle - wanted).abs();
        let mut order: SmallVec<[(u32, f64); 12]> = inner.iter().copied().filter(|&(_, a)| off(a) < reach).collect();
        order.sort_by(|x, y| off(x.1).total_cmp(&off(y.1)).then(x.0.cmp(&y.0)));
        order.into_iter().map(|(w, _)| w).find(|&w| Some(w) != taken && self.may_meet(fan.at, w, h, shy))
    }

    /// Whether an edge from `node` to `top` leaves all loops of the front closable by quads.
    fn may_meet(&self, node: u32, top: u32, h: u32, shy: bool) -> bool {
        let meets = self.mesh.star(top).any(|k| self.mesh.face(k) != NONE && self.is_front(k));
        if !meets {
            return self.mesh.place(top).is_free();
        }
        if shy {
            return false;
        }
        let (mut edges, mut to_top, mut to_node) = (0_usize, None, None);
        let mut k = h;
        loop {
            edges += 1;
            if self.mesh.target(k) == top && to_top.is_none() {
                to_top = Some(edges);
            }
            if self.mesh.target(k) == node && to_node.is_none() {
                to_node = Some(edges);
            }
            k = self.after(k).0;
            if k == h || edges > 20_000 {
                break;
            }
        }
        match (to_top, to_node) {
            (Some(top), Some(node)) => edges % 2 == 1 || (top.abs_diff(node) + 1).is_multiple_of(2),
            _ => true,
        }
    }

    /// Swaps the edge across the wanted direction so that it comes from the node.
    fn swap(&mut self, fan: &Fan, wanted: f64, length: f64, taken: Option<u32>, h: u32, shy: bool) -> Option<u32> {
        let (edge, p, q) = self.across(fan, wanted)?;
        let far = self.mesh.origin(self.mesh.prev(edge ^ 1));
        if Some(far) == taken || self.mesh.find(fan.at, far).is_some() || !self.may_meet(fan.at, far, h, shy) {
            return None;
        }
        let there = unfold(
            p,
            q,
            [self.mesh.point(self.mesh.origin(edge)), self.mesh.point(self.mesh.target(edge)), self.mesh.point(far)],
        );
        let angle = libm::atan2(there.y, there.x);
        if (angle - wanted).abs() >= SWING || there.length() > 0.75_f64.sqrt() * 2.0 * length || there.x.is_nan() {
            return None;
        }
        self.flip(edge).then_some(far)
    }

    /// The edge opposite to the node that the wanted direction crosses, directed as in the fan's triangle, and where
    /// its ends lie when the fan is laid flat.
    fn across(&self, fan: &Fan, wanted: f64) -> Option<(u32, DVec2, DVec2)> {
        let i = (1..fan.spokes.len()).find(|&i| fan.spokes[i].1 > wanted)?;
        let [(v, from), (w, to)] = [fan.spokes[i - 1], fan.spokes[i]];
        let edge = self.mesh.find(v, w)?;
        let inside = [edge, edge ^ 1].into_iter().find(|&k| {
            let face = self.mesh.face(k);
            face != NONE && self.mesh.is_triangle(face) && self.mesh.origin(self.mesh.prev(k)) == fan.at
        })?;
        let across = self.mesh.face(inside ^ 1);
        if self.mesh.arc(edge) != NONE || across == NONE || !self.mesh.is_triangle(across) {
            return None;
        }
        let flat = |x: u32, angle: f64| {
            let r = (self.mesh.point(x) - self.mesh.point(fan.at)).length();
            r * dvec2(libm::cos(angle), libm::sin(angle))
        };
        let (p, q) = (flat(v, from), flat(w, to));
        Some(if self.mesh.origin(inside) == v { (inside, p, q) } else { (inside, q, p) })
    }

    /// Flips the edge between two triangles; the caller looks at the result.
    pub(super) fn flip(&mut self, h: u32) -> bool {
        let t = h ^ 1;
        let (a, b) = (self.mesh.origin(h), self.mesh.target(h));
        let (c, d) = (self.mesh.origin(self.mesh.prev(h)), self.mesh.origin(self.mesh.prev(t)));
        if c == d || self.mesh.find(c, d).is_some() {
            return false;
        }
        let old = [self.mesh.face(h), self.mesh.face(t)];
        self.mesh.replace(&old, &[smallvec![a, d, c], smallvec![d, b, c]], None).is_some()
    }

    /// Puts a new node where the wanted direction leaves the fan.
    fn cut(&mut self, fan: &Fan, wanted: f64) -> Option<u32> {
        let (edge, p, q) = self.across(fan, wanted)?;
        let direction = dvec2(libm::cos(wanted), libm::sin(wanted));
        let (from, to) = (direction.perp_dot(p), direction.perp_dot(q));
        let t = (from / (from - to)).clamp(0.1, 0.9);
        if t.is_nan() {
            return None;
        }
        let (a, b) = (self.mesh.origin(edge), self.mesh.target(edge));
        let region = self.mesh.region(self.mesh.face(edge));
        let point = self.mesh.point(a).lerp(self.mesh.point(b), t);
        let foot = self.ground.project_from(region, point, self.mesh.point(a));
        let size = self.mesh.size(a) + t * (self.mesh.size(b) - self.mesh.size(a));
        let (f, g) = (self.mesh.face(edge), self.mesh.face(edge ^ 1));
        let (c, d) = (self.mesh.origin(self.mesh.prev(edge)), self.mesh.origin(self.mesh.prev(edge ^ 1)));
        let v = self.mesh.add_vertex(foot.point, foot.normal, Place::Region(region), size);
        let new = [smallvec![a, v, c], smallvec![v, b, c], smallvec![b, v, d], smallvec![v, a, d]];
        self.mesh.replace(&[f, g], &new, None)?;
        Some(v)
    }

    /// Moves a free top node that no quad has yet to where the ideal corner would have it.
    fn place(&mut self, h: u32, right: bool, angle: f64, length: f64, at: u32, top: u32) {
        let Place::Region(region) = self.mesh.place(top) else { return };
        if self.mesh.faces_at(top).any(|f| !self.mesh.is_triangle(f)) {
            return;
        }
        let origin = self.mesh.point(at);
        let other = if right { self.mesh.origin(h) } else { self.mesh.target(h) };
        let normal = self.mesh.normal(top);
        let along = self.mesh.point(other) - origin;
        let u = (along - normal * normal.dot(along)).normalize_or_zero();
        let side = if right { -normal.cross(u) } else { normal.cross(u) };
        let ideal = origin + length * (libm::cos(angle) * u + libm::sin(angle) * side);
        let now = self.mesh.point(top);
        for share in [1.0, 0.5, 0.25] {
            let foot = self.ground.project_from(region, now.lerp(ideal, share), now);
            if self.may_move(top, foot.point, foot.normal) {
                self.mesh.set_point(top, foot.point, foot.normal);
                return;
            }
        }
    }
}

/// Where the third point of a triangle falls when it is laid flat across the edge `p q`, away from the origin.
fn unfold(p: DVec2, q: DVec2, [a, b, c]: [DVec3; 3]) -> DVec2 {
    let axis = (b - a).normalize_or_zero();
    let along = (c - a).dot(axis);
    let height = ((c - a) - along * axis).length();
    let direction = (q - p).normalize_or_zero();
    let normal = direction.perp();
    let away = if normal.dot(p) >= 0.0 { normal } else { -normal };
    p + along * direction + height * away
}
