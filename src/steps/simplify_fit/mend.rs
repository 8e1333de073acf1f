//! Faces above the aspect ratio allowed: what collapses cannot reach.
//!
//! A tessellation spans flat faces and fillets with needles as long as the part, and no collapse removes one that runs
//! from curve to curve. Where neither a collapse nor a flip helps, it gets a new vertex ([`super::insert`]), which
//! changes no geometry; the simplification then goes on to its target, and may make no face that breaks the limit.

use glam::DVec3;

use super::cases::Bench;
use super::insert::insert;
use super::surfaces::Surfaces;
use crate::mesh::geometry::angle;
use crate::mesh::halfedge::{HalfedgeMesh, edge_of};
use crate::mesh::{EdgeId, FaceId, Freedom, HalfedgeId, VertexId};
use crate::metric::shape::best_stretch_with_angle;
use crate::technique::collapse::{CollapseRules, Order, Priority, collapse_edge};
use crate::technique::guarded::{Gain, GuardedMesh, StarRules};
use crate::technique::remesh::{Refusals, faces_below, flip_edges, raise_stretch, relax_vertices, towards_centroid};
use crate::watch::{Cancelled, Watch};

/// Edits at one face in one round.
const MOST_EDITS: usize = 8;

/// Mending ends when it has made this many times as many faces.
const MOST_GROWTH: usize = 2;

/// Rounds that do not lower the number of poor faces, one after the other, before mending ends.
const MOST_VAIN: usize = 3;

/// More faces than that are no rest that a search could mend.
const MOST_SEARCHED: usize = 200;

/// Rounds over the faces below the limit.
const MOST_ROUNDS: usize = 16;

/// Mends the faces below a stretch, worst first. Returns how many are left.
pub(super) fn mend(bench: &mut Bench<'_, '_>, limit: f64, watch: &Watch) -> Result<usize, Cancelled> {
    let rules = rules(limit);
    let mut left = faces_below(bench.guarded, limit);
    let most = MOST_GROWTH * bench.guarded.mesh().face_count();
    let mut tried: Vec<u64> = Vec::new();
    let (mut fewest, mut vain) = (left.len(), 0);
    for _ in 0..MOST_ROUNDS {
        if left.is_empty() {
            break;
        }
        watch.phase("mend", Some(left.len() as u64));
        for (place, &f) in left.iter().enumerate() {
            if place.is_multiple_of(64) {
                watch.check()?;
                watch.advance(place as u64, || format!("{} faces", bench.guarded.mesh().face_count()));
            }
            if !is_bad(bench, f, limit) || tried.get(f.index()) == Some(&age(bench, f)) {
                continue;
            }
            mend_face(bench, f, limit, &rules);
            if is_bad(bench, f, limit) {
                tried.resize(tried.len().max(f.index() + 1), u64::MAX);
                tried[f.index()] = age(bench, f);
            }
        }
        left = faces_below(bench.guarded, limit);
        vain = if left.len() < fewest { 0 } else { vain + 1 };
        fewest = fewest.min(left.len());
        if vain == MOST_VAIN || bench.guarded.mesh().face_count() > most {
            break;
        }
    }
    Ok(left.len())
}

/// Changes when the surroundings of a face change.
fn age(bench: &Bench<'_, '_>, f: FaceId) -> u64 {
    let mesh = bench.guarded.mesh();
    mesh.corners(f).into_iter().flat_map(|v| mesh.neighbours(v)).map(|v| u64::from(mesh.version(v))).sum()
}

fn rules(limit: f64) -> CollapseRules {
    CollapseRules {
        star: StarRules { min_stretch: limit, mean_stretch: 0.0, mend_below: Some(limit) },
        order: Order::OnSurface,
        priority: Priority::SmallFirst { size: 1.0 },
    }
}

/// Mends the few faces that are left by the search for sequences of edits; vertices that leave their fit are on none.
/// Returns how many are left where it was worth a search, else 0.
pub(super) fn mend_by_search(bench: &mut Bench<'_, '_>, limit: f64, watch: &Watch) -> Result<usize, Cancelled> {
    let count = faces_below(bench.guarded, limit).len();
    if count == 0 || count > MOST_SEARCHED {
        return Ok(0);
    }
    let rules = rules(limit);
    let rest = raise_stretch(bench.guarded, limit, &rules, watch)?;
    let mesh = bench.guarded.mesh();
    let left: Vec<VertexId> = mesh
        .vertices()
        .filter(|&v| bench.surfaces.number(v).is_some_and(|fit| !bench.surfaces.holds(fit, mesh.point(v))))
        .collect();
    for v in left {
        bench.surfaces.carry(v, None, true);
    }
    Ok(rest)
}

fn is_bad(bench: &Bench<'_, '_>, f: FaceId, limit: f64) -> bool {
    bench.guarded.mesh().face_is_live(f) && bench.guarded.stretch(f) < limit
}

