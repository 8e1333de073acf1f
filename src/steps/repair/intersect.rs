//! Faces that run through each other, counted exactly.
//!
//! Nearly all pairs whose boxes meet are neighbours, for which exact predicates are slowest because their answers are
//! zero: these are first tried with tests in plain arithmetic that may only say "apart for certain".

use glam::DVec3;

use super::draft::normal;
use super::report::RepairError;
use crate::mesh::contact::tell_contacts;
use crate::mesh::meetings::meetings;
use crate::mesh::predicate::{Meeting, triangle_triangle};
use crate::mesh::{FaceId, Surface};
use crate::metric::crossing::Common;
use crate::watch::{Cancelled, Watch};

/// How many faces are listed.
const LISTED: usize = 20;

/// What was found.
#[derive(Clone, Debug, Default)]
pub(super) struct Intersections {
    /// Pairs of faces with common points beyond shared corners and edges.
    pub(super) pairs: u64,
    /// The lowest faces among them, ascending.
    pub(super) faces: Vec<u32>,
    /// Whether these are all pairs; else there are at least as many.
    pub(super) complete: bool,
    /// The pairs and how they meet.
    pub(super) met: Vec<(u32, u32, Meeting)>,
}

impl Intersections {
    /// How many of the pairs only touch.
    pub(super) fn contacts(&self, surface: &Surface) -> u64 {
        let mut met = self.met.clone();
        tell_contacts(surface.faces.as_slice(), |v| surface.points[v], &mut met);
        met.iter().filter(|pair| pair.2 == Meeting::Touching).count() as u64
    }

    /// Refuses faces that run through each other along more than `longest` in all. Faces that lie on each other count
    /// with the area that they share, over `diagonal`, so that the sum does not depend on how finely they are cut.
    pub(super) fn check_length(
        &self,
        (longest, diagonal): (f64, f64),
        corners: impl Fn(FaceId) -> [DVec3; 3],
    ) -> Result<(), RepairError> {
        let mut length = 0.0;
        let mut places: Vec<(f64, u32, DVec3)> = Vec::new();
        for &(i, j, _) in &self.met {
            let [a, b] = [i, j].map(|f| corners(FaceId::from_raw(f)));
            let common = Common::of(a, b);
            let extent = common.length() + common.area() / diagonal;
            length += extent;
            places.push((extent, i, common.middle()));
        }
        if length <= longest {
            return Ok(());
        }
        places.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        places.dedup_by_key(|place| place.1);
        let worst = places.into_iter().take(LISTED).map(|(_, face, at)| (face, at)).collect();
        Err(RepairError::RunsThrough { pairs: self.pairs, length, longest, worst })
    }
}

/// Counts the pairs, as far as [`meetings`] goes.
pub(super) fn self_intersections(
    count: usize,
    corners: impl Fn(FaceId) -> [DVec3; 3],
    watch: &Watch,
) -> Result<Intersections, Cancelled> {
    let triangles: Vec<[DVec3; 3]> = (0..count).map(|f| corners(FaceId::new(f))).collect();
    let test = |a, b| if is_surely_apart(a, b) { Meeting::Disjoint } else { triangle_triangle(a, b) };
    let found = meetings(&triangles, test, watch)?;
    let mut faces: Vec<u32> = found.pairs.iter().flat_map(|&(i, j, _)| [i, j]).collect();
    faces.sort_unstable();
    faces.dedup();
    faces.truncate(LISTED);
    Ok(Intersections { pairs: found.pairs.len() as u64, faces, complete: found.complete, met: found.pairs })
}

/// A sign of plain arithmetic counts beyond this share of the magnitudes; rounding stays some thousand times below.
const MARGIN: f64 = 1e-12;

fn is_surely_apart(a: [DVec3; 3], b: [DVec3; 3]) -> bool {
    let shared = |p: DVec3, other: [DVec3; 3]| other.contains(&p);
    let [own_a, own_b] = [(a, b), (b, a)].map(|(t, other)| t.map(|p| !shared(p, other)));
    let (normal_a, normal_b) = (normal(a), normal(b));
    match own_a.iter().filter(|&&own| own).count() {
        // They share an edge: only faces folded flat onto each other have more in common.
        1 => {
            let aligned = normal_a.dot(normal_b);
            let size = (normal_a.length_squared() * normal_b.length_squared()).sqrt();
            size > 0.0 && is_fold_impossible(a, own_a, b, own_b, aligned, size)
        }
        2 => {
            is_beyond(a, normal_a, b, own_b) || is_beyond(b, normal_b, a, own_a) || are_wedges_apart(a, b, own_a, own_b)
        }
        _ => is_beyond(a, normal_a, b, own_b) || is_beyond(b, normal_b, a, own_a),
    }
}

/// Whether the faces at an edge are not in one plane, or lie on different sides of the edge in it.
fn is_fold_impossible(
    a: [DVec3; 3],
    own_a: [bool; 3],
    b: [DVec3; 3],
    own_b: [bool; 3],
    aligned: f64,
    size: f64,
) -> bool {
    if aligned.abs() < 0.999 * size {
        return true;
    }
    let (Some(i), Some(j)) = (own_a.iter().position(|&own| own), own_b.iter().position(|&own| own)) else {
        return false;
    };
    let along = a[(i + 2) % 3] - a[(i + 1) % 3];
    let from = a[(i + 1) % 3];
    let [p, q] = [a[i] - from, b[j] - from].map(|p| p * along.length_squared() - along * p.dot(along));
    p.dot(q) < -MARGIN * (p.length_squared() * q.length_squared()).sqrt()
}

/// Whether all of `b` that is not shared is strictly on one side of the plane of `a`.
fn is_beyond(a: [DVec3; 3], normal_a: DVec3, b: [DVec3; 3], own_b: [bool; 3]) -> bool {
    let (mut above, mut below) = (true, true);
    for (p, _) in b.into_iter().zip(own_b).filter(|(_, own)| *own) {
        let offset = p - a[0];
        let height = normal_a.dot(offset);
        let noise = MARGIN * normal_a.length() * (offset.length() + p.abs().max_element());
        above &= height > noise;
        below &= height < -noise;
    }
    above || below
}

/// Whether a plane through the one shared corner has the faces on different sides.
fn are_wedges_apart(a: [DVec3; 3], b: [DVec3; 3], own_a: [bool; 3], own_b: [bool; 3]) -> bool {
    let Some(tip) = own_a.iter().position(|&own| !own).map(|i| a[i]) else { return false };
    let rays = |t: [DVec3; 3], own: [bool; 3]| {
        let mut own_corners =
            t.into_iter().zip(own).filter(|(_, own)| *own).map(|(p, _)| (p - tip).normalize_or_zero());
        [own_corners.next().unwrap_or_default(), own_corners.next().unwrap_or_default()]
    };
    let ([a0, a1], [b0, b1]) = (rays(a, own_a), rays(b, own_b));
    let across = (a0 + a1).normalize_or_zero() - (b0 + b1).normalize_or_zero();
    // Rays are rounded in the unit sphere, but the corners they come from as far out as the mesh lies.
    let noise = 1e-9;
    a0.dot(across) > noise && a1.dot(across) > noise && b0.dot(across) < -noise && b1.dot(across) < -noise
}
