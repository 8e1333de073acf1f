//! `meshmill criteria`: files of other programs as criteria, and what criteria can name.

use std::path::{Path, PathBuf};

use clap::{Subcommand, ValueEnum};

use super::context::read_text;
use super::exit::{Exit, Fault, data, say};
use crate::criteria::import::{Dialect, Imported, import};
use crate::criteria::read;
use crate::metric::element::ELEMENT_METRICS;
use crate::metric::gate::criteria::Criteria;
use crate::metric::registry::Direction;
use crate::recipe::{Diagnostics, Scope, Span, load_criteria, suggest};
use crate::report::measure::unit_text;
use crate::report::table;
use crate::run::{RunError, replaced, write_named};

/// Criteria: standards for elements, each metric with its levels ideal, good, warn, fail and worst.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, Subcommand)]
enum What {
    /// Write a criteria file of HyperMesh or a meshQualityDict of snappyHexMesh as criteria.
    ///
    /// Each check names its line in the file; what has no place in criteria stands at the end with the reason, and on
    /// the standard error.
    Import(Import),
    /// List the metrics of elements that criteria can name.
    Metrics,
}

#[derive(Debug, clap::Args)]
struct Import {
    /// The file.
    file: PathBuf,
    /// Whose file it is. Default: what its checks say.
    #[arg(long, value_name = "PROGRAM")]
    from: Option<From>,
    /// Write to this file and not to the standard output.
    #[arg(long, value_name = "FILE")]
    to: Option<PathBuf>,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum From {
    Hypermesh,
    Snappy,
}

/// Larger files are no criteria of anybody.
const LARGEST: usize = 1 << 20;

pub(super) fn run(arguments: &Arguments) -> Result<Exit, Fault> {
    match &arguments.what {
        What::Import(arguments) => take_over(arguments),
        What::Metrics => {
            data(&metrics());
            Ok(Exit::Done)
        }
    }
}

fn take_over(arguments: &Import) -> Result<Exit, Fault> {
    let file = &arguments.file;
    let shown = file.display();
    if let Some(to) = &arguments.to
        && replaced(to, &[file.as_path()]).is_some()
    {
        return Err(RunError::WouldReplace { output: to.clone(), input: file.clone() }.into());
    }
    let text = read_text(file).map_err(|reason| Fault::usage(format!("cannot read {shown}: {reason}")))?;
    if text.len() > LARGEST {
        return Err(Fault::usage(format!(
            "{shown} has {} bytes; a file of criteria has at most {LARGEST}",
            text.len()
        )));
    }
    let dialect = match arguments.from {
        Some(From::Hypermesh) => Dialect::HyperMesh,
        Some(From::Snappy) => Dialect::Snappy,
        None => Dialect::of(&text).ok_or_else(|| {
            Fault::usage(format!("{shown}: these are no criteria of a program that is known"))
                .help("say whose they are with --from hypermesh or --from snappy")
        })?,
    };
    let name = file.file_name().unwrap_or_default().to_string_lossy();
    let Imported { text, taken, left } =
        import(&text, &name, dialect).map_err(|error| Fault::usage(format!("cannot read {shown}: {error}")))?;
    if taken == 0 {
        return Err(Fault::usage(format!("{shown}: none of its checks judges a surface"))
            .help("the checks of such a file that do are listed by `meshmill criteria metrics`"));
    }
    match &arguments.to {
        Some(to) => write_named(to, text.as_bytes())?,
        None => data(text.trim_end()),
    }
    for line in &left {
        say(&format!("{shown}: not supported: {line}"));
    }
    say(&format!("{shown}: {taken} checks taken over, {} lines not supported", left.len()));
    Ok(Exit::Done)
}

/// The metrics of elements, a line each.
fn metrics() -> String {
    let mut list = table::plain(&["metric", "of", "unit", "good is", "meaning"]);
    for metric in ELEMENT_METRICS {
        let better = if metric.direction == Direction::Higher { "more" } else { "less" };
        let cells = [metric.name, metric.on().text(), unit_text(metric.unit), better, metric.doc];
        table::add(&mut list, cells);
    }
    table::text(&list)
}

/// Reads a file of criteria that no recipe names. `set` replaces some of its parameters.
pub(super) fn read_file(file: &Path, set: &[(String, String)]) -> Result<Criteria, Fault> {
    let (table, sources) = load_criteria(file, &read_text, set)?;
    let known: Vec<String> = match table.get("params").map(|entry| &entry.value.value) {
        Some(crate::recipe::Node::Table(params)) => params.entries.keys().cloned().collect(),
        _ => Vec::new(),
    };
    if let Some((name, value)) = set.iter().find(|(name, _)| !known.contains(name)) {
        let help = suggest::did_you_mean(name, "they have", known.iter().map(String::as_str));
        return Err(
            Fault::usage(format!("--set {name}={value}: the criteria have no parameter `{name}`")).help_opt(help)
        );
    }
    let name = file.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let name = name.strip_suffix(".toml").unwrap_or(&name);
    let name = name.strip_suffix(".criteria").unwrap_or(name);
    let mut problems = Vec::new();
    let read = read((name, Span::default()), &table, &Scope::default(), &sources, &mut problems);
    read.ok_or_else(|| Diagnostics::new(sources, problems).into())
}
