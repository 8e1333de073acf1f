//! What repair refuses, and why.

use meshmill::step::Length;

use super::*;

/// A soup times a number, moved.
fn placed(soup: Soup, scale: f64, offset: f64) -> Soup {
    Soup { points: soup.points.iter().map(|&p| scale * p + DVec3::splat(offset)).collect(), ..soup }
}

fn refused(soup: &Soup, params: &RepairParams) -> RepairError {
    repair(soup, params, &Watch::silent()).map(drop).expect_err("it is repaired")
}

#[test]
fn what_arithmetic_cannot_hold_is_refused_with_extent_and_offset() {
    for (scale, offset) in [(1e-150, 0.0), (1e160, 0.0), (1.0, 1e15), (1e-40, 0.0), (1e-3, 1e9)] {
        let error = refused(&placed(cube([0.0; 3]), scale, offset), &RepairParams::default());
        let RepairError::BeyondArithmetic { extent, offset: far } = error else { panic!("{error}") };
        assert!(extent > 0.0 && far >= offset, "{extent} {far}");
        assert!(error.to_string().contains("extent") && error.to_string().contains("origin"), "{error}");
    }
    for (scale, offset) in [(1e-6, 0.0), (1e9, 0.0), (1.0, 1e8), (1e3, 1e6)] {
        run(&placed(cube([0.0; 3]), scale, offset));
    }
}

#[test]
fn faces_on_one_line_are_no_surface() {
    let points: Vec<[f64; 3]> = (0..10).map(|i| [1.0, 2.0, 3.0].map(|x| x * f64::from(i))).collect();
    let faces: Vec<[u32; 3]> = (0..20).map(|i| [i % 10, (3 * i + 1) % 10, (7 * i + 4) % 10]).collect();
    let error = refused(&soup(&points, &faces), &RepairParams::default());
    assert!(matches!(error, RepairError::NoArea { .. } | RepairError::NothingLeft { .. }), "{error}");
}

fn up_to(percent: f64) -> RepairParams {
    RepairParams { crossing_length: Some(Length::Percent(percent)), ..RepairParams::default() }
}

#[test]
fn bodies_that_run_through_each_other_too_far_stop_before_they_are_refined() {
    let through = merged(cube([0.0; 3]), &cube([0.4, 0.3, 0.5]));
    let error = refused(&through, &up_to(50.0));
    let RepairError::RunsThrough { pairs, length, longest, ref worst } = error else { panic!("{error}") };
    assert!(length > longest && !worst.is_empty(), "{error}");
    // The cubes share a box of 0.6 by 0.7 by 0.5; they cross along all its edges but the six at two opposite corners.
    assert!((length - 2.0 * (0.6 + 0.7 + 0.5)).abs() < 1e-6, "{error}");
    // Every face named is one of those that cross, and the place lies on both cubes.
    for (_, at) in worst {
        let on = |low: [f64; 3]| (*at - DVec3::from_array(low) - DVec3::splat(0.5)).abs().max_element();
        assert!((on([0.0; 3]) - 0.5).abs() < 1e-9 && (on([0.4, 0.3, 0.5]) - 0.5).abs() < 1e-9, "{at}");
    }
    for params in [RepairParams::default(), up_to(800.0)] {
        let (_, stats) = run_with(&through, &params);
        assert_eq!(stats.self_intersections, pairs);
    }
}

#[test]
fn how_far_bodies_run_through_each_other_does_not_depend_on_how_finely_they_are_cut() {
    let length = |soup: &Soup| match refused(soup, &up_to(0.01)) {
        RepairError::RunsThrough { length, .. } => length,
        error => panic!("{error}"),
    };
    for offset in [[0.41, 0.31, 0.53], [0.41, 0.31, 1.0]] {
        let coarse = merged(cube([0.0; 3]), &cube(offset));
        let fine = quartered(&quartered(&coarse));
        assert!((length(&fine) - length(&coarse)).abs() < 1e-6, "{} {}", length(&fine), length(&coarse));
    }
}

/// Four similar triangles for each.
fn quartered(soup: &Soup) -> Soup {
    let mut points: Vec<[f64; 3]> = Vec::new();
    for facet in &soup.faces {
        let corners: Vec<DVec3> = facet.corners().iter().map(|&v| soup.points[v]).collect();
        for at in 1..corners.len() - 1 {
            let [a, b, c] = [corners[0], corners[at], corners[at + 1]];
            let [ab, bc, ca] = [a.midpoint(b), b.midpoint(c), c.midpoint(a)];
            points.extend([a, ab, ca, ab, b, bc, ca, bc, c, ab, bc, ca].map(|p| p.to_array()));
        }
    }
    let faces: Vec<[u32; 3]> = (0..points.len() as u32 / 3).map(|f| [3 * f, 3 * f + 1, 3 * f + 2]).collect();
    self::soup(&points, &faces)
}
