//! Queries of the tree against a search through all triangles, and the ties.

use std::ops::ControlFlow;

use glam::{DVec3, dvec3};
use proptest::prelude::*;

use super::*;

fn point() -> impl Strategy<Value = DVec3> {
    prop::array::uniform3(-8..8_i32).prop_map(|p| 0.25 * dvec3(p[0].into(), p[1].into(), p[2].into()))
}

fn triangles() -> impl Strategy<Value = Vec<Triangle>> {
    prop::collection::vec(prop::array::uniform3(point()), 0..60)
}

fn grid(n: usize) -> Vec<Triangle> {
    let at = |i: usize, j: usize| dvec3(i as f64, j as f64, libm::sin(0.3 * i as f64) + libm::cos(0.2 * j as f64));
    (0..n * n)
        .flat_map(|k| {
            let (i, j) = (k / n, k % n);
            [[at(i, j), at(i + 1, j), at(i, j + 1)], [at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]]
        })
        .collect()
}

fn brute_closest(all: &[Triangle], p: DVec3) -> Option<(f64, u32)> {
    let pairs = all.iter().enumerate().map(|(i, t)| (t.nearest(p).distance_squared, i as u32));
    pairs.min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)))
}

proptest! {
    #[test]
    fn the_closest_is_that_of_all(all in triangles(), p in point()) {
        let bvh = Bvh::new(all.clone());
        let found = bvh.closest(p).map(|c| (c.nearest.distance_squared, c.index));
        prop_assert_eq!(found, brute_closest(&all, p));
        if let Some((distance, index)) = found {
            let again = bvh.closest_within(p, distance).map(|c| c.index);
            prop_assert_eq!(again, Some(index));
            prop_assert!(distance == 0.0 || bvh.closest_within(p, distance * 0.99).is_none());
            let enough = 2.0 * distance + 0.1;
            let near = bvh.near(p, f64::INFINITY, enough).map(|c| all[c.index as usize].nearest(p).distance_squared);
            prop_assert!(near.is_some_and(|near| near <= enough));
            // Where nothing is enough it is the closest; at no distance the first found is enough.
            let first = bvh.near(p, f64::INFINITY, distance * 0.99).map(|c| c.index);
            prop_assert!(distance == 0.0 || first == Some(index));
        }
    }

    #[test]
    fn boxes_and_pairs_are_those_of_all(all in triangles(), other in triangles()) {
        let bvh = Bvh::new(all.clone());
        let meet = |i: usize, j: usize, b: &[Triangle]| all[i].bounds().overlaps(&b[j].bounds());
        let mut pairs = Vec::new();
        let _ = bvh.for_each_self_pair(|i, j| { pairs.push((i, j)); ControlFlow::Continue(()) });
        pairs.sort_unstable();
        let mut expected = Vec::new();
        for i in 0..all.len() {
            for j in i + 1..all.len() {
                if meet(i, j, &all) { expected.push((i as u32, j as u32)); }
            }
        }
        prop_assert_eq!(pairs, expected);
        if let Some(first) = other.first() {
            let inside: Vec<u32> = (0..all.len() as u32).filter(|&i| meet(i as usize, 0, &other)).collect();
            prop_assert_eq!(bvh.in_box(&first.bounds()), inside);
        }
    }

    #[test]
    fn the_first_hit_is_the_nearest_of_all_hits(all in triangles(), origin in point(), direction in point()) {
        let ray = Ray { origin, direction };
        let bvh = Bvh::new(all);
        let hits = bvh.all_hits(&ray);
        prop_assert_eq!(bvh.first_hit(&ray), hits.first().copied());
        for hit in hits {
            let p = origin + hit.t * direction;
            prop_assert!(bvh.closest(p).is_some_and(|c| c.distance() < 1e-9));
        }
    }
}

#[test]
fn every_ray_through_a_closed_strip_hits() {
    let bvh = Bvh::new(grid(20));
    for i in 1..200 {
        // Also exactly through edges and corners of the grid.
        let origin = dvec3(0.1 * f64::from(i), 10.0, 50.0);
        assert!(bvh.first_hit(&Ray { origin, direction: -DVec3::Z }).is_some_and(|h| h.front), "{origin}");
    }
}

#[test]
fn equal_distances_go_to_the_lowest_index() {
    let t = [DVec3::ZERO, DVec3::X, DVec3::Y];
    let bvh = Bvh::new(vec![t; 100]);
    assert_eq!(bvh.closest(DVec3::Z).map(|c| c.index), Some(0));
    assert_eq!(bvh.len(), 100);
}

#[test]
fn an_empty_hierarchy_answers_nothing() {
    let bvh = TriangleBvh::new(Vec::new());
    assert!(bvh.is_empty() && bvh.closest(DVec3::ZERO).is_none() && bvh.bounds().is_empty());
    assert!(bvh.first_hit(&Ray { origin: DVec3::ZERO, direction: DVec3::X }).is_none());
}

#[test]
fn segments_work_alike() {
    let bvh = SegmentBvh::new((0..50).map(|i| [f64::from(i) * DVec3::X, f64::from(i + 1) * DVec3::X]).collect());
    let found = bvh.closest(dvec3(10.5, 2.0, 0.0)).map(|c| (c.index, c.nearest.distance_squared));
    assert_eq!(found, Some((10, 4.0)));
}
