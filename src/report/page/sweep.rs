//! The part of a page about a sweep: which cases are worth a look, and what each parameter does.

use std::fmt::Write;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde::Serialize;

use super::front::{Aim, aims, mesh_name, number, on_front};
use super::meshes::Gathered;
use super::plot::{self, Axis, Point, Rank};
use super::text::{anchor, unit, value};
use crate::metric::registry::{self, Unit};
use crate::report::sweep::{RowState, SweepColumn, SweepRow, SweepTable};

#[derive(Serialize)]
pub(super) struct SweepView {
    summary: String,
    parameters: Vec<String>,
    columns: Vec<String>,
    rows: Vec<RowView>,
    scatters: Vec<String>,
    parallel: String,
    pictures: Vec<PictureView>,
}

#[derive(Serialize)]
struct RowView {
    id: String,
    case: String,
    parameters: Vec<String>,
    values: Vec<CellView>,
    state: &'static str,
    class: &'static str,
    reason: String,
    front: bool,
}

#[derive(Serialize)]
struct CellView {
    text: String,
    sort: String,
    failed: bool,
}

#[derive(Serialize)]
struct PictureView {
    id: String,
    case: String,
    mesh: String,
    note: String,
    data: String,
    front: bool,
    in_viewer: bool,
}

/// Everything that the page says of a sweep.
pub(super) fn view(table: &SweepTable, gathered: &Gathered, in_viewer: &[String]) -> SweepView {
    let aims = aims(table);
    let fronts: Vec<bool> = table.rows.iter().map(|row| on_front(table, &aims, row)).collect();
    let passed = table.count(RowState::Passed);
    let mut summary = format!("{} cases, {passed} passed", table.rows.len());
    let failed = table.rows.len() - passed;
    if failed > 0 {
        let _ = write!(summary, ", {failed} did not");
    }
    if !aims.is_empty() {
        let names: Vec<String> = aims.iter().map(|aim| title(&table.columns[aim.column], Some(*aim))).collect();
        let count = fronts.iter().filter(|front| **front).count();
        let _ = write!(summary, "; {count} on the Pareto front of {}", names.join(", "));
    }
    let pairs: Vec<[Aim; 2]> = match aims[..] {
        [] | [_] => Vec::new(),
        [a, b] => vec![[a, b]],
        [a, b, c, ..] => vec![[a, b], [a, c], [b, c]],
    };
    SweepView {
        summary: summary + ".",
        parameters: table.parameters.clone(),
        columns: table.columns.iter().map(|column| title(column, None)).collect(),
        rows: table.rows.iter().zip(&fronts).map(|(row, front)| row_view(table, row, *front)).collect(),
        scatters: pairs.into_iter().map(|pair| scatter(table, pair)).collect(),
        parallel: parallel(table, &fronts),
        pictures: table
            .rows
            .iter()
            .zip(&fronts)
            .filter_map(|(row, front)| picture(table, row, *front, gathered, in_viewer))
            .collect(),
    }
}

/// `fe.min-stretch`, with which way is better.
fn title(column: &SweepColumn, aim: Option<Aim>) -> String {
    let name = if column.gate { format!("gate {}", column.name) } else { column.name.clone() };
    match aim {
        Some(Aim { lower: true, .. }) => format!("{} (less is better)", column.name),
        Some(Aim { lower: false, .. }) => format!("{} (more is better)", column.name),
        None => name,
    }
}

fn unit_of(column: &SweepColumn) -> Unit {
    registry::find(&column.metric).map_or(Unit::Ratio, |metric| metric.unit)
}

