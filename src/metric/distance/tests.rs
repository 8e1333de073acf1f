//! Distances known by hand, decisions on both sides of a threshold, and bounds that dense samples never exceed.

use glam::{DVec3, dvec3};
use proptest::prelude::*;

use super::*;
use crate::mesh::Facet;

fn soup(points: Vec<DVec3>, faces: &[[u32; 3]]) -> Soup {
    let faces = faces.iter().map(|f| Facet::Tri(f.map(VertexId::from_raw))).collect();
    Soup { points: points.into(), faces, ..Soup::default() }
}

/// A sphere of radius `r` from an octahedron, each face cut in `n * n`.
fn sphere(r: f64, n: u32) -> Soup {
    let mut points = Vec::new();
    let mut faces = Vec::new();
    for k in 0..8_u32 {
        let sign = |bit: u32| if k >> bit & 1 == 0 { 1.0 } else { -1.0 };
        let axes = [sign(0) * DVec3::X, sign(1) * DVec3::Y, sign(2) * DVec3::Z];
        let base = points.len() as u32;
        for i in 0..=n {
            for j in 0..=n - i {
                let weights = [f64::from(i), f64::from(j), f64::from(n - i - j)];
                points.push(r * (weights[0] * axes[0] + weights[1] * axes[1] + weights[2] * axes[2]).normalize());
            }
        }
        let at = |i: u32, j: u32| base + i * (n + 1) - i * (i.max(1) - 1) / 2 + j;
        for i in 0..n {
            for j in 0..n - i {
                faces.push([at(i, j), at(i + 1, j), at(i, j + 1)]);
                if i + j + 1 < n {
                    faces.push([at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]);
                }
            }
        }
    }
    soup(points, &faces)
}

fn cube(half: f64) -> Soup {
    let points = (0..8_u32).map(|k| {
        let c = |bit: u32| if k >> bit & 1 == 0 { -half } else { half };
        dvec3(c(0), c(1), c(2))
    });
    let quads: [[u32; 4]; 6] = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let faces: Vec<[u32; 3]> = quads.iter().flat_map(|q| [[q[0], q[1], q[2]], [q[0], q[2], q[3]]]).collect();
    soup(points.collect(), &faces)
}

fn both(a: &Soup, b: &Soup) -> TwoSided {
    two_sided(&Target::of(a), &Target::of(b), &Watch::silent()).expect("not cancelled").expect("triangles")
}

/// Both as one mesh.
fn together(a: &Soup, b: &Soup, at: DVec3) -> Soup {
    let mut all = a.clone();
    let base = a.points.len() as u32;
    b.points.iter().for_each(|&p| {
        all.points.push(p + at);
    });
    for facet in &b.faces {
        let mut facet = *facet;
        facet.corners_mut().iter_mut().for_each(|v| *v = VertexId::from_raw(v.raw() + base));
        all.faces.push(facet);
    }
    all
}

#[test]
fn what_is_inside_of_bodies_does_not_count_where_it_is_not_to() {
    let body = cube(1.0);
    let outside = |reference: &Soup| {
        let (from, to, watch) = (Target::of(reference), Target::of(&body), Watch::silent());
        let hidden = Inside::of(&body);
        let bound = outside_bound(&from, &to, &hidden, &watch).expect("not cancelled").expect("triangles");
        let holds = |threshold: f64| {
            decide_outside(&from, &to, threshold, &hidden, &watch).expect("not cancelled").expect("triangles").holds
        };
        // What the bound says is so, and less than what is reached is not.
        assert!(holds(bound) && (bound < 0.01 || !holds(0.2 * bound)), "{bound}");
        bound
    };
    assert!(outside(&together(&body, &cube(0.3), DVec3::ZERO)) < 1e-3);
    // Walls that run through the body stick out by 0.3 on one side.
    let sticks_out = outside(&together(&body, &cube(0.4), dvec3(0.9, 0.1, 0.05)));
    assert!((0.3..0.3 * 4.0).contains(&sticks_out), "{sticks_out}");
    // Nothing is inside of a sheet.
    let mut open = body.clone();
    open.faces = open.faces.iter().skip(1).copied().collect();
    assert!(!Inside::of(&open).holds(DVec3::ZERO) && Inside::of(&body).holds(DVec3::ZERO));
    assert!(!Inside::of(&body).holds(dvec3(1.5, 0.0, 0.0)));
    // A cavity is not inside.
    let mut cavity = cube(0.5);
    cavity.faces.iter_mut().for_each(|facet| facet.corners_mut().swap(1, 2));
    assert!(!Inside::of(&together(&body, &cavity, DVec3::ZERO)).holds(dvec3(0.1, 0.2, 0.3)));
}

#[test]
fn far_from_the_origin_the_bound_is_as_good() {
    let near = [sphere(1.0, 6), sphere(1.01, 5)];
    let far = near.clone().map(|mut soup| {
        soup.points.iter_mut().for_each(|p| *p += dvec3(4e6, -4e6, 1e6));
        soup
    });
    let bound =
        |[a, b]: &[Soup; 2]| two_sided(&Target::of(a), &Target::of(b), &Watch::silent()).unwrap().unwrap().upper();
    let (here, there) = (bound(&near), bound(&far));
    assert!((here - there).abs() < 1e-6, "{here} and {there}");
}

