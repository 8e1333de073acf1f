//! `meshmill check`: everything that is wrong with a recipe, without running it.

use super::context::RecipeArguments;
use super::exit::{Exit, Fault, data};

/// Check a recipe: steps, parameters, types, files, expressions, gates and outputs.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    #[command(flatten)]
    recipe: RecipeArguments,
}

pub(super) fn run(arguments: &Arguments) -> Result<Exit, Fault> {
    let planned = arguments.recipe.plan()?;
    let (steps, tasks) = (planned.recipe.steps.len(), planned.plan.len());
    data(&format!("{}: {steps} steps, {tasks} tasks, nothing wrong", planned.recipe.name));
    Ok(Exit::Done)
}
