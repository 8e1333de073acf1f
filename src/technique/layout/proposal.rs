//! A proposal to fill some cells anew, said by nodes; its cost before and after, and its execution.

use std::collections::BTreeMap;
use std::f64::consts::FRAC_PI_2;

use glam::DVec3;
use rustc_hash::FxHashMap;

use super::ground::Ground;
use super::replace::Undo;
use super::{Layout, quality};
use crate::mesh::id::Vertex;
use crate::mesh::{IdVec, VertexId};
use crate::technique::fill::{Flat, Pattern, is_new};

/// What a triangle costs; an inner node with one patch too many costs 1.
pub(super) const TRIANGLE: f64 = 6.0;
/// What a node on a smooth border costs more than an inner one, because regular borders matter most.
const BORDER: f64 = 1.5;

/// New cells that hold so many times the area between their corners would stand for a limb as if it were not there:
/// regular, and no use.
const LIMB: f64 = 8.0;

/// A border that turns by more between straight edges, in right angles, has a corner there.
const COARSE: f64 = 2.0 / 3.0;

/// Cells to take away, and polygons over old and new nodes to put there.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash)]
pub struct Proposal {
    /// The cells; together a disk.
    pub cells: Vec<u32>,
    /// The polygons, counter-clockwise.
    pub faces: Vec<Vec<VertexId>>,
}

/// The angle of each domain at these nodes, in right angles.
pub(super) fn corners(ground: &Ground<'_>, fixed: &IdVec<Vertex, bool>) -> FxHashMap<(VertexId, u32), f64> {
    let mut angles: FxHashMap<(VertexId, u32), f64> = FxHashMap::default();
    for v in fixed.ids().filter(|&v| fixed[v]) {
        for &f in ground.faces_at.of(v) {
            let corner = ground.corner_of(f, v).unwrap_or(0);
            let angle = crate::mesh::geometry::triangle_angles(ground.surface.corners(f))[usize::from(corner)];
            *angles.entry((v, ground.domain[f])).or_default() += angle;
        }
    }
    angles.into_iter().map(|(at, total)| (at, total / FRAC_PI_2)).collect()
}

