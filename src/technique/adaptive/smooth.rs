//! Vertices moved: to the middle of their stars, then to where the faces about them are worth most.
//!
//! The second follows K. Hu, D.-M. Yan, D. Bommes, P. Alliez, B. Benes. Error-Bounded and Feature Preserving Surface
//! Remeshing with Minimal Angle Improvement. TVCG 23(12), 2017, in looking at the poorest faces first.

use glam::DVec3;
use smallvec::SmallVec;

use super::work::{Care, Corners, Faces, Work, stretch};
use crate::mesh::edit::{relocate, slide};
use crate::mesh::geometry::area_vector;
use crate::mesh::{FaceId, Freedom, VertexId};

/// A move to the middle need not leave more than this stretch.
const ENOUGH: f64 = 0.5;
/// Shares of the way to the middle.
const SHARES: [f64; 2] = [1.0, 0.5];
/// Shares of the shortest edge that a search for a better place goes.
const STEPS: [f64; 3] = [0.25, 0.1, 0.04];
/// Directions that it tries.
const COMPASS: [(f64, f64); 6] =
    [(1.0, 0.0), (0.5, SIN_60), (-0.5, SIN_60), (-1.0, 0.0), (-0.5, -SIN_60), (0.5, -SIN_60)];
const SIN_60: f64 = 0.866_025_403_784_438_6;
/// What a move must gain.
const LITTLE: f64 = 1e-3;
/// Stars whose faces are worth this in the mean are left alone.
const WELL: f64 = 0.985;
/// Faces below this stretch are poor, and how much more that counts.
const POOR: f64 = 0.55;
const LACK: f64 = 3.0;
/// The normal below a foot and that of the star differ by less than this (the cosine): else the foot lies on another
/// side of the body.
const SAME_SIDE: f64 = 0.3;

/// What a face of this stretch is worth: poor ones lower a sum more than good ones raise it.
pub(super) fn worth(stretch: f64) -> f64 {
    stretch - LACK * (POOR - stretch).max(0.0)
}

/// The sides opposite a vertex.
type Sides = SmallVec<[[DVec3; 2]; 12]>;

/// What the star of a vertex at `p` is worth.
fn worth_at(p: DVec3, sides: &[[DVec3; 2]]) -> f64 {
    sides.iter().map(|&[a, b]| worth(stretch([p, a, b]))).sum()
}

