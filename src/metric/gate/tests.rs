//! Verdicts, excused faces, limits in percent and against a reference, on a mesh with one needle.

use glam::{DVec3, dvec3};

use super::*;
use crate::mesh::{EdgeMark, FaceId, Facet, Freedom, MarkCause, Soup, VertexId, edge_key};
use crate::metric::Value;
use crate::watch::Watch;

/// A good triangle, and a needle of 4 degrees at the origin whose two long edges are vertices 0-3 and 0-4.
fn with_needle() -> Soup {
    let theta = 4.0_f64.to_radians();
    let points = vec![
        DVec3::ZERO,
        DVec3::X,
        dvec3(0.5, 0.8, 0.0),
        dvec3(-1.0, 0.0, 0.0),
        dvec3(-libm::cos(theta), -libm::sin(theta), 0.0),
    ];
    let tri = |t: [u32; 3]| Facet::Tri(t.map(VertexId::from_raw));
    Soup { points: points.into(), faces: vec![tri([0, 1, 2]), tri([0, 3, 4])].into(), ..Soup::default() }
}

fn check(metric: &str) -> Check {
    Check { metric: metric.to_owned(), ..Check::default() }
}

fn at_least(metric: &str, limit: f64) -> Check {
    Check { at_least: Some(Limit::Number(limit)), ..check(metric) }
}

fn one(mesh: &Soup, reference: Option<&Soup>, check: Check) -> GateRow {
    let report = evaluate(mesh, reference, &[check], &Watch::silent()).expect("can be judged");
    assert_eq!(report.passed(), report.rows[0].passed);
    report.rows.into_iter().next().expect("one row")
}

#[test]
fn a_low_face_fails_and_is_named() {
    let row = one(&with_needle(), None, at_least("min-stretch", 0.2));
    assert!(!row.passed && row.fault_count == 1 && row.excused.is_empty());
    assert_eq!((row.faults[0].kind, row.faults[0].id), (FaultKind::Face, 1));
    assert!(row.slack.is_some_and(|s| s < 0.0));
}

#[test]
fn a_face_between_marked_edges_is_excused_below_the_angle_of_the_threshold() {
    let mut mesh = with_needle();
    let mark = EdgeMark { freedom: Freedom::OnCurve, cause: MarkCause::Feature };
    for end in [3, 4] {
        mesh.carried.mark(edge_key(VertexId::from_raw(0), VertexId::from_raw(end)), mark);
    }
    let row = one(&mesh, None, at_least("min-stretch", 0.2));
    assert!(row.passed && row.fault_count == 0);
    assert_eq!(row.excused.len(), 1);
    assert!(row.note.as_deref().is_some_and(|n| n.contains("7.0") && n.contains("1 face")), "{:?}", row.note);
    assert!(matches!(row.measured, Some(Value::Number(m)) if m > 0.7));
    // At a threshold of 0.1 an angle of 4 degrees is enough for a good face: this one has 0.119.
    let loose = one(&mesh, None, at_least("min-stretch", 0.1));
    assert!(loose.passed && loose.excused.is_empty());
}

#[test]
fn where_the_faces_at_fault_lie_is_told() {
    let mut mesh = with_needle();
    let mark = EdgeMark { freedom: Freedom::OnCurve, cause: MarkCause::Feature };
    let low = at_least("min-stretch", 0.2);
    assert_eq!(one(&mesh, None, low.clone()).cause, None);
    // From the curve along 0-3 to one that passes through vertex 4.
    for ends in [[0, 3], [4, 1]] {
        mesh.carried.mark(edge_key(VertexId::from_raw(ends[0]), VertexId::from_raw(ends[1])), mark);
    }
    assert_eq!(one(&mesh, None, low).cause, Some(Cause::BetweenCurves(1)));
    mesh.carried.mark(edge_key(VertexId::from_raw(3), VertexId::from_raw(4)), mark);
    assert_eq!(one(&mesh, None, at_least("min-stretch", 0.12)).cause, Some(Cause::AtCurves(1)));
}

#[test]
fn one_marked_edge_is_no_excuse() {
    let mut mesh = with_needle();
    let mark = EdgeMark { freedom: Freedom::Keep, cause: MarkCause::Locked };
    mesh.carried.mark(edge_key(VertexId::from_raw(0), VertexId::from_raw(3)), mark);
    assert!(!one(&mesh, None, at_least("min-stretch", 0.2)).passed);
}

#[test]
fn excepted_groups_are_not_judged() {
    let mut mesh = with_needle();
    mesh.carried.groups.faces.insert("rim".to_owned(), vec![FaceId::from_raw(1)]);
    let row = one(&mesh, None, Check { except: vec!["rim".to_owned()], ..at_least("min-stretch", 0.2) });
    assert!(row.passed);
    assert!(row.note.is_some_and(|n| n.contains("excepted")));
}

#[test]
fn properties_name_the_faces_at_fault() {
    let closed = Check { equals: Some(Limit::Flag(true)), ..check("closed") };
    let row = one(&with_needle(), None, closed);
    assert_eq!((row.passed, row.measured, row.fault_count), (false, Some(Value::Flag(false)), 2));
    assert_eq!(row.limit, "true");
}

