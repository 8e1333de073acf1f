//! Vertices moved: to the middle of their stars, then to where the faces about them are worth most.
//!
//! The second follows K. Hu, D.-M. Yan, D. Bommes, P. Alliez, B. Benes. Error-Bounded and Feature Preserving Surface
//! Remeshing with Minimal Angle Improvement. TVCG 23(12), 2017, in looking at the poorest faces first.

use glam::DVec3;
use smallvec::SmallVec;

use super::ahead::Near;
use super::order::scattered;
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

/// Vertices farther off than this part of the tolerance go back, and leave no face below this stretch.
const OFF: f64 = 0.3;
const SPOILT: f64 = 0.02;

/// Where a vertex may go, and the face of the reference there.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    pub(super) at: DVec3,
    pub(super) foot: FaceId,
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
        self.move_in_turn(self.awake_vertices(), Self::centred, Self::evened);
    }

    /// Puts vertices that lie off the reference back on it, at the cost of shapes: halves of edges that cut a corner
    /// stay behind where faces would have turned.
    pub(super) fn settle(&mut self) {
        let squared = (OFF * self.rules.tolerance).powi(2);
        let look = |work: &Self, v: VertexId| {
            let is_inner = work.mesh.vertex_freedom(v) == Freedom::Free && !work.mesh.is_boundary_vertex(v);
            let foot =
                is_inner.then(|| work.project(work.point(v), v)).filter(|foot| foot.distance_squared > squared)?;
            (work.reference.normal(foot.face).dot(work.normal_at(v)) > 0.0).then_some(foot)
        };
        let care = std::mem::replace(&mut self.care, Care::Sizes);
        let near = |_: &Self, v: VertexId| Near::from_slice(&[v]);
        self.in_turn(&scattered(self.awake_vertices()), near, look, |work, v, foot| {
            work.move_to(v, foot.point, foot.face, SPOILT);
        });
        self.care = care;
    }

    /// Moves vertices to where one search or the other, for those on curves, says. Returns how many.
    fn move_in_turn(
        &mut self,
        vertices: Vec<VertexId>,
        free: impl Fn(&Self, VertexId) -> Option<Place> + Sync,
        on_curve: impl Fn(&Self, VertexId) -> Option<Place> + Sync,
    ) -> usize {
        let look = |work: &Self, v: VertexId| match work.mesh.vertex_freedom(v) {
            Freedom::Free if !work.mesh.is_boundary_vertex(v) => free(work, v),
            Freedom::OnCurve => on_curve(work, v),
            Freedom::Free | Freedom::Keep => None,
        };
        let mut moved = 0;
        let near = |_: &Self, v: VertexId| Near::from_slice(&[v]);
        self.in_turn(&scattered(vertices), near, look, |work, v, place| moved += usize::from(work.go_to(v, place)));
        moved
    }

    fn centred(&self, v: VertexId) -> Option<Place> {
        let at = self.point(v);
        let (step, normal) = self.towards_middle(v)?;
        let least = self.least_at(v, at).min(ENOUGH);
        SHARES.into_iter().find_map(|share| {
            let foot = self.project(at + share * step, v);
            let is_here = self.reference.normal(foot.face).dot(normal) > SAME_SIDE;
            (is_here && self.may_go(v, foot.point, least)).then_some(Place { at: foot.point, foot: foot.face })
        })
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
    fn evened(&self, v: VertexId) -> Option<Place> {
        let [a, b] = self.curve_neighbours(v)?;
        let (p, q) = (self.point(a), self.point(b));
        let [s, t] = [a, b].map(|w| self.sizing.at(v) + self.sizing.at(w));
        let middle = p + s / (s + t) * (q - p);
        let least = self.least_at(v, self.point(v)).min(ENOUGH);
        self.place_on_curve(v, self.reference.curves.project(middle)?, least)
    }

    /// Moves a free vertex where no face folds or falls below the least stretch.
    pub(super) fn move_to(&mut self, v: VertexId, to: DVec3, foot: FaceId, least: f64) -> bool {
        self.may_go(v, to, least) && self.go_to(v, Place { at: to, foot })
    }

    /// Moves a vertex to a place that was found fit for it.
    pub(super) fn go_to(&mut self, v: VertexId, place: Place) -> bool {
        let done = match self.mesh.vertex_freedom(v) {
            Freedom::OnCurve => slide(&mut self.mesh, v, place.at).is_ok(),
            Freedom::Free | Freedom::Keep => relocate(&mut self.mesh, v, place.at).is_ok(),
        };
        if done {
            self.feet[v.index()] = place.foot;
            self.tally.moves += 1;
        }
        done
    }

    /// The same along a curve, where that stays near the reference's.
    pub(super) fn slide_to(&mut self, v: VertexId, to: DVec3, least: f64) -> bool {
        self.place_on_curve(v, to, least).is_some_and(|place| self.go_to(v, place))
    }

    /// A place for a vertex of a curve, where that stays near the reference's.
    fn place_on_curve(&self, v: VertexId, to: DVec3, least: f64) -> Option<Place> {
        let ends = self.curve_neighbours(v)?;
        let near = ends.iter().all(|&w| self.reference.curves.admit([to, self.point(w)]));
        (near && self.may_go(v, to, least)).then(|| Place { at: to, foot: self.project(to, v).face })
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
        let mut quiet = std::mem::take(&mut self.quiet_vertices);
        let restless = quiet.restless(self.awake_vertices(), |v| self.state(&[v]));
        let vertices = restless.iter().map(|&(v, _)| v).collect();
        let moved = self.move_in_turn(vertices, Self::better_place, Self::better_place_on_curve);
        quiet.remember(&restless, |v| self.state(&[v]));
        self.quiet_vertices = quiet;
        moved
    }

    fn sides_round(&self, v: VertexId) -> Sides {
        let side = |h| {
            let next = self.mesh.next(h);
            [self.mesh.origin(next), self.mesh.target(next)].map(|w| self.point(w))
        };
        self.mesh.outgoing(v).filter(|&h| self.mesh.face(h).is_some()).map(side).collect()
    }

    fn better_place(&self, v: VertexId) -> Option<Place> {
        let (at, sides) = (self.point(v), self.sides_round(v));
        let before = worth_at(at, &sides);
        if before > WELL * sides.len() as f64 {
            return None;
        }
        let normal = self.normal_at(v).try_normalize()?;
        let shortest = sides.iter().map(|side| side[0].distance(at)).fold(f64::INFINITY, f64::min);
        let across = normal.any_orthonormal_vector();
        let along = normal.cross(across);
        let places = |step: f64| COMPASS.map(|(cos, sin)| step * shortest * (cos * across + sin * along));
        let (best, reached) = climb(at, before, &sides, places);
        if reached <= before + LITTLE {
            return None;
        }
        let foot = self.project(best, v);
        let gains = self.reference.normal(foot.face).dot(normal) > SAME_SIDE
            && worth_at(foot.point, &sides) > before + LITTLE
            && self.may_go(v, foot.point, 0.0);
        gains.then_some(Place { at: foot.point, foot: foot.face })
    }

    fn better_place_on_curve(&self, v: VertexId) -> Option<Place> {
        let ends = self.curve_neighbours(v)?;
        let (at, sides) = (self.point(v), self.sides_round(v));
        let before = worth_at(at, &sides);
        let ways = ends.map(|w| self.point(w) - at);
        let (best, reached) = climb(at, before, &sides, |step| ways.map(|way| step * way));
        if reached <= before + LITTLE {
            return None;
        }
        let to = self.reference.curves.project(best)?;
        if worth_at(to, &sides) <= before + LITTLE {
            return None;
        }
        self.place_on_curve(v, to, 0.0)
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
