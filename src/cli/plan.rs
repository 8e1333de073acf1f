//! `meshmill plan`: what a run would do with each task, and why.

use std::collections::BTreeMap;
use std::fs;
use std::path::PathBuf;

use serde_json::{Value, json};

use super::Global;
use super::context::{RecipeArguments, open_store};
use super::exit::{Exit, Fault, data};
use super::run::options;
use crate::plan::{Key, Plan, Record, Task};
use crate::report::{record, table};
use crate::run::{Forecast, preview};

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
    /// Print one JSON document.
    #[arg(long)]
    json: bool,
}

pub(super) fn run(arguments: &Arguments, global: &Global) -> Result<Exit, Fault> {
    let planned = arguments.recipe.plan()?;
    planned.check_steps("--force", &arguments.force)?;
    let store = open_store(global)?;
    let mut options = options(&planned, arguments.out.as_deref(), None)?;
    options.force.clone_from(&arguments.force);
    let earlier = fs::read_to_string(options.out.join("run.ron")).map(|text| record::keys(&text)).unwrap_or_default();
    let known = |label: &str| known(&store, &earlier, label);
    let forecasts = preview(&planned.plan, &store, &options, &known);
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
        runs += usize::from(!matches!(forecast, Forecast::Source | Forecast::Cached(_)));
        rows.add_row([node.label.clone(), kind(&node.task).to_owned(), words]);
    }
    let tasks = plan.order().filter(|id| !matches!(plan.node(*id).task, Task::Source(_))).count();
    format!("{}\n\n{runs} of {tasks} tasks to run", table::text(&rows))
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
