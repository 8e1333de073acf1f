//! The whole held against the reference at once, both ways, and smaller sizes where it is too far.

use glam::DVec3;

use super::work::Work;
use crate::mesh::geometry::{centroid, triangle_size};
use crate::mesh::halfedge::{edge_of, halfedge_of, twin};
use crate::mesh::{EdgeId, FaceId, Freedom, Soup, VertexId};
use crate::metric::Subject;
use crate::metric::crossing::compare;
use crate::metric::distance::{Memo, Target, Wanted, decide_where};
use crate::metric::intersection::faces_of;
use crate::watch::{Cancelled, Watch};

/// Sizes are lowered by what the distance asks for, but by no less and no more than these at once.
const AT_ONCE: [f64; 2] = [0.5, 0.93];
/// The part of the tolerance that new sizes aim for.
const AIM: f64 = 0.88;
/// How far beyond the tolerance faces count that intersect.
const CROSSING: f64 = 2.0;
/// One face in so many may meet others for a while.
const A_FEW: usize = 200;
/// Strips between curves get edges up to so many times their width.
const OF_STRIP: f64 = 1.6;
/// A vertex is pulled to a lost place where no face gets worse than this.
const PULLED: f64 = 0.05;

/// What a certificate has found.
#[derive(Clone, Debug, Default)]
pub(super) struct Verdict {
    /// Vertices near places that are too far off or intersect, and the sizes asked for there.
    pub(super) wishes: Vec<(VertexId, f64)>,
    /// Points of the reference that are too far off, each with the face nearest to it.
    pub(super) lost: Vec<(DVec3, [VertexId; 3])>,
    /// Faces and pieces of the reference too far off.
    pub(super) places: usize,
    /// Faces that meet others where those of the reference do not.
    pub(super) crossing: usize,
}

/// What certificates remember of each other.
#[derive(Debug, Default)]
pub(super) struct Memos([Memo; 2]);

impl Work<'_> {
    /// Decides whether the mesh lies within the tolerance of the reference, both ways, and does not meet itself.
    pub(super) fn certify(&self, memos: &mut Memos, watch: &Watch) -> Result<Verdict, Cancelled> {
        let most = self.rules.tolerance;
        let soup = self.mesh.clone().leave().surface.to_soup();
        let (own, target) = (Target::of(&soup), &self.reference.target);
        let ids: Vec<FaceId> = self.mesh.faces().collect();
        let corners = |f: FaceId| self.mesh.corners(ids[f.index()]);
        let nearest = |p: DVec3| own.bvh().closest(p).map(|found| corners(own.face(found.index)));
        let everything: Wanted<'_> = &|_| true;
        let mut verdict = Verdict::default();
        let Memos([forth, back]) = memos;
        if let Some(found) = decide_where(&own, target, most, everything, Some(forth), watch)? {
            let beyond = found.beyond.iter().map(|&(f, _, off)| (f, off)).chain(found.undecided);
            beyond.for_each(|(f, off)| verdict.note(self, corners(f), off / most));
        }
        if let Some(found) = decide_where(target, &own, most, everything, Some(back), watch)? {
            for &(_, at, off) in &found.beyond {
                if let Some(corners) = nearest(at) {
                    verdict.note(self, corners, off / most);
                    verdict.lost.push((at, corners));
                }
            }
            for &(f, off) in &found.undecided {
                if let Some(corners) = nearest(centroid(target.triangles()[f.index()])) {
                    verdict.note(self, corners, off / most);
                }
            }
        }
        for f in new_crossings(&soup, &self.reference.soup, watch)? {
            verdict.crossing += 1;
            verdict.wish(self, corners(f), CROSSING);
        }
        Ok(verdict)
    }

    /// Moves vertices to points of the reference that would be lost else, and keeps them there.
    pub(super) fn pull(&mut self, lost: &[(DVec3, [VertexId; 3])]) {
        for &(at, corners) in lost {
            let foot = self.project(at, corners[0]).face;
            let may_move = |v: &VertexId| {
                self.mesh.vertex_is_live(*v) && self.mesh.vertex_freedom(*v) == Freedom::Free && !self.pinned[v.index()]
            };
            let mut near: Vec<VertexId> = corners.into_iter().filter(may_move).collect();
            near.sort_by(|&v, &w| self.point(v).distance(at).total_cmp(&self.point(w).distance(at)).then(v.cmp(&w)));
            if let Some(v) = near.into_iter().find(|&v| self.move_to(v, at, foot, PULLED)) {
                self.pinned[v.index()] = true;
                self.wake(v);
            }
        }
    }

    /// Lowers sizes where edges cross strips between curves.
    pub(super) fn lower_in_strips(&mut self) {
        let mut wishes = Vec::new();
        for e in self.mesh.edges().filter(|&e| self.mesh.edge_freedom(e) == Freedom::Free) {
            let ends = self.mesh.ends(e);
            if ends.iter().all(|&v| self.mesh.vertex_freedom(v) != Freedom::Free) && !self.cuts_corner(e) {
                wishes.extend(ends.map(|v| (v, OF_STRIP * self.length(e))));
            }
        }
        for (v, size) in wishes {
            if size < self.sizing.at(v) {
                self.sizing.lower(v, size);
            }
        }
        self.set_sizes();
    }

    /// Whether an edge joins neighbours of a corner between curves.
    fn cuts_corner(&self, e: EdgeId) -> bool {
        let is_curve = |side| self.mesh.edge_freedom(edge_of(side)) != Freedom::Free;
        [halfedge_of(e), twin(halfedge_of(e))]
            .into_iter()
            .any(|h| self.mesh.face(h).is_some() && is_curve(self.mesh.next(h)) && is_curve(self.mesh.prev(h)))
    }
}

/// Faces that meet others where those of the reference do not, or all that meet where they do so along too far.
fn new_crossings(mesh: &Soup, reference: &Soup, watch: &Watch) -> Result<Vec<FaceId>, Cancelled> {
    let subject = Subject::new(mesh, None, watch);
    let pairs = &subject.intersections().pairs;
    watch.check()?;
    if pairs.is_empty() {
        return Ok(Vec::new());
    }
    let found = compare(&subject, &Subject::new(reference, None, watch));
    watch.check()?;
    Ok(match (found.is_old(), found.elsewhere.is_empty()) {
        (true, _) => Vec::new(),
        (false, false) => found.elsewhere,
        (false, true) => faces_of(pairs),
    })
}

impl Verdict {
    /// Whether nothing is left to do.
    pub(super) fn is_clean(&self) -> bool {
        self.faults() == 0
    }

    /// How much is left to do.
    pub(super) fn faults(&self) -> usize {
        self.places + self.crossing
    }

    /// Whether a mesh of so many faces meets itself in more places than it is off elsewhere, in more than `before`, and
    /// not just in a few: smaller sizes only make more of folds.
    pub(super) fn is_tangled(&self, before: usize, faces: usize) -> bool {
        self.crossing > self.places.max(before).max(faces / A_FEW)
    }

    fn note(&mut self, work: &Work<'_>, corners: [VertexId; 3], excess: f64) {
        self.places += 1;
        self.wish(work, corners, excess);
    }

    fn wish(&mut self, work: &Work<'_>, corners: [VertexId; 3], excess: f64) {
        let [least, most] = AT_ONCE;
        let factor = (AIM / excess).sqrt().clamp(least, most);
        let longest = triangle_size(corners.map(|v| work.point(v)));
        self.wishes.extend(corners.map(|v| (v, factor * longest.min(work.sizing.at(v)))));
    }
}