#[test]
fn percents_are_of_the_diagonal_of_the_mesh_compared_with() {
    let mesh = with_needle();
    let mut far = mesh.clone();
    for p in &mut far.points {
        p.z += 0.1;
    }
    let ask = |percent: f64| {
        let limit = Some(Limit::Percent(percent));
        let reference = Some("clean".to_owned());
        one(&far, Some(&mesh), Check { at_most: limit, reference, ..check("distance") })
    };
    assert!(ask(10.0).passed);
    let fails = ask(4.0);
    assert!(!fails.passed && fails.fault_count == 4);
    assert!(matches!(fails.measured, Some(Value::Number(d)) if (d - 0.1).abs() < 1e-12));
    assert!(fails.faults.iter().any(|f| f.kind == FaultKind::ReferenceFace));
}

#[test]
fn a_value_is_compared_with_that_of_the_reference() {
    let mesh = with_needle();
    let same = Check { same_as_reference: true, ..check("euler-characteristic") };
    assert!(one(&mesh, Some(&mesh), same.clone()).passed);
    let mut less = mesh.clone();
    less.faces = vec![mesh.faces.as_slice()[0]].into();
    less.carried.groups.faces.insert("rim".to_owned(), Vec::new());
    let more = Check { no_more_than_reference: true, ..check("faces") };
    assert!(one(&less, Some(&mesh), more.clone()).passed);
    assert!(!one(&mesh, Some(&less), more).passed);
    assert_eq!(
        evaluate(&mesh, None, &[same], &Watch::silent()),
        Err(GateError::NoReference("euler-characteristic".to_owned()))
    );
}

#[test]
fn lost_groups_are_named() {
    let mesh = with_needle();
    let mut named = mesh.clone();
    named.carried.groups.faces.insert("Inlet".to_owned(), vec![FaceId::from_raw(0)]);
    let kept = Check { equals: Some(Limit::Flag(true)), ..check("groups-kept") };
    assert!(one(&named, Some(&named), kept.clone()).passed);
    let row = one(&mesh, Some(&named), kept);
    assert!(!row.passed && row.note.is_some_and(|n| n.contains("Inlet")));
}

#[test]
fn without_an_element_nothing_fails_but_an_unknown_metric_does() {
    let row = one(&with_needle(), None, at_least("min-scaled-jacobian", 0.5));
    assert!(row.passed && row.measured.is_none() && row.note.is_some());
    assert_eq!(
        evaluate(&with_needle(), None, &[check("no-such")], &Watch::silent()),
        Err(GateError::UnknownMetric("no-such".to_owned()))
    );
}

#[test]
fn a_check_of_a_count_that_stopped_fails_and_says_so() {
    // Triangles in one plane, each over all others: more pairs than are counted.
    let count = 1500;
    let at = |i: u32| f64::from(i) / 1e4;
    let points =
        (0..count).flat_map(|i| [dvec3(at(i), 0.0, 0.0), dvec3(1.0 + at(i), 0.0, 0.0), dvec3(at(i), 1.0, 0.0)]);
    let face = |i: u32| Facet::Tri([3 * i, 3 * i + 1, 3 * i + 2].map(VertexId::from_raw));
    let mesh =
        Soup { points: points.collect::<Vec<_>>().into(), faces: (0..count).map(face).collect(), ..Soup::default() };
    let limit = Some(Limit::Number(1e9));
    let row = one(&mesh, None, Check { at_most: limit, ..check("self-intersections") });
    assert_eq!((row.passed, row.measured), (false, Some(Value::AtLeast(1_000_000))));
    assert!(row.note.as_deref().is_some_and(|note| note.contains("counting stopped")), "{:?}", row.note);
    let same = one(&mesh, Some(&mesh), Check { no_more_than_reference: true, ..check("self-intersections") });
    assert!(!same.passed && same.limit.contains('≥'), "{}", same.limit);
}

#[test]
fn crossings_are_compared_with_those_of_the_reference_by_place() {
    // Two sheets that run through each other, cut into so many strips across.
    let sheets = |count: u32, tilt: f64| {
        let mut mesh = Soup::default();
        for upright in [false, true] {
            let base = mesh.points.len() as u32;
            for at in 0..=count {
                let along = f64::from(at) / f64::from(count);
                for side in [-0.4, 0.6] {
                    let point = if upright { dvec3(tilt, along, side) } else { dvec3(side, along, 0.0) };
                    mesh.points.push(point);
                }
            }
            for at in 0..count {
                let corner = |n: u32| VertexId::from_raw(base + 2 * at + n);
                mesh.faces.push(Facet::Quad([corner(0), corner(1), corner(3), corner(2)]));
            }
        }
        mesh
    };
    let no_more = || Check { no_more_than_reference: true, ..check("self-intersections") };
    let (coarse, fine) = (sheets(1, 0.0), sheets(9, 0.0));
    let row = one(&fine, Some(&coarse), no_more());
    assert!(row.passed && row.fault_count == 0, "{row:?}");
    assert!(row.note.as_deref().is_some_and(|note| note.starts_with("along the crossings")), "{row:?}");
    let elsewhere = one(&sheets(9, 0.1), Some(&coarse), no_more());
    assert!(!elsewhere.passed && elsewhere.fault_count > 8 && !elsewhere.faults.is_empty(), "{elsewhere:?}");
    // A number given is a number.
    let at_most = Check { at_most: Some(Limit::Number(1.0)), ..check("self-intersections") };
    assert!(!one(&fine, Some(&coarse), at_most).passed);
}
