//! Takes a mesh of the number of faces wanted from a hierarchy, with the distribution of element sizes kept.
//!
//! Every node has a reference size, from the front whose distribution is kept; the node whose size relative to that is
//! largest is split, or smallest merged, until the number is reached.
//!
//! Based on: H. Date, S. Kanai, T. Kishinami, I. Nishigaki. Mesh Simplification and Adaptive LOD for Finite Element
//! Mesh Generation, 2005, section 5.3.2.
//!
//! # Invariants
//! Without `polish`, every face was seen while the hierarchy was recorded, so thresholds hold if they hold at the
//! finest.
//!
//! # Cost
//! O(n log n) in the nodes between the two fronts; the reported distance costs more.
//!
//! # Departures
//! The distribution may also be that of any surface nearby (`like`), for example one that another step has adapted; the
//! front then moves from the coarsest one. Where a forced operation overshoots, legal ones bring the front back.

use std::sync::Arc;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::mesh::bvh::TriangleBvh;
use crate::mesh::geometry::triangle_size;
use crate::mesh::id::{IdVec, Vertex};
use crate::mesh::{Hierarchy, Surface};
use crate::step::{
    Artifact, InputDef, Inputs, Locks, OutPort, OutputDef, Port, Produced, Resolution, Share, Step as StepContract,
    StepFailure,
};
use crate::technique::hierarchy::{Density, Front};
use crate::technique::levels::{FrontReport, extract_measured};
use crate::watch::{Cancelled, Watch};

/// Takes a mesh of the number of faces wanted from a hierarchy, with the distribution of element sizes kept.
///
/// Give either `faces` or `share`. The distribution is that of `like`, or of the mesh `base` of the hierarchy.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default, rename_all = "kebab-case")]
pub struct AdaptDensityParams {
    /// The number of faces.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub faces: Option<usize>,
    /// The same as a share of the finest mesh's faces, such as `"25%"`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub share: Option<Share>,
    /// The mesh whose distribution is kept: a number of faces or a percent of the finest mesh's. Default: the finest
    /// mesh. With `like` it has no effect.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub base: Option<Resolution>,
    /// Betters the mesh by flips and relaxation, each certified: stretch, size and valence stay within what the mesh
    /// has without it, and so does the distance from the finest mesh, which is itself off the reference of its
    /// simplification. Its faces then are no longer those that were recorded. Default false.
    pub polish: bool,
}

/// What came out.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub struct AdaptDensityStats {
    /// Faces of the mesh whose distribution was kept.
    pub base_faces: usize,
    /// Whether the number of faces was reached, to 1 % or 4 faces.
    pub target_reached: bool,
    /// The mesh.
    pub front: FrontReport,
}

/// Why there is no mesh.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum AdaptDensityError {
    /// Neither or both were given.
    #[error("give either `faces` or `share`")]
    NotOne,
    /// There is nothing to take the distribution from.
    #[error("the surface `like` has no faces")]
    NoFaces,
    /// The run was interrupted.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

/// Takes a mesh from `hierarchy`, with the distribution of `like` where there is one.
///
/// # Errors
/// See [`AdaptDensityError`]. A number of faces that the hierarchy does not reach is no error.
pub fn adapt_density(
    hierarchy: &Hierarchy,
    like: Option<&Surface>,
    params: &AdaptDensityParams,
    watch: &Watch,
) -> Result<(Surface, AdaptDensityStats), AdaptDensityError> {
    let finest = hierarchy.finest.faces.len();
    let wanted = match (params.faces, params.share) {
        (Some(faces), None) => faces,
        (None, Some(share)) => (share.0 * finest as f64).round() as usize,
        (None, None) | (Some(_), Some(_)) => return Err(AdaptDensityError::NotOne),
    };
    watch.phase("move the front", None);
    let (base_faces, density, mut front) = if let Some(like) = like {
        (like.faces.len(), density_like(hierarchy, like)?, Front::coarsest(hierarchy))
    } else {
        let front = Front::with_faces(hierarchy, params.base.map_or(finest, |base| base.faces(finest)));
        (front.face_count(), Density::of(&front), front)
    };
    density.move_to(&mut front, wanted, watch)?;
    let target_reached = front.face_count().abs_diff(wanted) <= (wanted / 100).max(4);
    let (mesh, report) = extract_measured(&front, params.polish, watch)?;
    Ok((mesh, AdaptDensityStats { base_faces, target_reached, front: report }))
}

/// The distribution of element sizes of a surface, carried over to the leaves by closest points.
fn density_like(hierarchy: &Hierarchy, like: &Surface) -> Result<Density, AdaptDensityError> {
    if like.faces.is_empty() {
        return Err(AdaptDensityError::NoFaces);
    }
    let tree = TriangleBvh::of_surface(like);
    let size = |p| tree.closest(p).map_or(0.0, |found| triangle_size(like.corners(found.face())));
    let sizes: IdVec<Vertex, f64> = hierarchy.finest.points.iter().map(|&p| size(p)).collect();
    Ok(Density::like(hierarchy, |leaf| sizes[leaf]))
}

impl From<AdaptDensityError> for StepFailure {
    fn from(error: AdaptDensityError) -> Self {
        match error {
            AdaptDensityError::Cancelled(cancelled) => cancelled.into(),
            AdaptDensityError::NotOne => Self::failed(error.to_string()).with_help("for example share = \"25%\""),
            AdaptDensityError::NoFaces => Self::bad_input(error.to_string()),
        }
    }
}

/// The room's entry in the catalog.
#[derive(Debug)]
pub struct Step;

impl StepContract for Step {
    const NAME: &'static str = "adapt-density";
    const REVISION: u32 = 4;
    const INPUTS: &'static [InputDef] = &[
        InputDef {
            name: "from",
            accepts: &[Port::Hierarchy],
            required: true,
            doc: "a hierarchy, such as `fe.hierarchy` of a simplification step `fe`",
        },
        InputDef {
            name: "like",
            accepts: &[Port::Surface],
            required: false,
            doc: "the surface whose distribution of sizes is kept; default: `base`",
        },
    ];
    const OUTPUTS: &'static [OutputDef] = &[OutputDef { name: "main", port: OutPort::Is(Port::Surface), derive: None }];
    const CARRIES: &'static str =
        "Maps groups, regions, marks, pins and seams; takes fields from the nearest points of the finest mesh.";
    const EXAMPLE: &'static str = "use = \"adapt-density\"\nfrom = \"fe.hierarchy\"\nbase = \"50%\"\nshare = \"25%\"\n";

    type Params = AdaptDensityParams;
    type Stats = AdaptDensityStats;

    fn run(
        inputs: &Inputs,
        _output: &str,
        params: &AdaptDensityParams,
        _locks: &Locks,
        watch: &Watch,
    ) -> Result<Produced<AdaptDensityStats>, StepFailure> {
        let like = inputs.surface_opt("like")?.map(|surface| &**surface);
        let (surface, stats) = adapt_density(inputs.hierarchy("from")?, like, params, watch)?;
        Ok(Produced { artifact: Artifact::Surface(Arc::new(surface)), stats })
    }
}
