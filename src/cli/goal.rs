//! `meshmill sweep --goal`: a search for the best values of parameters, every evaluation a cached case.

use std::fmt::Write;
use std::path::Path;
use std::sync::Arc;

use super::context::{plan_cases, relative};
use super::exit::{Exit, Fault, data, say};
use super::run::{tell_unsaved, write_record};
use super::signals::Interrupt;
use super::sweep::{Arguments, table_text, write_tables};
use super::{Global, report};
use crate::plan::CaseSpec;
use crate::plan::goal::search::{Merit, search};
use crate::plan::goal::{Goal, parse};
use crate::recipe::{Diagnostics, Recipe, Span, Tree, Value, node_of, suggest};
use crate::report::Report;
use crate::report::measure::value_text;
use crate::report::sweep::{RowState, SweepRow, SweepTable};
use crate::run::{self, Observer, Plan, RunOptions, RunOutcome};
use crate::store::Store;

/// A parameter and where it may go.
struct Variable {
    name: String,
    span: Span,
    from: f64,
    to: f64,
    percent: bool,
    /// Where the recipe has it.
    start: f64,
}

impl Variable {
    /// Sizes and tolerances are matters of ratio.
    fn is_log(&self) -> bool {
        self.from > 0.0
    }

    fn part(&self, value: f64) -> f64 {
        let part = if self.is_log() {
            libm::log(value.max(self.from) / self.from) / libm::log(self.to / self.from)
        } else {
            (value - self.from) / (self.to - self.from)
        };
        part.clamp(0.0, 1.0)
    }

    fn value(&self, part: f64) -> Value {
        let between = |value: f64| value.clamp(self.from, self.to);
        // The start is the recipe's own value, to the last digit.
        let value = if part == self.part(self.start) && between(self.start) == self.start {
            self.start
        } else if self.is_log() {
            between(short(self.from * libm::exp(part * libm::log(self.to / self.from))))
        } else {
            between(short(self.from + part * (self.to - self.from)))
        };
        if self.percent { Value::Percent(value) } else { Value::Number(value) }
    }
}

/// Three significant digits: a value that a person would write.
fn short(value: f64) -> f64 {
    format!("{value:.2e}").parse().unwrap_or(value)
}

/// A search under way.
struct Hunt<'a> {
    recipe: &'a Recipe,
    goal: Goal,
    variables: Vec<Variable>,
    store: &'a Store,
    options: &'a RunOptions,
    observer: Arc<dyn Observer>,
    table: SweepTable,
    /// The cases of the table.
    specs: Vec<CaseSpec>,
    merits: Vec<Merit>,
    fault: Option<Fault>,
    /// Whether it was said that the cache cannot be written.
    told: bool,
}

pub(super) fn run(
    arguments: &Arguments,
    global: &Global,
    mut recipe: Recipe,
    (store, options, observer): (&Store, &RunOptions, Arc<dyn Observer>),
    interrupt: &Interrupt,
) -> Result<Exit, Fault> {
    let text = arguments.goal.clone().unwrap_or_default();
    let base = Arc::make_mut(&mut recipe.sources).add("--goal", "", text.clone());
    let goal = parse(&text, base);
    let variables = variables(&mut recipe, &arguments.vary)?;
    let goal = goal.map_err(|problem| Diagnostics::new(Arc::clone(&recipe.sources), vec![problem]))?;
    let start: Vec<f64> = variables.iter().map(|variable| variable.part(variable.start)).collect();
    let mut hunt = Hunt {
        recipe: &recipe,
        goal,
        table: SweepTable { recipe: recipe.name.clone(), ..SweepTable::default() },
        variables,
        store,
        options,
        observer,
        specs: Vec::new(),
        merits: Vec::new(),
        fault: None,
        told: false,
    };
    search(&start, arguments.evaluations as usize, &mut |point| hunt.evaluate(point));
    if let Some(fault) = hunt.fault {
        return Err(fault);
    }
    hunt.finish(arguments, global, &text, interrupt)
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
        let wrong = |message: String| Fault::usage(format!("--vary {name}={text}: {message}"));
        let Some(value) = scope.params.get(name) else {
            let help = suggest::did_you_mean(name, "there are", scope.params.keys().map(String::as_str));
            return Err(wrong(format!("the recipe has no parameter `{name}`")).help_opt(help));
        };
        let (start, is_percent) = match value {
            Some(Value::Number(value)) => (*value, false),
            Some(Value::Percent(value)) => (*value, true),
            _ => return Err(wrong("only a number or a percent can be varied".to_owned())),
        };
        let bound = |text: &str| -> Option<(f64, bool)> {
            let (number, percent) = text.strip_suffix('%').map_or((text, false), |number| (number, true));
            Some((number.trim().parse().ok().filter(|value: &f64| value.is_finite())?, percent))
        };
        let bounds = text.split_once("..").and_then(|(from, to)| Some((bound(from)?, bound(to)?)));
        let Some(((from, a), (to, b))) = bounds.filter(|(from, to)| from.0 < to.0) else {
            return Err(wrong("a range is FROM..TO, as in 1%..6%, the smaller one first".to_owned()));
        };
        if a != is_percent || b != is_percent {
            let kind = if is_percent { "a percent" } else { "a number" };
            return Err(wrong(format!("`{name}` is {kind}, and so must be both bounds")));
        }
        if variables.iter().any(|other| other.name == *name) {
            return Err(wrong("it is varied twice".to_owned()));
        }
        variables.push(Variable { name: name.clone(), span, from, to, percent: is_percent, start });
    }
    Ok(variables)
}

