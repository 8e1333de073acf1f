//! Known answers of straightening: planes, folds, cones, saddles, neighbours, on both ways.

use std::f64::consts::TAU;

use glam::DVec3;

use super::flip::flip;
use super::network::fixed_vertices;
use super::unfold::{Leash, unfold};
use super::*;
use crate::mesh::halfedge::tests::surface as mesh;
use crate::mesh::{HalfedgeMesh, ResolvedFreedom, Surface, VertexId};
use crate::technique::arcs::Arc;
use crate::watch::Watch;

/// A sheet of `n` by `n` squares cut by diagonals, bent by `shape`.
fn sheet(n: u32, shape: impl Fn(f64, f64) -> [f64; 3]) -> Surface {
    let id = |i: u32, j: u32| i + j * (n + 1);
    let points: Vec<[f64; 3]> =
        (0..(n + 1) * (n + 1)).map(|k| shape(f64::from(k % (n + 1)), f64::from(k / (n + 1)))).collect();
    let faces: Vec<[u32; 3]> = (0..n * n)
        .map(|k| (k % n, k / n))
        .flat_map(|(i, j)| {
            let [a, b, c, d] = [id(i, j), id(i + 1, j), id(i + 1, j + 1), id(i, j + 1)];
            [[a, b, c], [a, c, d]]
        })
        .collect();
    mesh(&points, &faces)
}

fn arc(vertices: &[u32]) -> Arc {
    Arc { vertices: vertices.iter().map(|&v| VertexId::from_raw(v)).collect(), is_closed: false, sides: [0, 1] }
}

/// The lengths of the arcs straightened both ways.
fn lengths(surface: &Surface, arcs: &[Arc]) -> [f64; 2] {
    let mesh = HalfedgeMesh::new(surface, &ResolvedFreedom::free(surface)).unwrap();
    let is_fixed = fixed_vertices(&mesh, std::iter::empty(), arcs);
    let paths: Vec<Vec<DVec3>> =
        arcs.iter().map(|arc| arc.vertices.iter().map(|&v| surface.points[v]).collect()).collect();
    let leash = Leash::new(&paths, f64::INFINITY);
    let mut unfolded = Network::new(&mesh, &is_fixed);
    for arc in arcs {
        unfolded.add_arc(arc);
    }
    unfold(&mut unfolded, &leash, 500, &Watch::silent()).unwrap();
    let (flipped, _) = flip(&mesh, &is_fixed, arcs, &leash, &Watch::silent()).unwrap();
    [unfolded.length(), flipped.length()]
}

/// The zigzag from (1, 1) to (9, 6) of a sheet of 10 by 10.
fn stairs() -> Arc {
    let mut at = (1, 1);
    let mut vertices = vec![12];
    while at != (9, 6) {
        if at.0 < 9 && (at.1 == 6 || at.0 <= at.1 + 1) {
            at.0 += 1;
        } else {
            at.1 += 1;
        }
        vertices.push(at.0 + at.1 * 11);
    }
    arc(&vertices)
}

#[test]
fn in_a_plane_a_path_becomes_a_straight_line() {
    let plane = sheet(10, |x, y| [x, y, 0.0]);
    let straight = 89.0_f64.sqrt();
    for (way, length) in lengths(&plane, &[stairs()]).into_iter().enumerate() {
        assert!((length / straight - 1.0).abs() < 1e-4, "{way}: {length} is not {straight}");
    }
}

#[test]
fn over_a_fold_a_path_is_straight_when_unfolded() {
    let folded = sheet(10, |x, y| if x < 5.0 { [x, y, 0.0] } else { [5.0, y, 5.0 - x] });
    let straight = 89.0_f64.sqrt();
    for (way, length) in lengths(&folded, &[stairs()]).into_iter().enumerate() {
        assert!((length / straight - 1.0).abs() < 1e-4, "{way}: {length} is not {straight}");
    }
}

/// A fan of `n` faces round vertex 0, the rim at these heights in turn, and a second ring outside it.
fn fan(n: u32, heights: [f64; 2]) -> Surface {
    let ring = |radius: f64| {
        (0..n).map(move |k| {
            let turn = TAU * f64::from(k) / f64::from(n);
            [radius * libm::cos(turn), radius * libm::sin(turn), radius * heights[k as usize % 2]]
        })
    };
    let points: Vec<[f64; 3]> = [[0.0; 3]].into_iter().chain(ring(1.0)).chain(ring(2.0)).collect();
    let next = |k: u32| (k + 1) % n;
    let inner = (0..n).map(|k| [0, 1 + k, 1 + next(k)]);
    let outer = (0..n).flat_map(|k| [[1 + k, 1 + n + k, 1 + n + next(k)], [1 + k, 1 + n + next(k), 1 + next(k)]]);
    let faces: Vec<[u32; 3]> = inner.chain(outer).collect();
    mesh(&points, &faces)
}

