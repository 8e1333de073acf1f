//! The record of a run, `run.ron`.

use std::path::Path;

use super::exit::{Exit, Fault};
use crate::report::{Report, record};
use crate::run;

pub(super) fn write_record(report: &Report, out: &Path) -> Result<(), Fault> {
    Ok(run::write_file(&out.join("run.ron"), record_text(report)?.as_bytes())?)
}

/// What stands in `run.ron`.
pub(super) fn record_text(report: &Report) -> Result<String, Fault> {
    record::to_ron(report).map_err(|error| Fault::new(Exit::Fault, format!("cannot write run.ron: {error}")))
}
