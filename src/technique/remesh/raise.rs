//! Raising the stretch of the faces below a threshold.
//!
//! H. Date, S. Kanai, T. Kishinami, I. Nishigaki, T. Dohi (JCISE 5(4), 2005, section 5.2.1) ask for a first phase in
//! which only edges that break the threshold collapse, until nothing does. Made precise: for each face below the
//! threshold, worst first, the first of a collapse, a flip, a relocation, and a split of its long edge, that brings its
//! star nearer to the threshold: the least stretch rises, or the sum of what the faces lack falls, and never does the
//! least stretch fall.

use glam::DVec3;

use super::{Gain, relax};
use crate::mesh::geometry::{area_vector, stretch};
use crate::mesh::halfedge::edge_of;
use crate::mesh::{EdgeId, FaceId, Freedom, VertexId};
use crate::technique::collapse::{CollapseRules, Editor};
use crate::watch::{Cancelled, Watch};

/// Rounds after which the phase ends even if it still finds something: each round gains, but ever less.
const MOST_ROUNDS: usize = 24;

/// Raises the stretch of the faces below `threshold`, worst first. Returns how many are left.
pub fn raise_stretch(
    editor: &mut Editor<'_>,
    threshold: f64,
    rules: &CollapseRules,
    watch: &Watch,
) -> Result<usize, Cancelled> {
    let rules = CollapseRules { mend_below: Some(threshold), min_stretch: threshold, mean_stretch: 0.0, ..*rules };
    let mut left = usize::MAX;
    for _ in 0..MOST_ROUNDS {
        let bad = faces_below(editor, threshold);
        if left == usize::MAX {
            watch.phase("raise stretch", Some(bad.len() as u64));
        }
        left = bad.len();
        watch.advance(0, || format!("{left} faces below {threshold}"));
        let mut gained = false;
        for (place, &f) in bad.iter().enumerate() {
            if place.is_multiple_of(64) {
                watch.check()?;
            }
            if editor.mesh().face_is_live(f) && editor.stretch(f) < threshold {
                gained |= mend(editor, f, &rules);
            }
        }
        if !gained {
            break;
        }
    }
    Ok(faces_below(editor, threshold).len())
}

/// The live faces with less stretch, worst first.
pub fn faces_below(editor: &Editor<'_>, threshold: f64) -> Vec<FaceId> {
    let mut bad: Vec<FaceId> = editor.mesh().faces().filter(|&f| editor.stretch(f) < threshold).collect();
    bad.sort_by(|&f, &g| editor.stretch(f).total_cmp(&editor.stretch(g)).then(f.cmp(&g)));
    bad
}

/// One edit that raises the least stretch round a face: collapse, flip, relocation, split of its longest edge.
fn mend(editor: &mut Editor<'_>, f: FaceId, rules: &CollapseRules) -> bool {
    let edges = edges_by_length(editor, f);
    if edges.iter().any(|&e| editor.try_collapse(e, rules).is_some()) {
        return true;
    }
    let threshold = rules.mend_below.unwrap_or(rules.min_stretch);
    if edges.iter().rev().any(|&e| editor.try_flip(e, Gain::Mend(threshold))) {
        return true;
    }
    let corners = editor.mesh().corners(f);
    if corners.iter().any(|&v| relax(editor, v, Gain::Mend(threshold)) || nudge(editor, v, threshold)) {
        return true;
    }
    // The star's other edges may stand in the way of all that.
    for v in corners {
        let star: Vec<EdgeId> = editor.mesh().outgoing(v).map(edge_of).collect();
        for e in star {
            if editor.mesh().edge_is_live(e) && !edges.contains(&e) && editor.try_collapse(e, rules).is_some() {
                return true;
            }
        }
        if !editor.mesh().face_is_live(f) || !editor.mesh().vertex_is_live(v) {
            return true;
        }
    }
    widen_wedge(editor, f, rules) || split_cap(editor, f, edges[2], rules)
}

