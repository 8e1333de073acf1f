//! A search for short sequences of edits that mend a face where no single edit does: two collapses that together close
//! a wedge between curves, a split and a collapse that flatten a cap, a flip that makes way for a move.
//!
//! A beam search over copies of the face's surroundings ([`Draft`]): of all edits at the worst faces the ones that
//! leave least to mend are followed further, even if the first of them make things worse. Deterministic: ties keep
//! their order. Cost: some 5000 edits tried on a copy, less than a tenth of a second a face; so it comes last.

use glam::DVec3;

use crate::mesh::edit::{Placement, check_collapse};
use crate::mesh::geometry::{angle, stretch};
use crate::mesh::halfedge::{HalfedgeMesh, edge_of, halfedge_of, twin};
use crate::mesh::{EdgeId, FaceId, Freedom, HalfedgeId, VertexId};
use crate::metric::shape::best_stretch_with_angle;
use crate::technique::guarded::{Draft, Edit, Gain, GuardedMesh, Trial};

/// A face this near to the best that its corner between two curves allows is left alone.
const NEAR_BEST: f64 = 0.95;

/// Radians below which the angle between two curves may be what limits a face.
const SHARP: f64 = 0.5;

/// Edits in a sequence.
const DEPTH: usize = 5;

/// Sequences followed further.
const BEAM: usize = 16;

/// Sequences tested in full at each length.
const MOST_TESTED: usize = 16;

/// Faces below the threshold, worst first, whose surroundings are edited next.
const WORST: usize = 2;

/// The part of what the faces lack that a sequence must make good.
const LEAST_GAIN: f64 = 0.01;

/// A draft after some edits, rated.
#[derive(Clone, Debug)]
struct Rated<'d> {
    trial: Trial<'d>,
    /// What the faces lack to what they can reach: the sum of squares of the shares.
    shortfall: f64,
}

/// The surroundings of a face, and what its faces should reach.
struct Cavity<'d> {
    draft: &'d Draft,
    threshold: f64,
}

/// Mends a face by a short sequence of edits; `false` where none was found.
pub(super) fn mend_by_search(guarded: &mut GuardedMesh<'_>, f: FaceId, threshold: f64) -> bool {
    let Some(draft) = surroundings(guarded, f) else { return false };
    let cavity = Cavity { draft: &draft, threshold };
    let start = cavity.rate(draft.begin(guarded));
    let enough = (1.0 - LEAST_GAIN) * start.shortfall;
    let mut beam = vec![start];
    for _ in 0..DEPTH {
        let next = follow(guarded, &cavity, &beam);
        let worth = next.iter().take_while(|t| t.shortfall < enough).take(MOST_TESTED);
        if worth.into_iter().any(|t| guarded.commit(&t.trial, Gain::Mend(threshold)).is_ok()) {
            return true;
        }
        beam = next;
        beam.truncate(BEAM);
    }
    false
}

/// The faces round the corners of `f` and round their neighbours, or where those are too many or carry groups, round
/// the corners alone; `None` where that does not go either.
fn surroundings(guarded: &GuardedMesh<'_>, f: FaceId) -> Option<Draft> {
    let mesh = guarded.mesh();
    let corners = mesh.corners(f);
    let wide = corners.into_iter().flat_map(|v| mesh.neighbours(v)).chain(corners);
    guarded.draft(wide).or_else(|_| guarded.draft(corners)).ok()
}

impl Cavity<'_> {
    /// The core faces below what they can reach, worst first.
    fn worst(&self, mesh: &HalfedgeMesh) -> Vec<FaceId> {
        let rated = mesh.faces().filter(|&f| self.draft.is_core(f)).map(|f| (stretch(mesh.corner_points(f)), f));
        let is_bad = |&(shape, f): &(f64, FaceId)| shape < self.threshold && shape < reachable(mesh, f, self.threshold);
        let mut bad: Vec<(f64, FaceId)> = rated.filter(is_bad).collect();
        bad.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        bad.into_iter().map(|(_, f)| f).collect()
    }

    fn rate<'d>(&self, trial: Trial<'d>) -> Rated<'d> {
        let mesh = trial.mesh();
        let lack = |f| {
            let shape = stretch(mesh.corner_points(f));
            if shape >= self.threshold { 0.0 } else { (1.0 - shape / reachable(mesh, f, self.threshold)).max(0.0) }
        };
        let shortfall = mesh.faces().filter(|&f| self.draft.is_core(f)).map(|f| lack(f).powi(2)).sum();
        Rated { trial, shortfall }
    }
}

/// The best outcomes of one edit more, best first.
fn follow<'d>(guarded: &GuardedMesh<'_>, cavity: &Cavity<'d>, beam: &[Rated<'d>]) -> Vec<Rated<'d>> {
    let most = BEAM.max(MOST_TESTED);
    let mut best: Vec<Rated<'d>> = Vec::new();
    for Rated { trial, .. } in beam {
        for edit in edits(guarded, cavity, trial.mesh()) {
            let Ok(next) = trial.with(guarded, edit) else { continue };
            let next = cavity.rate(next);
            let place = best.partition_point(|b| b.shortfall <= next.shortfall);
            // Equal shortfalls are nearly always the same mesh by another way.
            if place >= most || place > 0 && best[place - 1].shortfall == next.shortfall {
                continue;
            }
            best.insert(place, next);
            best.truncate(most);
        }
    }
    best
}

