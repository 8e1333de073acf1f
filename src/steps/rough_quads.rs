//! Cuts a surface into coarse quads along its borders, each with the faces that it covers.
//!
//! # Algorithm
//! Strips of triangles grow from all borders at once; a graph of them is simplified to belts. The outer loop of a belt
//! gets nodes at even distances, connectors run from them straight across to the inner loop, and what lies between two
//! of them is an element: a quad, or a triangle where two connectors meet. A belt with several holes has them joined,
//! one without gets a hole without area: a central node or path. Then triangles are coupled, and a triangle that
//! touches the rim with one corner is opened to a quad. The belts are the work of `technique::belts`, the complex that
//! they become that of `technique::layout`.
//!
//! Based on: T. Itoh, A. Yamada, T. Furuhata, K. Inoue, K. Shimada. Rough Quadrilateralation of Triangular Meshes via
//! Belt-like Subregioning for Surface Reconstruction. IBM Research Report RT0354, 2000.
//!
//! Where elements do not fit between the edges of the mesh, faces there are cut in four below the complex, which stays
//! as it is, or before the belts are made again where these are no disks; the cover says which ones, so that nobody
//! needs the finer mesh.
//!
//! # Invariants
//! - Nodes are vertices of the surface, edges are paths over its edges, and paths never cross.
//! - Every face is covered once; what an element covers is a disk with the element's corners on its rim.
//! - The complex has the Euler number of the surface; regions conform along their common arcs.
//!
//! # Cost
//! O(F log F) for the belts. Optimisation changes cavities of a few elements at a time, O(n log n) in their faces each.
//!
//! # Departures
//! - Strips are found in one search from all borders, so that the result does not depend on the order of loops.
//! - Strips of one border are put together by their distance before the graph is simplified, so that belts have the
//!   thickness asked for; the graph then merges what is left over.
//! - Elements are bounded by paths over edges. A connector is the path that hugs the straight walk, and of a fan every
//!   second spoke is drawn, as if its triangles were coupled at once: few edges meet in a vertex.
//! - Closed surfaces, which the paper leaves open, are cut along the borders of their regions. The nodes there are
//!   dealt out first, so that every region has an even number of them: an odd one leaves a triangle.
//! - Loops that are sampled freely get an even number of nodes for the same reason, and holes smaller than a few
//!   elements get theirs before connectors come to them, at least four.
//! - A corner whose angle lies between two numbers of right angles takes either number of elements; so does a node on a
//!   border that is coarse beside its curve, as round a small hole.
//! - Where too many vertices are irregular, the interval is shortened step by step to three fifths.
//! - Quads that are inverted between straight edges, as those that span a bend may be, are mended last, by moving their
//!   nodes or cutting them otherwise, though that may leave more irregular vertices.

use std::sync::Arc;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::mesh::geometry::{Aabb, triangle_area};
use crate::mesh::{FaceId, Quads, Surface};
use crate::metric::quad_layout::Layout as Counts;
use crate::step::{
    Artifact, ElementRef, InputDef, Inputs, Length, Locks, OutPort, OutputDef, Port, Produced, Step as StepContract,
    StepFailure,
};
use crate::technique::belts::{Attempt, BeltRules, Narrow, Order, Thickness, attempt};
use crate::technique::layout::Ground;
use crate::watch::{Cancelled, Watch};

/// Cuts a surface into coarse quads that follow its borders, each with the faces that it covers.
///
/// The surface should be fine: ten edges or more along an element, see `refine`; where it has no room for an element
/// its faces are cut in four. A closed surface must have regions. Needles, which CAD programs make of flat faces,
/// become many times the faces that elements need and slow the work down: `refine` with `flips` evens them out.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default, rename_all = "kebab-case")]
pub struct RoughQuadsParams {
    /// How far apart the nodes on borders lie, which is about the size of the elements. Default 6 % of the diagonal.
    /// With `optimize` shorter ones, down to half, are tried where too many vertices would be irregular.
    pub interval: Length,
    /// How thick belts are: a length, or strips of triangles as a table `{ strips = 8 }`. Default: as `interval`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub thickness: Option<BeltThickness>,
    /// A connector starts where the border's angle inside is at least this many degrees. Default 120.
    #[schemars(range(min = 90.0, max = 180.0))]
    pub min_angle: f64,
    /// Whether connectivity is improved after the paper's post-processing: triangles are paired along paths, nodes with
    /// too many or too few elements are repaired; of several ways in which belts are cut the best result is
    /// kept. Default true; `false` is the paper's method, from the outside.
    pub optimize: bool,
}

