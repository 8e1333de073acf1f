//! `meshmill measure`: the metrics of a mesh file, no recipe needed.

use std::path::PathBuf;

use super::convert::read_mesh;
use super::exit::{Exit, Fault, data, document_text};
use super::signals::Interrupt;
use crate::metric::measure;
use crate::report::json::{Kind, Measured};
use crate::report::table;
use crate::run::Silent;
use crate::watch::Watch;

/// Measure a mesh: counts, topology, size, element quality, and distance to a reference.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    /// The mesh.
    mesh: PathBuf,
    /// The mesh to compare with.
    #[arg(long, value_name = "MESH")]
    reference: Option<PathBuf>,
    /// Print one JSON document: `metrics`, numbers and booleans by name, and `units`, the unit of each that has one.
    #[arg(long, conflicts_with = "ron")]
    json: bool,
    /// Print RON.
    #[arg(long)]
    ron: bool,
}

pub(super) fn run(arguments: &Arguments) -> Result<Exit, Fault> {
    let mesh = read_mesh(&arguments.mesh)?;
    let reference = arguments.reference.as_deref().map(read_mesh).transpose()?;
    let interrupt = Interrupt::listen();
    let watch = Watch::new(std::sync::Arc::new(Silent), std::sync::Arc::clone(&interrupt.cancelled));
    let Ok(metrics) = measure(&mesh, reference.as_ref(), &watch) else {
        return Ok(interrupt.exit());
    };
    let fault = |error: String| Fault::new(Exit::Fault, format!("cannot write the metrics: {error}"));
    if arguments.json {
        data(&document_text(Kind::Measure, &Measured { metrics: metrics.values })?);
    } else if arguments.ron {
        let config = ron::ser::PrettyConfig::default();
        data(&ron::ser::to_string_pretty(&metrics, config).map_err(|error| fault(error.to_string()))?);
    } else {
        data(&table::measurement(&metrics));
    }
    Ok(Exit::Done)
}
