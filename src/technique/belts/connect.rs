//! Connectors from the outer loop of a belt to the inner one.
//!
//! Each begins along the bisector of the angle at its node and walks straight until it comes to the inner loop; the
//! path laid is the one over edges that hugs the line. It never meets an earlier one: where the walk would cross one,
//! it leads to that one's end instead, so that the ends keep the order of the beginnings.

use glam::{DMat3, DVec3};
use rustc_hash::FxHashSet;

use super::draft::Draft;
use super::sample::Rope;
use super::walk::Walk;
use crate::mesh::carried::edge_key;
use crate::mesh::{FaceId, VertexId};
use crate::technique::layout::{Terrain, along};

/// Where a walk came to.
enum Arrival {
    /// Near this vertex of the inner loop.
    Inner(VertexId),
    /// At a connector, which ends at this vertex.
    Connector(VertexId),
    /// Nowhere.
    Lost,
}

impl Draft<'_> {
    /// Lays the connectors of a belt.
    pub(super) fn connect(&mut self, belt: u32, outer: &Rope, inner: Vec<VertexId>, is_fan: bool) {
        let places: Vec<usize> = (0..outer.len()).filter(|&k| self.node[outer.vertices[k]]).collect();
        let is_inner: FxHashSet<VertexId> = inner.iter().copied().collect();
        let mut ends: Vec<VertexId> = inner.into_iter().filter(|&v| self.node[v]).collect();
        // The loop beyond may be sampled already; then its nodes are all there should be.
        let is_sampled = ends.len() >= 3;
        let on_spine = ends.len() <= 2 && ends.len() == is_inner.len().min(2);
        let mut was_laid = false;
        for &place in &places {
            // Every second node of a fan: two triangles coupled beforehand, of which a vertex holds only a few.
            let skip = is_fan && std::mem::take(&mut was_laid);
            if skip || is_inner.contains(&outer.vertices[place]) {
                continue;
            }
            let (angle, bisector) = self.bisector(belt, outer, place);
            if angle < self.min_angle {
                continue;
            }
            let snap = if is_fan {
                f64::INFINITY
            } else if is_sampled && !on_spine {
                1.0
            } else {
                self.snap
            };
            was_laid = self.connector(belt, outer.vertices[place], bisector, &is_inner, &mut ends, snap);
        }
    }

    /// The angle inside a belt at a place of its loop, which has the belt on its left, and the direction that halves
    /// it.
    fn bisector(&self, belt: u32, rope: &Rope, place: usize) -> (f64, DVec3) {
        let v = rope.vertices[place];
        let normal = self.ground.normal_at(v, |f| self.belts.of[f] == belt);
        let (ahead, back) = rope.arms(place, self.interval / 2.0);
        let flat = |d: DVec3| (d - normal * normal.dot(d)).normalize_or_zero();
        let (ahead, back) = (flat(ahead), flat(back));
        let mut angle = libm::atan2(normal.dot(ahead.cross(back)), ahead.dot(back));
        if angle <= 0.0 {
            angle += std::f64::consts::TAU;
        }
        let half = DMat3::from_cols(ahead, normal.cross(ahead), normal)
            * DVec3::new(libm::cos(angle / 2.0), libm::sin(angle / 2.0), 0.0);
        (angle, half)
    }

    fn connector(
        &mut self,
        belt: u32,
        start: VertexId,
        direction: DVec3,
        inner: &FxHashSet<VertexId>,
        ends: &mut Vec<VertexId>,
        snap: f64,
    ) -> bool {
        let wanted = match self.arrive(belt, start, direction, inner) {
            Arrival::Inner(v) => Some(self.snapped(v, ends, snap)),
            Arrival::Connector(end) => Some(end),
            Arrival::Lost => None,
        };
        let path = wanted.and_then(|end| self.straight_path(belt, start, end));
        let path = path.or_else(|| {
            let all: Vec<VertexId> = inner.iter().copied().collect();
            let nearest = self.short_path(belt, &[start], &all, &[])?;
            let end = self.snapped(*nearest.last()?, ends, snap);
            self.straight_path(belt, start, end)
        });
        let Some(path) = path else { return false };
        let Some(&end) = path.last() else { return false };
        if !self.node[end] {
            self.node[end] = true;
            ends.push(end);
        }
        self.add_wall(&path);
        self.connectors += 1;
        true
    }

    /// The node of the inner loop that is near enough to take the place of a new one.
    fn snapped(&self, v: VertexId, ends: &[VertexId], snap: f64) -> VertexId {
        let at = self.ground.point(v);
        let near = ends
            .iter()
            .map(|&e| (self.ground.point(e).distance(at), e))
            .min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        near.filter(|n| n.0 <= snap * self.interval).map_or(v, |n| n.1)
    }

    /// Walks straight until a face touches the inner loop.
    fn arrive(&self, belt: u32, start: VertexId, direction: DVec3, inner: &FxHashSet<VertexId>) -> Arrival {
        /// Belts are about one interval thick; a walk this many long has missed the inner loop.
        const FAR: f64 = 4.0;
        let inside = |f: FaceId| self.belts.of[f] == belt;
        let Some(mut walk) = Walk::new(self.ground, start, direction, inside) else { return Arrival::Lost };
        let (mut before, mut length) = (self.ground.point(start), 0.0);
        while length < FAR * self.interval {
            let step = walk.leave();
            let ends = [self.ground.origin(step.exit), self.ground.target(step.exit)];
            let corners = self.ground.surface.faces[step.exit.face];
            let touched = corners.iter().copied().filter(|&v| v != start && inner.contains(&v));
            let nearest = touched.min_by(|&a, &b| {
                let [da, db] = [a, b].map(|v| self.ground.point(v).distance_squared(step.point));
                da.total_cmp(&db).then(a.cmp(&b))
            });
            if let Some(v) = nearest {
                return Arrival::Inner(v);
            }
            if let Some(&end) = self.walls.get(&edge_key(ends[0], ends[1])) {
                return Arrival::Connector(end);
            }
            if !self.ground.beyond(step.exit).is_some_and(inside) || walk.enter(step).is_none() {
                break;
            }
            length += before.distance(step.point);
            before = step.point;
        }
        Arrival::Lost
    }

    /// The path over free vertices that hugs the straight line, unless it is far longer.
    fn straight_path(&mut self, belt: u32, start: VertexId, end: VertexId) -> Option<Vec<VertexId>> {
        /// A path dearer than this many times its straight length goes round something.
        const DETOUR: f64 = 4.0;
        let (a, b) = (self.ground.point(start), self.ground.point(end));
        let mut finder = std::mem::take(&mut self.finder);
        let free = |v: VertexId| self.is_free(v, belt);
        let open = |l: FaceId, r: FaceId| self.is_open(l, r, belt);
        let cost = along(a, b);
        let limit = DETOUR * a.distance(b).max(0.5 * self.interval);
        let terrain = Terrain { free: &free, open: &open, cost: &cost, limit, goal: Some(b) };
        let path = finder.path(self.ground, &[start], |v| v == end, &terrain);
        self.finder = finder;
        path
    }
}
