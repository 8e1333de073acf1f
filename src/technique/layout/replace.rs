//! Fills a cavity of a layout with another pattern.
//!
//! A chord of the pattern that runs through as few nodes as possible is laid as a path over the cavity's free vertices,
//! its inner nodes on the vertices nearest to where they should lie; it cuts cavity and pattern in two, and each half
//! is treated alike. In a disk any two points of the rim can be joined, so the only failure is a mesh too coarse.

use rustc_hash::FxHashSet;

use super::finder::{Terrain, along};
use super::ground::Side;
use super::part::Part;
use super::{Corner, Layout};
use crate::mesh::{FaceId, VertexId};
use crate::technique::fill::Pattern;
use glam::DVec3;

/// What a change removed, to bring it back.
#[derive(Clone, Debug, Default)]
pub struct Undo {
    labels: Vec<(FaceId, u32)>,
    cells: Vec<(u32, Vec<FaceId>, Vec<Corner>)>,
    nodes: Vec<(VertexId, bool)>,
    /// Faces taken from neighbours to make room.
    moved: Vec<(FaceId, u32)>,
    /// Cells from this number on were made by the change.
    first: u32,
    /// The new cells, in the order of the pattern's faces.
    pub made: Vec<u32>,
}

impl Layout<'_> {
    /// Fills the disk of `cells` with a pattern whose rim lies at `rim`, counter-clockwise; all other nodes of the
    /// cells vanish. Nodes of the rim that are new must lie on the rim of the surface. `None`, and nothing changed,
    /// when the mesh has no room for it.
    pub fn replace(&mut self, cells: &[u32], rim: &[VertexId], pattern: &Pattern) -> Option<Undo> {
        debug_assert_eq!(rim.len(), pattern.rim);
        let mut undo = self.clear(cells, rim);
        let whole = self.add_cell(undo.labels.iter().map(|&(f, _)| f).collect());
        let mut places: Vec<Option<VertexId>> = rim.iter().copied().map(Some).collect();
        places.resize(rim.len() + pattern.inner.len(), None);
        let mut made = vec![u32::MAX; pattern.faces.len()];
        let part = Part::new(&pattern.faces, (0..pattern.faces.len()).collect());
        let mut fill = Fill { pattern, places, made: &mut made, moved: Vec::new() };
        let filled = fill.part(self, whole, part);
        undo.moved = std::mem::take(&mut fill.moved);
        for &node in fill.places.iter().skip(rim.len()).flatten() {
            undo.nodes.push((node, self.node[node]));
            self.node[node] = true;
        }
        undo.made = made;
        let sound = filled.is_some() && self.close(&undo.made, pattern);
        if !sound {
            self.undo(undo);
            return None;
        }
        Some(undo)
    }

    /// Brings back what a change removed. Only the last change can be undone, then the one before.
    pub fn undo(&mut self, undo: Undo) {
        let touched = self.move_back(&undo.moved, undo.first);
        for cell in undo.first..self.faces.len() as u32 {
            self.clear_ring(cell);
        }
        self.faces.truncate(undo.first as usize);
        self.rings.truncate(undo.first as usize);
        for &(node, was) in undo.nodes.iter().rev() {
            self.node[node] = was;
        }
        for (face, cell) in undo.labels {
            self.cell[face] = cell;
        }
        for (cell, faces, ring) in undo.cells {
            self.faces[cell as usize] = faces;
            self.set_ring(cell, ring);
        }
        for cell in touched {
            self.retrace(cell);
        }
    }

    /// Moves faces back to where they came from, last first; the cells older than `first` that this changed, in rising
    /// order.
    fn move_back(&mut self, moved: &[(FaceId, u32)], first: u32) -> Vec<u32> {
        let mut touched = Vec::new();
        for &(face, home) in moved.iter().rev() {
            touched.extend([self.cell[face], home]);
            self.cell[face] = home;
        }
        touched.sort_unstable();
        touched.dedup();
        self.relist(moved.iter().rev().map(|m| m.0).collect(), &touched);
        touched.retain(|&c| c < first);
        touched
    }

    /// Takes cells and their nodes away.
    fn clear(&mut self, cells: &[u32], rim: &[VertexId]) -> Undo {
        let mut undo = Undo { first: self.faces.len() as u32, ..Undo::default() };
        for &cell in cells {
            let ring = self.rings[cell as usize].clone();
            self.clear_ring(cell);
            for corner in &ring {
                if self.node[corner.node] && !rim.contains(&corner.node) {
                    undo.nodes.push((corner.node, true));
                    self.node[corner.node] = false;
                }
            }
            let faces = std::mem::take(&mut self.faces[cell as usize]);
            undo.labels.extend(faces.iter().map(|&f| (f, cell)));
            undo.cells.push((cell, faces, ring));
        }
        for &node in rim.iter().filter(|&&node| !self.node[node]) {
            undo.nodes.push((node, false));
        }
        for &node in rim {
            self.node[node] = true;
        }
        undo
    }

    /// Traces the new cells; whether each has the corners that the pattern says.
    fn close(&mut self, made: &[u32], pattern: &Pattern) -> bool {
        for (&cell, face) in made.iter().zip(&pattern.faces) {
            let Some(ring) = self.trace(cell).filter(|ring| ring.len() == face.len()) else { return false };
            self.set_ring(cell, ring);
        }
        true
    }

    fn add_cell(&mut self, faces: Vec<FaceId>) -> u32 {
        let cell = self.faces.len() as u32;
        for &f in &faces {
            self.cell[f] = cell;
        }
        self.faces.push(faces);
        self.rings.push(Vec::new());
        cell
    }

    /// Whether a vertex lies strictly inside a cell.
    pub fn is_inside(&self, v: VertexId, cell: u32) -> bool {
        !self.node[v] && !self.ground.on_rim[v] && self.ground.faces_at.of(v).iter().all(|&f| self.cell[f] == cell)
    }

    /// Cuts a cell along a path from rim to rim; the cells on its left and right. `None` where the path has left the
    /// cell: room made for its last leg may have taken faces beside its first.
    fn split(&mut self, cell: u32, path: &[VertexId]) -> Option<(u32, u32)> {
        let is_inner = |w: &[VertexId]| {
            let sides = [self.ground.side_between(w[0], w[1]), self.ground.side_between(w[1], w[0])];
            sides.iter().all(|side| side.is_some_and(|side| self.cell[side.face] == cell))
        };
        if !path.windows(2).all(is_inner) {
            return None;
        }
        let walls: FxHashSet<[VertexId; 2]> = path.windows(2).flat_map(|w| [[w[0], w[1]], [w[1], w[0]]]).collect();
        let seed = self.ground.side_between(path[0], path[1])?.face;
        let all = std::mem::take(&mut self.faces[cell as usize]);
        let left = self.add_cell(vec![seed]);
        let mut next = 0;
        while let Some(&face) = self.faces[left as usize].get(next) {
            next += 1;
            for corner in 0..3 {
                let side = Side { face, corner };
                let Some(beyond) = self.ground.beyond(side).filter(|&f| self.cell[f] == cell) else { continue };
                if !walls.contains(&[self.ground.origin(side), self.ground.target(side)]) {
                    self.cell[beyond] = left;
                    self.faces[left as usize].push(beyond);
                }
            }
        }
        let rest: Vec<FaceId> = all.into_iter().filter(|&f| self.cell[f] == cell).collect();
        let is_cut = !rest.is_empty();
        let right = self.add_cell(rest);
        is_cut.then_some((left, right))
    }

    /// The vertex inside a cell, away from `taken`, that walking from the end of `taken` downhill leads to; `None`
    /// where the rim of the cell stands in the way.
    fn descend(&self, cell: u32, target: DVec3, taken: &[VertexId]) -> Option<VertexId> {
        let distance = |v: VertexId| self.ground.point(v).distance_squared(target);
        let mut at = *taken.last()?;
        let mut least = f64::INFINITY;
        loop {
            let (mut next, mut is_barred) = (None, false);
            for (v, _, _) in self.ground.leaving(at) {
                let d = distance(v);
                if d < least || (d == least && next.is_some_and(|n| v < n)) {
                    if self.is_inside(v, cell) && !taken.contains(&v) {
                        (least, next) = (d, Some(v));
                    } else {
                        is_barred = true;
                    }
                }
            }
            match next {
                Some(v) => at = v,
                None => return (!is_barred && !taken.contains(&at)).then_some(at),
            }
        }
    }

    /// A short path between two vertices through the inside of a cell, away from `taken`.
    fn join(&mut self, cell: u32, from: VertexId, to: VertexId, taken: &[VertexId]) -> Option<Vec<VertexId>> {
        let mut finder = std::mem::take(&mut self.finder);
        let free = |v: VertexId| self.is_inside(v, cell) && !taken.contains(&v);
        let open = |left: FaceId, right: FaceId| self.cell[left] == cell && self.cell[right] == cell;
        let cost = along(self.ground.point(from), self.ground.point(to));
        let terrain =
            Terrain { free: &free, open: &open, cost: &cost, limit: f64::INFINITY, goal: Some(self.ground.point(to)) };
        let path = finder.path(self.ground, &[from], |v| v == to, &terrain);
        self.finder = finder;
        path
    }
}

