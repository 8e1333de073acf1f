//! Reports as aligned tables for a terminal.

pub mod criteria;

use std::fmt::Write;

use comfy_table::{CellAlignment, Table};

use super::measure::{number_text, rows, value_text};
use super::{CaseReport, FileReport, Report, in_case};
use crate::metric::Measurement;
use crate::run::{Figures, FileState, TaskState};
use crate::terminal::printable;

/// The whole report: steps, metrics, gates and files of every case.
pub fn report(report: &Report) -> String {
    let mut parts = Vec::new();
    for case in &report.cases {
        if !case.name.is_empty() {
            parts.push(case.name.clone());
        }
        parts.push(steps(case, report));
        for (name, metrics) in case.measurements() {
            parts.push(format!("{name}\n{}", measurement(metrics)));
        }
        if !case.gates.is_empty() {
            parts.push(gates(case));
        }
        for (gate, criteria) in case.gates.iter().flat_map(|gate| gate.criteria.iter().map(move |c| (gate, c))) {
            parts.push(criteria::table(criteria, Some(&gate.step)));
        }
        if !case.files.is_empty() {
            parts.push(files(case, report));
        }
    }
    parts.retain(|part| !part.is_empty());
    parts.join("\n\n")
}

/// A table of metrics.
pub fn measurement(metrics: &Measurement) -> String {
    let mut table = plain(&[]);
    for [name, value, unit] in rows(metrics) {
        add(&mut table, [name, value, unit]);
    }
    align(&mut table, &[1]);
    text(&table)
}

fn steps(case: &CaseReport, report: &Report) -> String {
    let mut table = plain(&["step", "kind", "state", "seconds", "faces", "min stretch", "mean stretch"]);
    for step in &case.steps {
        let (state, seconds) =
            report.timings.tasks.get(&in_case(&case.name, &step.name)).copied().unwrap_or((TaskState::Cached, 0.0));
        let figures = step.figures.clone().unwrap_or_default();
        let seconds = if step.figures.is_some() { format!("{seconds:.2}") } else { String::new() };
        add(
            &mut table,
            [
                step.name.clone(),
                step.kind.clone(),
                state_text(state).to_owned(),
                seconds,
                figures.faces.map(grouped).unwrap_or_default(),
                figures.min_stretch.map(|value| format!("{value:.3}")).unwrap_or_default(),
                figures.mean_stretch.map(|value| format!("{value:.3}")).unwrap_or_default(),
            ],
        );
    }
    align(&mut table, &[3, 4, 5, 6]);
    text(&table)
}

fn gates(case: &CaseReport) -> String {
    let mut table = plain(&["gate", "metric", "limit", "measured", "verdict"]);
    // Writing to a string cannot fail.
    for gate in &case.gates {
        for row in &gate.rows {
            let mut verdict = if row.passed { "passed".to_owned() } else { "FAILED".to_owned() };
            if row.fault_count > 0 {
                let _ = write!(verdict, ", {} elements", grouped(row.fault_count));
            }
            if let Some(note) = &row.note {
                let _ = write!(verdict, " ({note})");
            }
            let measured = row.measured.as_ref().map_or_else(|| "undefined".to_owned(), value_text);
            add(&mut table, [gate.step.clone(), row.metric.clone(), row.limit.clone(), measured, verdict]);
        }
        if gate.passed.is_none() {
            add(&mut table, [gate.step.as_str(), "", "", "", "not decided"]);
        }
    }
    align(&mut table, &[3]);
    text(&table)
}

fn files(case: &CaseReport, report: &Report) -> String {
    let mut table = plain(&["file", "of", "state"]);
    for file in &case.files {
        let state = match (report.timings.files.get(&file.path), file.failed_gate) {
            (Some(FileState::Current), _) => "up to date",
            (Some(FileState::Written), _) => "written",
            (Some(FileState::Missing) | None, _) => "not written",
        };
        let said = file_notes(file);
        let said = if said.is_empty() { said } else { format!(" ({said})") };
        add(&mut table, [file.path.as_str(), file.step.as_str(), &format!("{state}{said}")]);
    }
    text(&table)
}

/// What there is to say of a file: how it was written, and without what.
pub fn file_notes(file: &FileReport) -> String {
    let lost = (!file.lost.is_empty()).then(|| format!("without {}", file.lost.join(", ")));
    file.note.iter().cloned().chain(lost).collect::<Vec<_>>().join("; ")
}

/// What a state is called in tables.
pub fn state_text(state: TaskState) -> &'static str {
    match state {
        TaskState::Unknown | TaskState::Want | TaskState::Ready => "not reached",
        TaskState::Unwanted => "not asked for",
        TaskState::Running => "running",
        TaskState::Cached => "cached",
        TaskState::Done => "done",
        TaskState::Failed => "FAILED",
        TaskState::Skipped => "skipped",
        TaskState::Cancelled => "cancelled",
    }
}

/// The figures of a result in a few words: `20 480 faces, stretch 0.21 to 0.87`.
pub fn figures_text(figures: &Figures) -> String {
    let mut parts = Vec::new();
    if let Some(faces) = figures.faces {
        parts.push(format!("{} faces", grouped(faces)));
    }
    if let (Some(min), Some(mean)) = (figures.min_stretch, figures.mean_stretch) {
        parts.push(format!(
            "stretch min {} mean {}",
            number_text((min * 1e3).round() / 1e3),
            number_text((mean * 1e3).round() / 1e3)
        ));
    }
    parts.join(", ")
}

/// A count with thin groups of three digits.
pub fn grouped(count: u64) -> String {
    let digits = count.to_string();
    let mut text = String::new();
    for (index, digit) in digits.chars().enumerate() {
        if index > 0 && (digits.len() - index).is_multiple_of(3) {
            text.push(' ');
        }
        text.push(digit);
    }
    text
}

/// A table without lines; columns are aligned by blanks, so that it can be read by eye and cut by programs.
pub fn plain(header: &[&str]) -> Table {
    let mut table = Table::new();
    table.load_style(comfy_table::presets::NOTHING);
    if !header.is_empty() {
        table.set_header(header);
    }
    table
}

/// Adds a row to a table. What stands in it may be a name from a file, and is made fit to be shown.
pub fn add<T: AsRef<str>>(table: &mut Table, cells: impl IntoIterator<Item = T>) {
    table.add_row(cells.into_iter().map(|cell| printable(cell.as_ref()).into_owned()));
}

/// The table as text, without blanks at the ends of lines.
pub fn text(table: &Table) -> String {
    let lines: Vec<String> = table.lines().map(|line| line.trim_end().to_owned()).collect();
    lines.join("\n")
}

/// A paragraph as lines of at most 80 columns, each after `indent` blanks. A word longer than that has a line of its
/// own.
pub fn wrapped(text: &str, indent: usize) -> Vec<String> {
    const WIDTH: usize = 80;
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        match lines.last_mut() {
            Some(line) if line.chars().count() + 1 + word.chars().count() <= WIDTH => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(format!("{:indent$}{word}", "")),
        }
    }
    lines
}

/// Aligns number columns to the right.
pub fn align(table: &mut Table, columns: &[usize]) {
    for column in columns {
        if let Some(column) = table.column_mut(*column) {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
}
