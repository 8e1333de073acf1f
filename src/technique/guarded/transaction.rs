//! Transactions: several edits whose outcome is kept or undone as a whole.
//!
//! They are done on a copy of their surroundings first ([`Draft`]), where topology and freedom answer as on the mesh
//! and single edits may make things worse. Only the outcome is held against thresholds, tolerance and embedding, as one
//! edit; where it passes, the edits are done on the mesh.
//! Not for vertices and edges in groups of their own: the copy does not count what is left of those.
//! Cost: O(faces in the copy) for each edit, some 80 faces.

use glam::DVec3;
use smallvec::SmallVec;

use super::copy_out::{Copied, Extent};
use super::edit::{Done, Edit};
use super::gain::Gain;
use super::keeper::Keeper;
use super::mesh::GuardedMesh;
use super::normals::{HAS_NORMAL, agree};
use super::refused::Refused;
use crate::mesh::geometry::{area_vector, closest_on_triangle, stretch, triangle_size};
use crate::mesh::halfedge::HalfedgeMesh;
use crate::mesh::{FaceId, Freedom, VertexId};
use crate::technique::quadric::Quadric;

/// No edit leaves a face worse than this, even in between.
const DEGENERATE: f64 = 1e-4;

/// Copies of more faces are not made.
const MOST_FACES: usize = 400;

/// Some faces copied out. Good until the next edit of the mesh.
#[derive(Debug)]
pub struct Draft {
    copied: Copied,
    age: u64,
}

/// A draft after some edits.
#[derive(Clone, Debug)]
pub struct Trial<'d> {
    draft: &'d Draft,
    mesh: HalfedgeMesh,
    edits: SmallVec<[(Edit, Done); 4]>,
    /// Faces that a split has halved: which half keeps the number is for the mesh to say, not for the copy.
    halved: SmallVec<[FaceId; 4]>,
    /// Planes and lines by vertex; empty where the tolerance is a certified distance.
    quadrics: Vec<[Quadric; 2]>,
}

/// A face before an edit.
struct Before {
    face: FaceId,
    normal: DVec3,
    is_good: bool,
}

impl Draft {
    /// Whether a face of the copy may change; new ones may.
    pub fn is_core(&self, f: FaceId) -> bool {
        self.copied.core.get(f.index()).copied().unwrap_or(true)
    }

    /// The copy before any edit.
    pub fn begin(&self, guarded: &GuardedMesh<'_>) -> Trial<'_> {
        let of = |v: &VertexId| [*guarded.quadrics.planes(*v), guarded.quadrics.lines(*v)];
        let is_certified = guarded.keeper.is_certified();
        let quadrics = if is_certified { Vec::new() } else { self.copied.vertices.iter().map(of).collect() };
        let (edits, halved) = (SmallVec::new(), SmallVec::new());
        Trial { draft: self, mesh: self.copied.mesh.clone(), edits, halved, quadrics }
    }
}

impl Trial<'_> {
    /// The copy as the edits leave it.
    pub fn mesh(&self) -> &HalfedgeMesh {
        &self.mesh
    }

    /// One edit more, by the copy's numbers, where topology, freedom and the directions of the faces admit it.
    ///
    /// # Errors
    /// The first test that refuses it.
    pub fn with(&self, guarded: &GuardedMesh<'_>, edit: Edit) -> Result<Self, Refused> {
        let touched = edit.touched(&self.mesh)?;
        // Beyond the faces that may change the copy ends, so that it would show one side of an edge only.
        let cuts = matches!(edit, Edit::Flip { .. } | Edit::Split { .. });
        if cuts && !touched.iter().all(|&f| self.draft.is_core(f)) {
            return Err(Refused::Extent);
        }
        let before: SmallVec<[Before; 16]> = touched.iter().map(|&f| Before::of(&self.mesh, f)).collect();
        let mut next = self.clone();
        let done = edit.apply(&mut next.mesh)?;
        next.edits.push((next.as_done(edit, done), done));
        if matches!(edit, Edit::Split { .. }) {
            next.halved.extend(touched.iter().copied());
        }
        let made = (self.mesh.face_slots()..next.mesh.face_slots()).map(FaceId::new);
        let is_flip = matches!(edit, Edit::Flip { .. });
        for f in touched.iter().copied().filter(|&f| next.mesh.face_is_live(f)).chain(made) {
            let points = next.mesh.corner_points(f);
            if stretch(points) < DEGENERATE {
                return Err(Refused::Shape);
            }
            if turns(&before, f, area_vector(points), is_flip) {
                return Err(Refused::FoldOver);
            }
        }
        if next.follow_quadrics(guarded, edit, done) { Ok(next) } else { Err(Refused::Tolerance) }
    }

    /// An edit that leaves the mesh no choice: the copy keeps vertices at its edge, which the mesh may be free to move.
    fn as_done(&self, edit: Edit, done: Done) -> Edit {
        match (edit, done) {
            (Edit::Collapse { ends, .. }, Done::Merged { kept, .. })
                if self.mesh.vertex_freedom(kept) == Freedom::Keep =>
            {
                Edit::Collapse { ends, to: self.mesh.point(kept) }
            }
            _ => edit,
        }
    }

