//! `meshmill diff`: two runs, or two meshes, side by side.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::convert::read_mesh;
use super::exit::{Exit, Fault, data, document_text};
use super::signals::Interrupt;
use crate::metric::measure;
use crate::report::diff::{MeshDiff, MetricChange, RunRecord, diff, metrics_text, text};
use crate::report::json::Kind;
use crate::run::Silent;
use crate::watch::Watch;

/// Compare two runs: which metrics changed, and which parameter, input or revision made it. Or compare two meshes.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    /// A run: its folder or its run.ron. Or a mesh.
    before: PathBuf,
    /// What it is compared with.
    after: PathBuf,
    /// Print one JSON document.
    #[arg(long)]
    json: bool,
}

pub(super) fn run(arguments: &Arguments) -> Result<Exit, Fault> {
    match (record_file(&arguments.before), record_file(&arguments.after)) {
        (Some(before), Some(after)) => runs(&before, &after, arguments.json),
        (None, None) => meshes(arguments),
        (Some(_), None) | (None, Some(_)) => Err(Fault::usage("a run can be compared with a run, a mesh with a mesh")),
    }
}

/// The run.ron that a path means; none for a mesh.
fn record_file(path: &Path) -> Option<PathBuf> {
    if path.is_dir() {
        Some(path.join("run.ron"))
    } else {
        path.extension().is_some_and(|ending| ending == "ron").then(|| path.to_path_buf())
    }
}

fn runs(before: &Path, after: &Path, json: bool) -> Result<Exit, Fault> {
    let found = diff(&read(before)?, &read(after)?);
    data(&if json { document_text(Kind::Diff, &found)? } else { text(&found) });
    Ok(Exit::Done)
}

fn read(path: &Path) -> Result<RunRecord, Fault> {
    let text =
        fs::read_to_string(path).map_err(|error| Fault::usage(format!("cannot read {}: {error}", path.display())))?;
    RunRecord::from_ron(&text).map_err(|error| {
        Fault::usage(format!("{} is no record of a run of this version: {error}", path.display()))
            .help("`meshmill run` writes run.ron into its output folder")
    })
}

/// Every metric of both meshes, the distance of the second one to the first.
fn meshes(arguments: &Arguments) -> Result<Exit, Fault> {
    let (before, after) = (read_mesh(&arguments.before)?, read_mesh(&arguments.after)?);
    let interrupt = Interrupt::listen();
    let watch = Watch::new(Arc::new(Silent), Arc::clone(&interrupt.cancelled));
    let (Ok(a), Ok(b)) = (measure(&before, None, &watch), measure(&after, Some(&before), &watch)) else {
        return Ok(interrupt.exit());
    };
    let names = crate::metric::registry::METRICS.iter().map(|metric| metric.name);
    let change = |name: &str| MetricChange { metric: name.to_owned(), before: a.get(name), after: b.get(name) };
    let metrics = names.map(change).filter(|change| change.before.is_some() || change.after.is_some()).collect();
    let found = MeshDiff { metrics };
    let text = if arguments.json { document_text(Kind::MeshDiff, &found)? } else { metrics_text(&found.metrics) };
    data(&text);
    Ok(Exit::Done)
}
