//! A few faces copied out of the workshop, to try sequences of edits on that alone make things worse.
//!
//! The copy holds the faces that may change (those at the inner vertices) and one ring of faces round them, so that
//! every check of [`crate::mesh::edit`] answers on the copy as it would in the workshop. Only the outcome of a sequence
//! is held against thresholds, tolerance and embedding, as one edit; then the sequence is done in the workshop.
//! Not for vertices and edges in groups of their own: the copy does not count what is left of those.
//! Cost: O(faces in the copy) for each edit tried, some 80 faces.

use glam::DVec3;
use smallvec::SmallVec;

use super::edit::{Done, Edit};
use super::raise::reachable;
use crate::mesh::geometry::{area_vector, closest_on_triangle, stretch, triangle_size};
use crate::mesh::halfedge::{HalfedgeMesh, edge_of};
use crate::mesh::{EdgeMark, FaceId, Freedom, LockRules, MarkCause, Rim, Surface, VertexId, edge_key, resolve_freedom};
use crate::technique::collapse::limits::least_stretch;
use crate::technique::collapse::priority::Tally;
use crate::technique::collapse::star::{HAS_NORMAL, LEAST_TURN_COSINE};
use crate::technique::collapse::{Editor, Keeper};
use crate::technique::quadric::Quadric;

/// No edit leaves a face worse than this, even in between.
const DEGENERATE: f64 = 1e-4;

/// Copies of more faces are not made.
const MOST_FACES: usize = 400;

/// The copy, as it was taken out.
#[derive(Debug)]
pub(super) struct Cavity {
    mesh: HalfedgeMesh,
    /// The workshop's numbers of the copy's vertices and faces.
    vertices: Vec<VertexId>,
    faces: Vec<FaceId>,
    /// Whether a face may change.
    core: Vec<bool>,
    threshold: f64,
}

/// The copy after some edits.
#[derive(Clone, Debug)]
pub(super) struct Trial {
    pub(super) mesh: HalfedgeMesh,
    edits: SmallVec<[(Edit, Done); 4]>,
    /// Planes and lines by vertex; empty where the tolerance is a certified distance.
    quadrics: Vec<[Quadric; 2]>,
    /// What the faces lack to what they can reach: the sum of squares of the shares.
    pub(super) shortfall: f64,
}

/// A face before an edit.
struct Before {
    face: FaceId,
    normal: DVec3,
    is_good: bool,
}

impl Cavity {
    /// The faces round the corners of `f` and round their neighbours; `None` where they are too many or carry groups.
    pub(super) fn around(editor: &Editor<'_>, f: FaceId, threshold: f64) -> Option<Self> {
        let mesh = editor.mesh();
        let corners = mesh.corners(f).to_vec();
        let wide = sorted(corners.iter().flat_map(|&v| mesh.neighbours(v)).chain(corners.iter().copied()));
        [wide, sorted(corners.into_iter())].iter().find_map(|inner| Self::of(editor, inner, threshold))
    }

    fn of(editor: &Editor<'_>, inner: &[VertexId], threshold: f64) -> Option<Self> {
        let mesh = editor.mesh();
        let changing = sorted(inner.iter().flat_map(|&v| mesh.faces_around(v)));
        let known = sorted(changing.iter().flat_map(|&f| mesh.corners(f)));
        let faces = sorted(known.iter().flat_map(|&v| mesh.faces_around(v)));
        if faces.len() > MOST_FACES || known.iter().any(|&v| mesh.is_grouped(v)) {
            return None;
        }
        let (surface, vertices) = copy(mesh, &faces, &known);
        let rules = LockRules { rim: Rim::Free, ..LockRules::default() };
        let mut freedom = resolve_freedom(&surface, &rules).ok()?;
        for (v, &at) in surface.points.ids().zip(&vertices) {
            let may_change = inner.binary_search(&at).is_ok();
            freedom.vertices[v] = if may_change { mesh.vertex_freedom(at) } else { Freedom::Keep };
        }
        let core = faces.iter().map(|f| changing.binary_search(f).is_ok()).collect();
        let mesh = HalfedgeMesh::new(&surface, &freedom).ok()?;
        Some(Self { mesh, vertices, faces, core, threshold })
    }

