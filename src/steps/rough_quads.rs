//! Cuts a surface into coarse quads along its borders, each with the faces that it covers.
//!
//! # Algorithm
//! Strips of triangles grow from all borders at once; a graph of them is simplified to belts. The outer loop of a belt
//! gets nodes at even distances, connectors run from them straight across to the inner loop, and what lies between two
//! of them is an element: a quad, or a triangle where two connectors meet. A belt with several holes has them joined, one
//! without gets a hole without area: a central node or path. Then triangles are coupled, and a triangle that touches the
//! rim with one corner is opened to a quad. The belts are the work of `technique::belts`, the complex that they become
//! that of `technique::layout`.
//!
//! Based on: T. Itoh, A. Yamada, T. Furuhata, K. Inoue, K. Shimada. Rough Quadrilateralation of Triangular Meshes via
//! Belt-like Subregioning for Surface Reconstruction. IBM Research Report RT0354, 2000.
//!
//! Where elements do not fit between the edges of the mesh, faces there are cut in four and the belts made again; the
//! cover says which ones, so that nobody needs the finer mesh.
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
//! - Closed surfaces, which the paper leaves open, are cut along the borders of their regions. The nodes there are dealt
//!   out first, so that every region has an even number of them: an odd one leaves a triangle.

use std::sync::Arc;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::mesh::geometry::Aabb;
use crate::mesh::{FaceId, Quads, Surface};
use crate::metric::quad_layout::{Layout as Counts, layout_counts};
use crate::step::{
    Artifact, ElementRef, InputDef, Inputs, Length, Locks, OutPort, OutputDef, Port, Produced, Step as StepContract,
    StepFailure,
};
use crate::technique::belts::{BeltReport, BeltRules, Order, Thickness, cut_belts};
use crate::technique::layout::optimise::{OptimiseReport, optimise, polygonise};
use crate::technique::layout::{Ground, Layout, Room, to_quads, with_rings};
use crate::watch::{Cancelled, Watch};

/// Cuts a surface into coarse quads that follow its borders, each with the faces that it covers.
///
/// The surface should be fine: ten edges or more along an element, see `refine`; where it has no room for an element its
/// faces are cut in four. A closed surface must have regions.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default, rename_all = "kebab-case")]
pub struct RoughQuadsParams {
    /// How far apart the nodes on borders lie, which is about the size of the elements. Default 6 % of the diagonal.
    pub interval: Length,
    /// How thick belts are: a length, or strips of triangles as a table `{ strips = 8 }`. Default: as `interval`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub thickness: Option<BeltThickness>,
    /// A connector starts where the border's angle inside is at least this many degrees. Default 120.
    #[schemars(range(min = 90.0, max = 180.0))]
    pub min_angle: f64,
    /// Whether connectivity is improved after the paper's post-processing: triangles are paired along paths, nodes with
    /// too many or too few elements are repaired; of several orders in which belts are cut the best result is
    /// kept. Default true; `false` is the paper's method, from the outside.
    pub optimize: bool,
}

/// How thick belts are.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum BeltThickness {
    /// Counted in strips of triangles.
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
    let mut room = Room::new(surface);
    loop {
        let ground = Ground::new(&room.surface);
        check_borders(&ground)?;
        let made = if params.optimize {
            best(&ground, &rules, params, watch)?
        } else {
            attempt(&ground, &rules, params, watch)?
        };
        match made {
            Ok(made) => return Ok(finish(surface, &ground, made, &room)),
            Err(narrow) => {
                let places = room.origins(&narrow.places);
                let around = with_rings(&ground, &narrow.around);
                if !room.cut(around)? {
                    return Err(RoughQuadsError::TooCoarse { faces: places });
                }
            }
        }
    }
}

