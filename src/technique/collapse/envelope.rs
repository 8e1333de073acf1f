//! Certified two-sided distance: no edit takes the surface further than the tolerance from the reference, or leaves a
//! part of the reference further than that from the surface.
//!
//! The set of points within `ε` of a triangle is convex. So a triangle whose three corners lie within `ε` of one
//! triangle lies within `ε` of it as a whole.
//! - **Reference to surface.** The reference is cut into pieces; each is owned by one live face, in whose offset its
//!   corners lie. An edit must find an owner among the new faces, or those next to them, for every piece of the faces
//!   that it replaces; a piece that no single face covers is bisected, down to a small part of `ε`.
//! - **Surface to reference.** Each new face is cut along the sides of the triangles of the reference that lie under it,
//!   found by their box hierarchy, until every part lies in the offset of one of them, or within `ε` by the Lipschitz
//!   bound of its middle.
//!
//! Both are local and exact up to rounding, for which 2 % of the tolerance are held back; so the surface as a whole
//! keeps the tolerance at every moment. Where the input broke it at the beginning, no edit makes that worse.
//! Related: Hu et al., Error-Bounded and Feature Preserving Surface Remeshing with Minimal Angle Improvement, TVCG 2017,
//! which bounds samples; pieces need no sampling density, and a flat part needs few.
//! Cost: a few pieces a face on flat parts, about `l/ε` of them along each edge of length `l`; 84 bytes each.

use glam::DVec3;

use super::clip::{self, Convex};
use crate::mesh::bvh::TriangleBvh;
use crate::mesh::geometry::closest_on_triangle;
use crate::mesh::halfedge::HalfedgeMesh;
use crate::mesh::{FaceId, Surface};

const NONE: u32 = u32::MAX;

/// Held back for rounding, and so that the next step with the same tolerance finds room.
const MARGIN: f64 = 0.98;

/// Pieces are bisected down to this part of the tolerance.
const FINEST: f64 = 1.0 / 16.0;

/// Parts that one check may look at before it gives up and refuses the edit.
const CHECK_BUDGET: usize = 3000;

/// And that the last check of a face may look at, which is made once.
const CERTIFY_BUDGET: usize = 1_000_000;

type Triangle = [DVec3; 3];

/// The tolerance zone of a reference, and who covers which piece of it.
#[derive(Debug)]
pub struct Envelope<'a> {
    reference: &'a Surface,
    tree: &'a TriangleBvh,
    reach: f64,
    finest: f64,
    pieces: Vec<Piece>,
    free: Vec<u32>,
    /// First piece of each face slot.
    head: Vec<u32>,
    /// Pieces that no face covered when the envelope was made.
    uncovered: usize,
    hint: usize,
    stack: Vec<Triangle>,
    parts: Vec<Convex>,
    targets: Vec<Target>,
    plan: Plan,
}

#[derive(Clone, Copy, Debug)]
struct Piece {
    corners: Triangle,
    /// 0: the envelope's; else the distance at which its owner was, beyond the tolerance.
    reach: f32,
    next: u32,
}

