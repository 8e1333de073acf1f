//! Files of criteria of other programs, as criteria of ours.
//!
//! # Algorithm
//! A reader takes a file apart into `Item`s, each with its lines: a check that has a metric of ours, or something
//! that has none and the reason. The writer puts both into one text, so that no line of the file is lost without a
//! word.
//!
//! # Invariants
//! - Every line of the file that is not blank or a comment of the other program belongs to one item.
//! - A check that is known and cannot be read is an error with its line, never left out.
//! - The text that is written is a file of criteria: `read` takes it.

use std::fmt::Write;

use crate::terminal::printable;

mod hypermesh;
mod snappy;

/// Whose file it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Dialect {
    /// A criteria file of Altair HyperMesh and BatchMesher.
    HyperMesh,
    /// `meshQualityDict`, or `meshQualityControls` of `snappyHexMeshDict`, of OpenFOAM.
    Snappy,
}

impl Dialect {
    /// What people call it.
    pub fn text(self) -> &'static str {
        match self {
            Self::HyperMesh => "a HyperMesh criteria file",
            Self::Snappy => "a meshQualityDict of snappyHexMesh",
        }
    }

    /// Whose file a text is, by the checks that it names.
    pub fn of(text: &str) -> Option<Self> {
        if text.lines().any(hypermesh::is_check) {
            return Some(Self::HyperMesh);
        }
        snappy::KEYS.iter().any(|key| text.contains(key)).then_some(Self::Snappy)
    }
}

/// Why a file cannot be taken over.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("line {line}: {message}")]
pub struct ImportError {
    /// The line, from 1.
    pub line: usize,
    /// What is wrong there.
    pub message: String,
}

/// A file as criteria of ours.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Imported {
    /// The file of criteria, TOML.
    pub text: String,
    /// How many checks were taken over.
    pub taken: usize,
    /// What has no place in ours, each with its line and the reason.
    pub left: Vec<String>,
}

/// A part of the other file.
#[derive(Clone, Debug, PartialEq)]
enum Item {
    /// A check that has a metric of ours.
    Check(Check),
    /// The penalties at the levels.
    Penalties { line: usize, values: [f64; 5] },
    /// Something without a place in ours.
    Other { line: usize, what: String, reason: String },
}

/// A check in the words of ours.
#[derive(Clone, Debug, PartialEq)]
struct Check {
    line: usize,
    /// What the other program calls it.
    what: &'static str,
    metric: &'static str,
    levels: [f64; 5],
    /// Whether the levels are percents.
    percent: bool,
    weight: f64,
    on: bool,
    /// What to know about the two definitions.
    note: String,
}

/// Takes a file over. `name` is what the text calls it.
///
/// # Errors
/// Where a check is known and its numbers cannot be read.
pub fn import(text: &str, name: &str, dialect: Dialect) -> Result<Imported, ImportError> {
    let items = match dialect {
        Dialect::HyperMesh => hypermesh::items(text)?,
        Dialect::Snappy => snappy::items(text)?,
    };
    let name = comment(name);
    let mut page = format!(
        "# From {name}, {}, by `meshmill criteria import`.\n# Each check names its line there; what has no place here \
         stands at the end.\n",
        dialect.text()
    );
    let _ = writeln!(page, "description = \"Taken over from {}\"", name.replace(['\\', '"'], "'"));
    let (mut taken, mut left) = (0, Vec::new());
    for item in &items {
        match item {
            Item::Penalties { line, values } => {
                let values: Vec<String> = values.iter().map(|value| number(*value)).collect();
                let _ = writeln!(page, "\n# Line {line}: penalty value.\npenalties = [{}]", values.join(", "));
            }
            Item::Check(check) => {
                taken += 1;
                write_check(&mut page, check);
            }
            Item::Other { line, what, reason } => left.push(format!("line {line}: {}: {reason}", comment(what))),
        }
    }
    if !left.is_empty() {
        page.push_str("\n# Not supported:\n");
        for line in &left {
            let _ = writeln!(page, "# {line}");
        }
    }
    Ok(Imported { text: page, taken, left })
}

fn write_check(page: &mut String, check: &Check) {
    let value = |value: &f64| {
        let value = number(*value);
        if check.percent { format!("\"{value}%\"") } else { value }
    };
    let names = ["ideal", "good", "warn", "fail", "worst"];
    let levels: Vec<String> =
        names.iter().zip(&check.levels).map(|(name, level)| format!("{name} = {}", value(level))).collect();
    let _ = writeln!(page, "\n# Line {}: {}. {}", check.line, check.what, check.note);
    let on = if check.on { "" } else { ", on = false" };
    let _ = writeln!(page, "{} = {{ {}, weight = {}{on} }}", check.metric, levels.join(", "), number(check.weight));
}

/// A number as TOML writes it.
fn number(value: f64) -> String {
    let text = format!("{value:?}");
    text.strip_suffix(".0").map(str::to_owned).unwrap_or(text)
}

/// Text of the other file that may stand in a comment of ours.
fn comment(text: &str) -> String {
    let short: String = printable(text.trim()).chars().take(120).collect();
    short.replace(|letter: char| letter.is_control(), " ")
}

/// A number of a file that can be a level.
fn level(text: &str) -> Option<f64> {
    text.parse().ok().filter(|value: &f64| value.abs() <= 1e150)
}

#[cfg(test)]
mod tests;
