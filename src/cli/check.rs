//! `meshmill check`: everything that is wrong with a recipe, without running it.

use super::context::{RecipeArguments, list_files, plan_cases};
use super::exit::{Exit, Fault, data};
use crate::plan::sweep::{has_sweep, sweep};

/// Check a recipe: steps, parameters, types, files, expressions, gates and outputs.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    #[command(flatten)]
    recipe: RecipeArguments,
}

pub(super) fn run(arguments: &Arguments) -> Result<Exit, Fault> {
    let planned = arguments.recipe.plan()?;
    let (steps, tasks) = (planned.recipe.steps.len(), planned.plan.len());
    let mut cases = String::new();
    if has_sweep(&planned.recipe) {
        let sweep = sweep(&planned.recipe, &list_files)?;
        plan_cases(&planned.recipe, &sweep.cases, Some(&sweep.columns))?;
        cases = format!("a sweep of {} cases, ", sweep.cases.len());
    }
    data(&format!("{}: {steps} steps, {tasks} tasks, {cases}nothing wrong", planned.recipe.name));
    Ok(Exit::Done)
}
