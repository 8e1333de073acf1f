//! How many real meshes each shipped pipeline takes, how long it takes them, and why it refuses the others.
//!
//! Runs one after the other, each with a cache of its own. What a run came to is kept as a line of a file, so that a
//! rating that was interrupted goes on where it stopped, and an earlier program can stand beside this one. Lines belong
//! to a program and a recipe, known by a hash of both: others are passed over.
//!
//! Percentiles are of the nearest rank, over all runs of the row, those that failed or did not end included.

use std::collections::BTreeMap;
use std::fs::{self, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};

use clap::Args;
use comfy_table::{CellAlignment, Table, presets};

use super::kinds::{self, Kind, meshes, name};
use super::program::root;
use super::timed::{self, Outcome};

/// Pipelines that say of themselves that they take open sheets.
const FOR_SHEETS: [&str; 3] = ["quads-open", "rough-quads", "surface-reconstruction"];

/// Options of `rate`.
#[derive(Args)]
pub(super) struct Rate {
    /// Folders of meshes.
    #[arg(required = true)]
    folders: Vec<PathBuf>,
    /// Pipelines, by the names of their files, with commas. Default: all.
    #[arg(long, value_delimiter = ',')]
    pipelines: Vec<String>,
    /// Most processor seconds of one run.
    #[arg(long, default_value_t = 60)]
    limit: u64,
    /// The program, instead of that of this checkout.
    #[arg(long)]
    pub(super) program: Option<PathBuf>,
    /// The folder of the pipelines, for an earlier program with its own.
    #[arg(long, default_value_os_t = root().join("pipelines"))]
    recipes: PathBuf,
    /// What each mesh is, as `kinds` lists it; meshes that are not on it are looked at.
    #[arg(long, default_value_os_t = root().join("examples/compare/kinds.txt"))]
    kinds: PathBuf,
    /// Where what runs came to is kept.
    #[arg(long, default_value_os_t = root().join("target/acceptance/rate.jsonl"))]
    results: PathBuf,
    /// What an earlier program came to, shown beside.
    #[arg(long)]
    before: Option<PathBuf>,
    /// Writes the tables to this file too, in Markdown.
    #[arg(long)]
    markdown: Option<PathBuf>,
}

impl Rate {
    /// Runs what has not run, and prints the tables; whether all could be kept and written.
    pub(super) fn run(&self, built: Option<PathBuf>) -> bool {
        let Some(program) = self.program.clone().or(built).and_then(|path| fs::canonicalize(path).ok()) else {
            eprintln!("there is no such program");
            return false;
        };
        let files: Vec<PathBuf> = self.folders.iter().flat_map(|folder| meshes(folder)).collect();
        let listed = kinds::read(&self.kinds);
        let of = |path: &PathBuf| listed.get(&name(path)).copied().or_else(|| Kind::of(path));
        let kinds: BTreeMap<String, Kind> =
            files.iter().map(|file| (name(file), of(file).unwrap_or(Kind::Crossing))).collect();
        let pipelines = if self.pipelines.is_empty() { self.shipped() } else { self.pipelines.clone() };
        let mut outcomes = Vec::new();
        let known = lines(&self.results);
        for pipeline in &pipelines {
            let recipe = self.recipes.join(format!("{pipeline}.toml"));
            let hash = identity(&program, &recipe);
            for file in files.iter().filter(|file| takes(pipeline, kinds[&name(file)])) {
                let is_it = |o: &&Outcome| o.program == hash && o.pipeline == *pipeline && o.mesh == name(file);
                let outcome = known.iter().rfind(is_it).cloned().or_else(|| {
                    let run = timed::run(&program, &recipe, file, self.limit).inspect_err(|error| eprintln!("{error}"));
                    let run = run.ok()?;
                    self.keep(Outcome { program: hash.clone(), pipeline: pipeline.clone(), mesh: name(file), ..run })
                });
                let Some(outcome) = outcome else { return false };
                outcomes.push(outcome);
            }
        }
        let before = self.before.as_deref().map(lines);
        let text = format!("{}\n\n{}\n", rates(&outcomes, before.as_deref(), &kinds), failures(&outcomes, &kinds));
        println!("{text}");
        self.markdown.as_ref().is_none_or(|path| fs::write(path, &text).is_ok())
    }

    /// The names of all pipelines.
    fn shipped(&self) -> Vec<String> {
        let entries = fs::read_dir(&self.recipes).into_iter().flatten().flatten().map(|entry| entry.path());
        let recipes = entries.filter(|path| path.extension().is_some_and(|ending| ending == "toml"));
        let mut names: Vec<String> =
            recipes.filter_map(|path| Some(path.file_stem()?.to_string_lossy().into_owned())).collect();
        names.sort();
        names
    }

