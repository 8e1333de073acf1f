//! Known answers: rounded rims, unevenly divided ones, bores that cross or break out.

use super::*;

#[test]
fn a_hole_is_told_at_its_axis_however_its_rim_is_divided() {
    let mut mesh = plate(&[hole(&[(0.3, 1.0), (0.3, 0.0)], true)]);
    for p in mesh.points.iter_mut().filter(|p| libm::hypot(p.x, p.y) < 0.31) {
        let turn = libm::atan2(p.y, p.x);
        let (sin, cos) = libm::sincos(turn + 0.5 * libm::sin(turn));
        (p.x, p.y) = (0.3 * cos, 0.3 * sin);
    }
    let (_, report) = removed(&mesh, 1.0, &HOLES);
    let [only] = &report.removed[..] else { panic!("{report:?}") };
    assert!(only.centre.distance(DVec3::new(0.0, 0.0, 0.5)) < 0.005, "{report:?}");
}

/// A quarter of a circle from the flat face at `z = 1` into a hole, or up a boss.
fn rounding(radius: f64, round: f64, up: f64) -> Vec<(f64, f64)> {
    let at = |i: usize| {
        let (sin, cos) = libm::sincos(TAU / 4.0 * i as f64 / 12.0);
        (radius + round * (1.0 - sin), 1.0 + up * round * (1.0 - cos))
    };
    (0..=12).map(at).collect()
}

#[test]
fn rounded_rims_go_with_their_feature() {
    let with = |mut rings: Vec<(f64, f64)>, more: &[(f64, f64)], is_through: bool| {
        rings.extend(more);
        hole(&rings, is_through)
    };
    let cells = [
        with(rounding(0.3, 0.2, -1.0), &[(0.3, 0.0)], true),
        with(rounding(0.3, 0.2, -1.0), &[(0.3, 0.4), (0.0, 0.4)], false),
        with(rounding(0.3, 0.2, 1.0), &[(0.3, 1.6), (0.0, 1.6)], false),
    ];
    let mesh = plate(&cells);
    assert_eq!(validate_surface(&mesh), []);
    // The side counts, not the wider opening.
    let all = [Kind::ThroughHoles, Kind::BlindHoles, Kind::Bosses];
    let (result, report) = removed(&mesh, 0.65, &all);
    assert_eq!((report.removed.len(), report.rejected.len()), (3, 0), "{report:?}");
    assert!(report.removed.iter().all(|r| (0.6..0.65).contains(&r.diameter)), "{report:?}");
    assert_eq!(characteristic(&result), 2);
    assert!((volume(&result) - 12.0).abs() < 1e-12, "{}", volume(&result));
    let (same, report) = removed(&mesh, 0.55, &all);
    assert_eq!((same.faces.len(), report.removed.len()), (mesh.faces.len(), 0));
}

#[test]
fn the_lid_of_a_hole_in_a_cone_is_no_boss() {
    let mesh = plate(&[hole(&[(0.8, 1.0), (0.3, 1.22), (0.3, 0.0)], true)]);
    let (result, report) = removed(&mesh, 0.7, &[Kind::ThroughHoles, Kind::BlindHoles, Kind::Bosses]);
    assert_eq!((report.removed.len(), report.rejected.len()), (1, 0), "{report:?}");
    assert_eq!(characteristic(&result), 2);
}

