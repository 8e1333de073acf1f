//! Certified two-sided distance: no edit takes the surface further than the tolerance from the reference, or leaves a
//! part of the reference further than that from the surface.
//!
//! The set of points within `ε` of a triangle is convex. So a triangle whose three corners lie within `ε` of one
//! triangle lies within `ε` of it as a whole.
//! - **Reference to surface.** The reference is cut into pieces; each is owned by one live face, in whose offset its
//!   corners lie. An edit must find an owner among the new faces, or those next to them, for every piece of the faces
//!   that it replaces (`cover`).
//! - **Surface to reference.** Each new face is cut along the sides of the triangles of the reference that lie under it,
//!   found by their box hierarchy, until every part lies in the offset of one of them, or within `ε` by the Lipschitz
//!   bound of its middle.
//!
//! Both are local and exact up to rounding, for which 2 % of the tolerance are held back; so the surface as a whole
//! keeps the tolerance at every moment. Where the input broke it at the beginning, no edit makes that worse.
//! Related: Hu et al., Error-Bounded and Feature Preserving Surface Remeshing with Minimal Angle Improvement, TVCG 2017,
//! which bounds samples; pieces need no sampling density, and a flat part needs few.
//! Cost: about as many parts as triangles of one surface lie under a face of the other.

use glam::DVec3;

use super::clip::{self, Convex};
use super::cover::{Cover, Reach};
use super::target::Target;
use crate::mesh::bvh::TriangleBvh;
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

pub(super) type Triangle = [DVec3; 3];

/// The tolerance zone of a reference, and who covers which piece of it.
#[derive(Debug)]
pub struct Envelope<'a> {
    reference: &'a Surface,
    tree: &'a TriangleBvh,
    reach: f64,
    finest: f64,
    cover: Cover<'a>,
    hint: usize,
    parts: Vec<Convex>,
}

impl<'a> Envelope<'a> {
    /// The zone of `tolerance` round the reference, covered by the faces of `mesh`, whose hierarchy is `own`.
    pub fn new(
        reference: &'a Surface,
        tree: &'a TriangleBvh,
        tolerance: f64,
        mesh: &HalfedgeMesh,
        own: &TriangleBvh,
        face_of: &[FaceId],
    ) -> Self {
        let reach = MARGIN * tolerance;
        let finest = FINEST * reach;
        let cover = Cover::new(reference, mesh, own, face_of, Reach { reach, finest }, tolerance);
        Self { reference, tree, reach, finest, cover, hint: 0, parts: Vec::new() }
    }

    /// Pieces of the reference that were further than the tolerance from the surface at the beginning.
    pub fn uncovered(&self) -> usize {
        self.cover.uncovered
    }

    /// Whether the whole surface and the whole reference lie within `tolerance` of each other, certified anew for the
    /// surface's side; the reference's side is what the pieces stand for.
    pub fn certifies(&mut self, mesh: &HalfedgeMesh, tolerance: f64) -> bool {
        // Edits keep a little less than the tolerance. Parts smaller than the rest pass wherever the surface does; how
        // finely an edit was tested says nothing here, as its faces are cut in another order.
        let kept = (self.reach, self.finest);
        (self.reach, self.finest) = (tolerance, 0.5 * (1.0 - MARGIN) * tolerance);
        let faces: Vec<FaceId> = mesh.faces().collect();
        let within = faces.into_iter().all(|f| self.is_within(&mesh.corner_points(f), CERTIFY_BUDGET));
        (self.reach, self.finest) = kept;
        within && self.cover.uncovered == 0
    }

    /// The distance that edits keep.
    pub fn reach(&self) -> f64 {
        self.reach
    }

    /// The point of the reference nearest to `p`, and the face it lies on.
    pub fn project(&self, p: DVec3) -> Option<(DVec3, FaceId)> {
        self.tree.closest(p).map(|c| (c.nearest.point, c.face()))
    }

    /// Whether `p` lies within the tolerance.
    pub fn contains(&self, p: DVec3) -> bool {
        self.tree.near(p, self.reach * self.reach, self.reach * self.reach).is_some()
    }