    /// The copy before any edit.
    pub(super) fn start(&self, editor: &Editor<'_>) -> Trial {
        let of = |v: &VertexId| [*editor.quadrics.planes(*v), editor.quadrics.lines(*v)];
        let quadrics = if editor.keeper.is_certified() { Vec::new() } else { self.vertices.iter().map(of).collect() };
        let mut trial = Trial { mesh: self.mesh.clone(), edits: SmallVec::new(), quadrics, shortfall: 0.0 };
        trial.shortfall = self.shortfall(&trial.mesh);
        trial
    }

    /// Whether a face of the copy may change.
    pub(super) fn is_core(&self, f: FaceId) -> bool {
        self.core.get(f.index()).copied().unwrap_or(true)
    }

    /// The core faces below what they can reach, worst first.
    pub(super) fn worst(&self, mesh: &HalfedgeMesh) -> Vec<FaceId> {
        let rated = mesh.faces().filter(|&f| self.is_core(f)).map(|f| (stretch(mesh.corner_points(f)), f));
        let is_bad = |&(shape, f): &(f64, FaceId)| shape < self.threshold && shape < reachable(mesh, f, self.threshold);
        let mut bad: Vec<(f64, FaceId)> = rated.filter(is_bad).collect();
        bad.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        bad.into_iter().map(|(_, f)| f).collect()
    }

    fn shortfall(&self, mesh: &HalfedgeMesh) -> f64 {
        let lack = |f| {
            let shape = stretch(mesh.corner_points(f));
            if shape >= self.threshold { 0.0 } else { (1.0 - shape / reachable(mesh, f, self.threshold)).max(0.0) }
        };
        mesh.faces().filter(|&f| self.is_core(f)).map(|f| lack(f).powi(2)).sum()
    }

    /// One edit more, where topology, freedom and the directions of the faces admit it.
    pub(super) fn after(&self, editor: &Editor<'_>, trial: &Trial, edit: Edit) -> Option<Trial> {
        let touched = edit.touched(&trial.mesh)?;
        let before: SmallVec<[Before; 16]> = touched.iter().map(|&f| Before::of(&trial.mesh, f)).collect();
        let mut next = trial.clone();
        let done = edit.apply(&mut next.mesh)?;
        next.edits.push((edit, done));
        let made = (trial.mesh.face_slots()..next.mesh.face_slots()).map(FaceId::new);
        let is_flip = matches!(edit, Edit::Flip { .. });
        for f in touched.iter().copied().filter(|&f| next.mesh.face_is_live(f)).chain(made) {
            let points = next.mesh.corner_points(f);
            if stretch(points) < DEGENERATE || turns(&before, f, area_vector(points), is_flip) {
                return None;
            }
        }
        next.follow_quadrics(editor, edit, done)?;
        next.shortfall = self.shortfall(&next.mesh);
        Some(next)
    }

    /// Does the edits of a trial in the workshop, where all tests admit their outcome and it mends.
    pub(super) fn commit(&self, editor: &mut Editor<'_>, trial: &Trial) -> bool {
        let Some(successors) = self.replace(editor, trial) else { return false };
        let admitted = self.mends(editor)
            && self.keeps_valence(editor, trial)
            && self.keeps_curves(editor, trial)
            && !turns_away(editor)
            && editor.patch_admitted();
        admitted && self.replay(editor, trial, &successors)
    }

    /// Fills the editor's patch with the faces that changed; returns the copy's numbers of their successors.
    fn replace(&self, editor: &mut Editor<'_>, trial: &Trial) -> Option<Vec<FaceId>> {
        let mut successors = Vec::new();
        editor.patch.clear();
        for f in (0..self.faces.len()).map(FaceId::new) {
            let is_live = trial.mesh.face_is_live(f);
            if is_live && self.is_unchanged(trial, f) {
                continue;
            }
            editor.patch.old.push(self.faces[f.index()]);
            if is_live {
                successors.push(f);
            }
        }
        let made = (self.faces.len()..trial.mesh.face_slots()).map(FaceId::new);
        successors.extend(made.filter(|&f| trial.mesh.face_is_live(f)));
        editor.patch.points.extend(successors.iter().map(|&f| trial.mesh.corner_points(f)));
        (!editor.patch.old.is_empty()).then_some(successors)
    }

    fn is_unchanged(&self, trial: &Trial, f: FaceId) -> bool {
        let (mut old, mut new) = (self.mesh.corners(f), trial.mesh.corners(f));
        old.sort_unstable();
        new.sort_unstable();
        old == new && old.iter().all(|&v| self.mesh.point(v) == trial.mesh.point(v))
    }

