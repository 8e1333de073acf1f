//! Local remeshing under guards: what pure collapse cannot reach.
//!
//! Passes as in Botsch and Kobbelt, A Remeshing Approach to Multiresolution Modeling, SGP 2004 (split, collapse, flip,
//! tangential relaxation, projection), each edit admitted by the [`Editor`] only: thresholds, certified tolerance and
//! embedding hold after every one of them, and it must gain, so that the passes end.
//!
//! Where no face is poor any more, the mean is raised: see [`coarsen`]. [`raise_stretch`] repairs the faces below a threshold before and after.

mod cavity;
mod edit;
mod ops;
mod raise;
mod regular;
mod search;

pub use ops::Gain;
use raise::settle_in;
pub use raise::{faces_below, raise_stretch, touch_up};
use regular::flip_to_regular;

use glam::DVec3;

use crate::mesh::geometry::area_vector;
use crate::mesh::{EdgeId, Freedom, VertexId};
use crate::technique::collapse::{CollapseRules, Editor, Ending, simplify};
use crate::watch::{Cancelled, Watch};

/// Least and mean stretch that optimised coarsening asks of new stars, in falling steps.
const COMFORT: [(f64, f64); 3] = [(0.7, 0.88), (0.6, 0.83), (0.5, 0.78)];

/// Further steps for meshes that the first ones hardly coarsen, such as grids of right-angled triangles, where the first
/// collapse always makes its star less even.
const LESS_COMFORT: [(f64, f64); 2] = [(0.4, 0.65), (0.3, 0.5)];

/// The part of the faces that must be gone for the further steps to be left out.
const COARSENED: f64 = 0.25;

/// What optimised faces should reach beyond the threshold asked for, with all means, and with single edits.
const GOOD: f64 = 0.35;
const BETTER: f64 = 0.45;

/// Rounds of flips and relaxation between collapses, and at the end.
const ROUNDS: [usize; 2] = [2, 8];

/// Rounds of flips towards regular valences and of moves that raise the mean, at the end.
const EVENING: usize = 4;

/// Coarsens to `target` faces, or until no edge is valid, with optimisation in between.
///
/// The stretch that new faces need starts high and falls in steps, so that poor collapses are only done when a target
/// asks for them; without a target they are not done.
pub fn coarsen(
    editor: &mut Editor<'_>,
    rules: &CollapseRules,
    target: usize,
    watch: &Watch,
) -> Result<Ending, Cancelled> {
    let mut ending = Ending::Exhausted;
    let start = editor.mesh().face_count() as f64;
    for (place, (least, mean)) in COMFORT.into_iter().chain(LESS_COMFORT).enumerate() {
        if place >= COMFORT.len() && (editor.mesh().face_count() as f64) < (1.0 - COARSENED) * start {
            break;
        }
        let rules = CollapseRules { min_stretch: least.max(rules.min_stretch), mean_stretch: mean, ..*rules };
        ending = simplify(editor, &rules, target, watch)?;
        optimise(editor, ROUNDS[0], watch)?;
        if ending == Ending::Target {
            break;
        }
    }
    let (mut comfort, _) = COMFORT[COMFORT.len() - 1];
    while ending == Ending::Exhausted && target > 0 && comfort > rules.min_stretch {
        comfort = (comfort - 0.1).max(rules.min_stretch);
        ending = simplify(editor, &CollapseRules { min_stretch: comfort, ..*rules }, target, watch)?;
        optimise(editor, 1, watch)?;
    }
    optimise(editor, ROUNDS[1], watch)?;
    even_out(editor, GOOD.max(rules.min_stretch), watch)?;
    for threshold in [rules.min_stretch, GOOD.max(rules.min_stretch)] {
        raise_stretch(editor, threshold, rules, watch)?;
    }
    touch_up(editor, BETTER.max(rules.min_stretch), rules, watch)?;
    Ok(ending)
}

/// Raises the mean stretch where no face falls below `least` by it: flips towards regular valences, which only pay after
/// the moves that follow, and moves to the centre of the star and then to the best place nearby.
fn even_out(editor: &mut Editor<'_>, least: f64, watch: &Watch) -> Result<(), Cancelled> {
    watch.phase("even out", Some(EVENING as u64));
    let gain = Gain::Mean(least);
    for round in 0..EVENING {
        watch.advance(round as u64, || format!("{} faces", editor.mesh().face_count()));
        if round + 1 < EVENING {
            flip_to_regular(editor, watch)?;
        }
        for _ in 0..2 {
            relax_vertices(editor, watch, |editor, v| relax(editor, v, gain))?;
        }
        flip_edges(editor, watch)?;
        relax_vertices(editor, watch, |editor, v| settle_in(editor, v, gain))?;
    }
    Ok(())
}

/// Collapses until no edge is valid, those that leave good faces first, and nothing else in between.
pub fn coarsen_purely(editor: &mut Editor<'_>, rules: &CollapseRules, watch: &Watch) -> Result<Ending, Cancelled> {
    for (least, mean) in COMFORT.into_iter().chain(LESS_COMFORT) {
        let rules = CollapseRules { min_stretch: least.max(rules.min_stretch), mean_stretch: mean, ..*rules };
        simplify(editor, &rules, 0, watch)?;
    }
    simplify(editor, rules, 0, watch)
}

