//! Certified two-sided distance: no edit takes the surface further than the tolerance from the reference, or leaves a
//! part of the reference further than that from the surface.
//!
//! The set of points within `ε` of a triangle is convex. So a triangle whose three corners lie within `ε` of one
//! triangle lies within `ε` of it as a whole.
//! - **Reference to surface.** The reference is cut into pieces; each is owned by one live face, in whose offset its
//!   corners lie. An edit must find an owner among the new faces, or those next to them, for every piece of the faces
//!   that it replaces (`cover`).
//! - **Surface to reference.** Each face has a bound of its distance, to which an edit adds how far it moves the
//!   surface (`drift`): no look at the reference while that is within the tolerance. Else the new face is cut along the
//!   sides of the triangles of the reference that lie under it, found by their box hierarchy, until every part lies in
//!   the offset of one of them, or within `ε` by the Lipschitz bound of its middle.
//!
//! Both are local and exact up to rounding, for which 2 % of the tolerance are held back; so the surface as a whole
//! keeps the tolerance at every moment. Where the input broke it at the beginning, no edit makes that worse.
//! Related: Hu et al., Error-Bounded and Feature Preserving Surface Remeshing with Minimal Angle Improvement, TVCG
//! 2017, which bounds samples; pieces need no sampling density, and a flat part needs few. Cost: about as many parts as
//! triangles of one surface lie under a face of the other.

use glam::DVec3;

use super::clip::{self, Convex};
use super::cover::{Change, Cover, Reach};
use super::drift::Drift;
use super::target::{Target, Triangle};
use crate::mesh::bvh::TriangleBvh;
use crate::mesh::geometry::closest_on_triangle;
use crate::mesh::halfedge::HalfedgeMesh;
use crate::mesh::{FaceId, Surface};

/// Held back for rounding, and so that the next step with the same tolerance finds room.
const MARGIN: f64 = 0.98;

/// Parts are cut down to this part of the tolerance.
const FINEST: f64 = 1.0 / 16.0;

/// Parts that one check may look at before it gives up and refuses the edit.
const CHECK_BUDGET: usize = 3000;

/// And that the last check of a face may look at, which is made once.
const CERTIFY_BUDGET: usize = 1_000_000;

/// A bound up to this part of the tolerance decides. Between it and the tolerance the full test does, which may refuse
/// what comes that near, as parts do not get finer than [`FINEST`]: so a face's past does not decide what is admitted.
const SURE: f64 = 1.0 - 2.0 * FINEST;

/// How far faces that count as the same set of points may be apart, as a part of the tolerance.
const SAME: f64 = 2e-6;

/// The tolerance zone of a reference, and who covers which piece of it.
#[derive(Debug)]
pub(in crate::technique::guarded) struct Envelope<'a> {
    reference: &'a Surface,
    tree: &'a TriangleBvh,
    reach: f64,
    finest: f64,
    cover: Cover<'a>,
    /// A bound of the distance of each live face from the reference; infinite where none is known.
    strays: Vec<f32>,
    drift: Drift,
    /// Whether the mesh began as the reference and all edits since were bounded by how far they moved the surface.
    is_traced: bool,
    /// Whether the last edit tested was.
    follows: bool,
    /// The bounds of the faces of the last edit tested: old ones, and new ones.
    known: Vec<f64>,
    found: Vec<f64>,
    hint: usize,
    parts: Vec<Convex>,
}

impl<'a> Envelope<'a> {
    /// The zone of `tolerance` round the reference, covered by the faces of `mesh`, whose hierarchy is `own`; without
    /// one, the mesh is the reference, face by face.
    pub(in crate::technique::guarded) fn new(
        reference: &'a Surface,
        tree: &'a TriangleBvh,
        tolerance: f64,
        mesh: &HalfedgeMesh,
        own: Option<&TriangleBvh>,
    ) -> Self {
        let reach = MARGIN * tolerance;
        let finest = FINEST * reach;
        let slots = mesh.face_slots();
        let (cover, stray) = match own {
            Some(own) => (Cover::new(reference, mesh, own, Reach { reach, finest }, tolerance), f32::INFINITY),
            None => (Cover::of_itself(reference, slots, Reach { reach, finest }), 0.0),
        };
        Self {
            reference,
            tree,
            reach,
            finest,
            cover,
            strays: vec![stray; slots],
            drift: Drift::default(),
            is_traced: own.is_none(),
            follows: false,
            known: Vec::new(),
            found: Vec::new(),
            hint: 0,
            parts: Vec::new(),
        }
    }

