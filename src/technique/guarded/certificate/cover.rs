//! The side of a reference: which live face covers which piece of it.
//!
//! Pieces are parts of the reference's triangles, each within reach of the one face that owns it. An edit must find an
//! owner for every piece of the faces that it replaces; a piece that no single face covers is cut along the sides of
//! the face nearest to its middle, so that a face over `k` others leaves about `k` pieces, whatever their size against
//! the reach. Where all pieces of a triangle of the reference are looked at together, the triangle is cut anew instead
//! of its pieces, so that pieces do not grow ever smaller. Cost: a few pieces a face; 88 bytes each.

use glam::DVec3;

use super::clip::{self, Convex};
use super::target::{Target, Triangle, find_owner, is_near_any, nearest};
use crate::mesh::bvh::TriangleBvh;
use crate::mesh::geometry::closest_on_triangle;
use crate::mesh::halfedge::HalfedgeMesh;
use crate::mesh::{FaceId, Surface};

/// An edit as the zone sees it.
#[derive(Clone, Copy, Debug)]
pub(in crate::technique::guarded) struct Change<'e> {
    /// The faces replaced.
    pub(in crate::technique::guarded) old: &'e [FaceId],
    /// Their corners.
    pub(in crate::technique::guarded) was: &'e [Triangle],
    /// Their successors.
    pub(in crate::technique::guarded) new: &'e [Triangle],
    /// Faces next to them that stay.
    pub(in crate::technique::guarded) beside: &'e [Triangle],
    /// Whether the surface stays as it is, as a set of points.
    pub(in crate::technique::guarded) is_same: bool,
}

const NONE: u32 = u32::MAX;

/// Parts that one check may look at before it gives up and refuses the edit.
const CHECK_BUDGET: usize = 3000;

/// And for each piece where the surface stays as it is: then owners are there, and the face of a long strip may own
/// thousands of pieces.
const SAME_BUDGET: usize = 16;

/// How near the pieces' owners must be, and how small parts may become.
#[derive(Clone, Copy, Debug)]
pub(super) struct Reach {
    pub(super) reach: f64,
    pub(super) finest: f64,
}

impl Reach {
    /// What lies beyond a side by no more than this need not be cut off.
    fn near(self) -> f64 {
        1e-3 * self.reach
    }
}

#[derive(Clone, Copy, Debug)]
struct Piece {
    corners: Triangle,
    /// The face of the reference that it is a part of.
    source: u32,
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

impl Plan {
    fn clear(&mut self) {
        self.kept.clear();
        self.retired.clear();
        self.parts.clear();
    }

    fn add(&mut self, like: Piece, part: &[DVec3], target: u32) {
        self.parts.extend(fan(part).map(|corners| (Piece { corners, ..like }, target)));
    }
}

/// Who covers which piece of a reference.
#[derive(Debug)]
pub(super) struct Cover<'a> {
    reference: &'a Surface,
    pieces: Vec<Piece>,
    free: Vec<u32>,
    /// First piece of each face slot.
    head: Vec<u32>,
    /// Pieces of each face of the reference.
    count: Vec<u32>,
    /// Pieces that no face covered at the beginning.
    pub(super) uncovered: usize,
    /// Pieces of the faces that an edit replaces, by the face of the reference that each is a part of.
    found: Vec<(u32, u32)>,
    parts: Vec<Convex>,
    targets: Vec<Target>,
    plan: Plan,
}

/// What one check may still do.
struct Check<'c> {
    targets: &'c [Target],
    hint: usize,
    budget: usize,
}

impl<'a> Cover<'a> {
    /// No pieces yet.
    fn empty(reference: &'a Surface, slots: usize) -> Self {
        Self {
            reference,
            pieces: Vec::with_capacity(reference.faces.len()),
            free: Vec::new(),
            head: vec![NONE; slots],
            count: vec![0; reference.faces.len()],
            uncovered: 0,
            found: Vec::new(),
            parts: Vec::new(),
            targets: Vec::new(),
            plan: Plan::default(),
        }
    }

