//! Known answers: a plate with holes, stepped and blind ones, slots, bosses, locks.

mod rims;

use std::f64::consts::TAU;

use glam::DVec3;

use super::*;
use crate::mesh::geometry::{area_vector, stretch};
use crate::mesh::halfedge::tests::surface;
use crate::mesh::topology::{EdgeTable, euler_characteristic};
use crate::mesh::validate::validate_surface;
use crate::technique::feature::{FeatureRules, mark_features};

const RULES: FeatureRules = FeatureRules {
    angle: 30.0,
    seed_angle: 40.0,
    corner_angle: 45.0,
    region_borders: true,
    voting_radius: None,
    gap: 0.0,
};

/// Facets round a hole.
const N: usize = 32;

/// A stack of rings about an axis in a square cell of side 2: radius and height of each, from the cell's top inwards.
/// A radius of zero ends it with a point.
struct Cell {
    rings: Vec<(f64, f64)>,
    /// How much the rings are wider in x.
    oval: f64,
    /// Whether the last ring lies on the bottom, so that the cell is open there.
    is_through: bool,
}

fn hole(rings: &[(f64, f64)], is_through: bool) -> Cell {
    Cell { rings: rings.to_vec(), oval: 1.0, is_through }
}

struct Builder {
    points: Vec<[f64; 3]>,
    faces: Vec<[u32; 3]>,
}

impl Builder {
    fn point(&mut self, p: [f64; 3]) -> u32 {
        if let Some(at) = self.points.iter().position(|q| *q == p) {
            return at as u32;
        }
        self.points.push(p);
        self.points.len() as u32 - 1
    }

    fn face(&mut self, corners: [u32; 3], turned: bool) {
        let [a, b, c] = corners;
        if a != b && b != c && c != a {
            self.faces.push(if turned { [a, c, b] } else { [a, b, c] });
        }
    }

    /// A strip between two closed lines of `N` points each.
    fn strip(&mut self, outer: &[u32], inner: &[u32], turned: bool) {
        for i in 0..N {
            let j = (i + 1) % N;
            self.face([outer[i], outer[j], inner[j]], turned);
            self.face([outer[i], inner[j], inner[i]], turned);
        }
    }

    fn ring(&mut self, x: f64, oval: f64, (radius, z): (f64, f64)) -> Vec<u32> {
        (0..N)
            .map(|i| {
                let (sin, cos) = libm::sincos(TAU * i as f64 / N as f64);
                self.point([x + oval * radius * cos, radius * sin, z])
            })
            .collect()
    }

    /// The border of a square of side 2, `N` points in the order of angles.
    fn square_of(at: impl Fn(f64, f64) -> [f64; 3]) -> Vec<[f64; 3]> {
        let side = N / 4;
        let place = |i: usize| {
            // Begins at angle 0, in the middle of the right side.
            let k = (i + side / 2) % N;
            let t = 2.0 * (k % side) as f64 / side as f64 - 1.0;
            let (u, v) = [(1.0, t), (-t, 1.0), (-1.0, -t), (t, -1.0)][k / side];
            at(u, v)
        };
        (0..N).map(place).collect()
    }

    fn square(&mut self, x: f64, z: f64) -> Vec<u32> {
        Self::square_of(|u, v| [x + u, v, z]).iter().map(|&p| self.point(p)).collect()
    }
}