/// New owners found by the last check: indices into the list of targets.
#[derive(Debug, Default)]
struct Plan {
    kept: Vec<(u32, u32)>,
    retired: Vec<u32>,
    parts: Vec<(Piece, u32)>,
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
        let mut this = Self {
            reference,
            tree,
            reach,
            finest: FINEST * reach,
            pieces: Vec::new(),
            free: Vec::new(),
            head: vec![NONE; mesh.face_slots()],
            uncovered: 0,
            hint: 0,
            stack: Vec::new(),
            parts: Vec::new(),
            targets: Vec::new(),
            plan: Plan::default(),
        };
        this.cover(mesh, own, face_of, tolerance);
        this
    }

    /// Pieces of the reference that were further than the tolerance from the surface at the beginning.
    pub fn uncovered(&self) -> usize {
        self.uncovered
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
        within && self.uncovered == 0
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
        self.tree.closest_within(p, self.reach * self.reach).is_some()
    }

    /// Finds an owner for each piece of the reference, whatever its distance.
    fn cover(&mut self, mesh: &HalfedgeMesh, own: &TriangleBvh, face_of: &[FaceId], tolerance: f64) {
        let budget = 4_000_000 + 16 * (self.reference.faces.len() + mesh.face_count());
        let mut stack: Vec<Triangle> = Vec::new();
        let mut hint = FaceId::from_raw(0);
        for f in self.reference.faces.ids() {
            stack.push(self.reference.corners(f));
            while let Some(corners) = stack.pop() {
                if mesh.face_slots() > hint.index() && covers(&mesh.corner_points(hint), &corners, self.reach) {
                    self.own(hint, corners, 0.0);
                    continue;
                }
                let (centre, radius) = ball(&corners);
                let Some(closest) = own.closest(centre) else { return };
                let owner = face_of[closest.index as usize];
                if covers(&mesh.corner_points(owner), &corners, self.reach) {
                    hint = owner;
                    self.own(owner, corners, 0.0);
                    continue;
                }
                let distance = closest.distance();
                let (longest, parts) = bisect(&corners);
                let hopeless = distance - radius > self.reach || self.pieces.len() > budget;
                if longest > self.finest && !hopeless {
                    stack.extend(parts);
                    continue;
                }
                let bound = distance + radius;
                self.uncovered += usize::from(bound > tolerance);
                self.own(owner, corners, (bound * 1.0001) as f32);
            }
        }
    }

    fn own(&mut self, owner: FaceId, corners: Triangle, reach: f32) {
        let piece = Piece { corners, reach, next: NONE };
        self.link(owner, piece);
    }

    fn link(&mut self, owner: FaceId, mut piece: Piece) {
        piece.next = self.head[owner.index()];
        let at = if let Some(at) = self.free.pop() {
            self.pieces[at as usize] = piece;
            at
        } else {
            self.pieces.push(piece);
            self.pieces.len() as u32 - 1
        };
        self.head[owner.index()] = at;
    }

    /// Whether the edit keeps the tolerance both ways.
    ///
    /// `old` are the faces replaced, `new` their successors; `beside` are faces next to them that stay. On `true`, the
    /// new owners wait for [`Envelope::commit`].
    pub fn admits(&mut self, old: &[FaceId], new: &[Triangle], beside: &[Triangle]) -> bool {
        new.iter().all(|face| self.may_be_within(face))
            && new.iter().all(|face| self.is_within(face, CHECK_BUDGET))
            && self.is_covered(old, new, beside)
    }

    /// Whether the points of a triangle that stray first, the middles of it and of its sides, lie within the tolerance: a
    /// cheap answer where the full test would bisect for long before it says no.
    fn may_be_within(&self, &[a, b, c]: &Triangle) -> bool {
        let squared = self.reach * self.reach;
        // The side opposite the changed corner is an old one.
        let middles = [(a + b + c) / 3.0, 0.5 * (a + b), 0.5 * (a + c)];
        middles.into_iter().all(|p| self.tree.closest_within(p, squared).is_some())
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
            && let Some(over) = clip::cut_out(part, target.corners, target.normal, parts)
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

    /// Whether every piece of the old faces finds a new owner.
    fn is_covered(&mut self, old: &[FaceId], new: &[Triangle], beside: &[Triangle]) -> bool {
        let mut plan = std::mem::take(&mut self.plan);
        let mut targets = std::mem::take(&mut self.targets);
        plan.kept.clear();
        plan.retired.clear();
        plan.parts.clear();
        targets.clear();
        targets.extend(new.iter().chain(beside).map(|&face| Target::new(face, self.reach)));
        let mut budget = CHECK_BUDGET;
        let mut hint = 0;
        let covered = old.iter().all(|face| {
            let mut at = self.head[face.index()];
            while at != NONE {
                let piece = self.pieces[at as usize];
                let squared = self.squared_reach_of(&piece);
                if let Some(target) = find_owner(&piece.corners, &targets, &mut hint, squared) {
                    plan.kept.push((at, target));
                } else if self.split(piece, &targets, &mut hint, &mut plan, &mut budget) {
                    plan.retired.push(at);
                } else {
                    return false;
                }
                at = piece.next;
            }
            true
        });
        self.plan = plan;
        self.targets = targets;
        covered
    }

    fn squared_reach_of(&self, piece: &Piece) -> f64 {
        let reach = self.reach.max(f64::from(piece.reach));
        reach * reach
    }

    /// Bisects a piece until each part has an owner.
    fn split(
        &mut self,
        piece: Piece,
        targets: &[Target],
        hint: &mut usize,
        plan: &mut Plan,
        budget: &mut usize,
    ) -> bool {
        let squared = self.squared_reach_of(&piece);
        // A corner out of reach of all faces ends the search before it begins.
        if piece.corners.iter().any(|&p| nearest(p, targets, *hint).1 > squared) {
            return false;
        }
        self.stack.clear();
        self.stack.push(piece.corners);
        while let Some(corners) = self.stack.pop() {
            if let Some(target) = find_owner(&corners, targets, hint, squared) {
                plan.parts.push((Piece { corners, ..piece }, target));
                continue;
            }
            let (centre, radius) = ball(&corners);
            let (target, distance_squared) = nearest(centre, targets, *hint);
            if distance_squared > squared {
                return false;
            }
            if distance_squared.sqrt() + radius <= squared.sqrt() {
                plan.parts.push((Piece { corners, ..piece }, target));
                continue;
            }
            let (longest, parts) = bisect(&corners);
            if longest <= self.finest || *budget == 0 {
                return false;
            }
            *budget -= 1;
            self.stack.extend(parts);
        }
        true
    }

    /// Makes the owners found by the last check that said `true` the owners; `targets` are the faces in the order of
    /// `new`, then of `beside`.
    pub fn commit(&mut self, old: &[FaceId], targets: &[FaceId]) {
        let most = targets.iter().map(|f| f.index() + 1).max().unwrap_or(0);
        if most > self.head.len() {
            self.head.resize(most, NONE);
        }
        for face in old {
            self.head[face.index()] = NONE;
        }
        let mut plan = std::mem::take(&mut self.plan);
        for (piece, target) in plan.kept.drain(..) {
            let owner = targets[target as usize].index();
            self.pieces[piece as usize].next = self.head[owner];
            self.head[owner] = piece;
        }
        self.free.append(&mut plan.retired);
        for (piece, target) in plan.parts.drain(..) {
            self.link(targets[target as usize], piece);
        }
        self.plan = plan;
    }
}

