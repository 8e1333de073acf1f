//! What a golden file of a step holds, and the check that no step goes without.

use std::collections::BTreeMap;

use meshmill::metric::{self, Value};
use meshmill::step::{Artifact, Produced};
use meshmill::watch::Watch;
use serde::Serialize;

use crate::snapshot::assert_golden;
use crate::step::{run_locked, step};

/// The metrics that say most; all of them are in the golden files of `measure` and of the pipelines.
const TOLD: [&str; 16] = [
    "vertices",
    "faces",
    "components",
    "boundary-loops",
    "euler-characteristic",
    "closed",
    "manifold",
    "oriented",
    "self-intersections",
    "area",
    "volume",
    "min-stretch",
    "mean-stretch",
    "max-size",
    "max-valence",
    "distance",
];

#[derive(Serialize)]
struct Golden<'a> {
    revision: u32,
    parameters: &'a str,
    statistics: &'a serde_json::Value,
    groups: Vec<String>,
    metrics: BTreeMap<String, Value>,
}

/// Runs a step on the input `from` and compares what it says and what it made with `tests/snapshots/steps`.
pub(super) fn golden(name: &str, case: &str, parameters: &str, from: &Artifact) -> Produced<serde_json::Value> {
    golden_of(name, case, parameters, "", &[("from", from.clone())])
}

/// The same with locks and any inputs.
pub(super) fn golden_of(
    name: &str,
    case: &str,
    parameters: &str,
    locks: &str,
    inputs: &[(&'static str, Artifact)],
) -> Produced<serde_json::Value> {
    let made = run_locked(name, "main", parameters, locks, inputs).unwrap_or_else(|e| panic!("{name} {case}: {e}"));
    let (mut groups, mut metrics) = (Vec::new(), BTreeMap::new());
    if let Artifact::Metrics(table) = &made.artifact {
        metrics.clone_from(&table.values);
    } else if let Some(mesh) = made.artifact.to_soup() {
        groups = mesh.carried.groups.list().map(|(kind, name, count)| format!("{kind} {name}: {count}")).collect();
        let reference = inputs[0].1.to_soup().filter(|reference| !reference.faces.is_empty());
        metrics = metric::measure(&mesh, reference.as_deref(), &Watch::silent()).expect("not cancelled").values;
        metrics.retain(|name, _| TOLD.contains(&name.as_str()));
    }
    let (revision, statistics) = (step(name).revision, &made.stats);
    assert_golden(
        "steps",
        &format!("{name}-{}", case.replace(' ', "-")),
        &Golden { revision, parameters, statistics, groups, metrics },
    );
    made
}

#[test]
fn every_step_is_tested() {
    let list = include_str!("../steps.rs");
    for step in meshmill::steps::CATALOG {
        let stem = step.name.replace('-', "_");
        assert!(list.contains(&format!("    mod {stem};")), "step `{}` has no tests/steps/{stem}.rs", step.name);
    }
}
