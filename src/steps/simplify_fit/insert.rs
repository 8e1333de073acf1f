//! New vertices where needles are too long for collapses, and the flips that make the best of them.
//!
//! A needle gets a vertex on a long side, as far from its short side as good faces reach; then edges round it are
//! flipped while the smallest angle rises. So one vertex serves all needles beside it: the off-centre of A. Üngör,
//! Off-centers: A new type of Steiner points for computing size-optimal quality-guaranteed Delaunay triangulations,
//! LATIN 2004, put onto an edge, where it changes no geometry. Rows of them grow with the distance from the curve.

use smallvec::SmallVec;

use super::cases::Bench;
use crate::mesh::geometry::{angle, stretch};
use crate::mesh::halfedge::{edge_of, halfedge_of, twin};
use crate::mesh::{EdgeId, FaceId, Freedom, HalfedgeId, VertexId};
use crate::technique::guarded::Gain;
use crate::watch::{Cancelled, Watch};

/// How far from the short side, in lengths of it and as a part of the aspect ratio allowed.
const FAR: f64 = 0.55;

/// A needle's shortest side is below this part of the next one.
const NEEDLE: f64 = 0.35;

/// Vertices that one needle may ask for.
const MOST_PASSED: usize = 16;

/// Flips after one vertex.
const MOST_FLIPS: usize = 256;

/// Flips edges within planes until the smallest angles are as large as they can be: changes no geometry.
pub(super) fn flip_within_planes(bench: &mut Bench<'_, '_>, watch: &Watch) -> Result<(), Cancelled> {
    watch.phase("flip within planes", None);
    let mut edges: Vec<EdgeId> = bench.guarded.mesh().edges().collect();
    edges.reverse();
    let mut left = 8 * edges.len();
    while let Some(e) = edges.pop() {
        left -= 1;
        if left == 0 {
            break;
        }
        if left.is_multiple_of(256) {
            watch.check()?;
        }
        let mesh = bench.guarded.mesh();
        let h = halfedge_of(e);
        let (Some(f), Some(g)) = (mesh.face(h), mesh.face(twin(h))) else { continue };
        if mesh.edge_freedom(e) == Freedom::Free
            && bench.guarded.is_plane(f, g)
            && bench.guarded.flip(e, Gain::LeastAngle).is_ok()
        {
            edges.extend(sides_of_pair(bench, e));
        }
    }
    Ok(())
}

/// The four edges round the two faces of an edge.
fn sides_of_pair(bench: &Bench<'_, '_>, e: EdgeId) -> [EdgeId; 4] {
    let mesh = bench.guarded.mesh();
    let h = halfedge_of(e);
    [mesh.next(h), mesh.prev(h), mesh.next(twin(h)), mesh.prev(twin(h))].map(edge_of)
}

/// Puts a vertex on a side of a face; `false` where none may get one.
pub(super) fn insert(bench: &mut Bench<'_, '_>, f: FaceId) -> bool {
    let mesh = bench.guarded.mesh();
    let first = mesh.face_halfedge(f);
    let mut sides = [first, mesh.next(first), mesh.prev(first)].map(|h| (length(bench, h), h));
    sides.sort_by(|a, b| a.0.total_cmp(&b.0).then(edge_of(a.1).cmp(&edge_of(b.1))));
    let [(short, h), (middle, _), (long, longest)] = sides;
    if short > NEEDLE * middle {
        // A cap: its apex is nearly on the longest side.
        let share = (middle * middle + long * long - short * short) / (2.0 * long * long);
        let middle_is_next = sides[1].1 == mesh.next(longest);
        let share = if middle_is_next { 1.0 - share } else { share };
        return place(bench, longest, share.clamp(0.1, 0.9));
    }
    let ends = [mesh.origin(h), mesh.target(h)];
    let reach = FAR * bench.params.max_aspect * short;
    let is_curve = |h: HalfedgeId| bench.guarded.mesh().edge_freedom(edge_of(h)) != Freedom::Free;
    let mut long_sides = [(is_curve(sides[2].1), sides[2]), (is_curve(sides[1].1), sides[1])];
    long_sides.sort_by_key(|&(is_curve, _)| is_curve);
    long_sides.into_iter().any(|(_, (length, side))| {
        let mesh = bench.guarded.mesh();
        let share = (reach / length).min(0.5);
        let share = if ends.contains(&mesh.origin(side)) { share } else { 1.0 - share };
        match encroached(bench, side, share) {
            Some((curve, foot)) => place(bench, curve, foot),
            None => place(bench, side, share),
        }
    })
}

/// Splits an edge; where no flip may go on, the poor faces that have the new vertex over their longest side get one on
/// that side: so a vertex passes through a row of needles that bend against each other.
fn place(bench: &mut Bench<'_, '_>, h: HalfedgeId, share: f64) -> bool {
    let Some(v) = split(bench, h, share) else { return false };
    let mut fresh: SmallVec<[VertexId; MOST_PASSED]> = SmallVec::new();
    fresh.push(v);
    let mut passed = 1;
    while let Some(v) = fresh.pop() {
        while let Some((side, foot)) = cap_at(bench, v).filter(|_| passed < MOST_PASSED) {
            let Some(w) = split(bench, side, foot) else { break };
            fresh.push(w);
            passed += 1;
        }
    }
    true
}