    /// Each face of the reference is a face of the mesh, and owns itself, or what the one before it owned.
    pub(super) fn of_itself(reference: &'a Surface, slots: usize, reach: Reach) -> Self {
        let mut this = Self::empty(reference, slots);
        let mut owner = FaceId::from_raw(0);
        for f in reference.faces.ids() {
            let corners = reference.corners(f);
            if !covers(&reference.corners(owner), &corners, reach.reach) {
                owner = f;
            }
            this.own(owner, f, &corners, 0.0);
        }
        this
    }

    /// Finds an owner for each piece of the reference among the faces of `mesh`, whatever its distance; `own` is their
    /// hierarchy.
    pub(super) fn new(
        reference: &'a Surface,
        mesh: &HalfedgeMesh,
        own: &TriangleBvh,
        reach: Reach,
        tolerance: f64,
    ) -> Self {
        let mut this = Self::empty(reference, mesh.face_slots());
        let budget = 4_000_000 + 16 * (reference.faces.len() + mesh.face_count());
        let mut parts: Vec<Convex> = Vec::new();
        let mut hint = FaceId::from_raw(0);
        for f in reference.faces.ids() {
            parts.push(Convex::from_slice(&reference.corners(f)));
            while let Some(part) = parts.pop() {
                if mesh.face_slots() > hint.index() && covers(&mesh.corner_points(hint), &part, reach.reach) {
                    this.own(hint, f, &part, 0.0);
                    continue;
                }
                let (centre, radius) = clip::ball(&part);
                let Some(closest) = own.closest(centre) else { return this };
                let owner = closest.face();
                if covers(&mesh.corner_points(owner), &part, reach.reach) {
                    hint = owner;
                    this.own(owner, f, &part, 0.0);
                    continue;
                }
                let distance = closest.distance();
                let hopeless = distance - radius > reach.reach || this.pieces.len() > budget;
                if !hopeless && divide(&part, &Target::new(mesh.corner_points(owner), reach.reach), reach, &mut parts) {
                    continue;
                }
                let bound = distance + radius;
                this.uncovered += usize::from(bound > tolerance);
                this.own(owner, f, &part, (bound * 1.0001) as f32);
            }
        }
        this
    }

    fn own(&mut self, owner: FaceId, source: FaceId, part: &[DVec3], reach: f32) {
        for corners in fan(part) {
            self.link(owner, Piece { corners, source: source.raw(), reach, next: NONE });
        }
    }

