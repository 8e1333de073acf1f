//! A run as JUnit XML, which continuous-integration systems show as tests: a suite a case, a test a check.
//!
//! # Algorithm
//! Every row of a gate is a test, and so is every criterion behind a row of criteria; a check that does not hold is a
//! `failure`, with the worst elements as its text. A step, gate or output that could not be made is a test with an
//! `error`; a gate that was not decided for that reason is `skipped`.
//!
//! # Source
//! The format that Jenkins and GitLab read: `testsuites`, `testsuite`, `testcase`, with the counts as attributes.
//!
//! # Invariants
//! - Equal results give equal bytes: there are no seconds and no dates here.
//! - Every text from outside is escaped, and what XML 1.0 cannot hold is replaced.

use std::fmt::Write;

use super::measure::value_text;
use super::table::criteria::{limit, number, place, value};
use super::{CaseReport, GateSection, Report};
use crate::metric::gate::GateRow;
use crate::metric::gate::criteria::{CriterionRow, row_name};
use crate::run::in_case;
use crate::step::StepFailure;

/// Elements that a failure names.
const NAMED: usize = 12;

/// A test.
struct Test {
    class: String,
    name: String,
    outcome: Outcome,
}

enum Outcome {
    Passed,
    /// A check does not hold: what was wanted, and where.
    Failed(String, String),
    /// Something could not be made.
    Error(String, String),
    Skipped(&'static str),
}

/// The report as a document.
pub fn document(report: &Report) -> String {
    let suites: Vec<(String, Vec<Test>)> =
        report.cases.iter().map(|case| (suite_name(report, case), tests(case))).collect();
    let all = || suites.iter().flat_map(|(_, tests)| tests);
    let mut page = String::from("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n");
    // Writing to a string cannot fail.
    let _ = writeln!(page, "<testsuites name=\"{}\"{}>", escape(&report.recipe), counts(all()));
    for (name, tests) in &suites {
        let _ = writeln!(page, "  <testsuite name=\"{}\"{}>", escape(name), counts(tests.iter()));
        for test in tests {
            write_test(&mut page, test);
        }
        page.push_str("  </testsuite>\n");
    }
    page.push_str("</testsuites>\n");
    page
}

fn suite_name(report: &Report, case: &CaseReport) -> String {
    in_case(&report.recipe, &case.name).trim_end_matches('/').to_owned()
}

fn counts<'a>(tests: impl Iterator<Item = &'a Test> + Clone) -> String {
    let count = |is: fn(&Outcome) -> bool| tests.clone().filter(|test| is(&test.outcome)).count();
    format!(
        " tests=\"{}\" failures=\"{}\" errors=\"{}\" skipped=\"{}\"",
        count(|_| true),
        count(|outcome| matches!(outcome, Outcome::Failed(..))),
        count(|outcome| matches!(outcome, Outcome::Error(..))),
        count(|outcome| matches!(outcome, Outcome::Skipped(_))),
    )
}

fn tests(case: &CaseReport) -> Vec<Test> {
    let error = |class: &str, name: String, failure: &StepFailure| Test {
        class: class.to_owned(),
        name,
        outcome: Outcome::Error(failure.message.clone(), failure.help.clone().unwrap_or_default()),
    };
    let steps = case.steps.iter().map(|step| match &step.failure {
        Some(failure) => error("steps", step.name.clone(), failure),
        None if step.content.is_some() => {
            Test { class: "steps".to_owned(), name: step.name.clone(), outcome: Outcome::Passed }
        }
        None => Test {
            class: "steps".to_owned(),
            name: step.name.clone(),
            outcome: Outcome::Skipped("a step before it failed, or it was not asked for"),
        },
    });
    let mut tests: Vec<Test> = steps.collect();
    tests.extend(case.gates.iter().flat_map(gate));
    let files = case.files.iter().filter_map(|file| Some((file, file.failure.as_ref()?)));
    tests.extend(files.map(|(file, failure)| error("outputs", file.path.clone(), failure)));
    tests
}

