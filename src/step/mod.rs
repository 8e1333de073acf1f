//! The contract between a step and everything else: what flows in and out, parameters, statistics, failure.
//!
//! A step is a plain library function plus one [`Step`] impl that binds it to recipes. The catalog (`steps::CATALOG`)
//! is a list of [`StepDef`]s; planning, schema and command line see only those and never a concrete step.

pub mod amount;
pub mod artifact;
pub mod failure;
pub mod length;
pub mod locks;
pub mod parameters;
pub mod resolution;
pub mod sizing;
pub mod tolerance;

use std::sync::Arc;

use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::Serialize;
use serde::de::DeserializeOwned;

pub use artifact::{Artifact, FileBytes, Port};
pub use failure::{ElementRef, FailureKind, StepFailure};
pub use length::{Angle, Length, Share, Sizing};
pub use locks::{Boundary, Locks};
pub use resolution::Resolution;
pub use sizing::ResolvedSizing;
pub use tolerance::{OutOfRange, REFERENCE, ResolvedTolerance, Tolerance, ToleranceError};

use crate::metric::Measured;
use crate::watch::Watch;

/// A named input of a step: a recipe key that names another step, or for [`Port::File`] a file.
#[derive(Clone, Copy, Debug)]
pub struct InputDef {
    /// The recipe key: `from`, `reference`, `file`.
    pub name: &'static str,
    /// Which artifacts fit.
    pub accepts: &'static [Port],
    /// Whether the key must be there.
    pub required: bool,
    /// One line for the reference.
    pub doc: &'static str,
}

/// A named output of a step. The first one is the main output and is called `main`.
#[derive(Clone, Copy, Debug)]
pub struct OutputDef {
    /// `main`, or the part after the dot in `from = "fe.hierarchy"`.
    pub name: &'static str,
    /// What comes out: one port, or the main input's own port.
    pub port: OutPort,
    /// Where it is a part of the main output: taken from that, so that the step runs once for both.
    pub derive: Option<Derive>,
}

/// Takes an output from the main one; `None` where that is no artifact of the step.
pub type Derive = fn(&Artifact) -> Option<Artifact>;

/// What an output is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OutPort {
    /// Always this.
    Is(Port),
    /// The same as the input named `from`.
    SameAsFrom,
}

