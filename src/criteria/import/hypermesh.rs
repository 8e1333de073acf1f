//! Criteria files of HyperMesh.
//!
//! # Source
//! Altair's reference of the commands `*setqualitycriteria` and `*writequalitycriteria`: a row is `?line? tag on weight
//! ideal good warn fail worst ?method?`, that of the penalties `?line? "penalty value" ideal good warn fail worst`. The
//! editor writes a heading above and, in newer versions, two more columns for colours. The definitions of the checks
//! are those of "How Element Quality is Calculated".

use std::collections::BTreeSet;

use super::{Check, ImportError, Item, level};

/// A check of theirs: its tag, our metric, whether its levels are percents, and what to know.
struct Known {
    tag: &'static str,
    metric: &'static str,
    percent: bool,
    note: &'static str,
}

const fn known(tag: &'static str, metric: &'static str, note: &'static str) -> Known {
    Known { tag, metric, percent: false, note }
}

const CHECKS: [Known; 13] = [
    known("min length", "min-length", "The shortest side."),
    known("max length", "max-length", "The longest side."),
    known("aspect ratio", "edge-ratio", "Longest side / shortest side."),
    known("warpage", "warp-angle", "The angle between the two triangles of a quad, the larger of both cuts."),
    known("max angle quad", "max-quad-angle", "The same."),
    known("min angle quad", "min-quad-angle", "The same."),
    known("max angle tria", "max-tria-angle", "The same."),
    known("min angle tria", "min-tria-angle", "The same."),
    known("skew", "skew", "90 less the angle between lines through midpoints."),
    known(
        "jacobian",
        "jacobian",
        "Least / largest determinant at the Gauss points of a quad; that of a flat triangle is 1.",
    ),
    known(
        "chordal dev",
        "chordal-deviation",
        "Midpoints of sides against the mesh that a gate or --reference compares with, as there is no CAD surface.",
    ),
    known("taper", "taper", "1 − least corner triangle / half of the quad; triangles have none."),
    Known { tag: "% of trias", metric: "triangle-share", percent: true, note: "Of the whole mesh." },
];

/// Rows that are known and have no place in ours.
const OTHERS: [(&str, &str); 6] = [
    ("qi color legend", "colours of a legend, no check"),
    ("global_solver", "the method for checks without one of their own; the definitions here are those named above"),
    ("time_step", "it depends on a material; use `characteristic-length`, which bounds the time step"),
    ("area_skew", "its columns are not documented, and there is no such metric; `equiangle-skew` is near"),
    ("cell_squish", "it is a check of volume cells"),
    ("equi_skew", "its columns are not documented; the metric is `equiangle-skew`"),
];

/// A row in lower case with single blanks, without its number, quotes and the command before it.
fn row(line: &str) -> String {
    let line = line.trim().trim_end_matches('\\');
    let line = line
        .strip_prefix("*createstringarray")
        .map_or(line, |rest| rest.trim_start().trim_start_matches(|letter: char| letter.is_ascii_digit()));
    let words = line.trim().trim_matches('"').to_lowercase();
    let mut words: Vec<&str> = words.split_whitespace().collect();
    if words.len() > 1 && words[0].bytes().all(|byte| byte.is_ascii_digit()) {
        words.remove(0);
    }
    words.join(" ")
}

/// Whether a line is one of the checks.
pub(super) fn is_check(line: &str) -> bool {
    let row = row(line);
    let rest =
        CHECKS.iter().find_map(|known| row.strip_prefix(known.tag)).or_else(|| row.strip_prefix("penalty value"));
    rest.is_some_and(|rest| rest.split_whitespace().filter(|word| level(word).is_some()).count() >= 5)
}

/// All rows of a file.
pub(super) fn items(text: &str) -> Result<Vec<Item>, ImportError> {
    let (mut items, mut seen) = (Vec::new(), BTreeSet::new());
    for (line, written) in (1..).zip(text.lines()) {
        let row = row(written);
        if row.is_empty() || row.starts_with('#') {
            continue;
        }
        let other = |reason: &str| Item::Other { line, what: written.to_owned(), reason: reason.to_owned() };
        let item = if let Some(rest) = row.strip_prefix("penalty value") {
            let values = numbers(rest, line)?;
            let values = values.get(..5).and_then(|values| values.try_into().ok());
            let values = values.ok_or_else(|| wrong(line, "`penalty value` has five numbers"))?;
            Item::Penalties { line, values }
        } else if let Some(known) = CHECKS.iter().find(|known| row.starts_with(known.tag)) {
            check(known, &row[known.tag.len()..], line)?
        } else if let Some((_, reason)) = OTHERS.iter().find(|(tag, _)| row.starts_with(tag)) {
            other(reason)
        } else {
            other("a heading or a row that is not known")
        };
        let name = match &item {
            Item::Check(check) => Some(check.what),
            Item::Penalties { .. } => Some("penalty value"),
            Item::Other { .. } => None,
        };
        let again = name.is_some_and(|name| !seen.insert(name));
        items.push(if again { other("the same row stands above; that one counts") } else { item });
    }
    Ok(items)
}

fn check(known: &Known, rest: &str, line: usize) -> Result<Item, ImportError> {
    let values = numbers(rest, line)?;
    let [on, weight, levels @ ..] = values.as_slice() else { return Err(too_short(known, line)) };
    let five: [f64; 5] = levels.get(..5).and_then(|five| five.try_into().ok()).ok_or_else(|| too_short(known, line))?;
    if !(0.0..=1e9).contains(weight) {
        return Err(wrong(line, format!("the weight of `{}` is {weight}", known.tag)));
    }
    let rises = five.is_sorted();
    if !rises && !five.is_sorted_by(|a, b| a >= b) {
        return Err(wrong(line, format!("the levels of `{}` rise and fall", known.tag)));
    }
    let method = levels.get(5).filter(|method| **method != 0.0);
    let method = method.map(|method| format!(" Method {method} is not taken over.")).unwrap_or_default();
    Ok(Item::Check(Check {
        line,
        what: known.tag,
        metric: known.metric,
        levels: five,
        percent: known.percent,
        weight: *weight,
        on: *on != 0.0,
        note: format!("{}{method}", known.note),
    }))
}

fn too_short(known: &Known, line: usize) -> ImportError {
    wrong(line, format!("`{}` has seven numbers: on, weight, ideal, good, warn, fail, worst", known.tag))
}

fn wrong(line: usize, message: impl Into<String>) -> ImportError {
    ImportError { line, message: message.into() }
}

fn numbers(rest: &str, line: usize) -> Result<Vec<f64>, ImportError> {
    let number =
        |word: &str| level(word).ok_or_else(|| wrong(line, format!("`{}` is not a number", super::comment(word))));
    rest.split_whitespace().map(|word| number(word.trim_matches('"'))).collect()
}
