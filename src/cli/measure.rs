//! `meshmill measure`: the metrics of a mesh file, no recipe needed.

use std::path::PathBuf;

use super::context::pair;
use super::convert::read_mesh;
use super::criteria::read_file;
use super::exit::{Exit, Fault, coloured, data, document_text};
use super::signals::Interrupt;
use crate::metric::gate::criteria::{Criteria, CriteriaError, CriteriaReport, judge};
use crate::metric::{Subject, measure_kept};
use crate::report::json::{Kind, Measured};
use crate::report::table;
use crate::run::Silent;
use crate::watch::Watch;

/// Measure a mesh: counts, topology, size, element quality, distance to a reference, and how well it keeps criteria.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    /// The mesh.
    mesh: PathBuf,
    /// The mesh to compare with.
    #[arg(long, value_name = "MESH")]
    reference: Option<PathBuf>,
    /// Judge the mesh by criteria too, a TOML file; ends with 3 where an element fails.
    #[arg(long, value_name = "FILE")]
    criteria: Option<PathBuf>,
    /// Set a parameter of the criteria.
    #[arg(long, value_name = "NAME=VALUE", value_parser = pair, requires = "criteria")]
    set: Vec<(String, String)>,
    /// Print one JSON document: `metrics`, numbers and booleans by name, and `units`, the unit of each that has one.
    #[arg(long, conflicts_with = "ron")]
    json: bool,
    /// Print RON.
    #[arg(long, conflicts_with = "criteria")]
    ron: bool,
}

pub(super) fn run(arguments: &Arguments) -> Result<Exit, Fault> {
    let criteria = arguments.criteria.as_deref().map(|file| read_file(file, &arguments.set)).transpose()?;
    if let Some(metric) = criteria.as_ref().and_then(Criteria::compares).filter(|_| arguments.reference.is_none()) {
        let message = format!("the criteria compare (`{}`), and nothing says with what", metric.name);
        return Err(Fault::usage(message).help("name a mesh with --reference"));
    }
    let mesh = read_mesh(&arguments.mesh)?;
    let reference = arguments.reference.as_deref().map(read_mesh).transpose()?;
    let interrupt = Interrupt::listen();
    let watch = Watch::new(std::sync::Arc::new(Silent), std::sync::Arc::clone(&interrupt.cancelled));
    let subject = Subject::new(&mesh, reference.as_ref(), &watch);
    let Ok(metrics) = measure_kept(&subject) else {
        return Ok(interrupt.exit());
    };
    let judged = match criteria.map(|criteria| judge(&subject, &criteria)).transpose() {
        Ok(judged) => judged.map(|(report, _)| report),
        Err(CriteriaError::Cancelled(_)) => return Ok(interrupt.exit()),
        Err(error) => return Err(Fault::usage(error.to_string())),
    };
    let exit = if judged.as_ref().is_none_or(CriteriaReport::passed) { Exit::Done } else { Exit::Gate };
    let fault = |error: String| Fault::new(Exit::Fault, format!("cannot write the metrics: {error}"));
    if arguments.json {
        data(&document_text(Kind::Measure, &Measured { metrics: metrics.values, criteria: judged })?);
    } else if arguments.ron {
        let config = ron::ser::PrettyConfig::default();
        data(&ron::ser::to_string_pretty(&metrics, config).map_err(|error| fault(error.to_string()))?);
    } else {
        data(&table::measurement(&metrics));
        if let Some(report) = judged {
            data(&coloured(&format!("\n{}", table::criteria::table(&report, None))));
        }
    }
    Ok(exit)
}