#[test]
fn a_path_leaves_the_tip_of_a_cone_and_stays_on_a_saddle() {
    let cone = fan(12, [-1.5, -1.5]);
    let over = arc(&[13, 1, 0, 7, 19]);
    let before = 4.0 * 3.25_f64.sqrt();
    for (way, length) in lengths(&cone, std::slice::from_ref(&over)).into_iter().enumerate() {
        assert!(length < 0.99 * before, "{way}: {length} of {before}");
    }
    let saddle = fan(12, [-1.0, 1.0]);
    let before = 4.0 * 2.0_f64.sqrt();
    for (way, length) in lengths(&saddle, &[over]).into_iter().enumerate() {
        assert!((length / before - 1.0).abs() < 1e-12, "{way}: {length} of {before}");
    }
}

#[test]
fn arcs_keep_off_each_other() {
    // The lower arc would be a straight line of length 8 above the upper one, were that not in its way.
    let plane = sheet(10, |x, y| [x, y, 0.0]);
    let id = |x: u32, y: u32| x + 11 * y;
    let low = [(1, 5), (1, 4), (1, 3), (2, 3), (3, 3), (4, 3), (5, 3), (6, 3), (7, 3), (8, 3), (8, 4), (9, 5)];
    let low = arc(&low.map(|(x, y)| id(x, y)));
    let high = arc(&[3, 4, 5, 6, 7].map(|x| id(x, 4)));
    let least = 2.0 * 5.0_f64.sqrt() + 4.0;
    for (way, length) in lengths(&plane, &[low.clone(), high]).into_iter().enumerate() {
        assert!(length >= least + 4.0 && length < least + 4.8, "{way}: {length}");
    }
    let alone = lengths(&plane, &[low]);
    assert!(alone.into_iter().all(|length| (length - 8.0).abs() < 1e-3), "{alone:?}");
}

#[test]
fn a_leash_holds() {
    let plane = sheet(10, |x, y| [x, y, 0.0]);
    let id = |x: u32, y: u32| x + 11 * y;
    let down = [(5, 5), (5, 4), (6, 4), (6, 3), (7, 3), (7, 2), (8, 2), (8, 1), (9, 1)];
    let roof: Vec<u32> = (1..5).map(|k| id(k, k)).chain(down.map(|(x, y)| id(x, y))).collect();
    let roof = arc(&roof);
    let mesh = HalfedgeMesh::new(&plane, &ResolvedFreedom::free(&plane)).unwrap();
    let is_fixed = fixed_vertices(&mesh, std::iter::empty(), std::slice::from_ref(&roof));
    let path: Vec<DVec3> = roof.vertices.iter().map(|&v| plane.points[v]).collect();
    let leash = Leash::new(&[path], 1.0);
    let (flipped, report) = flip(&mesh, &is_fixed, std::slice::from_ref(&roof), &leash, &Watch::silent()).unwrap();
    assert!(report.rounds > 0);
    let mut unfolded = Network::new(&mesh, &is_fixed);
    unfolded.add_arc(&roof);
    unfold(&mut unfolded, &leash, 100, &Watch::silent()).unwrap();
    for network in [&flipped, &unfolded] {
        assert!(network.polylines()[0].iter().all(|&p| leash.distance(0, p) <= 1.0));
    }
}

#[test]
fn a_closed_arc_does_not_shrink_away() {
    // A flat grid, and a square loop on it: nothing but the leash and the holds keeps it.
    let plane = sheet(10, |x, y| [x, y, 0.0]);
    let id = |x: u32, y: u32| x + 11 * y;
    let loop_of = |r: std::ops::RangeInclusive<u32>| -> Vec<u32> {
        let (low, high) = (*r.start(), *r.end());
        let bottom = (low..high).map(|x| id(x, low));
        let right = (low..high).map(|y| id(high, y));
        let top = (low + 1..=high).rev().map(|x| id(x, high));
        let left = (low + 1..=high).rev().map(|y| id(low, y));
        bottom.chain(right).chain(top).chain(left).collect()
    };
    let ring = Arc { is_closed: true, ..arc(&loop_of(2..=8)) };
    let mesh = HalfedgeMesh::new(&plane, &ResolvedFreedom::free(&plane)).unwrap();
    let is_fixed = fixed_vertices(&mesh, std::iter::empty(), std::slice::from_ref(&ring));
    let mut path: Vec<DVec3> = ring.vertices.iter().map(|&v| plane.points[v]).collect();
    path.push(path[0]);
    let leash = Leash::new(&[path], 1.5);
    let (mut network, _) = flip(&mesh, &is_fixed, std::slice::from_ref(&ring), &leash, &Watch::silent()).unwrap();
    unfold(&mut network, &leash, 50, &Watch::silent()).unwrap();
    assert!(network.length() > 8.0 && network.length() < 24.0, "{}", network.length());
}
