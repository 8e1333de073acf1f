//! Shortest paths along the edges of a mesh, with scratch memory that is reused from search to search.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use glam::DVec3;

use super::ground::Ground;
use crate::mesh::id::Vertex;
use crate::mesh::{FaceId, IdVec, VertexId};

/// Dijkstra's algorithm, towards a goal where one is given (A*). Of equally long paths the one over the lowest vertices
/// is found.
#[derive(Clone, Debug, Default)]
pub struct Finder {
    length: IdVec<Vertex, f64>,
    from: IdVec<Vertex, VertexId>,
    /// The search that reached a vertex: `2·n` while open, `2·n + 1` when settled.
    seen: IdVec<Vertex, u32>,
    round: u32,
}

/// What a search may use, and what its edges cost.
pub struct Terrain<'t> {
    /// Whether paths may pass a vertex.
    pub free: &'t dyn Fn(VertexId) -> bool,
    /// Whether paths may use an edge, given the faces on both sides.
    pub open: &'t dyn Fn(FaceId, FaceId) -> bool,
    /// The cost of an edge between two points.
    pub cost: &'t dyn Fn(DVec3, DVec3) -> f64,
    /// Paths that cost more are not found.
    pub limit: f64,
    /// Where the only target lies, if it is known: the search then looks there first. No edge may cost less than its
    /// length.
    pub goal: Option<DVec3>,
}

impl Finder {
    /// Scratch memory for a mesh of this many vertices.
    pub fn new(vertices: usize) -> Self {
        Self {
            length: IdVec::filled(0.0, vertices),
            from: IdVec::filled(VertexId::from_raw(0), vertices),
            seen: IdVec::filled(0, vertices),
            round: 0,
        }
    }

    /// The cheapest path from one of `sources` to a vertex that `is_target`; all vertices between are free.
    pub fn path(
        &mut self,
        ground: &Ground<'_>,
        sources: &[VertexId],
        is_target: impl Fn(VertexId) -> bool,
        terrain: &Terrain<'_>,
    ) -> Option<Vec<VertexId>> {
        self.round += 1;
        let (open, settled) = (2 * self.round, 2 * self.round + 1);
        let mut queue = BinaryHeap::new();
        // What is left of the way costs at least its straight length.
        let rest = |v: VertexId| terrain.goal.map_or(0.0, |goal| ground.point(v).distance(goal));
        for &source in sources {
            (self.length[source], self.from[source], self.seen[source]) = (0.0, source, open);
            queue.push(Reverse((rest(source).to_bits(), source.raw())));
        }
        while let Some(Reverse((_, raw))) = queue.pop() {
            let at = VertexId::from_raw(raw);
            // Of several entries of a vertex the first one to come has its least length.
            if self.seen[at] == settled {
                continue;
            }
            self.seen[at] = settled;
            if self.from[at] != at && is_target(at) {
                return Some(self.trail(at));
            }
            if self.from[at] != at && !(terrain.free)(at) {
                continue;
            }
            for (next, left, right) in ground.leaving(at) {
                if self.seen[next] == settled || !(terrain.open)(left, right) {
                    continue;
                }
                let is_new = self.seen[next] != open;
                if is_new && !(terrain.free)(next) && !is_target(next) {
                    continue;
                }
                let length = self.length[at] + (terrain.cost)(ground.point(at), ground.point(next));
                if length <= terrain.limit && (is_new || length < self.length[next]) {
                    (self.length[next], self.from[next], self.seen[next]) = (length, at, open);
                    // Neither is negative, so that the bits of sums are ordered as they are.
                    queue.push(Reverse(((length + rest(next)).to_bits(), next.raw())));
                }
            }
        }
        None
    }

    fn trail(&self, end: VertexId) -> Vec<VertexId> {
        let mut trail = vec![end];
        let mut at = end;
        while self.from[at] != at {
            at = self.from[at];
            trail.push(at);
        }
        trail.reverse();
        trail
    }
}

/// The cost of an edge: its length, and more the farther it lies from the segment `a b`, so that among many short paths
/// over a mesh the straight one is cheapest.
pub fn along(a: DVec3, b: DVec3) -> impl Fn(DVec3, DVec3) -> f64 {
    /// How much dearer an edge gets that lies as far from the segment as that is long.
    const PULL: f64 = 5.0;
    let span = a.distance(b).max(f64::MIN_POSITIVE);
    move |p, q| {
        let middle = (p + q) / 2.0;
        let away = crate::mesh::geometry::closest_on_segment(middle, [a, b]).distance_squared.sqrt();
        p.distance(q) * (1.0 + PULL * away / span)
    }
}
