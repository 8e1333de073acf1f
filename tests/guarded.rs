//! The promise of guarded edits, tried on long random sequences of them: whatever the verbs and their order, the
//! surface stays within the tolerance of its reference, both ways. The distance is measured by `metric::distance`,
//! which shares no code with the certificate.

use glam::{DVec3, dvec3};
use meshmill::mesh::halfedge::{HalfedgeMesh, halfedge_of};
use meshmill::mesh::validate::validate_workshop;
use meshmill::mesh::{EdgeId, FaceId, Facet, LockRules, Soup, Surface, VertexId, resolve_freedom};
use meshmill::metric::ToleranceMode;
use meshmill::metric::distance::{Target, decide};
use meshmill::steps::features::{FeaturesParams, features};
use meshmill::steps::repair::{NonManifold, RepairParams, repair};
use meshmill::technique::guarded::{
    Edit, Gain, GuardedMesh, Limits, Refused, Setup, SizeField, StarRules, diagonal, open, reference_tree,
};
use meshmill::watch::Watch;
use proptest::prelude::*;
use proptest::test_runner::Config;

/// Verbs in a sequence, and how many pass between two looks at the distance.
const VERBS: usize = 500;
const LOOK_EVERY: usize = 125;

/// The start meshes: smooth and sharp, closed and open, one sheet and three that meet along an edge.
const STARTS: [fn() -> Vec<[DVec3; 3]>; 5] = [torus, cube, bowl, sheet, book];

/// The triangles of `m` by `n` squares over the unit square.
fn squares(m: u32, n: u32, place: impl Fn(f64, f64) -> DVec3) -> Vec<[DVec3; 3]> {
    let at = |i: u32, j: u32| place(f64::from(i) / f64::from(m), f64::from(j) / f64::from(n));
    let cells = (0..m).flat_map(|i| (0..n).map(move |j| (i, j)));
    cells
        .flat_map(|(i, j)| {
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            [[a, b, c], [a, c, d]]
        })
        .collect()
}

fn torus() -> Vec<[DVec3; 3]> {
    squares(16, 13, |u, v| {
        // One turn is the same to the last bit wherever it ends.
        let ((sin_u, cos_u), (sin_v, cos_v)) = (turn(u), turn(v));
        dvec3((3.0 + cos_v) * cos_u, (3.0 + cos_v) * sin_u, sin_v)
    })
}

fn turn(part: f64) -> (f64, f64) {
    libm::sincos(std::f64::consts::TAU * part.fract())
}

/// Sharp edges and corners.
fn cube() -> Vec<[DVec3; 3]> {
    let side = |turned: fn(DVec3) -> DVec3| squares(3, 3, move |u, v| turned(dvec3(u, v, 1.0) - 0.5));
    let sides = [
        side(|p| p),
        side(|p| dvec3(p.z, p.x, p.y)),
        side(|p| dvec3(p.y, p.z, p.x)),
        side(|p| dvec3(p.y, p.x, -p.z)),
        side(|p| dvec3(-p.z, p.y, p.x)),
        side(|p| dvec3(p.x, -p.z, p.y)),
    ];
    sides.concat()
}

/// Round, with a rim.
fn bowl() -> Vec<[DVec3; 3]> {
    squares(7, 7, |u, v| {
        let (x, y) = (2.0 * u - 1.0, 2.0 * v - 1.0);
        dvec3(x, y, 0.4 * (x * x + y * y))
    })
}

/// Wavy and open.
fn sheet() -> Vec<[DVec3; 3]> {
    squares(9, 6, |u, v| dvec3(1.6 * u, v, 0.1 * libm::sin(9.0 * u) * libm::cos(7.0 * v)))
}

/// Three pages.
fn book() -> Vec<[DVec3; 3]> {
    let page = |x: f64, y: f64| squares(3, 4, move |u, v| dvec3(u * x, u * y, v));
    [page(1.0, 0.0), page(-0.8, 0.3), page(-0.1, -0.9)].concat()
}

/// A start mesh with its curves marked; what is not manifold is cut along seams.
fn start(triangles: &[[DVec3; 3]]) -> Surface {
    let points: Vec<DVec3> = triangles.as_flattened().to_vec();
    let faces = (0..triangles.len()).map(|f| Facet::Tri([0, 1, 2].map(|k| VertexId::new(3 * f + k)))).collect();
    let soup = Soup { points: points.into(), faces, ..Soup::default() };
    let params = RepairParams { non_manifold: NonManifold::Seam, ..RepairParams::default() };
    let (whole, _) = repair(&soup, &params, &Watch::silent()).expect("a surface");
    let (marked, _) = features(&whole, &FeaturesParams::default(), &Watch::silent()).expect("its curves");
    marked
}

