//! A tree of boxes over the live faces of a workshop, kept up while they change.
//!
//! Built over the order of the faces along a space-filling curve, eight boxes side by side in every node, so that one
//! query reads few and whole cache lines. When a face changes, the boxes on its way to the root grow and never shrink;
//! when half of the faces are gone or as many are new, the tree is built anew. So an update costs a few box unions, and
//! no query ever misses a face. Memory: about 45 bytes a face.

use glam::{DVec3, Vec3};

use crate::mesh::geometry::Aabb;
use crate::mesh::halfedge::HalfedgeMesh;
use crate::mesh::{FaceId, VertexId};

const NONE: u32 = u32::MAX;
const WIDTH: usize = 8;

/// A box in single precision, rounded outwards.
#[derive(Clone, Copy, Debug)]
pub(super) struct SmallBox {
    min: Vec3,
    max: Vec3,
}

impl SmallBox {
    pub(super) const EMPTY: Self = Self { min: Vec3::INFINITY, max: Vec3::NEG_INFINITY };

    #[inline]
    fn of(points: &[DVec3], origin: DVec3) -> Self {
        let mut all = Self::EMPTY;
        for &p in points {
            let p = p - origin;
            let near = p.as_vec3();
            // One part in 2^22 is more than the rounding of both the subtraction and the cast.
            let margin = near.abs() * 2.4e-7 + f32::MIN_POSITIVE;
            all.min = all.min.min(near - margin);
            all.max = all.max.max(near + margin);
        }
        all
    }

    #[inline]
    pub(super) fn union(self, other: Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    #[inline]
    pub(super) fn overlaps(self, other: Self) -> bool {
        self.min.cmple(other.max).all() && other.min.cmple(self.max).all()
    }

    #[inline]
    fn contains(self, other: Self) -> bool {
        self.min.cmple(other.min).all() && other.max.cmple(self.max).all()
    }
}

/// Eight boxes, a coordinate at a time.
#[derive(Clone, Copy, Debug)]
struct Node {
    min: [[f32; WIDTH]; 3],
    max: [[f32; WIDTH]; 3],
}

impl Node {
    const EMPTY: Self = Self { min: [[f32::INFINITY; WIDTH]; 3], max: [[f32::NEG_INFINITY; WIDTH]; 3] };

    /// One bit for each box that meets `area`.
    #[inline]
    fn meets(&self, area: &SmallBox) -> u32 {
        let (low, high) = (area.min.to_array(), area.max.to_array());
        let mut meets = [1_u32; WIDTH];
        for axis in 0..3 {
            let (min, max) = (&self.min[axis], &self.max[axis]);
            for lane in 0..WIDTH {
                meets[lane] &= u32::from(min[lane] <= high[axis]) & u32::from(max[lane] >= low[axis]);
            }
        }
        meets.iter().enumerate().fold(0, |bits, (lane, &meets)| bits | meets << lane)
    }

    #[inline]
    fn get(&self, lane: usize) -> SmallBox {
        let of = |sides: &[[f32; WIDTH]; 3]| Vec3::new(sides[0][lane], sides[1][lane], sides[2][lane]);
        SmallBox { min: of(&self.min), max: of(&self.max) }
    }

    #[inline]
    fn set(&mut self, lane: usize, own: SmallBox) {
        let (min, max) = (own.min.to_array(), own.max.to_array());
        for axis in 0..3 {
            self.min[axis][lane] = min[axis];
            self.max[axis][lane] = max[axis];
        }
    }

    fn union(&self) -> SmallBox {
        (0..WIDTH).fold(SmallBox::EMPTY, |all, lane| all.union(self.get(lane)))
    }
}

/// What a lowest node holds besides the boxes.
#[derive(Clone, Copy, Debug)]
struct Leaf {
    faces: [u32; WIDTH],
    corners: [[VertexId; 3]; WIDTH],
    /// The node that holds what did not fit into this one.
    more: u32,
    /// The node of the built tree that this one hangs on; itself, where it is one.
    home: u32,
}

/// A face near a query.
#[derive(Clone, Copy, Debug)]
pub(super) struct Near {
    pub(super) corners: [VertexId; 3],
    pub(super) area: SmallBox,
}

/// The tree.
#[derive(Clone, Debug, Default)]
pub(super) struct BoxTree {
    origin: DVec3,
    /// Box `i` of a level is the union of node `i` of the level below; the last level is one node.
    levels: Vec<Vec<Node>>,
    leaves: Vec<Leaf>,
    /// Where each face is: eight times its leaf, plus its lane.
    place: Vec<u32>,
    built_with: usize,
    added: usize,
    stack: Vec<(u32, u32)>,
}

impl BoxTree {
    /// The tree over all live faces.
    pub(super) fn new(mesh: &HalfedgeMesh) -> Self {
        let mut this = Self::default();
        this.rebuild(mesh);
        this
    }