#[test]
fn spheres_of_radius_1_and_1_1_are_0_1_apart() {
    let d = both(&sphere(1.0, 24), &sphere(1.1, 24));
    assert!(d.upper() >= d.lower() && d.upper() - d.lower() < 2e-3, "{d:?}");
    assert!((d.upper() - 0.1).abs() < 5e-3 && (d.to_reference.mean - 0.1).abs() < 5e-3, "{d:?}");
    assert!(d.to_reference.rms >= d.to_reference.mean);
}

#[test]
fn cubes_are_apart_by_their_corners() {
    let d = both(&cube(0.5), &cube(0.55));
    assert!((d.from_reference.upper - 3.0_f64.sqrt() * 0.05).abs() < 1e-12, "{d:?}");
    assert!((d.to_reference.upper - 0.05).abs() < 1e-12, "{d:?}");
}

#[test]
fn other_triangles_of_the_same_flat_faces_are_no_distance_apart() {
    // The same square, cut on the other diagonal, and into a fan.
    let p = vec![DVec3::ZERO, DVec3::X, dvec3(1.0, 1.0, 0.0), DVec3::Y, dvec3(0.3, 0.6, 0.0)];
    let a = soup(p.clone(), &[[0, 1, 2], [0, 2, 3]]);
    let b = soup(p.clone(), &[[0, 1, 3], [1, 2, 3]]);
    let fan = soup(p, &[[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]]);
    for (one, other) in [(&a, &b), (&b, &fan), (&a, &fan)] {
        let d = both(one, other);
        assert!(d.upper() < 1e-12, "{d:?}");
    }
}

#[test]
fn a_threshold_is_decided_both_ways() {
    let (small, large) = (Target::of(&cube(0.5)), Target::of(&cube(0.55)));
    let corner = 3.0_f64.sqrt() * 0.05;
    let ask = |t: f64| decide(&large, &small, t, &Watch::silent()).expect("not cancelled").expect("triangles");
    assert!(ask(corner).holds && ask(corner * 1.01).holds);
    let fails = ask(corner * 0.99);
    assert!(!fails.holds && fails.undecided.is_empty() && fails.beyond.len() == 12);
    assert!((fails.beyond[0].2 - corner).abs() < 1e-12);
}

#[test]
fn nothing_has_no_distance_and_cancelling_stops() {
    let (none, some) = (Target::of(&Soup::default()), Target::of(&cube(1.0)));
    assert_eq!(two_sided(&none, &some, &Watch::silent()), Ok(None));
}

fn terrain() -> impl Strategy<Value = Soup> {
    prop::collection::vec(prop::array::uniform3(-1.0..1.0_f64), 3..12).prop_map(|p| {
        let count = p.len() as u32;
        let points = p.into_iter().map(DVec3::from_array).collect();
        soup(points, &(0..count - 2).map(|i| [i, i + 1, i + 2]).collect::<Vec<_>>())
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn dense_samples_never_exceed_the_bound(a in terrain(), b in terrain()) {
        let (a, b) = (Target::of(&a), Target::of(&b));
        let bound = one_sided(&a, &b, &Watch::silent()).expect("not cancelled").expect("triangles");
        let dense = sample(a.triangles(), 5000);
        let most = dense.iter().filter_map(|&(_, p)| b.bvh().closest(p)).map(|c| c.distance()).fold(0.0, f64::max);
        prop_assert!(most <= bound.upper, "{most} {bound:?}");
        prop_assert!(bound.lower <= bound.upper);
        prop_assert!(bound.upper - bound.lower <= 0.011 * bound.upper + 1e-4, "{bound:?}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn a_memo_changes_no_decision(
        a in terrain(),
        b in terrain(),
        moves in prop::collection::vec((any::<prop::sample::Index>(), -0.3..0.3), 1..6),
    ) {
        let (to, watch) = (Target::of(&b), Watch::silent());
        let (mut there, mut back, mut a) = (Memo::default(), Memo::default(), a);
        for (index, height) in moves {
            let from = Target::of(&a);
            for threshold in [0.1, 0.1, 0.3] {
                let agree = |from: &Target, to: &Target, memo: &mut Memo| {
                    let decide = |memo| decide_where(from, to, threshold, &|_| true, memo, &watch).unwrap().unwrap();
                    let (with, without) = (decide(Some(memo)), decide(None));
                    prop_assert_eq!(&with.beyond, &without.beyond);
                    prop_assert_eq!(&with.undecided, &without.undecided);
                    prop_assert_eq!(with.holds, without.holds);
                    prop_assert!(!with.holds || with.upper <= threshold * (1.0 + 1e-8) + 1e-12);
                    Ok(())
                };
                agree(&from, &to, &mut there)?;
                agree(&to, &from, &mut back)?;
            }
            let v = VertexId::new(index.index(a.points.len()));
            a.points[v].z += height;
        }
    }

    #[test]
    fn what_is_known_to_be_within_is_not_looked_at_again(a in terrain()) {
        let target = Target::of(&a);
        let mut memo = Memo::default();
        let all = |memo: &mut Memo| memo.known(&target, &target, 0.5);
        prop_assert!(!all(&mut memo).contains(&true));
        decide_where(&target, &target, 0.5, &|_| true, Some(&mut memo), &Watch::silent()).unwrap().unwrap();
        prop_assert!(!all(&mut memo).contains(&false));
        prop_assert!(!memo.known(&target, &target, 0.25).contains(&true), "another threshold is another question");
    }
}
