//! Documents as an XML reader sees them.

use super::*;
use crate::metric::Value;
use crate::metric::gate::criteria::CriteriaReport;
use crate::metric::gate::{Fault, FaultKind};
use crate::report::{FileReport, Status, StepReport, Timings};
use std::collections::BTreeMap;

fn step(name: &str, content: Option<&str>, failure: Option<StepFailure>) -> StepReport {
    StepReport {
        name: name.to_owned(),
        kind: "repair".to_owned(),
        inputs: BTreeMap::new(),
        key: None,
        content: content.map(str::to_owned),
        record: Vec::new(),
        figures: None,
        stats: None,
        failure,
        differs_from: None,
    }
}

fn row(metric: &str, passed: bool, faults: Vec<Fault>) -> GateRow {
    GateRow {
        metric: metric.to_owned(),
        limit: "at least 0.2".to_owned(),
        measured: Some(Value::Number(0.1)),
        passed,
        slack: None,
        fault_count: faults.len() as u64,
        faults,
        excused: Vec::new(),
        cause: None,
        note: None,
    }
}

fn report(steps: Vec<StepReport>, gates: Vec<GateSection>, files: Vec<FileReport>) -> Report {
    Report {
        meshmill: "1".to_owned(),
        recipe: "part".to_owned(),
        description: String::new(),
        texts: Vec::new(),
        status: Status::GateFailed,
        cases: vec![CaseReport {
            name: String::new(),
            params: BTreeMap::new(),
            inputs: BTreeMap::new(),
            steps,
            gates,
            files,
        }],
        inputs: BTreeMap::new(),
        timings: Timings::default(),
    }
}

#[test]
fn every_check_and_every_criterion_is_a_test() {
    let fault = Fault { kind: FaultKind::Face, id: 3, at: [1.0, 2.0, 3.0], value: 12.0 };
    let criterion = |metric: &str, passed, worst| CriterionRow {
        metric: metric.to_owned(),
        limits: [0.0, 5.0, 8.0, 10.0, 90.0],
        levels: if passed { [4, 0, 0, 0, 0] } else { [3, 0, 0, 1, 0] },
        value: Some(12.0),
        passed,
        worst,
        ..CriterionRow::default()
    };
    let criteria = CriteriaReport {
        name: "lab".to_owned(),
        rows: vec![criterion("warp-angle", false, vec![fault]), criterion("skew", true, Vec::new())],
        ..CriteriaReport::default()
    };
    let gate = GateSection {
        step: "fe".to_owned(),
        references: Vec::new(),
        passed: Some(false),
        rows: vec![row("min-stretch", true, Vec::new()), row("criteria lab", false, vec![fault])],
        criteria: vec![criteria],
        failures: Vec::new(),
        advice: Vec::new(),
    };
    let text = document(&report(vec![step("fe", Some("abc"), None)], vec![gate], Vec::new()));
    let xml = roxmltree::Document::parse(&text).unwrap();
    let suite = xml.descendants().find(|node| node.has_tag_name("testsuite")).unwrap();
    let count = |name| suite.attribute(name).unwrap();
    assert_eq!(["tests", "failures", "errors", "skipped"].map(count), ["5", "2", "0", "0"]);
    let failures: Vec<_> = xml.descendants().filter(|node| node.has_tag_name("failure")).collect();
    let warped = failures[1];
    assert_eq!(warped.attribute("message"), Some("worst 12, wanted at most 10°; 1 elements"));
    assert_eq!(warped.text(), Some("face 3 at (1, 2, 3): 12"));
    let test = warped.parent().unwrap();
    assert_eq!(
        (test.attribute("classname"), test.attribute("name")),
        (Some("gates.fe.criteria lab"), Some("warp-angle"))
    );
}

#[test]
fn what_failed_is_an_error_and_what_waited_for_it_is_skipped() {
    let failure = StepFailure::failed("no <triangles> & \"quads\" \u{1b}[31m\u{0}").with_help("line\nbreak");
    let gate = GateSection {
        step: "fe".to_owned(),
        references: Vec::new(),
        passed: None,
        rows: Vec::new(),
        criteria: Vec::new(),
        failures: Vec::new(),
        advice: Vec::new(),
    };
    let file = FileReport {
        path: "out/'x'.stl".to_owned(),
        step: "fe".to_owned(),
        content: None,
        failed_gate: false,
        lost: Vec::new(),
        note: None,
        failure: Some(failure.clone()),
    };
    let steps = vec![step("clean", None, Some(failure)), step("fe", None, None)];
    let text = document(&report(steps, vec![gate], vec![file]));
    let xml = roxmltree::Document::parse(&text).unwrap();
    let root = xml.root_element();
    let count = |name| root.attribute(name).unwrap();
    assert_eq!(["tests", "failures", "errors", "skipped"].map(count), ["4", "0", "2", "2"]);
    let error = xml.descendants().find(|node| node.has_tag_name("error")).unwrap();
    assert!(error.attribute("message").unwrap().starts_with("no <triangles> & \"quads\""));
    assert_eq!(error.text(), Some("line\nbreak"));
}
