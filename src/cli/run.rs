//! `meshmill run`: a recipe from beginning to end.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::Global;
use super::context::{Planned, RecipeArguments, open_store, protected};
use super::exit::{Exit, Fault, coloured, data, document_text, say, say_failure};
use super::held::Held;
use super::machine::MemoryArguments;
use super::picture::{self, Pictures};
use super::progress;
use super::record::write_record;
use super::report;
use super::signals::Interrupt;
use super::trace::Trace;
use super::unchanged::Unchanged;
use crate::plan::in_case;
use crate::report::json::Kind;
use crate::report::{Report, Status, StepReport, junit, record, table};
use crate::run::{self, Observer, RunError, RunOptions, RunOutcome};
use crate::store::Store;
use crate::store::stamp::Said;

/// Run a recipe: what is not in the cache is computed, files are written where the gates hold.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    #[command(flatten)]
    pub(super) recipe: RecipeArguments,
    /// Folder of the output files. Default: `out/NAME`.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Most tasks at once, and most threads. Default: one for each processor.
    #[arg(long, short, value_name = "N")]
    jobs: Option<usize>,
    #[command(flatten)]
    memory: MemoryArguments,
    /// Run only this step and what it needs.
    #[arg(long, value_name = "STEP")]
    only: Vec<String>,
    /// Run this step again although it is cached; a result that differs is a fault.
    #[arg(long, value_name = "STEP")]
    force: Vec<String>,
    /// Run steps again whose failure is remembered.
    #[arg(long)]
    retry_failed: bool,
    /// Write `report.html` into the output folder too: graph, metrics, charts and meshes in one file.
    #[arg(long)]
    report: bool,
    /// Print the report as one JSON document.
    #[arg(long)]
    json: bool,
    /// Write the checks as JUnit XML too, for systems of continuous integration: a test for each check and criterion.
    #[arg(long, value_name = "FILE")]
    junit: Option<PathBuf>,
    /// Which outputs get a picture beside them: all where there are few of them, all, or none.
    #[arg(long, value_name = "WHICH", value_enum, default_value_t)]
    pictures: Pictures,
    /// Write a timeline for a trace viewer.
    #[arg(long, value_name = "FILE")]
    trace: Option<PathBuf>,
    /// Fail with 5 when anything differs from the lock file. Default: `NAME.lock.ron` beside the recipe.
    #[arg(long, value_name = "FILE", num_args = 0..=1, require_equals = true, default_missing_value = "")]
    locked: Option<String>,
}

pub(super) fn run(arguments: &Arguments, global: &Global) -> Result<Exit, Fault> {
    once(arguments, global, &Interrupt::listen())
}

/// One run; `watch` does more than one.
pub(super) fn once(arguments: &Arguments, global: &Global, interrupt: &Interrupt) -> Result<Exit, Fault> {
    let unchanged = arguments.unchanged(global);
    // Opened once, so that what there is to say of its levels is said once.
    let early = unchanged.as_ref().map(|_| open_store(global)).transpose()?;
    if let (Some(unchanged), Some(store)) = (&unchanged, &early)
        && let Some(exit) = unchanged.repeat(store).and_then(Exit::of_code)
    {
        return Ok(exit);
    }
    let planned = arguments.recipe.plan()?;
    planned.check_steps("--only", &arguments.only)?;
    planned.check_steps("--force", &arguments.force)?;
    let store = early.map_or_else(|| open_store(global), Ok)?;
    let mut options = options(&planned, arguments.out.as_deref(), arguments.jobs, interrupt)?;
    if let Some(lock) = arguments.locked.as_ref().filter(|lock| !lock.is_empty()) {
        options.protected.push(PathBuf::from(lock));
    }
    for file in [&arguments.trace, &arguments.junit].into_iter().flatten() {
        planned.check_replaces(file, &options.protected)?;
    }
    // No output takes its place.
    options.protected.extend(arguments.junit.clone());
    let _claim = run::claim(&options.out)?;
    options.only.clone_from(&arguments.only);
    options.force.clone_from(&arguments.force);
    options.retry_failed = arguments.retry_failed;
    let options = arguments.memory.applied(options, global);
    let seen = if unchanged.is_some() { planned.seen() } else { Vec::new() };
    let held = arguments.locked.as_ref().map(|file| Held::new(Path::new(file), &planned, &store, &options));
    let held = held.transpose()?;
    let extras = (arguments.trace.as_deref(), arguments.pictures);
    let Ran { report, cancelled, saved, keys } = execute(&planned, &store, &options, global, extras)?;
    tell(&report, arguments.json, global.quiet)?;
    if cancelled {
        return Ok(interrupt.exit());
    }
    if let Some(file) = &arguments.junit {
        run::write_named(file, junit::document(&report).as_bytes())?;
    }
    if arguments.report {
        report::write(&report, None, &store, &[], &options.out.join("report.html"))?;
    }
    if let Some(held) = held {
        held.check(&report, &options.out)?.pin(&store, &keys);
    }
    if let (Some(unchanged), Status::Done, true) = (unchanged, report.status, saved) {
        let out = if global.quiet { String::new() } else { table::report(&report.unchanged()) };
        let err = [left_out(&report), warnings(&report)].concat();
        let said = Said { out, err, exit: 0 };
        unchanged.remember(&store, (seen, report.written().collect()), said, &report, &options.out)?;
    }
    Ok(report.status.into())
}

