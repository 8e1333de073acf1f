//! Cuts polygons into quads and as few triangles as possible, by dynamic programming over their diagonals.

use glam::DVec3;

use super::Layout;
use crate::mesh::VertexId;
use crate::technique::fill::Pattern;

/// What a triangle costs beside the square of what its quality lacks.
const TRIANGLE: f64 = 2.0;
/// What a polygon of no or negative quality costs.
const FOLDED: f64 = 10.0;
/// What a diagonal costs that begins where there is no room for it.
const BLOCKED: f64 = 8.0;
/// What a diagonal costs that was tried in vain.
const REFUSED: f64 = 1e6;
/// Cells of more corners are not merged with others, for that would go on and on.
const WIDEST: usize = 8;
/// Polygons beyond are cut evenly first: the time grows with the fourth power.
const LARGEST: usize = 18;

/// How well a polygon over these nodes fits: 0 is best.
pub(super) fn misfit(layout: &Layout<'_>, nodes: &[VertexId], normal: DVec3) -> f64 {
    let quality = layout.quality(nodes, normal);
    let lack = 1.0 - quality;
    let triangle = if nodes.len() == 3 { TRIANGLE } else { 0.0 };
    lack * lack + triangle + if quality <= 0.05 { FOLDED * (1.0 - quality) } else { 0.0 }
}

/// The first diagonal of the best way to cut a cell into quads and triangles, as places in its ring.
fn diagonal(layout: &Layout<'_>, cell: u32, refused: &[[usize; 2]]) -> Option<[usize; 2]> {
    let nodes = layout.nodes(cell);
    let n = nodes.len();
    if n > LARGEST {
        let shifts = (0..n / 2).map(|shift| [shift, shift + n / 2]);
        return shifts.into_iter().find(|d| !refused.contains(d));
    }
    let blocked: Vec<bool> = nodes.iter().map(|&v| !layout.has_exit(cell, v)).collect();
    let normal = layout.area(cell).normalize_or_zero();
    let dear = |i: usize, j: usize| {
        let never = if refused.contains(&[i, j]) { REFUSED } else { 0.0 };
        never + if blocked[i] || blocked[j] { BLOCKED } else { 0.0 }
    };
    let table = Table::new(layout, &nodes, normal, dear);
    let [k, l] = table.at(0, n - 1).1;
    let sides = [[0, k], [k, l], [l, n - 1]];
    sides.into_iter().find(|[i, j]| *j != usize::MAX && *j > i + 1)
}

/// The best way to fill the corners `i..=j`, below the diagonal from `j` to `i`.
struct Table {
    n: usize,
    best: Vec<(f64, [usize; 2])>,
}

impl Table {
    fn new(layout: &Layout<'_>, nodes: &[VertexId], normal: DVec3, dear: impl Fn(usize, usize) -> f64) -> Self {
        let n = nodes.len();
        let mut table = Self { n, best: vec![(0.0, [usize::MAX; 2]); n * n] };
        for span in 2..n {
            for i in 0..n - span {
                let j = i + span;
                let mut best = (f64::INFINITY, [usize::MAX; 2]);
                for k in i + 1..j {
                    let sides = table.at(i, k).0 + table.at(k, j).0;
                    let cost = sides + misfit(layout, &[nodes[i], nodes[k], nodes[j]], normal);
                    if cost < best.0 {
                        best = (cost, [k, k]);
                    }
                    for l in k + 1..j {
                        let sides = table.at(i, k).0 + table.at(k, l).0 + table.at(l, j).0;
                        if sides >= best.0 {
                            continue;
                        }
                        let cost = sides + misfit(layout, &[nodes[i], nodes[k], nodes[l], nodes[j]], normal);
                        if cost < best.0 {
                            best = (cost, [k, l]);
                        }
                    }
                }
                if span < n - 1 {
                    best.0 += dear(i, j);
                }
                table.best[i * n + j] = best;
            }
        }
        table
    }

