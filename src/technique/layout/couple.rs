//! The post-processing of the method: two triangles become a quad, and a triangle that touches the rim with one corner
//! is opened there.

use super::Layout;
use super::proposal::Proposal;
use crate::mesh::VertexId;
use crate::technique::fill::Pattern;

/// Quads of less quality are not made of two triangles.
const LEAST: f64 = 0.2;

impl Layout<'_> {
    /// Couples triangles with a common edge, the best quads first; how many pairs.
    pub fn couple_triangles(&mut self) -> usize {
        let mut pairs: Vec<(f64, u32, u32)> = Vec::new();
        for cell in self.cells().filter(|&c| self.ring(c).len() == 3) {
            for k in 0..3 {
                let Some(other) = self.neighbour(cell, k).filter(|&o| o > cell && self.ring(o).len() == 3) else {
                    continue;
                };
                let Some(rim) = self.rim(&[cell, other]).filter(|rim| rim.len() == 4) else { continue };
                let normal = (self.area(cell) + self.area(other)).normalize_or_zero();
                pairs.push((self.quality(&rim, normal), cell, other));
            }
        }
        pairs.sort_by(|a, b| b.0.total_cmp(&a.0).then((a.1, a.2).cmp(&(b.1, b.2))));
        let mut coupled = 0;
        for (_, a, b) in pairs.into_iter().filter(|p| p.0 > LEAST) {
            if self.exists(a) && self.exists(b) && self.merge_pair(a, b) {
                coupled += 1;
            }
        }
        coupled
    }

    /// Makes one polygon of two cells.
    pub(super) fn merge_pair(&mut self, a: u32, b: u32) -> bool {
        let Some(rim) = self.rim(&[a, b]) else { return false };
        let proposal = Proposal { cells: vec![a, b], faces: vec![rim] };
        self.carry_out(&proposal, f64::NEG_INFINITY).is_some()
    }

    /// Opens triangles that touch the rim of the surface with one corner, which becomes two; how many.
    pub fn open_triangles(&mut self) -> usize {
        let triangles: Vec<u32> = self.cells().filter(|&c| self.ring(c).len() == 3).collect();
        triangles.into_iter().filter(|&c| self.exists(c) && self.open_triangle(c).is_some()).count()
    }

    fn open_triangle(&mut self, cell: u32) -> Option<()> {
        let on_rim: Vec<VertexId> = self.nodes(cell).into_iter().filter(|&v| self.ground.on_rim[v]).collect();
        let [v] = on_rim[..] else { return None };
        let fan = self.fan(v)?;
        let at = fan.iter().position(|&c| c == cell)?;
        let rim = self.rim(&fan)?;
        let place = rim.iter().position(|&w| w == v)?;
        let (before, after) = (rim[(place + rim.len() - 1) % rim.len()], rim[(place + 1) % rim.len()]);
        // The first cell of the fan has the rim behind `v`, the last one the rim ahead of it.
        let [first, second] = self.third_points(&fan, before, v, after)?;
        let index = |w: VertexId| rim.iter().position(|&r| r == w);
        let n = rim.len();
        // On the rim the second new node takes the place of `v`, the first one comes before it.
        let mut new_rim = rim.clone();
        new_rim[place] = second;
        new_rim.insert(place, first);
        let shifted = |k: usize| if k >= place { k + 1 } else { k };
        let mut faces = Vec::new();
        for (i, &c) in fan.iter().enumerate() {
            let mut face = Vec::new();
            for w in self.nodes(c) {
                match (w == v, i.cmp(&at)) {
                    (false, _) => face.push(index(w).map(shifted)?),
                    (true, std::cmp::Ordering::Less) => face.push(place + 1),
                    (true, std::cmp::Ordering::Greater) => face.push(place),
                    (true, std::cmp::Ordering::Equal) => face.extend([place, place + 1]),
                }
            }
            faces.push(face);
        }
        debug_assert_eq!(new_rim.len(), n + 1);
        let pattern = Pattern { rim: n + 1, inner: Vec::new(), faces };
        self.fill(&fan, &new_rim, &pattern, LEAST).map(|_| ())
    }

    /// The cells at a smooth node on the rim of the surface, from the rim ahead of it counter-clockwise to that behind.
    fn fan(&self, v: VertexId) -> Option<Vec<u32>> {
        let cells = self.cells_at(v);
        if self.fixed[v] || !self.ground.on_rim[v] || cells.iter().any(|&c| self.domain(c) != self.domain(cells[0])) {
            return None;
        }
        let corner = |c: u32| self.ring(c).iter().position(|corner| corner.node == v);
        let mut at = cells.iter().copied().find(|&c| corner(c).is_some_and(|k| self.beyond(c, k).is_none()))?;
        let mut fan = vec![at];
        while fan.len() <= cells.len() {
            let k = corner(at)?;
            let back = (k + self.ring(at).len() - 1) % self.ring(at).len();
            match self.beyond(at, back) {
                None => return (fan.len() == cells.len()).then_some(fan),
                Some(next) => fan.push(next),
            }
            at = fan[fan.len() - 1];
        }
        None
    }

    /// Vertices a third and two thirds of the way along the rim from `before` over `v` to `after`.
    fn third_points(&self, fan: &[u32], before: VertexId, v: VertexId, after: VertexId) -> Option<[VertexId; 2]> {
        let path_to = |from: VertexId, to: VertexId| {
            fan.iter().find_map(|&c| {
                let ring = self.ring(c);
                let k = (0..ring.len()).find(|&k| ring[k].node == from && ring[(k + 1) % ring.len()].node == to)?;
                Some(self.path(c, k))
            })
        };
        let mut path = path_to(before, v)?;
        path.extend_from_slice(&path_to(v, after)?[1..]);
        let mut lengths = vec![0.0];
        for pair in path.windows(2) {
            lengths.push(lengths[lengths.len() - 1] + self.ground.point(pair[0]).distance(self.ground.point(pair[1])));
        }
        let total = lengths[lengths.len() - 1];
        let near = |share: f64| {
            let off = |k: &usize| (lengths[*k] - share * total).abs();
            (1..path.len() - 1).min_by(|a, b| off(a).total_cmp(&off(b)))
        };
        let (a, b) = (near(1.0 / 3.0)?, near(2.0 / 3.0)?);
        (a < b).then(|| [path[a], path[b]])
    }
}
