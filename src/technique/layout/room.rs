//! Makes room for a path where the mesh has none: the borders of a cell move off the vertices that the path needs.

use rustc_hash::{FxHashMap, FxHashSet};

use super::finder::{Terrain, along};
use super::{Corner, Layout, Side};
use crate::mesh::{FaceId, VertexId};

/// How many borders may move, one making room for the other.
const DEPTH: usize = 3;

/// Faces on their way from cell to cell. Labels and corners are right at every moment, the lists of faces once
/// [`Layout::settle`] is done: what one vertex needs costs no more than the faces round it.
#[derive(Debug, Default)]
struct Moves {
    /// The faces with their old cells.
    faces: Vec<(FaceId, u32)>,
    /// How many faces the cells touched have now.
    sizes: FxHashMap<u32, usize>,
    /// The cells touched, in order, over and over.
    cells: Vec<u32>,
}

impl Layout<'_> {
    /// Finds a path that may run over the border of its cell, and takes the faces round such vertices from the
    /// neighbours; those faces with their old cells. The neighbours keep their corners.
    pub(super) fn make_room(&mut self, cell: u32, [from, to]: [VertexId; 2], taken: &[VertexId]) -> Vec<(FaceId, u32)> {
        let mut finder = std::mem::take(&mut self.finder);
        let domain = self.faces[cell as usize].first().map_or(0, |&f| self.ground.domain[f]);
        let usable = |v: VertexId| {
            let mut faces = self.ground.faces_at.of(v).iter();
            let near = faces.clone().any(|&f| self.cell[f] == cell);
            let fits = near && faces.all(|&f| self.ground.domain[f] == domain);
            fits && !self.node[v] && !self.ground.on_rim[v] && !taken.contains(&v)
        };
        let open = |a: FaceId, b: FaceId| self.cell[a] == cell || self.cell[b] == cell;
        let (a, b) = (self.ground.point(from), self.ground.point(to));
        let cost = along(a, b);
        let limit = 20.0 * a.distance(b);
        let terrain = Terrain { free: &usable, open: &open, cost: &cost, limit, goal: Some(b) };
        let path = finder.path(self.ground, &[from], |v| v == to, &terrain).unwrap_or_default();
        self.finder = finder;
        let mut moves = Moves::default();
        for &x in path.iter().filter(|&&x| x != from && x != to) {
            if !self.is_inside(x, cell) {
                self.absorb(cell, x, DEPTH, &mut moves);
            }
        }
        self.settle(moves)
    }

    /// Takes the faces round `x`; where the neighbour is too narrow, that one takes from its own neighbour before.
    fn absorb(&mut self, cell: u32, x: VertexId, depth: usize, moves: &mut Moves) -> Option<()> {
        let faces = self.ground.faces_at.of(x);
        let own = faces.iter().find(|&&f| self.cell[f] == cell)?;
        let other = faces.iter().map(|&f| self.cell[f]).find(|&c| c != cell)?;
        let domain = self.ground.domain[*own];
        let fits = |&f: &FaceId| (self.cell[f] == cell || self.cell[f] == other) && self.ground.domain[f] == domain;
        if self.node[x] || self.ground.on_rim[x] || !faces.iter().all(fits) {
            return None;
        }
        let fan: Vec<FaceId> = faces.iter().copied().filter(|&f| self.cell[f] == other).collect();
        if *self.size(other, moves) <= fan.len() + 1 {
            return None;
        }
        let corners = || fan.iter().flat_map(|&f| self.ground.surface.faces[f]);
        // Vertices between the ends of the fan come once in two faces; the ends come once each.
        let is_end = |v: VertexId| corners().filter(|&w| w == v).count() == 1;
        for v in corners().filter(|&v| v != x && !is_end(v)).collect::<Vec<_>>() {
            if !self.is_inside(v, other) && (depth == 0 || self.absorb(other, v, depth - 1, moves).is_none()) {
                return None;
            }
        }
        // What was taken for the neighbour may have changed the fan.
        let unchanged = fan.iter().all(|&f| self.cell[f] == other)
            && faces.iter().all(|f| self.cell[*f] == cell || fan.contains(f));
        if !unchanged {
            return None;
        }
        self.hand_over(&fan, [other, cell], x);
        *self.size(other, moves) -= fan.len();
        *self.size(cell, moves) += fan.len();
        moves.cells.extend([other, cell]);
        moves.faces.extend(fan.into_iter().map(|f| (f, other)));
        Some(())
    }

    fn size<'m>(&self, cell: u32, moves: &'m mut Moves) -> &'m mut usize {
        moves.sizes.entry(cell).or_insert_with(|| self.faces[cell as usize].len())
    }

    /// Labels the faces of one cell round `x` as the other's. Both are disks, and what lies between the ends of the fan
    /// lies inside the first, so both stay disks, with their corners; the paths at the ends begin at other faces.
    fn hand_over(&mut self, fan: &[FaceId], [from, to]: [u32; 2], x: VertexId) {
        for side in fan.iter().flat_map(|&face| (0..3).map(move |corner| Side { face, corner })) {
            let Some(beyond) = self.ground.twin(side).filter(|twin| self.cell[twin.face] == to) else { continue };
            if self.ground.origin(side) == x {
                self.turn(to, beyond, Side { face: side.face, corner: (side.corner + 1) % 3 });
            } else if self.ground.target(side) == x
                && let Some(next) = self.ground.twin(Side { face: side.face, corner: (side.corner + 2) % 3 })
            {
                self.turn(from, side, next);
            }
        }
        for &f in fan {
            self.cell[f] = to;
        }
    }

    /// Where a path of a cell began at one side, it begins at the next.
    fn turn(&mut self, cell: u32, side: Side, next: Side) {
        for corner in self.rings[cell as usize].iter_mut().filter(|corner| corner.side == side) {
            corner.side = next;
        }
    }

    /// Carries moves out on the lists of faces, and turns the rings to where they begin; the faces with their old
    /// cells.
    fn settle(&mut self, moves: Moves) -> Vec<(FaceId, u32)> {
        let mut met = FxHashSet::default();
        let mut cells: Vec<u32> = moves.cells.iter().rev().copied().filter(|&c| met.insert(c)).collect();
        cells.reverse();
        self.relist(moves.faces.iter().map(|m| m.0).collect(), &cells);
        for cell in cells {
            let mut ring = self.rings[cell as usize].clone();
            self.turn_to_first(cell, &mut ring);
            debug_assert!(ring.is_empty() || self.trace(cell).as_ref() == Some(&ring));
            self.clear_ring(cell);
            self.set_ring(cell, ring);
        }
        moves.faces
    }

    /// Makes the lists of cells right after faces moved between them, in this order.
    pub(super) fn relist(&mut self, mut moved: Vec<FaceId>, cells: &[u32]) {
        let mut seen = FxHashSet::default();
        // A face that moved twice is where it came last.
        moved.reverse();
        moved.retain(|&f| seen.insert(f));
        for &cell in cells {
            self.faces[cell as usize].retain(|f| !seen.contains(f));
        }
        for &f in moved.iter().rev() {
            self.faces[self.cell[f] as usize].push(f);
        }
    }

    /// Walks round a cell again after its border moved.
    pub(super) fn retrace(&mut self, cell: u32) {
        if self.rings[cell as usize].is_empty() {
            return;
        }
        if let Some(ring) = self.follow(cell).or_else(|| self.trace(cell)) {
            self.clear_ring(cell);
            self.set_ring(cell, ring);
        }
    }

    /// What [`Layout::trace`] finds, in time that grows with the border: for a cell that was a disk and whose border
    /// moved past some vertices, which leaves it one. `None` where no path begins where it did.
    fn follow(&self, cell: u32) -> Option<Vec<Corner>> {
        let inside = |f: FaceId| self.cell[f] == cell;
        let is_border = |side: Side| inside(side.face) && !self.ground.beyond(side).is_some_and(inside);
        let start = self.rings[cell as usize].iter().map(|corner| corner.side).find(|&side| is_border(side))?;
        let (mut ring, mut at) = (Vec::new(), start);
        for step in 0.. {
            if step > 3 * self.faces[cell as usize].len() {
                return None;
            }
            let node = self.ground.origin(at);
            if self.node[node] {
                ring.push(Corner { node, side: at });
            }
            at = self.ground.next_on_border(at, inside);
            if at == start {
                break;
            }
        }
        self.turn_to_first(cell, &mut ring);
        debug_assert_eq!(self.trace(cell).as_ref(), Some(&ring));
        Some(ring)
    }

    /// Lets a ring begin as if all faces of the cell had been looked through.
    fn turn_to_first(&self, cell: u32, ring: &mut [Corner]) {
        let at_face = |&f: &FaceId| {
            let here = (0..ring.len()).filter(|&k| ring[k].side.face == f);
            here.min_by_key(|&k| ring[k].side.corner)
        };
        let first = self.faces[cell as usize].iter().find_map(at_face);
        ring.rotate_left(first.unwrap_or(0));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::id::{Face, Vertex};
    use crate::mesh::{IdVec, Surface};
    use crate::technique::layout::Ground;

    const N: u32 = 16;

    fn id(x: u32, y: u32) -> VertexId {
        VertexId::from_raw(y * (N + 1) + x)
    }

    /// A square of N by N cells of two triangles each.
    fn square() -> Surface {
        let places = (0..=N).flat_map(|y| (0..=N).map(move |x| (x, y)));
        let points = places.map(|(x, y)| glam::dvec3(f64::from(x), f64::from(y), 0.0)).collect();
        let cells = (0..N * N).map(|i| (i % N, i / N));
        let corners = cells.map(|(x, y)| [id(x, y), id(x + 1, y), id(x + 1, y + 1), id(x, y + 1)]);
        let faces = corners.flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
        Surface { points, faces, ..Surface::default() }
    }

    /// The square cut into upright strips of these widths, with nodes at their ends.
    fn strips<'g>(ground: &'g Ground<'g>, widths: &[u32]) -> Layout<'g> {
        let ends: Vec<u32> = widths
            .iter()
            .scan(0, |x, w| {
                *x += w;
                Some(*x)
            })
            .collect();
        let strip = |x: u32| ends.iter().position(|&end| x < end).unwrap() as u32;
        let cell: IdVec<Face, u32> = (0..2 * N * N).map(|f| strip(f / 2 % N)).collect();
        let mut node: IdVec<Vertex, bool> = IdVec::filled(false, ground.surface.points.len());
        for &x in ends.iter().chain([&0]) {
            (0..=N).step_by(4).for_each(|y| node[id(x, y)] = true);
        }
        let fixed = node.clone();
        let (layout, bad) = Layout::new(ground, cell, widths.len(), node, fixed);
        assert_eq!(bad, []);
        layout
    }

    fn sorted(ring: &[Corner]) -> Vec<(VertexId, FaceId, u8)> {
        let mut all: Vec<_> = ring.iter().map(|c| (c.node, c.side.face, c.side.corner)).collect();
        all.sort_unstable();
        all
    }

    #[test]
    fn rings_are_right_whether_or_not_there_was_room() {
        let surface = square();
        let ground = Ground::new(&surface);
        let (mut moved, mut refused) = (0, 0);
        for widths in [&[2, 1, 1, 1, 1, 10][..], &[3, 2, 1, 2, 8], &[5, 1, 1, 9], &[1; N as usize]] {
            let mut layout = strips(&ground, widths);
            let corners: Vec<usize> = layout.cells().map(|c| layout.ring(c).len()).collect();
            for k in 0..400_u32 {
                let v = id(1 + k * 7 % (N - 1), 1 + k * 11 % (N - 1));
                let cell = layout.cell_of(ground.faces_at.of(v)[k as usize % ground.faces_at.of(v).len()]);
                let mut moves = Moves::default();
                match layout.absorb(cell, v, DEPTH, &mut moves) {
                    Some(()) => moved += 1,
                    None => refused += usize::from(!moves.faces.is_empty()),
                }
                layout.settle(moves);
                for c in layout.cells() {
                    let ring = layout.trace(c).expect("a disk");
                    assert_eq!(sorted(&ring), sorted(layout.ring(c)), "{widths:?}, {k}: cell {c}");
                    assert_eq!(ring.len(), corners[c as usize]);
                }
            }
        }
        assert!(moved > 20 && refused > 5, "{moved} moved, {refused} refused on the way");
    }
}
