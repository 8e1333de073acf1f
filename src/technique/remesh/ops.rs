//! Flip, split and relocation under the same guards as a collapse.

use glam::DVec3;

use crate::mesh::edit::{check_flip, check_split, flip, relocate, slide, split};
use crate::mesh::geometry::{area_vector, closest_on_segment, stretch, triangle_size};
use crate::mesh::halfedge::{edge_of, halfedge_of, twin};
use crate::mesh::{EdgeId, FaceId, Freedom, HalfedgeId, VertexId};
use crate::technique::collapse::limits::least_stretch;
use crate::technique::collapse::priority::Tally;
use crate::technique::collapse::{Editor, Keeper};

/// Without a certified distance, an edge is flipped only where its faces differ by less than 5 degrees.
const FLAT_COSINE: f64 = 0.996;

/// When an edit is worth it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Gain {
    /// The faces come nearer to this stretch: see [`Tally::mends`].
    Mend(f64),
    /// The least stretch rises.
    LeastStretch,
    /// The smallest angle rises: in a plane such flips end in the Delaunay triangulation.
    LeastAngle,
    /// The product of least and mean stretch rises, and the least does not fall below the threshold.
    Quality,
    /// The mean stretch rises, and no face falls below this stretch that was not.
    Mean(f64),
    /// Nothing asked, except that no face falls below this stretch that was not.
    Keep(f64),
    /// Nothing asked, except that no face falls below the threshold.
    None,
}

/// What a split may leave of a stretch that is below the threshold already.
const SPLIT_LOSS: f64 = 0.25;

