//! The four cases of the paper: what is done with the face at the head of the queue.

use glam::DVec3;
use smallvec::SmallVec;

use super::surfaces::{Kind, Surfaces};
use super::{Fillets, Fits, SimplifyFitParams};
use crate::mesh::edit::Placement;
use crate::mesh::geometry::{area_vector, aspect_ratio};
use crate::mesh::halfedge::{edge_of, halfedge_of};
use crate::mesh::{EdgeId, FaceId, VertexId};
use crate::technique::aspect_point::AspectPoint;

use crate::technique::dispersion::{amended_length, vertex_dispersion};
use crate::technique::guarded::{GuardedMesh, Merge, StarRules};

/// Positions that get the costly tests, best first.
pub(super) const MOST_TRIED: usize = 2;

/// The most edges at a merged vertex. Tessellations come with more; those stay until something else takes them.
pub(super) const MOST_VALENCE: usize = 14;

/// What was done, by case.
#[derive(Clone, Debug, Default)]
pub(super) struct Done {
    /// By the number of corners above the threshold: face collapses, edge collapses.
    pub(super) cases: [[usize; 2]; 4],
    /// Of the third case: merged onto the end with the larger dispersion.
    pub(super) onto: usize,
    /// Largest distance between a projected point and the plane that it was measured against.
    pub(super) largest_projection: f64,
    /// What the part consisted of before the first edit.
    pub(super) fillets: Vec<Fillets>,
}

/// What became of a face.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Outcome {
    /// Gone; this vertex took its place.
    Merged(VertexId),
    /// Too long for its case at this length.
    TooLong,
    /// Refused by a guard.
    Refused,
}

/// The workshop with what the cases look at.
pub(super) struct Bench<'e, 'a> {
    pub(super) guarded: &'e mut GuardedMesh<'a>,
    pub(super) params: &'e SimplifyFitParams,
    pub(super) surfaces: &'e mut Surfaces,
    pub(super) dispersion: Vec<f32>,
    pub(super) done: Done,
    /// Whether needles may get new vertices.
    pub(super) may_insert: bool,
    /// Positions that get the costly tests.
    pub(super) most_tried: usize,
    /// Whether the tolerance bounds `Err` of a projection only.
    pub(super) plane_tolerance: Option<f64>,
}

impl Bench<'_, '_> {
    pub(super) fn dispersion(&self, v: VertexId) -> f64 {
        f64::from(self.dispersion[v.index()])
    }

    /// Computes the dispersion of a vertex anew.
    pub(super) fn update(&mut self, v: VertexId) {
        let value = vertex_dispersion(self.guarded.mesh(), v, self.params.dispersion) as f32;
        if v.index() >= self.dispersion.len() {
            self.dispersion.resize(v.index() + 1, 0.0);
        }
        self.dispersion[v.index()] = value;
    }

    /// Computes all dispersions anew.
    pub(super) fn update_all(&mut self) {
        let vertices: Vec<VertexId> = self.guarded.mesh().vertices().collect();
        for v in vertices {
            self.update(v);
        }
    }

    /// A vertex that something else moved keeps its fit only where it still lies on it.
    pub(super) fn settle_fit(&mut self, v: VertexId) {
        let at = self.guarded.mesh().point(v);
        let fit = self.surfaces.number(v);
        self.keep_fit(v, at, fit, true);
        let origins = self.surfaces.origins(&[v]);
        self.surfaces.come_from(v, at, origins);
        self.update(v);
    }

    pub(super) fn edge_length(&self, e: EdgeId) -> f64 {
        let mesh = self.guarded.mesh();
        let [a, b] = mesh.ends(e).map(|v| mesh.point(v));
        a.distance(b)
    }

    /// The sides of a face, shortest first; ties by number.
    fn sides(&self, f: FaceId) -> [(f64, EdgeId); 3] {
        let mesh = self.guarded.mesh();
        let h = mesh.face_halfedge(f);
        let mut sides = [h, mesh.next(h), mesh.prev(h)].map(|h| (self.edge_length(edge_of(h)), edge_of(h)));
        sides.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        sides
    }

    /// Equation 6 with the largest dispersion of the corners.
    pub(super) fn amended(&self, f: FaceId) -> f64 {
        let mesh = self.guarded.mesh();
        let [a, b, c] = mesh.corner_points(f);
        let squared = (b - a).length_squared().min((c - b).length_squared()).min((a - c).length_squared());
        let most = mesh.corners(f).into_iter().map(|v| self.dispersion(v)).fold(0.0, f64::max);
        amended_length(squared.sqrt(), most, self.params.k_m)
    }