/// How thick belts are.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum BeltThickness {
    /// Counted in strips of triangles.
    #[schemars(extend("examples" = [{ "strips": 3 }]))]
    Strips {
        /// How many.
        strips: usize,
    },
    /// A length along the surface.
    Length(Length),
}

impl Default for RoughQuadsParams {
    fn default() -> Self {
        Self { interval: Length::Percent(6.0), thickness: None, min_angle: 120.0, optimize: true }
    }
}

/// What was made. Counts are taken on the result.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub struct RoughQuadsStats {
    /// Regions, or parts between marked edges, that were cut each on its own.
    pub domains: usize,
    /// Faces that were cut in four first, because elements did not fit between their edges.
    pub cut_faces: usize,
    /// Strips of triangles.
    pub strips: usize,
    /// Belts that the strips were merged into.
    pub belts: usize,
    /// Connectors laid across belts.
    pub connectors: usize,
    /// Pairs of triangles coupled, and triangles opened at the rim, after the belts were cut.
    pub post_processed: usize,
    /// Pairs of triangles that optimisation brought together.
    pub paired_triangles: usize,
    /// Nodes that optimisation put on borders, because an odd number of edges leaves a triangle over.
    pub parity_nodes: usize,
    /// Local edits and cavities filled anew by optimisation.
    pub edits: usize,
    /// Quads.
    pub quads: usize,
    /// Triangles.
    pub triangles: usize,
    /// Share of triangles, the paper's epsilon-t.
    pub triangle_share: f64,
    /// Share of vertices with other than four elements inside or two on smooth borders, the paper's epsilon-v.
    pub irregular_share: f64,
    /// The share of vertices that must be irregular by Euler's formula.
    pub forced_share: f64,
}

/// Why rough quads cannot be had.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RoughQuadsError {
    /// A length or angle is out of range.
    #[error("{name} must be {range}, got {value}")]
    OutOfRange {
        /// The parameter.
        name: &'static str,
        /// What it may be.
        range: &'static str,
        /// What it is.
        value: f64,
    },
    /// A part has no border to begin at.
    #[error("the part with face {face} has no border, where belts begin")]
    NoBorder {
        /// A face of it.
        face: FaceId,
    },
    /// Elements of this size would be many more than the faces that they are made of.
    #[error("`interval` asks for about {elements:.3e} elements, of a mesh of {faces} faces")]
    TooFine {
        /// Squares of that side that the area holds.
        elements: f64,
        /// Faces of the mesh.
        faces: usize,
    },
    /// Elements of this size do not fit between the edges of the mesh.
    #[error("the mesh is too coarse for elements of this size at {} places, the first at face {}", faces.len(), faces[0])]
    TooCoarse {
        /// A face at each place.
        faces: Vec<FaceId>,
    },
    /// The run was interrupted.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

/// Cuts `surface` into coarse quads.
///
/// # Errors
/// See [`RoughQuadsError`].
pub fn rough_quads(
    surface: &Surface,
    params: &RoughQuadsParams,
    watch: &Watch,
) -> Result<(Quads, RoughQuadsStats), RoughQuadsError> {
    let rules = rules(surface, params)?;
    check_borders(&Ground::new(surface))?;
    let made = if params.optimize {
        best(surface, &rules, watch)?
    } else {
        attempt(surface, &rules, false, &mut Vec::new(), watch)?
    };
    made.map(|made| finish(surface, made)).map_err(|narrow| RoughQuadsError::TooCoarse { faces: narrow.places })
}

