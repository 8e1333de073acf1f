//! Edges with more than two faces: which faces go on into which.
//!
//! After Guéziec, Taubin, Lazarus, Horn: Cutting and stitching: converting sets of polygons to manifold surfaces.
//! IEEE TVCG 7(2), 2001. They leave open which faces to join again; here the radial order round the edge decides.

use std::f64::consts::{PI, TAU};

use glam::DVec3;

use super::adjacency::{EdgeTable, Twins, apex, face_of, tail};
use super::draft::{Draft, normal};
use super::orient::{orient, turn};
use crate::mesh::id::Face;
use crate::mesh::{FaceId, HalfedgeId, IdVec, VertexId};

/// A non-manifold edge before it is cut.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct CutEdge {
    /// Its ends.
    pub(super) ends: [VertexId; 2],
    /// The number of its faces.
    pub(super) faces: usize,
}

/// Joins the faces at every edge in pairs. An odd face out becomes a border.
///
/// Where the faces alternate in direction round the edge, solids touch there, and each pair encloses material, so
/// that the solids come apart. Elsewhere sheets meet. The faces of a part that has no open edge stay together, so that
/// a fin which goes on flat from the wall of a box does not open the box; then the flattest pairs go on into each
/// other: of three plates the straight two.
pub(super) fn pair_faces(draft: &mut Draft, table: &EdgeTable) -> (Twins, Vec<CutEdge>) {
    let mut twins = table.twins();
    let is_cut = |group: &[(VertexId, HalfedgeId)]| group.len() > 2;
    if !table.edges().any(|(_, _, group)| is_cut(group)) {
        return (twins, Vec::new());
    }
    // Directions only mean something once each smooth part agrees with itself and closed parts look outward.
    let parts = orient(draft, &mut twins).component;
    let open = open_parts(draft, &parts);
    turn_closed_parts_outward(draft, &mut twins, &parts, &open);
    let closed = |f: FaceId| Some(parts[f]).filter(|&part| !open[part as usize]);
    let table = EdgeTable::new(&draft.faces, draft.points.len());
    let mut cut = Vec::new();
    for (a, b, group) in table.edges().filter(|(_, _, group)| is_cut(group)) {
        let spokes = spokes(draft, a, b, group, &closed);
        for (h, g) in pair_alternating(&spokes).unwrap_or_else(|| pair_flattest(&spokes)) {
            twins[h] = g;
            twins[g] = h;
        }
        cut.push(CutEdge { ends: [a, b], faces: group.len() });
    }
    (twins, cut)
}

/// Whether each part has edges where the number of its own faces is odd.
fn open_parts(draft: &Draft, parts: &IdVec<Face, u32>) -> Vec<bool> {
    let count = parts.iter().max().map_or(0, |&last| last as usize + 1);
    let mut open = vec![false; count];
    let table = EdgeTable::new(&draft.faces, draft.points.len());
    for (_, _, group) in table.edges() {
        for (_, h) in group {
            let part = parts[face_of(*h)];
            let own = group.iter().filter(|(_, g)| parts[face_of(*g)] == part).count();
            open[part as usize] |= own % 2 == 1;
        }
    }
    open
}

/// Parts without open edges of their own whose volume is negative are turned round.
fn turn_closed_parts_outward(draft: &mut Draft, twins: &mut Twins, parts: &IdVec<Face, u32>, open: &[bool]) {
    let mut volume = vec![0.0; open.len()];
    let middle = draft.faces.iter().next().map_or(DVec3::ZERO, |corners| draft.points[corners[0]]);
    for (face, &part) in parts.enumerate() {
        let [a, b, c] = draft.corners(face).map(|p| p - middle);
        volume[part as usize] += a.dot(b.cross(c));
    }
    let chosen: IdVec<Face, bool> =
        parts.iter().map(|&part| !open[part as usize] && volume[part as usize] < 0.0).collect();
    turn(draft, twins, &chosen);
}

/// A face at an edge, seen along the edge.
#[derive(Clone, Copy, Debug)]
struct Spoke {
    /// Its half-edge.
    halfedge: HalfedgeId,
    /// Its direction round the edge, in radians.
    angle: f64,
    /// Whether it runs from the lower end to the higher; then its outside is on the side of larger angles.
    forward: bool,
    /// Whether it has an area at all.
    solid: bool,
    /// Its part, where that has no open edge.
    closed: Option<u32>,
}

