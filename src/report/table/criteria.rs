//! How well a mesh keeps a standard, as a table: a line a metric, elements in each class, the worst element.

use super::super::measure::number_text;
use super::{add, align, grouped, plain, text};
use crate::metric::element::find;
use crate::metric::gate::Fault;
use crate::metric::gate::criteria::{CriteriaReport, CriterionRow, LEVELS, is_undefined};
use crate::metric::registry::{Direction, Unit};

/// The report of a standard for a terminal. `of` is the step that was judged.
pub fn table(report: &CriteriaReport, of: Option<&str>) -> String {
    let mut table = plain(&["metric", "limit", "worst value", "ideal", "good", "warn", "fail", "worst", "index", ""]);
    for row in &report.rows {
        let mut cells = vec![row.metric.clone(), limit(row), value(row)];
        cells.extend(row.levels.map(grouped));
        cells.push(rounded(row.quality_index));
        let verdict = if row.passed { "" } else { "FAILED " };
        cells.push(format!("{verdict}{}", row.worst.first().map(place).unwrap_or_default()));
        add(&mut table, cells);
    }
    align(&mut table, &[2, 3, 4, 5, 6, 7, 8]);
    format!("{}\n{}", head(report, of), text(&table))
}

/// The line above the table.
fn head(report: &CriteriaReport, of: Option<&str>) -> String {
    let of = of.map(|step| format!(" of {step}")).unwrap_or_default();
    let classes: Vec<String> = report
        .levels
        .iter()
        .zip(LEVELS)
        .filter(|(count, _)| **count > 0)
        .map(|(count, level)| format!("{} {level}", grouped(*count)))
        .collect();
    let classes =
        if classes.is_empty() { "no faces judged".to_owned() } else { format!("faces: {}", classes.join(", ")) };
    let verdict = if report.passed() { "passed" } else { "FAILED" };
    let name = crate::terminal::printable(&report.name).into_owned();
    format!("criteria {name}{of}: {verdict}, quality index {} (0 is best); {classes}", rounded(report.quality_index))
}

/// The level that must not be passed.
pub fn limit(row: &CriterionRow) -> String {
    let metric = find(&row.metric);
    let side = match metric.map(|metric| metric.direction) {
        Some(Direction::Higher) => "at least",
        _ => "at most",
    };
    format!("{side} {}", with_unit(row.limits[3], metric.map(|metric| metric.unit)))
}

fn with_unit(value: f64, unit: Option<Unit>) -> String {
    match unit {
        Some(Unit::Degrees) => format!("{}°", number_text(value)),
        Some(Unit::Share) => format!("{}%", number_text(100.0 * value)),
        _ => number_text(value),
    }
}

/// The worst value of a criterion.
pub fn value(row: &CriterionRow) -> String {
    let unit = find(&row.metric).map(|metric| metric.unit).filter(|unit| *unit == Unit::Share);
    let text = |value| if is_undefined(value) { number(value) } else { with_unit(value, unit) };
    row.value.map(text).unwrap_or_default()
}

/// A measured number, or that there is none.
pub fn number(value: f64) -> String {
    if is_undefined(value) { "degenerate".to_owned() } else { number_text(value) }
}

/// An index in a few digits.
fn rounded(index: f64) -> String {
    if index < 1e6 { number_text((index * 1e4).round() / 1e4) } else { format!("{index:.3e}") }
}

/// Which element, and where it is.
pub fn place(fault: &Fault) -> String {
    let [x, y, z] = fault.at.map(number_text);
    format!("face {} at ({x}, {y}, {z})", fault.id)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metric::gate::FaultKind;

    #[test]
    fn the_table_names_classes_and_the_worst_element() {
        let fault = Fault { kind: FaultKind::Face, id: 17, at: [1.5, 0.0, -2.0], value: 12.25 };
        let row = CriterionRow {
            metric: "warp-angle".to_owned(),
            weight: 1.0,
            limits: [0.0, 5.0, 8.0, 10.0, 90.0],
            levels: [1200, 3, 2, 1, 0],
            quality_index: 1.234_56,
            passed: false,
            value: Some(12.25),
            worst: vec![fault],
        };
        let degenerate = CriterionRow {
            metric: "stretch".to_owned(),
            limits: [1.0, 0.5, 0.3, 0.2, 0.0],
            value: Some(-f64::MAX),
            passed: true,
            ..CriterionRow::default()
        };
        let report = CriteriaReport {
            name: "lab".to_owned(),
            quality_index: 0.5,
            levels: [1200, 3, 2, 1, 0],
            worst: Some(fault),
            rows: vec![row, degenerate],
            ..CriteriaReport::default()
        };
        let table = table(&report, Some("fe"));
        let lines: Vec<&str> = table.lines().collect();
        assert!(lines[0].starts_with("criteria lab of fe: FAILED, quality index 0.5 (0 is best); faces: 1 200 ideal"));
        assert!(lines[2].contains("at most 10°") && lines[2].ends_with("FAILED face 17 at (1.5, 0, -2)"), "{table}");
        assert!(lines[3].contains("at least 0.2") && lines[3].contains("degenerate"), "{table}");
    }
}
