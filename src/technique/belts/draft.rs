//! The belts while they are cut into elements: nodes so far, and the paths laid as walls.

use rustc_hash::{FxHashMap, FxHashSet};

use super::even::settle;
use super::sample::{Rope, fill_gaps, forced};
use super::strips::{Belts, border_loops};
use super::{BeltRules, Order};
use crate::mesh::carried::{EdgeKey, edge_key};
use crate::mesh::id::Vertex;
use crate::mesh::{FaceId, IdVec, VertexId};
use crate::technique::layout::{Finder, Ground, Side};
use crate::watch::{Cancelled, Watch};

/// Nodes and walls on the way to a complex.
pub(super) struct Draft<'g> {
    pub(super) ground: &'g Ground<'g>,
    pub(super) belts: Belts,
    pub(super) interval: f64,
    /// Connectors start where the angle is at least this, in radians.
    pub(super) min_angle: f64,
    /// See [`BeltRules::snap`].
    pub(super) snap: f64,
    pub(super) node: IdVec<Vertex, bool>,
    pub(super) fixed: IdVec<Vertex, bool>,
    /// Edges between domains that have all their nodes.
    settled: FxHashSet<EdgeKey>,
    /// Edges laid, with the inner end of their path.
    pub(super) walls: FxHashMap<EdgeKey, VertexId>,
    /// Vertices on walls.
    taken: IdVec<Vertex, bool>,
    pub(super) done: Vec<bool>,
    pub(super) finder: Finder,
    /// Connectors laid.
    pub(super) connectors: usize,
}

/// Gives small holes their nodes before connectors come to them, which would leave them too few and an odd number.
fn sample_small(ground: &Ground<'_>, node: &mut IdVec<Vertex, bool>, interval: f64) {
    /// Loops shorter than this many intervals.
    const SMALL: f64 = 5.0;
    for sides in border_loops(ground, &ground.domain) {
        let rope = Rope::new(ground, &sides);
        let is_hole = sides.iter().all(|&side| ground.beyond(side).is_none());
        if is_hole && rope.length < SMALL * interval {
            fill_gaps(&rope, node, interval, |_| true);
        }
    }
}

impl<'g> Draft<'g> {
    pub(super) fn new(ground: &'g Ground<'g>, belts: Belts, rules: &BeltRules) -> Self {
        let (mut node, fixed) = forced(ground, &belts, rules.interval);
        let settled = settle(ground, &mut node, rules.interval);
        sample_small(ground, &mut node, rules.interval);
        Self {
            ground,
            interval: rules.interval,
            min_angle: rules.min_angle.to_radians(),
            snap: rules.snap,
            node,
            fixed,
            settled,
            walls: FxHashMap::default(),
            taken: IdVec::filled(false, ground.surface.points.len()),
            done: vec![false; belts.count],
            finder: Finder::new(ground.surface.points.len()),
            connectors: 0,
            belts,
        }
    }

    /// Cuts all belts, from the border inwards, of equal ones the longest first; from outside those wait whose outer
    /// loop is not cut yet.
    pub(super) fn run(&mut self, rule: Order, watch: &Watch) -> Result<(), Cancelled> {
        let mut loops: Vec<Vec<Vec<Side>>> = vec![Vec::new(); self.belts.count];
        for sides in border_loops(self.ground, &self.belts.of) {
            loops[self.belts.of[sides[0].face] as usize].push(sides);
        }
        let mut order: Vec<(u64, u64, usize)> = Vec::new();
        for (belt, loops) in loops.iter().enumerate() {
            let depth = |s: &Side| self.belts.depth[self.ground.origin(*s)];
            let least = loops.iter().flatten().map(depth).fold(f64::INFINITY, f64::min);
            let longest = loops.iter().map(|l| Rope::new(self.ground, l).length).fold(0.0, f64::max);
            order.push((least.to_bits(), !longest.to_bits(), belt));
        }
        order.sort_unstable();
        watch.phase("belts", Some(order.len() as u64));
        let waits_for: Vec<Vec<u32>> = match rule {
            Order::FromBorders => vec![Vec::new(); loops.len()],
            Order::FromOutside => loops.iter().map(|own| self.beyond_outer(own)).collect(),
        };
        for count in 0..order.len() {
            watch.check()?;
            watch.advance(count as u64, || format!("{} connectors", self.connectors));
            let is_ready =
                |entry: &(u64, u64, usize)| waits_for[entry.2].iter().all(|&other| self.done[other as usize]);
            let (_, _, belt) = order.remove(order.iter().position(is_ready).unwrap_or(0));
            self.cut_belt(belt as u32, std::mem::take(&mut loops[belt]));
            self.done[belt] = true;
        }
        Ok(())
    }

