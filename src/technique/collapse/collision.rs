//! Whether a changed star would run into the rest of the mesh, by exact tests.
//!
//! A tree of boxes over the live faces, built once over their order along a space-filling curve. When a face changes,
//! the boxes on its way to the root grow and never shrink; when half of the faces are gone or as many are new, the
//! tree is built anew. So an update costs a few box unions, and no query ever misses a face.
//! Faces that intersect already do not forbid anything elsewhere: only the new faces of an edit are tested.
//! Memory: 24 bytes a box, 8 faces a leaf.

use glam::{DVec3, Vec3};

use crate::mesh::FaceId;
use crate::mesh::geometry::Aabb;
use crate::mesh::halfedge::HalfedgeMesh;
use crate::mesh::predicate::triangle_triangle;

const NONE: u32 = u32::MAX;
const LEAF_FACES: usize = 8;

/// A box in single precision, rounded outwards.
#[derive(Clone, Copy, Debug)]
struct SmallBox {
    min: Vec3,
    max: Vec3,
}

impl SmallBox {
    const EMPTY: Self = Self { min: Vec3::INFINITY, max: Vec3::NEG_INFINITY };

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

    fn union(self, other: Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    fn overlaps(self, other: Self) -> bool {
        self.min.cmple(other.max).all() && other.min.cmple(self.max).all()
    }

    fn contains(self, other: Self) -> bool {
        self.min.cmple(other.min).all() && other.max.cmple(self.max).all()
    }
}

/// The boxes over the live faces of a workshop.
#[derive(Clone, Debug)]
pub struct Collision {
    origin: DVec3,
    /// A complete binary tree: the children of box `i` are `2i + 1` and `2i + 2`; the last `leaves` boxes are leaves.
    boxes: Vec<SmallBox>,
    first_leaf: usize,
    /// The first face of each leaf, and the next face of the same leaf.
    head: Vec<u32>,
    next: Vec<u32>,
    leaf_of: Vec<u32>,
    /// The box of each face; empty for faces that are gone.
    face_box: Vec<SmallBox>,
    new_boxes: Vec<SmallBox>,
    built_with: usize,
    added: usize,
    stack: Vec<u32>,
    near: Vec<u32>,
}

impl Collision {
    /// The boxes over all live faces.
    pub fn new(mesh: &HalfedgeMesh) -> Self {
        let mut this = Self {
            origin: DVec3::ZERO,
            boxes: Vec::new(),
            first_leaf: 0,
            head: Vec::new(),
            next: Vec::new(),
            leaf_of: Vec::new(),
            face_box: Vec::new(),
            new_boxes: Vec::new(),
            built_with: 0,
            added: 0,
            stack: Vec::new(),
            near: Vec::new(),
        };
        this.rebuild(mesh);
        this
    }

    fn rebuild(&mut self, mesh: &HalfedgeMesh) {
        let bounds = Aabb::of(mesh.vertices().map(|v| mesh.point(v)));
        self.origin = if bounds.is_empty() { DVec3::ZERO } else { bounds.centre() };
        let scale = 1023.0 / bounds.diagonal().max(f64::MIN_POSITIVE);
        let mut order: Vec<(u32, u32)> = mesh
            .faces()
            .map(|f| {
                let [a, b, c] = mesh.corner_points(f);
                (morton(((a + b + c) / 3.0 - bounds.min) * scale), f.raw())
            })
            .collect();
        order.sort_unstable();
        let leaves = order.len().div_ceil(LEAF_FACES).max(1).next_power_of_two();
        self.first_leaf = leaves - 1;
        self.boxes.clear();
        self.boxes.resize(2 * leaves - 1, SmallBox::EMPTY);
        self.head.clear();
        self.head.resize(leaves, NONE);
        self.next.clear();
        self.next.resize(mesh.face_slots(), NONE);
        self.leaf_of.clear();
        self.leaf_of.resize(mesh.face_slots(), NONE);
        self.face_box.clear();
        self.face_box.resize(mesh.face_slots(), SmallBox::EMPTY);
        for (place, &(_, face)) in order.iter().enumerate().rev() {
            let leaf = place * leaves / order.len();
            self.next[face as usize] = self.head[leaf];
            self.head[leaf] = face;
            self.leaf_of[face as usize] = leaf as u32;
            let own = SmallBox::of(&mesh.corner_points(FaceId::from_raw(face)), self.origin);
            let at = self.first_leaf + leaf;
            self.boxes[at] = self.boxes[at].union(own);
            self.face_box[face as usize] = own;
        }
        for at in (0..self.first_leaf).rev() {
            self.boxes[at] = self.boxes[2 * at + 1].union(self.boxes[2 * at + 2]);
        }
        self.built_with = order.len();
        self.added = 0;
    }

    /// Tells of a face that has changed, or of a new one that lies where `sibling` lies.
    pub fn update(&mut self, mesh: &HalfedgeMesh, face: FaceId, sibling: FaceId) {
        let at = face.index();
        if at >= self.leaf_of.len() {
            self.leaf_of.resize(at + 1, NONE);
            self.next.resize(at + 1, NONE);
            self.face_box.resize(at + 1, SmallBox::EMPTY);
        }
        if self.leaf_of[at] == NONE {
            let leaf = self.leaf_of[sibling.index()];
            self.leaf_of[at] = leaf;
            self.next[at] = self.head[leaf as usize];
            self.head[leaf as usize] = face.raw();
            self.added += 1;
        }
        let own = SmallBox::of(&mesh.corner_points(face), self.origin);
        self.face_box[at] = own;
        let mut node = self.first_leaf + self.leaf_of[at] as usize;
        while !self.boxes[node].contains(own) {
            self.boxes[node] = self.boxes[node].union(own);
            if node == 0 {
                break;
            }
            node = (node - 1) / 2;
        }
    }

