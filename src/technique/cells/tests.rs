//! What must hold of the whole that comes out of cells, on a wavy torus that carries everything there is.

use std::f64::consts::TAU;

use super::*;
use crate::mesh::{EdgeMark, Freedom, HalfedgeMesh, MarkCause, Regions, SeamId, edge_key};
use crate::metric::distance::{Target, upper_bound};
use crate::metric::intersection::self_intersections;
use crate::technique::collapse::{Order, Priority};
use crate::technique::guarded::{Limits, SizeField, StarRules, open};

const AROUND: usize = 120;
const ACROSS: usize = 60;
/// The half of it that is a group: not where boxes are cut in two.
const HALF: std::ops::Range<usize> = 11..71;
const SMALL: Size = Size { large: 2_000, cell: 400 };

#[derive(Debug, thiserror::Error)]
enum Error {
    #[error(transparent)]
    Locks(#[from] FreedomError),
    #[error(transparent)]
    Enter(#[from] EnterError),
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

/// Radii 1 and 0.4, with waves; group `half` and a region on one half, whose borders are marked curves.
fn torus(scale: f64) -> Surface {
    let id = |i: usize, j: usize| VertexId::new((i % AROUND) * ACROSS + j % ACROSS);
    let mut surface = Surface::default();
    for (i, j) in (0..AROUND).flat_map(|i| (0..ACROSS).map(move |j| (i, j))) {
        let (u, v) = (TAU * i as f64 / AROUND as f64, TAU * j as f64 / ACROSS as f64);
        let tube = 0.4 + 0.02 * libm::sin(5.0 * u) * libm::cos(3.0 * v);
        let radius = 1.0 + tube * libm::cos(v);
        surface.points.push(scale * DVec3::new(radius * libm::cos(u), radius * libm::sin(u), tube * libm::sin(v)));
    }
    let mut labels = Vec::new();
    let mut half = Vec::new();
    for (i, j) in (0..AROUND).flat_map(|i| (0..ACROSS).map(move |j| (i, j))) {
        let [a, b, c, d] = [id(i, j), id(i + 1, j), id(i + 1, j + 1), id(i, j + 1)];
        for face in [[a, b, c], [a, c, d]] {
            let f = surface.faces.push(face);
            labels.push(u32::from(HALF.contains(&i)));
            half.extend(HALF.contains(&i).then_some(f));
        }
    }
    let mark = EdgeMark { freedom: Freedom::OnCurve, cause: MarkCause::RegionBorder };
    let circles =
        [HALF.start, HALF.end].into_iter().flat_map(|i| (0..ACROSS).map(move |j| edge_key(id(i, j), id(i, j + 1))));
    let carried = &mut surface.carried;
    carried.marks = circles.map(|edge| (edge, mark)).collect();
    carried.groups.edges.insert("first".to_owned(), {
        let mut edges: Vec<_> = (0..ACROSS).map(|j| edge_key(id(HALF.start, j), id(HALF.start, j + 1))).collect();
        edges.sort_unstable();
        edges
    });
    carried.groups.faces.insert("half".to_owned(), half);
    carried.groups.vertices.insert("held".to_owned(), vec![id(7, 9), id(70, 40)]);
    carried.pins = [id(7, 9), id(70, 40)].map(|v| (v, Freedom::Keep)).into();
    carried.regions = Some(Regions { labels: labels.into_iter().collect(), names: vec!["a".into(), "b".into()] });
    surface
}

fn setup(mode: ToleranceMode, tolerance: f64) -> Setup {
    let limits = Limits { min_stretch: 0.2, max_size: SizeField::Uniform(f64::INFINITY), max_valence: 10 };
    let feature_tolerance = 0.5 * tolerance;
    Setup { mode, tolerance, feature_tolerance, feature_weight: 100.0, limits, may_merge_corners: false }
}

fn thinned(surface: &Surface, mode: ToleranceMode, tolerance: f64) -> Thinned {
    let rules = CollapseRules {
        star: StarRules { min_stretch: 0.2, ..StarRules::default() },
        order: Order::of(mode),
        priority: Priority::SmallFirst { size: 1.0 },
    };
    let setup = setup(mode, tolerance);
    let locks = LockRules::default();
    let task = Task { surface, reference: surface, locks, setup: &setup, rules: &rules, faces: 200 };
    thin_by::<Error>(SMALL, &task, &Watch::silent()).unwrap().expect("large enough")
}

const MODES: [(ToleranceMode, f64); 2] = [(ToleranceMode::Distance, 0.02), (ToleranceMode::QuadricRms, 0.02)];

#[test]
fn the_whole_is_one_surface_without_new_crossings() {
    let before = torus(1.0);
    for (mode, tolerance) in MODES {
        let Thinned { surface, counts, .. } = thinned(&before, mode, tolerance);
        let (faces, all) = (surface.faces.len(), before.faces.len());
        assert!(faces < all / 2, "{mode:?}: {faces} of {all} faces are left");
        assert_eq!(all - faces, 2 * counts.collapses);
        let freedom = resolve_freedom(&surface, &LockRules::default()).unwrap();
        let mesh = HalfedgeMesh::new(&surface, &freedom).unwrap();
        assert_eq!(mesh.euler_characteristic(), 0);
        assert!(mesh.edges().all(|e| !mesh.is_boundary_edge(e)));
        assert!(mesh.vertices().all(|v| mesh.valence(v) <= 10));
        assert_eq!(self_intersections(&surface.to_soup(), &Watch::silent()).unwrap().crossing().count(), 0);
    }
}

#[test]
fn certified_cells_use_half_of_the_tolerance() {
    let before = torus(1.0);
    let Thinned { surface, .. } = thinned(&before, ToleranceMode::Distance, 0.02);
    let [mesh, reference] = [&surface, &before].map(|surface| Target::of(&surface.to_soup()));
    for (from, to) in [(&mesh, &reference), (&reference, &mesh)] {
        let bound = upper_bound(from, to, &Watch::silent()).unwrap().unwrap();
        assert!(bound <= 0.01 * 1.001, "{bound}");
    }
}

#[test]
fn everything_carried_is_there_still() {
    let before = torus(1.0);
    for (mode, tolerance) in MODES {
        let Thinned { surface, .. } = thinned(&before, mode, tolerance);
        let carried = &surface.carried;
        // Two closed curves, of which one is the edge group.
        let mut at = vec![0; surface.points.len()];
        carried.marks.keys().flatten().for_each(|v| at[v.index()] += 1);
        assert!(at.iter().all(|&count| count == 0 || count == 2), "{mode:?}: curves are closed");
        let first = &carried.groups.edges["first"];
        assert!(!first.is_empty() && first.iter().all(|edge| carried.marks.contains_key(edge)));
        let marks = [carried.marks.len(), before.carried.marks.len()];
        assert!(first.len() < marks[0] && marks[0] < marks[1], "{mode:?}: {} of {marks:?} edges", first.len());
        // The group is the region, and ends at the curves.
        let regions = carried.regions.as_ref().unwrap();
        let labels: Vec<u32> = surface.faces.ids().map(|f| regions.labels[f]).collect();
        let half = &carried.groups.faces["half"];
        let of_label: Vec<FaceId> = surface.faces.ids().filter(|&f| labels[f.index()] == 1).collect();
        assert_eq!(half, &of_label);
        let area = |surface: &Surface| -> f64 {
            let half = surface.carried.groups.faces["half"].iter();
            half.map(|&f| triangle_area(surface.corners(f))).sum()
        };
        assert!((area(&surface) / area(&before) - 1.0).abs() < 0.02);
        // Pinned vertices lie where they lay.
        let places = |surface: &Surface| -> Vec<[u64; 3]> {
            let held = surface.carried.groups.vertices["held"].iter();
            let mut places: Vec<_> = held.map(|&v| surface.points[v].to_array().map(f64::to_bits)).collect();
            places.sort_unstable();
            places
        };
        assert_eq!(places(&surface), places(&before));
        assert_eq!(carried.pins.keys().copied().collect::<Vec<_>>(), carried.groups.vertices["held"]);
    }
}

#[test]
fn threads_and_powers_of_two_change_nothing() {
    for (mode, tolerance) in MODES {
        let one = thinned(&torus(1.0), mode, tolerance);
        for threads in [1, 2, 5, 8] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let same = pool.install(|| thinned(&torus(1.0), mode, tolerance));
            assert_eq!(one.surface, same.surface, "{threads} threads");
            assert_eq!(one.gathered, same.gathered, "{threads} threads");
        }
        let scale = f64::from(1 << 20);
        let scaled = thinned(&torus(scale), mode, tolerance * scale);
        assert_eq!(one.surface.faces, scaled.surface.faces);
    }
}

#[test]
fn quadrics_go_on_where_they_were() {
    let before = torus(1.0);
    let thinned = thinned(&before, ToleranceMode::QuadricRms, 0.02);
    // Every face of the input has given its plane to its three corners, and nothing is lost on the way.
    let freedom = resolve_freedom(&thinned.surface, &LockRules::default()).unwrap();
    let tree = reference_tree(ToleranceMode::QuadricRms, &before);
    let setup = setup(ToleranceMode::QuadricRms, 0.02);
    let mut guarded = open(&thinned.surface, &freedom, &before, &tree, setup).unwrap();
    thinned.hand_over(&mut guarded);
    let count: f64 = guarded.mesh().vertices().map(|v| guarded.gathered(v).planes()).sum();
    assert!((count - 3.0 * before.faces.len() as f64).abs() < 1e-6 * count, "{count} planes");
}

#[test]
fn what_cells_cannot_do_is_left_alone() {
    let mut surface = torus(1.0);
    let rules = CollapseRules {
        star: StarRules::default(),
        order: Order::of(ToleranceMode::Distance),
        priority: Priority::SmallFirst { size: 1.0 },
    };
    let setup = setup(ToleranceMode::Distance, 0.02);
    let asks = |surface: &Surface, reference: &Surface, faces: usize, size: Size| {
        let task = Task { surface, reference, locks: LockRules::default(), setup: &setup, rules: &rules, faces };
        thin_by::<Error>(size, &task, &Watch::silent()).unwrap().is_some()
    };
    assert!(asks(&surface, &surface, 600, SMALL));
    assert!(!asks(&surface, &surface, 600, SIZE), "small");
    assert!(!asks(&surface, &surface, 10_000, SMALL), "hardly fewer faces");
    assert!(!asks(&surface, &torus(1.1), 600, SMALL), "another reference");
    surface.carried.seams = [(VertexId::new(0), SeamId(0))].into();
    assert!(!asks(&surface, &surface, 600, SMALL), "seams");
}