impl Editor<'_> {
    /// Flips the edge where all tests admit it and it gains.
    pub fn try_flip(&mut self, edge: EdgeId, gain: Gain) -> bool {
        let Ok(plan) = check_flip(&self.mesh, edge) else { return false };
        let h = halfedge_of(edge);
        let (Some(left), Some(right)) = (self.mesh.face(h), self.mesh.face(twin(h))) else { return false };
        if !self.flip_keeps_valence(plan.ends, plan.apexes, gain) {
            return false;
        }
        let before = self.tally(&[left, right], gain);
        self.patch.clear();
        self.patch.old.extend([left, right]);
        self.patch.ids.extend([left, right]);
        for corners in plan.new_faces() {
            let points = corners.map(|v| self.mesh.point(v));
            self.patch.points.push(points);
        }
        self.patch.is_same = self.is_plane(left, right);
        let normals = [left, right].map(|f| area_vector(self.mesh.corner_points(f)));
        let flat = normals[0].dot(normals[1]) >= FLAT_COSINE * (normals[0].length() * normals[1].length());
        if !(flat || self.keeper.is_certified()) || !self.gains(&before, gain) || self.flip_folds(normals) {
            return false;
        }
        if !self.patch_admitted() {
            return false;
        }
        flip(&mut self.mesh, &plan);
        self.counts.flips += 1;
        self.settle();
        true
    }

    /// Valences move towards 6, or at least no apex gets more edges than allowed.
    fn flip_keeps_valence(&self, ends: [VertexId; 2], apexes: [VertexId; 2], gain: Gain) -> bool {
        let valence = |v: VertexId| self.mesh.valence(v) as i64;
        let least = |v: VertexId| if self.mesh.is_boundary_vertex(v) { 2 } else { 3 };
        if ends.iter().any(|&v| valence(v) <= least(v)) {
            return false;
        }
        let most = self.limits.max_valence as i64;
        let tallest = ends.map(valence).into_iter().max().unwrap_or(0);
        let is_worth_it = match gain {
            Gain::Mend(_) | Gain::LeastStretch | Gain::LeastAngle => true,
            Gain::Quality | Gain::Mean(_) | Gain::Keep(_) | Gain::None => false,
        };
        is_worth_it && apexes.iter().all(|&v| valence(v) < most.max(tallest))
            || apexes.iter().all(|&v| valence(v) < most)
    }

    /// Whether two faces lie in one plane, by far nearer than the tolerance: then a flip that does not fold leaves the
    /// surface as it is, as a set of points.
    pub fn is_plane(&self, left: FaceId, right: FaceId) -> bool {
        let Keeper::Distance { envelope, .. } = &self.keeper else { return false };
        let (near, faces) = (1e-6 * envelope.reach(), [left, right].map(|f| self.mesh.corner_points(f)));
        let vectors = faces.map(area_vector);
        let large = usize::from(vectors[1].length_squared() > vectors[0].length_squared());
        let Some(normal) = vectors[large].try_normalize() else { return false };
        faces[1 - large].iter().all(|&p| normal.dot(p - faces[large][0]).abs() <= near)
    }

    /// Whether a new face of a flip turns away from both old ones.
    fn flip_folds(&self, old: [DVec3; 2]) -> bool {
        let sum = old[0].normalize_or_zero() + old[1].normalize_or_zero();
        self.patch.points.iter().any(|points| {
            let normal = area_vector(*points);
            let cosine = |m: DVec3| normal.dot(m) / (normal.length() * m.length()).max(f64::MIN_POSITIVE);
            cosine(sum) < std::f64::consts::FRAC_1_SQRT_2
        })
    }

    /// Splits the edge at `at` where all tests admit it, and no face falls below the least stretch. Where one is there
    /// already, the halves may be a little worse, since more can be done with them; not beside kept edges, where
    /// nothing can, and the losses of single splits multiply.
    pub fn try_split(&mut self, edge: EdgeId, at: DVec3) -> Option<VertexId> {
        let plan = check_split(&self.mesh, edge).ok()?;
        let h = halfedge_of(edge);
        let [i, j] = plan.ends;
        let at = if plan.is_curve {
            crate::mesh::edit::Placement::Segment(self.mesh.point(i), self.mesh.point(j)).nearest(at)
        } else {
            at
        };
        self.patch.clear();
        let first_new = self.mesh.face_slots();
        let mut later = Vec::with_capacity(2);
        for side in [h, twin(h)] {
            let (Some(face), Some(apex)) = (self.mesh.face(side), self.mesh.apex(side)) else { continue };
            if self.mesh.valence(apex) >= self.limits.max_valence {
                return None;
            }
            let (from, to) = (self.mesh.origin(side), self.mesh.target(side));
            let point = |v: VertexId| self.mesh.point(v);
            self.patch.old.push(face);
            // The half at the first end keeps the face's number.
            let halves = [[from, to, apex].map(point), [from, to, apex].map(point)];
            let [mut near, mut far] = halves;
            near[1] = at;
            far[0] = at;
            let (kept, new) = if from == i { (near, far) } else { (far, near) };
            self.patch.ids.push(face);
            self.patch.points.push(kept);
            later.push((FaceId::new(first_new + later.len()), new));
        }
        for (id, points) in later {
            self.patch.ids.push(id);
            self.patch.points.push(points);
        }
        let [p, q] = [i, j].map(|v| self.mesh.point(v));
        self.patch.is_same = closest_on_segment(at, [p, q]).distance_squared <= 1e-24 * p.distance_squared(q);
        if !self.split_keeps_stretch() || self.split_folds() || !self.patch_admitted() {
            return None;
        }
        let v = split(&mut self.mesh, &plan, at);
        self.found_quadric(v);
        self.counts.splits += 1;
        self.settle();
        Some(v)
    }

    /// Whether an edge of the face must stay as it is, so that nothing can be mended there.
    fn is_beside_kept(&self, face: FaceId) -> bool {
        let first = self.mesh.face_halfedge(face);
        let sides = [first, self.mesh.next(first), self.mesh.prev(first)];
        sides.iter().any(|&side| self.mesh.edge_freedom(edge_of(side)) == Freedom::Keep)
    }

    fn split_keeps_stretch(&self) -> bool {
        let before = self.patch.old.iter().map(|&f| self.stretch(f)).fold(f64::INFINITY, f64::min);
        let limit = self.limits.min_stretch;
        let floor = least_stretch(limit, before);
        let may_lose = floor < limit && !self.patch.old.iter().any(|&face| self.is_beside_kept(face));
        let floor = if may_lose { SPLIT_LOSS * floor } else { floor };
        self.patch.points.iter().all(|points| stretch(*points) >= floor)
    }

    fn split_folds(&self) -> bool {
        let patch = &self.patch;
        let count = patch.old.len();
        patch.points.iter().enumerate().any(|(at, points)| {
            let old = area_vector(self.mesh.corner_points(patch.old[at % count]));
            let new = area_vector(*points);
            let scale = (old.length_squared() * new.length_squared()).sqrt();
            old.length_squared() > 0.0 && new.dot(old) < std::f64::consts::FRAC_1_SQRT_2 * scale
        })
    }

    /// Moves a vertex, on a curve along it, where all tests admit it and it gains.
    pub fn try_move(&mut self, v: VertexId, to: DVec3, gain: Gain) -> bool {
        let may = match self.mesh.vertex_freedom(v) {
            Freedom::Free => self.quadrics_admit(v, to),
            Freedom::OnCurve => self.may_slide(v, to),
            Freedom::Keep => false,
        };
        if !may || !to.is_finite() {
            return false;
        }
        self.patch.clear();
        for f in self.mesh.faces_around(v) {
            let corners = self.mesh.corners(f);
            self.patch.old.push(f);
            self.patch.ids.push(f);
            self.patch.points.push(corners.map(|w| if w == v { to } else { self.mesh.point(w) }));
        }
        let before = self.tally(&self.patch.old, gain);
        if !self.gains(&before, gain) || self.folds() || !self.patch_admitted() {
            return false;
        }
        let moved = match self.mesh.vertex_freedom(v) {
            Freedom::OnCurve => slide(&mut self.mesh, v, to),
            Freedom::Free | Freedom::Keep => relocate(&mut self.mesh, v, to),
        };
        if moved.is_err() {
            return false;
        }
        self.counts.moves += 1;
        self.settle();
        true
    }

    /// Whether the curve through the vertex stays near the reference's curves when it goes to `to`.
    fn may_slide(&self, v: VertexId, to: DVec3) -> bool {
        let Keeper::Distance { curves, .. } = &self.keeper else { return false };
        self.curve_neighbours(v).is_some_and(|ends| ends.iter().all(|&w| curves.admit([to, self.mesh.point(w)])))
    }

    /// The neighbours of a vertex along its only curve.
    pub fn curve_neighbours(&self, v: VertexId) -> Option<[VertexId; 2]> {
        let is_curve = |h: &HalfedgeId| self.mesh.edge_freedom(edge_of(*h)) != Freedom::Free;
        let mut ends = self.mesh.outgoing(v).filter(is_curve).map(|h| self.mesh.target(h));
        let pair = [ends.next()?, ends.next()?];
        ends.next().is_none().then_some(pair)
    }

    /// The tally of live faces.
    fn tally(&self, faces: &[FaceId], gain: Gain) -> Tally {
        let mut tally = match gain {
            Gain::Mend(threshold) => Tally::short_of(threshold),
            Gain::LeastStretch | Gain::LeastAngle | Gain::Quality | Gain::Mean(_) | Gain::Keep(_) | Gain::None => {
                Tally::new()
            }
        };
        for &f in faces {
            tally.add(self.stretch(f), self.size(f));
        }
        tally
    }

    /// Whether the patch is worth it, and breaks no threshold that held.
    fn gains(&self, before: &Tally, gain: Gain) -> bool {
        let mut after = Tally::short_of(before.threshold);
        let limit = &self.limits.max_size;
        for points in &self.patch.points {
            let size = triangle_size(*points);
            if !limit.is_unlimited() && size > self.limits.ceiling(points[0], before.size_max) {
                return false;
            }
            after.add(stretch(*points), size);
        }
        let floor = least_stretch(self.limits.min_stretch, before.stretch_min);
        match gain {
            Gain::Mend(_) => {
                after.stretch_min >= least_stretch(before.threshold, before.stretch_min) && after.mends(before)
            }
            Gain::LeastStretch => after.stretch_min > before.stretch_min * (1.0 + 1e-3),
            Gain::LeastAngle => {
                let old = self.patch.old.iter().map(|&f| least_sine(self.mesh.corner_points(f)));
                let new = self.patch.points.iter().map(|&points| least_sine(points));
                after.stretch_min >= floor && new.fold(1.0, f64::min) > old.fold(1.0, f64::min) * (1.0 + 1e-6)
            }
            Gain::Quality => after.stretch_min >= floor && after.quality() > before.quality() * (1.0 + 2e-3),
            Gain::Mean(least) => {
                after.stretch_min >= least_stretch(least, before.stretch_min).max(floor)
                    && after.mean() > before.mean() * (1.0 + 1e-3)
            }
            Gain::Keep(least) => after.stretch_min >= least_stretch(least, before.stretch_min).max(floor),
            Gain::None => after.stretch_min >= floor,
        }
    }
}