    /// Planes and lines follow the edit; whether the tolerance admits it.
    fn follow_quadrics(&mut self, guarded: &GuardedMesh<'_>, edit: Edit, done: Done) -> bool {
        if guarded.keeper.is_certified() {
            return true;
        }
        let moved = match (edit, done) {
            (_, Done::Merged { gone, kept }) => {
                let [planes, lines] = self.quadrics[gone.index()];
                let own = &mut self.quadrics[kept.index()];
                *own = [own[0].plus(&planes), own[1].plus(&lines)];
                kept
            }
            (_, Done::Made(v)) => {
                self.quadrics.push([guarded.quadrics.around(&self.mesh, v), Quadric::default()]);
                v
            }
            (Edit::Move { vertex, .. }, Done::Moved) => vertex,
            (_, Done::Moved | Done::Flipped) => return true,
        };
        let [planes, lines] = &self.quadrics[moved.index()];
        let at = self.mesh.point(moved) - guarded.quadrics.origin;
        guarded.keeper.admits_point(planes, lines, at)
    }

    /// Whether a face is what it was, under the same number on the mesh.
    fn is_unchanged(&self, f: FaceId) -> bool {
        if self.halved.contains(&f) {
            return false;
        }
        let before = &self.draft.copied.mesh;
        let (mut old, mut new) = (before.corners(f), self.mesh.corners(f));
        old.sort_unstable();
        new.sort_unstable();
        old == new && old.iter().all(|&v| before.point(v) == self.mesh.point(v))
    }

    /// No vertex has more edges than allowed, or than it had.
    fn keeps_valence(&self, guarded: &GuardedMesh<'_>) -> bool {
        let Copied { mesh, vertices, .. } = &self.draft.copied;
        self.mesh.vertices().all(|v| {
            let now = self.mesh.valence(v);
            match vertices.get(v.index()) {
                Some(&original) => now <= guarded.most_edges(original) || now <= mesh.valence(v),
                None => now <= guarded.limits.max_valence,
            }
        })
    }

    /// Every part of a curve that is new lies near the reference's curves.
    fn keeps_curves(&self, keeper: &Keeper<'_>) -> bool {
        let Keeper::Distance { curves, .. } = keeper else { return true };
        let (mesh, Copied { mesh: before, vertices, .. }) = (&self.mesh, &self.draft.copied);
        mesh.edges().filter(|&e| mesh.edge_freedom(e) != Freedom::Free).all(|e| {
            let ends = mesh.ends(e);
            let is_old = ends.iter().all(|&v| v.index() < vertices.len() && mesh.point(v) == before.point(v))
                && before.find_halfedge(ends[0], ends[1]).is_some();
            is_old || curves.admit(ends.map(|v| mesh.point(v)))
        })
    }
}