/// The faces at an edge in the order of their angles.
fn spokes(
    draft: &Draft,
    a: VertexId,
    b: VertexId,
    group: &[(VertexId, HalfedgeId)],
    closed: &dyn Fn(FaceId) -> Option<u32>,
) -> Vec<Spoke> {
    let along = (draft.points[b] - draft.points[a]).normalize_or_zero();
    let away = |h: HalfedgeId| (draft.points[apex(&draft.faces, h)] - draft.points[a]).reject_from_normalized(along);
    let reference = along.any_orthonormal_vector();
    let across = along.cross(reference);
    let mut spokes: Vec<Spoke> = group
        .iter()
        .map(|&(_, h)| {
            let away = away(h);
            let angle = libm::atan2(away.dot(across), away.dot(reference)) + PI;
            let forward = tail(&draft.faces, h) == a;
            let solid = normal(draft.corners(face_of(h))).length_squared() > 0.0;
            Spoke { halfedge: h, angle, forward, solid, closed: closed(face_of(h)) }
        })
        .collect();
    spokes.sort_by(|s, t| s.angle.total_cmp(&t.angle).then(s.halfedge.cmp(&t.halfedge)));
    settle_ties(&mut spokes);
    spokes
}

/// Orders faces that lie on each other, which their angles cannot do: a forward one comes first, then they take turns.
///
/// So a wall that two solids share is never taken for a sheet of material without thickness, and all the edges along
/// it are paired alike: else the solids would be joined at some of them, and again at the halves of those when split.
fn settle_ties(spokes: &mut [Spoke]) {
    let is_gap = |s: &Spoke, t: &Spoke| {
        let turn = (t.angle - s.angle).abs();
        turn.min(TAU - turn) > SAME_ANGLE
    };
    let count = spokes.len();
    // Faces that lie on each other may have angles on both sides of a full turn: begin after a gap.
    let Some(start) = (0..count).find(|&i| is_gap(&spokes[(i + count - 1) % count], &spokes[i])) else { return };
    spokes.rotate_left(start);
    for tied in spokes.chunk_by_mut(|s, t| !is_gap(s, t)).filter(|tied| tied.len() > 1) {
        tied.sort_by_key(|s| (!s.forward, s.halfedge));
        let split = tied.iter().filter(|s| s.forward).count();
        let (forward, backward) = tied.split_at(split);
        let (first, second) = if split * 2 >= tied.len() { (forward, backward) } else { (backward, forward) };
        let turns = |i: usize| [first.get(i), second.get(i)].into_iter().flatten().copied();
        let ordered: Vec<Spoke> = (0..first.len()).flat_map(turns).collect();
        tied.copy_from_slice(&ordered);
    }
}

/// Pairs that enclose material, if the faces alternate in direction all the way round.
fn pair_alternating(spokes: &[Spoke]) -> Option<Vec<(HalfedgeId, HalfedgeId)>> {
    let count = spokes.len();
    let alternates = (0..count).all(|i| spokes[i].forward != spokes[(i + 1) % count].forward && spokes[i].solid);
    if !alternates || !count.is_multiple_of(2) {
        return None;
    }
    // A backward face has its inside towards larger angles, where its partner follows.
    let pairs = (0..count).filter(|&i| !spokes[i].forward);
    Some(pairs.map(|i| (spokes[i].halfedge, spokes[(i + 1) % count].halfedge)).collect())
}

/// Differences of angle below this (radians) are noise of rounded coordinates, and must not decide between pairs that
/// are equally flat: all the edges along a joint should be paired alike.
const SAME_ANGLE: f64 = 1e-4;

/// Pairs within closed parts, and within what is open, then others; each in the order of their flatness; of equally
/// flat ones those that agree in direction come first.
///
/// Where as many faces run forward as backward the directions are taken to be right, and every pair agrees: a pair
/// that did not would turn part of a solid inside out.
fn pair_flattest(spokes: &[Spoke]) -> Vec<(HalfedgeId, HalfedgeId)> {
    let balanced = 2 * spokes.iter().filter(|s| s.forward).count() == spokes.len();
    let mut candidates = Vec::new();
    for (i, s) in spokes.iter().enumerate() {
        for (j, t) in spokes.iter().enumerate().skip(i + 1) {
            let turn = (s.angle - t.angle).abs();
            let bend = PI - turn.min(TAU - turn);
            let apart = s.closed != t.closed;
            let rank = (!(s.solid && t.solid), apart, (bend / SAME_ANGLE).round() as u64, s.forward == t.forward);
            if balanced && rank.3 {
                continue;
            }
            candidates.push((rank, s.halfedge.min(t.halfedge), s.halfedge.max(t.halfedge), i, j));
        }
    }
    candidates.sort_unstable();
    let mut free = vec![true; spokes.len()];
    let mut pairs = Vec::new();
    for (_, h, g, i, j) in candidates {
        if free[i] && free[j] {
            (free[i], free[j]) = (false, false);
            pairs.push((h, g));
        }
    }
    pairs
}