    /// Whether the whole surface and the whole reference lie within `tolerance` of each other: by what edits have kept,
    /// and where no edit came by, by the full test. The reference's side is what the pieces stand for.
    pub(in crate::technique::guarded) fn certifies(&mut self, mesh: &HalfedgeMesh, tolerance: f64) -> bool {
        // Edits keep a little less than the tolerance. Parts smaller than the rest pass wherever the surface does; how
        // finely an edit was tested says nothing here, as its faces are cut in another order.
        let kept = (self.reach, self.finest);
        (self.reach, self.finest) = (tolerance, 0.5 * (1.0 - MARGIN) * tolerance);
        let faces: Vec<FaceId> = mesh.faces().collect();
        let within = faces.into_iter().all(|f| {
            f64::from(self.strays[f.index()]) <= tolerance
                || self.bound(&mesh.corner_points(f), CERTIFY_BUDGET).is_some()
        });
        (self.reach, self.finest) = kept;
        within && self.cover.uncovered == 0
    }

    /// A bound of the two-sided distance from what edits have moved; `None` where some edit was admitted without one,
    /// or the mesh did not begin as the reference.
    ///
    /// A bound of a new face is that of the old faces below it and the gap between them. The same gap takes whatever
    /// lies on the old faces to the new one, so the bounds of all faces hold for the reference's points as well.
    pub(in crate::technique::guarded) fn traced(&self, mesh: &HalfedgeMesh) -> Option<f64> {
        let strays = mesh.faces().map(|f| f64::from(self.strays[f.index()]));
        self.is_traced.then(|| strays.fold(0.0, f64::max))
    }

    /// The distance that edits keep.
    pub(in crate::technique::guarded) fn reach(&self) -> f64 {
        self.reach
    }

    /// The point of the reference nearest to `p`, and the face it lies on.
    pub(in crate::technique::guarded) fn project(&self, p: DVec3) -> Option<(DVec3, FaceId)> {
        self.tree.closest(p).map(|c| (c.nearest.point, c.face()))
    }

    /// As [`Envelope::project`], with a face that is probably near: the same answer, found faster where it is.
    pub(in crate::technique::guarded) fn project_near(&self, p: DVec3, face: FaceId) -> Option<DVec3> {
        let bound = closest_on_triangle(p, self.reference.corners(face)).distance_squared;
        self.tree.closest_within(p, bound).map(|c| c.nearest.point)
    }

    /// Whether the edit keeps the tolerance both ways. On `true`, the new owners and bounds wait for
    /// [`Envelope::commit`].
    pub(in crate::technique::guarded) fn admits(&mut self, change: &Change<'_>) -> bool {
        let mut known = std::mem::take(&mut self.known);
        let mut found = std::mem::take(&mut self.found);
        known.clear();
        known.extend(change.old.iter().map(|f| f64::from(self.strays[f.index()])));
        let is_near = if change.is_same {
            found.clear();
            let most = known.iter().copied().fold(0.0, f64::max);
            found.resize(change.new.len(), most + SAME * self.reach);
            self.follows = true;
            true
        } else {
            self.drift.bounds(change.was, &known, change.new, &mut found);
            self.follows = found.iter().all(|bound| *bound <= SURE * self.reach);
            self.bounds_hold(change.new, &mut found)
        };
        (self.known, self.found) = (known, found);
        let reach = Reach { reach: self.reach, finest: self.finest };
        is_near && self.cover.admits(change, reach)
    }

    /// Whether the faces of the last edit tested were seen not to meet each other but where they touch.
    pub(in crate::technique::guarded) fn is_sheet(&self) -> bool {
        self.drift.is_sheet
    }

    /// Whether all new faces lie within the tolerance: by their bounds, or else held against the reference, which gives
    /// new bounds.
    fn bounds_hold(&mut self, new: &[Triangle], bounds: &mut [f64]) -> bool {
        let reach = self.reach;
        let sure = SURE * reach;
        new.iter().zip(&*bounds).all(|(face, &bound)| bound <= sure || self.may_be_within(face))
            && new.iter().zip(bounds).all(|(face, bound)| {
                if *bound > sure {
                    *bound = self.bound(face, CHECK_BUDGET).map_or(f64::INFINITY, |found| found.min(*bound));
                }
                *bound <= reach
            })
    }

