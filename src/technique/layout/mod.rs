//! A coarse complex of polygons embedded in a triangle mesh.
//!
//! Nodes are vertices of the mesh, edges are paths over its edges, and cells are sets of its faces, each a disk that
//! the nodes on its border make a polygon. Nothing else is stored: borders, neighbours and paths follow from the cell
//! of each face and from which vertices are nodes. So the complex is conforming by construction, its cells cover every
//! face once, and paths cannot cross.
//!
//! The one change is [`Layout::replace`]: some cells that form a disk get another pattern. It either embeds the whole
//! pattern or changes nothing, and it can be undone. Cells never cross the border of a domain (see [`Ground`]).
//!
//! # Cost
//! A change is O(n log n) in the faces of the cells that it touches.

pub mod complex;
pub mod couple;
pub mod export;
pub mod finder;
pub mod finer;
pub mod ground;
mod lift;
pub mod optimise;
mod parallel;
mod part;
pub mod polygon;
pub mod proposal;
pub mod replace;
mod room;

use glam::DVec3;
use rustc_hash::FxHashMap;

pub use complex::Complex;
pub use export::to_quads;
pub use finder::{Finder, Terrain, along};
pub use finer::{Room, cut_again, with_rings};
pub use ground::{Ground, Side, components};
pub use replace::Undo;

use crate::mesh::id::{Face, Vertex};
use crate::mesh::{FaceId, IdVec, VertexId};

/// A corner of a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Corner {
    /// The node.
    pub node: VertexId,
    /// Where the path to the next corner begins, seen from inside the cell.
    pub side: Side,
}

/// See the module.
#[derive(Clone, Debug)]
pub struct Layout<'g> {
    /// The mesh below.
    pub ground: &'g Ground<'g>,
    /// The cell of each face.
    pub(crate) cell: IdVec<Face, u32>,
    /// The faces of each cell; none where the cell is gone.
    faces: Vec<Vec<FaceId>>,
    /// The corners of each cell, counter-clockwise.
    rings: Vec<Vec<Corner>>,
    node: IdVec<Vertex, bool>,
    /// Nodes that stay where they are: corners, and where borders of domains meet.
    pub fixed: IdVec<Vertex, bool>,
    /// The area that a new cell may hold, unless the old ones hold more; square of the mesh's unit.
    pub largest: f64,
    around: FxHashMap<VertexId, Vec<u32>>,
    /// The angle of each domain at fixed nodes, in right angles.
    corners: FxHashMap<(VertexId, u32), f64>,
    pub(crate) finder: Finder,
}

/// A cell that is no disk, or whose border touches itself or has too few nodes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NotADisk {
    /// The cell.
    pub cell: u32,
    /// One of its faces.
    pub face: FaceId,
}

impl<'g> Layout<'g> {
    /// The complex of these cells and nodes, and the cells that are no disks.
    pub fn new(
        ground: &'g Ground<'g>,
        cell: IdVec<Face, u32>,
        count: usize,
        node: IdVec<Vertex, bool>,
        fixed: IdVec<Vertex, bool>,
    ) -> (Self, Vec<NotADisk>) {
        let mut faces = vec![Vec::new(); count];
        cell.enumerate().for_each(|(f, &c)| faces[c as usize].push(f));
        let finder = Finder::new(node.len());
        let rings = vec![Vec::new(); count];
        let corners = proposal::corners(ground, &fixed);
        let mut layout = Self {
            ground,
            cell,
            faces,
            rings,
            node,
            fixed,
            largest: f64::INFINITY,
            around: FxHashMap::default(),
            corners,
            finder,
        };
        let mut bad = Vec::new();
        for c in 0..count as u32 {
            let ring = if layout.is_simply_connected(c) { layout.trace(c) } else { None };
            match ring {
                Some(ring) => layout.set_ring(c, ring),
                None => bad.extend(layout.faces[c as usize].first().map(|&face| NotADisk { cell: c, face })),
            }
        }
        (layout, bad)
    }

    /// The cells there are, in rising order.
    pub fn cells(&self) -> impl Iterator<Item = u32> {
        (0..self.faces.len() as u32).filter(|&c| !self.faces[c as usize].is_empty())
    }