    /// Stretch and size of the successors against those of the faces they replace.
    fn mends(&self, editor: &Editor<'_>) -> bool {
        let mut before = Tally::short_of(self.threshold);
        for &f in &editor.patch.old {
            before.add(editor.stretch(f), editor.size(f));
        }
        let mut after = Tally::short_of(self.threshold);
        let floor = least_stretch(self.threshold, before.stretch_min);
        for points in &editor.patch.points {
            let (shape, size) = (stretch(*points), triangle_size(*points));
            if shape < floor || size > editor.limits().ceiling(points[0], before.size_max) {
                return false;
            }
            after.add(shape, size);
        }
        after.mends(&before)
    }

    /// No vertex has more edges than allowed, or than it had.
    fn keeps_valence(&self, editor: &Editor<'_>, trial: &Trial) -> bool {
        let most = editor.limits().max_valence;
        let had = |v: VertexId| if v.index() < self.vertices.len() { self.mesh.valence(v) } else { 0 };
        trial.mesh.vertices().all(|v| {
            let now = trial.mesh.valence(v);
            now <= most || now <= had(v)
        })
    }

    /// Every part of a curve that is new lies near the reference's curves.
    fn keeps_curves(&self, editor: &Editor<'_>, trial: &Trial) -> bool {
        let Keeper::Distance { curves, .. } = &editor.keeper else { return true };
        let mesh = &trial.mesh;
        mesh.edges().filter(|&e| mesh.edge_freedom(e) != Freedom::Free).all(|e| {
            let ends = mesh.ends(e);
            let is_old = ends.iter().all(|&v| v.index() < self.vertices.len() && mesh.point(v) == self.mesh.point(v))
                && self.mesh.find_halfedge(ends[0], ends[1]).is_some();
            is_old || curves.admit(ends.map(|v| mesh.point(v)))
        })
    }

    /// Does the edits in the workshop; the copy admitted them, so the workshop does.
    fn replay(&self, editor: &mut Editor<'_>, trial: &Trial, successors: &[FaceId]) -> bool {
        let mut now = self.vertices.clone();
        for &(edit, in_copy) in &trial.edits {
            let done = edit.renumbered(|v| now[v.index()]).apply(&mut editor.mesh);
            debug_assert!(done.is_some(), "the copy admitted {edit:?}, the workshop does not");
            match (in_copy, done) {
                (Done::Merged { kept, .. }, Some(Done::Merged { gone, kept: stayed })) => {
                    now[kept.index()] = stayed;
                    editor.quadrics.merge(gone, stayed);
                    editor.counts.collapses += 1;
                }
                (_, Some(Done::Made(v))) => {
                    now.push(v);
                    editor.quadrics.found(&editor.mesh, v);
                    editor.counts.splits += 1;
                }
                (_, Some(Done::Flipped)) => editor.counts.flips += 1,
                (_, Some(Done::Moved)) => editor.counts.moves += 1,
                (_, Some(Done::Merged { .. }) | None) => return false,
            }
        }
        for &f in successors {
            let [a, b, _] = trial.mesh.corners(f).map(|v| now[v.index()]);
            let face = editor.mesh.find_halfedge(a, b).and_then(|h| editor.mesh.face(h));
            editor.patch.ids.extend(face);
        }
        editor.settle();
        true
    }
}

/// Whether a successor looks away from all good faces near it.
fn turns_away(editor: &Editor<'_>) -> bool {
    let mesh = editor.mesh();
    let good: SmallVec<[[DVec3; 3]; 32]> =
        editor.patch.old.iter().filter(|&&f| editor.stretch(f) >= HAS_NORMAL).map(|&f| mesh.corner_points(f)).collect();
    editor.patch.points.iter().any(|points| {
        let centre = (points[0] + points[1] + points[2]) / 3.0;
        let distance = |face: &[DVec3; 3]| closest_on_triangle(centre, *face).distance_squared.sqrt();
        let nearest = good.iter().map(distance).fold(f64::INFINITY, f64::min);
        let near = 0.1 * triangle_size(*points);
        let agrees = |face: &[DVec3; 3]| agree(area_vector(*points), area_vector(*face));
        !good.is_empty() && !good.iter().any(|face| distance(face) <= nearest + near && agrees(face))
    })
}

