//! Whether a changed star would run into the rest of the mesh, by exact tests.
//!
//! Candidates come from a tree of boxes (`boxes`). Most pairs share a corner or an edge and are told apart by
//! the side of a plane; what is left goes to exact predicates.
//! Faces that intersect already do not forbid anything elsewhere: only the new faces of an edit are tested.

use glam::DVec3;

use super::boxes::{BoxTree, Near, SmallBox};
use super::certificate::Drift;
use crate::mesh::halfedge::HalfedgeMesh;
use crate::mesh::predicate::triangle_triangle;
use crate::mesh::{FaceId, VertexId};

/// The faces of a workshop, to be asked for intersections.
#[derive(Clone, Debug)]
pub(super) struct Collision {
    tree: BoxTree,
    star: Drift,
    new_boxes: Vec<SmallBox>,
    near: Vec<Near>,
}

impl Collision {
    /// Of all live faces.
    pub(super) fn new(mesh: &HalfedgeMesh) -> Self {
        Self { tree: BoxTree::new(mesh), star: Drift::default(), new_boxes: Vec::new(), near: Vec::new() }
    }

    /// Tells of a face that has changed, or of a new one that lies where `sibling` lies.
    pub(super) fn update(&mut self, face: FaceId, corners: [VertexId; 3], points: [DVec3; 3], sibling: FaceId) {
        self.tree.update(face, corners, points, sibling);
    }

    /// Tells of a face that is gone.
    pub(super) fn forget(&mut self, face: FaceId) {
        self.tree.forget(face);
    }

    /// Keeps queries fast after many changes.
    pub(super) fn tidy(&mut self, mesh: &HalfedgeMesh) {
        self.tree.tidy(mesh);
    }

    /// Whether a new face would meet another new one, or a face that stays, where they share no corner or edge. New
    /// ones that are known to be one sheet do not meet each other.
    pub(super) fn hits(&mut self, mesh: &HalfedgeMesh, old: &[FaceId], new: &[[DVec3; 3]], is_sheet: bool) -> bool {
        let is_sheet = is_sheet || self.star.sees_sheet(new);
        !is_sheet && meet_each_other(new) || self.first_hit(mesh, old, new, |_| false)
    }

    /// As [`Collision::hits`], for new faces that are the old ones cut otherwise: where one of those met another, or a
    /// face that stays, any of the new ones may meet the same. Even here faces must be tested, since a new corner is
    /// rounded off the old faces, and the other side of a needle or of a thin sheet is nearer than that.
    pub(super) fn hits_more(
        &mut self,
        mesh: &HalfedgeMesh,
        old: &[FaceId],
        was: impl Fn(FaceId) -> [DVec3; 3],
        new: &[[DVec3; 3]],
    ) -> bool {
        let olds = || old.iter().map(|&f| was(f));
        let met_itself = || meet_each_other(&olds().collect::<Vec<_>>());
        meet_each_other(new) && !met_itself() || self.first_hit(mesh, old, new, |b| olds().any(|a| meet(a, b)))
    }

    /// Whether a new face meets one that stays, past those that `excused` names.
    fn first_hit(
        &mut self,
        mesh: &HalfedgeMesh,
        old: &[FaceId],
        new: &[[DVec3; 3]],
        excused: impl Fn([DVec3; 3]) -> bool,
    ) -> bool {
        self.new_boxes.clear();
        self.new_boxes.extend(new.iter().map(|points| self.tree.box_of(points)));
        let all = self.new_boxes.iter().fold(SmallBox::EMPTY, |all, &own| all.union(own));
        self.tree.collect(all, old, &mut self.near);
        self.near.iter().any(|face| {
            let mut other = None;
            new.iter().zip(&self.new_boxes).any(|(&a, &new_box)| {
                if !new_box.overlaps(face.area) {
                    return false;
                }
                let b = *other.get_or_insert_with(|| face.corners.map(|v| mesh.point(v)));
                meet(a, b) && !excused(b)
            })
        })
    }
}

/// Whether two of the faces meet beyond a shared corner or edge.
fn meet_each_other(faces: &[[DVec3; 3]]) -> bool {
    faces.iter().enumerate().any(|(i, &a)| faces[..i].iter().any(|&b| meet(a, b)))
}

/// Whether two faces meet beyond a shared corner or edge.
#[inline]
fn meet(a: [DVec3; 3], b: [DVec3; 3]) -> bool {
    !clearly_apart(a, b) && triangle_triangle(a, b).is_intersection()
}

/// Whether two triangles clearly meet nowhere but in the corners they share: the common case, without exact numbers.
fn clearly_apart(a: [DVec3; 3], b: [DVec3; 3]) -> bool {
    // One bit for each corner that the other triangle has too.
    let (mut of_a, mut of_b) = (0_u8, 0_u8);
    for (i, p) in a.iter().enumerate() {
        for (j, q) in b.iter().enumerate() {
            let same = u8::from(p == q);
            of_a |= same << i;
            of_b |= same << j;
        }
    }
    match of_a.count_ones() {
        2 => {
            let [p, q, apex] = split(a, of_a);
            unfolded(q - p, apex - p, split(b, of_b)[2] - p)
        }
        3 => false,
        _ => one_sided(a, of_a, b, of_b) || one_sided(b, of_b, a, of_a),
    }
}

/// The two corners in the mask, then the third.
fn split(t: [DVec3; 3], mask: u8) -> [DVec3; 3] {
    match mask {
        0b011 => t,
        0b101 => [t[0], t[2], t[1]],
        _ => [t[1], t[2], t[0]],
    }
}

/// Whether two triangles on both sides of an edge do not lie folded on each other; their third corners are seen from
/// the edge's first end.
fn unfolded(along: DVec3, left: DVec3, right: DVec3) -> bool {
    let (m, n) = (along.cross(left), along.cross(right));
    let scale = m.length_squared() * n.length_squared();
    m.dot(n) < -1e-6 * scale.sqrt() || (m.cross(n).length_squared() > 1e-12 * scale && scale > 0.0)
}

/// Whether a plane along `b`, or at right angles to it along one of its edges, has `b` on one side and `a` strictly on
/// the other, apart from corners that the two share.
#[inline]
fn one_sided(a: [DVec3; 3], shared_of_a: u8, b: [DVec3; 3], shared_of_b: u8) -> bool {
    let normal = (b[1] - b[0]).cross(b[2] - b[0]);
    let heights = sides(a, shared_of_a, b[0], normal);
    if heights != 0 {
        return true;
    }
    (0..3).any(|i| {
        let next = (i + 1) % 3;
        // A shared corner off this edge lies on the inner side.
        let off_edge = shared_of_b & !(1 << i) & !(1 << next);
        off_edge == 0 && sides(a, shared_of_a, b[i], (b[next] - b[i]).cross(normal)) == 1
    })
}

/// 1 where all corners of `a` lie above the plane, -1 where all lie below, by more than rounding; else 0. Corners in
/// the mask do not count.
#[inline]
fn sides(a: [DVec3; 3], mask: u8, foot: DVec3, normal: DVec3) -> i8 {
    let size = 1e-9 * normal.abs().element_sum();
    let (mut above, mut below) = (true, true);
    for (i, p) in a.into_iter().enumerate() {
        let d = p - foot;
        let height = normal.dot(d);
        let margin = size * d.abs().element_sum();
        let counts = mask & (1 << i) == 0;
        above &= !counts || height > margin;
        below &= !counts || height < -margin;
    }
    i8::from(above) - i8::from(below)
}