impl Arguments {
    /// The short cut for this run; none where more is asked for than that everything is up to date.
    fn unchanged(&self, global: &Global) -> Option<Unchanged> {
        let files = self.trace.is_none() && self.junit.is_none();
        let plain = self.force.is_empty() && !self.json && !self.report && files && self.locked.is_none();
        let mut more = vec![("--out", path_bytes(self.out.as_deref())), ("--pictures", vec![self.pictures as u8])];
        more.extend(self.only.iter().map(|step| ("--only", step.as_bytes().to_vec())));
        (plain && global.verbose == 0).then(|| Unchanged::of("run", &self.recipe, &more, global))
    }
}

/// A run that has ended.
pub(super) struct Ran {
    pub(super) report: Report,
    /// Whether it was interrupted.
    pub(super) cancelled: bool,
    /// Whether the cache took all of it.
    pub(super) saved: bool,
    /// Keys of all its results, in hexadecimal.
    pub(super) keys: BTreeSet<String>,
}

/// Runs the plan and keeps a record of it.
pub(super) fn execute(
    planned: &Planned,
    store: &Store,
    options: &RunOptions,
    global: &Global,
    (trace, pictures): (Option<&Path>, Pictures),
) -> Result<Ran, Fault> {
    let outcome = traced(trace, global, &|observer| run::run(&planned.plan, store, options, observer))?;
    let mut report = Report::new(&planned.recipe.name, &planned.plan, &outcome);
    report::describe(&mut report, &planned.recipe);
    if !outcome.cancelled {
        // Only then: reading the last record of ten thousand steps takes longer than all the rest.
        if report.status != Status::Done && options.only.is_empty() {
            remove_stale(&report, &options.out, &planned.files());
        }
        picture::write(&planned.plan, &outcome, store, pictures)?;
        write_record(&report, &options.out)?;
    }
    let keys = outcome.tasks.iter().filter_map(|task| Some(task.key?.to_hex().to_string())).collect();
    Ok(Ran { report, cancelled: outcome.cancelled, saved: outcome.unsaved.is_none(), keys })
}

/// Removes what the last run of this folder wrote and this one did not, with its picture, so that nobody takes it for a
/// result of this one. What somebody has changed since is left, and what this run read, and what cannot be removed.
fn remove_stale(report: &Report, out: &Path, read: &[PathBuf]) {
    let Ok(text) = fs::read_to_string(out.join("run.ron")) else { return };
    let Ok(last) = record::from_ron(&text) else { return };
    let there: BTreeSet<PathBuf> = report.written().collect();
    let read: Vec<&Path> = read.iter().map(PathBuf::as_path).collect();
    for file in last.cases.iter().flat_map(|case| &case.files) {
        let path = Path::new(&file.path);
        if !run::is_inside(out, path) || run::replaced(path, &read).is_some() {
            continue;
        }
        let Some(content) = file.content.as_ref().filter(|_| !there.contains(path)) else { continue };
        if fs::read(path).is_ok_and(|bytes| blake3::hash(&bytes).to_hex().as_str() == content) {
            let _ = fs::remove_file(path);
            let picture = path.with_extension("png");
            if !there.contains(&picture) {
                let _ = fs::remove_file(picture);
            }
        }
    }
}

/// A run that reports to an observer.
type Work<'a> = dyn Fn(&Arc<dyn Observer>) -> Result<RunOutcome, RunError> + 'a;

/// Runs something under the observer that suits the terminal, with a timeline where one is asked for.
pub(super) fn traced(trace: Option<&Path>, global: &Global, work: &Work<'_>) -> Result<RunOutcome, Fault> {
    let observer: Arc<dyn Observer> = progress::observer(global.quiet, global.verbose > 0);
    let outcome = match trace {
        None => work(&observer)?,
        Some(path) => {
            let trace = Arc::new(Trace::new(observer));
            let outcome = work(&(Arc::clone(&trace) as Arc<dyn Observer>))?;
            trace.write(path)?;
            outcome
        }
    };
    tell_unsaved(&outcome);
    Ok(outcome)
}

/// Tells what the cache could not take.
pub(super) fn tell_unsaved(outcome: &RunOutcome) {
    if let Some(reason) = &outcome.unsaved {
        say(&format!(
            "warning: the cache could not be written, so the next run computes some of this again, and pictures and \
             reports may lack meshes: {reason}\n   help: check the folder and its free space, or use another one with \
             --cache DIR"
        ));
    }
}

/// The options of a run of this recipe.
pub(super) fn options(
    planned: &Planned,
    out: Option<&Path>,
    jobs: Option<usize>,
    interrupt: &Interrupt,
) -> Result<RunOptions, Fault> {
    let name = planned.recipe.name.clone();
    let jobs = jobs_of(jobs)?;
    let out = folder(out.map_or_else(|| Path::new("out").join(&name), Path::to_path_buf))?;
    let cancelled = Arc::clone(&interrupt.cancelled);
    let protected = protected(&planned.recipe);
    Ok(RunOptions { protected, cancelled, ..RunOptions::new(&name, out, jobs) })
}