    fn link(&mut self, owner: FaceId, mut piece: Piece) {
        self.count[piece.source as usize] += 1;
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

    /// Whether every piece of the old faces finds a new owner; on `true`, the owners wait for [`Cover::commit`].
    pub(super) fn admits(&mut self, change: &Change<'_>, reach: Reach) -> bool {
        let mut plan = std::mem::take(&mut self.plan);
        let mut targets = std::mem::take(&mut self.targets);
        let mut found = std::mem::take(&mut self.found);
        plan.clear();
        targets.clear();
        targets.extend(change.new.iter().chain(change.beside).map(|&face| Target::new(face, reach.reach)));
        self.gather(change.old, &mut found);
        let budget = if change.is_same { CHECK_BUDGET.max(SAME_BUDGET * found.len()) } else { CHECK_BUDGET };
        let mut check = Check { targets: &targets, hint: 0, budget };
        let covered =
            found.chunk_by(|a, b| a.0 == b.0).all(|same| self.find_owners(same, &mut check, &mut plan, reach));
        self.plan = plan;
        self.targets = targets;
        self.found = found;
        covered
    }

    fn gather(&self, old: &[FaceId], found: &mut Vec<(u32, u32)>) {
        found.clear();
        for face in old {
            let mut at = self.head[face.index()];
            while at != NONE {
                let piece = &self.pieces[at as usize];
                found.push((piece.source, at));
                at = piece.next;
            }
        }
        found.sort_unstable();
    }

    /// Owners for pieces of one triangle of the reference.
    fn find_owners(&mut self, same: &[(u32, u32)], check: &mut Check<'_>, plan: &mut Plan, reach: Reach) -> bool {
        let (source, first) = same[0];
        let is_whole = same.len() > 1
            && same.len() == self.count[source as usize] as usize
            && same.iter().all(|&(_, at)| self.pieces[at as usize].reach == 0.0);
        if is_whole {
            let corners = self.reference.corners(FaceId::from_raw(source));
            plan.retired.extend(same.iter().map(|&(_, at)| at));
            return self.place(Piece { corners, ..self.pieces[first as usize] }, check, plan, reach);
        }
        same.iter().all(|&(_, at)| {
            let piece = self.pieces[at as usize];
            let squared = squared_reach(&piece, reach);
            if let Some(target) = find_owner(&piece.corners, check.targets, &mut check.hint, squared) {
                plan.kept.push((at, target));
                return true;
            }
            plan.retired.push(at);
            self.cut_and_place(piece, check, plan, reach)
        })
    }

    /// Finds an owner for a piece, or cuts it until each part has one.
    fn place(&mut self, piece: Piece, check: &mut Check<'_>, plan: &mut Plan, reach: Reach) -> bool {
        let squared = squared_reach(&piece, reach);
        if let Some(target) = find_owner(&piece.corners, check.targets, &mut check.hint, squared) {
            plan.add(piece, &piece.corners, target);
            return true;
        }
        self.cut_and_place(piece, check, plan, reach)
    }

    /// Cuts a piece that no target covers until each part has an owner.
    fn cut_and_place(&mut self, piece: Piece, check: &mut Check<'_>, plan: &mut Plan, reach: Reach) -> bool {
        let mut parts = std::mem::take(&mut self.parts);
        parts.clear();
        let mut covered = check.budget > 0 && cut_part(&piece.corners, piece, check, plan, reach, &mut parts);
        check.budget = check.budget.saturating_sub(1);
        while let (true, Some(part)) = (covered, parts.pop()) {
            covered = check.budget > 0 && place_part(&part, piece, check, plan, reach, &mut parts);
            check.budget = check.budget.saturating_sub(1);
        }
        self.parts = parts;
        covered
    }

    /// Makes the owners found by the last check that said `true` the owners; `targets` are the faces in the order of
    /// `new`, then of `beside`.
    pub(super) fn commit(&mut self, old: &[FaceId], targets: &[FaceId]) {
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
        for piece in plan.retired.drain(..) {
            self.count[self.pieces[piece as usize].source as usize] -= 1;
            self.free.push(piece);
        }
        for (piece, target) in plan.parts.drain(..) {
            self.link(targets[target as usize], piece);
        }
        self.plan = plan;
    }
}

/// Finds an owner for a part, or replaces it by smaller ones; `false` where it reaches out of the zone, or may.
fn place_part(
    part: &[DVec3],
    piece: Piece,
    check: &mut Check<'_>,
    plan: &mut Plan,
    reach: Reach,
    parts: &mut Vec<Convex>,
) -> bool {
    let squared = squared_reach(&piece, reach);
    if let Some(target) = find_owner(part, check.targets, &mut check.hint, squared) {
        plan.add(piece, part, target);
        return true;
    }
    cut_part(part, piece, check, plan, reach, parts)
}

/// As [`place_part`] for a part that no target covers.
fn cut_part(
    part: &[DVec3],
    piece: Piece,
    check: &mut Check<'_>,
    plan: &mut Plan,
    reach: Reach,
    parts: &mut Vec<Convex>,
) -> bool {
    let squared = squared_reach(&piece, reach);
    // A corner out of reach of all faces ends the search.
    if !part.iter().all(|&p| is_near_any(p, check.targets, check.hint, squared)) {
        return false;
    }
    let (centre, radius) = clip::ball(part);
    let (at, distance_squared) = nearest(centre, check.targets, check.hint);
    if distance_squared > squared {
        return false;
    }
    if distance_squared.sqrt() + radius <= squared.sqrt() {
        plan.add(piece, part, at);
        return true;
    }
    divide(part, &check.targets[at as usize], reach, parts)
}

/// Cuts a part along the sides of the triangle nearest to its middle, or, where it lies beyond a side, across the ends
/// of that side, or else into halves; `false` where it is too small for that.
fn divide(part: &[DVec3], target: &Target, reach: Reach, parts: &mut Vec<Convex>) -> bool {
    let before = parts.len();
    let over = (target.squared > 0.0)
        .then(|| clip::cut_out(part, target.corners, target.normal, reach.near(), parts))
        .flatten()
        .filter(|_| parts.len() > before);
    let over = over.or_else(|| {
        let [p, q] = target.side_towards(clip::ball(part).0);
        clip::cut_between(part, p, q, reach.near(), parts).filter(|_| parts.len() > before)
    });
    if let Some(over) = over {
        parts.push(over);
        return true;
    }
    let (extent, halves) = clip::halve(part);
    if extent <= reach.finest {
        return false;
    }
    parts.extend(halves.into_iter().filter(|half| !half.is_empty()));
    true
}

fn squared_reach(piece: &Piece, reach: Reach) -> f64 {
    let reach = reach.reach.max(f64::from(piece.reach));
    reach * reach
}

/// Whether all corners of `part` lie within `reach` of `face`: then all of `part` does.
fn covers(face: &Triangle, part: &[DVec3], reach: f64) -> bool {
    let squared = reach * reach;
    part.iter().all(|&p| closest_on_triangle(p, *face).distance_squared <= squared)
}

/// The triangles that a convex part falls into.
fn fan(part: &[DVec3]) -> impl Iterator<Item = Triangle> + '_ {
    (2..part.len()).map(|at| [part[0], part[at - 1], part[at]])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::VertexId;
    use crate::mesh::halfedge::tests::{enter, surface};