/// A pattern on its way into a cavity.
struct Fill<'p> {
    pattern: &'p Pattern,
    places: Vec<Option<VertexId>>,
    made: &'p mut Vec<u32>,
    moved: Vec<(FaceId, u32)>,
}

impl<'p> Fill<'p> {
    fn part(&mut self, layout: &mut Layout<'_>, cell: u32, part: Part<'p>) -> Option<()> {
        let mut open = vec![(cell, part)];
        while let Some((cell, part)) = open.pop() {
            if let [only] = part.members[..] {
                self.made[only] = cell;
                continue;
            }
            let chord = part.chord()?;
            let path = self.lay(layout, cell, &chord)?;
            let (left, right) = layout.split(cell, &path)?;
            let (left_faces, right_faces) = part.cut(&chord);
            open.push((left, Part::new(&self.pattern.faces, left_faces)));
            open.push((right, Part::new(&self.pattern.faces, right_faces)));
        }
        Some(())
    }

    /// The path of a chord.
    fn lay(&mut self, layout: &mut Layout<'_>, cell: u32, chord: &[usize]) -> Option<Vec<VertexId>> {
        let mut path = vec![self.places[chord[0]]?];
        for &n in &chord[1..] {
            let to = match self.places[n] {
                Some(place) => place,
                None => self.place(layout, cell, n, &path)?,
            };
            let from = *path.last()?;
            let leg = match layout.join(cell, from, to, &path) {
                Some(leg) => leg,
                None => self.join_with_room(layout, cell, [from, to], &path)?,
            };
            path.extend_from_slice(&leg[1..]);
        }
        Some(path)
    }

