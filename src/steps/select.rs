//! Names a group of faces, edges or vertices by where they are and how they face.
//!
//! Selectors by place (`box`, `sphere`, `cylinder`, `plane`) take elements all of whose vertices are inside, the limit
//! included. Selectors by face (`normal`, `region`) take faces, and the edges and vertices of such faces. The selector
//! `boundary-loop` takes the vertices and edges of rims, and the faces with an edge there.
//!
//! Folklore; no single source.
//!
//! # Invariants
//! - The mesh stays as it is but for the new group.
//! - The members of the group are sorted, without repeats.
//!
//! # Cost
//! Linear in the mesh; O(n log n) where edges or rims are asked for.

mod selector;
#[cfg(test)]
mod tests;

use std::sync::Arc;

use glam::DVec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::mesh::geometry::Aabb;
use crate::mesh::id::{IdVec, Vertex};
use crate::mesh::topology::Faces;
use crate::mesh::{Carried, Soup, Surface};
use crate::step::{
    Artifact, InputDef, Inputs, Locks, OutPort, OutputDef, Port, Produced, Step as StepContract, StepFailure,
};
use crate::watch::Watch;

pub use selector::{BoundaryLoop, Cylinder, NormalCone, Plane, SelectBox, Sphere};

/// What a group holds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Of {
    /// Faces.
    #[default]
    Faces,
    /// Edges.
    Edges,
    /// Vertices.
    Vertices,
}

/// How several selectors work together.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Combine {
    /// An element must satisfy all.
    #[default]
    All,
    /// One is enough.
    Any,
}

/// Names a group of faces, edges or vertices by where they are and how they face.
///
/// Use it to lock elements (`keep`, `on-curve`, `only`), to give sizes by group, or to make a set for the solver.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct SelectParams {
    /// The name of the new group; the mesh must not have one of this name.
    pub name: String,
    /// What the group holds: `"faces"` (default), `"edges"` or `"vertices"`.
    #[serde(default)]
    pub of: Of,
    /// Whether an element must satisfy `"all"` selectors (default) or `"any"`.
    #[serde(default)]
    pub combine: Combine,
    /// Whether a group without members is fine. Default false: it is an error.
    #[serde(default)]
    pub allow_empty: bool,
    /// Inside a box along the axes.
    #[serde(default, rename = "box", skip_serializing_if = "Option::is_none")]
    pub in_box: Option<SelectBox>,
    /// Inside a sphere.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sphere: Option<Sphere>,
    /// Inside a cylinder.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cylinder: Option<Cylinder>,
    /// On a plane.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub plane: Option<Plane>,
    /// Facing a direction.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub normal: Option<NormalCone>,
    /// In the region of this name.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub region: Option<String>,
    /// On a rim.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub boundary_loop: Option<BoundaryLoop>,
}

/// What was selected.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub struct SelectStats {
    /// Elements in the group.
    pub selected: usize,
    /// Elements of that kind in the mesh.
    pub elements: usize,
}

