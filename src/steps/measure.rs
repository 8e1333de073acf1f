//! Measures a mesh: every metric of the registry that is defined on it, and those against a reference where one is
//! named.
//!
//! The mesh is measured as it is: vertices are not welded, so that the two sides of a seam count as rims. The metrics'
//! definitions stand in `metric`, one a row of its registry; the largest distance is a certified bound.
//!
//! Folklore; each metric's own source stands in `metric`.
//!
//! # Invariants
//! - The same mesh gives the same figures on any number of threads.
//! - A metric that is undefined on the mesh is absent from the table.
//!
//! # Cost
//! O(n log n); the distances to a reference cost most, a few microseconds a face and sample.

use std::sync::Arc;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::mesh::Soup;
use crate::metric::{self, Measurement, Subject};
use crate::step::{
    Artifact, InputDef, Inputs, Locks, OutPort, OutputDef, Port, Produced, Step as StepContract, StepFailure,
};
use crate::watch::{Cancelled, Watch};

/// Measures a mesh of any kind.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct MeasureParams {}

/// What was measured.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub struct MeasureStats {
    /// Metrics that are defined on the mesh.
    pub metrics: usize,
}

/// Why there are no figures.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MeasureError {
    /// The input named holds no mesh.
    #[error("the input `{0}` is not a mesh")]
    NotAMesh(&'static str),
    /// The run was interrupted.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

impl From<MeasureError> for StepFailure {
    fn from(error: MeasureError) -> Self {
        match error {
            MeasureError::NotAMesh(_) => Self::bad_input(error.to_string()),
            MeasureError::Cancelled(cancelled) => cancelled.into(),
        }
    }
}

/// Measures `mesh`, against `reference` where there is one.
pub fn measure(
    mesh: &Soup,
    reference: Option<&Soup>,
    _params: &MeasureParams,
    watch: &Watch,
) -> Result<(Measurement, MeasureStats), MeasureError> {
    of(&Subject::new(mesh, reference, watch))
}

fn of(subject: &Subject<'_>) -> Result<(Measurement, MeasureStats), MeasureError> {
    let table = metric::measure_kept(subject)?;
    let stats = MeasureStats { metrics: table.values.len() };
    Ok((table, stats))
}

/// The catalog's entry.
pub struct Step;

impl StepContract for Step {
    const NAME: &'static str = "measure";
    const REVISION: u32 = 5;
    const INPUTS: &'static [InputDef] = &[
        InputDef {
            name: "from",
            accepts: &[Port::Soup, Port::Surface, Port::Quads],
            required: true,
            doc: "the mesh to measure",
        },
        InputDef {
            name: "reference",
            accepts: &[Port::Soup, Port::Surface, Port::Quads],
            required: false,
            doc: "the mesh to compare with",
        },
    ];
    const OUTPUTS: &'static [OutputDef] = &[OutputDef { name: "main", port: OutPort::Is(Port::Metrics), derive: None }];
    const CARRIES: &'static str = "The result is a table: nothing of the mesh is carried.";
    const EXAMPLE: &'static str = "use = \"measure\"\nfrom = \"clean\"\nreference = \"raw\"\n";

    type Params = MeasureParams;
    type Stats = MeasureStats;

    fn run(
        inputs: &Inputs,
        _output: &str,
        _params: &MeasureParams,
        _locks: &Locks,
        watch: &Watch,
    ) -> Result<Produced<MeasureStats>, StepFailure> {
        inputs.require("from")?;
        let mesh = inputs.measured("from").ok_or(MeasureError::NotAMesh("from"))?;
        let reference = inputs.measured("reference");
        if reference.is_none() && inputs.get("reference").is_some() {
            return Err(MeasureError::NotAMesh("reference").into());
        }
        let table =
            metric::measure_kept(&Subject::kept(&mesh, reference.as_ref(), watch)).map_err(MeasureError::from)?;
        let stats = MeasureStats { metrics: table.values.len() };
        Ok(Produced { artifact: Artifact::Metrics(Arc::new(table)), stats })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{Facet, VertexId};
    use crate::metric::Value;
    use glam::DVec3;

    fn triangle() -> Soup {
        let corners = [0, 1, 2].map(VertexId::from_raw);
        Soup {
            points: vec![DVec3::X, DVec3::Y, DVec3::Z].into(),
            faces: vec![Facet::Tri(corners)].into(),
            ..Soup::default()
        }
    }

    #[test]
    fn a_metric_that_is_undefined_is_absent() {
        let mesh = triangle();
        let (alone, stats) = measure(&mesh, None, &MeasureParams {}, &Watch::silent()).expect("measures");
        assert_eq!(stats.metrics, alone.values.len());
        assert_eq!(alone.get("faces"), Some(Value::Count(1)));
        assert_eq!(alone.get("min-scaled-jacobian"), None);
        assert_eq!(alone.get("distance"), None);
        let (compared, _) = measure(&mesh, Some(&mesh), &MeasureParams {}, &Watch::silent()).expect("measures");
        assert!(matches!(compared.get("distance"), Some(Value::Number(d)) if d < 1e-14));
        assert_eq!(compared.get("groups-kept"), Some(Value::Flag(true)));
    }

    #[test]
    fn a_step_takes_meshes_only() {
        let table = Artifact::Metrics(Arc::new(Measurement::default()));
        let inputs = Inputs::new(vec![("from", table)]);
        let failure = Step::run(&inputs, "main", &MeasureParams {}, &Locks::default(), &Watch::silent());
        assert!(failure.is_err_and(|f| f.message.contains("not a mesh")));
    }
}