    /// Does what the case of the face asks for.
    pub(super) fn act(&mut self, f: FaceId, l0: f64, rules: &StarRules) -> Outcome {
        let threshold = self.params.dispersion_threshold.radians();
        let corners = self.guarded.mesh().corners(f);
        let above: SmallVec<[VertexId; 3]> = corners.into_iter().filter(|&v| self.dispersion(v) > threshold).collect();
        let sides = self.sides(f);
        let p = self.params;
        match above.len() {
            0 if self.amended(f) >= p.k1 * l0 => Outcome::TooLong,
            0 => self.flat(f, &sides, p.k1 * l0, rules),
            1 => self.opposite(f, above[0], &sides, l0, rules),
            2 if self.amended(f) >= p.k2 * l0 => Outcome::TooLong,
            2 => self.along(&above, &sides, rules),
            _ if sides[0].0 >= p.k3 * l0 => Outcome::TooLong,
            _ => self.transitional(f, &sides, p.k3 * l0, rules),
        }
    }

    fn is_fine(&self, f: FaceId) -> bool {
        aspect_ratio(self.guarded.mesh().corner_points(f)) <= self.params.fine_aspect
    }

    /// Case 1: a flat area. Where the shortest side may not go, the next one below the same length may.
    fn flat(&mut self, f: FaceId, sides: &[(f64, EdgeId); 3], most: f64, rules: &StarRules) -> Outcome {
        if self.is_fine(f)
            && let Some(v) = self.merge_face(f, rules, false)
        {
            self.done.cases[0][0] += 1;
            return Outcome::Merged(v);
        }
        for &(_, e) in sides.iter().take_while(|&&(length, _)| length < most) {
            if let Some(v) = self.merge_edge(e, rules, false) {
                self.done.cases[0][1] += 1;
                return Outcome::Merged(v);
            }
        }
        Outcome::Refused
    }

    /// Case 2: one corner on a feature, which stays; the side opposite goes.
    fn opposite(
        &mut self,
        f: FaceId,
        corner: VertexId,
        sides: &[(f64, EdgeId); 3],
        l0: f64,
        rules: &StarRules,
    ) -> Outcome {
        let mesh = self.guarded.mesh();
        let first = mesh.face_halfedge(f);
        let h = [first, mesh.next(first), mesh.prev(first)].into_iter().find(|&h| mesh.apex(h) == Some(corner));
        let Some(opposite) = h.map(edge_of) else { return Outcome::Refused };
        let length = self.edge_length(opposite);
        let mut outcome = Outcome::TooLong;
        if length < l0 {
            if let Some(v) = self.merge_edge(opposite, rules, false) {
                self.done.cases[1][1] += 1;
                return Outcome::Merged(v);
            }
            outcome = Outcome::Refused;
        }
        // A side at the feature goes where it is the shorter one by far: onto the feature, which stays.
        let (shortest, e) = sides[0];
        if e != opposite && shortest < 0.5 * l0 {
            if let Some(v) = self.merge_onto(e, corner, rules) {
                self.done.cases[1][1] += 1;
                return Outcome::Merged(v);
            }
            outcome = Outcome::Refused;
        }
        outcome
    }

    /// Case 3: two corners on a feature. Along it with the optimised point, else onto the end that is on it.
    fn along(&mut self, above: &[VertexId], sides: &[(f64, EdgeId); 3], rules: &StarRules) -> Outcome {
        let (_, e) = sides[0];
        let ends = self.guarded.mesh().ends(e);
        if ends.iter().all(|v| above.contains(v)) {
            if let Some(v) = self.merge_edge(e, rules, self.on_surface(ends)) {
                self.done.cases[2][1] += 1;
                return Outcome::Merged(v);
            }
            return Outcome::Refused;
        }
        let [a, b] = ends;
        let stay = if self.dispersion(b) > self.dispersion(a) { b } else { a };
        if let Some(v) = self.merge_onto(e, stay, rules) {
            self.done.cases[2][1] += 1;
            self.done.onto += 1;
            return Outcome::Merged(v);
        }
        Outcome::Refused
    }

    /// Whether both ends lie on accepted fits, which the merged vertex then should not leave.
    fn on_surface(&self, ends: [VertexId; 2]) -> bool {
        ends.iter().all(|&v| self.surfaces.of(v).is_some())
    }

