//! `meshmill sweep --goal`: a search for the best values of parameters, every evaluation a cached case.

use std::sync::Arc;
use std::sync::atomic::Ordering;

use super::context::{pair, plan_cases};
use super::exit::{Exit, Fault, data, say};
use super::record::write_record;
use super::run::tell_unsaved;
use super::signals::Interrupt;
use super::tables::{Form, table_text, write_tables};
use super::{Global, best, report};
use crate::plan::CaseSpec;
use crate::plan::goal::search::Merit;
use crate::plan::goal::vary::Variable;
use crate::plan::goal::{Goal, parse};
use crate::recipe::{Diagnostics, Recipe, Span};
use crate::report::Report;
use crate::report::measure::value_text;
use crate::report::sweep::{RowState, SweepRow, SweepTable};
use crate::run::study::{Evaluation, Study};
use crate::run::{self, Observer, RunOptions};
use crate::store::Store;

/// What to search for.
#[derive(Debug, clap::Args)]
#[group(skip)]
pub(super) struct Arguments {
    /// Search for the best values in the place of a grid: "min faces where min-stretch >= 0.3 and distance <= 0.2%".
    /// The recipe's gates must hold too. The best recipe is written to `best.toml`.
    #[arg(long, value_name = "GOAL", conflicts_with_all = ["axes", "list"])]
    pub(super) goal: Option<String>,
    /// A parameter that the search may change, and between which values: `size=1%..6%`.
    #[arg(long, value_name = "NAME=FROM..TO", value_parser = pair, requires = "goal")]
    vary: Vec<(String, String)>,
    /// How many cases the search may run.
    #[arg(long, value_name = "N", default_value_t = 12, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    evaluations: u32,
}

/// What a search has found so far.
struct Found {
    table: SweepTable,
    /// The cases of the table.
    specs: Vec<CaseSpec>,
    merits: Vec<Merit>,
}

/// What is done with it.
pub(super) struct After<'a> {
    pub(super) form: Form,
    pub(super) report: bool,
    pub(super) global: &'a Global,
    pub(super) interrupt: &'a Interrupt,
}

pub(super) fn run(
    arguments: &Arguments,
    mut recipe: Recipe,
    (store, options, observer): (&Store, &RunOptions, Arc<dyn Observer>),
    after: &After<'_>,
) -> Result<Exit, Fault> {
    let text = arguments.goal.clone().unwrap_or_default();
    let base = Arc::make_mut(&mut recipe.sources).add("--goal", "", text.clone());
    let goal = parse(&text, base);
    let variables = variables(&mut recipe, &arguments.vary)?;
    let goal = goal.map_err(|problem| Diagnostics::new(Arc::clone(&recipe.sources), vec![problem]))?;
    let table = SweepTable { recipe: recipe.name.clone(), ..SweepTable::default() };
    let mut found = Found { table, specs: Vec::new(), merits: Vec::new() };
    let study = Study {
        goal: &goal,
        variables: &variables,
        evaluations: arguments.evaluations as usize,
        plan: &|spec: &CaseSpec| plan_cases(&recipe, std::slice::from_ref(spec), Some(&goal.columns)),
        store,
        options,
        observer,
    };
    let names: Vec<String> = variables.iter().map(|variable| variable.name.clone()).collect();
    // That the cache cannot be written is said once.
    let mut told = false;
    study.search(&mut |evaluation| {
        if !told {
            told = evaluation.outcome.unsaved.is_some();
            tell_unsaved(&evaluation.outcome);
        }
        found.add(&names, evaluation);
    })?;
    found.finish(&recipe, (&goal, &text), (store, options), after)
}

/// The parameters that `--vary` names.
fn variables(recipe: &mut Recipe, vary: &[(String, String)]) -> Result<Vec<Variable>, Fault> {
    let mut problems = recipe.problems.clone();
    let scope = recipe.scope(&[], &mut problems);
    if !problems.is_empty() {
        return Err(Diagnostics::new(Arc::clone(&recipe.sources), problems).into());
    }
    if vary.is_empty() {
        return Err(Fault::usage("--goal needs something to vary").help("give --vary size=1%..6%"));
    }
    let mut variables: Vec<Variable> = Vec::new();
    for (name, text) in vary {
        let base = Arc::make_mut(&mut recipe.sources).add("--vary", "", format!("{name}={text}"));
        let span = Span { start: base, end: base + name.len() + 1 + text.len() };
        let wrong = |message: &str| Fault::usage(format!("--vary {name}={text}: {message}"));
        let variable = Variable::parse(name, text, span, &scope);
        let variable = variable.map_err(|unfit| wrong(&unfit.message).help_opt(unfit.help))?;
        if variables.iter().any(|other| other.name == *name) {
            return Err(wrong("it is varied twice"));
        }
        variables.push(variable);
    }
    Ok(variables)
}

