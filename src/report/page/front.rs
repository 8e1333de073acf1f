//! The cases of a sweep that no other case beats: those worth a look.

use crate::metric::Value;
use crate::report::sweep::{Better, RowState, SweepRow, SweepTable};

/// Aims that cases are compared by.
const MOST_AIMS: usize = 3;

/// What a case's result is called in the viewer.
pub(super) fn mesh_name(row: &SweepRow) -> Option<String> {
    Some(crate::report::in_case(&row.case, row.result.as_ref()?))
}

/// A column that cases are compared by: its place, and whether little is good.
#[derive(Clone, Copy)]
pub(super) struct Aim {
    pub(super) column: usize,
    pub(super) lower: bool,
}

/// The first few columns that have a good end and are not the same for all cases. Fewer faces cost less to compute.
pub(super) fn aims(table: &SweepTable) -> Vec<Aim> {
    let mut aims: Vec<Aim> = Vec::new();
    for (index, column) in table.columns.iter().enumerate() {
        let lower = match column.better {
            Better::Higher => false,
            Better::Lower => true,
            Better::Neutral if ["faces", "vertices"].contains(&column.metric.as_str()) => true,
            Better::Neutral => continue,
        };
        let known = |aim: &Aim| {
            let other = &table.columns[aim.column];
            (&other.step, &other.metric) == (&column.step, &column.metric)
        };
        let mut numbers = table.rows.iter().filter_map(|row| number(row, index));
        let first = numbers.next();
        let varies = numbers.any(|number| Some(number) != first);
        if varies && !aims.iter().any(known) && aims.len() < MOST_AIMS {
            aims.push(Aim { column: index, lower });
        }
    }
    aims
}

pub(super) fn number(row: &SweepRow, column: usize) -> Option<f64> {
    row.values.get(column).copied().flatten().map(Value::as_f64).filter(|number| number.is_finite())
}

/// Whether no other case that passed is as good in every aim and better in one.
pub(super) fn on_front(table: &SweepTable, aims: &[Aim], row: &SweepRow) -> bool {
    let badness = |row: &SweepRow| -> Option<Vec<f64>> {
        aims.iter().map(|aim| number(row, aim.column).map(|n| if aim.lower { n } else { -n })).collect()
    };
    let (Some(own), true) = (badness(row), row.state == RowState::Passed && !aims.is_empty()) else { return false };
    let beaten = |other: &Vec<f64>| other.iter().zip(&own).all(|(a, b)| a <= b) && *other != own;
    !table.rows.iter().filter(|other| other.state == RowState::Passed).filter_map(badness).any(|other| beaten(&other))
}

/// The rows on the front of all aims, in order.
pub(super) fn front(table: &SweepTable) -> Vec<&SweepRow> {
    let aims = aims(table);
    table.rows.iter().filter(|row| on_front(table, &aims, row)).collect()
}
