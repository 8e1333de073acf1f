//! Known answers of the partition, its counts and its cuts.

use super::dual::euler_characteristic;
use super::*;
use crate::mesh::halfedge::tests::surface as mesh;

/// The unit cube, each side of `n` by `n` squares, without marks.
fn cube(n: usize) -> Surface {
    let mut points: Vec<[f64; 3]> = Vec::new();
    let mut faces = Vec::new();
    let mut id = |p: [f64; 3]| {
        let found = points.iter().position(|q| *q == p);
        found.unwrap_or_else(|| {
            points.push(p);
            points.len() - 1
        }) as u32
    };
    for axis in 0..3 {
        for end in [0.0, 1.0] {
            for (i, j) in (0..n * n).map(|k| (k % n, k / n)) {
                let mut at = |i: usize, j: usize| {
                    let mut p = [end; 3];
                    (p[(axis + 1) % 3], p[(axis + 2) % 3]) = (i as f64 / n as f64, j as f64 / n as f64);
                    id(p)
                };
                let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
                let two = if end == 1.0 { [[a, b, c], [a, c, d]] } else { [[a, c, b], [a, d, c]] };
                faces.extend(two);
            }
        }
    }
    mesh(&points, &faces)
}

fn rules(wanted: Wanted) -> Rules {
    Rules { metric: Metric::L21, wanted, barriers: true, iterations: 20, disk: false, seed: 0 }
}

fn made(surface: &Surface, rules: &Rules) -> Partition {
    partition(surface, rules, &Watch::silent()).unwrap()
}

#[test]
fn six_regions_of_a_cube_have_no_error_from_any_seed() {
    let cube = cube(4);
    for seed in 0..10 {
        for metric in [Metric::L21, Metric::L2] {
            let found = made(&cube, &Rules { metric, seed, ..rules(Wanted::Regions(6)) });
            assert_eq!(found.proxies.len(), 6, "{metric:?} {seed}");
            assert!(found.report.error < 1e-12, "{metric:?} {seed}: {}", found.report.error);
        }
    }
}

#[test]
fn sixty_degrees_do_not_see_the_edges_of_a_cube() {
    let found = made(&cube(4), &rules(Wanted::Angle(std::f64::consts::FRAC_PI_3)));
    assert!(found.proxies.len() < 6 && found.report.worst_angle <= 60.0);
    // The normals of two sides lie 45 degrees from their mean, those of three at a corner 54.7.
    let found = made(&cube(4), &rules(Wanted::Angle(44.0_f64.to_radians())));
    assert_eq!(found.proxies.len(), 6);
}

#[test]
fn counts_tell_disks_rings_and_pinches() {
    let cube = cube(3);
    let side: Vec<u32> = (0..18).collect();
    assert_eq!(euler_characteristic(&cube, &side), 1);
    let ring: Vec<u32> = (0..18).filter(|f| f / 2 != 4).collect();
    assert_eq!(euler_characteristic(&cube, &ring), 0);
    let all: Vec<u32> = (0..cube.faces.len() as u32).collect();
    assert_eq!(euler_characteristic(&cube, &all), 2);
}

#[test]
fn a_ring_is_cut_into_two_disks() {
    let cube = cube(3);
    let edges = EdgeTable::new(&cube);
    let dual = Dual::new(&cube, &edges, false);
    let ring: Vec<u32> = (0..18).filter(|f| f / 2 != 4).collect();
    let parts = halve::Halver::new(&cube, &dual).halve(&ring).unwrap();
    for part in &parts {
        assert_eq!(euler_characteristic(&cube, part), 1, "{parts:?}");
    }
    assert_eq!(parts[0].len() + parts[1].len(), ring.len());
}

#[test]
fn a_closed_surface_has_at_least_two_regions() {
    let found = made(&cube(2), &rules(Wanted::Regions(1)));
    assert_eq!((found.proxies.len(), found.report.cuts), (2, 1));
}

#[test]
fn degenerate_faces_do_no_harm() {
    let points = [[0.0; 3], [1.0, 0.0, 0.0], [0.5, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 0.0]];
    let flat = mesh(&points, &[[0, 1, 3], [0, 2, 1], [0, 3, 4]]);
    for metric in [Metric::L21, Metric::L2] {
        for wanted in [Wanted::Regions(1), Wanted::Regions(3), Wanted::Regions(99), Wanted::Angle(0.0)] {
            let found = made(&flat, &Rules { metric, disk: true, ..rules(wanted) });
            assert!((1..=3).contains(&found.proxies.len()));
        }
    }
    let nothing = Surface::default();
    assert_eq!(made(&nothing, &rules(Wanted::Regions(5))).proxies.len(), 0);
}