/// The longest side of a poor face whose apex a vertex is, and the foot of the vertex on it.
fn cap_at(bench: &Bench<'_, '_>, v: VertexId) -> Option<(HalfedgeId, f64)> {
    let mesh = bench.guarded.mesh();
    let limit = bench.guarded.limits().min_stretch;
    let p = mesh.point(v);
    let poor = mesh.outgoing(v).filter(|&h| mesh.face(h).is_some_and(|f| bench.guarded.stretch(f) < limit));
    poor.map(|h| mesh.next(h)).find_map(|side| {
        let [x, y] = [mesh.origin(side), mesh.target(side)].map(|v| mesh.point(v));
        let foot = (p - x).dot(y - x) / (y - x).length_squared();
        (0.1..=0.9).contains(&foot).then_some((side, foot))
    })
}

/// The part of a curve that a vertex on an edge would make a poor face with, and the foot of the vertex on it: that
/// part gets the vertex instead. Looked for among the faces that flips would give to the vertex.
fn encroached(bench: &Bench<'_, '_>, h: HalfedgeId, share: f64) -> Option<(HalfedgeId, f64)> {
    let mesh = bench.guarded.mesh();
    let p = mesh.point(mesh.origin(h)).lerp(mesh.point(mesh.target(h)), share);
    let mut sides: SmallVec<[HalfedgeId; 32]> = SmallVec::new();
    for side in [h, twin(h)].into_iter().filter(|&side| mesh.face(side).is_some()) {
        sides.extend([mesh.next(side), mesh.prev(side)]);
    }
    let mut worst: Option<(f64, HalfedgeId, f64)> = None;
    let mut at = 0;
    while at < sides.len() && at < MOST_FLIPS {
        let side = sides[at];
        at += 1;
        let [x, y] = [mesh.origin(side), mesh.target(side)].map(|v| mesh.point(v));
        let beyond = mesh.apex(twin(side));
        let is_free = mesh.edge_freedom(edge_of(side)) == Freedom::Free;
        if let (true, Some(z)) = (is_free, beyond) {
            let z = mesh.point(z);
            if angle(x - p, y - p) + angle(x - z, y - z) > std::f64::consts::PI {
                sides.extend([mesh.next(twin(side)), mesh.prev(twin(side))]);
            }
            continue;
        }
        let shape = stretch([p, x, y]);
        let is_over = (x - p).dot(y - p) < 0.0;
        if is_over && shape < 2.0 * bench.guarded.limits().min_stretch && worst.is_none_or(|(least, ..)| shape < least)
        {
            let foot = (p - x).dot(y - x) / (y - x).length_squared();
            worst = Some((shape, side, foot.clamp(0.1, 0.9)));
        }
    }
    worst.map(|(_, side, foot)| (side, foot))
}

fn length(bench: &Bench<'_, '_>, h: HalfedgeId) -> f64 {
    let mesh = bench.guarded.mesh();
    mesh.point(mesh.origin(h)).distance(mesh.point(mesh.target(h)))
}

/// Splits an edge, and flips round the new vertex.
fn split(bench: &mut Bench<'_, '_>, h: HalfedgeId, share: f64) -> Option<VertexId> {
    let mesh = bench.guarded.mesh();
    let ends = [mesh.origin(h), mesh.target(h)];
    let at = mesh.point(ends[0]).lerp(mesh.point(ends[1]), share);
    let origins = bench.surfaces.origins(&ends);
    // The halves are needles still, until flips make better faces of them.
    let limit = bench.guarded.set_min_stretch(0.0);
    let made = bench.guarded.split(edge_of(h), at);
    bench.guarded.set_min_stretch(limit);
    let v = made.ok()?;
    let at = bench.guarded.mesh().point(v);
    bench.surfaces.carry(v, None, true);
    bench.surfaces.come_from(v, at, origins);
    bench.update(v);
    flip_round(bench, v);
    Some(v)
}

/// Flips the edges round a vertex, and what comes after them, while the smallest angles rise.
fn flip_round(bench: &mut Bench<'_, '_>, v: VertexId) {
    let mesh = bench.guarded.mesh();
    let mut edges: Vec<EdgeId> = Vec::new();
    for h in mesh.outgoing(v) {
        edges.push(edge_of(h));
        if mesh.face(h).is_some() {
            edges.push(edge_of(mesh.next(h)));
        }
    }
    let mut flips = 0;
    while let Some(e) = edges.pop() {
        let mesh = bench.guarded.mesh();
        if !mesh.edge_is_live(e) || mesh.edge_freedom(e) != Freedom::Free || mesh.is_boundary_edge(e) {
            continue;
        }
        if bench.guarded.flip(e, Gain::LeastAngle).is_ok() {
            flips += 1;
            if flips == MOST_FLIPS {
                return;
            }
            edges.extend(sides_of_pair(bench, e));
        }
    }
}