/// One verb, still to be applied to what is there.
#[derive(Clone, Copy, Debug)]
struct Draw {
    verb: u8,
    gain: u8,
    /// Which element, as a part of all.
    place: f64,
    /// Where to, in local edge lengths.
    step: [f64; 3],
    /// How much of that: small steps add up.
    share: f64,
}

fn draws() -> impl Strategy<Value = Vec<Draw>> {
    let share = prop::sample::select(vec![0.02, 0.1, 0.3]);
    let draw = (0..10_u8, 0..5_u8, 0.0..1.0, prop::array::uniform3(-1.0..1.0), share);
    let draw = draw.prop_map(|(verb, gain, place, step, share)| Draw { verb, gain, place, step, share });
    prop::collection::vec(draw, VERBS)
}

fn gain(draw: Draw) -> Gain {
    [Gain::None, Gain::Keep(0.0), Gain::Mend(0.5), Gain::LeastStretch, Gain::Quality][usize::from(draw.gain)]
}

/// The element at a part of all.
fn nth<T: Copy>(all: impl Iterator<Item = T>, place: f64) -> Option<T> {
    let all: Vec<T> = all.collect();
    all.get((place * all.len() as f64) as usize).copied()
}

/// A wish beside the middle of an edge, on the reference where the draw says so.
fn wish(guarded: &GuardedMesh<'_>, ends: [VertexId; 2], draw: Draw) -> DVec3 {
    let [a, b] = ends.map(|v| guarded.mesh().point(v));
    let at = a.lerp(b, 0.5 + 0.4 * draw.step[0]) + draw.share * a.distance(b) * DVec3::from_array(draw.step);
    if draw.gain.is_multiple_of(2) { guarded.project(at).unwrap_or(at) } else { at }
}

/// Does one verb; whether it was admitted.
fn apply(guarded: &mut GuardedMesh<'_>, draw: Draw) -> bool {
    let Some(edge) = nth(guarded.mesh().edges(), draw.place) else { return false };
    let ends = guarded.mesh().ends(edge);
    let to = wish(guarded, ends, draw);
    let rules = StarRules { min_stretch: 0.05, ..StarRules::default() };
    match draw.verb {
        0 => collapse(guarded, edge, to, &rules),
        1 => guarded.flip(edge, gain(draw)).is_ok(),
        2 => guarded.split(edge, to).is_ok(),
        3 => {
            let step = draw.share * DVec3::from_array(draw.step);
            let at = guarded.mesh().point(ends[0]);
            let to = at + at.distance(guarded.mesh().point(ends[1])) * step;
            guarded.relocate(ends[0], to, gain(draw)).is_ok()
        }
        4 => {
            let along = guarded.mesh().point(ends[1]) - guarded.mesh().point(ends[0]);
            let wish = guarded.mesh().point(ends[0]) + 0.5 * draw.step[0] * along;
            let to = guarded.project_to_curve(wish).unwrap_or(wish);
            guarded.relocate(ends[0], to, gain(draw)).is_ok()
        }
        5 => guarded.plan_edge(edge, &rules).and_then(|merge| guarded.merge(&merge, to)).is_ok(),
        6 => merge_face(guarded, draw, &rules),
        7 => split_and_pull(guarded, ends, to, draw),
        8 => several(guarded, edge, draw),
        _ => drafted(guarded, draw),
    }
}

fn collapse(guarded: &mut GuardedMesh<'_>, edge: EdgeId, to: DVec3, rules: &StarRules) -> bool {
    let Ok(plan) = guarded.plan_collapse(edge, rules) else { return false };
    let Ok(place) = guarded.place(&plan, to) else { return false };
    guarded.collapse(&plan, &place).is_ok()
}

fn merge_face(guarded: &mut GuardedMesh<'_>, draw: Draw, rules: &StarRules) -> bool {
    let Some(face) = nth(guarded.mesh().faces(), draw.place) else { return false };
    let Ok(merge) = guarded.plan_face(face, rules) else { return false };
    let [a, b, c] = guarded.mesh().corner_points(face);
    let to = (a + b + c) / 3.0 + draw.share * a.distance(b) * DVec3::from_array(draw.step);
    guarded.merge(&merge, to).is_ok()
}