/// Collapses two curve edges at once, one on each side of a narrow wedge between two curves: either alone makes things
/// worse, but both together leave one face of the wedge's angle where there were several.
fn widen_wedge(editor: &mut Editor<'_>, f: FaceId, rules: &CollapseRules) -> bool {
    let threshold = rules.mend_below.unwrap_or(rules.min_stretch);
    // The first of the two may make things worse: never where the limit holds.
    if editor.stretch(f) >= editor.limits().min_stretch {
        return false;
    }
    let curved: Vec<(VertexId, [VertexId; 2])> = editor
        .mesh()
        .corners(f)
        .into_iter()
        .filter(|&v| editor.mesh().vertex_freedom(v) == Freedom::OnCurve)
        .filter_map(|v| Some((v, editor.curve_neighbours(v)?)))
        .collect();
    let mut best: Option<(f64, [(VertexId, VertexId); 2])> = None;
    for (place, &(p, to_p)) in curved.iter().enumerate() {
        for &(q, to_q) in &curved[place + 1..] {
            for pair in to_p.into_iter().flat_map(|a| to_q.map(|b| [(p, a), (q, b)])) {
                let rest = shortfall_after(editor, pair, threshold);
                if rest.is_some_and(|rest| best.is_none_or(|(least, _)| rest < least)) {
                    best = rest.map(|rest| (rest, pair));
                }
            }
        }
    }
    let Some((_, [first, second])) = best else { return false };
    // The first of the two alone may fall short by as much as the face does; the second must mend.
    let loose = CollapseRules { min_stretch: 0.25 * editor.stretch(f), mend_below: None, ..*rules };
    merge_into(editor, first, &loose) && {
        merge_into(editor, second, rules);
        true
    }
}

/// Collapses the edge from a vertex to its neighbour on the curve, to where that is.
fn merge_into(editor: &mut Editor<'_>, (from, to): (VertexId, VertexId), rules: &CollapseRules) -> bool {
    // The first of two collapses may have taken an end of the second.
    let are_live = [from, to].iter().all(|&v| editor.mesh().vertex_is_live(v));
    let Some(h) = are_live.then(|| editor.mesh().find_halfedge(from, to)).flatten() else { return false };
    let at = editor.mesh().point(to);
    editor.try_collapse_at(edge_of(h), at, rules).is_some()
}

/// What the stars of two vertices would lack to the threshold, were each merged into its partner; `None` where that is
/// no gain.
fn shortfall_after(editor: &Editor<'_>, pair: [(VertexId, VertexId); 2], threshold: f64) -> Option<f64> {
    let mesh = editor.mesh();
    let mut faces: Vec<FaceId> = pair.iter().flat_map(|&(v, _)| mesh.faces_around(v)).collect();
    faces.sort_unstable();
    faces.dedup();
    let (mut before, mut after) = (0.0, 0.0);
    for f in faces {
        before += (threshold - editor.stretch(f)).max(0.0);
        let moved = mesh.corners(f).map(|v| pair.iter().find(|(from, _)| *from == v).map_or(v, |&(_, to)| to));
        if moved[0] != moved[1] && moved[1] != moved[2] && moved[2] != moved[0] {
            after += (threshold - stretch(moved.map(|v| mesh.point(v)))).max(0.0);
        }
    }
    (after < before - 0.05 * threshold).then_some(after)
}

/// Steps of a nudge, as shares of the shortest edge at the vertex for a free one, of the way to the neighbour on a curve.
const STEPS: [f64; 4] = [0.5, 0.25, 0.1, 0.03];

/// Directions in the tangent plane that a nudge tries.
const DIRECTIONS: usize = 8;

/// Places tested in full, best first.
const MOST_TRIED: usize = 3;

/// Moves a vertex a little to where its star falls least short of the threshold: a search, where relaxation to the
/// centre of the star does not help.
fn nudge(editor: &mut Editor<'_>, v: VertexId, threshold: f64) -> bool {
    let wishes = match editor.mesh().vertex_freedom(v) {
        Freedom::Free => around(editor, v),
        Freedom::OnCurve => along_curve(editor, v),
        Freedom::Keep => return false,
    };
    let mut rated: Vec<(f64, DVec3)> = wishes.into_iter().map(|to| (shortfall(editor, v, to, threshold), to)).collect();
    rated.sort_by(|a, b| a.0.total_cmp(&b.0));
    let now = shortfall(editor, v, editor.mesh().point(v), threshold);
    rated
        .into_iter()
        .take_while(|(rest, _)| *rest < now)
        .take(MOST_TRIED)
        .any(|(_, to)| editor.try_move(v, to, Gain::Mend(threshold)))
}

