//! `meshmill sweep`: a parameter study, all cases in one graph.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::Global;
use super::context::{Planned, RecipeArguments, list_files, open_store, pair, plan_cases, protected};
use super::exit::{Exit, Fault, data, say};
use super::machine::MemoryArguments;
use super::picture::{self, Pictures};
use super::record::write_record;
use super::run::{folder, jobs_of, left_out, path_bytes, traced, warnings};
use super::signals::Interrupt;
use super::tables::{Form, table_text, write_tables};
use super::unchanged::Unchanged;
use super::{goal, progress, report};
use crate::plan::sweep::sweep;
use crate::recipe::Recipe;
use crate::report::Report;
use crate::report::sweep::{RowState, SweepTable};
use crate::run::{self, RunOptions};
use crate::store::stamp::Said;

/// Run a recipe with many values of its parameters; what cases share runs once.
///
/// The axes stand in the recipe's [sweep] section or are given by -s. Each case writes to a folder of its own below
/// --out; sweep.csv and sweep.ron hold the table.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    #[command(flatten)]
    recipe: RecipeArguments,
    /// Values of a parameter or input: `1,2,4`, `1%..4%/5`, `0.1%..1%/5/log`, `a.stl,parts/*.stl`.
    #[arg(short = 's', long = "axis", value_name = "NAME=VALUES", value_parser = pair)]
    axes: Vec<(String, String)>,
    /// Folder of the cases and tables. Default: `out/NAME-sweep`.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Most tasks at once, and most threads. Default: one for each processor.
    #[arg(long, short, value_name = "N")]
    jobs: Option<usize>,
    #[command(flatten)]
    memory: MemoryArguments,
    /// Run steps again whose failure is remembered.
    #[arg(long)]
    retry_failed: bool,
    /// List the cases and run nothing.
    #[arg(long)]
    list: bool,
    /// Write `report.html` too: scatter with the Pareto front, parallel coordinates, a picture and the mesh of each
    /// case.
    #[arg(long)]
    report: bool,
    /// Print the table as one JSON document.
    #[arg(long, conflicts_with = "csv")]
    json: bool,
    /// Print the table as comma-separated values.
    #[arg(long)]
    csv: bool,
    /// Which outputs get a picture beside them: all where there are few of them, all, or none.
    #[arg(long, value_name = "WHICH", value_enum, default_value_t)]
    pictures: Pictures,
    /// Write a timeline for a trace viewer.
    #[arg(long, value_name = "FILE", conflicts_with = "goal")]
    trace: Option<PathBuf>,
    #[command(flatten)]
    search: goal::Arguments,
}

pub(super) fn run(arguments: &Arguments, global: &Global) -> Result<Exit, Fault> {
    let unchanged = arguments.unchanged(global);
    // Opened once, so that what there is to say of its levels is said once.
    let early = unchanged.as_ref().map(|_| open_store(global)).transpose()?;
    if let (Some(unchanged), Some(store)) = (&unchanged, &early)
        && let Some(exit) = unchanged.repeat(store).and_then(Exit::of_code)
    {
        return Ok(exit);
    }
    let recipe = arguments.recipe.load(&arguments.axes)?;
    let interrupt = Interrupt::listen();
    if arguments.search.goal.is_some() {
        let (store, options) =
            (early.map_or_else(|| open_store(global), Ok)?, options(arguments, &recipe, (&interrupt, global), "goal")?);
        let _claim = run::claim(&options.out)?;
        let observer = progress::observer(global.quiet, global.verbose > 0);
        let after = goal::After { form: arguments.form(), report: arguments.report, global, interrupt: &interrupt };
        return goal::run(&arguments.search, recipe, (&store, &options, observer), &after);
    }
    let found = sweep(&recipe, &list_files)?;
    arguments.recipe.check_fixed(&found.varied)?;
    let plan = plan_cases(&recipe, &found.cases, Some(&found.columns))?;
    if arguments.list {
        let names: Vec<&str> = found.cases.iter().map(|case| case.name.as_str()).collect();
        data(&names.join("\n"));
        return Ok(Exit::Done);
    }
    let (store, options) =
        (early.map_or_else(|| open_store(global), Ok)?, options(arguments, &recipe, (&interrupt, global), "sweep")?);
    let _claim = run::claim(&options.out)?;
    let trace = arguments.trace.as_deref();
    let planned = Planned { recipe, plan };
    let seen = if unchanged.is_some() { planned.seen() } else { Vec::new() };
    let Planned { recipe, plan } = planned;
    let outcome = traced(trace, global, &|observer| run::run(&plan, &store, &options, observer))?;
    let table = SweepTable::new(&recipe.name, &found.varied, &plan, &outcome);
    if outcome.cancelled {
        tell(&table, arguments, global.quiet)?;
        say("interrupted; the next sweep goes on from the last finished task");
        return Ok(interrupt.exit());
    }
    picture::write(&plan, &outcome, &store, arguments.pictures)?;
    let mut report = Report::new(&recipe.name, &plan, &outcome);
    report::describe(&mut report, &recipe);
    write_record(&report, &options.out)?;
    write_tables(&table, &options.out)?;
    if arguments.report {
        report::write(&report, Some(&table), &store, &[], &options.out.join("report.html"))?;
    }
    let mut said = tell(&table, arguments, global.quiet)?;
    for line in [left_out(&report), warnings(&report)].concat() {
        say(&line);
        said.err.push(line);
    }
    // Which files a pattern finds is not known from files.
    let whole = !found.lists_files && outcome.unsaved.is_none() && table.count(RowState::Failed) == 0;
    if let Some(unchanged) = unchanged.filter(|_| whole) {
        let mut written: Vec<PathBuf> = report.written().collect();
        written.extend(["sweep.csv", "sweep.ron"].map(|name| options.out.join(name)));
        unchanged.remember(&store, (seen, written), said, &report, &options.out)?;
    }
    Ok(exit(&table))
}

