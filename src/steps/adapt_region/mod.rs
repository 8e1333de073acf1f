//! Takes a mesh from a hierarchy that is fine in a region, or where a field asks for it, and coarse elsewhere.
//!
//! From a coarse front, nodes of the region whose elements are larger than wanted are split, with whatever must be
//! split before them, until no face at a vertex of the region has a longer side than asked for.
//!
//! Based on: H. Date, S. Kanai, T. Kishinami, I. Nishigaki. Mesh Simplification and Adaptive LOD for Finite Element
//! Mesh Generation, 2005, section 5.3.1.
//!
//! # Invariants
//! Without `polish`, every face was seen while the hierarchy was recorded, so thresholds hold if they hold at the
//! finest.
//!
//! # Cost
//! O(n log n) in the nodes above the result; the reported distance costs more.
//!
//! # Departures
//! The region is a set of vertices of the finest mesh, so that it keeps its shape however coarse the front is (the
//! paper hands a wish down to the nearest child); a field of an analysis may give the sizes, which the paper leaves to
//! future work. The paper compares the mean size of a vertex's faces when it was made, which lets single faces be
//! several times larger; here the longest side of every face counts as it is in the result.

mod params;
mod region;

use std::sync::Arc;

use schemars::JsonSchema;
use serde::Serialize;

use crate::mesh::hierarchy::{Hierarchy, NodeId};
use crate::mesh::id::{IdVec, Vertex};
use crate::mesh::{Soup, Surface};
use crate::metric::number::number_text;
use crate::step::{
    Artifact, InputDef, Inputs, Locks, OutPort, OutputDef, Port, Produced, Step as StepContract, StepFailure,
};
use crate::technique::hierarchy::{Front, Thresholds, region_thresholds};
use crate::technique::levels::{FrontReport, extract_measured};
use crate::watch::{Cancelled, Watch};

pub use params::{AdaptRegionParams, Ball, BoxRegion, HalfSpace, RegionName};

/// What came out.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub struct AdaptRegionStats {
    /// Faces of the mesh to refine from.
    pub base_faces: usize,
    /// Vertices of the finest mesh in the region.
    pub vertices_selected: usize,
    /// Vertices of the region at which a face has a longer side than asked for: one of the finest mesh.
    pub vertices_coarser: usize,
    /// What the result lacks of what was asked for; a run says it.
    pub warnings: Vec<String>,
    /// The mesh.
    pub front: FrontReport,
}

