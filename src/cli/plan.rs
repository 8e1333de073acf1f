//! `meshmill plan`: what a run would do with each task, and why.

use std::collections::BTreeMap;
use std::fs;
use std::path::PathBuf;

use serde_json::{Value, json};

use super::Global;
use super::context::{RecipeArguments, open_store};
use super::exit::{Exit, Fault, data};
use super::run::options;
use super::signals::Interrupt;
use crate::plan::{Key, Plan, Record, Task, TaskId};
use crate::report::{record, table};
use crate::run::{Explained, Forecast, explain};

/// Say what a run would do: cached, dependent on a task that has to run, or why a task has to run.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    #[command(flatten)]
    recipe: RecipeArguments,
    /// Folder of the output files, whose `run.ron` tells what was there before. Default: `out/NAME`.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Suppose that this step is run again.
    #[arg(long, value_name = "STEP")]
    force: Vec<String>,
    /// Suppose that steps are run again whose failure is remembered.
    #[arg(long)]
    retry_failed: bool,
    /// Compare the key of this step with that of its earlier result, field by field.
    #[arg(long, value_name = "STEP")]
    explain: Vec<String>,
    /// Print one JSON document.
    #[arg(long)]
    json: bool,
}

pub(super) fn run(arguments: &Arguments, global: &Global) -> Result<Exit, Fault> {
    let planned = arguments.recipe.plan()?;
    planned.check_steps("--force", &arguments.force)?;
    let store = open_store(global)?;
    planned.check_steps("--explain", &arguments.explain)?;
    let mut options = options(&planned, arguments.out.as_deref(), None, &Interrupt::default())?;
    options.force.clone_from(&arguments.force);
    options.retry_failed = arguments.retry_failed;
    let earlier = fs::read_to_string(options.out.join("run.ron")).map(|text| record::keys(&text)).unwrap_or_default();
    let known = |label: &str| known(&store, &earlier, label);
    let explained = explain(&planned.plan, &store, &options, &known);
    if !arguments.explain.is_empty() {
        data(&keys(&planned.plan, &explained, &arguments.explain, arguments.json));
        return Ok(Exit::Done);
    }
    let forecasts: Vec<Forecast> = explained.into_iter().map(|explained| explained.forecast).collect();
    if arguments.json {
        data(&to_json(&planned.plan, &forecasts).to_string());
    } else {
        data(&to_text(&planned.plan, &forecasts));
    }
    let unreadable = forecasts.iter().any(|forecast| matches!(forecast, Forecast::Unreadable(_)));
    Ok(if unreadable { Exit::Usage } else { Exit::Done })
}

fn known(store: &crate::store::Store, earlier: &BTreeMap<String, String>, label: &str) -> Option<Record> {
    let key = Key::from_hex(earlier.get(label)?).ok()?;
    Some(Record { fields: store.entry(&key)?.record })
}

fn to_text(plan: &Plan, forecasts: &[Forecast]) -> String {
    let mut rows = table::plain(&["task", "kind", "forecast"]);
    let mut runs = 0;
    for (id, forecast) in plan.order().zip(forecasts) {
        let node = plan.node(id);
        let words = words(plan, forecast);
        runs += usize::from(!matches!(forecast, Forecast::Source | Forecast::Cached(_) | Forecast::Failed(..)));
        table::add(&mut rows, [node.label.clone(), kind(&node.task).to_owned(), words]);
    }
    let tasks = plan.order().filter(|id| !matches!(plan.node(*id).task, Task::Source(_))).count();
    format!("{}\n\n{runs} of {tasks} tasks to run", table::text(&rows))
}

/// The fields of the keys of these steps and their gates, before and now; what differs is marked.
fn keys(plan: &Plan, explained: &[Explained], steps: &[String], json: bool) -> String {
    let case = &plan.cases()[0];
    let of_step = |name: &str| steps.iter().any(|step| name == step || name.starts_with(&format!("{step}.")));
    let mut tasks: Vec<TaskId> = case.steps.iter().filter(|(name, _)| of_step(name)).map(|(_, id)| *id).collect();
    tasks.extend(case.gates.iter().filter(|gate| of_step(&gate.step)).flat_map(|gate| gate.tasks.iter().copied()));
    tasks.sort_unstable();
    tasks.dedup();
    let (mut parts, mut documents) = (Vec::new(), Vec::new());
    for id in tasks {
        let explained = &explained[id.index()];
        let rows = fields(plan, id, explained);
        let (label, why) = (&plan.node(id).label, words(plan, &explained.forecast));
        if json {
            let fields = rows.iter().map(|[mark, field, before, now]| {
                json!({ "field": field, "before": before, "now": now, "differs": mark == "*" })
            });
            documents.push(json!({ "task": label, "why": why, "fields": fields.collect::<Vec<_>>() }));
            continue;
        }
        let mut table = table::plain(&["", "field", "before", "now"]);
        for row in rows {
            table::add(&mut table, row);
        }
        parts.push(format!("{label}: {why}\n{}", table::text(&table)));
    }
    if json { json!({ "tasks": documents }).to_string() } else { parts.join("\n\n") }
}