/// The artifacts given to a step, by input name.
#[derive(Clone, Debug, Default)]
pub struct Inputs {
    artifacts: Vec<(&'static str, Artifact)>,
    measured: Vec<(&'static str, Arc<Measured>)>,
}

impl Inputs {
    /// Inputs from pairs of name and artifact.
    pub fn new(artifacts: Vec<(&'static str, Artifact)>) -> Self {
        Self { artifacts, measured: Vec::new() }
    }

    /// The same, with what others keep of these inputs.
    #[must_use]
    pub fn with_measured(self, measured: Vec<(&'static str, Arc<Measured>)>) -> Self {
        Self { measured, ..self }
    }

    /// The mesh of this input, with what is known of it; `None` where the input is no mesh or is not there.
    pub fn measured(&self, name: &str) -> Option<Arc<Measured>> {
        let known = self.measured.iter().find(|(n, _)| *n == name).map(|(_, measured)| Arc::clone(measured));
        known.or_else(|| Some(Arc::new(Measured::new(self.get(name)?.to_soup()?))))
    }

    /// The artifact of this name, where the recipe gave one.
    pub fn get(&self, name: &str) -> Option<&Artifact> {
        self.artifacts.iter().find(|(n, _)| *n == name).map(|(_, a)| a)
    }

    /// The artifact of a required input.
    pub fn require(&self, name: &'static str) -> Result<&Artifact, StepFailure> {
        self.get(name).ok_or_else(|| StepFailure::bad_input(format!("the input `{name}` is missing")))
    }

    /// A required input that is a surface.
    pub fn surface(&self, name: &'static str) -> Result<&Arc<crate::mesh::Surface>, StepFailure> {
        self.require(name)?.as_surface()
    }

    /// A required input that is a hierarchy.
    pub fn hierarchy(&self, name: &'static str) -> Result<&Arc<crate::mesh::Hierarchy>, StepFailure> {
        self.require(name)?.as_hierarchy()
    }

    /// An optional input that is a surface.
    pub fn surface_opt(&self, name: &'static str) -> Result<Option<&Arc<crate::mesh::Surface>>, StepFailure> {
        self.get(name).map(Artifact::as_surface).transpose()
    }
}

/// What a step gives back: the artifact of the output asked for, and the truth about how it went.
#[derive(Clone, Debug)]
pub struct Produced<S> {
    /// The artifact.
    pub artifact: Artifact,
    /// What was done and whether it finished.
    pub stats: S,
}

/// A step of the catalog.
pub trait Step {
    /// The recipe's `use = "…"`, kebab-case.
    const NAME: &'static str;
    /// Raised whenever equal input may give another output.
    const REVISION: u32;
    /// Inputs: `from` first.
    const INPUTS: &'static [InputDef];
    /// Outputs: `main` first.
    const OUTPUTS: &'static [OutputDef];
    /// Whether the common keys `keep`, `on-curve`, `only` and `boundary` apply.
    const EDITS: bool = false;
    /// Which of groups, regions, marks, seams and fields survive, in words.
    const CARRIES: &'static str;
    /// A recipe snippet (TOML step table body) that the tests run.
    const EXAMPLE: &'static str;

    /// Parameters; their doc comments are the user's reference.
    type Params: DeserializeOwned + Serialize + JsonSchema + Send + Sync + 'static;
    /// Statistics; replayed with a cached result.
    type Stats: Serialize + JsonSchema;

    /// The groups that the result has besides those of its inputs.
    fn new_groups(_params: &Self::Params) -> Vec<String> {
        Vec::new()
    }

    /// Runs the step for one of its outputs.
    fn run(
        inputs: &Inputs,
        output: &str,
        params: &Self::Params,
        locks: &Locks,
        watch: &Watch,
    ) -> Result<Produced<Self::Stats>, StepFailure>;
}

/// A step as the rest of the program sees it.
#[derive(Clone, Copy)]
pub struct StepDef {
    /// See [`Step::NAME`].
    pub name: &'static str,
    /// See [`Step::REVISION`].
    pub revision: u32,
    /// See [`Step::INPUTS`].
    pub inputs: &'static [InputDef],
    /// See [`Step::OUTPUTS`].
    pub outputs: &'static [OutputDef],
    /// See [`Step::EDITS`].
    pub edits: bool,
    /// See [`Step::CARRIES`].
    pub carries: &'static str,
    /// See [`Step::EXAMPLE`].
    pub example: &'static str,
    /// Schema of the parameters.
    pub params_schema: fn(&mut SchemaGenerator) -> Schema,
    /// Schema of the statistics.
    pub stats_schema: fn(&mut SchemaGenerator) -> Schema,
    /// Reads the parameters, which keep their spans in errors.
    pub bind: fn(toml::de::ValueDeserializer<'_>) -> Result<Arc<dyn BoundStep>, toml::de::Error>,
}

impl std::fmt::Debug for StepDef {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "StepDef({} r{})", self.name, self.revision)
    }
}

impl StepDef {
    /// The catalog entry of `S`.
    pub const fn of<S: Step + 'static>() -> Self {
        Self {
            name: S::NAME,
            revision: S::REVISION,
            inputs: S::INPUTS,
            outputs: S::OUTPUTS,
            edits: S::EDITS,
            carries: S::CARRIES,
            example: S::EXAMPLE,
            params_schema: |generator| generator.subschema_for::<S::Params>(),
            stats_schema: |generator| generator.subschema_for::<S::Stats>(),
            bind: |value| {
                let params = <S::Params as serde::Deserialize>::deserialize(value)?;
                Ok(Arc::new(Bound::<S> { params }))
            },
        }
    }

    /// The output of this name.
    pub fn output(&self, name: &str) -> Option<&OutputDef> {
        self.outputs.iter().find(|o| o.name == name)
    }
}

/// A step with its parameters, ready to run.
pub trait BoundStep: Send + Sync {
    /// Parameters with defaults filled in, for keys and explanations.
    fn canonical(&self) -> serde_json::Value;

    /// The groups that the result has besides those of its inputs.
    fn new_groups(&self) -> Vec<String>;

    /// Runs the step for one of its outputs; statistics come as JSON.
    fn run(
        &self,
        inputs: &Inputs,
        output: &str,
        locks: &Locks,
        watch: &Watch,
    ) -> Result<Produced<serde_json::Value>, StepFailure>;
}

struct Bound<S: Step> {
    params: S::Params,
}

impl<S: Step> BoundStep for Bound<S> {
    fn canonical(&self) -> serde_json::Value {
        serde_json::to_value(&self.params).unwrap_or(serde_json::Value::Null)
    }

    fn new_groups(&self) -> Vec<String> {
        S::new_groups(&self.params)
    }

    fn run(
        &self,
        inputs: &Inputs,
        output: &str,
        locks: &Locks,
        watch: &Watch,
    ) -> Result<Produced<serde_json::Value>, StepFailure> {
        let produced = S::run(inputs, output, &self.params, locks, watch)?;
        let stats = serde_json::to_value(&produced.stats).unwrap_or(serde_json::Value::Null);
        Ok(Produced { artifact: produced.artifact, stats })
    }
}
