//! Unit tests of cavities: what they make regular, and what they leave as it is.

use glam::{DVec3, dvec3};
use proptest::prelude::*;

use super::*;
use crate::mesh::carried::{EdgeMark, MarkCause};
use crate::mesh::{Facet, Freedom, Soup, Surface, VertexId, edge_key};
use crate::technique::mixed::NONE;

/// Squares along each side.
const N: u32 = 12;

fn id(x: u32, y: u32) -> u32 {
    y * (N + 1) + x
}

fn squares() -> impl Iterator<Item = [VertexId; 4]> {
    let square = |(x, y)| [id(x, y), id(x + 1, y), id(x + 1, y + 1), id(x, y + 1)].map(VertexId::from_raw);
    (0..N * N).map(|i| (i % N, i / N)).map(square)
}

/// A sheet that is bent by so much, of triangles; marked along the column `wall`.
fn sheet(bend: f64, wall: Option<u32>) -> Surface {
    let at = |x: f64, y: f64| dvec3(x, y, bend * libm::sin(0.3 * x) * libm::cos(0.2 * y));
    let points: Vec<DVec3> = (0..=N).flat_map(|y| (0..=N).map(move |x| at(f64::from(x), f64::from(y)))).collect();
    let faces: Vec<_> = squares().flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    let mut surface = Surface { points: points.into(), faces: faces.into(), ..Surface::default() };
    for (x, y) in wall.into_iter().flat_map(|x| (0..N).map(move |y| (x, y))) {
        let [a, b] = [id(x, y), id(x, y + 1)].map(VertexId::from_raw);
        surface.carried.mark(edge_key(a, b), EdgeMark { freedom: Freedom::OnCurve, cause: MarkCause::Feature });
    }
    surface
}

/// The squares of the sheet as quads over its ground.
fn quads(ground: &Ground<'_>) -> Mixed {
    let faces: Vec<_> = squares().map(Facet::Quad).collect();
    let soup = Soup { points: ground.surface.points.clone(), faces: faces.into(), ..Soup::default() };
    // Of the two triangles of a square the first tells the region.
    let regions = (0..(N * N) as usize).map(|i| ground.regions[2 * i]).collect();
    let mesh = ground.workshop().unwrap();
    let arc = |a: VertexId, b: VertexId| mesh.find(a.raw(), b.raw()).map_or(NONE, |h| mesh.arc(h));
    let mut quads = Mixed::new(&soup, ground.places.clone(), regions, arc).unwrap();
    for v in 0..quads.vertex_slots() {
        quads.set_point(v, quads.point(v), DVec3::Z);
        quads.set_size(v, 1.0);
    }
    quads
}

/// Turns the edge between two vertices, if there is one between quads of one region.
fn turn(mesh: &mut Mixed, [a, b]: [u32; 2], left: bool) {
    let Some(h) = mesh.find(a, b).filter(|&h| mesh.arc(h) == NONE) else { return };
    let faces = [mesh.face(h), mesh.face(h ^ 1)];
    if faces.contains(&NONE) || !mesh.place(a).is_free() || !mesh.place(b).is_free() {
        return;
    }
    let corner = |k: u32| mesh.origin(k);
    let [c, d] = [mesh.target(mesh.next(h)), corner(mesh.prev(h))];
    let [e, f] = [mesh.target(mesh.next(h ^ 1)), corner(mesh.prev(h ^ 1))];
    let new = if left { [[e, f, b, c], [c, d, a, e]] } else { [[f, b, c, d], [d, a, e, f]] };
    mesh.begin();
    let made = mesh.replace(&faces, &new.map(|corners| corners.into_iter().collect()), None);
    if made.is_some() && [a, b, c, d, e, f].iter().all(|&v| mesh.is_proper(v, 3)) {
        mesh.commit();
    } else {
        mesh.rollback();
    }
}

