//! A proposal to fill some cells anew, said by nodes; its cost before and after, and its execution.

use std::collections::BTreeMap;

use glam::DVec3;

use super::Layout;
use super::pattern::Pattern;
use super::replace::Undo;
use crate::mesh::VertexId;

/// What a triangle costs; an inner node with one patch too many costs 1.
const TRIANGLE: f64 = 6.0;
/// What a node on a smooth border costs more than an inner one, because regular borders matter most.
const BORDER: f64 = 1.5;

/// A node of a proposal that is not there yet.
pub(super) fn new_node(number: usize) -> VertexId {
    VertexId::from_raw(u32::MAX - 1 - number as u32)
}

fn is_new(v: VertexId) -> bool {
    v.raw() > u32::MAX / 2
}

/// Cells to take away, and polygons over old and new nodes to put there.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Proposal {
    /// The cells; together a disk.
    pub cells: Vec<u32>,
    /// The polygons, counter-clockwise.
    pub faces: Vec<Vec<VertexId>>,
}

impl Layout<'_> {
    /// How many patches of its domain a node should have: 4 inside, 2 on a smooth border, at a corner one for each
    /// right angle.
    pub fn wanted(&self, node: VertexId, domain: u32) -> usize {
        if !self.is_on_border(node) {
            return 4;
        }
        if !self.fixed[node] {
            return 2;
        }
        let faces = self.ground.faces_at.of(node).iter().filter(|&&f| self.ground.domain[f] == domain);
        let angle = |&f: &crate::mesh::FaceId| {
            let corner = self.ground.corner_of(f, node).unwrap_or(0);
            crate::mesh::geometry::triangle_angles(self.ground.surface.corners(f))[usize::from(corner)]
        };
        let total: f64 = faces.map(angle).sum();
        ((total / std::f64::consts::FRAC_PI_2).round() as usize).max(1)
    }

    /// How many cells of a domain a node has.
    pub fn patches(&self, node: VertexId, domain: u32) -> usize {
        self.cells_at(node).iter().filter(|&&c| self.domain(c) == domain).count()
    }

    /// What a node with so many patches costs.
    fn strain(&self, node: VertexId, domain: u32, patches: usize) -> f64 {
        let off = patches.abs_diff(self.wanted(node, domain)) as f64;
        let weight = if self.is_on_border(node) { BORDER } else { 1.0 };
        // An inner node of two patches is no corner of either.
        let folded = if patches == 2 && !self.is_on_border(node) { 4.0 } else { 0.0 };
        weight * off * off + folded
    }

    /// The rim of some cells as nodes, counter-clockwise; `None` unless they form a disk.
    pub fn rim(&self, cells: &[u32]) -> Option<Vec<VertexId>> {
        let mut next = BTreeMap::new();
        for &cell in cells {
            let ring = self.ring(cell);
            for k in 0..ring.len() {
                if self.beyond(cell, k).is_none_or(|other| !cells.contains(&other))
                    && next.insert(ring[k].node, ring[(k + 1) % ring.len()].node).is_some()
                {
                    return None;
                }
            }
        }
        let start = *next.keys().next()?;
        let (mut rim, mut at) = (vec![start], *next.get(&start)?);
        while at != start && rim.len() <= next.len() {
            rim.push(at);
            at = *next.get(&at)?;
        }
        // One loop round cells that hang together, with one more node than edges less cells, is a disk.
        let mut nodes: Vec<VertexId> = cells.iter().flat_map(|&c| self.nodes(c)).collect();
        let sides = nodes.len();
        nodes.sort_unstable();
        nodes.dedup();
        let edges = usize::midpoint(sides, rim.len());
        (rim.len() == next.len() && nodes.len() + cells.len() == edges + 1).then_some(rim)
    }

    /// The change of cost that a proposal brings.
    pub fn gain(&self, proposal: &Proposal) -> f64 {
        let Some(&first) = proposal.cells.first() else { return 0.0 };
        let domain = self.domain(first);
        let mut counts: BTreeMap<VertexId, (usize, usize)> = BTreeMap::new();
        for node in proposal.cells.iter().flat_map(|&c| self.nodes(c)) {
            counts.entry(node).or_default().0 += 1;
        }
        for &node in proposal.faces.iter().flatten() {
            counts.entry(node).or_default().1 += 1;
        }
        let triangles = |count: usize| TRIANGLE * count as f64;
        let mut change = triangles(proposal.faces.iter().filter(|f| f.len() == 3).count())
            - triangles(proposal.cells.iter().filter(|&&c| self.ring(c).len() == 3).count());
        for (node, (before, after)) in counts {
            if is_new(node) {
                let off = after.abs_diff(4) as f64;
                change += off * off + if after == 2 { 4.0 } else { 0.0 };
                continue;
            }
            let patches = self.patches(node, domain);
            change -= self.strain(node, domain, patches);
            if after > 0 {
                change += self.strain(node, domain, patches + after - before);
            }
        }
        change
    }

    /// Carries a proposal out; `None`, and nothing changed, where it is no disk or there is no room, or where a new cell
    /// would be worse than `least` and worse than the old ones.
    pub fn carry_out(&mut self, proposal: &Proposal, least: f64) -> Option<Undo> {
        let rim = self.rim(&proposal.cells)?;
        let mut index: BTreeMap<VertexId, usize> = rim.iter().enumerate().map(|(k, &v)| (v, k)).collect();
        let mut faces = Vec::with_capacity(proposal.faces.len());
        for face in &proposal.faces {
            let mut corners = Vec::with_capacity(face.len());
            for &node in face {
                let next = index.len();
                corners.push(*index.entry(node).or_insert(next));
            }
            faces.push(corners);
        }
        let inner = vec![DVec3::ZERO; index.len() - rim.len()];
        let mut pattern = Pattern { rim: rim.len(), inner, faces };
        let points: Vec<DVec3> = rim.iter().map(|&v| self.ground.point(v)).collect();
        pattern.relax(&points);
        self.fill(&proposal.cells, &rim, &pattern, least)
    }

    /// Replaces, and takes it back where a new cell is worse than `least` and worse than all old ones.
    pub(super) fn fill(&mut self, cells: &[u32], rim: &[VertexId], pattern: &Pattern, least: f64) -> Option<Undo> {
        let before = cells.iter().map(|&c| self.quality_of(c)).fold(f64::INFINITY, f64::min);
        let undo = self.replace(cells, rim, pattern)?;
        let after = undo.made.iter().map(|&c| self.quality_of(c)).fold(f64::INFINITY, f64::min);
        if after < least.min(before) {
            self.undo(undo);
            return None;
        }
        Some(undo)
    }
}