    /// Adds a line to what is kept; nothing where the file cannot be written.
    fn keep(&self, outcome: Outcome) -> Option<Outcome> {
        let verdict = outcome.reason.as_deref().unwrap_or("passes");
        eprintln!("{} {}: {:.2} s, {verdict}", outcome.pipeline, outcome.mesh, outcome.seconds);
        let line = serde_json::to_string(&outcome).ok()? + "\n";
        let kept = fs::create_dir_all(self.results.parent()?)
            .and_then(|()| OpenOptions::new().create(true).append(true).open(&self.results))
            .and_then(|mut file| file.write_all(line.as_bytes()));
        kept.inspect_err(|error| eprintln!("{}: {error}", self.results.display())).ok()?;
        Some(outcome)
    }
}

fn takes(pipeline: &str, kind: Kind) -> bool {
    kind == Kind::Open || !FOR_SHEETS.contains(&pipeline)
}

/// What a line of results belongs to.
fn identity(program: &Path, recipe: &Path) -> String {
    let mut hasher = blake3::Hasher::new();
    for file in [program, recipe] {
        hasher.update(blake3::hash(&fs::read(file).unwrap_or_default()).as_bytes());
    }
    hasher.finalize().to_hex()[..16].to_owned()
}

/// What a file of results holds.
fn lines(path: &Path) -> Vec<Outcome> {
    let text = fs::read_to_string(path).unwrap_or_default();
    text.lines().filter_map(|line| serde_json::from_str(line).ok()).collect()
}

/// Share passed, median and 95th percentile of some runs.
fn figures(runs: &[&Outcome]) -> [String; 3] {
    if runs.is_empty() {
        return [const { String::new() }; 3];
    }
    let passed = runs.iter().filter(|run| run.code == 0).count();
    let mut seconds: Vec<f64> = runs.iter().map(|run| run.seconds).collect();
    seconds.sort_by(f64::total_cmp);
    let rank = |share: f64| format!("{:.2}", seconds[((share * seconds.len() as f64).ceil() as usize).max(1) - 1]);
    [format!("{:.1} %", 100.0 * passed as f64 / runs.len() as f64), rank(0.5), rank(0.95)]
}

/// A row for each pipeline and kind of mesh.
fn rates(outcomes: &[Outcome], before: Option<&[Outcome]>, kinds: &BTreeMap<String, Kind>) -> Table {
    let mut head = vec!["pipeline", "meshes", "runs", "passed", "median s", "95 % s"];
    head.extend(before.iter().flat_map(|_| ["passed before", "median s before", "95 % s before"]));
    let mut table = table(&head, 2..head.len());
    let mut groups: Vec<(&str, Kind)> = outcomes.iter().map(|o| (o.pipeline.as_str(), kinds[&o.mesh])).collect();
    groups.sort_unstable();
    groups.dedup();
    for (pipeline, kind) in groups {
        let is_in = |o: &&Outcome| o.pipeline == pipeline && kinds.get(&o.mesh) == Some(&kind);
        let runs: Vec<&Outcome> = outcomes.iter().filter(is_in).collect();
        let mut row = vec![pipeline.to_owned(), kind.name().to_owned(), runs.len().to_string()];
        row.extend(figures(&runs));
        if let Some(before) = before {
            row.extend(figures(&before.iter().filter(is_in).collect::<Vec<_>>()));
        }
        table.add_row(row);
    }
    table
}

/// A row for each run without a result that passes.
fn failures(outcomes: &[Outcome], kinds: &BTreeMap<String, Kind>) -> Table {
    let mut table = table(&["pipeline", "mesh", "which is", "s", "reason"], 3..4);
    for outcome in outcomes {
        let Some(reason) = &outcome.reason else { continue };
        let seconds = format!("{:.2}", outcome.seconds);
        // One line, whose bars are none of the table's.
        let reason = reason.split_whitespace().collect::<Vec<_>>().join(" ").replace('|', "/");
        table.add_row([&outcome.pipeline, &outcome.mesh, kinds[&outcome.mesh].name(), &seconds, &reason]);
    }
    table
}

/// An empty table, which is aligned text and Markdown at once, with its columns of numbers.
fn table(head: &[&str], numbers: std::ops::Range<usize>) -> Table {
    let mut table = Table::new();
    table.load_style(presets::ASCII_MARKDOWN).set_header(head);
    for column in numbers {
        if let Some(column) = table.column_mut(column) {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    table
}
