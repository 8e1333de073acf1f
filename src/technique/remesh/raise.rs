//! Raising the stretch of the faces below a threshold.
//!
//! H. Date, S. Kanai, T. Kishinami, I. Nishigaki, T. Dohi (JCISE 5(4), 2005, section 5.2.1) ask for a first phase in
//! which only edges that break the threshold collapse, until nothing does. Made precise: for each face below the
//! threshold, worst first, the first of a collapse, a flip and a relocation that brings its star nearer to the
//! threshold: the least stretch rises, or the sum of what the faces lack falls, and never does the least stretch fall.
//! Where there is none, a search for a sequence of edits whose outcome does ([`super::search`]).

use std::collections::BTreeMap;

use glam::DVec3;

use super::relax;
use super::search::{mend_by_search, reachable};
use crate::mesh::geometry::{area_vector, stretch};
use crate::mesh::halfedge::edge_of;
use crate::mesh::{EdgeId, FaceId, Freedom, VertexId};
use crate::technique::collapse::{CollapseRules, collapse_edge};
use crate::technique::guarded::{Gain, GuardedMesh, StarRules, Tally};
use crate::watch::{Cancelled, Watch};

/// Rounds after which the phase ends even if it still finds something: each round gains, but ever less.
const MOST_ROUNDS: usize = 24;

/// Rounds of searching for what no single edit mends.
const MOST_SEARCHES: usize = 4;

/// Faces searched in one round, worst first: each costs as much as thousands of edits.
const MOST_SEARCHED: usize = 400;

/// Raises the stretch of the faces below `threshold`, worst first, and where no single edit helps by a search for
/// several. Returns how many are left.
pub fn raise_stretch(
    guarded: &mut GuardedMesh<'_>,
    threshold: f64,
    rules: &CollapseRules,
    watch: &Watch,
) -> Result<usize, Cancelled> {
    let mut failed = BTreeMap::new();
    for _ in 0..MOST_SEARCHES {
        touch_up(guarded, threshold, rules, watch)?;
        if !search(guarded, threshold, &mut failed, watch)? {
            break;
        }
    }
    Ok(faces_below(guarded, threshold).len())
}

/// As [`raise_stretch`] by single edits only.
pub fn touch_up(
    guarded: &mut GuardedMesh<'_>,
    threshold: f64,
    rules: &CollapseRules,
    watch: &Watch,
) -> Result<(), Cancelled> {
    let star = StarRules { mend_below: Some(threshold), min_stretch: threshold, mean_stretch: 0.0 };
    let rules = CollapseRules { star, ..*rules };
    let mut failed = BTreeMap::new();
    for round in 0..MOST_ROUNDS {
        let bad = faces_below(guarded, threshold);
        if round == 0 {
            watch.phase("raise stretch", Some(bad.len() as u64));
        }
        watch.advance(0, || format!("{} faces below {threshold}", bad.len()));
        let mut gained = false;
        for (place, &f) in bad.iter().enumerate() {
            if place.is_multiple_of(64) {
                watch.check()?;
            }
            let is_open = guarded.mesh().face_is_live(f) && guarded.stretch(f) < threshold;
            if !is_open || failed.get(&f) == Some(&age(guarded, f)) {
                continue;
            }
            if mend(guarded, f, &rules) {
                gained = true;
            } else {
                failed.insert(f, age(guarded, f));
            }
        }
        if !gained {
            break;
        }
    }
    Ok(())
}

/// Searches at the faces that are left, except where that has failed and nothing has changed since. Returns whether it
/// helped anywhere.
fn search(
    guarded: &mut GuardedMesh<'_>,
    threshold: f64,
    failed: &mut BTreeMap<FaceId, u64>,
    watch: &Watch,
) -> Result<bool, Cancelled> {
    let mut gained = false;
    for f in faces_below(guarded, threshold).into_iter().take(MOST_SEARCHED) {
        watch.check()?;
        let mesh = guarded.mesh();
        let is_open = mesh.face_is_live(f) && guarded.stretch(f) < reachable(mesh, f, threshold);
        if !is_open || failed.get(&f) == Some(&age(guarded, f)) {
            continue;
        }
        if mend_by_search(guarded, f, threshold) {
            gained = true;
        } else {
            failed.insert(f, age(guarded, f));
        }
    }
    Ok(gained)
}

/// Changes when the surroundings of a face change.
fn age(guarded: &GuardedMesh<'_>, f: FaceId) -> u64 {
    let mesh = guarded.mesh();
    let around = mesh.corners(f).into_iter().flat_map(|v| mesh.neighbours(v));
    around.map(|v| u64::from(mesh.version(v))).sum()
}

/// The live faces with less stretch, worst first.
pub fn faces_below(guarded: &GuardedMesh<'_>, threshold: f64) -> Vec<FaceId> {
    let mut bad: Vec<FaceId> = guarded.mesh().faces().filter(|&f| guarded.stretch(f) < threshold).collect();
    bad.sort_by(|&f, &g| guarded.stretch(f).total_cmp(&guarded.stretch(g)).then(f.cmp(&g)));
    bad
}

/// One edit that raises the least stretch round a face: collapse, flip, relocation.
fn mend(guarded: &mut GuardedMesh<'_>, f: FaceId, rules: &CollapseRules) -> bool {
    let edges = edges_by_length(guarded, f);
    if edges.iter().any(|&e| collapse_edge(guarded, e, rules).is_some()) {
        return true;
    }
    let threshold = rules.star.mend_below.unwrap_or(rules.star.min_stretch);
    if edges.iter().rev().any(|&e| guarded.flip(e, Gain::Mend(threshold)).is_ok()) {
        return true;
    }
    let corners = guarded.mesh().corners(f);
    if corners.iter().any(|&v| relax(guarded, v, Gain::Mend(threshold)) || nudge(guarded, v, threshold)) {
        return true;
    }
    // The star's other edges may stand in the way of all that.
    for v in corners {
        let star: Vec<EdgeId> = guarded.mesh().outgoing(v).map(edge_of).collect();
        for e in star {
            if guarded.mesh().edge_is_live(e) && !edges.contains(&e) && collapse_edge(guarded, e, rules).is_some() {
                return true;
            }
        }
        if !guarded.mesh().face_is_live(f) || !guarded.mesh().vertex_is_live(v) {
            return true;
        }
    }
    false
}

