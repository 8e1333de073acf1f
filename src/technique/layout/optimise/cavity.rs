//! Cavities round irregular nodes are filled anew with as few irregular nodes as their rims allow.
//!
//! A cavity grows cell by cell, from an irregular node or from the way between two of them; whenever its rim turns like
//! a polygon of two to six sides it may be filled by the patches of `fill`. So irregular nodes that lie apart cancel
//! each other out, and of many that make up for one another two are left.

use std::collections::BTreeMap;

use rustc_hash::{FxHashMap, FxHashSet};

use super::fill::{Cut, Faces, Outline};
use super::{LEAST, Memory};
use crate::mesh::VertexId;
use crate::technique::layout::Layout;
use crate::technique::layout::lift::Flat;
use crate::technique::layout::proposal::Proposal;
use crate::watch::{Cancelled, Watch};

/// Larger cavities change more than they gain.
const LARGEST: usize = 200;

/// A change must lower the cost by more than rounding.
const LESS: f64 = -1e-9;

/// Grows cavities round irregular nodes, and where these bring nothing from one such node to another; how many were
/// filled anew.
pub(super) fn improve(layout: &mut Layout<'_>, memory: &mut Memory, watch: &Watch) -> Result<usize, Cancelled> {
    let single = improve_from(layout, memory, watch, |layout, seed| vec![around(layout, seed)])?;
    if single > 0 { Ok(single) } else { improve_from(layout, memory, watch, ways) }
}