/// A plate of thickness 1 with a row of cells.
fn plate(cells: &[Cell]) -> Surface {
    let mut b = Builder { points: Vec::new(), faces: Vec::new() };
    let count = cells.len();
    for (i, cell) in cells.iter().enumerate() {
        let x = 2.0 * i as f64;
        let (top, bottom) = (b.square(x, 1.0), b.square(x, 0.0));
        let mut last = top.clone();
        for &ring in &cell.rings {
            let next = b.ring(x, cell.oval, ring);
            b.strip(&last, &next, false);
            last = next;
        }
        let end = if cell.is_through { last } else { vec![b.point([x, 0.0, 0.0]); N] };
        b.strip(&bottom, &end, true);
        for k in 0..N {
            let pair = [top[k], top[(k + 1) % N]].map(|v| b.points[v as usize]);
            let on = |at: fn(&[f64; 3]) -> f64, value: f64| pair.iter().all(|p| at(p) == value);
            let is_outside =
                on(|p| p[1], 1.0) || on(|p| p[1], -1.0) || on(|p| p[0], -1.0) || on(|p| p[0], 2.0 * count as f64 - 1.0);
            if is_outside {
                let (t, u, v, w) = (top[k], top[(k + 1) % N], bottom[(k + 1) % N], bottom[k]);
                b.face([t, v, u], false);
                b.face([t, w, v], false);
            }
        }
    }
    surface(&b.points, &b.faces)
}

/// A block of side 2 with a bore from the top's middle that turns, with a mitre, and leaves through the right side.
fn elbow(radius: f64) -> Surface {
    let mut b = Builder { points: Vec::new(), faces: Vec::new() };
    let mut circles = Vec::new();
    for axis in 0..3 {
        for sign in [1.0, -1.0] {
            // Seen from outside, `u` and `v` turn to the left about the axis.
            let at = |u: f64, v: f64| {
                let mut p = [0.0; 3];
                (p[axis], p[(axis + 1) % 3], p[(axis + 2) % 3]) = (sign, u, sign * v);
                p
            };
            let flat = Builder::square_of(at);
            let square: Vec<u32> = flat.iter().map(|&p| b.point(p)).collect();
            if sign > 0.0 && axis != 1 {
                let turn = |i: usize| libm::sincos(TAU * i as f64 / N as f64);
                let circle: Vec<u32> =
                    (0..N).map(turn).map(|(sin, cos)| b.point(at(radius * cos, radius * sin))).collect();
                b.strip(&square, &circle, false);
                circles.push(circle);
            } else {
                let middle = vec![b.point(at(0.0, 0.0)); N];
                b.strip(&square, &middle, false);
            }
        }
    }
    let mitre: Vec<u32> = (0..N)
        .map(|i| {
            let (sin, cos) = libm::sincos(TAU * i as f64 / N as f64);
            b.point([radius * cos, radius * sin, radius * cos])
        })
        .collect();
    let right: Vec<u32> = (0..N).map(|i| circles[0][(N / 4 + N - i) % N]).collect();
    b.strip(&circles[1], &mitre, false);
    b.strip(&mitre, &right, false);
    surface(&b.points, &b.faces)
}

fn volume(mesh: &Surface) -> f64 {
    mesh.faces.ids().map(|f| mesh.corners(f)).map(|[a, b, c]| a.dot(b.cross(c)) / 6.0).sum()
}

fn characteristic(mesh: &Surface) -> i64 {
    euler_characteristic(mesh, &EdgeTable::new(mesh))
}

fn removed(mesh: &Surface, most: f64, kinds: &[Kind]) -> (Surface, Report) {
    removed_where(mesh, &RULES, most, kinds)
}

fn removed_where(mesh: &Surface, rules: &FeatureRules, most: f64, kinds: &[Kind]) -> (Surface, Report) {
    let (marked, _) = mark_features(mesh, rules, &Watch::silent()).expect("nobody interrupts");
    let (result, report) =
        remove_features(&marked, most, kinds, &LockRules::default(), &Watch::silent()).expect("no locks");
    assert_eq!(validate_surface(&result), []);
    (result, report)
}

/// The area of a regular polygon with `N` corners.
fn polygon(radius: f64) -> f64 {
    0.5 * N as f64 * radius * radius * libm::sin(TAU / N as f64)
}

const HOLES: [Kind; 2] = [Kind::ThroughHoles, Kind::BlindHoles];

