//! Cracks that are zipped, and holes that are filled as round as their surroundings.

use meshmill::step::Length;

use super::*;

/// The same soup through a map, faces turned where that mirrors.
fn mapped(soup: &Soup, is_mirror: bool, map: impl Fn(DVec3) -> DVec3) -> Soup {
    let mut soup = soup.clone();
    soup.points.iter_mut().for_each(|p| *p = map(*p));
    if is_mirror {
        soup.faces.iter_mut().for_each(|facet| facet.corners_mut().swap(1, 2));
    }
    soup
}

/// A wall of a cylinder of radius 1 and height 2 between two angles, with rings at these heights on both sides.
fn wall(angles: [f64; 2], columns: usize, first: &[f64], last: &[f64]) -> Soup {
    let at = |angle: f64, z: f64| {
        let (sin, cos) = libm::sincos(angle);
        [cos, sin, z]
    };
    let middle: Vec<f64> = (0..=8).map(|k| 0.25 * f64::from(k)).collect();
    let mut points = Vec::new();
    for i in 0..columns {
        let angle = |i: usize| angles[0] + (angles[1] - angles[0]) * i as f64 / columns as f64;
        let (left, right) = (if i == 0 { first } else { &middle }, if i + 1 == columns { last } else { &middle });
        let (mut a, mut b) = (0, 0);
        while a + 1 < left.len() || b + 1 < right.len() {
            let is_left = b + 1 == right.len() || (a + 1 < left.len() && left[a + 1] <= right[b + 1]);
            let tip = if is_left { at(angle(i), left[a + 1]) } else { at(angle(i + 1), right[b + 1]) };
            points.extend([at(angle(i), left[a]), at(angle(i + 1), right[b]), tip]);
            if is_left { a += 1 } else { b += 1 }
        }
    }
    let faces: Vec<[u32; 3]> = (0..points.len() as u32 / 3).map(|f| [3 * f, 3 * f + 1, 3 * f + 2]).collect();
    soup(&points, &faces)
}

/// A cylinder's wall with a crack along it, on whose sides the corners are at other heights.
fn cracked(width: f64) -> Soup {
    let turn = 2.0 * std::f64::consts::PI;
    wall([0.0, turn - width], 24, &[0.0, 0.3, 0.7, 1.2, 1.5, 2.0], &[0.0, 0.25, 0.5, 0.75, 1.2, 1.35, 1.8, 2.0])
}

fn zipping(gaps: f64) -> RepairParams {
    RepairParams { gaps: Some(Length::Absolute(gaps)), ..RepairParams::default() }
}

#[test]
fn a_crack_along_a_cylinder_is_zipped() {
    let soup = cracked(0.05);
    let (open, _) = run(&soup);
    assert_eq!(euler(&open).0, 1);
    for (factor, is_mirror) in [(1.0, false), (1.0, true), (1e6, false), (1e-6, true)] {
        let sign = if is_mirror { -factor } else { factor };
        let other = mapped(&soup, is_mirror, |p| DVec3::new(sign * p.x, factor * p.y, factor * p.z));
        let (surface, stats) = run_with(&other, &zipping(0.06 * factor));
        // A tube: two rims, each with the corners of its ring.
        let border = euler(&surface);
        assert_eq!((border.0, border.1), (0, 48), "{factor}");
        assert!(stats.vertices_zipped > 0 && stats.max_move > 0.0 && stats.max_move <= 0.06 * factor, "{stats:?}");
        assert_eq!(stats.self_intersections, 0);
        for p in &surface.points {
            let radius = p.truncate().length() / factor;
            assert!((radius - 1.0).abs() < 1e-3, "{radius}");
        }
        // No more than the gaps is allowed: then it stays open.
        let (surface, stats) = run_with(&other, &zipping(0.04 * factor));
        assert!(euler(&surface).0 == 1 && stats.vertices_zipped == 0);
    }
    let all = RepairParams { fill_holes: meshmill::steps::repair::FillHoles::All, ..zipping(0.06) };
    let (closed, _) = run_with(&soup, &all);
    assert_eq!(euler(&closed), (2, 0));
    let whole = std::f64::consts::PI * 2.0;
    assert!((volume(&closed) / whole - 1.0).abs() < 0.02, "{}", volume(&closed));
}

#[test]
fn what_is_no_crack_is_not_zipped() {
    // A strip, a plate of two sheets without a wall between them, and sheets that meet at a right angle.
    let square = |at: [[f64; 3]; 4]| soup(&at, &[[0, 1, 2], [0, 2, 3]]);
    let strip = square([[0.0; 3], [1.0, 0.0, 0.0], [1.0, 0.01, 0.0], [0.0, 0.01, 0.0]]);
    let sheet = |z: f64| square([[0.0, 0.0, z], [1.0, 0.0, z], [1.0, 1.0, z], [0.0, 1.0, z]]);
    let below = mapped(&sheet(-0.01), true, |p| p);
    let corner = square([[0.0, -0.01, 0.0], [1.0, -0.01, 0.0], [1.0, -0.01, 1.0], [0.0, -0.01, 1.0]]);
    for soup in [strip, merged(sheet(0.0), &below), merged(sheet(0.0), &corner)] {
        let (surface, stats) = run_with(&soup, &zipping(0.02));
        assert_eq!((stats.vertices_zipped, surface), (0, run(&soup).0));
    }
    // While these two belong together.
    let beside = mapped(&sheet(0.0), false, |p| p + DVec3::new(1.01, 0.0, 0.0));
    let (surface, stats) = run_with(&merged(sheet(0.0), &beside), &zipping(0.02));
    assert_eq!((stats.vertices_zipped, surface.points.len(), euler(&surface)), (2, 6, (1, 6)));
}

#[test]
fn a_cap_cut_off_a_sphere_grows_back() {
    let open = sphere(24, 4, 24);
    let height = 1.0 - libm::cos(std::f64::consts::PI * 4.0 / 24.0);
    for (factor, is_mirror) in [(1.0, false), (1.0, true), (1e6, true), (1e-6, false)] {
        let sign = if is_mirror { -factor } else { factor };
        let cut = mapped(&open, is_mirror, |p| DVec3::new(factor * p.x, factor * p.y, sign * p.z));
        let (surface, _) = run_with(&cut, &fill_all());
        assert_eq!(euler(&surface), (2, 0));
        // A flat lid would miss the sphere by the height of the cap.
        let miss = surface.points.iter().map(|p| (p.length() / factor - 1.0).abs()).fold(0.0, f64::max);
        assert!(miss < 0.12 * height, "{miss} of {height}");
    }
}