/// A transaction that halves an edge and moves the new vertex.
fn split_and_pull(guarded: &mut GuardedMesh<'_>, ends: [VertexId; 2], to: DVec3, draw: Draw) -> bool {
    let [a, b] = ends.map(|v| guarded.mesh().point(v));
    let made = VertexId::new(guarded.mesh().vertex_slots());
    let edits = [Edit::Split { ends, at: 0.5 * (a + b) }, Edit::Move { vertex: made, to }];
    guarded.transact(&edits, gain(draw)).is_ok()
}

/// A transaction over the two faces of an edge: flipped, then one of the sides halved, and a corner taken away.
fn several(guarded: &mut GuardedMesh<'_>, edge: EdgeId, draw: Draw) -> bool {
    let mesh = guarded.mesh();
    let Some(apex) = mesh.apex(halfedge_of(edge)) else { return false };
    let ends = mesh.ends(edge);
    let side = [ends[0], apex];
    let at = 0.5 * (mesh.point(side[0]) + mesh.point(side[1]));
    let made = VertexId::new(mesh.vertex_slots());
    let out = nth(mesh.outgoing(ends[1]), draw.place).map_or(apex, |h| mesh.target(h));
    let edits = [
        Edit::Flip { ends },
        Edit::Split { ends: side, at },
        Edit::Collapse { ends: [ends[1], out], to: mesh.point(out) },
        Edit::Move { vertex: made, to: at + 0.1 * DVec3::from_array(draw.step) * at.distance(mesh.point(apex)) },
    ];
    let few = if draw.gain.is_multiple_of(2) { &edits[..2] } else { &edits[1..] };
    guarded.transact(few, gain(draw)).is_ok()
}

/// Edits on a copy of the faces round one, by the copy's own numbers, where vertices at its edge look kept: an edge is
/// halved, the new vertex goes into a corner nearby, and another edge is flipped.
fn drafted(guarded: &mut GuardedMesh<'_>, draw: Draw) -> bool {
    let Some(face) = nth(guarded.mesh().faces(), draw.place) else { return false };
    let Ok(draft) = guarded.draft(guarded.mesh().corners(face)) else { return false };
    let place = |turn: f64| (draw.place * 97.0 + 0.37 * turn).fract();
    let side = |mesh: &HalfedgeMesh, turn| {
        let core = nth(mesh.faces().filter(|&f| draft.is_core(f)), place(turn))?;
        let h = mesh.face_halfedge(core);
        Some([mesh.origin(h), mesh.target(h)])
    };
    let start = draft.begin(guarded);
    let Some(ends) = side(start.mesh(), 0.0) else { return false };
    let [a, b] = ends.map(|v| start.mesh().point(v));
    let made = VertexId::new(start.mesh().vertex_slots());
    let at = a.lerp(b, 0.5) + draw.share * 0.1 * a.distance(b) * DVec3::from_array(draw.step);
    let halved = start.with(guarded, Edit::Split { ends, at });
    let merged = halved.and_then(|trial| {
        let corner = ends[usize::from(draw.gain % 2)];
        trial.with(guarded, Edit::Collapse { ends: [made, corner], to: at })
    });
    let flipped = merged.and_then(|trial| {
        let ends = side(trial.mesh(), 1.0).ok_or(Refused::Topology)?;
        trial.with(guarded, Edit::Flip { ends })
    });
    flipped.and_then(|trial| guarded.commit(&trial, Gain::Keep(0.0))).is_ok()
}

/// Whether both meshes lie within `tolerance` of each other.
fn lie_within(mesh: &HalfedgeMesh, reference: &Target, tolerance: f64) -> bool {
    let target = Target::of(&mesh.clone().leave().surface.to_soup());
    [(&target, reference), (reference, &target)].into_iter().all(|(from, to)| {
        let decision = decide(from, to, tolerance, &Watch::silent()).expect("not cancelled");
        decision.is_some_and(|decision| decision.holds)
    })
}

fn setup(tolerance: f64) -> Setup {
    Setup {
        mode: ToleranceMode::Distance,
        tolerance,
        feature_tolerance: tolerance,
        feature_weight: 1.0,
        limits: Limits { min_stretch: 0.05, max_size: SizeField::Uniform(f64::INFINITY), max_valence: 14 },
        may_merge_corners: true,
    }
}

