//! `meshmill schema`: JSON Schemas, for editors and for programs that read what this one prints.

use super::context::endings;
use super::exit::{Exit, Fault, data};
use crate::report::json;
use crate::schema::{criteria_schema_text, recipe_schema_text};
use crate::steps::CATALOG;

/// Print a JSON Schema: of recipes or files of criteria, for editors, or of what `--json` prints.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    /// Which one.
    #[arg(value_enum, default_value_t)]
    of: Of,
}

#[derive(Clone, Copy, Debug, Default, clap::ValueEnum)]
enum Of {
    /// Recipes.
    #[default]
    Recipe,
    /// Files of criteria.
    Criteria,
    /// What `run`, `measure`, `diff` and `sweep` print with `--json`.
    Output,
}

#[expect(clippy::unnecessary_wraps, reason = "every subcommand has this form")]
pub(super) fn run(arguments: &Arguments) -> Result<Exit, Fault> {
    let text = match arguments.of {
        Of::Recipe => recipe_schema_text(CATALOG, &endings()),
        Of::Criteria => criteria_schema_text(),
        Of::Output => json::schema_text(),
    };
    data(text.trim_end());
    Ok(Exit::Done)
}
