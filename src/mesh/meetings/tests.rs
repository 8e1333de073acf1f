//! The pairs are those of all pairs, and there is little work where many triangles meet at one place.

use std::ops::ControlFlow;

use glam::{DVec3, dvec3};

use super::finder::Finder;
use super::*;
use crate::mesh::bvh::Triangle;
use crate::mesh::predicate::triangle_triangle;

fn all_pairs(triangles: &[Triangle]) -> Vec<(u32, u32, Meeting)> {
    let mut pairs = Vec::new();
    for j in 0..triangles.len() {
        for i in 0..j {
            let meeting = triangle_triangle(triangles[i], triangles[j]);
            if meeting.is_intersection() {
                pairs.push((i as u32, j as u32, meeting));
            }
        }
    }
    pairs.sort_unstable();
    pairs
}

fn found(triangles: &[Triangle]) -> Meetings {
    meetings(triangles, triangle_triangle, &Watch::silent()).expect("nobody interrupts")
}

/// How many candidates are looked at.
fn candidates(triangles: &[Triangle]) -> usize {
    let finder = Finder::new(triangles);
    let mut count = 0;
    for i in 0..finder.len() as u32 {
        let own = triangles[finder.original(i) as usize];
        let _ = finder.for_each_near(i, own.bounds(), &mut |_| {
            count += 1;
            ControlFlow::Continue(())
        });
    }
    count
}

fn around(i: usize, count: usize) -> DVec3 {
    let angle = std::f64::consts::TAU * (i % count) as f64 / count as f64;
    dvec3(libm::cos(angle), libm::sin(angle), 0.0)
}

/// Sheets that hang together at one edge.
fn at_edge(count: usize) -> Vec<Triangle> {
    (0..count).map(|i| [DVec3::ZERO, DVec3::Z, around(i, count) + 0.5 * DVec3::Z]).collect()
}

/// Upright triangles that have one corner in common.
fn at_corner(count: usize) -> Vec<Triangle> {
    (0..count).map(|i| [DVec3::ZERO, around(i, count), around(i, count) + 0.3 * DVec3::Z]).collect()
}

/// A flat disc.
fn disc(count: usize) -> Vec<Triangle> {
    (0..count).map(|i| [DVec3::ZERO, around(i, count), around(i + 1, count)]).collect()
}

/// Numbers from 0 to 1 that look random.
fn noise(seed: usize) -> f64 {
    let mixed = (seed as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    ((mixed ^ (mixed >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9) >> 40) as f64 / (1 << 24) as f64
}

#[test]
fn the_pairs_are_those_of_all_pairs() {
    // Triangles between few points: many at each corner and edge, many the same, many through each other.
    let point = |seed: usize| dvec3(noise(seed), noise(seed + 1000), noise(seed + 2000));
    for points in [9, 14, 40] {
        let corner = |i: usize| point((noise(3 * i + points) * points as f64) as usize);
        let triangles: Vec<Triangle> =
            (0..400).map(|i| [corner(3 * i), corner(3 * i + 1), corner(3 * i + 2)]).collect();
        let found = found(&triangles);
        assert!(found.complete && !found.pairs.is_empty());
        assert_eq!(found.pairs, all_pairs(&triangles));
    }
}

#[test]
fn what_lies_on_each_other_at_a_corner_or_an_edge_is_found() {
    for mut triangles in [at_edge(200), at_corner(200), disc(200)] {
        let [a, b, c] = triangles[7];
        // One over its half, one that stands on it, one across the others.
        triangles.push([a, b, 0.5 * (b + c)]);
        triangles.push([a, 0.5 * (b + c), c + DVec3::Z]);
        triangles.push([a, around(3, 200) + 0.2 * DVec3::Z, around(90, 200) - 0.1 * DVec3::Z]);
        triangles.push([b, a, 0.5 * (a + c)]);
        assert_eq!(found(&triangles).pairs, all_pairs(&triangles));
    }
}

#[test]
fn many_triangles_at_one_place_cost_little() {
    let count = 20_000;
    let same = vec![[DVec3::ZERO, DVec3::X, DVec3::Y]; count];
    // Boxes do not fit arcs across all directions closely: a hundredth of all pairs is left of those.
    for (triangles, most) in [
        (at_edge(count), 64 * count),
        (disc(count), 64 * count),
        (same, 64 * count),
        (at_corner(count), count * count / 100),
    ] {
        assert!(candidates(&triangles) < most, "{}", candidates(&triangles));
        let found = found(&triangles);
        assert!(found.pairs.is_empty() && found.complete);
    }
}

#[test]
fn looking_stops_where_the_answer_is_quadratic() {
    let at = |i: usize| DVec3::X * (i as f64 / 1e5);
    let over: Vec<Triangle> = (0..8000).map(|i| [DVec3::ZERO, DVec3::X, DVec3::Y].map(|p| p + at(i))).collect();
    let many = found(&over);
    assert!(!many.complete && many.pairs.len() == MOST);
    assert_eq!(many, found(&over));
    // None of these meet, but only the exact test can tell.
    let stacked: Vec<Triangle> = (0..8000)
        .map(|i| [DVec3::ZERO, dvec3(1.0, 0.0, 1.0), dvec3(0.0, 1.0, 1.0)].map(|p| p + DVec3::Z * (i as f64 / 1e5)))
        .collect();
    assert_eq!(found(&stacked), Meetings::default());
}