/// The sine of the smallest angle: twice the area over the product of the two longer sides.
fn least_sine([a, b, c]: [DVec3; 3]) -> f64 {
    let squares = [(b - a).length_squared(), (c - b).length_squared(), (a - c).length_squared()];
    let [x, y, z] = squares;
    let longer = (x * y).max(y * z).max(z * x);
    if longer > 0.0 { ((b - a).cross(c - a).length_squared() / longer).sqrt() } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::halfedge::tests::{enter, surface};
    use crate::technique::collapse::limits::{Limits, SizeField};

    /// Two faces over an edge, and a third one so near that a new corner beside the edge would lie past it.
    fn split_under(ceiling: [[f64; 3]; 3]) -> Option<VertexId> {
        let low = [[0.0; 3], [1.0, 0.0, 0.0], [0.5, 1.0, 0.0], [0.5, -1.0, 0.0]];
        let mesh = enter(&surface(&[&low[..], &ceiling].concat(), &[[0, 1, 2], [1, 0, 3], [4, 5, 6]]));
        let shared = mesh.edges().find(|&e| !mesh.is_boundary_edge(e)).expect("the two faces share an edge");
        let limits = Limits { min_stretch: 0.0, max_size: SizeField::Uniform(f64::INFINITY), max_valence: 9 };
        let mut editor = Editor::new(mesh, Keeper::QuadricRms { most: 1.0 }, limits, 1.0);
        editor.try_split(shared, DVec3::new(0.5, 0.0, 1e-13))
    }

    #[test]
    fn a_rounded_corner_does_not_pierce_the_other_side() {
        let above = |z: f64| [[0.4, -0.1, z], [2.0, -0.1, z], [0.5, 0.2, z]];
        assert_eq!(split_under(above(1e-14)), None);
        assert!(split_under(above(1e-12)).is_some(), "out of reach");
        let through = [[0.4, 0.1, -1.0], [0.6, 0.1, -1.0], [0.5, 0.1, 1.0]];
        assert!(split_under(through).is_some(), "the faces met before");
    }
}
