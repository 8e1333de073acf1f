//! Triangles walk towards each other and become quads.

use std::collections::VecDeque;
use std::collections::hash_map::Entry;

use rustc_hash::FxHashMap;

use super::{LEAST, OptimiseReport};
use crate::mesh::VertexId;
use crate::technique::layout::Layout;
use crate::technique::layout::proposal::Proposal;
use crate::watch::{Cancelled, Watch};

/// Removes triangles in pairs; a single one left in a domain goes by a node on the rim or on the border to a domain
/// that has one too.
pub(super) fn remove(layout: &mut Layout<'_>, report: &mut OptimiseReport, watch: &Watch) -> Result<(), Cancelled> {
    pair_up(layout, report, watch)?;
    report.parity_nodes += even_out(layout);
    pair_up(layout, report, watch)
}

fn pair_up(layout: &mut Layout<'_>, report: &mut OptimiseReport, watch: &Watch) -> Result<(), Cancelled> {
    let mut given_up: Vec<u32> = Vec::new();
    loop {
        watch.check()?;
        let first = layout.cells().find(|&c| layout.ring(c).len() == 3 && !given_up.contains(&c));
        let Some(triangle) = first else { return Ok(()) };
        match march(layout, triangle) {
            Some(()) => report.pairs += 1,
            None => given_up.extend(layout.cells().filter(|&c| layout.ring(c).len() == 3 && c <= triangle)),
        }
    }
}

/// Walks a triangle to the nearest other one and couples them.
fn march(layout: &mut Layout<'_>, start: u32) -> Option<()> {
    /// Longer walks disturb more than they mend.
    const LONGEST: usize = 200;
    let mut at = start;
    for _ in 0..LONGEST {
        let path = path_to_triangle(layout, at)?;
        if path.len() == 2 {
            return layout.merge_pair(path[0], path[1]).then_some(());
        }
        at = step(layout, &path)?;
    }
    None
}

/// The shortest way over cells of one domain to another triangle.
fn path_to_triangle(layout: &Layout<'_>, start: u32) -> Option<Vec<u32>> {
    let mut from: FxHashMap<u32, u32> = FxHashMap::default();
    let mut queue = VecDeque::from([start]);
    from.insert(start, start);
    while let Some(at) = queue.pop_front() {
        for k in 0..layout.ring(at).len() {
            let Some(next) = layout.neighbour(at, k).filter(|next| !from.contains_key(next)) else { continue };
            from.insert(next, at);
            if layout.ring(next).len() == 3 {
                let mut path = vec![next];
                while let Some(&last) = path.last().filter(|&&last| last != start) {
                    path.push(from[&last]);
                }
                path.reverse();
                return Some(path);
            }
            queue.push_back(next);
        }
    }
    None
}

/// Moves the triangle `path[0]` through the quad `path[1]` to the side of `path[2]`; the triangle's new cell.
fn step(layout: &mut Layout<'_>, path: &[u32]) -> Option<u32> {
    let [triangle, quad, next] = [path[0], path[1], path[2]];
    let exit = (0..layout.ring(quad).len()).find(|&k| layout.neighbour(quad, k) == Some(next))?;
    let ring = layout.nodes(quad);
    let exit = (ring[exit], ring[(exit + 1) % ring.len()]);
    let rim = layout.rim(&[triangle, quad]).filter(|rim| rim.len() == 5)?;
    let mut options: Vec<(f64, Proposal)> = Vec::new();
    for k in 0..5 {
        let at = |i: usize| rim[(k + i) % 5];
        let tri = vec![at(0), at(1), at(2)];
        let faces = (0..2).any(|i| (tri[i], tri[i + 1]) == exit);
        if faces {
            let proposal = Proposal { cells: vec![triangle, quad], faces: vec![tri, vec![at(2), at(3), at(4), at(0)]] };
            options.push((layout.gain(&proposal), proposal));
        }
    }
    options.sort_by(|a, b| a.0.total_cmp(&b.0));
    // A poor shape on the way is better than a triangle that stays.
    for least in [LEAST, f64::NEG_INFINITY] {
        for (_, proposal) in &options {
            if let Some(undo) = layout.carry_out(proposal, least) {
                return Some(undo.made[0]);
            }
        }
    }
    None
}

/// Gives each domain that has a single triangle left another border node, shared with a second such domain, or alone
/// on the rim.
fn even_out(layout: &mut Layout<'_>) -> usize {
    let mut added = 0;
    let odd: Vec<u32> = layout.cells().filter(|&c| layout.ring(c).len() == 3).collect();
    for triangle in odd {
        if !layout.exists(triangle) || layout.ring(triangle).len() != 3 {
            continue;
        }
        let Some(way) = way_out(layout, triangle) else { continue };
        for (a, b) in way {
            added += usize::from(layout.add_border_node(a, b).is_some());
        }
    }
    layout.make_polygons();
    added
}

/// Edges to cross on the way from a triangle to the rim, or to a domain with a triangle: nodes there make all even.
fn way_out(layout: &Layout<'_>, start: u32) -> Option<Vec<(VertexId, VertexId)>> {
    let mut from: FxHashMap<u32, (u32, Option<(VertexId, VertexId)>)> = FxHashMap::default();
    let mut queue = VecDeque::from([start]);
    from.insert(start, (start, None));
    let home = layout.domain(start);
    let mut found = None;
    'search: while let Some(at) = queue.pop_front() {
        if layout.domain(at) != home && layout.ring(at).len() == 3 {
            found = Some((at, None));
            break;
        }
        for k in 0..layout.ring(at).len() {
            let ring = layout.ring(at);
            let edge = (ring[k].node, ring[(k + 1) % ring.len()].node);
            let Some(next) = layout.beyond(at, k) else {
                found = Some((at, Some(edge)));
                break 'search;
            };
            if let Entry::Vacant(entry) = from.entry(next) {
                entry.insert((at, (layout.domain(next) != layout.domain(at)).then_some(edge)));
                queue.push_back(next);
            }
        }
    }
    let (mut at, last) = found?;
    let mut way: Vec<(VertexId, VertexId)> = last.into_iter().collect();
    while at != start {
        let (before, edge) = from[&at];
        way.extend(edge);
        at = before;
    }
    Some(way)
}

impl Layout<'_> {
    /// Puts a node in the middle of the edge from `a` to `b`, which both cells beside it get.
    fn add_border_node(&mut self, a: VertexId, b: VertexId) -> Option<VertexId> {
        let (cell, k) = self.cells_at(a).iter().find_map(|&c| {
            let ring = self.ring(c);
            let k = (0..ring.len()).find(|&k| ring[k].node == a && ring[(k + 1) % ring.len()].node == b)?;
            Some((c, k))
        })?;
        let path = self.path(cell, k);
        let middle = *path.get(path.len() / 2).filter(|_| path.len() > 2)?;
        let other = self.beyond(cell, k);
        self.make_node(middle, [Some(cell), other]);
        Some(middle)
    }
}
