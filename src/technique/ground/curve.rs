//! The network of curves and its pieces from node to node.

use glam::DVec3;
use rustc_hash::FxHashMap;
use smallvec::SmallVec;

use crate::mesh::topology::EdgeTable;
use crate::mesh::{EdgeMark, Freedom, MarkCause, Surface, VertexId};

/// A piece of the network from node to node.
#[derive(Clone, Debug)]
pub struct Curve {
    /// Its vertices in order; the last is the first one where it is closed.
    pub vertices: Vec<VertexId>,
    /// Their coordinates.
    pub points: Vec<DVec3>,
    /// The length from the start to each.
    pub along: Vec<f64>,
    /// What its first edge is marked as.
    pub mark: EdgeMark,
}

impl Curve {
    fn new(surface: &Surface, vertices: Vec<VertexId>, mark: EdgeMark) -> Self {
        let points: Vec<DVec3> = vertices.iter().map(|&v| surface.points[v]).collect();
        let mut along = vec![0.0];
        for pair in points.windows(2) {
            along.push(along[along.len() - 1] + (pair[1] - pair[0]).length());
        }
        Self { vertices, points, along, mark }
    }

    /// Its length.
    pub fn length(&self) -> f64 {
        self.along[self.along.len() - 1]
    }

    /// Whether it ends where it starts.
    pub fn is_closed(&self) -> bool {
        self.vertices[0] == self.vertices[self.vertices.len() - 1]
    }

    /// The point at a length from the start.
    pub fn at(&self, along: f64) -> DVec3 {
        let i = self.along.partition_point(|&s| s < along).clamp(1, self.along.len() - 1);
        let (from, to) = (self.along[i - 1], self.along[i]);
        let t = if to > from { ((along - from) / (to - from)).clamp(0.0, 1.0) } else { 0.0 };
        self.points[i - 1].lerp(self.points[i], t)
    }

    /// The length from the start to the point nearest to `p`.
    pub fn nearest(&self, p: DVec3) -> f64 {
        let mut best = (f64::INFINITY, 0.0);
        for (i, pair) in self.points.windows(2).enumerate() {
            let near = crate::mesh::geometry::closest_on_segment(p, [pair[0], pair[1]]);
            if near.distance_squared < best.0 {
                best = (near.distance_squared, self.along[i] + near.weights[1] * (self.along[i + 1] - self.along[i]));
            }
        }
        best.1
    }

    /// The largest distance between the piece from `from` to `to` and its chord.
    pub fn sag(&self, from: f64, to: f64) -> f64 {
        self.bend(from, to).0
    }

    /// The largest distance between the piece from `from` to `to` and its chord, the length from the start where it is
    /// reached, and the number of points inside the piece.
    pub(super) fn bend(&self, from: f64, to: f64) -> (f64, f64, usize) {
        let chord = [self.at(from), self.at(to)];
        let first = self.along.partition_point(|&s| s <= from);
        let end = self.along.partition_point(|&s| s < to);
        let mut most = (0.0, from);
        for i in first..end {
            let off = crate::mesh::geometry::closest_on_segment(self.points[i], chord).distance_squared;
            if off > most.0 {
                most = (off, self.along[i]);
            }
        }
        (most.0.sqrt(), most.1, end.saturating_sub(first))
    }
}

/// The edges of the network at each vertex: the other end and the mark.
pub(super) type Network = FxHashMap<VertexId, SmallVec<[(VertexId, EdgeMark); 4]>>;

/// All marked edges, rims, and edges between two labels.
pub(super) fn network(surface: &Surface, edges: &EdgeTable) -> Network {
    let labels = surface.carried.regions.as_ref().map(|r| &r.labels);
    let mut network = Network::default();
    for (_, key, sides) in edges.iter() {
        let cause = match sides {
            [s, t] if labels.is_some_and(|l| l[s.face] != l[t.face]) => Some(MarkCause::RegionBorder),
            [_, _] => None,
            _ => Some(MarkCause::Boundary),
        };
        let implied = cause.map(|cause| EdgeMark { freedom: Freedom::OnCurve, cause });
        if let Some(mark) = surface.carried.marks.get(&key).copied().or(implied) {
            network.entry(key[0]).or_default().push((key[1], mark));
            network.entry(key[1]).or_default().push((key[0], mark));
        }
    }
    network
}

/// Whether each vertex is a node of the network. The pins of released vertices do not count.
pub(super) fn nodes(
    surface: &Surface,
    network: &Network,
    corner: f64,
    released: &std::collections::BTreeSet<VertexId>,
) -> Vec<bool> {
    let cosine = libm::cos(corner.to_radians());
    let is_node = |v: VertexId| {
        let Some(spokes) = network.get(&v) else { return false };
        let [(a, s), (b, t)] = spokes[..] else { return true };
        let is_pinned = surface.carried.pins.get(&v) == Some(&Freedom::Keep) && !released.contains(&v);
        if is_pinned || s.cause != t.cause {
            return true;
        }
        let [p, q, r] = [a, v, b].map(|w| surface.points[w]);
        (q - p).dot(r - q) < cosine * (q - p).length() * (r - q).length()
    };
    surface.points.ids().map(is_node).collect()
}

/// The pieces of the network; a closed curve without a node starts at its lowest vertex.
pub(super) fn curves(surface: &Surface, network: &Network, is_node: Vec<bool>) -> Vec<Curve> {
    let mut passed = vec![false; surface.points.len()];
    let mut curves = Vec::new();
    let spokes = |v: VertexId| network.get(&v).map(SmallVec::as_slice).unwrap_or_default();
    for round in 0..2 {
        for v in surface.points.ids() {
            let starts = if round == 0 { is_node[v.index()] } else { !passed[v.index()] && !spokes(v).is_empty() };
            if !starts || (round == 1 && is_node[v.index()]) {
                continue;
            }
            for &(first, mark) in spokes(v) {
                let chain = walk(v, first, &is_node, spokes);
                let last = chain[chain.len() - 1];
                // Each piece is met from both ends: the one from the lower end, or towards the lower neighbour, counts.
                let back = chain[chain.len() - 2];
                let counts = (v, first) <= (last, back);
                if counts {
                    for w in &chain {
                        passed[w.index()] = true;
                    }
                    curves.push(Curve::new(surface, chain, mark));
                }
            }
            passed[v.index()] = true;
        }
    }
    curves
}

fn walk<'a>(
    start: VertexId,
    first: VertexId,
    is_node: &[bool],
    spokes: impl Fn(VertexId) -> &'a [(VertexId, EdgeMark)],
) -> Vec<VertexId> {
    let mut chain = vec![start, first];
    while chain[chain.len() - 1] != start && !is_node[chain[chain.len() - 1].index()] {
        let (before, at) = (chain[chain.len() - 2], chain[chain.len() - 1]);
        let Some(&(next, _)) = spokes(at).iter().find(|(w, _)| *w != before) else { break };
        chain.push(next);
    }
    chain
}