    /// A sheet of needles from side to side, as a tessellation spans a fillet, and two triangles instead.
    #[test]
    fn the_owner_of_thousands_of_pieces_can_be_split() {
        const NEEDLES: u32 = 3000;
        let at =
            |k: u32| [[0.0, f64::from(k) / f64::from(NEEDLES), 0.0], [10.0, f64::from(k) / f64::from(NEEDLES), 0.0]];
        let points: Vec<[f64; 3]> = (0..=NEEDLES).flat_map(at).collect();
        let needles = (0..NEEDLES).map(|k| 2 * k).flat_map(|k| [[k, k + 1, k + 3], [k, k + 3, k + 2]]);
        let reference = surface(&points, &needles.collect::<Vec<_>>());
        let coarse = surface(&[[0.0; 3], [10.0, 0.0, 0.0], [10.0, 1.0, 0.0], [0.0, 1.0, 0.0]], &[[0, 1, 2], [0, 2, 3]]);
        let (mesh, own) = (enter(&coarse), TriangleBvh::of_surface(&coarse));
        let reach = Reach { reach: 1e-3, finest: 1e-4 };
        let mut cover = Cover::new(&reference, &mesh, &own, reach, 1e-3);
        assert_eq!(cover.uncovered, 0);
        let [a, b, c, d] = [0, 1, 2, 3].map(|v| coarse.points[VertexId::from_raw(v)]);
        let middle = 0.5 * (a + c);
        let old: Vec<FaceId> = mesh.faces().collect();
        let was: Vec<Triangle> = old.iter().map(|&f| mesh.corner_points(f)).collect();
        let new = [[a, b, middle], [b, c, middle], [c, d, middle], [d, a, middle]];
        let change = Change { old: &old, was: &was, new: &new, beside: &[], is_same: true };
        assert!(!cover.admits(&Change { new: &new[..3], ..change }, reach), "a quarter is left out");
        assert!(cover.admits(&change, reach));
        cover.commit(&old, &[0, 1, 2, 3].map(FaceId::from_raw));
        assert!(cover.pieces.len() - cover.free.len() > CHECK_BUDGET);
    }
}