    /// Tries again after the borders beside both ends have moved.
    fn join_with_room(
        &mut self,
        layout: &mut Layout<'_>,
        cell: u32,
        ends: [VertexId; 2],
        path: &[VertexId],
    ) -> Option<Vec<VertexId>> {
        let moved = layout.make_room(cell, ends, path);
        self.moved.extend(moved);
        layout.join(cell, ends[0], ends[1], path)
    }

    /// The free vertex inside a cell that is nearest to where node `n` should lie.
    fn place(&mut self, layout: &Layout<'_>, cell: u32, n: usize, taken: &[VertexId]) -> Option<VertexId> {
        let target = self.pattern.inner[n - self.pattern.rim];
        if let Some(near) = layout.descend(cell, target, taken) {
            self.places[n] = Some(near);
            return Some(near);
        }
        let mut best: Option<(f64, VertexId)> = None;
        for v in layout.faces(cell).iter().flat_map(|&f| layout.ground.surface.faces[f]) {
            let distance = layout.ground.point(v).distance_squared(target);
            let nearer = best.is_none_or(|b| distance < b.0 || (distance == b.0 && v < b.1));
            if nearer && layout.is_inside(v, cell) && !taken.contains(&v) {
                best = Some((distance, v));
            }
        }
        self.places[n] = best.map(|b| b.1);
        self.places[n]
    }
}