#[test]
fn five_through_holes_are_filled_flat() {
    let radii = [0.3, 0.4, 0.25, 0.5, 0.35];
    let mesh = plate(&radii.map(|r| hole(&[(r, 1.0), (r, 0.0)], true)));
    assert_eq!(validate_surface(&mesh), []);
    assert_eq!(characteristic(&mesh), -8);
    let (result, report) = removed(&mesh, 1.1, &HOLES);
    assert_eq!(report.removed.len(), 5, "{report:?}");
    assert_eq!((report.rejected.len(), characteristic(&result)), (0, 2));
    let filled: f64 = radii.iter().map(|&r| polygon(r)).sum();
    assert!((volume(&result) - volume(&mesh) - filled).abs() < 1e-12);
    let inside = |p: DVec3| radii.iter().enumerate().any(|(i, r)| libm::hypot(p.x - 2.0 * i as f64, p.y) < r + 1e-9);
    let mut shapes = Vec::new();
    for f in result.faces.ids() {
        let corners = result.corners(f);
        if corners.iter().all(|&p| inside(p)) {
            let normal = area_vector(corners).normalize();
            assert!(normal.z.abs() > 1.0 - 1e-12, "{corners:?}");
            assert!(corners.iter().all(|p| p.z.abs() < 1e-12 || (p.z - 1.0).abs() < 1e-12));
            shapes.push(stretch(corners));
        }
    }
    let mean = shapes.iter().sum::<f64>() / shapes.len() as f64;
    assert!(mean >= 0.7, "mean stretch {mean} of {}", shapes.len());
    // The rims have vanished from the marks: only the outline of the plate is left.
    assert!(result.carried.marks.keys().all(|e| e.iter().all(|&v| !inside(result.points[v]))));
}

#[test]
fn only_the_small_round_ones_go() {
    let mut cells = [0.2, 0.5, 0.3].map(|r| hole(&[(r, 1.0), (r, 0.0)], true));
    cells[2].oval = 1.6;
    let (result, report) = removed(&plate(&cells), 0.7, &HOLES);
    assert_eq!(report.removed.len(), 1);
    assert!((report.removed[0].diameter - 0.4).abs() < 1e-9 && report.removed[0].centre.x.abs() < 1e-9);
    let reasons: Vec<Reason> = report.rejected.iter().map(|r| r.reason).collect();
    assert_eq!(reasons.len(), 2);
    assert!(reasons.contains(&Reason::TooLarge));
    assert_eq!(characteristic(&result), -2);
}

#[test]
fn steps_chamfers_and_floors_go_with_their_hole() {
    let cells = [
        // Counterbore, through.
        hole(&[(0.5, 1.0), (0.5, 0.6), (0.3, 0.6), (0.3, 0.0)], true),
        // Chamfered at both ends.
        hole(&[(0.4, 1.0), (0.3, 0.9), (0.3, 0.1), (0.4, 0.0)], true),
        // Blind with a flat floor.
        hole(&[(0.3, 1.0), (0.3, 0.5), (0.0, 0.5)], false),
        // Blind, stepped, with the cone of a drill.
        hole(&[(0.5, 1.0), (0.5, 0.7), (0.3, 0.7), (0.3, 0.4), (0.0, 0.1)], false),
    ];
    let mesh = plate(&cells);
    assert_eq!(validate_surface(&mesh), []);
    let (result, report) = removed(&mesh, 1.1, &HOLES);
    let kinds: Vec<Kind> = report.removed.iter().map(|r| r.kind).collect();
    assert_eq!(kinds.iter().filter(|&&k| k == Kind::ThroughHoles).count(), 2, "{report:?}");
    assert_eq!(kinds.iter().filter(|&&k| k == Kind::BlindHoles).count(), 2, "{report:?}");
    assert!((volume(&result) - 16.0).abs() < 1e-12, "a plain plate is left: {}", volume(&result));
    let (_, report) = removed(&mesh, 1.1, &[Kind::BlindHoles]);
    assert_eq!(report.removed.len(), 2);
}

