//! Makes the curves between regions into marked edges of the surface.
//!
//! # Algorithm
//! Faces are cut along the curves by the order of points round each face, and cells triangulated so that the worst
//! triangle is best; see [`split_curves`](crate::technique::split_curves). Points near a vertex snap to it, and flips
//! of flat pairs of faces beside the curves mend what is still thin.
//!
//! Based on: R. Miyazaki, K. Harada. Transformation of a closed 3D triangular mesh to a quadrilateral mesh based on
//! feature edges, section 3.3.
//!
//! # Invariants
//! - The surface stays as a point set; its area stays but for rounding.
//! - Every segment of a curve is an edge, marked as the border of two regions, free to change along its curve only.
//! - Regions are those beside the curves; they meet at marked edges only. Where borders end or branch, the vertex is
//!   pinned.
//!
//! # Cost
//! O(F log F), and cubic in the crossings of one face up to a limit.
//!
//! # Departures
//! The paper cuts cells into fans, which may take three points of one side; and it neither snaps nor mends.

use std::sync::Arc;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::mesh::geometry::{stretch, triangle_area};
use crate::mesh::topology::EdgeTable;
use crate::mesh::{EdgeMark, FaceId, Freedom, MarkCause, Surface, edge_key};
use crate::step::{
    Artifact, ElementRef, InputDef, Inputs, Locks, OutPort, OutputDef, Port, Produced, Share, Step as StepContract,
    StepFailure,
};
use crate::technique::arcs::{self, arcs};
use crate::technique::flat_flips::{FlipError, flip_beside};
use crate::technique::split_curves::{SplitError as Reason, split_along};
use crate::watch::{Cancelled, Watch};

/// Cuts the surface along the curves between its regions, which become marked edges.
///
/// Use it after `straighten`; straight after `partition` it marks the borders as they are.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default, rename_all = "kebab-case")]
pub struct SplitParams {
    /// A point of a curve nearer to a vertex than this share of the edge snaps to it, or moves off so far where it may
    /// not. From 0 to 0.4, default 0.2. Smaller values leave slivers, larger ones make curves less smooth.
    pub snap: Share,
    /// Whether flat pairs of faces beside the curves are flipped where that makes the worse one better. Default true.
    pub flips: bool,
}

impl Default for SplitParams {
    fn default() -> Self {
        Self { snap: Share(0.2), flips: true }
    }
}

/// What was cut.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub struct SplitStats {
    /// Curves cut along; 0 where the borders of regions were only marked.
    pub curves: usize,
    /// Vertices made.
    pub new_vertices: usize,
    /// Points that snapped to a vertex.
    pub snapped: usize,
    /// Points moved along their edge to leave room.
    pub shifted: usize,
    /// Faces before.
    pub faces_before: usize,
    /// Faces after.
    pub faces: usize,
    /// Edges flipped beside the curves.
    pub flips: usize,
    /// Borders between two regions.
    pub arcs: usize,
    /// Where they end; these vertices are pinned.
    pub junctions: usize,
    /// Edges marked as borders.
    pub border_edges: usize,
    /// The least stretch of a face before.
    pub min_stretch_before: f64,
    /// The least stretch of a face after.
    pub min_stretch: f64,
    /// The change of the area as a share of it: rounding.
    pub area_change: f64,
}