    /// Case 4: a transitional surface, as fillets are: the optimised point goes onto a fit.
    fn transitional(&mut self, f: FaceId, sides: &[(f64, EdgeId); 3], most: f64, rules: &StarRules) -> Outcome {
        if self.is_fine(f)
            && let Some(v) = self.merge_face(f, rules, true)
        {
            self.done.cases[3][0] += 1;
            return Outcome::Merged(v);
        }
        for &(_, e) in sides.iter().take_while(|&&(length, _)| length < most) {
            if let Some(v) = self.merge_edge(e, rules, true) {
                self.done.cases[3][1] += 1;
                return Outcome::Merged(v);
            }
        }
        Outcome::Refused
    }

    fn merge_face(&mut self, f: FaceId, rules: &StarRules, fits: bool) -> Option<VertexId> {
        let merge = self.guarded.plan_face(f, rules).ok()?;
        let corners = self.guarded.mesh().corner_points(f);
        let best = AspectPoint::new(self.guarded.rim()).on_triangle(corners);
        let [a, b, c] = corners;
        let mut wishes: SmallVec<[DVec3; 6]> = SmallVec::from_slice(&[best, (a + b + c) / 3.0, a, b, c]);
        self.sort(&merge, &mut wishes);
        self.place(&merge, &wishes, area_vector(corners), fits.then_some([Kind::Sphere, Kind::Cylinder]))
    }

    fn merge_edge(&mut self, e: EdgeId, rules: &StarRules, fits: bool) -> Option<VertexId> {
        let merge = self.guarded.plan_edge(e, rules).ok()?;
        let mesh = self.guarded.mesh();
        let h = halfedge_of(e);
        let (a, b) = (mesh.point(mesh.origin(h)), mesh.point(mesh.target(h)));
        let t = AspectPoint::new(self.guarded.rim()).on_segment(a, b);
        let normal: DVec3 = mesh
            .ends(e)
            .into_iter()
            .map(|v| mesh.faces_around(v).map(|f| area_vector(mesh.corner_points(f))).sum::<DVec3>())
            .map(DVec3::normalize_or_zero)
            .sum();
        let mut wishes: SmallVec<[DVec3; 6]> =
            [t, 0.0, 0.25, 0.5, 0.75, 1.0].into_iter().map(|t| a + t * (b - a)).collect();
        self.sort(&merge, &mut wishes);
        self.place(&merge, &wishes, normal, fits.then_some([Kind::Cylinder, Kind::Sphere]))
    }

    /// Merges the ends of an edge whatever case they are.
    pub(super) fn merge_any(&mut self, e: EdgeId, rules: &StarRules) -> bool {
        let fits = self.on_surface(self.guarded.mesh().ends(e));
        let Some(v) = self.merge_edge(e, rules, fits) else { return false };
        let ring: SmallVec<[VertexId; 16]> = self.guarded.mesh().neighbours(v).collect();
        self.update(v);
        for w in ring {
            self.update(w);
        }
        true
    }

    /// Merges the ends of an edge where one of them is.
    fn merge_onto(&mut self, e: EdgeId, stay: VertexId, rules: &StarRules) -> Option<VertexId> {
        let merge = self.guarded.plan_edge(e, rules).ok()?;
        let at = self.guarded.mesh().point(stay);
        if merge.placement.nearest(at) != at || self.guarded.rim().count() > MOST_VALENCE {
            return None;
        }
        let (fit, moved) = (self.surfaces.number(stay), self.surfaces.was_moved(stay));
        let origins = self.surfaces.origins(&merge.ends);
        let v = self.guarded.merge(&merge, at).ok()?;
        self.keep_fit(v, at, fit, moved);
        self.surfaces.come_from(v, at, origins);
        Some(v)
    }

    /// Wishes by the least stretch that they give, best first; what freedom fixes is one wish.
    fn sort(&self, merge: &Merge, wishes: &mut SmallVec<[DVec3; 6]>) {
        if let Placement::Fixed(point) = merge.placement {
            wishes.clear();
            wishes.push(point);
            return;
        }
        let mut rated: SmallVec<[(f64, DVec3); 6]> =
            wishes.iter().map(|&p| merge.placement.nearest(p)).map(|p| (self.guarded.stretch_at(p), p)).collect();
        // Stable: of equal ones the optimised point stays first.
        rated.sort_by(|a, b| b.0.total_cmp(&a.0));
        wishes.clear();
        for (_, p) in rated {
            if wishes.last() != Some(&p) {
                wishes.push(p);
            }
        }
        wishes.truncate(self.most_tried);
    }

