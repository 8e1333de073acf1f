//! Brings finished quads nearer to the surface by moving single vertices: over ridges and tips that a face cuts off.

use glam::DVec3;
use smallvec::SmallVec;

use super::check::{Check, Fault};
use crate::mesh::geometry::{Aabb, closest_on_triangle};
use crate::technique::ground::Ground;
use crate::technique::mixed::{Mixed, Place};
use crate::watch::{Cancelled, Watch};

/// How often all faces are checked again after moves.
const CHECKS: usize = 3;
/// Rounds over the faults found.
const ROUNDS: usize = 4;
/// Shapes that moves may fall to, or what they were before where that is less.
const SOUND: f64 = 0.5;
/// The part of the tolerance from which on a distance counts.
const CALM: f64 = 0.8;
/// Points of the surface looked at round a vertex.
const POINTS: usize = 64;

/// Moves vertices at faults in regions that are `awake` until there is none, or no move helps.
pub(super) fn settle(
    mesh: &mut Mixed,
    ground: &Ground<'_>,
    check: &Check,
    tolerance: f64,
    awake: &[bool],
    watch: &Watch,
) -> Result<(), Cancelled> {
    let mut faults = check.beyond(mesh, tolerance, awake, watch)?;
    for _ in 0..CHECKS {
        let mut work = Settler { mesh, ground, check, tolerance };
        let mut moved = vec![false; awake.len()];
        for _ in 0..ROUNDS {
            let mut helped = false;
            for fault in &faults {
                if work.mend(fault) {
                    moved[work.mesh.region(fault.face) as usize] = true;
                    helped = true;
                }
            }
            if !helped {
                break;
            }
        }
        if !moved.contains(&true) {
            break;
        }
        faults.retain(|fault| !moved[mesh.region(fault.face) as usize]);
        faults.extend(check.beyond(mesh, tolerance, &moved, watch)?);
    }
    Ok(())
}

/// Moves of single vertices that mind the distance.
pub(super) struct Settler<'a, 'g> {
    pub(super) mesh: &'a mut Mixed,
    pub(super) ground: &'a Ground<'g>,
    pub(super) check: &'a Check,
    pub(super) tolerance: f64,
}

impl Settler<'_, '_> {
    /// Whether a corner of the face at fault found a better place.
    fn mend(&mut self, fault: &Fault) -> bool {
        let mut corners: SmallVec<[(f64, u32); 4]> = SmallVec::new();
        for v in self.mesh.corners(fault.face) {
            corners.push((self.mesh.point(v).distance_squared(fault.at), v));
        }
        corners.sort_by(|x, y| x.0.total_cmp(&y.0).then(x.1.cmp(&y.1)));
        let mut moved = false;
        for (_, v) in corners {
            moved |= self.move_vertex(v, fault.at);
        }
        moved
    }

    fn move_vertex(&mut self, v: u32, target: DVec3) -> bool {
        let Place::Region(region) = self.mesh.place(v) else { return false };
        let (start, normal) = (self.mesh.point(v), self.mesh.normal(v));
        let mut points = self.points_near(v);
        // A ridge between points that are farther apart than the faces.
        points.push(self.ground.project_from(region, target, start).point);
        let least = self.mesh.star_quality(v).min(SOUND);
        let reach = self.mesh.star(v).map(|h| self.mesh.length(h)).fold(0.0, f64::max);
        let axis = if normal == DVec3::ZERO { DVec3::Z } else { normal };
        let x = axis.any_orthonormal_vector();
        let y = axis.cross(x);
        let mut best = (0.98 * self.excess(v, &points, f64::INFINITY), start, normal);
        let before = best.0;
        if before <= 0.0 {
            return false;
        }
        let mut wishes: SmallVec<[DVec3; 24]> = SmallVec::new();
        for share in [1.0, 0.7, 0.45, 0.25] {
            wishes.push(start.lerp(target, share));
        }
        for step in [0.08, 0.18, 0.32] {
            for (a, b) in [(1.0, 0.0), (0.7, 0.7), (0.0, 1.0), (-0.7, 0.7), (-1.0, 0.0), (-0.7, -0.7), (0.0, -1.0)] {
                wishes.push(start + step * reach * (a * x + b * y));
            }
        }
        for wish in wishes {
            let foot = self.ground.project_from(region, wish, start);
            if normal != DVec3::ZERO && foot.normal.dot(normal) < 0.2 {
                continue;
            }
            self.mesh.set_point(v, foot.point, foot.normal);
            if self.mesh.star_quality(v) >= least - 1e-12 {
                let excess = self.excess(v, &points, best.0);
                if excess < best.0 {
                    best = (excess, foot.point, foot.normal);
                }
            }
        }
        self.mesh.set_point(v, best.1, best.2);
        best.0 < before
    }

