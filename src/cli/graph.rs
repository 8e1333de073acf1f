//! `meshmill graph`: the tasks of a recipe as a drawing.

use clap::ValueEnum;

use super::context::RecipeArguments;
use super::exit::{Exit, Fault, data};
use crate::plan::draw;

/// Print the graph of tasks for Graphviz or Mermaid.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    #[command(flatten)]
    recipe: RecipeArguments,
    /// Language of the drawing.
    #[arg(long, value_name = "FORMAT", default_value = "dot")]
    format: GraphFormat,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum GraphFormat {
    Dot,
    Mermaid,
}

pub(super) fn run(arguments: &Arguments) -> Result<Exit, Fault> {
    let planned = arguments.recipe.plan()?;
    let text = match arguments.format {
        GraphFormat::Dot => draw::dot(&planned.plan),
        GraphFormat::Mermaid => draw::mermaid(&planned.plan),
    };
    data(text.trim_end());
    Ok(Exit::Done)
}