/// Collapses and flips that bring the face nearer to the limit, and new vertices where there is none.
fn mend_face(bench: &mut Bench<'_, '_>, f: FaceId, limit: f64, rules: &CollapseRules) {
    for _ in 0..MOST_EDITS {
        if !is_bad(bench, f, limit) {
            return;
        }
        let sides = sides(bench, f);
        if let Some(v) = sides[..2].iter().find_map(|&e| collapse_edge(bench.guarded, e, rules)) {
            bench.settle_fit(v);
            continue;
        }
        if sides.iter().rev().any(|&e| bench.guarded.flip(e, Gain::Mend(limit)).is_ok()) {
            continue;
        }
        if !bench.may_insert || is_wedge(bench, f, limit) || !insert(bench, f) {
            return;
        }
    }
}

/// Whether two curves meet in a corner of the face at an angle that no triangle above the limit has.
fn is_wedge(bench: &Bench<'_, '_>, f: FaceId, limit: f64) -> bool {
    let mesh = bench.guarded.mesh();
    let h = mesh.face_halfedge(f);
    [h, mesh.next(h), mesh.prev(h)].into_iter().any(|out| {
        let back = mesh.prev(out);
        let is_curve = |h: HalfedgeId| mesh.edge_freedom(edge_of(h)) != Freedom::Free;
        let at = mesh.point(mesh.origin(out));
        let opening = angle(mesh.point(mesh.target(out)) - at, mesh.point(mesh.origin(back)) - at);
        is_curve(out) && is_curve(back) && opening < 0.5 && best_stretch_with_angle(opening) < limit
    })
}

/// The sides of a face, shortest first.
fn sides(bench: &Bench<'_, '_>, f: FaceId) -> [EdgeId; 3] {
    let mesh = bench.guarded.mesh();
    let h = mesh.face_halfedge(f);
    let mut sides = [h, mesh.next(h), mesh.prev(h)].map(|h| (length_squared(bench, h), edge_of(h)));
    sides.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    sides.map(|(_, e)| e)
}

fn length_squared(bench: &Bench<'_, '_>, h: HalfedgeId) -> f64 {
    let mesh = bench.guarded.mesh();
    mesh.point(mesh.origin(h)).distance_squared(mesh.point(mesh.target(h)))
}

/// Flips and relaxation that raise the quality, past what was refused before: vertices in flat areas move within their
/// plane, vertices on a fit along it, and others to the nearest point of the reference.
pub(super) fn polish(
    bench: &mut Bench<'_, '_>,
    rounds: usize,
    refusals: &mut Refusals,
    watch: &Watch,
) -> Result<(), Cancelled> {
    watch.phase("polish", Some(rounds as u64));
    let Bench { guarded, surfaces, .. } = bench;
    for round in 0..rounds {
        watch.advance(round as u64, || format!("{} faces", guarded.mesh().face_count()));
        let flips = flip_edges(guarded, refusals, watch)?;
        let moves = relax_vertices(guarded, refusals, watch, |guarded, v| relax(guarded, surfaces, v))?;
        if (flips + moves) * 100 < guarded.mesh().vertex_count() {
            break;
        }
    }
    Ok(())
}

/// Only vertices of faces below this stretch are worth a move.
const WORTH_A_MOVE: f64 = 0.85;

/// And only by this part of their shortest edge, or more.
const WORTH_A_STEP: f64 = 0.07;

/// Towards the area-weighted centre of the star.
fn relax(guarded: &mut GuardedMesh<'_>, surfaces: &Surfaces, v: VertexId) -> bool {
    let mesh = guarded.mesh();
    if mesh.vertex_freedom(v) != Freedom::Free || mesh.is_boundary_vertex(v) {
        return false;
    }
    if mesh.faces_around(v).all(|f| guarded.stretch(f) >= WORTH_A_MOVE) {
        return false;
    }
    let at = mesh.point(v);
    let Some((step, normal)) = towards_centroid(mesh, v) else { return false };
    let near = mesh.neighbours(v).map(|w| mesh.point(w).distance_squared(at)).fold(f64::INFINITY, f64::min);
    if step.length_squared() < WORTH_A_STEP * WORTH_A_STEP * near {
        return false;
    }
    let fit = surfaces.of(v);
    let is_flat = fit.is_none() && is_flat(mesh, v, normal);
    [1.0, 0.5].into_iter().any(|share| {
        let wish = at + share * step;
        let to = match fit {
            Some(fit) => fit.project(wish),
            None if is_flat => Some(wish),
            None => guarded.project(wish),
        };
        to.is_some_and(|to| guarded.relocate(v, to, Gain::Quality).is_ok())
    })
}

/// Whether the whole star lies in one plane.
fn is_flat(mesh: &HalfedgeMesh, v: VertexId, normal: DVec3) -> bool {
    let at = mesh.point(v);
    mesh.neighbours(v).all(|w| {
        let along = mesh.point(w) - at;
        along.dot(normal).abs() <= 1e-10 * along.length()
    })
}
