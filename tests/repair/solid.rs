//! Faces that run through each other are cut, and what is inside of bodies goes.

use glam::DMat3;
use meshmill::mesh::Regions;
use meshmill::metric::intersection::self_intersections;
use meshmill::steps::repair::{Bodies, SelfIntersections, repair_and_remove};

use proptest::prelude::*;

use super::*;

fn removing(bodies: Bodies) -> RepairParams {
    RepairParams { self_intersections: SelfIntersections::Remove, bodies, ..RepairParams::default() }
}

/// Repairs, and checks that no two faces of the result meet.
fn solid(soup: &Soup) -> (Surface, RepairStats) {
    let (surface, stats) = run_with(soup, &removing(Bodies::Union));
    let pairs = self_intersections(&surface.to_soup(), &Watch::silent()).expect("nobody interrupts").pairs;
    assert_eq!((pairs.len(), stats.self_intersections), (0, 0));
    let certificate = stats.certificate.as_ref().expect("asked for");
    assert_eq!((certificate.crossing_pairs, certificate.contacts, certificate.farthest), (0, 0, stats.max_move));
    let (characteristic, border) = euler(&surface);
    assert_eq!((certificate.euler_characteristic, certificate.closed), (characteristic, border == 0));
    if let Some(enclosed) = certificate.volume {
        assert!((enclosed - volume(&surface)).abs() <= 1e-9 * enclosed.abs());
    }
    (surface, stats)
}

#[test]
fn bodies_that_run_through_each_other_become_one() {
    let soup = merged(cube([0.0; 3]), &cube([0.5, 0.4, 0.3]));
    let (surface, stats) = solid(&soup);
    assert_eq!(euler(&surface), (2, 0));
    assert!((volume(&surface) - (2.0 - 0.5 * 0.6 * 0.7)).abs() < 1e-8, "{}", volume(&surface));
    let removal = stats.removal.expect("something was removed");
    assert!(removal.pairs == stats.self_intersections_before && removal.pairs > 0, "{removal:?}");
    assert!(removal.rounds == 1 && removal.pairs_left == 0 && removal.stopped.is_none(), "{removal:?}");
    // Three sides of each cube have a part in the other one: 0.3, 0.35 and 0.42.
    assert!((removal.area_removed - 2.0 * (0.3 + 0.35 + 0.42)).abs() < 1e-8, "{removal:?}");
    let removed = repair_and_remove(&soup, &removing(Bodies::Union), &Watch::silent()).expect("repairs").1;
    assert_eq!(removed.faces.len() as u64, removal.pieces_removed);
}

/// Repairs to bodies apart, and returns their volumes in the order of their faces: each closed, none crossing another.
fn apart(soup: &Soup) -> (Vec<f64>, RepairStats) {
    let (surface, stats) = run_with(soup, &removing(Bodies::Keep));
    let found = self_intersections(&surface.to_soup(), &Watch::silent()).expect("nobody interrupts");
    assert_eq!((found.crossing().count(), euler(&surface).1), (0, 0));
    let parts = meshmill::mesh::topology::components(&surface);
    let mut volumes = vec![0.0; parts.count];
    for (f, &part) in parts.of_face.enumerate() {
        let [a, b, c] = surface.corners(f);
        volumes[part as usize] += a.dot(b.cross(c)) / 6.0;
    }
    (volumes, stats)
}

fn are_near(found: &[f64], expected: &[f64]) {
    let is_near = found.len() == expected.len() && found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-7);
    assert!(is_near, "{found:?} is not {expected:?}");
}

#[test]
fn bodies_that_are_kept_have_the_common_part_once() {
    let common = 0.5 * 0.6 * 0.7;
    let (volumes, stats) = apart(&merged(cube([0.0; 3]), &cube([0.5, 0.4, 0.3])));
    are_near(&volumes, &[1.0, 1.0 - common]);
    assert!(stats.removal.is_some_and(|removal| removal.rounds > 0 && removal.pairs_left == 0));
    // The one that comes first in the file keeps it.
    let mut small = cube([0.5, 0.4, 0.3]);
    small.points.iter_mut().for_each(|p| *p = DVec3::splat(0.5) + 0.5 * *p);
    let overlap = (1.0 - 0.75) * (1.0 - 0.7) * (1.0 - 0.65);
    are_near(&apart(&merged(small.clone(), &cube([0.0; 3]))).0, &[0.125, 1.0 - overlap]);
    are_near(&apart(&merged(cube([0.0; 3]), &small)).0, &[1.0, 0.125 - overlap]);
    // Three in a row, the middle one last.
    let row = merged(merged(cube([0.0; 3]), &cube([1.5, 0.0, 0.0])), &cube([0.75, 0.1, 0.2]));
    are_near(&apart(&row).0, &[1.0, 1.0, 1.0 - 2.0 * 0.25 * 0.9 * 0.8]);
}