fn row_view(table: &SweepTable, row: &SweepRow, front: bool) -> RowView {
    let cell = |(index, column): (usize, &SweepColumn)| {
        let measured = row.values.get(index).copied().flatten();
        let kind = unit_of(column);
        let text = measured.map(|measured| value(&measured, kind)).unwrap_or_default();
        let sort = number(row, index).map(|number| number.to_string()).unwrap_or_default();
        let unit = if text.is_empty() { "" } else { unit(kind) };
        let text = format!("{text} {unit}").trim_end().to_owned();
        CellView { text, sort, failed: row.passed.get(index).copied().flatten() == Some(false) }
    };
    RowView {
        id: anchor(&row.case),
        case: row.case.clone(),
        parameters: row.parameters.clone(),
        values: table.columns.iter().enumerate().map(cell).collect(),
        state: row.state.text(),
        class: if row.state == RowState::Passed { "good" } else { "bad" },
        reason: row.reason.clone().unwrap_or_default(),
        front,
    }
}

fn rank(row: &SweepRow, front: bool) -> Rank {
    match (row.state, front) {
        (RowState::Passed, true) => Rank::Front,
        (RowState::Passed, false) => Rank::Other,
        (RowState::GateFailed | RowState::Failed | RowState::NotReached, _) => Rank::Failed,
    }
}

/// What a pointer on a case tells.
fn story(table: &SweepTable, row: &SweepRow) -> String {
    let parameters = table.parameters.iter().zip(&row.parameters).map(|(name, value)| format!("{name} {value}"));
    let measured = table.columns.iter().zip(&row.values).filter(|(column, _)| !column.gate);
    let measured =
        measured.filter_map(|(column, v)| Some(format!("{} {}", column.name, value(v.as_ref()?, unit_of(column)))));
    let parts: Vec<String> = parameters.chain(measured).collect();
    format!("{}: {} ({})", row.case, parts.join(", "), row.state.text())
}

fn scatter(table: &SweepTable, [x, y]: [Aim; 2]) -> String {
    let point = |row: &SweepRow| {
        let at = [number(row, x.column)?, number(row, y.column)?];
        let rank = rank(row, on_front(table, &[x, y], row));
        Some(Point { at, rank, title: story(table, row), link: format!("case-{}", anchor(&row.case)) })
    };
    let points: Vec<Point> = table.rows.iter().filter_map(point).collect();
    let titles = [x, y].map(|aim| title(&table.columns[aim.column], Some(aim)));
    plot::scatter(&points, &titles, [x.lower, y.lower])
}

/// Parameters and columns as axes, where they vary.
fn parallel(table: &SweepTable, fronts: &[bool]) -> String {
    let of_parameter = |index: usize| {
        let texts = table.rows.iter().map(|row| row.parameters.get(index).cloned().unwrap_or_default()).collect();
        Axis::of_texts(&table.parameters[index], texts)
    };
    let of_column = |(index, column): (usize, &SweepColumn)| {
        let kind = unit_of(column);
        let numbers = table.rows.iter().map(|row| number(row, index)).collect();
        Axis::of_numbers(&title(column, None), numbers, matches!(kind, Unit::Share))
    };
    let columns = table.columns.iter().enumerate().filter(|(_, column)| !column.gate).map(of_column);
    let axes = (0..table.parameters.len()).map(of_parameter).chain(columns).filter(Axis::varies).collect::<Vec<_>>();
    let lines: Vec<(Rank, String)> =
        table.rows.iter().zip(fronts).map(|(row, front)| (rank(row, *front), story(table, row))).collect();
    if axes.len() > 1 { plot::parallel(&axes, &lines) } else { String::new() }
}

fn picture(
    table: &SweepTable,
    row: &SweepRow,
    front: bool,
    gathered: &Gathered,
    in_viewer: &[String],
) -> Option<PictureView> {
    let mesh = mesh_name(row)?;
    let known = gathered.meshes.get(&mesh)?;
    let parameters = table.parameters.iter().zip(&row.parameters).map(|(name, value)| format!("{name} {value}"));
    Some(PictureView {
        id: anchor(&row.case),
        case: row.case.clone(),
        note: parameters.collect::<Vec<_>>().join(", "),
        data: STANDARD.encode(&known.picture),
        front,
        in_viewer: in_viewer.contains(&mesh),
        mesh,
    })
}