fn finish(surface: &Surface, ground: &Ground<'_>, made: Attempt, room: &Room) -> (Quads, RoughQuadsStats) {
    let mut quads = made.quads;
    if let Some(cover) = &mut quads.cover {
        cover.surface = surface.shape_hash();
        cover.cuts.clone_from(&room.cuts);
    }
    let Counts { triangles, irregular, forced, vertices } = made.counts;
    let elements = quads.mesh.faces.len();
    let stats = RoughQuadsStats {
        domains: ground.domains,
        cut_faces: room.cuts.iter().map(Vec::len).sum(),
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

/// Where elements do not fit between the edges of the mesh.
struct Narrow {
    /// A face at each place.
    places: Vec<FaceId>,
    /// The faces that would have to be smaller.
    around: Vec<FaceId>,
}

/// Quads made by one order of the belts.
struct Attempt {
    quads: Quads,
    counts: Counts,
    belts: BeltReport,
    post_processed: usize,
    report: OptimiseReport,
}

fn attempt(
    ground: &Ground<'_>,
    rules: &BeltRules,
    params: &RoughQuadsParams,
    watch: &Watch,
) -> Result<Result<Attempt, Narrow>, Cancelled> {
    let (mut layout, bad, belts) = cut_belts(ground, rules, watch)?;
    if !bad.is_empty() {
        return Ok(Err(narrow(&layout, bad.iter().map(|b| b.cell))));
    }
    let mut stuck = polygonise(&mut layout, watch)?;
    if !stuck.is_empty() {
        return Ok(Err(narrow(&layout, stuck.into_iter())));
    }
    let mut post_processed = layout.couple_triangles() + layout.open_triangles();
    post_processed += layout.couple_triangles();
    let mut report = OptimiseReport::default();
    if params.optimize {
        report = optimise(&mut layout, watch)?;
        stuck = polygonise(&mut layout, watch)?;
    }
    part_parallels(&mut layout, &mut stuck, watch)?;
    let odd = layout.cells().filter(|&c| !(3..=4).contains(&layout.ring(c).len()));
    let left: Vec<u32> = stuck.into_iter().filter(|&c| layout.exists(c)).chain(odd).collect();
    if !left.is_empty() {
        return Ok(Err(narrow(&layout, left.into_iter())));
    }
    let quads = to_quads(&layout);
    let counts = layout_counts(&quads.mesh);
    Ok(Ok(Attempt { quads, counts, belts, post_processed, report }))
}

/// These cells, which are too narrow, with what lies round them.
fn narrow(layout: &Layout<'_>, cells: impl Iterator<Item = u32>) -> Narrow {
    let mut cells: Vec<u32> = cells.collect();
    cells.sort_unstable();
    cells.dedup();
    let mut places: Vec<FaceId> = cells.iter().filter_map(|&c| layout.faces(c).iter().min().copied()).collect();
    places.sort_unstable();
    Narrow { places, around: cells.iter().flat_map(|&c| layout.faces(c)).copied().collect() }
}

/// The best of several ways to cut the belts; the first that is good enough ends the search, and so does the first one
/// where it finds no room.
fn best(
    ground: &Ground<'_>,
    rules: &BeltRules,
    params: &RoughQuadsParams,
    watch: &Watch,
) -> Result<Result<Attempt, Narrow>, Cancelled> {
    const OTHERS: [(Order, f64); 3] =
        [(Order::FromBorders, 0.5), (Order::FromOutside, 0.5), (Order::FromBorders, SNAP)];
    let mut best = match attempt(ground, rules, params, watch)? {
        Ok(made) => made,
        Err(narrow) => return Ok(Err(narrow)),
    };
    for (order, snap) in OTHERS {
        if best.is_good() {
            break;
        }
        if let Ok(made) = attempt(ground, &BeltRules { order, snap, ..*rules }, params, watch)?
            && made.shares() < best.shares()
        {
            best = made;
        }
    }
    Ok(Ok(best))
}

impl Attempt {
    /// The shares of triangles and of irregular vertices.
    fn shares(&self) -> [f64; 2] {
        let share = |count: usize, of: usize| count as f64 / of.max(1) as f64;
        let Counts { triangles, irregular, vertices, .. } = &self.counts;
        [share(*triangles, self.quads.mesh.faces.len()), share(irregular.len(), *vertices)]
    }

    /// Whether another way is not worth its time.
    fn is_good(&self) -> bool {
        /// Shares that the paper's own examples keep.
        const GOOD: [f64; 2] = [0.03, 0.1];
        let [triangles, irregular] = self.shares();
        let forced = self.counts.forced as f64 / self.counts.vertices.max(1) as f64;
        triangles <= GOOD[0] && irregular <= GOOD[1].max(1.25 * forced)
    }
}

/// Parts edges between the same two nodes, and what becomes of the cells beside them.
fn part_parallels(layout: &mut Layout<'_>, stuck: &mut Vec<u32>, watch: &Watch) -> Result<(), Cancelled> {
    /// Cutting the cells beside may make new ones.
    const ROUNDS: usize = 4;
    for _ in 0..ROUNDS {
        if layout.part_parallels() == 0 {
            break;
        }
        *stuck = polygonise(layout, watch)?;
        layout.couple_triangles();
    }
    Ok(())
}

/// How near to a node, as a share of the interval, a connector joins it; less leaves rows apart that should be one, more
/// makes rows meet that should run on.
const SNAP: f64 = 0.4;

fn rules(surface: &Surface, params: &RoughQuadsParams) -> Result<BeltRules, RoughQuadsError> {
    let diagonal = Aabb::of(surface.points.iter().copied()).diagonal();
    let check = |name, range, value: f64, holds: bool| {
        if holds { Ok(()) } else { Err(RoughQuadsError::OutOfRange { name, range, value }) }
    };
    let interval = params.interval.resolve(diagonal);
    check("interval", "above 0", interval, interval > 0.0)?;
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
    Ok(BeltRules { thickness, interval, min_angle: params.min_angle, order: Order::FromOutside, snap: SNAP })
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
    const REVISION: u32 = 3;
    const INPUTS: &'static [InputDef] = &[InputDef {
        name: "from",
        accepts: &[Port::Surface],
        required: true,
        doc: "the surface to cut, finer than the elements",
    }];
    const OUTPUTS: &'static [OutputDef] = &[OutputDef { name: "main", port: OutPort::Is(Port::Quads) }];
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