#[test]
fn bodies_that_are_kept_may_touch() {
    // By a whole face, whose triangles are the same or not, by a part of it, by an edge and by a corner.
    for at in [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.25, 0.5], [1.0, 1.0, 0.0], [1.0, 1.0, 0.5], [1.0, 1.0, 1.0]] {
        let (volumes, stats) = apart(&merged(cube([0.0; 3]), &cube(at)));
        are_near(&volumes, &[1.0, 1.0]);
        assert!(stats.removal.is_none(), "{at:?}");
    }
    // Flush, so that they overlap without a face through another one.
    are_near(&apart(&merged(cube([0.0; 3]), &cube([0.5, 0.0, 0.0]))).0, &[1.0, 0.5]);
    // A copy has nothing that is not of the first one.
    are_near(&apart(&merged(cube([0.0; 3]), &cube([1e-3, 0.0, 0.0]))).0, &[1.0, 1e-3]);
}

#[test]
fn a_cavity_is_of_the_body_round_it() {
    let mut inner = cube([0.0; 3]);
    inner.points.iter_mut().for_each(|p| *p = DVec3::splat(0.25) + 0.5 * *p);
    // Reaches through the wall into the cavity.
    let mut bar = cube([0.0; 3]);
    bar.points.iter_mut().for_each(|p| *p = DVec3::new(0.5, 0.45, 0.45) + *p * DVec3::new(1.0, 0.1, 0.1));
    let soup = merged(merged(cube([0.0; 3]), &inner), &bar);
    let (volumes, _) = apart(&soup);
    let total: f64 = volumes.iter().sum();
    assert!((total - (1.0 - 0.125 + 0.01 - 0.25 * 0.01)).abs() < 1e-7, "{volumes:?}");
}

/// A sphere of which one vertex is pulled through the other side.
fn pierced() -> Soup {
    let mut soup = sphere(16, 0, 16);
    let top = soup.points.iter().map(|p| p.z).fold(0.0, f64::max);
    soup.points.iter_mut().filter(|p| p.z == top).for_each(|p| *p = DVec3::new(0.1, 0.2, -1.5));
    soup
}

#[test]
fn a_body_that_runs_through_itself_is_cut_and_another_one_beside_it_is_not() {
    let soup = merged(pierced(), &cube([0.2, 0.2, -0.2]));
    let (surface, stats) = run_with(&soup, &removing(Bodies::Keep));
    // What is left meets the other body only.
    let left = self_intersections(&surface.to_soup(), &Watch::silent()).expect("nobody interrupts").pairs;
    assert!(stats.removal.is_some_and(|removal| removal.rounds > 0 && removal.pieces_removed > 0));
    // The cube is the last body.
    let is_cube = |f: meshmill::mesh::FaceId| f.index() + 12 >= surface.faces.len();
    assert!(left.iter().all(|&(f, g, _)| is_cube(f) != is_cube(g)), "{left:?}");
    let (alone, _) = solid(&pierced());
    assert_eq!(euler(&alone).1, 0);
    let (united, _) = solid(&soup);
    assert!(volume(&united) > volume(&alone));
}

#[test]
fn bodies_that_touch_are_valid_in_any_way() {
    // By a face in part, an edge, a part of it, a corner, an edge on a face.
    for at in [[1.0, 0.25, 0.5], [1.0, 1.0, 0.0], [1.0, 1.0, 0.5], [1.0, 1.0, 1.0], [1.0, 1.0, 0.25]] {
        let (surface, _) = solid(&merged(cube([0.0; 3]), &cube(at)));
        assert_eq!(euler(&surface).1, 0);
        assert!((volume(&surface) - 2.0).abs() < 1e-8, "{at:?}: {}", volume(&surface));
    }
    let (joined, _) = solid(&merged(cube([0.0; 3]), &cube([1.0, 0.25, 0.5])));
    assert_eq!(euler(&joined).0, 2);
    let (apart, _) = solid(&merged(cube([0.0; 3]), &cube([1.0, 1.0, 0.0])));
    assert_eq!(euler(&apart).0, 4);
}

#[test]
fn a_body_inside_of_another_stays() {
    let mut inner = cube([0.4, 0.4, 0.4]);
    inner.points.iter_mut().for_each(|p| *p = DVec3::splat(0.3) + 0.2 * (*p - DVec3::splat(0.4)));
    let soup = merged(merged(cube([0.0; 3]), &inner), &cube([0.75, 0.0, 0.0]));
    let (surface, stats) = solid(&soup);
    assert_eq!((euler(&surface), stats.cavities), ((4, 0), 1));
    assert!((volume(&surface) - (1.75 - 0.008)).abs() < 1e-8);
}