    /// Whether the edit keeps the tolerance both ways.
    ///
    /// `old` are the faces replaced, `new` their successors; `beside` are faces next to them that stay. On `true`, the
    /// new owners wait for [`Envelope::commit`].
    pub fn admits(&mut self, old: &[FaceId], new: &[Triangle], beside: &[Triangle]) -> bool {
        new.iter().all(|face| self.may_be_within(face))
            && new.iter().all(|face| self.is_within(face, CHECK_BUDGET))
            && self.cover.admits(old, new, beside, Reach { reach: self.reach, finest: self.finest })
    }

    /// As [`Envelope::admits`] for an edit that leaves the surface as it is, as a set of points: only the pieces need
    /// owners.
    pub fn admits_same(&mut self, old: &[FaceId], new: &[Triangle], beside: &[Triangle]) -> bool {
        self.cover.admits(old, new, beside, Reach { reach: self.reach, finest: self.finest })
    }

    /// Whether the points of a triangle that stray first, the middles of it and of its sides, lie within the tolerance: a
    /// cheap answer where the full test would bisect for long before it says no.
    fn may_be_within(&self, &[a, b, c]: &Triangle) -> bool {
        let squared = self.reach * self.reach;
        // The side opposite the changed corner is an old one.
        let middles = [(a + b + c) / 3.0, 0.5 * (a + b), 0.5 * (a + c)];
        middles.into_iter().all(|p| self.tree.near(p, squared, squared).is_some())
    }

    /// Whether a triangle lies within the tolerance of the reference.
    ///
    /// A part that no single triangle covers is cut along the sides of the one nearest to its middle: what lies over
    /// that one is judged by its corners, the rest goes on. Neighbouring parts mostly lie near the same triangle, so the
    /// last one found is asked first, and the tree is searched only until something is near enough.
    fn is_within(&mut self, face: &Triangle, mut budget: usize) -> bool {
        let mut parts = std::mem::take(&mut self.parts);
        parts.clear();
        parts.push(Convex::from_slice(face));
        let mut known = self.reference_target(self.hint);
        let mut within = true;
        while let (true, Some(part)) = (within, parts.pop()) {
            within = budget > 0 && self.settle_part(&part, &mut known, &mut parts);
            budget = budget.saturating_sub(1);
        }
        self.parts = parts;
        within
    }

    /// Certifies a part, or replaces it by smaller ones; `false` where it reaches out of the zone, or may.
    fn settle_part(&mut self, part: &Convex, known: &mut Option<Target>, parts: &mut Vec<Convex>) -> bool {
        let squared = self.reach * self.reach;
        if known.is_some_and(|known| known.covers(part, squared)) {
            return true;
        }
        let (centre, radius) = clip::ball(part);
        let slack = (self.reach - radius).max(0.0);
        if slack > 0.0 && known.is_some_and(|known| known.distance_squared(centre) <= slack * slack) {
            return true;
        }
        let Some(closest) = self.tree.near(centre, squared, slack * slack) else { return false };
        self.hint = closest.index as usize;
        *known = self.reference_target(self.hint);
        let Some(target) = *known else { return false };
        if closest.nearest.distance_squared <= slack * slack && slack > 0.0 || target.covers(part, squared) {
            return true;
        }
        if target.squared > 0.0
            && let before = parts.len()
            && let Some(over) = clip::cut_out(part, target.corners, target.normal, 1e-3 * self.reach, parts)
        {
            if target.covers(&over, squared) {
                return true;
            }
            if parts.len() > before {
                parts.push(over);
                return true;
            }
        }
        let (extent, halves) = clip::halve(part);
        parts.extend(halves.into_iter().filter(|half| !half.is_empty()));
        extent > self.finest
    }

    fn reference_target(&self, face: usize) -> Option<Target> {
        (face < self.reference.faces.len()).then(|| Target::new(self.reference.corners(FaceId::new(face)), self.reach))
    }

    /// Makes the owners found by the last check that said `true` the owners; `targets` are the faces in the order of
    /// `new`, then of `beside`.
    pub fn commit(&mut self, old: &[FaceId], targets: &[FaceId]) {
        self.cover.commit(old, targets);
    }
}