    /// Whether the points of a triangle that stray first, the middles of it and of its sides, lie within the tolerance:
    /// a cheap answer where the full test would bisect for long before it says no.
    fn may_be_within(&self, &[a, b, c]: &Triangle) -> bool {
        let squared = self.reach * self.reach;
        // The side opposite the changed corner is an old one.
        let middles = [(a + b + c) / 3.0, 0.5 * (a + b), 0.5 * (a + c)];
        middles.into_iter().all(|p| self.tree.near(p, squared, squared).is_some())
    }

    /// A bound of the distance of a triangle from the reference where it lies within the tolerance.
    ///
    /// A part that no single triangle covers is cut along the sides of the one nearest to its middle: what lies over
    /// that one is judged by its corners, the rest goes on. Neighbouring parts mostly lie near the same triangle, so
    /// the last one found is asked first, and the tree is searched only until something is near enough.
    fn bound(&mut self, face: &Triangle, mut budget: usize) -> Option<f64> {
        let mut parts = std::mem::take(&mut self.parts);
        parts.clear();
        parts.push(Convex::from_slice(face));
        let mut known = self.reference_target(self.hint);
        let mut bound = Some(0.0);
        while let (Some(most), Some(part)) = (bound, parts.pop()) {
            let found = if budget > 0 { self.settle_part(&part, &mut known, &mut parts) } else { None };
            bound = found.map(|squared| squared.max(most));
            budget = budget.saturating_sub(1);
        }
        self.parts = parts;
        bound.map(|squared| squared.sqrt().min(self.reach))
    }

    /// Certifies a part, and says by which squared distance, or replaces it by smaller ones; `None` where it reaches
    /// out of the zone, or may.
    fn settle_part(&mut self, part: &Convex, known: &mut Option<Target>, parts: &mut Vec<Convex>) -> Option<f64> {
        let squared = self.reach * self.reach;
        if let Some(furthest) = known.and_then(|known| known.furthest(part, squared)) {
            return Some(furthest);
        }
        let (centre, radius) = clip::ball(part);
        let slack = (self.reach - radius).max(0.0);
        let in_ball = |from_centre: f64| {
            let is_near = slack > 0.0 && from_centre <= slack * slack;
            is_near.then(|| (from_centre.sqrt() + radius) * (from_centre.sqrt() + radius))
        };
        if let Some(furthest) = known.filter(|_| slack > 0.0).and_then(|known| in_ball(known.distance_squared(centre)))
        {
            return Some(furthest);
        }
        let closest = self.tree.near(centre, squared, slack * slack)?;
        self.hint = closest.index as usize;
        *known = self.reference_target(self.hint);
        let target = (*known)?;
        if let Some(furthest) = in_ball(closest.nearest.distance_squared).or_else(|| target.furthest(part, squared)) {
            return Some(furthest);
        }
        if target.squared > 0.0
            && let before = parts.len()
            && let Some(over) = clip::cut_out(part, target.corners, target.normal, 1e-3 * self.reach, parts)
        {
            if let Some(furthest) = target.furthest(&over, squared) {
                return Some(furthest);
            }
            if parts.len() > before {
                parts.push(over);
                return Some(0.0);
            }
        }
        let (extent, halves) = clip::halve(part);
        parts.extend(halves.into_iter().filter(|half| !half.is_empty()));
        (extent > self.finest).then_some(0.0)
    }

    fn reference_target(&self, face: usize) -> Option<Target> {
        (face < self.reference.faces.len()).then(|| Target::new(self.reference.corners(FaceId::new(face)), self.reach))
    }

    /// Makes what the last check that said `true` found hold: `targets` are the new faces in its order, then those
    /// beside.
    pub(in crate::technique::guarded) fn commit(&mut self, old: &[FaceId], targets: &[FaceId]) {
        let most = targets.iter().map(|f| f.index() + 1).max().unwrap_or(0);
        self.strays.resize(self.strays.len().max(most), f32::INFINITY);
        for (face, &bound) in targets.iter().zip(&self.found) {
            // The cast may round down.
            self.strays[face.index()] = bound as f32 * (1.0 + 2.0 * f32::EPSILON);
        }
        self.is_traced &= self.follows;
        self.cover.commit(old, targets);
    }
}