#[test]
fn a_hole_with_a_step_that_is_too_wide_stays_whole() {
    let cells = [
        hole(&[(0.5, 1.0), (0.5, 0.6), (0.3, 0.6), (0.3, 0.0)], true),
        // Over a countersink.
        hole(&[(0.5, 1.0), (0.5, 0.6), (0.3, 0.4), (0.3, 0.0)], true),
        // A pocket with a small hole in its floor, which is a feature of its own.
        hole(&[(0.9, 1.0), (0.9, 0.6), (0.2, 0.6), (0.2, 0.0)], true),
    ];
    let mesh = plate(&cells);
    assert_eq!(validate_surface(&mesh), []);
    let (result, report) = removed(&mesh, 0.7, &HOLES);
    let [only] = &report.removed[..] else { panic!("{report:?}") };
    assert!((only.diameter - 0.4).abs() < 1e-9, "{report:?}");
    assert_eq!(characteristic(&result), characteristic(&mesh) + 2);
    assert!(report.rejected.iter().all(|r| r.reason.is_size()), "{report:?}");
    let kept: Vec<f64> =
        report.rejected.iter().filter(|r| r.reason == Reason::StepTooLarge).map(|r| r.diameter).collect();
    assert!(kept.len() == 2 && kept.iter().all(|d| (d - 0.6).abs() < 1e-9), "the bores are listed too: {report:?}");
}

#[test]
fn bores_whose_rims_nearly_touch_go() {
    let rules = FeatureRules { gap: 0.05, ..RULES };
    // Side by side, and over one with a step that is narrower than the gap, where one of two rims is left out.
    let beside = [0.99, 0.98].map(|r| hole(&[(r, 1.0), (r, 0.0)], true));
    let over = [0.9, 0.8].map(|r| hole(&[(r, 1.0), (r, 0.6), (r - 0.01, 0.6), (r - 0.01, 0.0)], true));
    for (cells, left_out, bores) in [(beside, 0, 2), (over, 2 * N, 4)] {
        let mesh = plate(&cells);
        let (_, features) = mark_features(&mesh, &rules, &Watch::silent()).expect("nobody interrupts");
        assert_eq!(features.alongside_edges, left_out, "{features:?}");
        let (result, report) = removed_where(&mesh, &rules, 2.0, &HOLES);
        assert_eq!((report.removed.len(), report.rejected.len()), (bores, 0), "{report:?}");
        assert_eq!((characteristic(&mesh), characteristic(&result)), (-2, 2));
        assert!((volume(&result) - 8.0).abs() < 1e-12);
    }
}

#[test]
fn bores_that_end_in_each_other_go_as_one() {
    let mesh = elbow(0.2);
    assert_eq!(validate_surface(&mesh), []);
    assert_eq!(characteristic(&mesh), 0);
    let (result, report) = removed(&mesh, 0.5, &HOLES);
    let [only] = &report.removed[..] else { panic!("{report:?}") };
    assert_eq!((only.kind, only.bores, report.rejected.len()), (Kind::ThroughHoles, 2, 0));
    assert!((only.diameter - 0.4).abs() < 1e-9, "{report:?}");
    assert_eq!(characteristic(&result), 2);
    assert!((volume(&result) - 8.0).abs() < 1e-12);
    // Where they may not go, both are listed.
    let mut held = mesh.clone();
    let is_bore = |p: &DVec3| p.abs().max_element() < 0.5;
    let bore = mesh.faces.ids().filter(|&f| mesh.corners(f).iter().any(is_bore)).collect();
    held.carried.groups.faces.insert("bore".into(), bore);
    let (marked, _) = mark_features(&held, &RULES, &Watch::silent()).expect("nobody interrupts");
    let keep = ["bore".to_owned()];
    let locks = LockRules { keep: &keep, ..LockRules::default() };
    let (same, report) = remove_features(&marked, 0.5, &HOLES, &locks, &Watch::silent()).expect("there is a bore");
    assert_eq!((same, report.removed.len()), (marked, 0));
    assert_eq!(report.rejected.iter().map(|r| r.reason).collect::<Vec<_>>(), [Reason::Locked; 2]);
}