proptest! {
    #![proptest_config(Config { cases: 40, failure_persistence: None, max_shrink_iters: 64, ..Config::default() })]

    #[test]
    fn any_sequence_of_verbs_keeps_the_distance(
        which in 0..STARTS.len(),
        share in prop::sample::select(vec![0.003, 0.01, 0.03]),
        draws in draws(),
    ) {
        let surface = start(&STARTS[which]());
        let tolerance = share * diagonal(&surface);
        let reference = Target::of(&surface.to_soup());
        let freedom = resolve_freedom(&surface, &LockRules::default()).expect("no locks");
        let tree = reference_tree(ToleranceMode::Distance, &surface);
        let mut guarded = open(&surface, &freedom, &surface, &tree, setup(tolerance)).expect("a surface");
        guarded.tie_seams();
        let mut done = 0;
        for (at, draw) in draws.into_iter().enumerate() {
            let edits = guarded.counts().edits();
            let admitted = apply(&mut guarded, draw);
            prop_assert_eq!(admitted, guarded.counts().edits() > edits, "told the truth about {:?}", draw);
            done += usize::from(admitted);
            if (at + 1).is_multiple_of(LOOK_EVERY) {
                prop_assert_eq!(validate_workshop(guarded.mesh()), []);
                prop_assert!(lie_within(guarded.mesh(), &reference, tolerance), "after {} verbs", at + 1);
            }
        }
        prop_assert!(done > VERBS / 20, "only {} verbs were admitted", done);
        prop_assert_eq!(guarded.certified_distance(tolerance), Some(tolerance));
    }
}

#[test]
fn plans_and_drafts_older_than_the_last_edit_are_refused() {
    let surface = start(&torus());
    let freedom = resolve_freedom(&surface, &LockRules::default()).expect("no locks");
    let tree = reference_tree(ToleranceMode::Distance, &surface);
    let mut guarded = open(&surface, &freedom, &surface, &tree, setup(0.1)).expect("a surface");
    let rules = StarRules::default();
    let edges: Vec<EdgeId> = guarded.mesh().edges().collect();
    let middle = |guarded: &GuardedMesh<'_>, edge| {
        let [a, b] = guarded.mesh().ends(edge).map(|v| guarded.mesh().point(v));
        0.5 * (a + b)
    };
    let (plan, place) = edges
        .iter()
        .find_map(|&edge| {
            let plan = guarded.plan_collapse(edge, &rules).ok()?;
            let place = guarded.place(&plan, middle(&guarded, edge)).ok()?;
            Some((plan, place))
        })
        .expect("an edge that may collapse");
    let corners = guarded.mesh().corners(FaceId::new(0));
    let draft = guarded.draft(corners).expect("few faces");
    let trial = draft.begin(&guarded);
    let face = FaceId::new(40);
    let merge = guarded.plan_face(face, &rules).expect("three free corners");
    let at = middle(&guarded, edges[200]);
    guarded.split(edges[200], at).expect("the surface stays the same");
    assert_eq!(guarded.collapse(&plan, &place), Err(Refused::Outdated));
    assert_eq!(guarded.merge(&merge, at), Err(Refused::Outdated));
    assert_eq!(guarded.commit(&trial, Gain::None), Err(Refused::Outdated));
}

#[test]
fn a_transaction_is_kept_or_undone_as_a_whole() {
    let surface = start(&sheet());
    let freedom = resolve_freedom(&surface, &LockRules::default()).expect("no locks");
    let tree = reference_tree(ToleranceMode::Distance, &surface);
    let mut guarded = open(&surface, &freedom, &surface, &tree, setup(0.02)).expect("a surface");
    let mesh = guarded.mesh();
    let inner = mesh.edges().find(|&e| mesh.ends(e).iter().all(|&v| !mesh.is_boundary_vertex(v)));
    let ends = mesh.ends(inner.expect("an edge inside"));
    let [a, b] = ends.map(|v| mesh.point(v));
    let made = VertexId::new(mesh.vertex_slots());
    let faces = mesh.face_count();
    let split = Edit::Split { ends, at: 0.5 * (a + b) };
    let far = Edit::Move { vertex: made, to: 0.5 * (a + b) + 0.1 * DVec3::Z };
    let refused = guarded.transact(&[split, far], Gain::Keep(0.0)).expect_err("out of the tolerance, or folded");
    assert!(matches!(refused, Refused::Tolerance | Refused::FoldOver), "{refused}");
    assert_eq!((guarded.mesh().face_count(), guarded.counts().edits()), (faces, 0));
    let near = Edit::Move { vertex: made, to: 0.5 * (a + b) + 0.001 * DVec3::Z };
    guarded.transact(&[split, near], Gain::Keep(0.0)).expect("both");
    assert_eq!((guarded.mesh().face_count(), guarded.counts().edits()), (faces + 2, 2));
    assert_eq!(guarded.mesh().point(made), 0.5 * (a + b) + 0.001 * DVec3::Z);
}
