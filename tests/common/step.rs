//! Runs steps of the catalog as a recipe does: by name, with parameters as TOML.

use std::sync::Arc;

use meshmill::mesh::validate::{validate_soup, validate_surface};
use meshmill::mesh::{Soup, Surface};
use meshmill::step::{Artifact, FileBytes, Inputs, Locks, Produced, StepDef, StepFailure};
use meshmill::steps::CATALOG;
use meshmill::watch::Watch;
use serde::Deserialize;
use serde_json::Value;
use toml::de::ValueDeserializer;

/// The step of this name.
pub(crate) fn step(name: &str) -> &'static StepDef {
    CATALOG.iter().find(|step| step.name == name).unwrap_or_else(|| panic!("no step `{name}`"))
}

/// Runs a step; `parameters` and `locks` are the keys of its recipe table, separated by commas.
pub(crate) fn run_locked(
    name: &str,
    output: &str,
    parameters: &str,
    locks: &str,
    inputs: &[(&'static str, Artifact)],
) -> Result<Produced<Value>, StepFailure> {
    let (parameters, locks) = (format!("{{ {parameters} }}"), format!("{{ {locks} }}"));
    let bound = (step(name).bind)(ValueDeserializer::parse(&parameters).unwrap()).unwrap();
    let locks = Locks::deserialize(ValueDeserializer::parse(&locks).unwrap()).unwrap();
    let mut produced = bound.run(&Inputs::new(inputs.to_vec()), output, &locks, &Watch::silent())?;
    if let Some(derive) = step(name).outputs.iter().find(|def| def.name == output).and_then(|def| def.derive) {
        produced.artifact = derive(&produced.artifact).unwrap();
    }
    check(&produced.artifact, &format!("{name} {parameters}"));
    Ok(produced)
}

/// Runs a step on `from` for its main output.
pub(crate) fn run(name: &str, parameters: &str, from: &Artifact) -> Produced<Value> {
    run_locked(name, "main", parameters, "", &[("from", from.clone())]).unwrap_or_else(|e| panic!("{name}: {e}"))
}

/// What every step promises of a mesh that it gives: no defect of connectivity, coordinates or what is carried.
pub(crate) fn check(artifact: &Artifact, what: &str) {
    match artifact {
        Artifact::Surface(surface) => assert_eq!(validate_surface(surface), [], "{what}"),
        // A soup may be any polygon soup, but its numbers must fit.
        Artifact::Soup(soup) => assert!(soup.points.iter().all(|p| p.is_finite()), "{what}: {:?}", validate_soup(soup)),
        Artifact::Quads(quads) => {
            let mesh = &quads.mesh;
            let edges = meshmill::mesh::topology::EdgeTable::new(mesh);
            assert!(mesh.points.iter().all(|p| p.is_finite()), "{what}: a coordinate is not finite");
            assert!(edges.iter().all(|(_, _, sides)| sides.len() <= 2), "{what}: an edge has more than two faces");
            let alike = |sides: &[meshmill::mesh::topology::SideRef]| sides[0].is_forward == sides[1].is_forward;
            assert!(!edges.iter().any(|(_, _, s)| s.len() == 2 && alike(s)), "{what}: faces turn against each other");
        }
        _ => {}
    }
}

pub(crate) fn soup(mesh: Soup) -> Artifact {
    Artifact::Soup(Arc::new(mesh))
}

pub(crate) fn surface(mesh: Surface) -> Artifact {
    Artifact::Surface(Arc::new(mesh))
}

pub(crate) fn file(name: &str, text: &str) -> Artifact {
    Artifact::File(Arc::new(FileBytes { name: name.to_owned(), bytes: text.as_bytes().to_vec() }))
}