/// Why there is no mesh.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum AdaptRegionError {
    /// Nothing says where.
    #[error("no region is given")]
    NoRegion,
    /// Neither or both were given.
    #[error("give either `size` or `ratio`")]
    NotOne,
    /// A number is out of range.
    #[error("{name} must be {range}, got {value}")]
    OutOfRange {
        /// The parameter.
        name: &'static str,
        /// What it may be.
        range: &'static str,
        /// What it is.
        value: f64,
    },
    /// A vector has a coordinate that is no number, or no direction.
    #[error("{0} has a vector that is not finite or has no direction")]
    BadVector(&'static str),
    /// A group or region that is not there.
    #[error("there is no {kind} `{name}`; there are: {known}")]
    Unknown {
        /// Group or region.
        kind: &'static str,
        /// As written.
        name: String,
        /// The names that are there.
        known: String,
    },
    /// A face that is not there.
    #[error("there is no face {face}: the finest mesh has {faces}")]
    NoSuchFace {
        /// As written.
        face: u32,
        /// Number of faces.
        faces: usize,
    },
    /// The region is empty.
    #[error("the region holds no vertex of the finest mesh")]
    Empty,
    /// The input `values`, `field` and `field-sizes` belong together.
    #[error("the input `values`, `field` and `field-sizes` are given together or not at all")]
    HalfAField,
    /// The field is not there or has several numbers an element.
    #[error("`values` has no field `{name}` with one number an element; it has: {known}")]
    NoField {
        /// As written.
        name: String,
        /// The fields that are there.
        known: String,
    },
    /// The run was interrupted.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

/// Takes a mesh from `hierarchy`. `values` carries the field that `params.field` names.
///
/// # Errors
/// See [`AdaptRegionError`].
pub fn adapt_region(
    hierarchy: &Hierarchy,
    values: Option<&Soup>,
    params: &AdaptRegionParams,
    watch: &Watch,
) -> Result<(Surface, AdaptRegionStats), AdaptRegionError> {
    let finest = &hierarchy.finest;
    let mut front = Front::base(hierarchy, params.base.map(|base| base.faces(finest.faces.len())));
    let base_faces = front.face_count();
    let wishes = wishes(&front, values, params)?;
    let selected = wishes.iter().filter(|size| size.is_finite()).count();
    if selected == 0 {
        return Err(AdaptRegionError::Empty);
    }
    let thresholds: Thresholds = region_thresholds(hierarchy, |leaf| wishes[leaf]);
    watch.phase("refine", None);
    front.refine_faces_to(&thresholds, watch)?;
    let (coarser, worst) = front.coarser(|leaf| thresholds[leaf]);
    let (mesh, report) = extract_measured(&front, params.polish, watch)?;
    let stats = AdaptRegionStats {
        base_faces,
        vertices_selected: selected,
        vertices_coarser: coarser,
        warnings: worst.map(|worst| shortfall(coarser, selected, worst)).into_iter().collect(),
        front: report,
    };
    Ok((mesh, stats))
}

/// What is said where the finest mesh itself is coarser than what was asked for.
fn shortfall(coarser: usize, selected: usize, [side, wish]: [f64; 2]) -> String {
    format!(
        "at {coarser} of the {selected} vertices of the region sides are longer than asked for (up to {}, where {} was \
         asked for): the finest mesh of the hierarchy has no shorter ones there; make the hierarchy of a finer mesh",
        number_text(side),
        number_text(wish)
    )
}

/// The size wanted at each vertex of the finest mesh; infinite outside the region.
fn wishes(
    front: &Front<'_>,
    values: Option<&Soup>,
    params: &AdaptRegionParams,
) -> Result<IdVec<Vertex, f64>, AdaptRegionError> {
    let hierarchy = front.hierarchy();
    let finest = &hierarchy.finest;
    let mut wishes: IdVec<Vertex, f64> = IdVec::filled(f64::INFINITY, finest.points.len());
    let mut is_anything = false;
    if let Some(inside) = region::vertices(finest, params)? {
        is_anything = true;
        let diagonal = region::diagonal(finest);
        let current = params.ratio.map(|ratio| (ratio, front.representatives(), front.longest_sides()));
        for (leaf, _) in inside.enumerate().filter(|(_, is_in)| **is_in) {
            wishes[leaf] = match (params.size, &current) {
                (Some(size), None) => size.resolve(diagonal),
                (None, Some((ratio, stands, longest))) => {
                    stands[NodeId::from_raw(leaf.raw())].map_or(0.0, |node| ratio * longest[node])
                }
                (None, None) | (Some(_), Some(_)) => return Err(AdaptRegionError::NotOne),
            };
        }
    }
    match (values, &params.field, params.field_sizes.is_empty()) {
        (None, None, true) => {}
        (Some(soup), Some(field), false) => {
            is_anything = true;
            region::apply_field(finest, soup, field, &params.field_sizes, &mut wishes)?;
        }
        _ => return Err(AdaptRegionError::HalfAField),
    }
    if is_anything { Ok(wishes) } else { Err(AdaptRegionError::NoRegion) }
}

impl From<AdaptRegionError> for StepFailure {
    fn from(error: AdaptRegionError) -> Self {
        let message = error.to_string();
        match error {
            AdaptRegionError::Cancelled(cancelled) => cancelled.into(),
            AdaptRegionError::NoRegion => Self::failed(message).with_help(
                "give `spheres`, `boxes`, `half-spaces`, `groups`, `regions`, `points`, `elements` or a field",
            ),
            AdaptRegionError::NotOne => Self::failed(message).with_help("for example ratio = 0.5"),
            AdaptRegionError::HalfAField => Self::failed(message)
                .with_help("values = \"STEP\", field = \"stress\", field-sizes = [[100, \"4%\"], [200, \"1%\"]]"),
            AdaptRegionError::NoField { .. } => Self::failed(message)
                .with_help("a column of a CSV file is a field where all its cells are numbers or empty"),
            AdaptRegionError::OutOfRange { .. }
            | AdaptRegionError::BadVector(_)
            | AdaptRegionError::Unknown { .. }
            | AdaptRegionError::NoSuchFace { .. }
            | AdaptRegionError::Empty => Self::failed(message),
        }
    }
}

/// The room's entry in the catalog.
#[derive(Debug)]
pub struct Step;

impl StepContract for Step {
    const NAME: &'static str = "adapt-region";
    const REVISION: u32 = 5;
    const INPUTS: &'static [InputDef] = &[
        InputDef {
            name: "from",
            accepts: &[Port::Hierarchy],
            required: true,
            doc: "a hierarchy, such as `fe.hierarchy` of a simplification step `fe`",
        },
        InputDef {
            name: "values",
            accepts: &[Port::Soup, Port::Surface],
            required: false,
            doc: "a mesh, or the points of a CSV file, with the field that `field` names, such as the result of an analysis",
        },
    ];
    const OUTPUTS: &'static [OutputDef] = &[OutputDef { name: "main", port: OutPort::Is(Port::Surface), derive: None }];
    const CARRIES: &'static str =
        "Maps groups, regions, marks, pins and seams; takes fields from the nearest points of the finest mesh.";
    const EXAMPLE: &'static str = "use = \"adapt-region\"\nfrom = \"fe.hierarchy\"\nbase = \"10%\"\nratio = 0.5\n\
        spheres = [{ centre = [0, 0, 0], radius = \"25%\" }]\n";

    type Params = AdaptRegionParams;
    type Stats = AdaptRegionStats;

    fn run(
        inputs: &Inputs,
        _output: &str,
        params: &AdaptRegionParams,
        _locks: &Locks,
        watch: &Watch,
    ) -> Result<Produced<AdaptRegionStats>, StepFailure> {
        let values = inputs.get("values").and_then(Artifact::to_soup);
        let (surface, stats) = adapt_region(inputs.hierarchy("from")?, values.as_deref(), params, watch)?;
        Ok(Produced { artifact: Artifact::Surface(Arc::new(surface)), stats })
    }
}
