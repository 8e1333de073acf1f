//! A search for short sequences of edits that mend a face where no single edit does: two collapses that together close
//! a wedge between curves, a split and a collapse that flatten a cap, a flip that makes way for a move.
//!
//! A beam search over copies of the face's surroundings ([`Cavity`]): of all edits at the worst faces the ones that
//! leave least to mend are followed further, even if the first of them make things worse. Deterministic: ties keep
//! their order. Cost: some 5000 edits tried on a copy, less than a tenth of a second a face; so it comes last.

use glam::DVec3;

use super::cavity::{Cavity, Trial};
use super::edit::Edit;
use crate::mesh::edit::{Placement, check_collapse};
use crate::mesh::halfedge::{HalfedgeMesh, edge_of, halfedge_of, twin};
use crate::mesh::{EdgeId, FaceId, Freedom, HalfedgeId, VertexId};
use crate::technique::collapse::Editor;

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

/// Mends a face by a short sequence of edits; `false` where none was found.
pub(super) fn mend_by_search(editor: &mut Editor<'_>, f: FaceId, threshold: f64) -> bool {
    let Some(cavity) = Cavity::around(editor, f, threshold) else { return false };
    let start = cavity.start(editor);
    let enough = (1.0 - LEAST_GAIN) * start.shortfall;
    let mut beam = vec![start];
    for _ in 0..DEPTH {
        let next = follow(editor, &cavity, &beam);
        if next.iter().take_while(|t| t.shortfall < enough).take(MOST_TESTED).any(|t| cavity.commit(editor, t)) {
            return true;
        }
        beam = next;
        beam.truncate(BEAM);
    }
    false
}

/// The best outcomes of one edit more, best first.
fn follow(editor: &Editor<'_>, cavity: &Cavity, beam: &[Trial]) -> Vec<Trial> {
    let most = BEAM.max(MOST_TESTED);
    let mut best: Vec<Trial> = Vec::new();
    for trial in beam {
        for edit in edits(editor, cavity, &trial.mesh) {
            let Some(next) = cavity.after(editor, trial, edit) else { continue };
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
fn edits(editor: &Editor<'_>, cavity: &Cavity, mesh: &HalfedgeMesh) -> Vec<Edit> {
    let mut out = Vec::new();
    let mut edges: Vec<EdgeId> = Vec::new();
    let mut vertices: Vec<VertexId> = Vec::new();
    for f in cavity.worst(mesh).into_iter().take(WORST) {
        let corners = mesh.corners(f);
        vertices.extend(corners);
        edges.extend(corners.into_iter().flat_map(|v| mesh.outgoing(v).map(edge_of)));
        edges.extend(mesh.corners(f).into_iter().flat_map(|v| opposite_edges(mesh, v)));
        splits(editor, cavity, mesh, f, &mut out);
    }
    vertices.sort_unstable();
    vertices.dedup();
    edges.sort_unstable();
    edges.dedup();
    for e in edges {
        collapses(editor, mesh, e, &mut out);
        let [a, b] = mesh.ends(e);
        let is_core = |h: HalfedgeId| mesh.face(h).is_some_and(|f| cavity.is_core(f));
        let h = halfedge_of(e);
        if mesh.edge_freedom(e) == Freedom::Free && is_core(h) && is_core(twin(h)) {
            out.push(Edit::Flip { ends: [a, b] });
        }
    }
    for v in vertices {
        moves(editor, mesh, v, &mut out);
    }
    out
}

/// The edges opposite a vertex in its faces.
fn opposite_edges(mesh: &HalfedgeMesh, v: VertexId) -> impl Iterator<Item = EdgeId> + '_ {
    mesh.outgoing(v).filter(|&h| mesh.face(h).is_some()).map(|h| edge_of(mesh.next(h)))
}

fn collapses(editor: &Editor<'_>, mesh: &HalfedgeMesh, e: EdgeId, out: &mut Vec<Edit>) {
    let Ok(plan) = check_collapse(mesh, e) else { return };
    let ends = mesh.ends(e);
    let [p, q] = ends.map(|v| mesh.point(v));
    let mut push = |to: DVec3| out.push(Edit::Collapse { ends, to });
    match plan.placement {
        Placement::Fixed(at) => push(at),
        Placement::Segment(a, b) => [a, b, 0.5 * (a + b)].into_iter().for_each(&mut push),
        Placement::Anywhere => {
            let middle = 0.5 * (p + q);
            [p, q, editor.keeper.project(middle).unwrap_or(middle)].into_iter().for_each(&mut push);
        }
    }
}

/// Splits of a face's sides in the middle, and of the longest at the foot of its height.
fn splits(editor: &Editor<'_>, cavity: &Cavity, mesh: &HalfedgeMesh, f: FaceId, out: &mut Vec<Edit>) {
    let first = mesh.face_halfedge(f);
    for h in [first, mesh.next(first), mesh.prev(first)] {
        if !mesh.face(twin(h)).is_none_or(|f| cavity.is_core(f)) {
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
            let at = if is_curve { at } else { editor.keeper.project(at).unwrap_or(at) };
            out.push(Edit::Split { ends, at });
        }
    }
}

/// Moves to the middle of the neighbours, and half the way; on a curve also towards each neighbour.
fn moves(editor: &Editor<'_>, mesh: &HalfedgeMesh, v: VertexId, out: &mut Vec<Edit>) {
    let at = mesh.point(v);
    match mesh.vertex_freedom(v) {
        Freedom::Keep => {}
        Freedom::Free => {
            let (sum, count) = mesh.neighbours(v).fold((DVec3::ZERO, 0.0), |(s, n), w| (s + mesh.point(w), n + 1.0));
            for share in [1.0, 0.5] {
                let wish = at.lerp(sum / count, share);
                out.push(Edit::Move { vertex: v, to: editor.keeper.project(wish).unwrap_or(wish) });
            }
        }
        Freedom::OnCurve => {
            let is_curve = |h: &HalfedgeId| mesh.edge_freedom(edge_of(*h)) != Freedom::Free;
            let ends: Vec<DVec3> = mesh.outgoing(v).filter(is_curve).map(|h| mesh.point(mesh.target(h))).collect();
            let [a, b] = ends[..] else { return };
            for wish in [0.5 * (a + b), at.lerp(a, 0.5), at.lerp(b, 0.5), at.lerp(a, 0.2), at.lerp(b, 0.2)] {
                out.extend(editor.keeper.project_to_curve(wish).map(|to| Edit::Move { vertex: v, to }));
            }
        }
    }
}