#[test]
fn sheets_are_cut_along_where_they_meet_and_stay() {
    let square = |at: [[f64; 3]; 4]| soup(&at, &[[0, 1, 2], [0, 2, 3]]);
    let flat = square([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]]);
    let upright = square([[-0.5, 0.1, -1.0], [0.5, 0.2, -1.0], [0.5, 0.2, 1.0], [-0.5, 0.1, 1.0]]);
    let (surface, _) = solid(&merged(flat, &upright));
    let area: f64 = surface.faces.ids().map(|f| meshmill::mesh::geometry::triangle_area(surface.corners(f))).sum();
    assert!((area - (4.0 + 2.0 * 1.01_f64.sqrt())).abs() < 1e-8, "{area}");
}

#[test]
fn what_faces_carry_goes_along() {
    let mut soup = merged(cube([0.0; 3]), &cube([0.5, 0.4, 0.3]));
    let second = || (12..24).map(meshmill::mesh::FaceId::new);
    soup.carried.groups.faces.insert("second".to_owned(), second().collect());
    let labels = (0..24).map(|f| u32::from(f >= 12)).collect::<Vec<_>>().into();
    soup.carried.regions = Some(Regions { labels, names: vec!["a".to_owned(), "b".to_owned()] });
    let (surface, _) = solid(&soup);
    let group = &surface.carried.groups.faces["second"];
    let regions = surface.carried.regions.as_ref().expect("regions");
    let mut area = 0.0;
    for f in surface.faces.ids() {
        assert_eq!(regions.labels[f] == 1, group.binary_search(&f).is_ok());
        if regions.labels[f] == 1 {
            area += meshmill::mesh::geometry::triangle_area(surface.corners(f));
        }
    }
    assert!((area - (6.0 - (0.3 + 0.35 + 0.42))).abs() < 1e-8, "{area}");
}

#[test]
fn where_nothing_meets_nothing_changes() {
    for soup in [cube([0.1; 3]), sphere(16, 0, 16), sphere(16, 2, 16), merged(cube([0.0; 3]), &cube([3.0, 0.0, 0.0]))] {
        let (reported, stats) = run(&soup);
        let (removed, mut other) = run_with(&soup, &removing(Bodies::Union));
        let certificate = other.certificate.take().expect("asked for");
        assert_eq!((reported, stats), (removed, other));
        assert_eq!(certificate.crossing_pairs + certificate.contacts, 0);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    /// Boxes turned alike, which have planes, edges and corners in common, or nearly so.
    #[test]
    fn boxes_that_hardly_differ_from_touching_are_valid(
        axis in [-1.0_f64..1.0, -1.0..1.0, -1.0..1.0],
        angle in 0.0_f64..6.0,
        steps in [0_usize..5, 0..5, 0..5],
        tiny in prop::sample::select(vec![0.0, 1e-12, -1e-12, 1e-9, -1e-9, 1e-7]),
        bodies in prop::sample::select(vec![Bodies::Union, Bodies::Keep]),
    ) {
        prop_assume!(DVec3::from_array(axis).length() > 0.1);
        let turn = DMat3::from_axis_angle(DVec3::from_array(axis).normalize(), angle);
        let offset = steps.map(|step| [0.0, 0.25, 0.5, 1.0, 1.0 + tiny][step]);
        prop_assume!(offset != [0.0; 3]);
        let mut soup = merged(cube([0.0; 3]), &cube(offset));
        soup.points.iter_mut().for_each(|p| *p = turn * *p);
        let (surface, stats) = repair(&soup, &removing(bodies), &Watch::silent()).expect("repairs");
        check_manifold(&surface);
        let found = self_intersections(&surface.to_soup(), &Watch::silent()).expect("nobody interrupts");
        prop_assert_eq!((found.crossing().count(), euler(&surface).1), (0, 0));
        if bodies == Bodies::Union {
            prop_assert_eq!(found.contacts(), 0);
        }
        let common: f64 = offset.iter().map(|x| (1.0 - x).max(0.0)).product();
        let expected = 2.0 - common;
        prop_assert!((volume(&surface) - expected).abs() < 1e-6, "{} is not {}", volume(&surface), expected);
        prop_assert!(stats.certificate.is_some_and(|certificate| certificate.closed));
    }
}

#[test]
fn any_number_of_threads_gives_the_same() {
    let soup = merged(merged(pierced(), &cube([0.2, 0.2, -0.2])), &sphere(16, 0, 16));
    for bodies in [Bodies::Union, Bodies::Keep] {
        let made = [1, 3].map(|threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
            pool.install(|| repair_and_remove(&soup, &removing(bodies), &Watch::silent()).expect("repairs"))
        });
        assert_eq!(made[0], made[1]);
    }
}
