//! What flows between steps: shared, immutable values with a port type each.

use std::fmt;
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::failure::StepFailure;
use crate::mesh::{Hierarchy, Patches, Quads, Soup, Surface};
use crate::metric::Measurement;

/// The type of an input or output, checked before anything runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Port {
    /// The bytes of a file.
    File,
    /// Triangles and quads of any topology, as read.
    Soup,
    /// An oriented 2-manifold triangle mesh, perhaps with boundary.
    Surface,
    /// A surface with the record of the collapses that coarsen it.
    Hierarchy,
    /// A quad-dominant mesh.
    Quads,
    /// Smooth surfaces over a quad-dominant mesh.
    Patches,
    /// A table of metrics.
    Metrics,
}

impl fmt::Display for Port {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::File => "file",
            Self::Soup => "soup",
            Self::Surface => "surface",
            Self::Hierarchy => "hierarchy",
            Self::Quads => "quads",
            Self::Patches => "patches",
            Self::Metrics => "metrics",
        })
    }
}

/// A file as a step sees it: its bytes and how it was called. Paths never reach a step.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FileBytes {
    /// File name without folders; its ending tells the format, the rest serves error messages only.
    pub name: String,
    /// The content.
    pub bytes: Vec<u8>,
}

/// A value between steps. Cloning shares it.
#[derive(Clone, Debug)]
pub enum Artifact {
    /// See [`Port::File`].
    File(Arc<FileBytes>),
    /// See [`Port::Soup`].
    Soup(Arc<Soup>),
    /// See [`Port::Surface`].
    Surface(Arc<Surface>),
    /// See [`Port::Hierarchy`].
    Hierarchy(Arc<Hierarchy>),
    /// See [`Port::Quads`].
    Quads(Arc<Quads>),
    /// See [`Port::Patches`].
    Patches(Arc<Patches>),
    /// See [`Port::Metrics`].
    Metrics(Arc<Measurement>),
}

impl Artifact {
    /// Its port type.
    pub fn port(&self) -> Port {
        match self {
            Self::File(_) => Port::File,
            Self::Soup(_) => Port::Soup,
            Self::Surface(_) => Port::Surface,
            Self::Hierarchy(_) => Port::Hierarchy,
            Self::Quads(_) => Port::Quads,
            Self::Patches(_) => Port::Patches,
            Self::Metrics(_) => Port::Metrics,
        }
    }

    /// The surface, or a failure that names the port found.
    pub fn as_surface(&self) -> Result<&Arc<Surface>, StepFailure> {
        match self {
            Self::Surface(surface) => Ok(surface),
            other => Err(StepFailure::bad_input(format!("expected a surface, got a {}", other.port()))),
        }
    }

    /// The hierarchy, or a failure that names the port found.
    pub fn as_hierarchy(&self) -> Result<&Arc<Hierarchy>, StepFailure> {
        match self {
            Self::Hierarchy(hierarchy) => Ok(hierarchy),
            other => Err(StepFailure::bad_input(format!("expected a hierarchy, got a {}", other.port()))),
        }
    }

    /// The quads, or a failure that names the port found.
    pub fn as_quads(&self) -> Result<&Arc<Quads>, StepFailure> {
        match self {
            Self::Quads(quads) => Ok(quads),
            other => Err(StepFailure::bad_input(format!("expected quads, got a {}", other.port()))),
        }
    }

    /// The soup, or a failure that names the port found.
    pub fn as_soup(&self) -> Result<&Arc<Soup>, StepFailure> {
        match self {
            Self::Soup(soup) => Ok(soup),
            other => Err(StepFailure::bad_input(format!("expected a soup, got a {}", other.port()))),
        }
    }

    /// Any mesh, or the tessellation of patches, as a soup, for writers and metrics; `None` for files, hierarchies and
    /// metrics.
    pub fn to_soup(&self) -> Option<Arc<Soup>> {
        match self {
            Self::Soup(soup) => Some(Arc::clone(soup)),
            Self::Surface(surface) => Some(Arc::new(surface.to_soup())),
            Self::Quads(quads) => Some(Arc::new(quads.mesh.clone())),
            Self::Patches(patches) => Some(Arc::new(patches.tessellation.clone())),
            Self::File(_) | Self::Hierarchy(_) | Self::Metrics(_) => None,
        }
    }
}