impl Layout<'_> {
    /// How many patches of its domain a node should have: 4 inside, 2 on a smooth border, at a corner one for each
    /// right angle. On a border that is coarse beside its curve, as round a small hole, either number will do.
    pub fn wanted(&self, node: VertexId, domain: u32) -> usize {
        if !self.is_on_border(node) {
            return 4;
        }
        if self.fixed[node] {
            return (self.right_angles(node, domain).round() as usize).max(1);
        }
        if self.patches(node, domain) <= 2 {
            return 2;
        }
        let coarse = self.coarse_angles(node, domain);
        if (coarse - 2.0).abs() <= COARSE { 2 } else { coarse.round().max(2.0) as usize }
    }

    /// At a corner whose angle lies between two numbers of right ones, the one that it is farther from.
    pub(super) fn second_choice(&self, node: VertexId, domain: u32) -> Option<usize> {
        /// How near to the middle between both.
        const BETWEEN: f64 = 0.2;
        let angle = self.corners.get(&(node, domain)).copied().filter(|_| self.fixed[node])?;
        let is_between = (angle - angle.floor() - 0.5).abs() < BETWEEN && angle > 1.0;
        let first = angle.round();
        is_between.then(|| if first > angle { first as usize - 1 } else { first as usize + 1 })
    }

    /// The angle of a domain at a fixed node, in right angles.
    fn right_angles(&self, node: VertexId, domain: u32) -> f64 {
        self.corners.get(&(node, domain)).copied().unwrap_or(1.0)
    }

    /// The angle of a domain at a node of its border between the straight edges there, in right angles.
    fn coarse_angles(&self, node: VertexId, domain: u32) -> f64 {
        let at = self.ground.point(node);
        let angle = |&cell: &u32| {
            let ring = self.ring(cell);
            let n = ring.len();
            let k = ring.iter().position(|corner| corner.node == node).unwrap_or(0);
            let [to, from] = [1, n - 1].map(|step| self.ground.point(ring[(k + step) % n].node) - at);
            crate::mesh::geometry::angle(to, from)
        };
        let here = self.cells_at(node).iter().filter(|&&c| self.domain(c) == domain);
        here.map(angle).sum::<f64>() / FRAC_PI_2
    }

    /// How many cells of a domain a node has.
    pub fn patches(&self, node: VertexId, domain: u32) -> usize {
        self.cells_at(node).iter().filter(|&&c| self.domain(c) == domain).count()
    }

    /// What a node with so many patches costs.
    pub(super) fn strain(&self, node: VertexId, domain: u32, patches: usize) -> f64 {
        let off = self.off(node, domain, patches);
        let weight = if self.is_on_border(node) { BORDER } else { 1.0 };
        // An inner node of two patches is no corner of either.
        let folded = if patches == 2 && !self.is_on_border(node) { 4.0 } else { 0.0 };
        weight * off * off + folded
    }

    /// How far so many patches are from what fits a node. An angle between two numbers of right ones takes either.
    pub(super) fn off(&self, node: VertexId, domain: u32, patches: usize) -> f64 {
        if !self.is_on_border(node) {
            return patches.abs_diff(4) as f64;
        }
        if self.fixed[node] {
            let off = (patches as f64 - self.right_angles(node, domain)).abs();
            return (2.0 * off - 1.0).max(0.0);
        }
        let smooth = patches.abs_diff(2) as f64;
        if patches <= 2 {
            return smooth;
        }
        let coarse = self.coarse_angles(node, domain);
        if (coarse - 2.0).abs() <= COARSE {
            smooth
        } else {
            (patches as f64 - coarse.round().max(2.0)).abs().min(smooth)
        }
    }

    /// The rim of some cells as nodes, counter-clockwise; `None` unless they form a disk.
    pub fn rim(&self, cells: &[u32]) -> Option<Vec<VertexId>> {
        let mut next = BTreeMap::new();
        let mut sorted = cells.to_vec();
        sorted.sort_unstable();
        for &cell in cells {
            let ring = self.ring(cell);
            for k in 0..ring.len() {
                if self.beyond(cell, k).is_none_or(|other| sorted.binary_search(&other).is_err())
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

    /// Carries a proposal out; `None`, and nothing changed, where it is no disk or there is no room, or where a new
    /// cell would be worse than `least` and worse than the old ones.
    pub fn carry_out(&mut self, proposal: &Proposal, least: f64) -> Option<Undo> {
        /// Fewer cells are nearly flat; what is relaxed keeps its connectivity and must not stay where it is.
        const BENT: usize = 8;
        let rim = self.rim(&proposal.cells)?;
        let flat = (proposal.cells.len() > BENT).then(|| self.lay_flat(&proposal.cells, &rim));
        let pattern = self.pattern(&rim, &proposal.faces, flat.as_ref());
        self.fill(&proposal.cells, &rim, &pattern, least)
    }

    /// Polygons over the nodes of a rim and others, with places for these.
    pub(super) fn pattern(&self, rim: &[VertexId], polygons: &[Vec<VertexId>], flat: Option<&Flat>) -> Pattern {
        let mut pattern = Pattern::over(rim, polygons);
        match flat {
            Some(flat) => flat.place(&mut pattern),
            None => pattern.relax(&rim.iter().map(|&v| self.ground.point(v)).collect::<Vec<_>>()),
        }
        pattern
    }

    /// How badly shaped the polygons over a rim are likely to be, 0 for squares: the mean and the worst of the squares
    /// of what their qualities lack.
    pub(super) fn misshape(&self, rim: &[VertexId], polygons: &[Vec<VertexId>], flat: &Flat) -> f64 {
        let pattern = self.pattern(rim, polygons, Some(flat));
        let point = |&n: &usize| if n < rim.len() { self.ground.point(rim[n]) } else { pattern.inner[n - rim.len()] };
        let (mut sum, mut worst) = (0.0, 0.0_f64);
        for face in &pattern.faces {
            let corners: Vec<DVec3> = face.iter().map(point).collect();
            let n = corners.len();
            let normal =
                (1..n - 1).map(|k| (corners[k] - corners[0]).cross(corners[k + 1] - corners[0])).sum::<DVec3>();
            let lack = 1.0 - quality(&corners, normal.normalize_or_zero());
            sum += lack * lack;
            worst = worst.max(lack * lack);
        }
        sum / pattern.faces.len().max(1) as f64 + worst
    }

    /// Replaces, and takes it back where a new cell is worse than `least` and worse than all old ones, or holds a limb.
    pub(super) fn fill(&mut self, cells: &[u32], rim: &[VertexId], pattern: &Pattern, least: f64) -> Option<Undo> {
        let before = cells.iter().map(|&c| self.quality_of(c)).fold(f64::INFINITY, f64::min);
        let bulge = cells.iter().map(|&c| self.bulge(c)).fold(LIMB, f64::max);
        let held = cells.iter().map(|&c| self.held(c)).fold(self.largest, f64::max);
        let undo = self.replace(cells, rim, pattern)?;
        let after = undo.made.iter().map(|&c| self.quality_of(c)).fold(f64::INFINITY, f64::min);
        let is_limb = undo.made.iter().any(|&c| self.bulge(c) > bulge || self.held(c) > held);
        if after < least.min(before) || is_limb {
            self.undo(undo);
            return None;
        }
        Some(undo)
    }
}