/// A block from `y = -2` to 0 and of thickness 1, from whose long side a bore about `(0, y)` has taken a bite.
fn notched(radius: f64, y: f64) -> Surface {
    let mut b = Builder { points: Vec::new(), faces: Vec::new() };
    let begin = libm::asin(-y / radius);
    let mut line = vec![[-2.0, 0.0]];
    for i in 0..=N {
        let (sin, cos) = libm::sincos((TAU / 2.0 + 2.0 * begin) * i as f64 / N as f64 - begin - TAU / 2.0);
        line.push([radius * cos, y + radius * sin]);
    }
    line.push([2.0, 0.0]);
    let rows: Vec<[u32; 4]> = line
        .iter()
        .map(|&[x, y]| [[x, y, 1.0], [x, y, 0.0], [x, -2.0, 0.0], [x, -2.0, 1.0]].map(|p| b.point(p)))
        .collect();
    for pair in rows.windows(2) {
        for k in 0..4 {
            let (a, c) = (k, (k + 1) % 4);
            b.face([pair[0][a], pair[1][a], pair[1][c]], false);
            b.face([pair[0][a], pair[1][c], pair[0][c]], false);
        }
    }
    for (row, turned) in [(rows[0], false), (rows[rows.len() - 1], true)] {
        b.face([row[0], row[1], row[2]], turned);
        b.face([row[0], row[2], row[3]], turned);
    }
    surface(&b.points, &b.faces)
}

#[test]
fn notches_of_bores_are_listed() {
    for y in [0.0, 0.1, 0.15] {
        let mesh = notched(0.4, y);
        assert_eq!(validate_surface(&mesh), []);
        assert!((5.0..8.0).contains(&volume(&mesh)));
        let (same, report) = removed(&mesh, 1.0, &HOLES);
        assert_eq!((same.faces.len(), report.removed.len()), (mesh.faces.len(), 0));
        let [only] = &report.rejected[..] else { panic!("at {y}: {report:?}") };
        assert_eq!(only.reason, Reason::CutByOthers);
        assert!((only.diameter - 0.8).abs() < 1e-9 && libm::hypot(only.centre.x, only.centre.y - y) < 1e-9);
        assert_eq!(removed(&mesh, 1.0, &[Kind::Bosses]).1, Report::default());
        assert_eq!(removed(&mesh, 0.7, &HOLES).1, Report::default());
    }
    assert_eq!(removed(&notched(0.4, 0.3), 1.0, &HOLES).1, Report::default(), "a shallow dent");
}

/// A block of side 2 with bores along all three axes through its middle.
fn three_bores(radius: f64) -> Surface {
    let mut b = Builder { points: Vec::new(), faces: Vec::new() };
    // Bores share points, whose coordinates come out of different angles.
    let rounded = |x: f64| (x * 1e9).round() / 1e9;
    for axis in 0..3 {
        for sign in [1.0, -1.0] {
            let at = |u: f64, v: f64, w: f64| {
                let mut p = [0.0; 3];
                (p[axis], p[(axis + 1) % 3], p[(axis + 2) % 3]) = (sign * rounded(w), rounded(u), sign * rounded(v));
                p.map(|x| x + 0.0)
            };
            let square: Vec<u32> = Builder::square_of(|u, v| at(u, v, 1.0)).into_iter().map(|p| b.point(p)).collect();
            let turn = |i: usize| libm::sincos(TAU * i as f64 / N as f64);
            let circle: Vec<u32> = (0..N).map(turn).map(|(s, c)| b.point(at(radius * c, radius * s, 1.0))).collect();
            let inner: Vec<u32> = (0..N)
                .map(turn)
                .map(|(s, c)| b.point(at(radius * c, radius * s, radius * s.abs().max(c.abs()))))
                .collect();
            b.strip(&square, &circle, false);
            b.strip(&circle, &inner, false);
        }
    }
    surface(&b.points, &b.faces)
}

#[test]
fn three_bores_through_one_place_leave_no_void() {
    let mesh = three_bores(0.4);
    assert_eq!((validate_surface(&mesh), characteristic(&mesh)), (Vec::new(), -8));
    let (result, report) = removed(&mesh, 1.0, &HOLES);
    let [only] = &report.removed[..] else { panic!("{report:?}") };
    assert_eq!((only.kind, only.bores, report.rejected.len()), (Kind::ThroughHoles, 3, 0));
    assert_eq!(characteristic(&result), 2);
    assert!((volume(&result) - 8.0).abs() < 1e-12, "{}", volume(&result));
}