    /// Whether this cell is still there.
    pub fn exists(&self, cell: u32) -> bool {
        self.faces.get(cell as usize).is_some_and(|faces| !faces.is_empty())
    }

    /// The cell of a face.
    pub fn cell_of(&self, face: FaceId) -> u32 {
        self.cell[face]
    }

    /// The faces of a cell.
    pub fn faces(&self, cell: u32) -> &[FaceId] {
        &self.faces[cell as usize]
    }

    /// The corners of a cell, counter-clockwise.
    pub fn ring(&self, cell: u32) -> &[Corner] {
        &self.rings[cell as usize]
    }

    /// The nodes of a cell, counter-clockwise.
    pub fn nodes(&self, cell: u32) -> Vec<VertexId> {
        self.ring(cell).iter().map(|corner| corner.node).collect()
    }

    /// The cells at a node, in no order that means anything but the same on every machine.
    pub fn cells_at(&self, node: VertexId) -> &[u32] {
        self.around.get(&node).map_or(&[], Vec::as_slice)
    }

    /// Whether a vertex is a node.
    pub fn is_node(&self, v: VertexId) -> bool {
        self.node[v]
    }

    /// The domain of a cell.
    pub fn domain(&self, cell: u32) -> u32 {
        self.ground.domain[self.faces[cell as usize][0]]
    }

    /// The cell beyond the edge that leaves corner `k`; `None` at the rim of the surface.
    pub fn beyond(&self, cell: u32, k: usize) -> Option<u32> {
        self.ground.beyond(self.ring(cell)[k].side).map(|face| self.cell[face])
    }

    /// The cell of the same domain beyond the edge that leaves corner `k`.
    pub fn neighbour(&self, cell: u32, k: usize) -> Option<u32> {
        let side = self.ring(cell)[k].side;
        let face = self.ground.beyond(side)?;
        (self.ground.domain[face] == self.ground.domain[side.face]).then(|| self.cell[face])
    }

    /// The path from corner `k` to the next one, both included.
    pub fn path(&self, cell: u32, k: usize) -> Vec<VertexId> {
        let start = self.ring(cell)[k];
        let mut path = vec![start.node];
        let mut at = start.side;
        loop {
            let end = self.ground.target(at);
            path.push(end);
            if self.node[end] {
                return path;
            }
            at = self.ground.next_on_border(at, |f| self.cell[f] == cell);
        }
    }

    /// Whether a node lies on the border of its domain.
    pub fn is_on_border(&self, node: VertexId) -> bool {
        self.ground.on_border[node]
    }

    /// The area of a cell along its mean normal.
    pub fn area(&self, cell: u32) -> DVec3 {
        self.faces(cell).iter().map(|&f| self.ground.areas[f]).sum::<DVec3>() / 2.0
    }

    /// The least sine-like quality of the corners that these nodes make on a patch of this normal: 1 for a rectangle
    /// and for the equilateral triangle, less where it is slender, 0 where a corner is straight, negative where it is
    /// reflex.
    pub fn quality(&self, nodes: &[VertexId], normal: DVec3) -> f64 {
        let corners: Vec<DVec3> = nodes.iter().map(|&v| self.ground.point(v)).collect();
        quality(&corners, normal)
    }

    /// The quality of a cell.
    pub fn quality_of(&self, cell: u32) -> f64 {
        self.quality(&self.nodes(cell), self.area(cell).normalize_or_zero())
    }

    /// The area of the faces of a cell.
    pub fn held(&self, cell: u32) -> f64 {
        self.faces(cell).iter().map(|&f| self.ground.areas[f].length()).sum::<f64>() / 2.0
    }

    /// How many times the area that its corners span a cell holds: 1 where it is flat, 3.1 for a cap of half a sphere,
    /// without bound where it holds a limb. Infinite where the corners lie on a line.
    pub fn bulge(&self, cell: u32) -> f64 {
        let corners: Vec<DVec3> = self.nodes(cell).iter().map(|&v| self.ground.point(v)).collect();
        let middle = corners.iter().sum::<DVec3>() / corners.len().max(1) as f64;
        let triangle = |i: usize| (corners[i] - middle).cross(corners[(i + 1) % corners.len()] - middle).length() / 2.0;
        self.held(cell) / (0..corners.len()).map(triangle).sum::<f64>()
    }