    /// The belts of the same domain beyond the longest of these loops.
    fn beyond_outer(&self, loops: &[Vec<Side>]) -> Vec<u32> {
        let length = |sides: &&Vec<Side>| Rope::new(self.ground, sides).length;
        // Of equal ones the first, as when the belt is cut.
        let outer = loops.iter().rev().max_by(|a, b| length(a).total_cmp(&length(b)));
        let beyond = |side: &Side| {
            let face = self.ground.beyond(*side)?;
            (self.ground.domain[face] == self.ground.domain[side.face]).then(|| self.belts.of[face])
        };
        let mut all: Vec<u32> = outer.into_iter().flatten().filter_map(beyond).collect();
        all.sort_unstable();
        all.dedup();
        all
    }

    fn cut_belt(&mut self, belt: u32, mut loops: Vec<Vec<Side>>) {
        // A closed surface in one piece has no border to begin at.
        if loops.is_empty() {
            return;
        }
        let lengths: Vec<f64> = loops.iter().map(|l| Rope::new(self.ground, l).length).collect();
        let longest = (0..loops.len()).max_by(|&a, &b| lengths[a].total_cmp(&lengths[b]).then(b.cmp(&a))).unwrap_or(0);
        let sides = loops.remove(longest);
        let outer = Rope::new(self.ground, &sides);
        self.sample(&sides, &outer);
        let holes: Vec<Vec<VertexId>> =
            loops.iter().map(|l| l.iter().map(|&s| self.ground.origin(s)).collect()).collect();
        let mut inner: Vec<VertexId> = holes.concat();
        match holes.len() {
            0 if outer.vertices.iter().filter(|&&v| self.node[v]).count() <= 6 => return,
            0 => inner = self.spine(belt, &outer.vertices),
            1 => {}
            _ => inner.extend(self.join_holes(belt, &outer.vertices, &holes)),
        }
        let is_fan = holes.is_empty() && inner.len() == 1;
        self.connect(belt, &outer, inner, is_fan);
    }

    /// Fills the gaps of a loop; not much where the belt beyond is cut already.
    fn sample(&mut self, sides: &[Side], rope: &Rope) {
        let (ground, belts, done) = (self.ground, &self.belts, &self.done);
        let is_settled = |s: Side| self.settled.contains(&edge_key(ground.origin(s), ground.target(s)));
        let is_cut = |s: Side| ground.beyond(s).is_some_and(|f| done[belts.of[f] as usize]);
        let may_fill = |k: usize| !is_cut(sides[k]) && !is_settled(sides[k]);
        fill_gaps(rope, &mut self.node, self.interval, may_fill);
    }

    /// Whether a vertex lies inside a belt, away from walls.
    pub(super) fn is_free(&self, v: VertexId, belt: u32) -> bool {
        let inside = || self.ground.faces_at.of(v).iter().all(|&f| self.belts.of[f] == belt);
        !self.taken[v] && !self.node[v] && !self.ground.on_rim[v] && inside()
    }

    /// Whether a path may cross from one face to the other.
    pub(super) fn is_open(&self, a: FaceId, b: FaceId, belt: u32) -> bool {
        self.belts.of[a] == belt && self.belts.of[b] == belt
    }

    pub(super) fn is_taken(&self, v: VertexId) -> bool {
        self.taken[v]
    }

    /// Lays a path.
    pub(super) fn add_wall(&mut self, path: &[VertexId]) {
        let Some(&end) = path.last() else { return };
        for pair in path.windows(2) {
            self.walls.insert(edge_key(pair[0], pair[1]), end);
        }
        for &v in path {
            self.taken[v] = true;
        }
    }
}
