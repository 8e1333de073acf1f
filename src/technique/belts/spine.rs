//! What connectors of a belt lead to where it has no single hole: the joints of several holes, or a path in its middle.

use std::collections::VecDeque;

use glam::DVec3;
use rustc_hash::FxHashMap;

use super::draft::Draft;
use crate::mesh::{FaceId, VertexId};
use crate::technique::layout::Terrain;

/// A belt without a hole whose nodes all lie within this many intervals of its centre gets one central node.
const NEAR: f64 = 1.5;

/// A belt winds, as a spiral does, where the way between its ends is so many times as long as that between the points
/// of it that lie farthest apart.
const WINDING: f64 = 2.0;

impl Draft<'_> {
    /// Joins all inner loops to one, always the two closest ones; the vertices of the joints.
    pub(super) fn join_holes(&mut self, belt: u32, outer: &[VertexId], holes: &[Vec<VertexId>]) -> Vec<VertexId> {
        let mut joined = holes[0].clone();
        let mut open: Vec<&Vec<VertexId>> = holes[1..].iter().collect();
        let mut joints = Vec::new();
        while !open.is_empty() {
            let targets: Vec<VertexId> = open.iter().flat_map(|hole| self.nodes_or_all(hole)).collect();
            let sources = self.nodes_or_all(&joined);
            let Some(path) = self.short_path(belt, &sources, &targets, outer) else { break };
            self.add_wall(&path);
            let Some(&end) = path.last() else { break };
            (self.node[path[0]], self.node[end]) = (true, true);
            let Some(hole) = open.iter().position(|hole| hole.contains(&end)) else { break };
            joined.extend(open.remove(hole));
            joined.extend(&path);
            joints.extend(path);
        }
        joints
    }

    fn nodes_or_all(&self, vertices: &[VertexId]) -> Vec<VertexId> {
        let nodes: Vec<VertexId> = vertices.iter().copied().filter(|&v| self.node[v]).collect();
        if nodes.is_empty() { vertices.to_vec() } else { nodes }
    }

    /// A central vertex, or in a long belt a central path: the zero-area hole of a belt without one.
    pub(super) fn spine(&mut self, belt: u32, outer: &[VertexId]) -> Vec<VertexId> {
        let depth = self.depth_in(belt, outer);
        let deepest = depth.iter().copied().max_by(|a, b| a.1.cmp(&b.1).then(b.0.cmp(&a.0)));
        let Some((centre, deep)) = deepest else { return Vec::new() };
        let at = self.ground.point(centre);
        let is_near = |&v: &VertexId| !self.node[v] || self.ground.point(v).distance(at) <= NEAR * self.interval;
        let is_round = outer.iter().all(is_near);
        self.node[centre] = true;
        if is_round {
            return vec![centre];
        }
        let ridge: Vec<VertexId> = depth.iter().filter(|d| 5 * d.1 >= 3 * deep).map(|d| d.0).collect();
        let straight =
            self.ends_by_distance(&ridge, centre).and_then(|[a, b]| self.short_path(belt, &[a], &[b], outer));
        self.node[centre] = false;
        let winding =
            self.ends_by_edges(&ridge, centre, belt).and_then(|[a, b]| self.short_path(belt, &[a], &[b], outer));
        let reach = |path: &Option<Vec<VertexId>>| path.as_ref().map_or(0.0, |path| self.length(path));
        let is_winding = reach(&winding) > WINDING * reach(&straight);
        let chosen = if is_winding { winding } else { straight };
        let Some(path) = chosen else {
            self.node[centre] = true;
            return vec![centre];
        };
        self.add_wall(&path);
        for &end in [path.first(), path.last()].into_iter().flatten() {
            self.node[end] = true;
        }
        path
    }

    /// The two vertices of a ridge that lie far from each other as the crow flies.
    fn ends_by_distance(&self, ridge: &[VertexId], centre: VertexId) -> Option<[VertexId; 2]> {
        let far = |from: VertexId| {
            let from = self.ground.point(from);
            ridge.iter().copied().max_by(|&a, &b| {
                let [da, db] = [a, b].map(|v| self.ground.point(v).distance_squared(from));
                da.total_cmp(&db).then(b.cmp(&a))
            })
        };
        let a = far(centre)?;
        far(a).filter(|&b| b != a).map(|b| [a, b])
    }

    /// The two vertices of a ridge that lie far from each other along the belt.
    fn ends_by_edges(&self, ridge: &[VertexId], centre: VertexId, belt: u32) -> Option<[VertexId; 2]> {
        let far = |from: VertexId| {
            let away = self.depth_in(belt, &[from]).into_iter().filter(|(v, _)| ridge.binary_search(v).is_ok());
            away.max_by(|a, b| a.1.cmp(&b.1).then(b.0.cmp(&a.0))).map(|(v, _)| v)
        };
        let a = far(centre)?;
        far(a).filter(|&b| b != a).map(|b| [a, b])
    }

    fn length(&self, path: &[VertexId]) -> f64 {
        path.windows(2).map(|w| self.ground.point(w[0]).distance(self.ground.point(w[1]))).sum()
    }

    /// Inner vertices of a belt with the number of edges between them and its outer loop, by vertex.
    fn depth_in(&self, belt: u32, outer: &[VertexId]) -> Vec<(VertexId, u32)> {
        let mut depth: FxHashMap<VertexId, u32> = outer.iter().map(|&v| (v, 0)).collect();
        let mut queue: VecDeque<VertexId> = outer.iter().copied().collect();
        let mut found = Vec::new();
        while let Some(v) = queue.pop_front() {
            let next = depth[&v] + 1;
            for (w, left, right) in self.ground.leaving(v) {
                let is_here = self.belts.of[left] == belt && self.belts.of[right] == belt;
                if is_here && self.is_free(w, belt) && !depth.contains_key(&w) {
                    depth.insert(w, next);
                    found.push((w, next));
                    queue.push_back(w);
                }
            }
        }
        found.sort_unstable();
        found
    }

    /// The shortest path through free vertices of a belt.
    pub(super) fn short_path(
        &mut self,
        belt: u32,
        sources: &[VertexId],
        targets: &[VertexId],
        avoid: &[VertexId],
    ) -> Option<Vec<VertexId>> {
        let mut finder = std::mem::take(&mut self.finder);
        let mut sorted = targets.to_vec();
        sorted.sort_unstable();
        let mut shunned = avoid.to_vec();
        shunned.sort_unstable();
        let free = |v: VertexId| self.is_free(v, belt) && shunned.binary_search(&v).is_err();
        let open = |a: FaceId, b: FaceId| self.belts.of[a] == belt && self.belts.of[b] == belt;
        let cost = |a: DVec3, b: DVec3| a.distance(b);
        let terrain = Terrain { free: &free, open: &open, cost: &cost, limit: f64::INFINITY, goal: None };
        let path = finder.path(self.ground, sources, |v| sorted.binary_search(&v).is_ok(), &terrain);
        self.finder = finder;
        path
    }
}
