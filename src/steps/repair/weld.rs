//! Welding within a tolerance: closes the cracks between borders, and touches nothing that is closed already.

use glam::DVec3;
use rustc_hash::FxHashMap;

use super::adjacency::EdgeTable;
use super::draft::Draft;
use crate::mesh::id::Vertex;
use crate::mesh::{IdVec, VertexId};

/// What welding within the tolerance did.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Welded {
    /// Vertices merged into another one.
    pub(super) vertices: u64,
    /// The largest distance that one of them moved.
    pub(super) shift: f64,
}

/// Merges every vertex on an open edge with the vertices within `tolerance` of it.
///
/// Chains of near vertices are one cluster as long as one member has all others within the tolerance; a longer chain
/// is split. Members move onto that vertex, so that nothing moves further than the tolerance, and the vertices that
/// remain are further apart than it.
pub(super) fn weld(draft: &mut Draft, table: &EdgeTable, tolerance: f64) -> Welded {
    let open = open_vertices(draft, table);
    if tolerance <= 0.0 || !open.iter().any(|&is_open| is_open) {
        return Welded::default();
    }
    let clusters = cluster(draft, &open, tolerance);
    let mut target: IdVec<Vertex, VertexId> = draft.points.ids().collect();
    let mut welded = Welded::default();
    for members in clusters {
        for (vertex, onto) in assign(&draft.points, members, tolerance) {
            if vertex != onto {
                target[vertex] = onto;
                welded.vertices += 1;
                welded.shift = welded.shift.max(draft.points[vertex].distance(draft.points[onto]));
            }
        }
    }
    if welded.vertices > 0 {
        draft.redirect(&target);
    }
    welded
}

/// Which vertices lie on an edge with one face only.
pub(super) fn open_vertices(draft: &Draft, table: &EdgeTable) -> IdVec<Vertex, bool> {
    let mut open = IdVec::filled(false, draft.points.len());
    for (a, b, group) in table.edges() {
        if group.len() == 1 {
            open[a] = true;
            open[b] = true;
        }
    }
    open
}

/// Vertices in cubes, to find those near a point.
struct Grid<'a> {
    points: &'a IdVec<Vertex, DVec3>,
    origin: DVec3,
    cell: f64,
    first: FxHashMap<[i64; 3], VertexId>,
    after: IdVec<Vertex, VertexId>,
}

const END: VertexId = VertexId::from_raw(u32::MAX);

impl<'a> Grid<'a> {
    /// Cubes of at least twice the tolerance, so that a query looks at eight of them at most. They are larger where
    /// vertices are sparse: then a query looks at one of them nearly always.
    fn new(draft: &'a Draft, used: impl Iterator<Item = VertexId>, tolerance: f64) -> Self {
        let points = &draft.points;
        let used: Vec<VertexId> = used.collect();
        let (low, high) = used
            .iter()
            .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), &v| (low.min(points[v]), high.max(points[v])));
        let spacing = (high - low).length() / (used.len() as f64).sqrt();
        let cell = (spacing / 4.0).clamp(2.0 * tolerance, 64.0 * tolerance);
        let after = IdVec::filled(END, points.len());
        let mut grid = Self { points, origin: low, cell, first: FxHashMap::default(), after };
        for v in used.into_iter().rev() {
            let key = grid.key(points[v]);
            grid.after[v] = grid.first.insert(key, v).unwrap_or(END);
        }
        grid
    }

    fn key(&self, point: DVec3) -> [i64; 3] {
        ((point - self.origin) / self.cell).floor().to_array().map(|x| x as i64)
    }

    /// Calls `found` with every vertex within `radius` of `point`.
    fn near(&self, point: DVec3, radius: f64, mut found: impl FnMut(VertexId)) {
        let (low, high) = (self.key(point - DVec3::splat(radius)), self.key(point + DVec3::splat(radius)));
        for x in low[0]..=high[0] {
            for y in low[1]..=high[1] {
                for z in low[2]..=high[2] {
                    let mut here = self.first.get(&[x, y, z]).copied().unwrap_or(END);
                    while here != END {
                        if self.points[here].distance_squared(point) <= radius * radius {
                            found(here);
                        }
                        here = self.after[here];
                    }
                }
            }
        }
    }
}

/// Sets of two and more vertices that hang together by steps of at most the tolerance, each in ascending order.
fn cluster(draft: &Draft, open: &IdVec<Vertex, bool>, tolerance: f64) -> Vec<Vec<VertexId>> {
    let mut used = IdVec::<Vertex, bool>::filled(false, draft.points.len());
    for corners in &draft.faces {
        for &v in corners {
            used[v] = true;
        }
    }
    let grid = Grid::new(draft, used.ids().filter(|&v| used[v]), tolerance);
    let mut parent: IdVec<Vertex, VertexId> = draft.points.ids().collect();
    for v in open.ids().filter(|&v| open[v]) {
        grid.near(draft.points[v], tolerance, |u| {
            let (a, b) = (find(&mut parent, u), find(&mut parent, v));
            let (low, high) = (a.min(b), a.max(b));
            parent[high] = low;
        });
    }
    let mut members: Vec<(VertexId, VertexId)> =
        parent.ids().map(|v| (find(&mut parent, v), v)).filter(|&(root, v)| root != v).collect();
    members.sort_unstable();
    members
        .chunk_by(|a, b| a.0 == b.0)
        .map(|chunk| std::iter::once(chunk[0].0).chain(chunk.iter().map(|m| m.1)).collect())
        .collect()
}

fn find(parent: &mut IdVec<Vertex, VertexId>, mut v: VertexId) -> VertexId {
    while parent[v] != v {
        parent[v] = parent[parent[v]];
        v = parent[v];
    }
    v
}

/// Clusters up to this size look for the best member in all pairs; larger ones are chains, or a tolerance far too
/// large.
const LARGEST_EXACT_CLUSTER: usize = 64;

/// Each member with the vertex that it moves onto.
fn assign(points: &IdVec<Vertex, DVec3>, mut members: Vec<VertexId>, tolerance: f64) -> Vec<(VertexId, VertexId)> {
    // Order by place rather than by number: a file that lists the same vertices otherwise is welded alike.
    members.sort_by(|&a, &b| lexicographic(points[a], points[b]));
    if members.len() <= LARGEST_EXACT_CLUSTER {
        let reach = |v: VertexId| members.iter().map(|&u| points[u].distance(points[v])).fold(0.0, f64::max);
        let best = members.iter().copied().min_by(|&a, &b| reach(a).total_cmp(&reach(b)));
        if let Some(centre) = best.filter(|&centre| reach(centre) <= tolerance) {
            return members.into_iter().map(|v| (v, centre)).collect();
        }
    }
    let mut leaders: Vec<VertexId> = Vec::new();
    let mut assigned = Vec::with_capacity(members.len());
    for v in members {
        let from_v = |u: VertexId| points[u].distance(points[v]);
        let nearest = leaders.iter().copied().min_by(|&a, &b| from_v(a).total_cmp(&from_v(b)));
        let near = nearest.filter(|&leader| from_v(leader) <= tolerance);
        if near.is_none() {
            leaders.push(v);
        }
        assigned.push((v, near.unwrap_or(v)));
    }
    assigned
}

fn lexicographic(a: DVec3, b: DVec3) -> std::cmp::Ordering {
    a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)).then(a.z.total_cmp(&b.z))
}