/// Rounds of splits, flips and relaxation. Returns the number of edits that gained in the last round.
pub fn optimise(editor: &mut Editor<'_>, rounds: usize, watch: &Watch) -> Result<usize, Cancelled> {
    let mut last = 0;
    watch.phase("optimise", Some(rounds as u64));
    for round in 0..rounds {
        watch.advance(round as u64, || format!("{} faces", editor.mesh().face_count()));
        split_long_edges(editor, watch)?;
        last = flip_edges(editor, watch)? + relax_vertices(editor, watch, relax_for_quality)?;
        if last * 200 < editor.mesh().vertex_count() {
            break;
        }
    }
    Ok(last)
}

/// Halves edges above the size limit, longest first.
fn split_long_edges(editor: &mut Editor<'_>, watch: &Watch) -> Result<(), Cancelled> {
    if editor.limits().max_size.is_unlimited() {
        return Ok(());
    }
    let mesh = editor.mesh();
    let mut long: Vec<(f64, EdgeId)> = Vec::new();
    for e in mesh.edges() {
        let [a, b] = mesh.ends(e).map(|v| mesh.point(v));
        let length = (b - a).length();
        if length > editor.limits().max_size.at(0.5 * (a + b)) {
            long.push((length, e));
        }
    }
    long.sort_by(|x, y| y.0.total_cmp(&x.0).then(x.1.cmp(&y.1)));
    for (place, (_, e)) in long.into_iter().enumerate() {
        if place.is_multiple_of(64) {
            watch.check()?;
        }
        let [a, b] = editor.mesh().ends(e).map(|v| editor.mesh().point(v));
        editor.try_split(e, 0.5 * (a + b));
    }
    Ok(())
}

fn flip_edges(editor: &mut Editor<'_>, watch: &Watch) -> Result<usize, Cancelled> {
    let mut flips = 0;
    for e in (0..editor.mesh().edge_slots()).map(EdgeId::new) {
        if e.index().is_multiple_of(256) {
            watch.check()?;
        }
        if editor.mesh().edge_is_live(e) && editor.try_flip(e, Gain::LeastStretch) {
            flips += 1;
        }
    }
    Ok(flips)
}

fn relax_vertices(
    editor: &mut Editor<'_>,
    watch: &Watch,
    relax: impl Fn(&mut Editor<'_>, VertexId) -> bool,
) -> Result<usize, Cancelled> {
    let mut moves = 0;
    for v in (0..editor.mesh().vertex_slots()).map(VertexId::new) {
        if v.index().is_multiple_of(256) {
            watch.check()?;
        }
        if editor.mesh().vertex_is_live(v) && relax(editor, v) {
            moves += 1;
        }
    }
    Ok(moves)
}

fn relax_for_quality(editor: &mut Editor<'_>, v: VertexId) -> bool {
    relax(editor, v, Gain::Quality)
}

/// Relaxation of a vertex: a free one tangentially, one on a curve along it.
fn relax(editor: &mut Editor<'_>, v: VertexId, gain: Gain) -> bool {
    match editor.mesh().vertex_freedom(v) {
        Freedom::Free => relax_tangentially(editor, v, gain),
        Freedom::OnCurve => relax_along_curve(editor, v, gain),
        Freedom::Keep => false,
    }
}

/// Towards the area-weighted centroid of the star, back onto the reference.
fn relax_tangentially(editor: &mut Editor<'_>, v: VertexId, gain: Gain) -> bool {
    let mesh = editor.mesh();
    let at = mesh.point(v);
    let (mut centre, mut normal, mut weight) = (DVec3::ZERO, DVec3::ZERO, 0.0);
    for f in mesh.faces_around(v) {
        let corners = mesh.corner_points(f);
        let vector = area_vector(corners);
        let area = vector.length();
        centre += area * ((corners[0] - at) + (corners[1] - at) + (corners[2] - at)) / 3.0;
        normal += vector;
        weight += area;
    }
    let Some(normal) = normal.try_normalize() else { return false };
    if weight <= 0.0 {
        return false;
    }
    let step = centre / weight;
    let tangential = step - normal * normal.dot(step);
    for share in [1.0, 0.4] {
        let wish = at + share * tangential;
        let to = editor.keeper.project(wish).unwrap_or(wish);
        if editor.try_move(v, to, gain) {
            return true;
        }
    }
    false
}

/// Towards the middle between the neighbours on the curve, back onto the reference's curve.
fn relax_along_curve(editor: &mut Editor<'_>, v: VertexId, gain: Gain) -> bool {
    let Some([a, b]) = editor.curve_neighbours(v) else { return false };
    let mesh = editor.mesh();
    let (at, middle) = (mesh.point(v), 0.5 * (mesh.point(a) + mesh.point(b)));
    for share in [1.0, 0.5, 0.2] {
        let Some(to) = editor.keeper.project_to_curve(at + share * (middle - at)) else { return false };
        if editor.try_move(v, to, gain) {
            return true;
        }
    }
    false
}
