//! The table of a sweep, as files and on the terminal.

use std::path::Path;

use super::exit::{Exit, Fault, document_text};
use crate::report::json::Kind;
use crate::report::sweep::SweepTable;
use crate::run;

/// How the table is printed.
#[derive(Clone, Copy, Debug)]
pub(super) enum Form {
    /// For people.
    Text,
    /// One JSON document.
    Json,
    /// Comma-separated values.
    Csv,
}

pub(super) fn write_tables(table: &SweepTable, out: &Path) -> Result<(), Fault> {
    run::write_file(&out.join("sweep.csv"), to_csv(table)?.as_bytes())?;
    let ron = table.to_ron().map_err(|error| fault(&error))?;
    Ok(run::write_file(&out.join("sweep.ron"), ron.as_bytes())?)
}

fn to_csv(table: &SweepTable) -> Result<String, Fault> {
    table.to_csv().map_err(|error| fault(&error))
}

fn fault(error: &dyn std::fmt::Display) -> Fault {
    Fault::new(Exit::Fault, format!("cannot write the table: {error}"))
}

/// The table in the form asked for.
pub(super) fn table_text(table: &SweepTable, form: Form, quiet: bool) -> Result<String, Fault> {
    Ok(match form {
        Form::Json => document_text(Kind::Sweep, table)?,
        Form::Csv => to_csv(table)?.trim_end().to_owned(),
        Form::Text if quiet => String::new(),
        Form::Text => table.to_text(),
    })
}