/// Fills cavities and nothing else.
fn fill(mesh: &mut Mixed, ground: &Ground<'_>, tolerance: f64) -> usize {
    let awake = vec![true; ground.region_count()];
    let mut cleaner = Cleaner::new(mesh, ground, 0.1, &awake);
    cleaner.tolerance = tolerance;
    let (mut all, mut refused) = (0, cavity::Refused::default());
    loop {
        let filled = cleaner.fill_cavities(&mut refused, &Watch::silent()).unwrap();
        if filled == 0 {
            return all;
        }
        all += filled;
    }
}

/// How far middles of faces and edges are from the surface.
fn farthest(mesh: &mut Mixed, ground: &Ground<'_>) -> f64 {
    let all: Vec<u32> = mesh.vertices().collect();
    Cleaner::new(mesh, ground, 0.1, &[true, true]).farthest(&all)
}

/// How far valences are from their ideals.
fn misfits(mesh: &mut Mixed, ground: &Ground<'_>) -> f64 {
    let all: Vec<u32> = mesh.vertices().collect();
    Cleaner::new(mesh, ground, 0.1, &[true, true]).misfits(&all)
}

fn irregular(mesh: &Mixed) -> usize {
    census(mesh).irregular
}

#[test]
fn a_vertex_of_very_many_edges_costs_nothing() {
    let n: u32 = 8000;
    let round = |i: u32| f64::from(i) * std::f64::consts::TAU / f64::from(n);
    let rim = (0..n).map(|i| dvec3(libm::cos(round(i)), libm::sin(round(i)), 0.0));
    let points: Vec<DVec3> = std::iter::once(DVec3::ZERO).chain(rim).collect();
    let corner = |i: u32| VertexId::from_raw(1 + i % n);
    let faces: Vec<_> = (0..n).map(|i| [VertexId::from_raw(0), corner(i), corner(i + 1)]).collect();
    let surface = Surface { points: points.into(), faces: faces.into(), ..Surface::default() };
    let ground = Ground::new(&surface);
    let quad = |i: u32| Facet::Quad([VertexId::from_raw(0), corner(2 * i), corner(2 * i + 1), corner(2 * i + 2)]);
    let faces: Vec<_> = (0..n / 2).map(quad).collect();
    let soup = Soup { points: surface.points.clone(), faces: faces.into(), ..Soup::default() };
    let regions = (0..n as usize / 2).map(|i| ground.regions[2 * i]).collect();
    let triangles = ground.workshop().unwrap();
    let arc = |a: VertexId, b: VertexId| triangles.find(a.raw(), b.raw()).map_or(NONE, |h| triangles.arc(h));
    let mut mesh = Mixed::new(&soup, ground.places.clone(), regions, arc).unwrap();
    let awake = vec![true; ground.region_count()];
    let mut cleaner = Cleaner::new(&mut mesh, &ground, 0.1, &awake);
    assert!((0..9).all(|v| !cleaner.best_edit(v)), "pairs of its edges alone are 16 million");
}

#[test]
fn irregular_vertices_that_lie_apart_cancel_out() {
    let surface = sheet(0.0, None);
    let ground = Ground::new(&surface);
    let mut mesh = quads(&ground);
    for ([x, y], left) in [([3, 3], true), ([8, 4], false), ([5, 9], true)] {
        turn(&mut mesh, [id(x, y), id(x + 1, y)], left);
    }
    assert_eq!(irregular(&mesh), 12);
    assert!(fill(&mut mesh, &ground, 1.0) > 0);
    assert_eq!((irregular(&mesh), mesh.census()), (0, (0, (N * N) as usize)));
    assert_eq!(mesh.faults(), [] as [String; 0]);
    let least = mesh.faces().map(|f| mesh.quality(f)).fold(1.0, f64::min);
    assert!(least > 0.9, "{least}");
}

