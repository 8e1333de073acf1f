//! `meshmill lock`: what a recipe was made of and what it gave, as a file that `run --locked` is held against.

use std::path::PathBuf;

use clap::ValueEnum;

use super::Global;
use super::context::{RecipeArguments, lock_file, open_store};
use super::exit::{Exit, Fault, say};
use super::held;
use super::machine::MemoryArguments;
use super::picture::Pictures;
use super::run::{Ran, execute, options, tell};
use super::signals::Interrupt;
use crate::report::Status;
use crate::report::lock::{Class, Lock, ingredients};
use crate::run;

/// Run a recipe and lock it: `run --locked` then fails with 5 when anything differs.
///
/// Parameters, inputs and revisions of steps must be the same in every class; results are compared as the class says.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    #[command(flatten)]
    recipe: RecipeArguments,
    /// How results are compared: by bytes, by metrics, or by metrics within --tolerance.
    #[arg(long, value_name = "CLASS", default_value = "bytes")]
    class: ClassName,
    /// Largest relative difference of a metric, for the class `tolerance`.
    #[arg(long, value_name = "NUMBER", default_value_t = 1e-6)]
    tolerance: f64,
    /// The lock file. Default: `NAME.lock.ron` beside the recipe.
    #[arg(long, value_name = "FILE")]
    to: Option<PathBuf>,
    /// Folder of the output files. Default: `out/NAME`.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Most tasks at once, and most threads. Default: one for each processor.
    #[arg(long, short, value_name = "N")]
    jobs: Option<usize>,
    #[command(flatten)]
    memory: MemoryArguments,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum ClassName {
    Bytes,
    Metrics,
    Tolerance,
}

pub(super) fn run(arguments: &Arguments, global: &Global) -> Result<Exit, Fault> {
    if !(0.0..1.0).contains(&arguments.tolerance) {
        return Err(Fault::usage("--tolerance is a number from 0 to less than 1: 0.001 is one in a thousand"));
    }
    let planned = arguments.recipe.plan()?;
    let store = open_store(global)?;
    let interrupt = Interrupt::listen();
    let mut options = options(&planned, arguments.out.as_deref(), arguments.jobs, &interrupt)?;
    let file = arguments.to.clone().unwrap_or_else(|| lock_file(&planned.recipe));
    planned.check_replaces(&file, &[])?;
    options.protected.push(file.clone());
    let options = arguments.memory.applied(options, global);
    let _claim = run::claim(&options.out)?;
    let before = ingredients(&planned.recipe.name, &planned.plan, &run::records(&planned.plan, &store, &options));
    let Ran { report, cancelled, keys, .. } = execute(&planned, &store, &options, global, (None, Pictures::default()))?;
    if report.status != Status::Done {
        tell(&report, false, global.quiet)?;
        say("nothing was locked");
        return Ok(if cancelled { interrupt.exit() } else { report.status.into() });
    }
    let class = match arguments.class {
        ClassName::Bytes => Class::Bytes,
        ClassName::Metrics => Class::Metrics,
        ClassName::Tolerance => Class::Tolerance,
    };
    let tolerance = if class == Class::Tolerance { arguments.tolerance } else { 0.0 };
    let lock = Lock { class, tolerance, ..before.with_results(&report, &options.out) };
    let text = lock.to_ron().map_err(|error| Fault::new(Exit::Fault, format!("cannot write the lock: {error}")))?;
    let written: Vec<PathBuf> = report.written().collect();
    planned.check_replaces(&file, &written)?;
    run::write_named(&file, text.as_bytes())?;
    held::pin(&file, &store, &keys);
    if !global.quiet {
        say(&format!("{}: locked {} tasks and {} files", file.display(), lock.tasks.len(), lock.files.len()));
    }
    Ok(Exit::Done)
}
