//! `run.ron`: what a run did, kept beside its files; and what `plan` needs to know of it again.

use std::collections::BTreeMap;

use ron::ser::PrettyConfig;
use serde::Deserialize;

use super::Report;

/// The text of `run.ron`.
pub fn to_ron(report: &Report) -> Result<String, ron::Error> {
    let config = PrettyConfig::default().struct_names(false).indentor("  ").separate_tuple_members(false);
    Ok(ron::ser::to_string_pretty(report, config)? + "\n")
}

/// The keys of an earlier run, by step name. A text that is no record of a run gives none.
pub fn keys(text: &str) -> BTreeMap<String, String> {
    let Ok(record) = ron::from_str::<Record>(text) else { return BTreeMap::new() };
    let steps = record.cases.into_iter().rev().flat_map(|case| case.steps);
    steps.filter_map(|step| Some((step.name, step.key?))).collect()
}

#[derive(Deserialize)]
struct Record {
    cases: Vec<RecordedCase>,
}

#[derive(Deserialize)]
struct RecordedCase {
    steps: Vec<RecordedStep>,
}

#[derive(Deserialize)]
struct RecordedStep {
    name: String,
    key: Option<String>,
}
