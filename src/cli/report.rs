//! `meshmill report`: the page of a run that is finished.

use std::fs;
use std::path::{Path, PathBuf};

use super::Global;
use super::context::{open_store, read_text, texts};
use super::exit::{Exit, Fault, say};
use crate::metric::Measurement;
use crate::recipe::{Overrides, Recipe};
use crate::report::page::{self, Library, PageError, PageOptions};
use crate::report::sweep::SweepTable;
use crate::report::{Report, record};
use crate::run::{self, Entry, Figures, Outcome, VERSION};
use crate::step::Artifact;
use crate::store::{Store, host};

/// Write the page of a finished run: one HTML file with graph, metrics, charts and meshes, which works offline.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    /// The recipe, whose last run is in `out/NAME`, or the output folder of any run or sweep.
    #[arg(value_name = "RECIPE|OUTDIR")]
    target: PathBuf,
    /// The file to write. Default: `report.html` in the output folder.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Show only the meshes of these steps, the first two side by side at first. Default: all.
    #[arg(long, value_name = "STEP")]
    step: Vec<String>,
}

pub(super) fn run(arguments: &Arguments, global: &Global) -> Result<Exit, Fault> {
    let folder = folder(&arguments.target)?;
    let path = folder.join("run.ron");
    let text = fs::read_to_string(&path).map_err(|error| no_record(&path, &error))?;
    let report = record::from_ron(&text).map_err(|error| {
        Fault::usage(format!("{} is not the record of a run: {error}", path.display()))
            .help("run the recipe again; records of other versions cannot be read")
    })?;
    let table = read_table(&folder)?;
    warn_of_changes(&arguments.target, &report);
    let file = arguments.out.clone().unwrap_or_else(|| folder.join("report.html"));
    write(&report, table.as_ref(), &open_store(global)?, &arguments.step, &file)?;
    say(&format!("{}: written", file.display()));
    Ok(Exit::Done)
}

/// The table of a sweep, where the folder is that of one.
fn read_table(folder: &Path) -> Result<Option<SweepTable>, Fault> {
    let path = folder.join("sweep.ron");
    let Ok(text) = fs::read_to_string(&path) else { return Ok(None) };
    let table = record::sweep_from_ron(&text);
    table.map(Some).map_err(|error| Fault::usage(format!("{} is not the table of a sweep: {error}", path.display())))
}

/// Writes the page of a run or sweep.
pub(super) fn write(
    report: &Report,
    table: Option<&SweepTable>,
    store: &Store,
    steps: &[String],
    file: &Path,
) -> Result<(), Fault> {
    let options = PageOptions { steps: steps.to_vec() };
    let page = page::html(report, table, &Shelf(store), &options).map_err(|error| match error {
        PageError::Empty | PageError::UnknownStep { .. } => Fault::usage(error.to_string()),
        PageError::Template(_) | PageError::Data(_) => Fault::new(Exit::Fault, error.to_string()),
    })?;
    Ok(run::write_file(file, page.as_bytes())?)
}

/// The folder with the record of the run.
fn folder(target: &Path) -> Result<PathBuf, Fault> {
    if target.is_dir() {
        return Ok(target.to_path_buf());
    }
    let recipe = Recipe::load(target, &read_text, &Overrides::default())?;
    let run = Path::new("out").join(&recipe.name);
    let sweep = Path::new("out").join(format!("{}-sweep", recipe.name));
    Ok(if !run.join("run.ron").exists() && sweep.join("run.ron").exists() { sweep } else { run })
}

fn no_record(path: &Path, error: &std::io::Error) -> Fault {
    if error.kind() == std::io::ErrorKind::NotFound {
        Fault::usage(format!("there is no run to report: {} is missing", path.display()))
            .help("run the recipe first, or give the folder that `run --out` wrote to")
    } else {
        Fault::usage(format!("cannot read {}: {error}", path.display()))
    }
}

/// Says so when the recipe is not the one that was run.
fn warn_of_changes(target: &Path, report: &Report) {
    let Ok(text) = fs::read_to_string(target) else { return };
    if report.texts.first().is_some_and(|(_, known)| *known != text) {
        say(&format!("{} has changed since this run; the page shows the run", target.display()));
    }
}

/// The texts of a recipe for its record.
pub(super) fn describe(report: &mut Report, recipe: &Recipe) {
    report.description.clone_from(&recipe.description);
    report.texts = texts(recipe);
}

/// The cache as the page wants it.
struct Shelf<'a>(&'a Store);

impl Library for Shelf<'_> {
    fn artifact(&self, content: &str) -> Option<Artifact> {
        self.0.load(&blake3::Hash::from_hex(content).ok()?)
    }

    fn parameters(&self, key: &str) -> Vec<(String, String)> {
        let entry = blake3::Hash::from_hex(key).ok().and_then(|key| self.0.entry(&key));
        let own = |(name, value): (String, String)| {
            let name = name.strip_prefix("parameter ").or(name.strip_prefix("lock "))?;
            Some((name.to_owned(), value))
        };
        entry.map(|entry| entry.record.into_iter().filter_map(own).collect()).unwrap_or_default()
    }

    fn measurement(
        &self,
        content: &str,
        reference: Option<&str>,
        make: &mut dyn FnMut() -> Option<Measurement>,
    ) -> Option<Measurement> {
        let key = measurement_key(content, reference);
        if let Some(Outcome::Artifact { figures, .. }) = self.0.entry(&key).map(|entry| entry.outcome)
            && let Some(known) = figures.metrics
        {
            return Some(known);
        }
        let made = make()?;
        // Remembering is a convenience: a cache that cannot be written to must not keep anybody from reading.
        let _ = self.remember(&key, &made);
        Some(made)
    }
}

impl Shelf<'_> {
    fn remember(&self, key: &blake3::Hash, made: &Measurement) -> Result<(), crate::store::StoreError> {
        let artifact = Artifact::Metrics(std::sync::Arc::new(made.clone()));
        let (saved, written) = self.0.save(&artifact);
        written?;
        let figures = Figures { port: artifact.port().to_string(), metrics: Some(made.clone()), ..Figures::default() };
        let entry = Entry {
            version: VERSION.to_owned(),
            host: host(),
            task: "report/metrics".to_owned(),
            record: Vec::new(),
            outcome: Outcome::Artifact { content: saved.content, bytes: saved.bytes, figures },
            stats: serde_json::Value::Null,
            seconds: 0.0,
            memory: None,
        };
        self.0.publish(key, &entry)
    }
}

/// The key of the metrics of one mesh against another: version and contents.
fn measurement_key(content: &str, reference: Option<&str>) -> blake3::Hash {
    let mut hasher = blake3::Hasher::new();
    for part in ["report metrics", VERSION, content, reference.unwrap_or("")] {
        hasher.update(&(part.len() as u64).to_le_bytes());
        hasher.update(part.as_bytes());
    }
    hasher.finalize()
}
