//! The few numbers of an artifact that tables and progress lines show, taken once when it is made.

use crate::step::Artifact;
use crate::store::Figures;

/// The figures of an artifact.
pub(super) fn figures(artifact: &Artifact) -> Figures {
    let mut figures = Figures { port: artifact.port().to_string(), ..Figures::default() };
    match artifact {
        Artifact::File(_) => {}
        Artifact::Soup(soup) => {
            figures.vertices = Some(soup.points.len() as u64);
            figures.faces = Some(soup.faces.len() as u64);
        }
        Artifact::Surface(surface) => {
            figures.vertices = Some(surface.points.len() as u64);
            figures.faces = Some(surface.faces.len() as u64);
        }
        Artifact::Metrics(metrics) => figures.metrics = Some((**metrics).clone()),
    }
    figures
}