/// What the star of a vertex would lack to the threshold, were the vertex elsewhere.
fn shortfall(editor: &Editor<'_>, v: VertexId, to: DVec3, threshold: f64) -> f64 {
    let mesh = editor.mesh();
    let lack = |f: FaceId| {
        let corners = mesh.corners(f).map(|w| if w == v { to } else { mesh.point(w) });
        (threshold - stretch(corners)).max(0.0)
    };
    mesh.faces_around(v).map(lack).sum()
}

/// Places round a free vertex, on the reference.
fn around(editor: &Editor<'_>, v: VertexId) -> Vec<DVec3> {
    let mesh = editor.mesh();
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
    wishes.map(|(step, k)| wish(step, k)).map(|p| editor.keeper.project(p).unwrap_or(p)).collect()
}

/// Places along the curve of a vertex.
fn along_curve(editor: &Editor<'_>, v: VertexId) -> Vec<DVec3> {
    let Some(ends) = editor.curve_neighbours(v) else { return Vec::new() };
    let mesh = editor.mesh();
    let at = mesh.point(v);
    let wishes = STEPS.into_iter().flat_map(|step| ends.map(|w| at + step * (mesh.point(w) - at)));
    wishes.filter_map(|wish| editor.keeper.project_to_curve(wish)).collect()
}

/// Splits the long edge of a cap at the foot of its height, and collapses the height.
fn split_cap(editor: &mut Editor<'_>, f: FaceId, longest: EdgeId, rules: &CollapseRules) -> bool {
    let mesh = editor.mesh();
    let [a, b] = mesh.ends(longest);
    let Some(apex) = mesh.corners(f).into_iter().find(|&v| v != a && v != b) else { return false };
    let (p, q, r) = (mesh.point(a), mesh.point(b), mesh.point(apex));
    let along = q - p;
    let t = (r - p).dot(along) / along.length_squared().max(f64::MIN_POSITIVE);
    if !(0.1..=0.9).contains(&t) {
        return false;
    }
    let height = (r - (p + t * along)).length();
    // Only caps: elsewhere a split makes things worse, and nothing would undo it.
    if height > 0.2 * along.length() {
        return false;
    }
    let before = editor.stretch(f);
    let Some(foot) = editor.try_split(longest, p + t * along) else { return false };
    let Some(h) = editor.mesh().find_halfedge(foot, apex) else { return false };
    // The star of the height contains the halves of the cap, which are as bad as it was.
    let rules = CollapseRules { min_stretch: before, ..*rules };
    if editor.try_collapse(edge_of(h), &rules).is_some() {
        return true;
    }
    // Undo: the foot goes back into an end of the edge.
    let back: Vec<EdgeId> = editor.mesh().outgoing(foot).map(edge_of).collect();
    let rules = CollapseRules { min_stretch: 0.0, mend_below: None, ..rules };
    for e in back {
        if editor.mesh().ends(e).iter().any(|&v| v == a || v == b) && editor.try_collapse(e, &rules).is_some() {
            break;
        }
    }
    false
}

/// The edges of a face, shortest first.
fn edges_by_length(editor: &Editor<'_>, f: FaceId) -> [EdgeId; 3] {
    let mesh = editor.mesh();
    let first = mesh.face_halfedge(f);
    let mut edges = [first, mesh.next(first), mesh.prev(first)].map(edge_of);
    let length = |e: EdgeId| {
        let [a, b] = mesh.ends(e);
        (mesh.point(b) - mesh.point(a)).length_squared()
    };
    edges.sort_by(|&d, &e| length(d).total_cmp(&length(e)).then(d.cmp(&e)));
    edges
}