fn finish(surface: &Surface, made: Attempt) -> (Quads, RoughQuadsStats) {
    let mut quads = made.quads;
    let cut_faces = made.cuts.iter().map(Vec::len).sum();
    if let Some(cover) = &mut quads.cover {
        cover.surface = surface.shape_hash();
        cover.cuts = made.cuts;
    }
    let Counts { triangles, irregular, forced, vertices } = made.counts;
    let elements = quads.mesh.faces.len();
    let stats = RoughQuadsStats {
        domains: made.domains,
        cut_faces,
        strips: made.belts.strips,
        belts: made.belts.belts,
        connectors: made.belts.connectors,
        post_processed: made.post_processed,
        paired_triangles: made.report.pairs,
        parity_nodes: made.report.parity_nodes,
        edits: made.report.edits + made.report.cavities,
        quads: elements - triangles,
        triangles,
        triangle_share: triangles as f64 / elements.max(1) as f64,
        irregular_share: irregular.len() as f64 / vertices.max(1) as f64,
        forced_share: forced as f64 / vertices.max(1) as f64,
    };
    (quads, stats)
}

/// In which ways belts are cut: their order, how near connectors join a node, and how many times as far apart nodes
/// lie. Shorter intervals come last: where limbs or holes are hardly wider than one element, there is no regular layout
/// of elements of the size asked for.
const WAYS: [(Order, f64, f64); 8] = [
    (Order::FromOutside, SNAP, 1.0),
    (Order::FromBorders, 0.5, 1.0),
    (Order::FromOutside, SNAP, 0.9),
    (Order::FromOutside, SNAP, 0.8),
    (Order::FromBorders, 0.5, 0.7),
    (Order::FromOutside, SNAP, 0.6),
    (Order::FromBorders, 0.5, 0.6),
    (Order::FromBorders, 0.5, 0.5),
];

/// The best of several ways to cut the belts; the first that is good enough ends the search.
fn best(surface: &Surface, rules: &BeltRules, watch: &Watch) -> Result<Result<Attempt, Narrow>, Cancelled> {
    let (mut known, mut best) = (Vec::new(), None);
    let mut narrow = Narrow { places: Vec::new() };
    for (order, snap, scale) in WAYS {
        let (interval, thickness) = (rules.interval * scale, rules.thickness.scaled(scale));
        let way = BeltRules { thickness, interval, order, snap, ..*rules };
        match attempt(surface, &way, true, &mut known, watch)? {
            Ok(made) => {
                let excess = excess(&made.counts, made.quads.mesh.faces.len());
                if best.as_ref().is_none_or(|(least, _)| excess < *least) {
                    best = Some((excess, made));
                }
                if excess.iter().all(|&e| e <= 1.0) {
                    break;
                }
            }
            Err(found) if narrow.places.is_empty() => narrow = found,
            Err(_) => {}
        }
    }
    Ok(best.map(|best| best.1).ok_or(narrow))
}

/// The shares of triangles and of irregular vertices beside those that are good enough: up to 1 another way is not
/// worth its time.
fn excess(counts: &Counts, elements: usize) -> [f64; 2] {
    /// Shares that the paper's own examples keep.
    const GOOD: [f64; 2] = [0.03, 0.1];
    let Counts { triangles, irregular, forced, vertices } = counts;
    let share = |count: usize, of: usize| count as f64 / of.max(1) as f64;
    let bar = GOOD[1].max(1.25 * share(*forced, *vertices));
    [(share(*triangles, elements) / GOOD[0]).max(1.0), share(irregular.len(), *vertices) / bar]
}

/// How near to a node, as a share of the interval, a connector joins it; less leaves rows apart that should be one,
/// more makes rows meet that should run on.
const SNAP: f64 = 0.4;

/// Squares of the interval that an element made by optimisation may hold, unless those before held more: three by
/// three.
const LARGEST: f64 = 9.0;

/// Elements that a face of the mesh may be cut for.
const MOST_ELEMENTS: f64 = 64.0;