fn improve_from(
    layout: &mut Layout<'_>,
    memory: &mut Memory,
    watch: &Watch,
    seeds: impl Fn(&Layout<'_>, VertexId) -> Vec<Vec<u32>>,
) -> Result<usize, Cancelled> {
    let mut filled = 0;
    let mut nodes: Vec<VertexId> = layout.ground.surface.points.ids().filter(|&v| layout.is_node(v)).collect();
    nodes.retain(|&v| is_irregular(layout, v));
    for node in nodes {
        watch.check()?;
        if layout.is_node(node) && is_irregular(layout, node) {
            let all = seeds(layout, node);
            filled += usize::from(all.into_iter().any(|cells| grow(layout, cells, memory)));
        }
    }
    Ok(filled)
}

fn is_irregular(layout: &Layout<'_>, v: VertexId) -> bool {
    let mut domains: Vec<u32> = layout.cells_at(v).iter().map(|&c| layout.domain(c)).collect();
    domains.sort_unstable();
    domains.dedup();
    domains.into_iter().any(|d| layout.patches(v, d) != layout.wanted(v, d))
}

/// The cells of one domain at a node.
fn around(layout: &Layout<'_>, seed: VertexId) -> Vec<u32> {
    let mut cells = layout.cells_at(seed).to_vec();
    cells.sort_unstable();
    let domain = cells.first().map(|&c| layout.domain(c));
    cells.retain(|&c| Some(layout.domain(c)) == domain);
    cells
}

/// The cells at a node with those on the way to another irregular node, for some that are near.
fn ways(layout: &Layout<'_>, seed: VertexId) -> Vec<Vec<u32>> {
    /// So many others are tried.
    const OTHERS: usize = 4;
    let start = around(layout, seed);
    let mut from: FxHashMap<u32, u32> = start.iter().map(|&c| (c, c)).collect();
    let mut reached: FxHashSet<VertexId> = start.iter().flat_map(|&c| layout.nodes(c)).collect();
    let (mut queue, mut next, mut ways) = (start.clone(), 0, Vec::new());
    while let Some(&at) = queue.get(next).filter(|_| ways.len() < OTHERS) {
        next += 1;
        for node in layout.nodes(at) {
            if reached.insert(node) && is_irregular(layout, node) && ways.len() < OTHERS {
                let (mut way, mut cell) = (start.clone(), at);
                while from[&cell] != cell {
                    way.push(cell);
                    cell = from[&cell];
                }
                ways.push(way);
            }
        }
        for k in 0..layout.ring(at).len() {
            if let Some(other) = layout.neighbour(at, k).filter(|other| !from.contains_key(other)) {
                from.insert(other, at);
                queue.push(other);
            }
        }
    }
    ways
}

fn grow(layout: &mut Layout<'_>, cells: Vec<u32>, memory: &mut Memory) -> bool {
    /// Refused fillings before a cavity is given up.
    const TRIES: usize = 4;
    let Some(mut cavity) = Cavity::new(layout, cells) else { return false };
    let mut tries = 0;
    while cavity.cells.len() <= LARGEST && tries < TRIES && memory.patience > 0 {
        if let Some(proposal) = cavity.proposal(layout)
            && layout.gain(&proposal) < LESS
            && !memory.refused.contains(&proposal)
        {
            tries += 1;
            if layout.carry_out(&proposal, LEAST).is_some() {
                return true;
            }
            let faces: usize = proposal.cells.iter().map(|&c| layout.faces(c).len()).sum();
            memory.refused.insert(proposal);
            memory.patience = memory.patience.saturating_sub(faces);
        }
        let Some(next) = cavity.next_cell(layout) else { return false };
        cavity.add(layout, next);
    }
    false
}

/// Cells that form a disk, while it grows.
struct Cavity {
    domain: u32,
    cells: Vec<u32>,
    is_inside: FxHashSet<u32>,
    /// How many cells inside each node has.
    nodes: BTreeMap<VertexId, usize>,
    /// Cells beside the cavity, with the number of common edges.
    beside: BTreeMap<u32, i32>,
}

impl Cavity {
    fn new(layout: &Layout<'_>, cells: Vec<u32>) -> Option<Self> {
        layout.rim(&cells)?;
        let domain = layout.domain(*cells.first()?);
        let (is_inside, nodes, beside) = (FxHashSet::default(), BTreeMap::new(), BTreeMap::new());
        let mut cavity = Self { domain, cells: Vec::new(), is_inside, nodes, beside };
        for cell in cells {
            cavity.add(layout, cell);
        }
        Some(cavity)
    }

    fn add(&mut self, layout: &Layout<'_>, cell: u32) {
        self.cells.push(cell);
        self.is_inside.insert(cell);
        self.beside.remove(&cell);
        for k in 0..layout.ring(cell).len() {
            *self.nodes.entry(layout.ring(cell)[k].node).or_default() += 1;
            if let Some(other) = layout.neighbour(cell, k).filter(|other| !self.is_inside.contains(other)) {
                *self.beside.entry(other).or_default() += 1;
            }
        }
    }

    /// How many patches inside a node of the rim should have; `None` inside.
    fn turn(&self, layout: &Layout<'_>, node: VertexId, inside: usize) -> Option<i32> {
        let outside = layout.patches(node, self.domain) as i32 - inside as i32;
        let is_rim = outside > 0 || layout.is_on_border(node);
        is_rim.then(|| layout.wanted(node, self.domain) as i32 - outside)
    }

    /// A filling that may cost less than what is there.
    fn proposal(&self, layout: &Layout<'_>) -> Option<Proposal> {
        let mut cost = 6.0 * self.cells.iter().filter(|&&c| layout.ring(c).len() == 3).count() as f64;
        let mut corners = 0;
        for (&node, &inside) in &self.nodes {
            let turn = self.turn(layout, node, inside);
            if turn.is_some_and(|turn| turn > 2) {
                return None;
            }
            corners += usize::from(turn.is_some_and(|turn| turn < 2));
            cost += layout.strain(node, self.domain, layout.patches(node, self.domain));
        }
        if !(2..=6).contains(&corners) {
            return None;
        }
        let rim = layout.rim(&self.cells)?;
        let is_corner = |k: &usize| self.turn(layout, rim[*k], self.nodes[&rim[*k]]).is_some_and(|turn| turn < 2);
        let corners: Vec<usize> = (0..rim.len()).filter(is_corner).collect();
        let outline = Outline { nodes: rim, corners };
        let least = outline.corners.len().abs_diff(4) as f64;
        let faces = (cost > least).then(|| outline.whole(&mut 0)).flatten();
        let faces = faces.or_else(|| (cost > 2.0).then(|| self.in_two(layout, &outline)).flatten())?;
        // What is regular only because it is coarse follows no shape.
        let is_coarse = 3 * faces.len() < self.cells.len();
        (!is_coarse).then(|| Proposal { cells: self.cells.clone(), faces })
    }

    /// The best shaped of the fillings in two.
    fn in_two(&self, layout: &Layout<'_>, outline: &Outline) -> Option<Faces> {
        /// How many edges a row may have less or more than its length tells.
        const SLACK: usize = 2;
        /// Fillings whose shape is looked at.
        const LOOKS: usize = 24;
        let point = |v: VertexId| layout.ground.point(v);
        let nodes = &outline.nodes;
        let total: f64 = (0..nodes.len()).map(|k| point(nodes[k]).distance(point(nodes[(k + 1) % nodes.len()]))).sum();
        let mean = (total / nodes.len().max(1) as f64).max(f64::MIN_POSITIVE);
        let aimed =
            |a: VertexId, b: VertexId| ((point(a).distance(point(b)) / mean).round() as usize).clamp(1, LARGEST);
        let mut cuts = outline.cuts(|a, b| [aimed(a, b).saturating_sub(SLACK), aimed(a, b) + SLACK]);
        let off = |cut: &Cut| aimed(nodes[cut.from], nodes[cut.to]).abs_diff(cut.edges);
        cuts.sort_by_key(|cut| (off(cut), cut.from, cut.to));
        // Of many equally good ones some from everywhere.
        let equal = cuts.iter().take_while(|cut| off(cut) == cuts.first().map_or(0, off)).count();
        let step = equal.div_ceil(LOOKS).max(1);
        let flat = Flat::new(layout, &self.cells, nodes);
        let judged = cuts.into_iter().step_by(step).take(LOOKS).filter_map(|cut| {
            let faces = outline.in_two(cut)?;
            Some((layout.misshape(nodes, &faces, &flat), faces))
        });
        judged.min_by(|a, b| a.0.total_cmp(&b.0)).map(|best| best.1)
    }

    /// The neighbour that makes the cavity roundest and keeps it a disk: at a node that turns back first, then the one
    /// with most common edges.
    fn next_cell(&self, layout: &Layout<'_>) -> Option<u32> {
        /// Neighbours tried.
        const CHOICES: usize = 8;
        let mut scores: BTreeMap<u32, i32> = self.beside.iter().map(|(&c, &common)| (c, 10 * common)).collect();
        for (&node, &inside) in &self.nodes {
            let Some(turn) = self.turn(layout, node, inside) else { continue };
            for cell in layout.cells_at(node) {
                if let Some(score) = scores.get_mut(cell) {
                    *score += if turn >= 3 { 25 } else { 1 };
                }
            }
        }
        let mut ranked: Vec<(i32, u32)> = scores.into_iter().map(|(c, s)| (-s, c)).collect();
        ranked.sort_unstable();
        ranked.into_iter().take(CHOICES).map(|r| r.1).find(|&c| self.stays_disk(layout, c))
    }

    /// Whether a cell beside the cavity meets it in one row of edges and nowhere else.
    fn stays_disk(&self, layout: &Layout<'_>, cell: u32) -> bool {
        let n = layout.ring(cell).len();
        let meets: Vec<bool> =
            (0..n).map(|k| layout.neighbour(cell, k).is_some_and(|c| self.is_inside.contains(&c))).collect();
        let common = meets.iter().filter(|&&m| m).count();
        let starts = (0..n).filter(|&k| meets[k] && !meets[(k + n - 1) % n]).count();
        let touched = layout.ring(cell).iter().filter(|corner| self.nodes.contains_key(&corner.node)).count();
        starts == 1 && touched == common + 1
    }
}
