//! Cavities round irregular nodes are filled anew with as few irregular nodes as their rims allow.
//!
//! A cavity grows cell by cell, from an irregular node or from the way between two of them; whenever its rim turns like
//! a polygon of two to six sides it may be filled by the patches of [`fill`](crate::technique::fill). So irregular
//! nodes that lie apart cancel each other out, and of many that make up for one another two are left.

use std::collections::BTreeMap;

use rustc_hash::{FxHashMap, FxHashSet};

use super::{LEAST, Memory};
use crate::mesh::VertexId;
use crate::technique::fill::{Cut, Faces, Outline};
use crate::technique::layout::Layout;
use crate::technique::layout::proposal::{Proposal, TRIANGLE};
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
    domains.into_iter().any(|d| layout.off(v, d, layout.patches(v, d)) > 0.5)
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
            && proposal.cells.iter().map(|&c| layout.area(c).length()).sum::<f64>()
                <= memory.largest * proposal.faces.len() as f64
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

/// A node of a cavity. The layout stays as it is while the cavity grows.
#[derive(Clone, Debug)]
struct Seen {
    /// Cells inside.
    inside: i32,
    /// Cells of the domain, how many there should be, and how many else there may be.
    patches: i32,
    wanted: i32,
    second: Option<i32>,
    is_border: bool,
    cells: Vec<u32>,
}

impl Seen {
    /// How many patches inside a node of the rim should have; `None` inside. A corner that leans gets its second
    /// choice.
    fn turn(&self, leans: bool) -> Option<i32> {
        let outside = self.patches - self.inside;
        let wanted = self.second.filter(|_| leans).unwrap_or(self.wanted);
        (outside > 0 || self.is_border).then_some(wanted - outside)
    }
}

/// Cells that form a disk, while it grows.
struct Cavity {
    domain: u32,
    cells: Vec<u32>,
    is_inside: FxHashSet<u32>,
    nodes: BTreeMap<VertexId, Seen>,
    /// What its triangles and nodes cost.
    cost: f64,
    /// Cells beside the cavity, with the number of common edges.
    beside: BTreeMap<u32, i32>,
}

impl Cavity {
    fn new(layout: &Layout<'_>, cells: Vec<u32>) -> Option<Self> {
        layout.rim(&cells)?;
        let domain = layout.domain(*cells.first()?);
        let (is_inside, nodes, beside) = (FxHashSet::default(), BTreeMap::new(), BTreeMap::new());
        let mut cavity = Self { domain, cells: Vec::new(), is_inside, nodes, cost: 0.0, beside };
        for cell in cells {
            cavity.add(layout, cell);
        }
        Some(cavity)
    }

    fn add(&mut self, layout: &Layout<'_>, cell: u32) {
        self.cells.push(cell);
        self.is_inside.insert(cell);
        self.beside.remove(&cell);
        self.cost += if layout.ring(cell).len() == 3 { TRIANGLE } else { 0.0 };
        for k in 0..layout.ring(cell).len() {
            let node = layout.ring(cell)[k].node;
            let seen = self.nodes.entry(node).or_insert_with(|| {
                let patches = layout.patches(node, self.domain);
                self.cost += layout.strain(node, self.domain, patches);
                Seen {
                    inside: 0,
                    patches: patches as i32,
                    wanted: layout.wanted(node, self.domain) as i32,
                    second: layout.second_choice(node, self.domain).map(|n| n as i32),
                    is_border: layout.is_on_border(node),
                    cells: layout.cells_at(node).to_vec(),
                }
            });
            seen.inside += 1;
            if let Some(other) = layout.neighbour(cell, k).filter(|other| !self.is_inside.contains(other)) {
                *self.beside.entry(other).or_default() += 1;
            }
        }
    }

    /// The filling that costs least, if one costs less than what is there.
    fn proposal(&self, layout: &Layout<'_>) -> Option<Proposal> {
        /// Corners between two numbers that are tried with the other one.
        const LEANING: usize = 3;
        let between = self.nodes.iter().filter(|(_, seen)| seen.second.is_some() && seen.turn(false).is_some());
        let leans = std::iter::once(None).chain(between.map(|(&v, _)| Some(v)).take(LEANING));
        let found = leans.filter_map(|lean| self.leaning(layout, lean)).map(|p| (layout.gain(&p), p));
        found.min_by(|a, b| a.0.total_cmp(&b.0)).map(|best| best.1)
    }

    /// A filling that may cost less than what is there, with the second choice of one corner.
    fn leaning(&self, layout: &Layout<'_>, lean: Option<VertexId>) -> Option<Proposal> {
        /// Nodes that turn back which one row can join.
        const MOST: usize = 2;
        let turn = |node: VertexId| self.nodes.get(&node).and_then(|seen| seen.turn(lean == Some(node)));
        let (mut corners, mut reflex) = (0, 0);
        for (&node, seen) in &self.nodes {
            match seen.turn(lean == Some(node)) {
                Some(1) => corners += 1,
                Some(3) => reflex += 1,
                Some(2) | None => {}
                Some(_) => return None,
            }
        }
        let least = corners as f64 - reflex as f64 - 4.0;
        if reflex > MOST || !(2 + reflex..=6 + reflex).contains(&corners) || self.cost <= least.abs() {
            return None;
        }
        let rim = layout.rim(&self.cells)?;
        let places = |wanted: i32| (0..rim.len()).filter(|&k| turn(rim[k]) == Some(wanted)).collect::<Vec<_>>();
        let (corners, reflex) = (places(1), places(3));
        let is_straight = reflex.is_empty();
        let outline = Outline { nodes: rim, corners, reflex };
        let whole = if is_straight { outline.whole(&mut 0) } else { None };
        let faces =
            whole.or_else(|| (self.cost > 2.0 || !is_straight).then(|| self.in_two(layout, &outline)).flatten())?;
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
        cuts.sort_by_key(|cut| (cut.irregular, off(cut), cut.from, cut.to));
        // Of many equally good ones some from everywhere.
        let first = cuts.first().map(|cut| (cut.irregular, off(cut)));
        let equal = cuts.iter().take_while(|cut| Some((cut.irregular, off(cut))) == first).count();
        let step = equal.div_ceil(LOOKS).max(1);
        let flat = layout.lay_flat(&self.cells, nodes);
        let judged = cuts.into_iter().step_by(step).take(LOOKS).filter_map(|cut| {
            let faces = outline.in_two(cut)?;
            Some((layout.misshape(nodes, &faces, &flat), faces))
        });
        judged.min_by(|a, b| a.0.total_cmp(&b.0)).map(|best| best.1)
    }

    /// The neighbour that makes the cavity roundest and keeps it a disk: at a node that no filling can
    /// have on its rim first, then the one with most common edges.
    fn next_cell(&self, layout: &Layout<'_>) -> Option<u32> {
        /// Neighbours tried.
        const CHOICES: usize = 8;
        let mut scores: BTreeMap<u32, i32> = self.beside.iter().map(|(&c, &common)| (c, 10 * common)).collect();
        for seen in self.nodes.values() {
            let Some(turn) = seen.turn(false) else { continue };
            for cell in &seen.cells {
                if let Some(score) = scores.get_mut(cell) {
                    *score += if (1..=2).contains(&turn) { 1 } else { 25 };
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
