//! Corners of curves that lie closer together than the curves may move: one of them may merge into the other.
//!
//! Tessellations of surfaces that nearly meet in one point give two corners a hair apart. Both kept would force slivers
//! of that size. So a path between them becomes a curve, and the corner with fewer curves may slide along its curves,
//! each of which must stay within the curves' tolerance of where it was, as any other curve.
//! Cost: O(corners · edges within reach of one).

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use rustc_hash::FxHashMap;

use crate::mesh::halfedge::{HalfedgeMesh, edge_of};
use crate::mesh::{Freedom, HalfedgeId, ResolvedFreedom, VertexId, edge_key};

/// A way from one corner to another along edges.
struct Way {
    length: f64,
    /// From one corner to the other.
    vertices: Vec<VertexId>,
}

/// The freedom with which corners closer than `reach` may merge; `None` where there are none.
pub(super) fn free_close_corners(
    mesh: &HalfedgeMesh,
    freedom: &ResolvedFreedom,
    reach: f64,
) -> Option<ResolvedFreedom> {
    let is_corner = |&v: &VertexId| mesh.vertex_freedom(v) == Freedom::Keep && curves(mesh, v).is_some_and(|n| n > 0);
    let mut ways: Vec<Way> = mesh.vertices().filter(is_corner).flat_map(|v| ways_from(mesh, v, reach)).collect();
    if ways.is_empty() {
        return None;
    }
    ways.sort_by(|a, b| a.length.total_cmp(&b.length).then_with(|| a.vertices.cmp(&b.vertices)));
    let mut freedom = freedom.clone();
    for way in ways {
        let [first, .., last] = way.vertices[..] else { continue };
        let rank = |v| (curves(mesh, v), Reverse(v));
        let weak = if rank(first) < rank(last) { first } else { last };
        let both_kept = [first, last].iter().all(|&v| freedom.vertices[v] == Freedom::Keep);
        let crosses =
            way.vertices[1..way.vertices.len() - 1].iter().any(|&v| freedom.vertices[v] != mesh.vertex_freedom(v));
        if !both_kept || crosses {
            continue;
        }
        freedom.vertices[weak] = Freedom::OnCurve;
        for pair in way.vertices.windows(2) {
            freedom.make_curve(edge_key(pair[0], pair[1]));
        }
        for &v in &way.vertices[1..way.vertices.len() - 1] {
            freedom.vertices[v] = Freedom::OnCurve;
        }
    }
    Some(freedom)
}

/// The number of curve edges at a vertex; `None` where one of them is kept.
fn curves(mesh: &HalfedgeMesh, v: VertexId) -> Option<usize> {
    let mut count = 0;
    for h in mesh.outgoing(v) {
        match mesh.edge_freedom(edge_of(h)) {
            Freedom::Keep => return None,
            Freedom::OnCurve => count += 1,
            Freedom::Free => {}
        }
    }
    Some(count)
}

/// The shortest ways from a corner to the corners with higher numbers within reach, through vertices that are no
/// corners; a way meets a curve only to follow it.
fn ways_from(mesh: &HalfedgeMesh, start: VertexId, reach: f64) -> Vec<Way> {
    let mut settled: FxHashMap<VertexId, VertexId> = FxHashMap::default();
    // Lengths are not negative, so that their bits are in their order.
    let mut queue = BinaryHeap::from([Reverse((0_u64, start, start, false))]);
    let mut ways = Vec::new();
    while let Some(Reverse((bits, v, from, by_curve))) = queue.pop() {
        let on_curve = v != start && mesh.vertex_freedom(v) == Freedom::OnCurve;
        if settled.contains_key(&v) || on_curve && !by_curve {
            continue;
        }
        settled.insert(v, from);
        let length = f64::from_bits(bits);
        if v != start && mesh.vertex_freedom(v) == Freedom::Keep {
            if v > start && curves(mesh, v).is_some_and(|n| n > 0) {
                ways.push(Way { length, vertices: trace(&settled, start, v) });
            }
            continue;
        }
        let is_way = |h: &HalfedgeId| match mesh.edge_freedom(edge_of(*h)) {
            Freedom::Keep => false,
            Freedom::OnCurve => v == start || on_curve,
            Freedom::Free => !on_curve,
        };
        for h in mesh.outgoing(v).filter(is_way) {
            let w = mesh.target(h);
            let far = length + mesh.point(v).distance(mesh.point(w));
            if far <= reach && !settled.contains_key(&w) {
                let by_curve = mesh.edge_freedom(edge_of(h)) == Freedom::OnCurve;
                queue.push(Reverse((far.to_bits(), w, v, by_curve)));
            }
        }
    }
    ways
}

fn trace(from: &FxHashMap<VertexId, VertexId>, start: VertexId, end: VertexId) -> Vec<VertexId> {
    let mut vertices = vec![end];
    let mut at = end;
    while at != start {
        at = from[&at];
        vertices.push(at);
    }
    vertices.reverse();
    vertices
}