/// The edits at the worst faces.
fn edits(guarded: &GuardedMesh<'_>, cavity: &Cavity<'_>, mesh: &HalfedgeMesh) -> Vec<Edit> {
    let mut out = Vec::new();
    let mut edges: Vec<EdgeId> = Vec::new();
    let mut vertices: Vec<VertexId> = Vec::new();
    for f in cavity.worst(mesh).into_iter().take(WORST) {
        let corners = mesh.corners(f);
        vertices.extend(corners);
        edges.extend(corners.into_iter().flat_map(|v| mesh.outgoing(v).map(edge_of)));
        edges.extend(mesh.corners(f).into_iter().flat_map(|v| opposite_edges(mesh, v)));
        splits(guarded, cavity, mesh, f, &mut out);
    }
    vertices.sort_unstable();
    vertices.dedup();
    edges.sort_unstable();
    edges.dedup();
    for e in edges {
        collapses(guarded, mesh, e, &mut out);
        let [a, b] = mesh.ends(e);
        let is_core = |h: HalfedgeId| mesh.face(h).is_some_and(|f| cavity.draft.is_core(f));
        let h = halfedge_of(e);
        if mesh.edge_freedom(e) == Freedom::Free && is_core(h) && is_core(twin(h)) {
            out.push(Edit::Flip { ends: [a, b] });
        }
    }
    for v in vertices {
        moves(guarded, mesh, v, &mut out);
    }
    out
}

/// The edges opposite a vertex in its faces.
fn opposite_edges(mesh: &HalfedgeMesh, v: VertexId) -> impl Iterator<Item = EdgeId> + '_ {
    mesh.outgoing(v).filter(|&h| mesh.face(h).is_some()).map(|h| edge_of(mesh.next(h)))
}

fn collapses(guarded: &GuardedMesh<'_>, mesh: &HalfedgeMesh, e: EdgeId, out: &mut Vec<Edit>) {
    let Ok(plan) = check_collapse(mesh, e) else { return };
    let ends = mesh.ends(e);
    let [p, q] = ends.map(|v| mesh.point(v));
    let mut push = |to: DVec3| out.push(Edit::Collapse { ends, to });
    match plan.placement {
        Placement::Fixed(at) => push(at),
        Placement::Segment(a, b) => [a, b, 0.5 * (a + b)].into_iter().for_each(&mut push),
        Placement::Anywhere => {
            let middle = 0.5 * (p + q);
            [p, q, guarded.project(middle).unwrap_or(middle)].into_iter().for_each(&mut push);
        }
    }
}

/// Splits of a face's sides in the middle, and of the longest at the foot of its height.
fn splits(guarded: &GuardedMesh<'_>, cavity: &Cavity<'_>, mesh: &HalfedgeMesh, f: FaceId, out: &mut Vec<Edit>) {
    let first = mesh.face_halfedge(f);
    for h in [first, mesh.next(first), mesh.prev(first)] {
        if !mesh.face(twin(h)).is_none_or(|f| cavity.draft.is_core(f)) {
            continue;
        }
        let ends = [mesh.origin(h), mesh.target(h)];
        let [p, q] = ends.map(|v| mesh.point(v));
        let is_curve = mesh.edge_freedom(edge_of(h)) != Freedom::Free;
        let along = q - p;
        let foot = mesh.apex(h).map_or(0.5, |v| (mesh.point(v) - p).dot(along) / along.length_squared());
        for share in [0.5, foot] {
            if !(0.1..=0.9).contains(&share) {
                continue;
            }
            let at = p + share * along;
            let at = if is_curve { at } else { guarded.project(at).unwrap_or(at) };
            out.push(Edit::Split { ends, at });
        }
    }
}

/// Moves to the middle of the neighbours, and half the way; on a curve also towards each neighbour.
fn moves(guarded: &GuardedMesh<'_>, mesh: &HalfedgeMesh, v: VertexId, out: &mut Vec<Edit>) {
    let at = mesh.point(v);
    match mesh.vertex_freedom(v) {
        Freedom::Keep => {}
        Freedom::Free => {
            let (sum, count) = mesh.neighbours(v).fold((DVec3::ZERO, 0.0), |(s, n), w| (s + mesh.point(w), n + 1.0));
            for share in [1.0, 0.5] {
                let wish = at.lerp(sum / count, share);
                out.push(Edit::Move { vertex: v, to: guarded.project(wish).unwrap_or(wish) });
            }
        }
        Freedom::OnCurve => {
            let is_curve = |h: &HalfedgeId| mesh.edge_freedom(edge_of(*h)) != Freedom::Free;
            let ends: Vec<DVec3> = mesh.outgoing(v).filter(is_curve).map(|h| mesh.point(mesh.target(h))).collect();
            let [a, b] = ends[..] else { return };
            for wish in [0.5 * (a + b), at.lerp(a, 0.5), at.lerp(b, 0.5), at.lerp(a, 0.2), at.lerp(b, 0.2)] {
                out.extend(guarded.project_to_curve(wish).map(|to| Edit::Move { vertex: v, to }));
            }
        }
    }
}

/// The stretch a face should reach: `threshold`, or where curves meet in one of its corners too sharply for that,
/// nearly the best that the corner allows.
pub(super) fn reachable(mesh: &HalfedgeMesh, f: FaceId, threshold: f64) -> f64 {
    let first = mesh.face_halfedge(f);
    let sides = [first, mesh.next(first), mesh.prev(first)];
    let is_curve = sides.map(|h| mesh.edge_freedom(edge_of(h)) != Freedom::Free);
    let corners = sides.map(|h| mesh.point(mesh.origin(h)));
    let mut target = threshold;
    for at in 0..3 {
        let (next, before) = ((at + 1) % 3, (at + 2) % 3);
        if is_curve[at] && is_curve[before] {
            let opening = angle(corners[next] - corners[at], corners[before] - corners[at]);
            if opening < SHARP {
                target = target.min(NEAR_BEST * best_stretch_with_angle(opening));
            }
        }
    }
    target
}
