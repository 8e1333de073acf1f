//! A small catalog for tests of the plan: steps that do nothing with parameters of every sort.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::step::{InputDef, Inputs, Length, Locks, OutPort, OutputDef, Port, Produced, Step, StepDef, StepFailure};
use crate::watch::Watch;

const FILE: InputDef = InputDef { name: "file", accepts: &[Port::File], required: true, doc: "the mesh file" };
const SOUP: InputDef =
    InputDef { name: "from", accepts: &[Port::Soup, Port::Surface], required: true, doc: "the mesh" };
const SURFACE: InputDef = InputDef { name: "from", accepts: &[Port::Surface], required: true, doc: "the surface" };
const REFERENCE: InputDef =
    InputDef { name: "reference", accepts: &[Port::Surface], required: false, doc: "what tolerances refer to" };
const MAIN_SURFACE: OutputDef = OutputDef { name: "main", port: OutPort::Is(Port::Surface), derive: None };

/// What the toys report: nothing.
#[derive(Serialize, JsonSchema)]
pub(super) struct NoStats {}

macro_rules! toy {
    ($step:ident, $params:ident, $name:literal, $inputs:expr, $outputs:expr, $edits:literal) => {
        pub(super) struct $step;
        impl Step for $step {
            const NAME: &'static str = $name;
            const REVISION: u32 = 1;
            const INPUTS: &'static [InputDef] = $inputs;
            const OUTPUTS: &'static [OutputDef] = $outputs;
            const EDITS: bool = $edits;
            const CARRIES: &'static str = "everything";
            const EXAMPLE: &'static str = "";
            type Params = $params;
            type Stats = NoStats;
            fn run(_: &Inputs, _: &str, _: &$params, _: &Locks, _: &Watch) -> Result<Produced<NoStats>, StepFailure> {
                Err(StepFailure::failed("a toy does not run"))
            }
        }
    };
}

/// No parameters.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub(super) struct NoParams {}

/// Whether holes are closed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub(super) enum FillHoles {
    #[default]
    None,
    All,
}

/// Makes a surface.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub(super) struct RepairParams {
    /// Which holes are closed.
    #[serde(default)]
    pub(super) fill_holes: FillHoles,
}

/// Smooths.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub(super) struct SmoothParams {
    /// Largest distance to the reference.
    pub(super) tolerance: Length,
    /// How often; 1 to 100.
    #[serde(default = "ten")]
    #[schemars(range(min = 1, max = 100))]
    pub(super) times: u32,
    /// How far a vertex goes each time; 0 to 1.
    #[serde(default)]
    pub(super) damping: f64,
}

fn ten() -> u32 {
    10
}

toy!(
    Read,
    NoParams,
    "read",
    &[FILE],
    &[OutputDef { name: "main", port: OutPort::Is(Port::Soup), derive: None }],
    false
);
toy!(Repair, RepairParams, "repair", &[SOUP], &[MAIN_SURFACE], false);
toy!(
    Smooth,
    SmoothParams,
    "smooth",
    &[SURFACE, REFERENCE],
    &[MAIN_SURFACE, OutputDef { name: "coarse", port: OutPort::Is(Port::Surface), derive: None }],
    true
);
toy!(
    Select,
    NoParams,
    "select",
    &[SOUP],
    &[OutputDef { name: "main", port: OutPort::SameAsFrom, derive: None }],
    false
);
toy!(
    Measure,
    NoParams,
    "measure",
    &[SOUP],
    &[OutputDef { name: "main", port: OutPort::Is(Port::Metrics), derive: None }],
    false
);

/// The toy steps.
pub(super) static CATALOG: &[StepDef] = &[
    StepDef::of::<Read>(),
    StepDef::of::<Repair>(),
    StepDef::of::<Smooth>(),
    StepDef::of::<Select>(),
    StepDef::of::<Measure>(),
];