impl Hunt<'_> {
    /// Runs one case; `None` ends the search.
    fn evaluate(&mut self, point: &[f64]) -> Option<Merit> {
        let spec = self.spec(point);
        let planned = plan_cases(self.recipe, std::slice::from_ref(&spec), Some(&self.goal.columns));
        let plan = planned.map_err(|fault| self.fault = Some(fault)).ok()?;
        let outcome = run::run(&plan, self.store, self.options, &self.observer);
        let outcome = outcome.map_err(|error| self.fault = Some(error.into())).ok()?;
        if outcome.cancelled {
            return None;
        }
        let told = self.told || outcome.unsaved.is_some();
        let outcome = if self.told { outcome } else { tell_unsaved(outcome) };
        self.told = told;
        let names: Vec<String> = self.variables.iter().map(|variable| variable.name.clone()).collect();
        let mut table = SweepTable::new(&self.recipe.name, &names, &plan, &outcome);
        let mut row = table.rows.pop()?;
        let merit = self.merit(&plan, &outcome, &mut row);
        let value = row.values.first().copied().flatten();
        let value = value.as_ref().map_or_else(|| "undefined".to_owned(), value_text);
        say(&format!("{}: {}: {value}, {}", self.merits.len() + 1, row.case, row.state.text()));
        self.merits.push(merit);
        self.table.parameters = table.parameters;
        self.table.columns = table.columns;
        self.table.rows.push(row);
        self.specs.push(spec);
        Some(merit)
    }

    fn spec(&self, point: &[f64]) -> CaseSpec {
        let mut spec = CaseSpec::default();
        let mut names = Vec::new();
        for (variable, part) in self.variables.iter().zip(point) {
            let value = variable.value(*part);
            names.push(format!("{}-{}", variable.name, value.to_string().replace('%', "pct")));
            spec.params.push((variable.name.clone(), Tree { span: variable.span, value: node_of(value) }));
        }
        spec.name = names.join("_");
        spec
    }

    /// How good the case is; notes in its row which condition of the goal does not hold.
    fn merit(&self, plan: &Plan, outcome: &RunOutcome, row: &mut SweepRow) -> Merit {
        let nothing = Merit { violation: f64::INFINITY, objective: f64::INFINITY };
        let Some(case) = plan.cases().first() else { return nothing };
        if row.state == RowState::Failed {
            return nothing;
        }
        let gates = case.gates.iter().flat_map(|gate| gate.tasks.iter().map(|task| (gate.step.as_str(), *task)));
        let conditions = case.columns.iter().skip(1).map(|column| ("goal", column.task));
        let mut violation = 0.0;
        for (step, task) in gates.chain(conditions) {
            for judged in outcome.task(task).gate_report().map(|report| report.rows).unwrap_or_default() {
                if judged.passed {
                    continue;
                }
                let short = judged.slack.map_or(1.0, f64::abs);
                let scale = judged.measured.map_or(0.0, |value| value.as_f64().abs()) + short;
                violation += 1.0 + if scale > 0.0 { short / scale } else { 1.0 };
                if step == "goal" {
                    let reason = crate::report::sweep::wanted(step, &judged);
                    row.reason = Some(row.reason.take().map_or(reason.clone(), |other| format!("{other}; {reason}")));
                    row.state = RowState::GateFailed;
                }
            }
        }
        let objective = row.values.first().copied().flatten().map_or(f64::INFINITY, crate::metric::Value::as_f64);
        Merit { violation, objective: if self.goal.maximize { -objective } else { objective } }
    }

    fn finish(self, arguments: &Arguments, global: &Global, text: &str, interrupt: &Interrupt) -> Result<Exit, Fault> {
        write_tables(&self.table, &self.options.out)?;
        let table = table_text(&self.table, arguments, global.quiet)?;
        if !table.is_empty() {
            data(&table);
        }
        let best = (0..self.merits.len()).reduce(|best, at| {
            let (a, b) = (self.merits[best], self.merits[at]);
            if b.partial_cmp(&a) == Some(std::cmp::Ordering::Less) { at } else { best }
        });
        if self.options.cancelled.load(std::sync::atomic::Ordering::Relaxed) {
            say("interrupted; the next search goes on from what is cached");
            return Ok(interrupt.exit());
        }
        let Some(best) = best else { return Ok(Exit::Fault) };
        if arguments.report {
            self.report()?;
        }
        let row = &self.table.rows[best];
        if self.merits[best].violation > 0.0 {
            say(&format!("none of {} evaluations reaches the goal; the nearest is {}", self.merits.len(), row.case));
            if let Some(reason) = &row.reason {
                say(&format!("  {reason}"));
            }
            return Ok(if row.state == RowState::Failed { Exit::Step } else { Exit::Gate });
        }
        let file = self.options.out.join("best.toml");
        run::write_file(&file, self.best_recipe(row, text, &file).as_bytes())?;
        if !global.quiet {
            let column = self.table.columns.first().map(|column| column.name.clone()).unwrap_or_default();
            let value =
                |row: &SweepRow| row.values.first().and_then(Option::as_ref).map(value_text).unwrap_or_default();
            let first = self.table.rows.first().map(value).unwrap_or_default();
            say(&format!(
                "best of {}: {}, {column} {} (the recipe itself: {first})",
                self.merits.len(),
                row.case,
                value(row)
            ));
            data(&file.display().to_string());
        }
        Ok(Exit::Done)
    }

    /// Writes the record and the report of all evaluations, which are in the cache.
    fn report(&self) -> Result<(), Fault> {
        let plan = plan_cases(self.recipe, &self.specs, Some(&self.goal.columns))?;
        let silent: Arc<dyn Observer> = Arc::new(run::Silent);
        let outcome = tell_unsaved(run::run(&plan, self.store, self.options, &silent)?);
        let mut report = Report::new(&self.recipe.name, &plan, &outcome);
        report::describe(&mut report, self.recipe);
        write_record(&report, &self.options.out)?;
        report::write(&report, Some(&self.table), self.store, &[], &self.options.out.join("report.html"))
    }

    /// A recipe that extends the one searched, with every parameter filled in.
    fn best_recipe(&self, row: &SweepRow, text: &str, file: &Path) -> String {
        let quoted = |text: &str| toml::Value::from(text).to_string();
        let slashes = |path: &Path| path.to_string_lossy().replace('\\', "/");
        let recipe = relative(&self.recipe.path, file.parent().unwrap_or(Path::new("")));
        let mut lines = format!(
            "# {}\n# The best of {} evaluations: {}.\n",
            text.replace(char::is_control, " "),
            self.merits.len(),
            row.case
        );
        // Writing to a string cannot fail.
        let _ = writeln!(
            lines,
            "extends = {}\nname = {}\n",
            quoted(&slashes(&recipe)),
            quoted(&format!("{}-best", self.recipe.name))
        );
        let overridden =
            self.recipe.inputs.in_order().into_iter().filter_map(|(name, entry)| match &entry.value.value {
                crate::recipe::Node::File(path) => Some((name, path)),
                _ => None,
            });
        let inputs: Vec<String> = overridden
            .map(|(name, path)| {
                let path = relative(path, file.parent().unwrap_or(Path::new("")));
                format!("{name} = {}\n", quoted(&slashes(&path)))
            })
            .collect();
        if !inputs.is_empty() {
            let _ = writeln!(lines, "[inputs]\n{}", inputs.concat());
        }
        let varied: Vec<(String, Tree)> = self
            .table
            .parameters
            .iter()
            .zip(&row.parameters)
            .zip(&self.variables)
            .map(|((name, text), variable)| {
                let number = text.trim_end_matches('%').parse().unwrap_or(variable.start);
                let value = if variable.percent { Value::Percent(number) } else { Value::Number(number) };
                (name.clone(), Tree { span: variable.span, value: node_of(value) })
            })
            .collect();
        let scope = self.recipe.scope(&varied, &mut Vec::new());
        lines.push_str("[params]\n");
        for (name, value) in &scope.params {
            let value = match value {
                Some(Value::Text(text)) if text.starts_with('=') => quoted(&format!("={text}")),
                Some(value @ (Value::Text(_) | Value::Percent(_))) => quoted(&value.to_string()),
                Some(value @ (Value::Number(_) | Value::Bool(_))) => value.to_string(),
                Some(Value::File(_)) | None => continue,
            };
            let key = if name.is_ascii() { name.clone() } else { quoted(name) };
            let _ = writeln!(lines, "{key} = {value}");
        }
        lines
    }
}