impl Trial {
    /// Planes and lines follow the edit; `None` where the tolerance does not admit it.
    fn follow_quadrics(&mut self, editor: &Editor<'_>, edit: Edit, done: Done) -> Option<()> {
        if editor.keeper.is_certified() {
            return Some(());
        }
        let moved = match done {
            Done::Merged { gone, kept } => {
                let [planes, lines] = self.quadrics[gone.index()];
                let own = &mut self.quadrics[kept.index()];
                *own = [own[0].plus(&planes), own[1].plus(&lines)];
                kept
            }
            Done::Made(v) => {
                self.quadrics.push([editor.quadrics.around(&self.mesh, v), Quadric::default()]);
                v
            }
            Done::Moved => edit.vertex()?,
            Done::Flipped => return Some(()),
        };
        let [planes, lines] = &self.quadrics[moved.index()];
        let at = self.mesh.point(moved) - editor.quadrics.origin;
        editor.keeper.admits_point(planes, lines, at).then_some(())
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

fn agree(m: DVec3, n: DVec3) -> bool {
    let scale = (m.length_squared() * n.length_squared()).sqrt();
    scale > 0.0 && m.dot(n) >= LEAST_TURN_COSINE * scale
}

fn sorted<T: Ord>(items: impl Iterator<Item = T>) -> Vec<T> {
    let mut all: Vec<T> = items.collect();
    all.sort_unstable();
    all.dedup();
    all
}

/// A surface of the faces, and the workshop's number of each of its vertices. Vertices that are not `known` appear once
/// for each fan of the faces round them, so that the surface has fans only.
fn copy(mesh: &HalfedgeMesh, faces: &[FaceId], known: &[VertexId]) -> (Surface, Vec<VertexId>) {
    let mut vertices = known.to_vec();
    let mut surface = Surface::default();
    let mut fans: Vec<(VertexId, FaceId, VertexId)> = Vec::new();
    for &f in faces {
        let corners = mesh.corners(f).map(|v| match known.binary_search(&v) {
            Ok(place) => VertexId::new(place),
            Err(_) => fan_of(mesh, faces, v, f, &mut fans, &mut vertices),
        });
        surface.faces.push(corners);
    }
    surface.points = vertices.iter().map(|&v| mesh.point(v)).collect();
    for (local, &f) in faces.iter().enumerate() {
        let first = mesh.face_halfedge(f);
        for h in [first, mesh.next(first), mesh.prev(first)] {
            let freedom = mesh.edge_freedom(edge_of(h));
            if freedom != Freedom::Free {
                let corners = surface.faces[FaceId::new(local)];
                let local = |v| corners.into_iter().find(|c| vertices[c.index()] == v);
                if let (Some(a), Some(b)) = (local(mesh.origin(h)), local(mesh.target(h))) {
                    surface.carried.mark(edge_key(a, b), EdgeMark { freedom, cause: MarkCause::Feature });
                }
            }
        }
        let class = mesh.face_class(f).to_string();
        surface.carried.groups.faces.entry(class).or_default().push(FaceId::new(local));
    }
    (surface, vertices)
}

/// The copy's number of `v` in the fan of the faces that `f` belongs to.
fn fan_of(
    mesh: &HalfedgeMesh,
    faces: &[FaceId],
    v: VertexId,
    f: FaceId,
    fans: &mut Vec<(VertexId, FaceId, VertexId)>,
    vertices: &mut Vec<VertexId>,
) -> VertexId {
    if let Some(place) = fans.iter().position(|&(w, g, _)| (w, g) == (v, f)) {
        return fans[place].2;
    }
    let number = VertexId::new(vertices.len());
    vertices.push(v);
    let is_in = |g: FaceId| faces.binary_search(&g).is_ok();
    // Outgoing half-edges run round the vertex; from `f` both ways until a face is not in the copy.
    let around: SmallVec<[Option<FaceId>; 16]> = mesh.outgoing(v).map(|h| mesh.face(h).filter(|&g| is_in(g))).collect();
    let start = around.iter().position(|&g| g == Some(f)).unwrap_or(0);
    let count = around.len();
    let onwards = (1..count).map(|k| around[(start + k) % count]).take_while(Option::is_some).flatten();
    let backwards = (1..count).map(|k| around[(start + count - k) % count]).take_while(Option::is_some).flatten();
    let fan = sorted(onwards.chain(backwards));
    fans.push((v, f, number));
    fans.extend(fan.into_iter().map(|g| (v, g, number)));
    number
}