    /// Tells of a face that is gone.
    pub fn forget(&mut self, face: FaceId) {
        self.face_box[face.index()] = SmallBox::EMPTY;
    }

    /// Builds the tree anew when too much has changed since it was built.
    pub fn tidy(&mut self, mesh: &HalfedgeMesh) {
        if 2 * mesh.face_count() < self.built_with || self.added > self.built_with / 2 + 64 {
            self.rebuild(mesh);
        }
    }

    /// Whether a new face would meet another new one, or a face that stays, where they share no corner or edge.
    pub fn hits(&mut self, mesh: &HalfedgeMesh, old: &[FaceId], new: &[[DVec3; 3]]) -> bool {
        for (i, &a) in new.iter().enumerate() {
            if new[..i].iter().any(|&b| !clearly_apart(a, b) && triangle_triangle(a, b).is_intersection()) {
                return true;
            }
        }
        self.new_boxes.clear();
        self.new_boxes.extend(new.iter().map(|points| SmallBox::of(points, self.origin)));
        let all = self.new_boxes.iter().fold(SmallBox::EMPTY, |all, &own| all.union(own));
        self.collect(all, old);
        self.near.iter().any(|&face| {
            let own = self.face_box[face as usize];
            let mut other = None;
            new.iter().zip(&self.new_boxes).any(|(&a, &new_box)| {
                if !new_box.overlaps(own) {
                    return false;
                }
                let b = *other.get_or_insert_with(|| mesh.corner_points(FaceId::from_raw(face)));
                !clearly_apart(a, b) && triangle_triangle(a, b).is_intersection()
            })
        })
    }

    /// Gathers the faces whose boxes meet `area`, without those in `old`.
    fn collect(&mut self, area: SmallBox, old: &[FaceId]) {
        self.near.clear();
        self.stack.clear();
        self.stack.push(0);
        while let Some(node) = self.stack.pop() {
            let node = node as usize;
            if !self.boxes[node].overlaps(area) {
                continue;
            }
            if node < self.first_leaf {
                self.stack.push(2 * node as u32 + 1);
                self.stack.push(2 * node as u32 + 2);
                continue;
            }
            let mut face = self.head[node - self.first_leaf];
            while face != NONE {
                if self.face_box[face as usize].overlaps(area) && !old.contains(&FaceId::from_raw(face)) {
                    self.near.push(face);
                }
                face = self.next[face as usize];
            }
        }
    }
}

/// Whether two triangles clearly meet nowhere but in the corners they share: the common case, without exact numbers.
fn clearly_apart(a: [DVec3; 3], b: [DVec3; 3]) -> bool {
    let mut shared = [a[0]; 3];
    let mut common = 0;
    for p in a {
        if b.contains(&p) {
            shared[common] = p;
            common += 1;
        }
    }
    match common {
        2 => unfolded(a, b, [shared[0], shared[1]]),
        3 => false,
        _ => one_sided(a, b) || one_sided(b, a),
    }
}

/// Whether two triangles with a common edge do not lie folded on each other.
fn unfolded(a: [DVec3; 3], b: [DVec3; 3], edge: [DVec3; 2]) -> bool {
    let along = edge[1] - edge[0];
    let side = |t: [DVec3; 3]| {
        let apex = t.into_iter().find(|p| !edge.contains(p)).unwrap_or(edge[0]);
        along.cross(apex - edge[0])
    };
    let (m, n) = (side(a), side(b));
    let scale = m.length_squared() * n.length_squared();
    m.dot(n) < -1e-6 * scale.sqrt() || (m.cross(n).length_squared() > 1e-12 * scale && scale > 0.0)
}

/// Whether a plane along `b`, or at right angles to it along one of its edges, has `b` on one side and `a` strictly on
/// the other, apart from corners that the two share.
fn one_sided(a: [DVec3; 3], b: [DVec3; 3]) -> bool {
    let normal = (b[1] - b[0]).cross(b[2] - b[0]);
    let (above, below) = sides(a, b, b[0], normal, |_| true);
    if above || below {
        return true;
    }
    (0..3).any(|i| {
        let (p, q) = (b[i], b[(i + 1) % 3]);
        let outward = (q - p).cross(normal);
        // A shared corner off this edge lies on the inner side.
        sides(a, b, p, outward, |corner| corner == p || corner == q).0
    })
}

/// Whether all corners of `a` lie above, and whether all lie below the plane, by more than rounding. Corners shared
/// with `b` do not count where `on_plane` says so, and spoil both answers where not.
fn sides(a: [DVec3; 3], b: [DVec3; 3], foot: DVec3, normal: DVec3, on_plane: impl Fn(DVec3) -> bool) -> (bool, bool) {
    let size = normal.abs().element_sum();
    let mut answer = (true, true);
    for p in a {
        if b.contains(&p) {
            if !on_plane(p) {
                return (false, false);
            }
            continue;
        }
        let d = p - foot;
        let height = normal.dot(d);
        let margin = 1e-9 * size * d.abs().element_sum();
        answer.0 &= height > margin;
        answer.1 &= height < -margin;
    }
    answer
}

/// Interleaves the bits of a point with coordinates from 0 to 1023.
fn morton(p: DVec3) -> u32 {
    let spread = |x: f64| {
        let mut bits = x.clamp(0.0, 1023.0) as u32;
        bits = (bits | (bits << 16)) & 0x0300_00FF;
        bits = (bits | (bits << 8)) & 0x0300_F00F;
        bits = (bits | (bits << 4)) & 0x030C_30C3;
        (bits | (bits << 2)) & 0x0924_9249
    };
    spread(p.x) | (spread(p.y) << 1) | (spread(p.z) << 2)
}