impl Found {
    /// Takes a case into the table, and says how it went.
    fn add(&mut self, names: &[String], evaluation: Evaluation) {
        let Evaluation { spec, plan, outcome, merit, unmet } = evaluation;
        let mut table = SweepTable::new(&self.table.recipe, names, &plan, &outcome);
        let Some(mut row) = table.rows.pop() else { return };
        row.misses(&unmet);
        let value = row.values.first().copied().flatten();
        let value = value.as_ref().map_or_else(|| "undefined".to_owned(), value_text);
        say(&format!("{}: {}: {value}, {}", self.merits.len() + 1, row.case, row.state.text()));
        self.merits.push(merit);
        self.table.parameters = table.parameters;
        self.table.columns = table.columns;
        self.table.rows.push(row);
        self.specs.push(spec);
    }

    fn finish(
        self,
        recipe: &Recipe,
        (goal, text): (&Goal, &str),
        (store, options): (&Store, &RunOptions),
        after: &After<'_>,
    ) -> Result<Exit, Fault> {
        write_tables(&self.table, &options.out)?;
        let table = table_text(&self.table, after.form, after.global.quiet)?;
        if !table.is_empty() {
            data(&table);
        }
        let best = (0..self.merits.len()).reduce(|best, at| {
            let (a, b) = (self.merits[best], self.merits[at]);
            if b.partial_cmp(&a) == Some(std::cmp::Ordering::Less) { at } else { best }
        });
        if options.cancelled.load(Ordering::Relaxed) {
            say("interrupted; the next search goes on from what is cached");
            return Ok(after.interrupt.exit());
        }
        let Some(best) = best else { return Ok(Exit::Fault) };
        if after.report {
            self.report(recipe, goal, (store, options))?;
        }
        let row = &self.table.rows[best];
        let count = self.merits.len();
        if self.merits[best].violation > 0.0 {
            say(&format!("none of {count} evaluations reaches the goal; the nearest is {}", row.case));
            if let Some(reason) = &row.reason {
                say(&format!("  {reason}"));
            }
            return Ok(if row.state == RowState::Failed { Exit::Step } else { Exit::Gate });
        }
        let file = options.out.join("best.toml");
        let head = [text.to_owned(), format!("The best of {count} evaluations: {}.", row.case)];
        run::write_file(&file, best::recipe(recipe, &self.specs[best], &head, &file).as_bytes())?;
        if !after.global.quiet {
            self.say_best(row);
            data(&file.display().to_string());
        }
        Ok(Exit::Done)
    }

    fn say_best(&self, row: &SweepRow) {
        let column = self.table.columns.first().map(|column| column.name.clone()).unwrap_or_default();
        let value = |row: &SweepRow| row.values.first().and_then(Option::as_ref).map(value_text).unwrap_or_default();
        let first = self.table.rows.first().map(value).unwrap_or_default();
        let (count, case, best) = (self.merits.len(), &row.case, value(row));
        say(&format!("best of {count}: {case}, {column} {best} (the recipe itself: {first})"));
    }

    /// Writes the record and the report of all evaluations, which are in the cache.
    fn report(&self, recipe: &Recipe, goal: &Goal, (store, options): (&Store, &RunOptions)) -> Result<(), Fault> {
        let plan = plan_cases(recipe, &self.specs, Some(&goal.columns))?;
        let silent: Arc<dyn Observer> = Arc::new(run::Silent);
        let outcome = run::run(&plan, store, options, &silent)?;
        tell_unsaved(&outcome);
        let mut report = Report::new(&recipe.name, &plan, &outcome);
        report::describe(&mut report, recipe);
        write_record(&report, &options.out)?;
        report::write(&report, Some(&self.table), store, &[], &options.out.join("report.html"))
    }
}
