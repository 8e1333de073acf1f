//! Penalties, classes and indices of known elements.

use super::*;
use crate::mesh::{Facet, Soup, VertexId};
use crate::watch::Watch;
use glam::{DVec3, dvec3};

fn soup(points: &[DVec3], faces: &[&[u32]]) -> Soup {
    let facet = |face: &&[u32]| match face {
        [a, b, c] => Facet::Tri([*a, *b, *c].map(VertexId::from_raw)),
        [a, b, c, d] => Facet::Quad([*a, *b, *c, *d].map(VertexId::from_raw)),
        other => panic!("{other:?}"),
    };
    let faces: Vec<Facet> = faces.iter().map(facet).collect();
    Soup { points: points.to_vec().into(), faces: faces.into(), ..Soup::default() }
}

fn criterion(metric: &str, levels: [f64; 5], weight: f64) -> Criterion {
    Criterion { metric: metric.to_owned(), levels: levels.map(Limit::Number), weight }
}

fn standard(criteria: Vec<Criterion>) -> Criteria {
    Criteria { name: "lab".to_owned(), penalties: PENALTIES, criteria, except: Vec::new() }
}

fn judged(mesh: &Soup, criteria: &Criteria) -> (CriteriaReport, GateRow) {
    judge(&Subject::new(mesh, None, &Watch::silent()), criteria).unwrap()
}

/// Rectangles of height 1 in a row, with these lengths, so that their edge ratio is known.
fn strip(lengths: &[f64]) -> Soup {
    let (mut points, mut x) = (vec![DVec3::ZERO, DVec3::Y], 0.0);
    let mut faces = Vec::new();
    for (i, length) in (0_u32..).zip(lengths) {
        x += length;
        points.extend([dvec3(x, 0.0, 0.0), dvec3(x, 1.0, 0.0)]);
        faces.push([2 * i, 2 * i + 2, 2 * i + 3, 2 * i + 1]);
    }
    soup(&points, &faces.iter().map(<[u32; 4]>::as_slice).collect::<Vec<_>>())
}

#[test]
fn penalties_are_linear_between_the_levels() {
    for (direction, sign) in [(Direction::Lower, 1.0), (Direction::Higher, -1.0)] {
        let scale = Scale::new(direction, [1.0, 2.0, 4.0, 5.0, 10.0].map(|limit| sign * limit), PENALTIES);
        let expected = [
            (0.5, 0.0, 0),
            (2.0, 0.0, 0),
            (3.0, 0.4, 1),
            (4.0, 0.8, 1),
            (4.5, 0.9, 2),
            (5.0, 1.0, 2),
            (7.5, 5.5, 3),
            (10.0, 10.0, 3),
            (11.0, 10.0, 4),
            (f64::INFINITY, 10.0, 4),
        ];
        for (value, penalty, level) in expected {
            assert!((scale.penalty(sign * value) - penalty).abs() < 1e-12, "{value}");
            assert_eq!(scale.level(sign * value), level, "{value}");
        }
        assert_eq!((scale.penalty(f64::NAN), scale.level(f64::NAN)), (10.0, 4));
    }
}

#[test]
fn levels_that_fall_together_are_steps() {
    let scale = Scale::new(Direction::Lower, [3.0; 5], PENALTIES);
    assert_eq!([2.0, 3.0, 3.1].map(|v| (scale.level(v), scale.penalty(v))), [(0, 0.0), (0, 0.0), (4, 10.0)]);
    let scale = Scale::new(Direction::Higher, [1.0, 1.0, 0.5, 0.5, 0.0], PENALTIES);
    assert_eq!(scale.level(0.4), 3);
    assert!((scale.penalty(0.25) - 5.5).abs() < 1e-12);
}

#[test]
fn the_index_of_a_mesh_is_that_of_the_formula() {
    let mesh = strip(&[1.0, 3.0, 4.0, 7.5]);
    let ratio = criterion("edge-ratio", [1.0, 2.0, 4.0, 5.0, 10.0], 2.0);
    let skew = criterion("skew", [0.0, 10.0, 35.0, 45.0, 70.0], 1.0);
    let (report, row) = judged(&mesh, &standard(vec![ratio, skew]));
    let [edges, skew] = report.rows.as_slice() else { panic!() };
    // Penalties 0, 0.4, 0.8 pass and 5.5 fails.
    assert!((edges.quality_index - (0.4 + 5.5)).abs() < 1e-12);
    assert_eq!((edges.levels, edges.passed), ([1, 2, 0, 1, 0], false));
    assert_eq!((skew.quality_index, skew.levels, skew.passed), (0.0, [4, 0, 0, 0, 0], true));
    // The criterion that holds is averaged, the other counts with its weight.
    assert!((report.quality_index - 2.0 * 5.9).abs() < 1e-12);
    assert_eq!(report.levels, [1, 2, 0, 1, 0]);
    let worst = edges.worst.first().unwrap();
    assert_eq!((worst.id, worst.at), (3, [11.75, 0.5, 0.0]));
    assert!((worst.value - 7.5).abs() < 1e-9 && edges.worst.len() == 4);
    // Of the element: skew passes with 0, the edge ratio fails with 2 · 5.5.
    assert!((report.worst.unwrap().value - 11.0).abs() < 1e-9);
    assert_eq!((row.passed, row.fault_count, row.faults.len(), row.faults[0].id), (false, 1, 1, 3));
    assert!(row.note.unwrap().contains("failing: edge-ratio"));
}