    /// Walks once round a cell. `None` when its border has several loops, touches itself, or has under two nodes.
    fn trace(&self, cell: u32) -> Option<Vec<Corner>> {
        let inside = |f: FaceId| self.cell[f] == cell;
        let (mut sides, mut start) = (0, None);
        for &face in &self.faces[cell as usize] {
            for corner in 0..3 {
                let side = Side { face, corner };
                if !self.ground.beyond(side).is_some_and(inside) {
                    sides += 1;
                    start = start.or(self.node[self.ground.origin(side)].then_some(side));
                }
            }
        }
        let (start, mut ring, mut visited) = (start?, Vec::new(), Vec::with_capacity(sides));
        let mut at = start;
        while visited.len() < sides {
            let node = self.ground.origin(at);
            visited.push(node);
            if self.node[node] {
                ring.push(Corner { node, side: at });
            }
            at = self.ground.next_on_border(at, inside);
            if at == start {
                break;
            }
        }
        let count = visited.len();
        visited.sort_unstable();
        visited.dedup();
        (at == start && count == sides && visited.len() == count && ring.len() >= 2).then_some(ring)
    }

    /// Whether vertices minus edges plus faces is one.
    fn is_simply_connected(&self, cell: u32) -> bool {
        let faces = &self.faces[cell as usize];
        let mut vertices: Vec<VertexId> = faces.iter().flat_map(|&f| self.ground.surface.faces[f]).collect();
        vertices.sort_unstable();
        vertices.dedup();
        let sides =
            |&f: &FaceId| self.ground.across[f].iter().filter(|g| g.is_some_and(|g| self.cell[g] == cell)).count();
        let inner: usize = faces.iter().map(sides).sum();
        let edges = 3 * faces.len() - inner / 2;
        vertices.len() + faces.len() == edges + 1
    }

    fn set_ring(&mut self, cell: u32, ring: Vec<Corner>) {
        for corner in &ring {
            self.around.entry(corner.node).or_default().push(cell);
        }
        self.rings[cell as usize] = ring;
    }

    /// Makes a vertex on the border of these cells a node.
    pub(super) fn make_node(&mut self, v: VertexId, cells: [Option<u32>; 2]) {
        self.node[v] = true;
        for cell in cells.into_iter().flatten() {
            self.clear_ring(cell);
            if let Some(ring) = self.trace(cell) {
                self.set_ring(cell, ring);
            }
        }
    }

    fn clear_ring(&mut self, cell: u32) {
        for corner in std::mem::take(&mut self.rings[cell as usize]) {
            if let Some(cells) = self.around.get_mut(&corner.node) {
                cells.retain(|&c| c != cell);
            }
        }
    }
}

/// Patches longer than so many times their shortest side count less, by the cube of what they exceed it: a row of
/// slender ones has few irregular nodes, and no use.
const LONG: f64 = 5.0;

/// See [`Layout::quality`].
fn quality(corners: &[DVec3], normal: DVec3) -> f64 {
    let n = corners.len();
    let scale = if n == 3 { 2.0 / 3.0_f64.sqrt() } else { 1.0 };
    let corner = |i: usize| {
        let at = corners[i];
        let (to, from) = (corners[(i + 1) % n] - at, corners[(i + n - 1) % n] - at);
        scale * normal.dot(to.normalize_or_zero().cross(from.normalize_or_zero()))
    };
    let least = (0..n).map(corner).fold(f64::INFINITY, f64::min);
    let sides = (0..n).map(|i| corners[i].distance(corners[(i + 1) % n]));
    let (shortest, longest) = sides.fold((f64::INFINITY, 0.0_f64), |(s, l), side| (s.min(side), l.max(side)));
    if longest > LONG * shortest && least > 0.0 {
        let slender = LONG * shortest / longest;
        return least * slender * slender * slender;
    }
    least
}