/// Why nothing was selected.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SelectError {
    /// No selector was given.
    #[error("no selector is given")]
    NoSelector,
    /// The mesh has a group of this name.
    #[error("there is a group `{0}` already")]
    NameTaken(String),
    /// No element satisfies the selectors.
    #[error("nothing is selected; the mesh lies between {:?} and {:?}", bounds.min.to_array(), bounds.max.to_array())]
    Empty {
        /// The mesh's bounding box.
        bounds: Aabb,
    },
    /// There is no region of this name.
    #[error("there is no region `{name}`; regions: {}", if known.is_empty() { "none".into() } else { known.join(", ") })]
    UnknownRegion {
        /// As asked for.
        name: String,
        /// The names there are.
        known: Vec<String>,
    },
    /// A rim of this rank does not exist.
    #[error("there is no rim number {rank}: the mesh has {rims}")]
    NoSuchRim {
        /// As asked for.
        rank: usize,
        /// Rims there are.
        rims: usize,
    },
    /// A direction has no length.
    #[error("the direction of `{0}` has no length")]
    NoDirection(&'static str),
    /// A selector has a coordinate that is not finite.
    #[error("`{0}` has a number that is not finite")]
    NotFinite(&'static str),
}

/// Selects on any mesh and adds the group to `carried`.
///
/// # Errors
/// See [`SelectError`]; `carried` is unchanged then.
pub fn select(
    mesh: &impl Faces,
    points: &IdVec<Vertex, DVec3>,
    carried: &mut Carried,
    params: &SelectParams,
) -> Result<SelectStats, SelectError> {
    if carried.groups.contains(&params.name) {
        return Err(SelectError::NameTaken(params.name.clone()));
    }
    let selection = selector::evaluate(mesh, points, carried, params)?;
    if selection.len() == 0 && !params.allow_empty {
        return Err(SelectError::Empty { bounds: Aabb::of(points.iter().copied()) });
    }
    let stats = SelectStats { selected: selection.len(), elements: selection.elements };
    let groups = &mut carried.groups;
    match params.of {
        Of::Faces => drop(groups.faces.insert(params.name.clone(), selection.faces)),
        Of::Edges => drop(groups.edges.insert(params.name.clone(), selection.edges)),
        Of::Vertices => drop(groups.vertices.insert(params.name.clone(), selection.vertices)),
    }
    Ok(stats)
}

impl From<SelectError> for StepFailure {
    fn from(error: SelectError) -> Self {
        let failure = Self::failed(error.to_string());
        match error {
            SelectError::NoSelector => failure.with_help(
                "give at least one of `box`, `sphere`, `cylinder`, `plane`, `normal`, `region`, `boundary-loop`",
            ),
            SelectError::Empty { .. } => {
                failure.with_help("check units and limits, or set `allow-empty = true` if an empty group is fine")
            }
            SelectError::NameTaken(_) => failure.with_help("choose another `name`"),
            SelectError::UnknownRegion { .. }
            | SelectError::NoSuchRim { .. }
            | SelectError::NoDirection(_)
            | SelectError::NotFinite(_) => failure,
        }
    }
}

/// The room's entry in the catalog.
#[derive(Debug)]
pub struct Step;

impl StepContract for Step {
    const NAME: &'static str = "select";
    const REVISION: u32 = 1;
    const INPUTS: &'static [InputDef] = &[InputDef {
        name: "from",
        accepts: &[Port::Soup, Port::Surface],
        required: true,
        doc: "the mesh to select on",
    }];
    const OUTPUTS: &'static [OutputDef] = &[OutputDef { name: "main", port: OutPort::SameAsFrom, derive: None }];
    const CARRIES: &'static str = "everything, and the new group";
    const EXAMPLE: &'static str =
        "use = \"select\"\nfrom = \"clean\"\nname = \"top\"\nnormal = { direction = [0, 0, 1], angle = 30 }\n";

    type Params = SelectParams;
    type Stats = SelectStats;

    fn new_groups(params: &SelectParams) -> Vec<String> {
        vec![params.name.clone()]
    }

    fn run(
        inputs: &Inputs,
        _output: &str,
        params: &SelectParams,
        _locks: &Locks,
        watch: &Watch,
    ) -> Result<Produced<SelectStats>, StepFailure> {
        watch.check()?;
        match inputs.require("from")? {
            Artifact::Surface(surface) => {
                let mut carried = surface.carried.clone();
                let stats = select(surface.as_ref(), &surface.points, &mut carried, params)?;
                let surface = Surface { carried, points: surface.points.clone(), faces: surface.faces.clone() };
                Ok(Produced { artifact: Artifact::Surface(Arc::new(surface)), stats })
            }
            Artifact::Soup(soup) => {
                let mut carried = soup.carried.clone();
                let stats = select(soup.as_ref(), &soup.points, &mut carried, params)?;
                let soup = Soup { carried, points: soup.points.clone(), faces: soup.faces.clone() };
                Ok(Produced { artifact: Artifact::Soup(Arc::new(soup)), stats })
            }
            other => Err(StepFailure::bad_input(format!("expected a mesh, got a {}", other.port()))),
        }
    }
}
