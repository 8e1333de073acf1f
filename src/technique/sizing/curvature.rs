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

/// What bounds an edge over a bent surface; lengths in mesh units.
#[derive(Clone, Copy, Debug)]
pub struct Chord {
    /// The farthest that it may lie off the arc below it.
    pub sagitta: f64,
    /// The longest that it may be.
    pub most: f64,
    /// The most that the arc may turn, in radians; arcs that a chord of twice the sagitta spans may turn further.
    pub turn: f64,
}

impl Chord {
    fn longest(&self, curvature: f64) -> f64 {
        let curvature = curvature.max(f64::MIN_POSITIVE);
        let turning = (self.turn / curvature).max(2.0 * self.sagitta);
        (8.0 * self.sagitta / curvature).sqrt().min(turning).min(self.most)
    }
}

/// The longest edge within these bounds, for each face of a mesh that has just been entered.
pub fn longest_edges(mesh: &HalfedgeMesh, chord: Chord) -> IdVec<Face, f64> {
    let least_area = SPREAD * chord.most * chord.most;
    let mut bending: Vec<Bending> = mesh.faces().map(|f| own(mesh, f)).collect();
    for _ in 0..PASSES {
        bending = mesh.faces().map(|f| shared(mesh, f, &bending, least_area)).collect();
    }
    let longest = |bending: &Bending| {
        let curvature = if bending.area > 0.0 { norm(&bending.tensor) / bending.area } else { 0.0 };
        chord.longest(curvature)
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

#[cfg(test)]
mod tests {
    use super::Chord;

    /// An arc of this radius, a chord of this length: how far apart in the middle, and how far the arc turns.
    fn arc(radius: f64, chord: f64) -> [f64; 2] {
        let half = libm::asin((0.5 * chord / radius).min(1.0));
        [radius * (1.0 - libm::cos(half)), 2.0 * half]
    }

    #[test]
    fn chords_keep_to_the_sagitta_and_where_asked_to_the_turn() {
        let sagitta = 0.1;
        for radius in [0.2, 0.4, 0.8, 1.6, 100.0] {
            for turn in [f64::INFINITY, 1.0] {
                let longest = Chord { sagitta, most: 5.0, turn }.longest(1.0 / radius);
                let [off, turned] = arc(radius, longest);
                // A parabola stands for the arc: a quarter of a circle lies a sixth farther off.
                assert!(off <= 1.2 * sagitta || longest >= 2.0 * radius, "radius {radius}, turn {turn}: {off}");
                assert!(turned <= 1.05 * turn || longest <= 2.0 * sagitta, "radius {radius}, turn {turn}: {turned}");
                assert!(longest <= 5.0);
            }
        }
    }

    #[test]
    fn what_is_flat_gets_the_longest() {
        assert_eq!(Chord { sagitta: 0.1, most: 3.0, turn: 1.0 }.longest(0.0), 3.0);
    }
}