impl Work<'_> {
    /// Moves every vertex to the middle of its star.
    pub(super) fn smooth(&mut self) {
        for v in self.awake_vertices() {
            match self.mesh.vertex_freedom(v) {
                Freedom::Free if !self.mesh.is_boundary_vertex(v) => self.centre(v),
                Freedom::OnCurve => self.even(v),
                Freedom::Free | Freedom::Keep => {}
            }
        }
    }

    fn centre(&mut self, v: VertexId) {
        let at = self.point(v);
        let Some((step, normal)) = self.towards_middle(v) else { return };
        let least = self.least_at(v, at).min(ENOUGH);
        for share in SHARES {
            let foot = self.project(at + share * step, v);
            let is_here = self.reference.normal(foot.face).dot(normal) > SAME_SIDE;
            if is_here && self.move_to(v, foot.point, foot.face, least) {
                return;
            }
        }
    }

    /// The way to the middle of the star in its tangent plane, where faces that are wanted smaller weigh more, and the
    /// normal of that.
    fn towards_middle(&self, v: VertexId) -> Option<(DVec3, DVec3)> {
        let at = self.point(v);
        let (mut centre, mut normal, mut weights) = (DVec3::ZERO, DVec3::ZERO, 0.0);
        for f in self.mesh.faces_around(v) {
            let ids = self.mesh.corners(f);
            let corners = ids.map(|w| self.point(w));
            let vector = area_vector(corners);
            let size = ids.iter().map(|&w| self.sizing.at(w)).sum::<f64>();
            let weight = vector.length() / (size * size);
            centre += weight * ((corners[0] - at) + (corners[1] - at) + (corners[2] - at)) / 3.0;
            normal += vector;
            weights += weight;
        }
        let normal = normal.try_normalize().filter(|_| weights > 0.0)?;
        let step = centre / weights;
        Some((step - normal * normal.dot(step), normal))
    }

    /// Moves a vertex along its curve to the middle of its neighbours there, nearer to where edges are wanted shorter.
    fn even(&mut self, v: VertexId) {
        let Some([a, b]) = self.curve_neighbours(v) else { return };
        let (p, q) = (self.point(a), self.point(b));
        let [s, t] = [a, b].map(|w| self.sizing.at(v) + self.sizing.at(w));
        let middle = p + s / (s + t) * (q - p);
        let least = self.least_at(v, self.point(v)).min(ENOUGH);
        if let Some(to) = self.reference.curves.project(middle) {
            self.slide_to(v, to, least);
        }
    }

    /// Moves a free vertex where no face folds or falls below the least stretch.
    pub(super) fn move_to(&mut self, v: VertexId, to: DVec3, foot: FaceId, least: f64) -> bool {
        if !self.may_go(v, to, least) || relocate(&mut self.mesh, v, to).is_err() {
            return false;
        }
        self.feet[v.index()] = foot;
        self.tally.moves += 1;
        true
    }

    /// The same along a curve, where that stays near the reference's.
    pub(super) fn slide_to(&mut self, v: VertexId, to: DVec3, least: f64) -> bool {
        let Some(ends) = self.curve_neighbours(v) else { return false };
        let near = ends.iter().all(|&w| self.reference.curves.admit([to, self.point(w)]));
        if !near || !self.may_go(v, to, least) || slide(&mut self.mesh, v, to).is_err() {
            return false;
        }
        self.feet[v.index()] = self.project(to, v).face;
        self.tally.moves += 1;
        true
    }

    fn may_go(&self, v: VertexId, to: DVec3, least: f64) -> bool {
        let all: Faces = self.mesh.faces_around(v).collect();
        let longest = self.mesh.neighbours(v).map(|w| self.point(w).distance(to)).fold(0.0, f64::max);
        let was_longer = |w: VertexId| self.point(w).distance(self.point(v)) >= longest;
        if longest > self.rules.longest && !self.mesh.neighbours(v).any(was_longer) {
            return false;
        }
        let new: SmallVec<[Corners; 16]> = all.iter().map(|&f| self.moved(f, v, to)).collect();
        all.iter().zip(&new).all(|(&f, &new)| stretch(new) >= least && !self.folds(f, &all, new))
            && (self.care != Care::Samples || self.is_near(&all, &new, v))
    }

    /// Moves every vertex to where the faces round it are worth most. Returns how many moved.
    pub(super) fn improve(&mut self) -> usize {
        let mut moved = 0;
        for v in self.awake_vertices() {
            let gained = match self.mesh.vertex_freedom(v) {
                Freedom::Free if !self.mesh.is_boundary_vertex(v) => self.improve_free(v),
                Freedom::OnCurve => self.improve_on_curve(v),
                Freedom::Free | Freedom::Keep => false,
            };
            moved += usize::from(gained);
        }
        moved
    }

    fn sides_round(&self, v: VertexId) -> Sides {
        let side = |h| {
            let next = self.mesh.next(h);
            [self.mesh.origin(next), self.mesh.target(next)].map(|w| self.point(w))
        };
        self.mesh.outgoing(v).filter(|&h| self.mesh.face(h).is_some()).map(side).collect()
    }

    fn improve_free(&mut self, v: VertexId) -> bool {
        let (at, sides) = (self.point(v), self.sides_round(v));
        let before = worth_at(at, &sides);
        if before > WELL * sides.len() as f64 {
            return false;
        }
        let Some(normal) = self.normal_at(v).try_normalize() else { return false };
        let shortest = sides.iter().map(|side| side[0].distance(at)).fold(f64::INFINITY, f64::min);
        let across = normal.any_orthonormal_vector();
        let along = normal.cross(across);
        let places = |step: f64| COMPASS.map(|(cos, sin)| step * shortest * (cos * across + sin * along));
        let (best, reached) = climb(at, before, &sides, places);
        if reached <= before + LITTLE {
            return false;
        }
        let foot = self.project(best, v);
        self.reference.normal(foot.face).dot(normal) > SAME_SIDE
            && worth_at(foot.point, &sides) > before + LITTLE
            && self.move_to(v, foot.point, foot.face, 0.0)
    }

    fn improve_on_curve(&mut self, v: VertexId) -> bool {
        let Some(ends) = self.curve_neighbours(v) else { return false };
        let (at, sides) = (self.point(v), self.sides_round(v));
        let before = worth_at(at, &sides);
        let ways = ends.map(|w| self.point(w) - at);
        let (best, reached) = climb(at, before, &sides, |step| ways.map(|way| step * way));
        if reached <= before + LITTLE {
            return false;
        }
        let Some(to) = self.reference.curves.project(best) else { return false };
        worth_at(to, &sides) > before + LITTLE && self.slide_to(v, to, 0.0)
    }
}

/// The best place found by ever shorter steps, and what the star is worth there.
fn climb<const N: usize>(
    at: DVec3,
    before: f64,
    sides: &[[DVec3; 2]],
    steps: impl Fn(f64) -> [DVec3; N],
) -> (DVec3, f64) {
    let (mut best, mut reached) = (at, before);
    for share in STEPS {
        let from = best;
        for step in steps(share) {
            let value = worth_at(from + step, sides);
            if value > reached {
                (best, reached) = (from + step, value);
            }
        }
    }
    (best, reached)
}
