//! Makes room for a path where the mesh has none: the borders of a cell move off the vertices that the path needs.

use super::finder::{Terrain, along};
use super::{Corner, Layout, Side};
use crate::mesh::{FaceId, VertexId};

/// How many borders may move, one making room for the other.
const DEPTH: usize = 3;

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
        let mut moved = Vec::new();
        for &x in path.iter().filter(|&&x| x != from && x != to) {
            if !self.is_inside(x, cell) {
                self.absorb(cell, x, DEPTH, &mut moved);
            }
        }
        moved
    }

    /// Takes the faces round `x`; where the neighbour is too narrow, that one takes from its own neighbour before.
    fn absorb(&mut self, cell: u32, x: VertexId, depth: usize, moved: &mut Vec<(FaceId, u32)>) -> Option<()> {
        let faces = self.ground.faces_at.of(x);
        let own = faces.iter().find(|&&f| self.cell[f] == cell)?;
        let other = faces.iter().map(|&f| self.cell[f]).find(|&c| c != cell)?;
        let domain = self.ground.domain[*own];
        let fits = |&f: &FaceId| (self.cell[f] == cell || self.cell[f] == other) && self.ground.domain[f] == domain;
        if self.node[x] || self.ground.on_rim[x] || !faces.iter().all(fits) {
            return None;
        }
        let fan: Vec<FaceId> = faces.iter().copied().filter(|&f| self.cell[f] == other).collect();
        if self.faces[other as usize].len() <= fan.len() + 1 {
            return None;
        }
        let corners = || fan.iter().flat_map(|&f| self.ground.surface.faces[f]);
        // Vertices between the ends of the fan come once in two faces; the ends come once each.
        let is_end = |v: VertexId| corners().filter(|&w| w == v).count() == 1;
        for v in corners().filter(|&v| v != x && !is_end(v)).collect::<Vec<_>>() {
            if !self.is_inside(v, other) && (depth == 0 || self.absorb(other, v, depth - 1, moved).is_none()) {
                return None;
            }
        }
        // What was taken for the neighbour may have changed the fan.
        let unchanged = fan.iter().all(|&f| self.cell[f] == other)
            && faces.iter().all(|f| self.cell[*f] == cell || fan.contains(f));
        if !unchanged {
            return None;
        }
        self.faces[other as usize].retain(|f| !fan.contains(f));
        for &f in &fan {
            self.cell[f] = cell;
        }
        self.faces[cell as usize].extend(&fan);
        // Paths begin at other faces of both now. There is no ring yet where room is made.
        let holds = self.retrace(other) && self.retrace(cell);
        if !holds {
            for &f in &fan {
                self.cell[f] = other;
            }
            self.faces[cell as usize].retain(|f| !fan.contains(f));
            self.faces[other as usize].extend(&fan);
            self.retrace(other);
            self.retrace(cell);
            return None;
        }
        moved.extend(fan.into_iter().map(|f| (f, other)));
        Some(())
    }

    /// Walks round a cell again after its border moved; whether it is still a disk with the same number of corners.
    pub(super) fn retrace(&mut self, cell: u32) -> bool {
        let before = self.rings[cell as usize].len();
        if before == 0 {
            return true;
        }
        let ring = self.follow(cell).or_else(|| self.trace(cell));
        let holds = ring.as_ref().is_some_and(|ring| ring.len() == before);
        if let Some(ring) = ring {
            self.clear_ring(cell);
            self.set_ring(cell, ring);
        }
        holds
    }

    /// What [`Layout::trace`] finds, in time that grows with the border: for a cell that was a disk and whose border moved
    /// past some vertices, which leaves it one. `None` where no path begins where it did.
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
        // It begins as if all faces had been looked through.
        let at_face = |&f: &FaceId| {
            let here = (0..ring.len()).filter(|&k| ring[k].side.face == f);
            here.min_by_key(|&k| ring[k].side.corner)
        };
        let first = self.faces[cell as usize].iter().find_map(at_face)?;
        ring.rotate_left(first);
        debug_assert_eq!(self.trace(cell).as_ref(), Some(&ring));
        Some(ring)
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
                let mut taken = Vec::new();
                match layout.absorb(cell, v, DEPTH, &mut taken) {
                    Some(()) => moved += 1,
                    None => refused += usize::from(!taken.is_empty()),
                }
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