#[test]
fn no_cavity_crosses_a_curve() {
    let surface = sheet(0.0, Some(6));
    let ground = Ground::new(&surface);
    assert_eq!(ground.region_count(), 2);
    let mut mesh = quads(&ground);
    for x in [3, 8] {
        turn(&mut mesh, [id(x, 5), id(x + 1, 5)], true);
    }
    fill(&mut mesh, &ground, 1.0);
    assert_eq!(irregular(&mesh), 0);
    let on_wall = mesh.edges().filter(|&h| mesh.arc(h) != NONE && mesh.point(mesh.origin(h)).x == 6.0);
    assert_eq!(on_wall.filter(|&h| mesh.point(mesh.target(h)).x == 6.0).count(), N as usize);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn cavities_keep_the_rim_the_curves_and_the_shapes(
        turns in prop::collection::vec((1..N - 1, 1..N, any::<bool>(), any::<bool>()), 1..14),
        bend in 0.0..1.0,
        tolerance in 0.0..0.2,
        wall in prop::option::of(3..N - 3),
    ) {
        let surface = sheet(bend, wall);
        let ground = Ground::new(&surface);
        let mut mesh = quads(&ground);
        for &(x, y, upright, left) in &turns {
            turn(&mut mesh, if upright { [id(y, x), id(y, x + 1)] } else { [id(x, y), id(x + 1, y)] }, left);
        }
        // Nodes stay, other vertices of curves may slide along them.
        let nodes = |mesh: &Mixed| -> Vec<_> {
            let all = mesh.vertices().filter(|&v| mesh.place(v) == Place::Node);
            all.map(|v| mesh.point(v).to_array().map(f64::to_bits)).collect()
        };
        let sliding = |mesh: &Mixed| mesh.vertices().filter(|&v| matches!(mesh.place(v), Place::Arc { .. })).count();
        let curves = |mesh: &Mixed| mesh.edges().filter(|&h| mesh.arc(h) != NONE).count();
        let least = |mesh: &Mixed| mesh.faces().map(|f| mesh.quality(f)).fold(1.0, f64::min);
        let euler = |mesh: &Mixed| mesh.vertices().count() + mesh.faces().count() - mesh.edges().count();
        let before = (nodes(&mesh), sliding(&mesh), curves(&mesh), euler(&mesh));
        let (poor, odd, far) = (least(&mesh), misfits(&mut mesh, &ground), farthest(&mut mesh, &ground));
        let filled = fill(&mut mesh, &ground, tolerance);
        prop_assert_eq!(mesh.faults(), [] as [String; 0]);
        prop_assert_eq!((nodes(&mesh), sliding(&mesh), curves(&mesh), euler(&mesh)), before);
        prop_assert_eq!(mesh.census().0, 0);
        prop_assert!(least(&mesh) >= poor.min(POOR) - 1e-12);
        prop_assert!(farthest(&mut mesh, &ground) <= far.max(tolerance));
        prop_assert!(misfits(&mut mesh, &ground) < odd || filled == 0);
    }
}

/// The area of a flat mesh, faces turned over counted as negative.
fn area(mesh: &Mixed) -> f64 {
    let of = |f: u32| {
        let p: Vec<DVec3> = mesh.corners(f).iter().map(|&v| mesh.point(v)).collect();
        0.5 * (p[2] - p[0]).cross(p[3] - p[1]).z
    };
    mesh.faces().map(of).sum()
}

/// A sheet with a wall, and a ring put about the faces at these vertices.
fn pillowed(surface: &Surface, around: &[u32]) -> Option<(Mixed, usize)> {
    let ground = Ground::new(surface);
    let mut mesh = quads(&ground);
    let faces = mesh.faces_around(around);
    mesh.begin();
    pillow(&mut mesh, &ground, 0.1, &faces)?;
    mesh.commit();
    Some((mesh, faces.len()))
}