#[test]
fn openings_that_stay_are_listed() {
    let sides = |n: usize| {
        let mut mesh = plate(&[hole(&[(0.5, 1.0), (0.5, 0.0)], true)]);
        // The rim's vertices onto the sides of a polygon, whose corners are on the circle.
        for p in mesh.points.iter_mut().filter(|p| libm::hypot(p.x, p.y) < 0.51) {
            let step = TAU / n as f64;
            let from_middle = (libm::atan2(p.y, p.x) + 1e-9).rem_euclid(step) - 0.5 * step;
            let shrunk = libm::cos(0.5 * step) / libm::cos(from_middle);
            (p.x, p.y) = (p.x * shrunk, p.y * shrunk);
        }
        mesh
    };
    for n in [4, 8] {
        let mesh = sides(n);
        let (result, report) = removed(&mesh, 1.1, &HOLES);
        assert_eq!(result.faces, mesh.faces, "{n} corners");
        assert_eq!(report.rejected.iter().map(|r| r.reason).collect::<Vec<_>>(), [Reason::NotRound]);
        assert!((0.7..1.0).contains(&report.rejected[0].diameter), "{report:?}");
    }
}

#[test]
fn bosses_go_when_asked_for_and_the_hole_in_one_first() {
    let cells = [
        hole(&[(0.4, 1.0), (0.4, 1.5), (0.0, 1.5)], false),
        hole(&[(0.5, 1.0), (0.5, 1.5), (0.2, 1.5), (0.2, 0.5), (0.0, 0.5)], false),
    ];
    let mesh = plate(&cells);
    assert_eq!(validate_surface(&mesh), []);
    assert_eq!(removed(&mesh, 1.1, &HOLES).1.removed.len(), 1);
    let (result, report) = removed(&mesh, 1.1, &[Kind::BlindHoles, Kind::Bosses]);
    assert_eq!(report.removed.len(), 3, "{report:?}");
    assert!((volume(&result) - 8.0).abs() < 1e-12);
}

#[test]
fn kept_groups_hold_their_holes_and_fills_inherit() {
    let mut mesh = plate(&[0.3, 0.4].map(|r| hole(&[(r, 1.0), (r, 0.0)], true)));
    let of = |mesh: &Surface, test: fn([DVec3; 3]) -> bool| -> Vec<FaceId> {
        mesh.faces.ids().filter(|&f| test(mesh.corners(f))).collect()
    };
    let bore = of(&mesh, |c| c.iter().all(|p| libm::hypot(p.x, p.y) < 0.31));
    let top = of(&mesh, |c| c.iter().all(|p| p.z == 1.0));
    mesh.carried.groups.faces.insert("bore".into(), bore);
    mesh.carried.groups.faces.insert("top".into(), top);
    let (marked, _) = mark_features(&mesh, &RULES, &Watch::silent()).expect("nobody interrupts");
    let keep = ["bore".to_owned()];
    let locks = LockRules { keep: &keep, ..LockRules::default() };
    let (result, report) = remove_features(&marked, 1.0, &HOLES, &locks, &Watch::silent()).expect("there is a bore");
    assert_eq!(validate_surface(&result), []);
    assert_eq!(report.removed.len(), 1);
    assert_eq!(report.rejected.iter().map(|r| r.reason).collect::<Vec<_>>(), [Reason::Locked]);
    assert_eq!(result.carried.groups.faces["bore"].len(), 2 * N);
    assert_eq!(result.carried.groups.faces["top"], of(&result, |c| c.iter().all(|p| (p.z - 1.0).abs() < 1e-12)));
    let unknown = ["lid".to_owned()];
    let locks = LockRules { only: &unknown, ..LockRules::default() };
    assert!(remove_features(&marked, 1.0, &HOLES, &locks, &Watch::silent()).is_err());
}

#[test]
fn without_marks_nothing_is_found() {
    let mesh = plate(&[hole(&[(0.3, 1.0), (0.3, 0.0)], true)]);
    let result = remove_features(&mesh, 1.0, &HOLES, &LockRules::default(), &Watch::silent()).expect("no locks");
    assert_eq!(result, (mesh, Report::default()));
}