/// Why nothing was cut.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SplitError {
    /// Neither curves nor regions.
    #[error("the surface has no curves and no regions, so there is nothing to cut along")]
    NothingToCut,
    /// The share is not one of an edge.
    #[error("`snap` lies between 0 and 0.4, got {0}")]
    BadSnap(f64),
    /// See [`Reason`].
    #[error(transparent)]
    Curves(#[from] Reason),
    /// The surface is none.
    #[error(transparent)]
    Repair(#[from] FlipError),
    /// A segment did not become an edge: a fault of this step.
    #[error("a segment of curve {curve} did not become an edge")]
    SegmentMissing {
        /// The curve.
        curve: usize,
    },
    /// The run was interrupted.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

impl From<SplitError> for StepFailure {
    fn from(error: SplitError) -> Self {
        let message = error.to_string();
        match error {
            SplitError::Cancelled(cancelled) => cancelled.into(),
            SplitError::NothingToCut => {
                Self::bad_input(message).with_help("put `partition` and `straighten` before this step")
            }
            SplitError::BadSnap(_) => Self::failed(message).with_help("leave `snap` out for 0.2"),
            SplitError::Curves(reason) => {
                let curve = |number: usize| ElementRef { kind: "curve".to_owned(), id: number as u64, at: reason.at() };
                Self::failed(message)
                    .with_help("straighten less, or mark the borders of regions without straightening")
                    .with_elements(reason.curves().into_iter().map(curve).collect())
            }
            SplitError::Repair(_) => Self::bad_input(message),
            SplitError::SegmentMissing { .. } => Self::failed(message).with_help("report this as a fault"),
        }
    }
}

/// Cuts `surface` along its curves.
///
/// # Errors
/// See [`SplitError`].
pub fn split(surface: &Surface, params: &SplitParams, watch: &Watch) -> Result<(Surface, SplitStats), SplitError> {
    let carried = &surface.carried;
    if !(0.0..=0.4).contains(&params.snap.0) {
        return Err(SplitError::BadSnap(params.snap.0));
    }
    if carried.curves.is_empty() && carried.regions.is_none() {
        return Err(SplitError::NothingToCut);
    }
    watch.phase("cutting faces", None);
    let made = split_along(surface, &EdgeTable::new(surface), &carried.curves, params.snap.0)?;
    watch.check()?;
    let mut result = made.surface;
    let (arcs, junctions, border_edges) = mark(&mut result);
    watch.phase("mending faces", None);
    let flips = if params.flips { flip_beside(&mut result, surface.points.len())? } else { 0 };
    check_segments(&result, surface, &made.chains)?;
    let stats = SplitStats {
        curves: made.chains.len(),
        new_vertices: made.crossings.len(),
        snapped: made.snapped,
        shifted: made.shifted,
        faces_before: surface.faces.len(),
        faces: result.faces.len(),
        flips,
        arcs,
        junctions,
        border_edges,
        min_stretch_before: least_stretch(surface),
        min_stretch: least_stretch(&result),
        area_change: area_change(surface, &result),
    };
    Ok((result, stats))
}

/// Marks the borders of the regions and pins where they end; returns the arcs, those ends and the edges.
fn mark(surface: &mut Surface) -> (usize, usize, usize) {
    let Some(regions) = &surface.carried.regions else { return (0, 0, 0) };
    let network = arcs(surface, &EdgeTable::new(surface), &regions.labels);
    let mark = EdgeMark { freedom: Freedom::OnCurve, cause: MarkCause::RegionBorder };
    let mut marked = 0;
    for [a, b] in network.arcs.iter().flat_map(arcs::Arc::edges) {
        surface.carried.mark(edge_key(a, b), mark);
        marked += 1;
    }
    for &v in &network.junctions {
        surface.carried.pin(v, Freedom::Keep);
    }
    (network.arcs.len(), network.junctions.len(), marked)
}

/// Every segment of every chain must be an edge of the result, between its regions.
fn check_segments(
    result: &Surface,
    surface: &Surface,
    chains: &[Vec<crate::mesh::VertexId>],
) -> Result<(), SplitError> {
    let edges = EdgeTable::new(result);
    for (curve, (chain, from)) in chains.iter().zip(&surface.carried.curves).enumerate() {
        let closing = (from.is_closed && chain.len() > 2).then(|| [chain[chain.len() - 1], chain[0]]);
        // A segment along an old edge may pass points of other curves; then it is several edges.
        let is_edge = |[a, b]: [crate::mesh::VertexId; 2]| edges.find(edge_key(a, b)).is_some();
        if !chain.windows(2).map(|pair| [pair[0], pair[1]]).chain(closing).all(is_edge) {
            return Err(SplitError::SegmentMissing { curve });
        }
    }
    Ok(())
}

fn least_stretch(surface: &Surface) -> f64 {
    surface.faces.ids().map(|f: FaceId| stretch(surface.corners(f))).fold(f64::INFINITY, f64::min)
}

fn area_change(before: &Surface, after: &Surface) -> f64 {
    let area = |surface: &Surface| surface.faces.ids().map(|f| triangle_area(surface.corners(f))).sum::<f64>();
    let (before, after) = (area(before), area(after));
    if before > 0.0 { (after - before) / before } else { 0.0 }
}

/// The room's entry in the catalog.
#[derive(Debug)]
pub struct Step;

impl StepContract for Step {
    const NAME: &'static str = "split";
    const REVISION: u32 = 2;
    const INPUTS: &'static [InputDef] = &[InputDef {
        name: "from",
        accepts: &[Port::Surface],
        required: true,
        doc: "a surface with curves or regions",
    }];
    const OUTPUTS: &'static [OutputDef] = &[OutputDef { name: "main", port: OutPort::Is(Port::Surface), derive: None }];
    const CARRIES: &'static str = "groups, regions, marks, pins and seams are inherited by the parts; new vertices join \
        the vertex groups of both ends of their edge; vertex fields are linear, face fields as in the parent; curves \
        become marked edges";
    const EXAMPLE: &'static str = "use = \"split\"\nfrom = \"curves\"\nsnap = 0.2\n";

    type Params = SplitParams;
    type Stats = SplitStats;

    fn run(
        inputs: &Inputs,
        _output: &str,
        params: &SplitParams,
        _locks: &Locks,
        watch: &Watch,
    ) -> Result<Produced<SplitStats>, StepFailure> {
        let surface = inputs.surface("from")?;
        watch.check()?;
        let (result, stats) = split(surface, params, watch)?;
        Ok(Produced { artifact: Artifact::Surface(Arc::new(result)), stats })
    }
}
