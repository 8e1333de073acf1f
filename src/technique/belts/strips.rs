//! Strips of triangles along the border of each domain, and the belts that they are merged into.

use std::cmp::Reverse;
use std::collections::{BTreeSet, BinaryHeap};

use petgraph::graph::{NodeIndex, UnGraph};
use petgraph::visit::EdgeRef;
use rustc_hash::FxHashMap;

use crate::mesh::id::{Face, Vertex};
use crate::mesh::{FaceId, IdVec, VertexId};
use crate::technique::layout::{Ground, Side, components};

/// How thick belts are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Thickness {
    /// Strips a belt, counted in triangles.
    Strips(usize),
    /// A length along the surface; strips are then as wide as a mean edge is long.
    Length(f64),
}

impl Thickness {
    /// So many times as thick.
    #[must_use]
    pub fn scaled(self, by: f64) -> Self {
        match self {
            Self::Strips(strips) => Self::Strips(((strips as f64 * by).round() as usize).max(1)),
            Self::Length(length) => Self::Length(length * by),
        }
    }
}

/// Faces with the belt of each.
#[derive(Clone, Debug)]
pub(super) struct Belts {
    pub(super) of: IdVec<Face, u32>,
    pub(super) count: usize,
    /// Strips before merging.
    pub(super) strips: usize,
    /// The distance of each vertex from the border of its domain; 0 on the border.
    pub(super) depth: IdVec<Vertex, f64>,
}

/// The border of a domain as loops: the loop of each side, numbered from 0 in the order of their lowest sides.
pub(super) fn border_loops(ground: &Ground<'_>, of: &IdVec<Face, u32>) -> Vec<Vec<Side>> {
    let mut done = IdVec::<Face, [bool; 3]>::filled([false; 3], of.len());
    let mut loops = Vec::new();
    for face in of.ids() {
        for corner in 0..3 {
            let side = Side { face, corner };
            let inside = |f: FaceId| of[f] == of[face];
            if done[face][usize::from(corner)] || ground.beyond(side).is_some_and(inside) {
                continue;
            }
            let (mut sides, mut at) = (Vec::new(), side);
            while !std::mem::replace(&mut done[at.face][usize::from(at.corner)], true) {
                sides.push(at);
                at = ground.next_on_border(at, inside);
            }
            loops.push(sides);
        }
    }
    loops
}

/// Where a face lies: how many strips from the border, and from which loop of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Place {
    level: u32,
    label: u32,
}

/// Belts of all domains. Domains without a border stay without strips: one belt each.
pub(super) fn belts(ground: &Ground<'_>, thickness: Thickness, mean_edge: f64) -> Belts {
    let (unit, most) = match thickness {
        Thickness::Strips(strips) => (None, strips.max(1)),
        Thickness::Length(length) => (Some(mean_edge), ((length / mean_edge).round() as usize).max(1)),
    };
    let (places, depth) = places(ground, unit);
    let joined = |a: FaceId, b: FaceId| ground.domain[a] == ground.domain[b] && places[a] == places[b];
    let (strip, strips) = components(&ground.across, joined);
    let block = |f: FaceId| (places[f].label, places[f].level / most as u32);
    let (of, count) = components(&ground.across, |a, b| ground.domain[a] == ground.domain[b] && block(a) == block(b));
    let of = merge(ground, &of, count, &places, most);
    let of = without_pinches(ground, of);
    let (of, count) = components(&ground.across, |a, b| ground.domain[a] == ground.domain[b] && of[a] == of[b]);
    drop(strip);
    Belts { of, count, strips, depth }
}