    fn at(&self, i: usize, j: usize) -> (f64, [usize; 2]) {
        self.best[i * self.n + j]
    }
}

impl Layout<'_> {
    /// Cuts cells of five corners and more, and merges those of two into a neighbour; the cells that could not.
    ///
    /// Where the mesh has no room for a cut, the cell is cut together with a neighbour.
    pub fn make_polygons(&mut self) -> Vec<u32> {
        let mut open: Vec<u32> = self.cells().collect();
        let mut stuck = Vec::new();
        let mut merges = 8 + open.len() / 4;
        while let Some(cell) = open.pop() {
            if !self.exists(cell) || self.ring(cell).len() < 2 || (3..=4).contains(&self.ring(cell).len()) {
                continue;
            }
            let mut made = if self.ring(cell).len() == 2 { self.merge_digon(cell) } else { self.cut_polygon(cell) };
            if made.is_none() && merges > 0 && self.ring(cell).len() <= WIDEST {
                merges -= 1;
                made = self.merge_small(cell);
            }
            match made {
                Some(cells) => open.extend(cells),
                None => stuck.push(cell),
            }
        }
        stuck.retain(|&cell| self.exists(cell) && !(3..=4).contains(&self.ring(cell).len()));
        stuck
    }

    /// Joins a cell with the neighbour of fewest corners with which it forms a disk.
    fn merge_small(&mut self, cell: u32) -> Option<Vec<u32>> {
        let mut others: Vec<(usize, u32)> = (0..self.ring(cell).len())
            .filter_map(|k| self.neighbour(cell, k).filter(|&other| other != cell))
            .map(|other| (self.ring(other).len(), other))
            .collect();
        others.sort_unstable();
        others.dedup();
        others.into_iter().find_map(|(_, other)| {
            let rim = self.rim(&[cell, other])?;
            self.replace(&[cell, other], &rim, &Pattern::polygon(rim.len())).map(|undo| undo.made)
        })
    }

    /// Whether an edge leads from a node into a cell.
    pub fn has_exit(&self, cell: u32, v: VertexId) -> bool {
        self.ground.leaving(v).any(|(_, left, right)| self.cell[left] == cell && self.cell[right] == cell)
    }

    fn cut_polygon(&mut self, cell: u32) -> Option<Vec<u32>> {
        /// Diagonals tried before giving up.
        const TRIES: usize = 16;
        let rim = self.nodes(cell);
        let n = rim.len();
        let mut refused = Vec::new();
        for _ in 0..TRIES {
            let [i, j] = diagonal(self, cell, &refused).filter(|d| !refused.contains(d))?;
            let faces = vec![(i..=j).collect(), (j..=i + n).map(|k| k % n).collect()];
            let pattern = Pattern { rim: n, inner: Vec::new(), faces };
            if let Some(undo) = self.replace(&[cell], &rim, &pattern) {
                return Some(undo.made);
            }
            refused.push([i, j]);
        }
        None
    }

    /// Two paths between the same nodes are one: the cell between them joins a neighbour.
    fn merge_digon(&mut self, cell: u32) -> Option<Vec<u32>> {
        for k in 0..2 {
            let Some(other) = self.neighbour(cell, k).filter(|&other| other != cell) else { continue };
            let rim = self.nodes(other);
            if let Some(undo) = self.replace(&[other, cell], &rim, &Pattern::polygon(rim.len())) {
                return Some(undo.made);
            }
        }
        self.open_digon(cell)
    }

    /// A domain of one cell with two corners gets a node on its border, which those beyond get too.
    fn open_digon(&mut self, cell: u32) -> Option<Vec<u32>> {
        let longest =
            (0..2).filter(|&k| self.neighbour(cell, k).is_none()).max_by_key(|&k| self.path(cell, k).len())?;
        let path = self.path(cell, longest);
        let middle = *path.get(path.len() / 2).filter(|_| path.len() > 2)?;
        let other = self.beyond(cell, longest);
        self.make_node(middle, [Some(cell), other]);
        Some(other.into_iter().chain([cell]).collect())
    }
}