/// The verb.
impl GuardedMesh<'_> {
    /// A copy of the faces at `inner`, which may change, with all that their checks look at.
    ///
    /// # Errors
    /// Groups of vertices or edges among them, or too many faces.
    pub fn draft(&self, inner: impl IntoIterator<Item = VertexId>) -> Result<Draft, Refused> {
        let extent = Extent::of(&self.mesh, inner.into_iter());
        if extent.faces.len() > MOST_FACES {
            return Err(Refused::Extent);
        }
        if extent.known.iter().any(|&v| self.mesh.is_grouped(v)) {
            return Err(Refused::Features);
        }
        Ok(Draft { copied: extent.copy(&self.mesh).ok_or(Refused::Topology)?, age: self.age })
    }

    /// Does the edits of a trial where all tests admit their outcome, as one edit, and it gains.
    ///
    /// # Errors
    /// The first test that refuses it; nothing is done then.
    pub fn commit(&mut self, trial: &Trial<'_>, gain: Gain) -> Result<(), Refused> {
        if trial.draft.age != self.age {
            return Err(Refused::Outdated);
        }
        let successors = self.replace(trial);
        if self.patch.old.is_empty() {
            return Err(Refused::Gain);
        }
        let before = self.tally(&self.patch.old, gain);
        self.gains(&before, gain)?;
        if !trial.keeps_valence(self) {
            return Err(Refused::Valence);
        }
        if !trial.keeps_curves(&self.keeper) {
            return Err(Refused::Curves);
        }
        if self.turns_away() {
            return Err(Refused::FoldOver);
        }
        self.admit_patch()?;
        self.replay(trial, &successors)
    }

    /// Does edits one after the other where all tests admit their outcome, as one edit, and it gains; else none.
    ///
    /// Vertices made by splits are numbered on from [`HalfedgeMesh::vertex_slots`]; of two that became one, either
    /// number stands for it afterwards.
    ///
    /// # Errors
    /// The first test that refuses an edit, or the outcome; nothing is done then.
    pub fn transact(&mut self, edits: &[Edit], gain: Gain) -> Result<(), Refused> {
        let slots = self.mesh.vertex_slots();
        let named = edits.iter().flat_map(Edit::named);
        let is_there = |v: &VertexId| v.index() < slots && self.mesh.vertex_is_live(*v);
        let draft = self.draft(named.filter(is_there))?;
        let mut names: Vec<(VertexId, VertexId)> =
            draft.copied.vertices.iter().enumerate().map(|(local, &v)| (v, VertexId::new(local))).collect();
        let mut trial = draft.begin(self);
        let mut made = slots;
        for edit in edits {
            let local = |v| names.iter().find(|&&(name, _)| name == v).map(|&(_, local)| local);
            trial = trial.with(self, edit.renumbered(local).ok_or(Refused::Topology)?)?;
            match trial.edits.last() {
                Some(&(_, Done::Merged { gone, kept })) => {
                    names.iter_mut().filter(|(_, local)| *local == gone).for_each(|(_, local)| *local = kept);
                }
                Some(&(_, Done::Made(v))) => {
                    names.push((VertexId::new(made), v));
                    made += 1;
                }
                Some((_, Done::Flipped | Done::Moved)) | None => {}
            }
        }
        self.commit(&trial, gain)
    }

    /// Fills the patch with the faces that a trial changed; returns the copy's numbers of their successors.
    fn replace(&mut self, trial: &Trial<'_>) -> Vec<FaceId> {
        let faces = &trial.draft.copied.faces;
        let mut successors = Vec::new();
        self.patch.clear();
        for f in (0..faces.len()).map(FaceId::new) {
            let is_live = trial.mesh.face_is_live(f);
            if is_live && trial.is_unchanged(f) {
                continue;
            }
            self.patch.old.push(faces[f.index()]);
            if is_live {
                successors.push(f);
            }
        }
        let made = (faces.len()..trial.mesh.face_slots()).map(FaceId::new);
        successors.extend(made.filter(|&f| trial.mesh.face_is_live(f)));
        self.patch.points.extend(successors.iter().map(|&f| trial.mesh.corner_points(f)));
        successors
    }

    /// Whether a successor looks away from all good faces near it.
    fn turns_away(&self) -> bool {
        let is_good = |&&f: &&FaceId| self.stretch(f) >= HAS_NORMAL;
        let good: SmallVec<[[DVec3; 3]; 32]> =
            self.patch.old.iter().filter(is_good).map(|&f| self.mesh.corner_points(f)).collect();
        self.patch.points.iter().any(|points| {
            let centre = (points[0] + points[1] + points[2]) / 3.0;
            let distance = |face: &[DVec3; 3]| closest_on_triangle(centre, *face).distance_squared.sqrt();
            let nearest = good.iter().map(distance).fold(f64::INFINITY, f64::min);
            let near = 0.1 * triangle_size(*points);
            let agrees = |face: &[DVec3; 3]| agree(area_vector(*points), area_vector(*face));
            !good.is_empty() && !good.iter().any(|face| distance(face) <= nearest + near && agrees(face))
        })
    }

    /// Does the edits on the mesh; the copy admitted them, so the mesh does.
    fn replay(&mut self, trial: &Trial<'_>, successors: &[FaceId]) -> Result<(), Refused> {
        let mut now = trial.draft.copied.vertices.clone();
        for &(edit, in_copy) in &trial.edits {
            let edit = edit.renumbered(|v| now.get(v.index()).copied()).ok_or(Refused::Topology)?;
            let done = edit.apply(&mut self.mesh);
            debug_assert!(done.is_ok(), "the copy admitted {edit:?}, the mesh does not");
            match (in_copy, done?) {
                (Done::Merged { kept, .. }, Done::Merged { gone, kept: stayed }) => {
                    now[kept.index()] = stayed;
                    self.quadrics.merge(gone, stayed);
                    self.counts.collapses += 1;
                }
                (_, Done::Made(v)) => {
                    now.push(v);
                    self.quadrics.found(&self.mesh, v);
                    self.counts.splits += 1;
                }
                (_, Done::Flipped) => self.counts.flips += 1,
                (_, Done::Moved) => self.counts.moves += 1,
                (_, Done::Merged { .. }) => return Err(Refused::Topology),
            }
        }
        for &f in successors {
            let [a, b, _] = trial.mesh.corners(f).map(|v| now[v.index()]);
            let face = self.mesh.find_halfedge(a, b).and_then(|h| self.mesh.face(h));
            self.patch.ids.extend(face);
        }
        self.settle();
        Ok(())
    }
}

impl Before {
    fn of(mesh: &HalfedgeMesh, face: FaceId) -> Self {
        let points = mesh.corner_points(face);
        Self { face, normal: area_vector(points), is_good: stretch(points) >= HAS_NORMAL }
    }
}

/// Whether a face turns too far from what it was, or from what it was made of.
fn turns(before: &[Before], f: FaceId, normal: DVec3, is_flip: bool) -> bool {
    let own = before.iter().find(|b| b.face == f && b.is_good && !is_flip);
    if let Some(own) = own {
        return !agree(normal, own.normal);
    }
    let mut good = before.iter().filter(|b| b.is_good).peekable();
    if good.peek().is_some() {
        return !good.any(|b| agree(normal, b.normal));
    }
    normal.dot(before.iter().map(|b| b.normal).sum()) <= 0.0
}