/// Whether all corners of `part` lie within `reach` of `face`: then all of `part` does.
fn covers(face: &Triangle, part: &Triangle, reach: f64) -> bool {
    let squared = reach * reach;
    part.iter().all(|&p| closest_on_triangle(p, *face).distance_squared <= squared)
}

/// A triangle that many points are held against, with what does not depend on the point.
#[derive(Clone, Copy, Debug)]
struct Target {
    corners: Triangle,
    /// Its box, grown by the reach.
    low: DVec3,
    high: DVec3,
    normal: DVec3,
    /// The square of the normal; 0 where the triangle is too thin to have one.
    squared: f64,
}

impl Target {
    fn new(corners: Triangle, reach: f64) -> Self {
        let [a, b, c] = corners;
        let normal = (b - a).cross(c - a);
        let size = (b - a).length_squared().max((c - b).length_squared()).max((a - c).length_squared());
        let squared = normal.length_squared();
        // Needles get no shortcut: their normal may be off.
        let squared = if squared > 1e-12 * size * size { squared } else { 0.0 };
        Self { corners, low: a.min(b).min(c) - reach, high: a.max(b).max(c) + reach, normal, squared }
    }

    fn distance_squared(&self, p: DVec3) -> f64 {
        closest_on_triangle(p, self.corners).distance_squared
    }

    /// Whether all corners of `part` lie within the root of `squared`: then all of `part` does.
    fn covers(&self, part: &[DVec3], squared: f64) -> bool {
        part.iter().all(|&p| self.is_near(p, squared))
    }

    fn is_near(&self, p: DVec3, squared: f64) -> bool {
        if self.squared > 0.0 {
            let height = self.normal.dot(p - self.corners[0]);
            // A point further from the plane by more than rounding is further from the triangle.
            if height * height > 1.000_001 * squared * self.squared {
                return false;
            }
        }
        self.distance_squared(p) <= squared
    }

    /// Whether `part` reaches out of the box by more than the reach that the box was grown by.
    fn is_clear_of(&self, low: DVec3, high: DVec3) -> bool {
        low.cmplt(self.low).any() || high.cmpgt(self.high).any()
    }
}

/// A target that covers the part: the one that covered the last part, or the first of all.
fn find_owner(part: &[DVec3], targets: &[Target], hint: &mut usize, squared: f64) -> Option<u32> {
    if targets.get(*hint).is_some_and(|target| target.covers(part, squared)) {
        return Some(*hint as u32);
    }
    let (low, high) = part.iter().fold((part[0], part[0]), |(low, high), &p| (low.min(p), high.max(p)));
    let owner = targets.iter().position(|target| !target.is_clear_of(low, high) && target.covers(part, squared))?;
    *hint = owner;
    Some(owner as u32)
}

/// The target nearest to `p`, and its squared distance; `hint` is one that is likely to be near.
fn nearest(p: DVec3, targets: &[Target], hint: usize) -> (u32, f64) {
    let hint = if hint < targets.len() { hint } else { 0 };
    let mut best = (hint as u32, targets.get(hint).map_or(f64::INFINITY, |target| target.distance_squared(p)));
    for (at, target) in targets.iter().enumerate() {
        let height = target.normal.dot(p - target.corners[0]);
        if at == hint || height * height > 1.000_001 * best.1 * target.squared && target.squared > 0.0 {
            continue;
        }
        let squared = target.distance_squared(p);
        if squared < best.1 {
            best = (at as u32, squared);
        }
    }
    best
}

/// The centroid and the distance of the furthest corner from it.
fn ball(&[a, b, c]: &Triangle) -> (DVec3, f64) {
    let centre = (a + b + c) / 3.0;
    let squared = |p: DVec3| (p - centre).length_squared();
    (centre, squared(a).max(squared(b)).max(squared(c)).sqrt())
}

/// The longest side, and the two halves that its midpoint makes.
fn bisect(&[a, b, c]: &Triangle) -> (f64, [Triangle; 2]) {
    let (ab, bc, ca) = ((b - a).length_squared(), (c - b).length_squared(), (a - c).length_squared());
    if ab >= bc && ab >= ca {
        let m = 0.5 * (a + b);
        (ab.sqrt(), [[a, m, c], [m, b, c]])
    } else if bc >= ca {
        let m = 0.5 * (b + c);
        (bc.sqrt(), [[b, m, a], [m, c, a]])
    } else {
        let m = 0.5 * (c + a);
        (ca.sqrt(), [[c, m, b], [m, a, b]])
    }
}