fn gate(gate: &GateSection) -> Vec<Test> {
    let class = format!("gates.{}", gate.step);
    let mut tests = Vec::new();
    for row in &gate.rows {
        let criteria = gate.criteria.iter().find(|criteria| row_name(&criteria.name) == row.metric);
        let outcome = if row.passed { Outcome::Passed } else { failed(row) };
        tests.push(Test { class: class.clone(), name: row.metric.clone(), outcome });
        for criterion in criteria.iter().flat_map(|criteria| &criteria.rows) {
            let outcome = if criterion.passed { Outcome::Passed } else { criterion_failed(criterion) };
            tests.push(Test { class: format!("{class}.{}", row.metric), name: criterion.metric.clone(), outcome });
        }
    }
    for failure in &gate.failures {
        let outcome = Outcome::Error(failure.message.clone(), failure.help.clone().unwrap_or_default());
        tests.push(Test { class: class.clone(), name: "gate".to_owned(), outcome });
    }
    if gate.passed.is_none() && gate.failures.is_empty() {
        tests.push(Test { class, name: "gate".to_owned(), outcome: Outcome::Skipped("it could not be decided") });
    }
    tests
}

fn failed(row: &GateRow) -> Outcome {
    let measured = row.measured.as_ref().map_or_else(|| "undefined".to_owned(), value_text);
    let mut text = row.note.clone().unwrap_or_default();
    for fault in row.faults.iter().take(NAMED) {
        let _ = write!(text, "\n{}: {}", place(fault), number(fault.value));
    }
    Outcome::Failed(format!("measured {measured}, wanted {}; {} elements", row.limit, row.fault_count), text)
}

fn criterion_failed(row: &CriterionRow) -> Outcome {
    let count = row.levels[3] + row.levels[4];
    let lines: Vec<String> =
        row.worst.iter().take(NAMED).map(|fault| format!("{}: {}", place(fault), number(fault.value))).collect();
    let value = value(row);
    Outcome::Failed(format!("worst {value}, wanted {}; {count} elements", limit(row)), lines.join("\n"))
}

fn write_test(page: &mut String, test: &Test) {
    let (class, name) = (escape(&test.class), escape(&test.name));
    let _ = write!(page, "    <testcase classname=\"{class}\" name=\"{name}\"");
    let _ = match &test.outcome {
        Outcome::Passed => writeln!(page, "/>"),
        Outcome::Skipped(why) => writeln!(page, ">\n      <skipped message=\"{why}\"/>\n    </testcase>"),
        Outcome::Failed(message, text) => element(page, ("failure", "gate"), message, text),
        Outcome::Error(message, text) => element(page, ("error", "step"), message, text),
    };
}

fn element(page: &mut String, (tag, kind): (&str, &str), message: &str, text: &str) -> std::fmt::Result {
    let (message, text) = (escape(message), escape(text.trim()));
    writeln!(page, ">\n      <{tag} type=\"{kind}\" message=\"{message}\">{text}</{tag}>\n    </testcase>")
}

/// The text with what means something in XML written out, and without what XML 1.0 cannot hold.
fn escape(text: &str) -> String {
    let mut safe = String::with_capacity(text.len());
    for letter in text.chars() {
        match letter {
            '&' => safe.push_str("&amp;"),
            '<' => safe.push_str("&lt;"),
            '>' => safe.push_str("&gt;"),
            '"' => safe.push_str("&quot;"),
            '\'' => safe.push_str("&apos;"),
            '\n' => safe.push_str("&#10;"),
            '\u{fffe}' | '\u{ffff}' => safe.push('\u{fffd}'),
            other if other.is_control() => safe.push('\u{fffd}'),
            other => safe.push(other),
        }
    }
    safe
}

#[cfg(test)]
mod tests;
