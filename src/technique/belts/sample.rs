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

    /// Whether one of the vertices within `reach` of place `k` along the loop is `wanted`.
    fn is_any_near(&self, k: usize, reach: f64, wanted: impl Fn(VertexId) -> bool) -> bool {
        let n = self.len();
        let ahead = (0..n).map(|step| (k + step) % n).take_while(|&j| j == k || self.between(k, j) <= reach);
        let back = (0..n).map(|step| (k + n - step) % n).take_while(|&j| j == k || self.between(j, k) <= reach);
        ahead.chain(back).any(|j| wanted(self.vertices[j]))
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
    let mut node = fixed.clone();
    for v in ground.surface.points.ids() {
        let faces = ground.faces_at.of(v);
        if faces.iter().all(|&f| belts.of[f] == belts.of[faces[0]]) {
            continue;
        }
        let outside = usize::from(ground.on_rim[v]);
        if fans(ground, &belts.of, v).len() + outside >= 3 {
            node[v] = true;
            fixed[v] = fans(ground, &ground.domain, v).len() + outside >= 3;
        }
    }
    corners(ground, interval, &mut fixed);
    for v in node.ids() {
        node[v] |= fixed[v];
    }
    (node, fixed)
}

/// Fixes vertices where a border turns by more than 45 degrees over a short arm; of close ones the sharpest, whichever
/// domain it is a corner of.
fn corners(ground: &Ground<'_>, interval: f64, fixed: &mut IdVec<Vertex, bool>) {
    let loops = border_loops(ground, &ground.domain);
    let ropes: Vec<(Rope, f64)> = loops
        .iter()
        .map(|sides| {
            let rope = Rope::new(ground, sides);
            // Over longer arms a small round hole would turn everywhere, and a small square one would lose corners.
            let arm = (interval / 4.0).min(rope.length / 12.0);
            (rope, arm)
        })
        .collect();
    let mut sharp: Vec<(f64, usize, usize)> = Vec::new();
    for (number, (rope, arm)) in ropes.iter().enumerate() {
        for k in 0..rope.len() {
            let (ahead, back) = rope.arms(k, *arm);
            let turn = std::f64::consts::PI - crate::mesh::geometry::angle(ahead, back);
            if turn > CORNER {
                sharp.push((turn, number, k));
            }
        }
    }
    sharp.sort_by(|a, b| b.0.total_cmp(&a.0).then((a.1, a.2).cmp(&(b.1, b.2))));
    for (_, number, k) in sharp {
        let (rope, arm) = &ropes[number];
        if !rope.is_any_near(k, 1.5 * arm, |v| fixed[v]) {
            fixed[rope.vertices[k]] = true;
        }
    }
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
    let length = |g: usize| rope.between(places[g], places[(g + 1) % gaps]);
    let mut parts: Vec<usize> = (0..gaps)
        .map(|g| {
            let least = [4, 2][usize::from(gaps > 1)].max(if gaps > 2 { 1 } else { 2 });
            let wanted = (length(g) / interval).round() as usize;
            if !may_fill(places[g]) && length(g) < 1.8 * interval && gaps > 2 {
                1
            } else {
                wanted.max(if gaps > 2 { 1 } else { least })
            }
        })
        .collect();
    if places.iter().all(|&k| may_fill(k)) {
        make_even(&mut parts, |g| length(g) / interval);
    }
    for (g, &count) in parts.iter().enumerate() {
        for part in 1..count {
            let place = rope.place_near(places[g], length(g) * part as f64 / count as f64);
            node[rope.vertices[place]] = true;
        }
    }
}

/// Gives one of the gaps of a loop a part more where their number is odd, or one less: an odd loop leaves a triangle.
fn make_even(parts: &mut [usize], wanted: impl Fn(usize) -> f64) {
    if parts.iter().sum::<usize>() % 2 == 0 {
        return;
    }
    let least = if parts.len() > 2 { 1 } else { 2 };
    let mut best: Option<(f64, usize, usize)> = None;
    for (g, &count) in parts.iter().enumerate() {
        for other in [count + 1, count - 1] {
            let cost = libm::log(other as f64 / wanted(g).max(0.1)).abs();
            if other >= least && best.is_none_or(|b| cost < b.0) {
                best = Some((cost, g, other));
            }
        }
    }
    if let Some((_, g, other)) = best {
        parts[g] = other;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_odd_loop_changes_where_lengths_change_least() {
        // Gaps of 1.0, 4.4 and 2.0 intervals: four parts become five rather than one two.
        let lengths = [1.0, 4.4, 2.0];
        let mut parts = [1, 4, 2];
        make_even(&mut parts, |g| lengths[g]);
        assert_eq!(parts, [1, 5, 2]);
        let mut alone = [5];
        make_even(&mut alone, |_| 4.6);
        assert_eq!(alone, [4]);
    }
}