    /// The surface's points in the box of a star, spread thin where there are many.
    pub(super) fn points_near(&self, v: u32) -> Vec<DVec3> {
        let mut area = Aabb::of([self.mesh.point(v)]);
        for f in self.mesh.faces_at(v) {
            for h in self.mesh.sides(f) {
                area = area.with(self.mesh.point(self.mesh.origin(h)));
            }
        }
        let near = self.check.corners.in_box(&area.grown(2.0 * self.tolerance));
        let step = near.len().div_ceil(POINTS).max(1);
        let triangles = self.triangles_at(v);
        let far = (3.0 * self.tolerance).powi(2);
        let at = |i: u32| self.ground.surface.points[crate::mesh::VertexId::from_raw(i)];
        near.into_iter().step_by(step).map(at).filter(|&p| distance_squared(p, &triangles) < far).collect()
    }

    /// The triangles of the faces at a vertex, quads cut along the shorter diagonal.
    fn triangles_at(&self, v: u32) -> SmallVec<[[DVec3; 3]; 12]> {
        let mut out = SmallVec::new();
        for f in self.mesh.faces_at(v) {
            let p: SmallVec<[DVec3; 4]> = self.mesh.sides(f).map(|h| self.mesh.point(self.mesh.origin(h))).collect();
            if p.len() == 3 {
                out.push([p[0], p[1], p[2]]);
            } else if p[0].distance_squared(p[2]) <= p[1].distance_squared(p[3]) {
                out.extend([[p[0], p[1], p[2]], [p[0], p[2], p[3]]]);
            } else {
                out.extend([[p[0], p[1], p[3]], [p[1], p[2], p[3]]]);
            }
        }
        out
    }

    /// The sum of squares of what distances exceed the calm part of the tolerance by, both ways, at samples; once it is
    /// at least `bound`, anything above.
    pub(super) fn excess(&self, v: u32, points: &[DVec3], bound: f64) -> f64 {
        let triangles = self.triangles_at(v);
        let calm = CALM * self.tolerance;
        let over = |squared: f64| (squared.sqrt() - calm).max(0.0).powi(2);
        let nearest = |p| self.check.surface.bvh().near(p, f64::INFINITY, calm * calm);
        let mut sum = 0.0;
        for &p in points {
            sum += over(distance_squared(p, &triangles));
            if sum >= bound {
                return sum;
            }
        }
        for t in &triangles {
            for [a, b, c] in SAMPLES {
                let p = a * t[0] + b * t[1] + c * t[2];
                sum += nearest(p).map_or(0.0, |c| over(c.nearest.distance_squared));
            }
            if sum >= bound {
                return sum;
            }
        }
        sum
    }
}

/// Where distances are sampled in a triangle: its middle, and its sides.
const SAMPLES: [[f64; 3]; 10] = [
    [1.0 / 3.0, 1.0 / 3.0, 1.0 / 3.0],
    [0.5, 0.5, 0.0],
    [0.0, 0.5, 0.5],
    [0.5, 0.0, 0.5],
    [0.75, 0.25, 0.0],
    [0.25, 0.75, 0.0],
    [0.0, 0.75, 0.25],
    [0.0, 0.25, 0.75],
    [0.75, 0.0, 0.25],
    [0.25, 0.0, 0.75],
];

fn distance_squared(p: DVec3, triangles: &[[DVec3; 3]]) -> f64 {
    triangles.iter().map(|&t| closest_on_triangle(p, t).distance_squared).fold(f64::INFINITY, f64::min)
}