impl Arguments {
    fn form(&self) -> Form {
        match (self.json, self.csv) {
            (true, _) => Form::Json,
            (_, true) => Form::Csv,
            _ => Form::Text,
        }
    }

    /// The short cut for this sweep; none where more is asked for than that everything is up to date.
    fn unchanged(&self, global: &Global) -> Option<Unchanged> {
        let plain =
            self.search.goal.is_none() && !self.report && !self.list && self.trace.is_none() && global.verbose == 0;
        let mut more = vec![
            ("--out", path_bytes(self.out.as_deref())),
            ("--pictures", vec![self.pictures as u8]),
            ("--json --csv", vec![u8::from(self.json), u8::from(self.csv)]),
        ];
        more.extend(
            self.axes.iter().flat_map(|(name, values)| [("-s", name.clone().into()), ("", values.clone().into())]),
        );
        plain.then(|| Unchanged::of("sweep", &self.recipe, &more, global))
    }
}

fn options(
    arguments: &Arguments,
    recipe: &Recipe,
    (interrupt, global): (&Interrupt, &Global),
    what: &str,
) -> Result<RunOptions, Fault> {
    let usual = || Path::new("out").join(format!("{}-{what}", recipe.name));
    let out = folder(arguments.out.clone().unwrap_or_else(usual))?;
    let options = RunOptions {
        retry_failed: arguments.retry_failed,
        protected: protected(recipe),
        cancelled: Arc::clone(&interrupt.cancelled),
        ..RunOptions::new(&recipe.name, out, jobs_of(arguments.jobs)?)
    };
    Ok(arguments.memory.applied(options, global))
}

/// A case without a result counts for more than one whose gate does not hold.
fn exit(table: &SweepTable) -> Exit {
    if table.count(RowState::Failed) > 0 {
        Exit::Step
    } else if table.count(RowState::GateFailed) > 0 {
        Exit::Gate
    } else {
        Exit::Done
    }
}

/// Prints the table and what went wrong, and gives back what was said.
fn tell(table: &SweepTable, arguments: &Arguments, quiet: bool) -> Result<Said, Fault> {
    let out = table_text(table, arguments.form(), quiet)?;
    let mut err = Vec::new();
    for row in &table.rows {
        if let (RowState::Failed | RowState::GateFailed, Some(reason)) = (row.state, &row.reason) {
            err.push(format!("{}: {}: {reason}", row.case, row.state.text()));
        }
    }
    let (all, passed) = (table.rows.len(), table.count(RowState::Passed));
    if passed < all && !quiet {
        err.push(format!("{passed} of {all} cases passed"));
    }
    if !out.is_empty() {
        data(&out);
    }
    for line in &err {
        say(line);
    }
    Ok(Said { out, err, exit: exit(table) as u8 })
}