/// Steps of a nudge, as shares of the shortest edge at the vertex for a free one, of the way to the neighbour on a
/// curve.
const STEPS: [f64; 4] = [0.5, 0.25, 0.1, 0.03];

/// Directions in the tangent plane that a nudge tries.
const DIRECTIONS: usize = 8;

/// Places tested in full, best first.
const MOST_TRIED: usize = 3;

/// Moves a vertex a little to where its star falls least short of the threshold: a search, where relaxation to the
/// centre of the star does not help.
fn nudge(guarded: &mut GuardedMesh<'_>, v: VertexId, threshold: f64) -> bool {
    let lack = |guarded: &GuardedMesh<'_>, to: DVec3| shortfall(guarded, v, to, threshold);
    move_to_best(guarded, v, Gain::Mend(threshold), lack)
}

/// Moves a vertex to the place nearby where its star has the best mean stretch that gains.
pub(super) fn settle_in(guarded: &mut GuardedMesh<'_>, v: VertexId, gain: Gain) -> bool {
    let poorness = |guarded: &GuardedMesh<'_>, to: DVec3| {
        let mut tally = Tally::new();
        let mesh = guarded.mesh();
        for f in mesh.faces_around(v) {
            tally.add_stretch(stretch(mesh.corners(f).map(|w| if w == v { to } else { mesh.point(w) })));
        }
        -tally.mean()
    };
    move_to_best(guarded, v, gain, poorness)
}

/// Tries the places round a vertex that are rated lower than its own, lowest first.
fn move_to_best(
    guarded: &mut GuardedMesh<'_>,
    v: VertexId,
    gain: Gain,
    rate: impl Fn(&GuardedMesh<'_>, DVec3) -> f64,
) -> bool {
    let wishes = match guarded.mesh().vertex_freedom(v) {
        Freedom::Free => around(guarded, v),
        Freedom::OnCurve => along_curve(guarded, v),
        Freedom::Keep => return false,
    };
    let mut rated: Vec<(f64, DVec3)> = wishes.into_iter().map(|to| (rate(guarded, to), to)).collect();
    rated.sort_by(|a, b| a.0.total_cmp(&b.0));
    let now = rate(guarded, guarded.mesh().point(v));
    rated
        .into_iter()
        .take_while(|(rest, _)| *rest < now)
        .take(MOST_TRIED)
        .any(|(_, to)| guarded.relocate(v, to, gain).is_ok())
}

/// What the star of a vertex would lack to the threshold, were the vertex elsewhere.
fn shortfall(guarded: &GuardedMesh<'_>, v: VertexId, to: DVec3, threshold: f64) -> f64 {
    let mesh = guarded.mesh();
    let lack = |f: FaceId| {
        let corners = mesh.corners(f).map(|w| if w == v { to } else { mesh.point(w) });
        (threshold - stretch(corners)).max(0.0)
    };
    mesh.faces_around(v).map(lack).sum()
}

/// Places round a free vertex, on the reference.
fn around(guarded: &GuardedMesh<'_>, v: VertexId) -> Vec<DVec3> {
    let mesh = guarded.mesh();
    let at = mesh.point(v);
    let normal: DVec3 = mesh.faces_around(v).map(|f| area_vector(mesh.corner_points(f))).sum();
    let Some(normal) = normal.try_normalize() else { return Vec::new() };
    let shortest = mesh.neighbours(v).map(|w| mesh.point(w).distance(at)).fold(f64::INFINITY, f64::min);
    let across = normal.any_orthonormal_vector();
    let along = normal.cross(across);
    let turn = std::f64::consts::TAU / DIRECTIONS as f64;
    let wish = |step: f64, k: usize| {
        let (sin, cos) = libm::sincos(turn * k as f64);
        at + step * shortest * (cos * across + sin * along)
    };
    let wishes = STEPS.into_iter().flat_map(|step| (0..DIRECTIONS).map(move |k| (step, k)));
    let mut places: Vec<DVec3> = wishes.map(|(step, k)| wish(step, k)).collect();
    guarded.project_round(at, &mut places);
    places
}

/// Places along the curve of a vertex.
fn along_curve(guarded: &GuardedMesh<'_>, v: VertexId) -> Vec<DVec3> {
    let Some(ends) = guarded.curve_neighbours(v) else { return Vec::new() };
    let mesh = guarded.mesh();
    let at = mesh.point(v);
    let wishes = STEPS.into_iter().flat_map(|step| ends.map(|w| at + step * (mesh.point(w) - at)));
    wishes.filter_map(|wish| guarded.project_to_curve(wish)).collect()
}

/// The edges of a face, shortest first.
fn edges_by_length(guarded: &GuardedMesh<'_>, f: FaceId) -> [EdgeId; 3] {
    let mesh = guarded.mesh();
    let first = mesh.face_halfedge(f);
    let mut edges = [first, mesh.next(first), mesh.prev(first)].map(edge_of);
    let length = |e: EdgeId| {
        let [a, b] = mesh.ends(e);
        (mesh.point(b) - mesh.point(a)).length_squared()
    };
    edges.sort_by(|&d, &e| length(d).total_cmp(&length(e)).then(d.cmp(&e)));
    edges
}