    /// Puts the merged vertex where the first wish allows, projected onto a fit where one is asked for and found.
    fn place(&mut self, merge: &Merge, wishes: &[DVec3], normal: DVec3, kinds: Option<[Kind; 2]>) -> Option<VertexId> {
        let first = *wishes.first()?;
        if self.guarded.rim().count() > MOST_VALENCE {
            return None;
        }
        // Cheap tests first: a star that no guard will admit needs no fit.
        if self.guarded.stretch_at(first) <= 0.0 {
            return None;
        }
        if merge.placement == Placement::Anywhere
            && let Some(v) = self.place_on_fit(merge, wishes, normal, kinds)
        {
            return Some(v);
        }
        self.place_anywhere(merge, wishes)
    }

    /// Puts the merged vertex onto the fit that all it merges come from, or onto that of a trial.
    fn place_on_fit(
        &mut self,
        merge: &Merge,
        wishes: &[DVec3],
        normal: DVec3,
        kinds: Option<[Kind; 2]>,
    ) -> Option<VertexId> {
        let known = self.surfaces.common(self.guarded.mesh(), &merge.ends);
        for &fit in &known {
            if let Some(v) = self.place_on(fit, merge, wishes, normal) {
                return Some(v);
            }
        }
        if !known.is_empty() {
            return None;
        }
        let quadric = kinds?.into_iter().find_map(|kind| {
            self.allows(kind).then(|| self.surfaces.trial(self.guarded.mesh(), &merge.ends, kind)).flatten()
        })?;
        let fit = self.surfaces.add(quadric);
        self.place_on(fit, merge, wishes, normal)
    }

    fn place_on(&mut self, fit: u32, merge: &Merge, wishes: &[DVec3], normal: DVec3) -> Option<VertexId> {
        let quadric = self.surfaces.quadric(fit);
        let origins = self.surfaces.origins(&merge.ends);
        for &wish in wishes {
            let Some(p) = quadric.project(wish) else { continue };
            let error = (p - wish).dot(normal.normalize_or_zero()).abs();
            if self.plane_tolerance.is_some_and(|most| error > most) {
                continue;
            }
            if let Ok(v) = self.guarded.merge(merge, p) {
                self.done.largest_projection = self.done.largest_projection.max(error);
                self.surfaces.accept(v, fit);
                self.surfaces.come_from(v, p, origins);
                return Some(v);
            }
        }
        None
    }

    /// Puts the merged vertex where the first wish allows, with what it still stands for.
    fn place_anywhere(&mut self, merge: &Merge, wishes: &[DVec3]) -> Option<VertexId> {
        let first = *wishes.first()?;
        let origins = self.surfaces.origins(&merge.ends);
        let kept: SmallVec<[_; 3]> = merge
            .ends
            .iter()
            .map(|&v| {
                let at = self.guarded.mesh().point(v);
                (at, self.surfaces.number(v), self.surfaces.was_moved(v))
            })
            .collect();
        // What the collapsed edge or face allows no more, a place above it may: chords of a round face sink into it.
        let above = |guarded: &GuardedMesh<'_>| guarded.optimum(merge, first);
        for at in 0..=wishes.len() {
            let Some(wish) = wishes.get(at).copied().or_else(|| above(self.guarded)) else { break };
            let Ok(v) = self.guarded.merge(merge, wish) else { continue };
            let at = self.guarded.mesh().point(v);
            let stayed = kept.into_iter().find(|kept| kept.0 == at);
            let (_, fit, moved) = stayed.unwrap_or((at, None, true));
            let fit = fit.or_else(|| origins.iter().copied().find(|&fit| self.surfaces.holds(fit, at)));
            self.keep_fit(v, at, fit, moved);
            self.surfaces.come_from(v, at, origins);
            return Some(v);
        }
        None
    }

    /// A vertex that stays where it was keeps its fit; any other one has none.
    fn keep_fit(&mut self, v: VertexId, at: DVec3, fit: Option<u32>, moved: bool) {
        let stays = fit.filter(|&fit| self.surfaces.holds(fit, at));
        self.surfaces.carry(v, stays, moved && stays.is_none());
    }

    fn allows(&self, kind: Kind) -> bool {
        match self.params.fit {
            Fits::Both => true,
            Fits::None => false,
            Fits::Sphere => kind == Kind::Sphere,
            Fits::Cylinder => kind == Kind::Cylinder,
        }
    }
}