/// One search from all borders at once: the level and loop of each face, the distance of each vertex.
fn places(ground: &Ground<'_>, unit: Option<f64>) -> (IdVec<Face, Place>, IdVec<Vertex, f64>) {
    let surface = ground.surface;
    let mut depth = IdVec::filled(f64::INFINITY, surface.points.len());
    let mut label = IdVec::filled(u32::MAX, surface.points.len());
    // A border vertex belongs to a loop of each domain that it touches.
    let mut of_domain: FxHashMap<(u32, VertexId), u32> = FxHashMap::default();
    let mut queue = BinaryHeap::new();
    for (number, sides) in border_loops(ground, &ground.domain).iter().enumerate() {
        for &side in sides {
            let v = ground.origin(side);
            of_domain.entry((ground.domain[side.face], v)).or_insert(number as u32);
            if depth[v] > 0.0 {
                depth[v] = 0.0;
                queue.push(Reverse((0_u64, 0_u32, v)));
            }
        }
    }
    while let Some(Reverse((bits, from, v))) = queue.pop() {
        if depth[v].to_bits() != bits || (depth[v] > 0.0 && label[v] != from) {
            continue;
        }
        for (next, left, _) in ground.leaving(v) {
            if depth[next] == 0.0 {
                continue;
            }
            let step = if unit.is_some() { ground.point(v).distance(ground.point(next)) } else { 1.0 };
            let label_here = if depth[v] == 0.0 { of_domain[&(ground.domain[left], v)] } else { label[v] };
            let candidate = (depth[v] + step, label_here);
            if candidate < (depth[next], label[next]) {
                (depth[next], label[next]) = candidate;
                queue.push(Reverse((depth[next].to_bits(), label_here, next)));
            }
        }
    }
    let label_in = |f: FaceId, v: VertexId| {
        if depth[v] == 0.0 { of_domain.get(&(ground.domain[f], v)).copied().unwrap_or(u32::MAX) } else { label[v] }
    };
    let place = |(f, corners): (FaceId, &[VertexId; 3])| {
        let near =
            corners.iter().map(|&v| (depth[v], label_in(f, v))).min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let (distance, label) = near.unwrap_or((0.0, u32::MAX));
        let level = if distance.is_finite() { (distance / unit.unwrap_or(1.0)) as u32 } else { 0 };
        Place { level, label }
    };
    (surface.faces.enumerate().map(place).collect(), depth)
}

/// A node of the graph while belts are merged.
struct Lump {
    low: u32,
    high: u32,
    faces: usize,
}

impl Lump {
    fn span(&self) -> usize {
        (self.high - self.low + 1) as usize
    }

    fn with(&self, other: &Self) -> Self {
        Self { low: self.low.min(other.low), high: self.high.max(other.high), faces: self.faces + other.faces }
    }
}

/// Merges lumps with one neighbour, then small ones, where the result is not too thick; until nothing changes.
fn merge(
    ground: &Ground<'_>,
    of: &IdVec<Face, u32>,
    count: usize,
    places: &IdVec<Face, Place>,
    most: usize,
) -> IdVec<Face, u32> {
    let mut graph = strip_graph(ground, of, count, places);
    let (least, limit) = (most.div_ceil(2), most + most / 2);
    let few = 8 * most;
    let mut home: Vec<u32> = (0..count as u32).collect();
    loop {
        let mut order: Vec<(usize, usize, NodeIndex)> = graph
            .node_indices()
            .filter(|&n| graph[n].faces > 0)
            .map(|n| (graph[n].span(), graph[n].faces, n))
            .collect();
        order.sort_unstable();
        let mut merged = false;
        for (_, _, node) in order {
            let neighbours: BTreeSet<NodeIndex> = graph.neighbors(node).collect();
            let lump = &graph[node];
            let is_small = lump.span() < least || lump.faces < few;
            if lump.faces == 0 || !(neighbours.len() == 1 || is_small) {
                continue;
            }
            let is_tiny = lump.faces < most * 2;
            let best = neighbours.iter().map(|&n| (lump.with(&graph[n]).span(), graph[n].faces, n)).min();
            let Some((span, _, target)) = best else { continue };
            if (is_small && span <= limit) || span <= most || is_tiny {
                absorb(&mut graph, target, node);
                home[node.index()] = target.index() as u32;
                merged = true;
            }
        }
        if !merged {
            break;
        }
    }
    let root = |mut at: u32| {
        while home[at as usize] != at {
            at = home[at as usize];
        }
        at
    };
    of.iter().map(|&lump| root(lump)).collect()
}

