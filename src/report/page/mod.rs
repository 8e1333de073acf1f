//! A run as one HTML file that needs no network: what was done, how good it is, and the meshes to turn about.
//!
//! [`html`] is a function of the record of a run ([`Report`]) and of what the cache still holds ([`Library`]). The page
//! carries its style, the viewer (`viewer/dist/viewer.js`), and the meshes as packed arrays; large meshes are shown
//! with fewer faces, and the page says so. Tables and charts are plain HTML and SVG and need no script.
//!
//! # Invariants
//! - Equal records and results give equal bytes: there is no clock here and no order of a hash table.
//! - Every text from outside (names, paths, recipes) is escaped.
//! - The arrays of all meshes together stay below [`MOST_BYTES`]; the limit on faces falls until they do.
//!
//! # Cost
//! One pass over each mesh for its metrics, which the library may remember, and O(F log F) where faces are thinned.

mod chart;
mod column;
mod criteria;
mod front;
mod graph;
mod line;
mod meshes;
mod outline;
mod overview;
mod pack;
mod plot;
mod recipe;
mod shown;
mod steps;
mod sweep;
mod text;
mod worst;

use minijinja::{AutoEscape, Environment, context};

use super::Report;
use super::picture::ramp;
use super::sweep::SweepTable;
use crate::metric::Measurement;
use crate::step::Artifact;
use crate::terminal::steers;

/// Faces of a mesh that are shown before it is thinned.
pub const MOST_FACES: usize = 100_000;
/// Characters that the arrays of all meshes may take.
pub const MOST_BYTES: usize = 13_000_000;

/// What the page takes out of the cache. Whatever is gone is left out of the page, and said so.
pub trait Library {
    /// The artifact of a content hash.
    fn artifact(&self, content: &str) -> Option<Artifact>;
    /// The parameters behind a key, with their defaults.
    fn parameters(&self, key: &str) -> Vec<(String, String)>;
    /// The metrics of a result against a reference, remembered or made.
    fn measurement(
        &self,
        content: &str,
        reference: Option<&str>,
        make: &mut dyn FnMut() -> Option<Measurement>,
    ) -> Option<Measurement>;
}

/// What the caller decides about a page.
#[derive(Clone, Debug, Default)]
pub struct PageOptions {
    /// Steps whose meshes are shown, the first two side by side at first. Empty: all, beginning with the reference and
    /// the result.
    pub steps: Vec<String>,
}

/// Why there is no page.
#[derive(Debug, thiserror::Error)]
pub enum PageError {
    /// The record has no case.
    #[error("the record of the run is empty")]
    Empty,
    /// A step that was asked for is not in the record, or has no mesh.
    #[error("the run has no mesh of a step `{name}`; steps with meshes: {}", known.join(", "))]
    UnknownStep {
        /// As asked for.
        name: String,
        /// Those that there are.
        known: Vec<String>,
    },
    /// The template failed: a fault of the program.
    #[error("cannot fill in the page: {0}")]
    Template(#[from] minijinja::Error),
    /// The data of the viewer could not be written: a fault of the program.
    #[error("cannot write the data of the page: {0}")]
    Data(#[from] serde_json::Error),
}

/// The page of a run; of a sweep, with its table. A sweep's steps are those of its first case on the front.
pub fn html(
    report: &Report,
    table: Option<&SweepTable>,
    library: &dyn Library,
    options: &PageOptions,
) -> Result<String, PageError> {
    let best = table.and_then(|table| front::front(table).first().map(|row| row.case.as_str()));
    let best = report.cases.iter().find(|case| Some(case.name.as_str()) == best);
    let case = best.or(report.cases.first()).ok_or(PageError::Empty)?;
    let mut chosen = outline::Outline::new(case, &options.steps)?;
    if let Some(table) = table {
        chosen.show_cases(table, &options.steps);
    }
    let gathered = meshes::gather(case, &chosen, library);
    let environment = environment()?;
    let data = serde_json::to_string(&gathered.viewer(&chosen, case))?;
    let page = environment.get_template("page.html")?.render(context! {
        style => include_str!("page.css"),
        script => include_str!("../viewer/dist/viewer.js"),
        // Within a script element only `<` can end it.
        data => data.replace('<', "\\u003c"),
        blobs => gathered.blobs.clone().into_texts(),
        has_meshes => gathered.has_meshes(),
        head => overview::head(report, case),
        tiles => overview::tiles(case, &chosen, &gathered),
        sweep => table.map(|table| sweep::view(table, &gathered, &chosen.shown)),
        graph => overview::graph(report, case),
        steps => steps::steps(report, case, &chosen, &gathered, library),
        matrix => steps::matrix(case, &gathered),
        gates => overview::gates(case),
        files => overview::files(report, case),
        inputs => overview::inputs(report),
        texts => recipe::texts(report),
        reference => chosen.reference,
        quality => chart::stops(&ramp::QUALITY),
    })?;
    // What turns the direction of writing comes from names in files; it may stand in the text and in the data.
    Ok(page.replace(|letter: char| steers(letter) && !letter.is_control(), "\u{fffd}"))
}

/// The templates of the page.
fn environment() -> Result<Environment<'static>, PageError> {
    let mut environment = Environment::new();
    environment.set_auto_escape_callback(|_| AutoEscape::Html);
    environment.set_trim_blocks(true);
    environment.set_lstrip_blocks(true);
    environment.add_template("page.html", include_str!("page.html"))?;
    environment.add_template("criteria.html", include_str!("criteria.html"))?;
    environment.add_template("sweep.html", include_str!("sweep.html"))?;
    Ok(environment)
}
