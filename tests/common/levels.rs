//! A hierarchy for steps that cut one.

use meshmill::mesh::Soup;
use meshmill::step::Artifact;

use crate::step::{run_locked, surface};

/// The hierarchy that property control by quadrics records of a mesh.
pub(crate) fn levels(mesh: &Soup) -> Artifact {
    let from = [("from", surface(crate::shapes::surface(mesh)))];
    let parameters = "tolerance = \"2%\", tolerance-mode = \"quadric-rms\"";
    run_locked("control-properties", "hierarchy", parameters, "", &from).unwrap_or_else(|e| panic!("{e}")).artifact
}