fn rules(surface: &Surface, params: &RoughQuadsParams) -> Result<BeltRules, RoughQuadsError> {
    let diagonal = Aabb::of(surface.points.iter().copied()).diagonal();
    let check = |name, range, value: f64, holds: bool| {
        if holds { Ok(()) } else { Err(RoughQuadsError::OutOfRange { name, range, value }) }
    };
    let interval = params.interval.resolve(diagonal);
    check("interval", "above 0", interval, interval > 0.0)?;
    let area: f64 = surface.faces.ids().map(|f| triangle_area(surface.corners(f))).sum();
    let elements = area / (interval * interval);
    if elements > MOST_ELEMENTS * surface.faces.len() as f64 {
        return Err(RoughQuadsError::TooFine { elements, faces: surface.faces.len() });
    }
    check("min-angle", "from 90 to 180", params.min_angle, (90.0..=180.0).contains(&params.min_angle))?;
    let thickness = match &params.thickness {
        None => Thickness::Length(interval),
        Some(BeltThickness::Strips { strips }) => {
            check("strips", "at least 1", *strips as f64, *strips >= 1)?;
            Thickness::Strips(*strips)
        }
        Some(BeltThickness::Length(length)) => {
            let length = length.resolve(diagonal);
            check("thickness", "above 0", length, length > 0.0)?;
            Thickness::Length(length)
        }
    };
    let largest = LARGEST * interval * interval;
    Ok(BeltRules { thickness, interval, largest, min_angle: params.min_angle, order: Order::FromOutside, snap: SNAP })
}

/// Each part must have a border.
fn check_borders(ground: &Ground<'_>) -> Result<(), RoughQuadsError> {
    let mut has_border = vec![false; ground.domains];
    for (face, across) in ground.across.enumerate() {
        let domain = ground.domain[face];
        has_border[domain as usize] |= across.iter().any(|g| g.is_none_or(|g| ground.domain[g] != domain));
    }
    let closed = ground.domain.enumerate().find(|(_, d)| !has_border[**d as usize]);
    closed.map_or(Ok(()), |(face, _)| Err(RoughQuadsError::NoBorder { face }))
}

impl RoughQuadsError {
    fn failure(self, surface: &Surface) -> StepFailure {
        let message = self.to_string();
        let element = |face: &FaceId| ElementRef {
            kind: "face".to_owned(),
            id: u64::from(face.raw()),
            at: Some(crate::mesh::geometry::centroid(surface.corners(*face))),
        };
        match self {
            Self::Cancelled(cancelled) => cancelled.into(),
            Self::OutOfRange { .. } => StepFailure::failed(message),
            Self::NoBorder { face } => StepFailure::failed(message)
                .with_help("run `partition` first, or mark closed curves with `features`")
                .with_elements(vec![element(&face)]),
            Self::TooFine { .. } => StepFailure::failed(message)
                .with_help("run `refine` with a smaller `max-edge` first, or raise `interval`"),
            Self::TooCoarse { faces } => StepFailure::failed(message)
                .with_help("run `refine` with a smaller `max-edge` first, or raise `interval`")
                .with_elements(faces.iter().take(32).map(element).collect()),
        }
    }
}

/// The room's entry in the catalog.
#[derive(Debug)]
pub struct Step;

impl StepContract for Step {
    const NAME: &'static str = "rough-quads";
    const REVISION: u32 = 10;
    const INPUTS: &'static [InputDef] = &[InputDef {
        name: "from",
        accepts: &[Port::Surface],
        required: true,
        doc: "the surface to cut, finer than the elements",
    }];
    const OUTPUTS: &'static [OutputDef] = &[OutputDef { name: "main", port: OutPort::Is(Port::Quads), derive: None }];
    const CARRIES: &'static str = "regions are mapped, and face groups where they hold all faces of an element; rims and \
        borders of regions are marked, corners pinned; other groups, seams and fields are dropped";
    const EXAMPLE: &'static str = "use = \"rough-quads\"\nfrom = \"sheet\"\ninterval = \"25%\"\n";

    type Params = RoughQuadsParams;
    type Stats = RoughQuadsStats;

    fn run(
        inputs: &Inputs,
        _output: &str,
        params: &RoughQuadsParams,
        _locks: &Locks,
        watch: &Watch,
    ) -> Result<Produced<RoughQuadsStats>, StepFailure> {
        let surface = inputs.surface("from")?;
        let (quads, stats) = rough_quads(surface, params, watch).map_err(|error| error.failure(surface))?;
        Ok(Produced { artifact: Artifact::Quads(Arc::new(quads)), stats })
    }
}
