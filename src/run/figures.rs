//! The few numbers of an artifact that tables and progress lines show, taken once when it is made.

use crate::mesh::{Facet, Soup, Surface, geometry};
use crate::metric::summary;
use crate::step::Artifact;
use crate::store::Figures;

/// The figures of an artifact.
pub(super) fn figures(artifact: &Artifact) -> Figures {
    let port = artifact.port().to_string();
    match artifact {
        Artifact::File(_) => Figures { port, ..Figures::default() },
        Artifact::Soup(soup) => Figures { port, ..of_mesh(soup.points.len(), soup.faces.len(), &stretches(soup)) },
        Artifact::Surface(surface) => {
            Figures { port, ..of_mesh(surface.points.len(), surface.faces.len(), &surface_stretches(surface)) }
        }
        Artifact::Hierarchy(hierarchy) => {
            let finest = &hierarchy.finest;
            Figures { port, ..of_mesh(finest.points.len(), finest.faces.len(), &surface_stretches(finest)) }
        }
        Artifact::Quads(quads) => {
            let mesh = &quads.mesh;
            Figures { port, ..of_mesh(mesh.points.len(), mesh.faces.len(), &stretches(mesh)) }
        }
        Artifact::Patches(patches) => {
            let mesh = &patches.tessellation;
            Figures { port, ..of_mesh(mesh.points.len(), mesh.faces.len(), &stretches(mesh)) }
        }
        Artifact::Metrics(metrics) => Figures { port, metrics: Some((**metrics).clone()), ..Figures::default() },
    }
}

fn of_mesh(vertices: usize, faces: usize, stretches: &[f64]) -> Figures {
    Figures {
        vertices: Some(vertices as u64),
        faces: Some(faces as u64),
        min_stretch: summary::min(stretches),
        mean_stretch: summary::mean(stretches),
        ..Figures::default()
    }
}

fn stretches(soup: &Soup) -> Vec<f64> {
    let stretch = |facet: &Facet| match facet {
        Facet::Tri(corners) => Some(geometry::stretch(corners.map(|v| soup.points[v]))),
        Facet::Quad(_) => None,
    };
    soup.faces.iter().filter_map(stretch).collect()
}

fn surface_stretches(surface: &Surface) -> Vec<f64> {
    surface.faces.ids().map(|face| geometry::stretch(surface.corners(face))).collect()
}