    /// The box of a triangle, as this tree has it.
    #[inline]
    pub(super) fn box_of(&self, corners: &[DVec3; 3]) -> SmallBox {
        SmallBox::of(corners, self.origin)
    }

    fn rebuild(&mut self, mesh: &HalfedgeMesh) {
        let bounds = Aabb::of(mesh.vertices().map(|v| mesh.point(v)));
        self.origin = if bounds.is_empty() { DVec3::ZERO } else { bounds.centre() };
        let scale = CELLS / bounds.diagonal().max(f64::MIN_POSITIVE);
        let mut order: Vec<(u64, u32)> = mesh
            .faces()
            .map(|f| {
                let [a, b, c] = mesh.corner_points(f);
                (morton(((a + b + c) / 3.0 - bounds.min) * scale), f.raw())
            })
            .collect();
        order.sort_unstable();
        self.place.clear();
        self.place.resize(mesh.face_slots(), NONE);
        self.levels.clear();
        self.leaves.clear();
        let mut nodes = Vec::with_capacity(order.len().div_ceil(WIDTH));
        for faces in order.chunks(WIDTH) {
            let home = nodes.len() as u32;
            let corners = [[VertexId::from_raw(NONE); 3]; WIDTH];
            let mut leaf = Leaf { faces: [NONE; WIDTH], corners, more: NONE, home };
            let mut node = Node::EMPTY;
            for (lane, &(_, face)) in faces.iter().enumerate() {
                let f = FaceId::from_raw(face);
                leaf.faces[lane] = face;
                leaf.corners[lane] = mesh.corners(f);
                self.place[face as usize] = WIDTH as u32 * home + lane as u32;
                node.set(lane, self.box_of(&mesh.corner_points(f)));
            }
            nodes.push(node);
            self.leaves.push(leaf);
        }
        while nodes.len() > 1 {
            let above = nodes.chunks(WIDTH).map(|below| {
                let mut node = Node::EMPTY;
                for (lane, below) in below.iter().enumerate() {
                    node.set(lane, below.union());
                }
                node
            });
            let above: Vec<Node> = above.collect();
            self.levels.push(std::mem::replace(&mut nodes, above));
        }
        self.levels.push(nodes);
        self.built_with = order.len();
        self.added = 0;
    }

    /// Tells of a face that has changed, or of a new one that lies where `sibling` lies.
    pub(super) fn update(&mut self, face: FaceId, corners: [VertexId; 3], points: [DVec3; 3], sibling: FaceId) {
        if face.index() >= self.place.len() {
            self.place.resize(face.index() + 1, NONE);
        }
        if self.place[face.index()] == NONE {
            self.place[face.index()] = self.room_beside(sibling);
            self.added += 1;
        }
        let place = self.place[face.index()] as usize;
        let (leaf, lane) = (place / WIDTH, place % WIDTH);
        self.leaves[leaf].faces[lane] = face.raw();
        self.leaves[leaf].corners[lane] = corners;
        let own = self.box_of(&points);
        self.levels[0][leaf].set(lane, own);
        let mut at = self.leaves[leaf].home as usize;
        for level in &mut self.levels[1..] {
            let (node, lane) = (&mut level[at / WIDTH], at % WIDTH);
            let now = node.get(lane);
            if now.contains(own) {
                break;
            }
            node.set(lane, now.union(own));
            at /= WIDTH;
        }
    }

    /// A free place near a face, which may be gone by now.
    fn room_beside(&mut self, sibling: FaceId) -> u32 {
        let mut leaf = self.place[sibling.index()] as usize / WIDTH;
        loop {
            if let Some(lane) = self.leaves[leaf].faces.iter().position(|&face| face == NONE) {
                return (WIDTH * leaf + lane) as u32;
            }
            if self.leaves[leaf].more == NONE {
                break;
            }
            leaf = self.leaves[leaf].more as usize;
        }
        let new = self.leaves.len();
        self.leaves[leaf].more = new as u32;
        self.leaves.push(Leaf { faces: [NONE; WIDTH], more: NONE, ..self.leaves[leaf] });
        self.levels[0].push(Node::EMPTY);
        (WIDTH * new) as u32
    }

    /// Tells of a face that is gone. Its place is remembered, for those that come in its stead.
    pub(super) fn forget(&mut self, face: FaceId) {
        let place = self.place[face.index()] as usize;
        self.levels[0][place / WIDTH].set(place % WIDTH, SmallBox::EMPTY);
        self.leaves[place / WIDTH].faces[place % WIDTH] = NONE;
    }

