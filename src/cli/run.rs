//! `meshmill run`: a recipe from beginning to end.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::Global;
use super::context::{Planned, RecipeArguments, open_store};
use super::exit::{Exit, Fault, data, say, say_failure};
use super::picture;
use super::progress;
use super::report;
use super::signals::Interrupt;
use super::trace::Trace;
use crate::report::{Report, Status, record, table};
use crate::run::{self, Observer, RunOptions};

/// Run a recipe: what is not in the cache is computed, files are written where the gates hold.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    #[command(flatten)]
    recipe: RecipeArguments,
    /// Folder of the output files. Default: `out/NAME`.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Most tasks at once, and most threads. Default: one for each processor.
    #[arg(long, short, value_name = "N")]
    jobs: Option<usize>,
    /// Run only this step and what it needs.
    #[arg(long, value_name = "STEP")]
    only: Vec<String>,
    /// Run this step again although it is cached; a result that differs is a fault.
    #[arg(long, value_name = "STEP")]
    force: Vec<String>,
    /// Write `report.html` into the output folder too: graph, metrics, charts and meshes in one file.
    #[arg(long)]
    report: bool,
    /// Print the report as one JSON document.
    #[arg(long)]
    json: bool,
    /// Write a timeline for a trace viewer.
    #[arg(long, value_name = "FILE")]
    trace: Option<PathBuf>,
}

pub(super) fn run(arguments: &Arguments, global: &Global) -> Result<Exit, Fault> {
    let planned = arguments.recipe.plan()?;
    planned.check_steps("--only", &arguments.only)?;
    planned.check_steps("--force", &arguments.force)?;
    let store = open_store(global)?;
    let interrupt = Interrupt::listen();
    let mut options = options(&planned, arguments.out.as_deref(), arguments.jobs)?;
    options.only.clone_from(&arguments.only);
    options.force.clone_from(&arguments.force);
    options.cancelled = Arc::clone(&interrupt.cancelled);
    let mut observer: Arc<dyn Observer> = progress::observer(global.quiet, global.verbose > 0);
    let trace = arguments.trace.as_ref().map(|_| Arc::new(Trace::new(Arc::clone(&observer))));
    if let Some(trace) = &trace {
        observer = Arc::clone(trace) as Arc<dyn Observer>;
    }
    let outcome = run::run(&planned.plan, &store, &options, &observer)?;
    if let (Some(trace), Some(path)) = (&trace, &arguments.trace) {
        trace.write(path)?;
    }
    let mut report = Report::new(&planned.recipe.name, &planned.plan, &outcome);
    report::describe(&mut report, &planned.recipe);
    if !outcome.cancelled {
        picture::write(&planned.plan, &outcome, &store)?;
        write_record(&report, &options.out)?;
        if arguments.report {
            report::write(&report, &store, &[], &options.out.join("report.html"))?;
        }
    }
    tell(&report, arguments.json, global.quiet)?;
    Ok(if outcome.cancelled { interrupt.exit() } else { report.status.into() })
}

/// The options of a run of this recipe.
pub(super) fn options(planned: &Planned, out: Option<&Path>, jobs: Option<usize>) -> Result<RunOptions, Fault> {
    if jobs == Some(0) {
        return Err(Fault::usage("--jobs 0: at least one task must run at a time"));
    }
    let name = planned.recipe.name.clone();
    let jobs = jobs.unwrap_or_else(|| std::thread::available_parallelism().map_or(1, std::num::NonZero::get));
    let out = out.map_or_else(|| Path::new("out").join(&name), Path::to_path_buf);
    Ok(RunOptions { name, out, jobs, only: Vec::new(), force: Vec::new(), cancelled: Arc::default() })
}

fn write_record(report: &Report, out: &Path) -> Result<(), Fault> {
    let text =
        record::to_ron(report).map_err(|error| Fault::new(Exit::Fault, format!("cannot write run.ron: {error}")))?;
    Ok(run::write_file(&out.join("run.ron"), text.as_bytes())?)
}

fn tell(report: &Report, json: bool, quiet: bool) -> Result<(), Fault> {
    if json {
        let text = serde_json::to_string_pretty(report);
        data(&text.map_err(|error| Fault::new(Exit::Fault, format!("cannot write the report: {error}")))?);
    } else if !quiet {
        data(&table::report(report));
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
    match report.status {
        Status::GateFailed => say("a gate failed; see the table, and the files below failed/"),
        Status::Cancelled => say("interrupted; the next run goes on from the last finished task"),
        Status::Done | Status::Differs | Status::BadInput | Status::StepFailed => {}
    }
    Ok(())
}

fn short(hash: &str) -> &str {
    hash.get(..12).unwrap_or(hash)
}