#[test]
fn a_mesh_within_all_levels_has_a_weighted_mean() {
    let mesh = strip(&[3.0, 3.0]);
    let ratio = criterion("edge-ratio", [1.0, 2.0, 4.0, 5.0, 10.0], 3.0);
    let skew = criterion("skew", [0.0, 10.0, 35.0, 45.0, 70.0], 1.0);
    let (report, row) = judged(&mesh, &standard(vec![ratio, skew]));
    assert!((report.quality_index - 3.0 * 0.4 / 4.0).abs() < 1e-12);
    assert!(row.passed && row.faults.is_empty());
}

#[test]
fn triangles_and_quads_are_judged_by_what_is_theirs() {
    let points = [DVec3::ZERO, DVec3::X, dvec3(1.0, 1.0, 0.0), DVec3::Y, dvec3(1.9, 0.1, 0.0)];
    let mesh = soup(&points, &[&[0, 1, 2, 3], &[1, 4, 2]]);
    let criteria = standard(vec![
        criterion("min-tria-angle", [60.0, 50.0, 30.0, 20.0, 0.0], 1.0),
        criterion("max-quad-angle", [90.0, 110.0, 125.0, 135.0, 180.0], 1.0),
        criterion("triangle-share", [0.0, 0.1, 0.2, 0.4, 1.0], 1.0),
    ]);
    let (report, row) = judged(&mesh, &criteria);
    let counts: Vec<u64> = report.rows.iter().map(|row| row.levels.iter().sum()).collect();
    assert_eq!(counts, [1, 1, 1]);
    let share = &report.rows[2];
    assert_eq!((share.value, share.passed, share.worst.len()), (Some(0.5), false, 0));
    // No face is at fault for the share of triangles, and the standard fails all the same.
    assert_eq!((row.passed, row.fault_count), (false, 0));
}

#[test]
fn a_degenerate_element_is_the_worst_and_can_be_stored() {
    let mesh = soup(&[DVec3::ZERO, DVec3::X, 2.0 * DVec3::X], &[&[0, 1, 2]]);
    let (report, row) = judged(&mesh, &standard(vec![criterion("stretch", [1.0, 0.5, 0.3, 0.2, 0.0], 1.0)]));
    assert_eq!((report.rows[0].levels, report.quality_index), ([0, 0, 0, 0, 1], 10.0));
    assert!(report.rows[0].value.is_some_and(is_undefined));
    let json = serde_json::to_string(&report).unwrap();
    assert_eq!(serde_json::from_str::<CriteriaReport>(&json).unwrap(), report);
    assert_eq!(serde_json::from_str::<GateRow>(&serde_json::to_string(&row).unwrap()).unwrap(), row);
}

#[test]
fn nothing_to_judge_passes_and_says_so() {
    let criteria = standard(vec![criterion("stretch", [1.0, 0.5, 0.3, 0.2, 0.0], 1.0)]);
    let (report, row) = judged(&Soup::default(), &criteria);
    assert_eq!((report.quality_index, report.worst, report.levels), (0.0, None, [0; 5]));
    assert!(row.passed && row.note.unwrap().contains("no element to judge"));
}

#[test]
fn groups_can_be_excepted_and_a_reference_is_asked_for() {
    let mut mesh = strip(&[1.0, 9.0]);
    let ratio = criterion("edge-ratio", [1.0, 2.0, 4.0, 5.0, 10.0], 1.0);
    let mut criteria = standard(vec![ratio]);
    assert!(!judged(&mesh, &criteria).1.passed);
    mesh.carried.groups.faces.insert("bolts".to_owned(), vec![crate::mesh::FaceId::from_raw(1)]);
    criteria.except = vec!["bolts".to_owned()];
    let (report, row) = judged(&mesh, &criteria);
    assert!(row.passed && report.levels == [1, 0, 0, 0, 0]);
    let deviation = standard(vec![criterion("chordal-deviation", [0.0, 0.1, 0.2, 0.3, 1.0], 1.0)]);
    let watch = Watch::silent();
    let error = judge(&Subject::new(&mesh, None, &watch), &deviation).unwrap_err();
    assert_eq!(error, CriteriaError::NoReference("chordal-deviation".to_owned()));
    let above = Soup { points: mesh.points.iter().map(|p| *p + 0.25 * DVec3::Z).collect(), ..mesh.clone() };
    let (report, _) = judge(&Subject::new(&above, Some(&mesh), &watch), &deviation).unwrap();
    assert!(report.rows[0].value.is_some_and(|value| (value - 0.25).abs() < 1e-12));
    assert_eq!(report.rows[0].levels, [0, 0, 2, 0, 0]);
}

#[test]
fn percents_are_of_the_diagonal() {
    let mesh = strip(&[3.0]);
    let levels = [50.0, 60.0, 70.0, 96.0, 200.0].map(Limit::Percent);
    let length = Criterion { metric: "max-length".to_owned(), levels, weight: 1.0 };
    let (report, _) = judged(&mesh, &standard(vec![length]));
    let diagonal = 10.0_f64.sqrt();
    assert!((report.rows[0].limits[0] - 0.5 * diagonal).abs() < 1e-12);
    // 3 lies between 70 and 96 % of 3.162.
    assert_eq!(report.rows[0].levels, [0, 0, 1, 0, 0]);
}