    /// Builds the tree anew when too much has changed since it was built.
    pub(super) fn tidy(&mut self, mesh: &HalfedgeMesh) {
        if 2 * mesh.face_count() < self.built_with || self.added > self.built_with / 2 + 64 {
            self.rebuild(mesh);
        }
    }

    /// Gathers the faces whose boxes meet `area`, without those in `old`.
    pub(super) fn collect(&mut self, area: SmallBox, old: &[FaceId], near: &mut Vec<Near>) {
        near.clear();
        self.stack.clear();
        self.stack.push((self.levels.len() as u32 - 1, 0));
        while let Some((level, node)) = self.stack.pop() {
            let Some(found) = self.levels[level as usize].get(node as usize) else { continue };
            let mut meets = found.meets(&area);
            if level > 0 {
                while meets != 0 {
                    self.stack.push((level - 1, WIDTH as u32 * node + meets.trailing_zeros()));
                    meets &= meets - 1;
                }
                continue;
            }
            let leaf = &self.leaves[node as usize];
            if leaf.more != NONE {
                self.stack.push((0, leaf.more));
            }
            while meets != 0 {
                let lane = meets.trailing_zeros() as usize;
                if !old.contains(&FaceId::from_raw(leaf.faces[lane])) {
                    near.push(Near { corners: leaf.corners[lane], area: found.get(lane) });
                }
                meets &= meets - 1;
            }
        }
    }
}

/// Cells along the diagonal for the order of the faces.
const CELLS: f64 = 2_097_151.0;

/// Interleaves the bits of a point with coordinates from 0 to [`CELLS`].
fn morton(p: DVec3) -> u64 {
    let spread = |x: f64| {
        let mut bits = x.clamp(0.0, CELLS) as u64;
        bits = (bits | (bits << 32)) & 0x001F_0000_0000_FFFF;
        bits = (bits | (bits << 16)) & 0x001F_0000_FF00_00FF;
        bits = (bits | (bits << 8)) & 0x100F_00F0_0F00_F00F;
        bits = (bits | (bits << 4)) & 0x10C3_0C30_C30C_30C3;
        (bits | (bits << 2)) & 0x1249_2492_4924_9249
    };
    spread(p.x) | (spread(p.y) << 1) | (spread(p.z) << 2)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::halfedge::tests::{enter, surface};
    use proptest::prelude::*;

    /// Triangles apart from each other, one for each point.
    fn scattered(points: &[[f64; 3]]) -> HalfedgeMesh {
        let corners: Vec<[f64; 3]> =
            points.iter().flat_map(|&[x, y, z]| [[x, y, z], [x + 0.1, y, z], [x, y + 0.1, z]]).collect();
        let faces: Vec<[u32; 3]> = (0..points.len() as u32).map(|f| [3 * f, 3 * f + 1, 3 * f + 2]).collect();
        enter(&surface(&corners, &faces))
    }

    fn points() -> impl Strategy<Value = Vec<[f64; 3]>> {
        prop::collection::vec(prop::array::uniform3(-1.0..1.0f64), 1..120)
    }

    proptest! {
        #[test]
        fn no_query_misses_a_face(
            places in points(),
            gone in prop::collection::vec(0usize..120, 0..40),
            added in points(),
            area in prop::array::uniform3(-1.0..1.0f64),
        ) {
            let mesh = scattered(&places);
            let mut tree = BoxTree::new(&mesh);
            let mut alive: Vec<Option<[DVec3; 3]>> = mesh.faces().map(|f| Some(mesh.corner_points(f))).collect();
            for at in gone {
                if alive.get(at).is_some_and(Option::is_some) {
                    tree.forget(FaceId::new(at));
                    alive[at] = None;
                }
            }
            for (at, place) in added.iter().enumerate() {
                let p = DVec3::from_array(*place);
                let corners = [p, p + 0.2 * DVec3::X, p + 0.2 * DVec3::Z];
                let id = FaceId::new(alive.len());
                tree.update(id, [VertexId::from_raw(id.raw()); 3], corners, FaceId::new(at % places.len()));
                alive.push(Some(corners));
            }
            let low = DVec3::from_array(area);
            let query = [low, low + 0.5, low];
            let mut near = Vec::new();
            tree.collect(tree.box_of(&query), &[], &mut near);
            let exact = Aabb::of(query);
            let expected = alive.iter().flatten().filter(|t| Aabb::of(t.iter().copied()).overlaps(&exact)).count();
            prop_assert!(near.len() >= expected);
            let loose = exact.grown(1e-5);
            let most = alive.iter().flatten().filter(|t| Aabb::of(t.iter().copied()).overlaps(&loose)).count();
            prop_assert!(near.len() <= most);
        }
    }
}
