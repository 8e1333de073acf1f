//! `run.ron`: what a run did, kept beside its files; and what `plan` needs to know of it again.

use std::collections::BTreeMap;

use ron::ser::PrettyConfig;
use serde::Deserialize;

use super::Report;
use super::sweep::SweepTable;

/// The text of `run.ron`.
pub fn to_ron(report: &Report) -> Result<String, ron::Error> {
    let config = PrettyConfig::default().struct_names(false).indentor("  ").separate_tuple_members(false);
    Ok(ron::ser::to_string_pretty(report, config)? + "\n")
}

/// The report that a `run.ron` holds.
pub fn from_ron(text: &str) -> Result<Report, ron::error::SpannedError> {
    ron::from_str(text)
}

/// The table that a `sweep.ron` holds.
pub fn sweep_from_ron(text: &str) -> Result<SweepTable, ron::error::SpannedError> {
    ron::from_str(text)
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::{CaseReport, Status, StepReport, Timings};
    use crate::run::TaskState;

    #[test]
    fn a_record_is_read_as_it_was_written() {
        let step = StepReport {
            name: "fe".to_owned(),
            kind: "repair".to_owned(),
            inputs: BTreeMap::from([("from".to_owned(), "raw".to_owned())]),
            key: Some("ab".to_owned()),
            record: vec![("step".to_owned(), "repair".to_owned())],
            content: None,
            figures: Some(crate::run::Figures { port: "surface".to_owned(), faces: Some(12), ..Default::default() }),
            stats: Some(serde_json::json!({"a": [1, 2.5, null, true], "b": {"c": "text"}, "d": -3})),
            failure: Some(crate::step::StepFailure::failed("no \"way\"").with_help("try")),
            differs_from: None,
        };
        let case = CaseReport {
            name: String::new(),
            params: BTreeMap::from([("size".to_owned(), "2%".to_owned())]),
            inputs: BTreeMap::from([("part".to_owned(), "a.stl".to_owned())]),
            steps: vec![step],
            gates: Vec::new(),
            files: Vec::new(),
        };
        let tasks = BTreeMap::from([("fe".to_owned(), (TaskState::Cached, 0.25))]);
        let report = Report {
            meshmill: "1".to_owned(),
            recipe: "part".to_owned(),
            description: String::new(),
            texts: vec![("part.toml".to_owned(), "name = \"part\"\n".to_owned())],
            status: Status::StepFailed,
            cases: vec![case],
            inputs: BTreeMap::from([("a.stl".to_owned(), None)]),
            timings: Timings {
                total: 1.5,
                tasks,
                files: BTreeMap::new(),
                ran: BTreeMap::from([("repair".to_owned(), 1)]),
                memory: BTreeMap::from([("fe".to_owned(), crate::run::Peak { bytes: 12, alone: true })]),
            },
        };
        assert_eq!(from_ron(&to_ron(&report).unwrap()).unwrap(), report);
    }
}