fn strip_graph(
    ground: &Ground<'_>,
    of: &IdVec<Face, u32>,
    count: usize,
    places: &IdVec<Face, Place>,
) -> UnGraph<Lump, ()> {
    let mut graph = UnGraph::with_capacity(count, 3 * count);
    for _ in 0..count {
        graph.add_node(Lump { low: u32::MAX, high: 0, faces: 0 });
    }
    let mut arcs = BTreeSet::new();
    for (f, &lump) in of.enumerate() {
        let node = &mut graph[NodeIndex::new(lump as usize)];
        let level = places[f].level;
        (node.low, node.high, node.faces) = (node.low.min(level), node.high.max(level), node.faces + 1);
        for g in ground.across[f].into_iter().flatten() {
            if of[g] > lump && ground.domain[f] == ground.domain[g] {
                arcs.insert((lump, of[g]));
            }
        }
    }
    for (a, b) in arcs {
        graph.add_edge(NodeIndex::new(a as usize), NodeIndex::new(b as usize), ());
    }
    graph
}

/// Moves the faces and arcs of `gone` to `target`.
fn absorb(graph: &mut UnGraph<Lump, ()>, target: NodeIndex, gone: NodeIndex) {
    graph[target] = graph[target].with(&graph[gone]);
    graph[gone].faces = 0;
    let edges: Vec<_> = graph.edges(gone).map(|e| (e.id(), e.target())).collect();
    for &(_, other) in &edges {
        if other != target && graph.find_edge(target, other).is_none() {
            graph.add_edge(target, other, ());
        }
    }
    let others: Vec<NodeIndex> = edges.iter().map(|e| e.1).collect();
    for other in others {
        if let Some(edge) = graph.find_edge(gone, other) {
            graph.remove_edge(edge);
        }
    }
}

/// Belts that touch themselves in a vertex lose the smaller fan there to the belt beside it.
fn without_pinches(ground: &Ground<'_>, mut of: IdVec<Face, u32>) -> IdVec<Face, u32> {
    /// More rounds have never changed anything; what is left becomes a node.
    const ROUNDS: usize = 8;
    for _ in 0..ROUNDS {
        let mut changed = false;
        for v in ground.surface.points.ids() {
            changed |= open_pinch(ground, &mut of, v);
        }
        if !changed {
            break;
        }
    }
    of
}

fn open_pinch(ground: &Ground<'_>, of: &mut IdVec<Face, u32>, v: VertexId) -> bool {
    let faces = ground.faces_at.of(v);
    if faces.iter().all(|&f| of[f] == of[faces[0]]) {
        return false;
    }
    let fans = fans(ground, of, v);
    let twice = |fan: &Vec<FaceId>| fans.iter().filter(|other| of[other[0]] == of[fan[0]]).count() > 1;
    let smallest = fans.iter().filter(|fan| twice(fan)).min_by_key(|fan| (fan.len(), fan[0]));
    let Some(fan) = smallest else { return false };
    let belt = of[fan[0]];
    let domain = ground.domain[fan[0]];
    let beside = fan.iter().flat_map(|&f| ground.across[f]).flatten();
    let other =
        beside.filter(|&g| of[g] != belt && ground.domain[g] == domain && faces.contains(&g)).map(|g| of[g]).min();
    let Some(other) = other else { return false };
    for &f in fan {
        of[f] = other;
    }
    true
}

/// The faces at a vertex in sets that hang together within one belt.
pub(super) fn fans(ground: &Ground<'_>, of: &IdVec<Face, u32>, v: VertexId) -> Vec<Vec<FaceId>> {
    let mut left: Vec<FaceId> = ground.faces_at.of(v).to_vec();
    let mut fans = Vec::new();
    while let Some(start) = left.first().copied() {
        let (mut fan, mut next) = (vec![start], 0);
        left.remove(0);
        while next < fan.len() {
            let f = fan[next];
            next += 1;
            for g in ground.across[f].into_iter().flatten() {
                if of[g] == of[f]
                    && let Some(at) = left.iter().position(|&h| h == g)
                {
                    left.remove(at);
                    fan.push(g);
                }
            }
        }
        fans.push(fan);
    }
    fans
}