#[test]
fn a_ring_about_faces_adds_one_for_each_edge_of_their_rim() {
    let surface = sheet(0.0, None);
    for (around, rim) in [(vec![id(5, 5)], 8), (vec![id(5, 5), id(6, 5)], 10), (vec![id(1, 0)], 6), (vec![id(0, 0)], 4)]
    {
        let (mesh, inside) = pillowed(&surface, &around).unwrap();
        assert_eq!(mesh.faults(), [] as [String; 0]);
        assert_eq!(mesh.census(), (0, (N * N) as usize + rim), "{inside} faces inside");
        assert!(mesh.faces().all(|f| mesh.quality(f) > 0.3));
        assert!((area(&mesh) - f64::from(N * N)).abs() < 1e-9);
    }
}

#[test]
fn a_ring_across_a_curve_gives_it_a_vertex_at_each_crossing() {
    let surface = sheet(0.0, Some(6));
    // Round a vertex of the wall, beside it, round an edge on it, and at its end on the rim.
    for (around, more) in [([6, 5], 2), ([5, 5], 0), ([6, 1], 2), ([6, 0], 2)] {
        let (mesh, _) = pillowed(&surface, &[id(around[0], around[1])]).unwrap();
        assert_eq!(mesh.faults(), [] as [String; 0]);
        assert!((area(&mesh) - f64::from(N * N)).abs() < 1e-9);
        let wall: Vec<u32> =
            mesh.edges().filter(|&h| mesh.arc(h) != NONE && mesh.face(h) != NONE && mesh.face(h ^ 1) != NONE).collect();
        assert_eq!(wall.len(), N as usize + more, "{around:?}");
        assert!(wall.iter().all(|&h| mesh.point(mesh.origin(h)).x == 6.0 && mesh.point(mesh.target(h)).x == 6.0));
        let length: f64 = wall.iter().map(|&h| mesh.length(h)).sum();
        assert!((length - f64::from(N)).abs() < 1e-9, "the wall is covered once");
        for h in wall {
            let [left, right] = [h, h ^ 1].map(|k| mesh.region(mesh.face(k)));
            assert_ne!(left, right, "regions meet on the wall");
        }
    }
}

#[test]
fn there_is_no_ring_about_what_is_no_disk() {
    let surface = sheet(0.0, None);
    assert!(pillowed(&surface, &[id(2, 2), id(8, 8)]).is_none(), "two pieces");
    let ground = Ground::new(&surface);
    let mut mesh = quads(&ground);
    let all = mesh.faces_around(&[id(4, 4), id(6, 4), id(4, 6), id(6, 6)]);
    let hole = mesh.faces_around(&[id(5, 5)]);
    let ring: Vec<u32> = all.into_iter().filter(|f| !hole.contains(f)).collect();
    mesh.begin();
    assert!(pillow(&mut mesh, &ground, 0.1, &ring).is_none(), "a ring");
    mesh.rollback();
    assert_eq!(mesh.census(), (0, (N * N) as usize));
    assert_eq!(mesh.faults(), [] as [String; 0]);
}

#[test]
fn two_quads_round_the_end_of_a_curve_are_to_be_more() {
    // A fan of two quads about the end of one curve, which have both their edges there in common.
    let at = |x: f64, y: f64| dvec3(x, y, 0.0);
    let points = [at(0.0, 0.0), at(1.0, 0.2), at(1.0, -0.2), at(2.0, 1.0), at(2.0, -1.0)];
    let mut mesh = Mixed::of_faces(&points, &[&[0, 2, 4, 1], &[0, 1, 3, 2]]).unwrap();
    let surface = Surface::default();
    let ground = Ground::new(&surface);
    mesh.set_place(0, Place::Node);
    let h = mesh.find(0, 1).unwrap();
    mesh.set_arc(h, 0);
    let cleaner = Cleaner::new(&mut mesh, &ground, 0.1, &[true]);
    assert!(cleaner.misfit(0) > 20.0, "{}", cleaner.misfit(0));
}
