//! Which vertices of the borders of belts become nodes before anything is connected.

use glam::DVec3;

use super::strips::{Belts, border_loops, fans};
use crate::mesh::id::Vertex;
use crate::mesh::{IdVec, VertexId};
use crate::technique::layout::{Ground, Side};

/// A turn of the border by more, in radians, is a corner.
const CORNER: f64 = std::f64::consts::FRAC_PI_4;

/// Vertices of a closed loop with the length of the loop up to each.
pub(super) struct Rope {
    pub(super) vertices: Vec<VertexId>,
    /// Length from the first vertex.
    at: Vec<f64>,
    pub(super) length: f64,
    points: Vec<DVec3>,
}

impl Rope {
    pub(super) fn new(ground: &Ground<'_>, sides: &[Side]) -> Self {
        let vertices: Vec<VertexId> = sides.iter().map(|&s| ground.origin(s)).collect();
        let points: Vec<DVec3> = vertices.iter().map(|&v| ground.point(v)).collect();
        let (mut at, mut length) = (Vec::with_capacity(points.len()), 0.0);
        for k in 0..points.len() {
            at.push(length);
            length += points[k].distance(points[(k + 1) % points.len()]);
        }
        Self { vertices, at, length, points }
    }

    pub(super) fn len(&self) -> usize {
        self.vertices.len()
    }

    /// The length from place `a` on to place `b`; the whole loop when they are equal.
    pub(super) fn between(&self, a: usize, b: usize) -> f64 {
        let gap = self.at[b] - self.at[a];
        if gap > 0.0 { gap } else { gap + self.length }
    }

    /// The point `ahead` of place `k` along the loop; behind it where negative.
    fn point_at(&self, k: usize, ahead: f64) -> DVec3 {
        let n = self.len();
        let s = (self.at[k] + ahead).rem_euclid(self.length.max(f64::MIN_POSITIVE));
        let i = self.at.partition_point(|&a| a <= s).saturating_sub(1);
        let (p, q) = (self.points[i], self.points[(i + 1) % n]);
        let span = p.distance(q);
        if span > 0.0 { p + (q - p) * ((s - self.at[i]) / span).clamp(0.0, 1.0) } else { p }
    }

    /// The directions ahead and back at a place, over an arm of this length.
    pub(super) fn arms(&self, k: usize, arm: f64) -> (DVec3, DVec3) {
        let arm = arm.min(self.length / 6.0);
        let p = self.points[k];
        ((self.point_at(k, arm) - p).normalize_or_zero(), (self.point_at(k, -arm) - p).normalize_or_zero())
    }

    /// The place nearest to `ahead` of place `k`, other than those listed.
    pub(super) fn place_near(&self, k: usize, ahead: f64) -> usize {
        let s = (self.at[k] + ahead).rem_euclid(self.length.max(f64::MIN_POSITIVE));
        let i = self.at.partition_point(|&a| a <= s).saturating_sub(1);
        let next = (i + 1) % self.len();
        let end = if next == 0 { self.length } else { self.at[next] };
        if s - self.at[i] <= end - s { i } else { next }
    }
}

/// Corners of the domains' borders, and vertices where three belts, domains or the outside meet.
pub(super) fn forced(ground: &Ground<'_>, belts: &Belts, interval: f64) -> (IdVec<Vertex, bool>, IdVec<Vertex, bool>) {
    let mut fixed = IdVec::filled(false, ground.surface.points.len());
    for sides in border_loops(ground, &ground.domain) {
        for v in corners(&Rope::new(ground, &sides), interval) {
            fixed[v] = true;
        }
    }
    let mut node = fixed.clone();
    for v in ground.surface.points.ids() {
        let faces = ground.faces_at.of(v);
        if faces.iter().all(|&f| belts.of[f] == belts.of[faces[0]]) {
            continue;
        }
        let outside = usize::from(ground.on_rim[v]);
        if fans(ground, &belts.of, v).len() + outside >= 3 {
            node[v] = true;
            fixed[v] |= fans(ground, &ground.domain, v).len() + outside >= 3;
        }
    }
    (node, fixed)
}

/// Vertices where a loop turns by more than 45 degrees over a short arm; of close ones the sharpest.
fn corners(rope: &Rope, interval: f64) -> Vec<VertexId> {
    let arm = interval / 4.0;
    let turn = |k: usize| {
        let (ahead, back) = rope.arms(k, arm);
        std::f64::consts::PI - crate::mesh::geometry::angle(ahead, back)
    };
    let mut sharp: Vec<(f64, usize)> = (0..rope.len()).map(|k| (turn(k), k)).filter(|s| s.0 > CORNER).collect();
    sharp.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    let mut kept: Vec<usize> = Vec::new();
    for (_, k) in sharp {
        let apart =
            |&other: &usize| rope.between(k, other).min(rope.between(other, k)) > 1.5 * arm.min(rope.length / 6.0);
        if kept.iter().all(apart) {
            kept.push(k);
        }
    }
    kept.into_iter().map(|k| rope.vertices[k]).collect()
}

/// Adds nodes to a loop so that they lie about `interval` apart; gaps for which `may_fill` is false keep fewer.
pub(super) fn fill_gaps(rope: &Rope, node: &mut IdVec<Vertex, bool>, interval: f64, may_fill: impl Fn(usize) -> bool) {
    let mut places: Vec<usize> = (0..rope.len()).filter(|&k| node[rope.vertices[k]]).collect();
    if places.is_empty() {
        let lowest = (0..rope.len()).min_by_key(|&k| rope.vertices[k]).unwrap_or(0);
        node[rope.vertices[lowest]] = true;
        places.push(lowest);
    }
    let gaps = places.len();
    for g in 0..gaps {
        let (a, b) = (places[g], places[(g + 1) % gaps]);
        let length = rope.between(a, b);
        let least = [4, 2][usize::from(gaps > 1)].max(if gaps > 2 { 1 } else { 2 });
        let mut parts = (length / interval).round() as usize;
        parts = if gaps > 2 { parts.max(1) } else { parts.max(least) };
        if !may_fill(a) && length < 1.8 * interval && gaps > 2 {
            parts = 1;
        }
        for part in 1..parts {
            let place = rope.place_near(a, length * part as f64 / parts as f64);
            node[rope.vertices[place]] = true;
        }
    }
}
