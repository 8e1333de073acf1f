//! `meshmill schema`: the JSON Schema of recipes, for editors.

use super::context::endings;
use super::exit::{Exit, Fault, data};
use crate::schema::recipe_schema_text;
use crate::steps::CATALOG;

/// Print the JSON Schema of recipes.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {}

#[expect(clippy::unnecessary_wraps, reason = "every subcommand has this form")]
pub(super) fn run(_arguments: &Arguments) -> Result<Exit, Fault> {
    data(recipe_schema_text(CATALOG, &endings()).trim_end());
    Ok(Exit::Done)
}
