//! `meshmill lock`: what a recipe was made of and what it gave, as a file that `run --locked` is held against.

use std::path::PathBuf;

use super::Global;
use super::class::ClassArguments;
use super::context::{RecipeArguments, lock_file, open_store};
use super::exit::{Exit, Fault, say};
use super::held;
use super::machine::MemoryArguments;
use super::picture::Pictures;
use super::run::{Ran, execute, options, tell};
use super::signals::Interrupt;
use crate::report::Status;
use crate::report::lock::{Lock, ingredients};
use crate::run;

/// Run a recipe and lock it: `run --locked` then fails with 5 when anything differs.
///
/// Parameters, inputs and revisions of steps must be the same in every class; results are compared as the class says.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    #[command(flatten)]
    recipe: RecipeArguments,
    #[command(flatten)]
    class: ClassArguments,
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

pub(super) fn run(arguments: &Arguments, global: &Global) -> Result<Exit, Fault> {
    let (class, tolerance) = arguments.class.read()?;
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