/// The folder of the outputs; nothing may be there, or a folder, and no file in the place of one above it.
pub(super) fn folder(out: PathBuf) -> Result<PathBuf, Fault> {
    // What lies below a file does not exist, so that the nearest that does tells.
    let there = out.ancestors().find(|path| path.symlink_metadata().is_ok());
    match there.filter(|path| path.exists() && !path.is_dir()) {
        Some(file) if file == out => {
            Err(Fault::usage(format!("--out {}: this is a file", out.display())).help("name a folder"))
        }
        Some(file) => Err(Fault::usage(format!("--out {}: {} is a file", out.display(), file.display()))
            .help("name a folder that is not below a file")),
        None => Ok(out),
    }
}

/// A path as it was given, or nothing.
pub(super) fn path_bytes(path: Option<&Path>) -> Vec<u8> {
    path.map(|path| path.as_os_str().as_encoded_bytes().to_vec()).unwrap_or_default()
}

/// How many tasks run at once.
pub(super) fn jobs_of(jobs: Option<usize>) -> Result<usize, Fault> {
    if jobs == Some(0) {
        return Err(Fault::usage("--jobs 0: at least one task must run at a time"));
    }
    Ok(jobs.unwrap_or_else(|| std::thread::available_parallelism().map_or(1, std::num::NonZero::get)))
}

pub(super) fn tell(report: &Report, json: bool, quiet: bool) -> Result<(), Fault> {
    if json {
        data(&document_text(Kind::Run, report)?);
    } else if !quiet {
        data(&coloured(&table::report(report)));
    }
    for line in left_out(report) {
        say(&line);
    }
    for (name, failure) in report.failures() {
        say_failure(name, failure);
    }
    for step in report.cases.iter().flat_map(|case| &case.steps) {
        if let (Some(before), Some(now)) = (&step.differs_from, &step.content) {
            let (name, before, now) = (&step.name, short(before), short(now));
            say(&format!(
                "{name}: gave {now}, but the cache has {before} for equal inputs: the step is not deterministic"
            ));
        }
    }
    for warning in warnings(report) {
        say(&warning);
    }
    match report.status {
        Status::GateFailed => {
            say(&gates_failed(report));
            for gate in report.cases.iter().flat_map(|case| &case.gates) {
                for advice in &gate.advice {
                    say(&format!("  try: {}: {advice}", gate.step));
                }
            }
        }
        Status::Cancelled => say("interrupted; the next run goes on from the last finished task"),
        Status::Done | Status::Differs | Status::BadInput | Status::StepFailed => {}
    }
    Ok(())
}

/// A sweep over thousands of parts says no more than this of what was left out of them.
const MOST_LINES: usize = 100;

/// What readers left out of the files that they read, each once, however many cases read them.
pub(super) fn left_out(report: &Report) -> Vec<String> {
    let steps = report.cases.iter().flat_map(|case| &case.steps);
    let lines: BTreeSet<String> = steps
        .filter_map(|step| Some((&step.name, step.stats.as_ref()?.get("left-out")?.as_array()?)))
        .flat_map(|(name, all)| {
            all.iter().filter_map(move |what| Some(format!("{name}: left out on reading: {}", what.as_str()?)))
        })
        .collect();
    let rest = lines.len().saturating_sub(MOST_LINES);
    let mut lines: Vec<String> = lines.into_iter().take(MOST_LINES).collect();
    if rest > 0 {
        lines.push(format!("and {rest} more lines about what was left out on reading"));
    }
    lines
}

/// What steps say that their results lack.
pub(super) fn warnings(report: &Report) -> Vec<String> {
    let steps =
        report.cases.iter().flat_map(|case| case.steps.iter().map(move |step| (in_case(&case.name, &step.name), step)));
    let of = |(name, step): (String, &StepReport)| {
        let list =
            step.stats.as_ref().and_then(|stats| stats.get("warnings")).and_then(|list| list.as_array()).cloned();
        let texts = list.unwrap_or_default().into_iter().filter_map(|text| text.as_str().map(str::to_owned));
        texts.map(|text| format!("warning: {name}: {text}")).collect::<Vec<_>>()
    };
    steps.flat_map(of).collect()
}

/// Which checks did not hold.
fn gates_failed(report: &Report) -> String {
    let sections = report.cases.iter().flat_map(|case| &case.gates);
    let rows = sections.flat_map(|gate| gate.rows.iter().map(move |row| (gate, row)));
    let failed: BTreeSet<String> =
        rows.filter(|(_, row)| !row.passed).map(|(gate, row)| format!("{}: {}", gate.step, row.metric)).collect();
    let names: Vec<String> = failed.into_iter().collect();
    format!("a gate failed ({}); see the table, and the files below failed/", names.join(", "))
}

fn short(hash: &str) -> &str {
    hash.get(..12).unwrap_or(hash)
}