/// Mark, name, value before and value now of every field of a key.
fn fields(plan: &Plan, id: TaskId, explained: &Explained) -> Vec<[String; 4]> {
    let unknown = plan
        .inputs(id)
        .into_iter()
        .map(|(name, input)| (format!("input {name}"), format!("not known before {} has run", plan.node(input).label)));
    let unknown: BTreeMap<String, String> = unknown.filter(|(name, _)| explained.now.get(name).is_none()).collect();
    let names = explained.now.fields.iter().map(|(name, _)| name).chain(unknown.keys());
    let gone = explained.earlier.iter().flat_map(|earlier| earlier.fields.iter().map(|(name, _)| name));
    let gone = gone.filter(|name| explained.now.get(name).is_none() && !unknown.contains_key(*name));
    let row = |name: &String| {
        let before = explained.earlier.as_ref().map(|earlier| earlier.get(name).unwrap_or("not given"));
        let waits = unknown.get(name);
        let now = waits.map_or_else(|| explained.now.get(name).unwrap_or("not given"), String::as_str);
        let mark = match (waits, before) {
            (Some(_), _) => "?",
            (None, Some(before)) if before != now => "*",
            (None, _) => "",
        };
        let short = |text: &str| {
            let is_hash = name.starts_with("input ") && text.len() == 64;
            if is_hash { text[..12].to_owned() } else { text.to_owned() }
        };
        [mark.to_owned(), name.clone(), before.map(short).unwrap_or_default(), short(now)]
    };
    names.chain(gone).map(row).collect()
}

fn kind(task: &Task) -> &'static str {
    match task {
        Task::Source(_) => "file",
        Task::Step(step) => step.def.name,
        Task::Gate(_) => "gate",
    }
}

fn words(plan: &Plan, forecast: &Forecast) -> String {
    match forecast {
        Forecast::Source => "read".to_owned(),
        Forecast::Unreadable(failure) => failure.message.clone(),
        Forecast::Cached(_) => "cached".to_owned(),
        Forecast::Failed(_, failure) => format!("failed before: {}", failure.message),
        Forecast::Forced(_) => "runs again: forced".to_owned(),
        Forecast::DependsOn(tasks) => {
            let names: Vec<&str> = tasks.iter().map(|task| plan.node(*task).label.as_str()).collect();
            format!("depends on {}", names.join(", "))
        }
        Forecast::New(_) => "runs: new".to_owned(),
        Forecast::Changed(_, changes) => {
            let changes: Vec<String> = changes.iter().map(ToString::to_string).collect();
            format!("runs: {}", changes.join("; "))
        }
        Forecast::Gone(_) => "runs: its result was removed from the cache".to_owned(),
    }
}

fn to_json(plan: &Plan, forecasts: &[Forecast]) -> Value {
    let tasks = plan.order().zip(forecasts).map(|(id, forecast)| {
        let node = plan.node(id);
        let (state, key, changes) = match forecast {
            Forecast::Source => ("source", None, Vec::new()),
            Forecast::Unreadable(_) => ("unreadable", None, Vec::new()),
            Forecast::Cached(key) => ("cached", Some(key), Vec::new()),
            Forecast::Failed(key, _) => ("failed", Some(key), Vec::new()),
            Forecast::Forced(key) => ("forced", Some(key), Vec::new()),
            Forecast::DependsOn(_) => ("depends", None, Vec::new()),
            Forecast::New(key) => ("new", Some(key), Vec::new()),
            Forecast::Changed(key, changes) => ("changed", Some(key), changes.clone()),
            Forecast::Gone(key) => ("gone", Some(key), Vec::new()),
        };
        json!({
            "task": node.label,
            "kind": kind(&node.task),
            "state": state,
            "why": words(plan, forecast),
            "key": key.map(|key| key.to_hex().to_string()),
            "changes": changes,
        })
    });
    json!({ "tasks": tasks.collect::<Vec<_>>() })
}
