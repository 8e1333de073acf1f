//! How long edges may be for the curvature of a surface.
//!
//! A chord of length `h` on a circle of radius `ρ` lies `h²/(8 ρ)` off it. The curvature of a face is the tensor of the
//! bends of its edges over the area that belongs to them (D. Cohen-Steiner, J.-M. Morvan. Restricted Delaunay
//! triangulations and normal cycle. SoCG 2003), averaged over faces nearby: bends that alternate, as the noise of a
//! scan does, cancel out. Faces behind a marked curve do not count, nor more of a large neighbour than is there of the
//! face itself, so that a plane beside a round edge does not hide it.
//!
//! # Cost
//! O(F), for each of a few passes.

use glam::{DMat3, DVec3};

use crate::mesh::geometry::{angle, area_vector};
use crate::mesh::halfedge::{HalfedgeMesh, edge_of, twin};
use crate::mesh::id::Face;
use crate::mesh::{FaceId, Freedom, HalfedgeId, IdVec};

/// How often faces share what they know with their neighbours.
const PASSES: usize = 3;

/// Neighbours count with at least this area, as a part of the square of the largest size: needles say little alone.
const SPREAD: f64 = 0.01;

/// The sum of bends round a face, and the area over which they were summed.
#[derive(Clone, Copy, Debug, Default)]
struct Bending {
    tensor: DMat3,
    area: f64,
}

/// The longest edge up to `most` that lies no further than `sagitta` off the arc below it, for each face of a mesh that
/// has just been entered.
pub fn longest_edges(mesh: &HalfedgeMesh, sagitta: f64, most: f64) -> IdVec<Face, f64> {
    let least_area = SPREAD * most * most;
    let mut bending: Vec<Bending> = mesh.faces().map(|f| own(mesh, f)).collect();
    for _ in 0..PASSES {
        bending = mesh.faces().map(|f| shared(mesh, f, &bending, least_area)).collect();
    }
    let longest = |bending: &Bending| {
        let curvature = if bending.area > 0.0 { norm(&bending.tensor) / bending.area } else { 0.0 };
        (8.0 * sagitta / curvature.max(f64::MIN_POSITIVE)).sqrt().min(most)
    };
    bending.iter().map(longest).collect()
}

/// The longest edge for a curve that turns by an angle between two of its edges of these lengths.
pub fn longest_chord(turn: f64, lengths: [f64; 2], sagitta: f64) -> f64 {
    if turn < STRAIGHT { f64::INFINITY } else { (4.0 * (lengths[0] + lengths[1]) / turn * sagitta).sqrt() }
}

/// Curves that turn by less, in radians, are straight.
const STRAIGHT: f64 = 1e-6;

/// The root of the sum of squares: the largest curvature, and a little more where both are large.
fn norm(m: &DMat3) -> f64 {
    (m.x_axis.length_squared() + m.y_axis.length_squared() + m.z_axis.length_squared()).sqrt()
}

fn sides(mesh: &HalfedgeMesh, f: FaceId) -> [HalfedgeId; 3] {
    let first = mesh.face_halfedge(f);
    [first, mesh.next(first), mesh.prev(first)]
}

/// The face behind a side that no curve runs along.
fn behind(mesh: &HalfedgeMesh, side: HalfedgeId) -> Option<FaceId> {
    mesh.face(twin(side)).filter(|_| mesh.edge_freedom(edge_of(side)) == Freedom::Free)
}

fn own(mesh: &HalfedgeMesh, f: FaceId) -> Bending {
    let vector = area_vector(mesh.corner_points(f));
    let mut tensor = DMat3::ZERO;
    for side in sides(mesh, f) {
        let Some(other) = behind(mesh, side) else { continue };
        let next = area_vector(mesh.corner_points(other));
        let along = mesh.point(mesh.target(side)) - mesh.point(mesh.origin(side));
        let sign = if vector.cross(next).dot(along) < 0.0 { -1.0 } else { 1.0 };
        let weight = 0.5 * sign * angle(vector, next) * along.length();
        tensor += outer(along.normalize_or_zero(), weight);
    }
    Bending { tensor, area: 0.5 * vector.length() }
}

fn outer(d: DVec3, weight: f64) -> DMat3 {
    DMat3::from_cols(weight * d.x * d, weight * d.y * d, weight * d.z * d)
}

fn shared(mesh: &HalfedgeMesh, f: FaceId, all: &[Bending], least_area: f64) -> Bending {
    let mut sum = all[f.index()];
    let limit = sum.area.max(least_area);
    for other in sides(mesh, f).into_iter().filter_map(|side| behind(mesh, side)) {
        let next = all[other.index()];
        let share = if next.area > limit { limit / next.area } else { 1.0 };
        sum.tensor += next.tensor * share;
        sum.area += next.area * share;
    }
    sum
}
