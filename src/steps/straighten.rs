//! Turns the jagged borders of regions into smooth curves on the surface.
//!
//! # Algorithm
//! The arcs between regions are chains of edges; they become polylines over faces, either by local unfolding in a few
//! sweeps, or as geodesics by flips of an intrinsic triangulation and sweeps afterwards. The work is done by
//! [`surface_curve`](crate::technique::surface_curve). At the end the surface is cut along the curves on trial; curves
//! that cross, or have other regions on their sides, get their old course back.
//!
//! Based on: R. Miyazaki, K. Harada. Transformation of a closed 3D triangular mesh to a quadrilateral mesh based on
//! feature edges, section 3.2; D. Martínez, L. Velho, P. C. Carvalho. Computing geodesics on triangular meshes.
//! Computers & Graphics 29(5), 2005; N. Sharp, K. Crane. You can find geodesic paths in triangle meshes by just
//! flipping edges. ACM Transactions on Graphics 39(6), 2020.
//!
//! # Invariants
//! - Points, faces and labels stay; curves are added, one for each arc.
//! - No curve is longer than its arc, and none is farther from it than `max-deviation`.
//! - Junctions, rims, marked edges, pinned and seam vertices stay on their curves, and no curve comes to one that was
//!   not on it. Curves meet at junctions only, and the same regions meet as before.
//!
//! # Cost
//! O(F log F) for the trial, and a small multiple of the points on the curves a sweep.
//!
//! # Departures
//! The paper locks nothing, so that a hole's rim, which is a crease, would be cut by chords, and closed arcs would
//! shrink away. Marked edges are locked here; closed arcs are held at four points, other ones each sweep; and a leash
//! keeps every point near its arc.

use std::collections::BTreeSet;
use std::sync::Arc;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::mesh::geometry::Aabb;
use crate::mesh::halfedge::EnterError;
use crate::mesh::id::Vertex;
use crate::mesh::topology::EdgeTable;
use crate::mesh::{Curve, HalfedgeMesh, IdVec, ResolvedFreedom, Surface, SurfacePoint};
use crate::step::{
    Artifact, InputDef, Inputs, Length, Locks, OutPort, OutputDef, Port, Produced, Step as StepContract, StepFailure,
};
use crate::technique::arcs::{self, arcs};
use crate::technique::curvature::mean_edge;
use crate::technique::split_curves::split_along;
use crate::technique::surface_curve::Network;
use crate::technique::surface_curve::flip::flip;
use crate::technique::surface_curve::network::fixed_vertices;
use crate::technique::surface_curve::unfold::{Leash, unfold};
use crate::watch::{Cancelled, Watch};

/// How far a curve may go from its arc by default, in mean edges: half a tooth more than the teeth of an arc.
const DEVIATION_EDGES: f64 = 1.5;
/// More trials than this are never needed but on purpose; then all curves get their old course back.
const MOST_TRIALS: usize = 16;

/// Straightens the borders of regions into curves on the surface, which `split` makes edges of.
///
/// Use it after `partition`. The borders that lie on marked edges stay as they are.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default, rename_all = "kebab-case")]
pub struct StraightenParams {
    /// How: `"unfold"` (default) smooths in sweeps as the paper does, `"flip-geodesic"` makes each border as straight
    /// as it can be on the surface.
    pub method: Method,
    /// Sweeps over the points of all borders; with `flip-geodesic` sweeps that smooth the places where borders were
    /// held. Default 8. More is straighter, not better: straight borders leave round shapes.
    #[schemars(range(min = 0, max = 1000))]
    pub rounds: usize,
    /// How far a point may go from the border as it was. Length; default 1.5 mean edges.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_deviation: Option<Length>,
}

impl Default for StraightenParams {
    fn default() -> Self {
        Self { method: Method::Unfold, rounds: 8, max_deviation: None }
    }
}

/// How borders are straightened.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// Faces between neighbouring points are unfolded into the plane and the path pulled taut there.
    #[default]
    Unfold,
    /// Edges of an intrinsic triangulation are flipped until borders are geodesic.
    FlipGeodesic,
}

/// What became of the borders.
#[derive(Clone, Debug, Default, PartialEq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub struct StraightenStats {
    /// Curves, one for each border between two regions.
    pub curves: usize,
    /// Of those, closed ones.
    pub closed: usize,
    /// Curves that lie on marked edges all along and stay.
    pub locked: usize,
    /// Curves that got their old course back, because they would have crossed another.
    pub restored: usize,
    /// Points on all curves.
    pub points: usize,
    /// Length of all borders before, in mesh units.
    pub length_before: f64,
    /// Length of all curves.
    pub length: f64,
    /// The largest distance of a point from the border as it was.
    pub deviation: f64,
    /// Sweeps made.
    pub rounds: usize,
    /// Moves of points in all sweeps.
    pub moves: usize,
    /// Edges flipped.
    pub flips: usize,
}

/// Why nothing was straightened.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum StraightenError {
    /// Without regions there are no borders.
    #[error("the surface has no regions, so there is nothing to straighten")]
    NoRegions,
    /// Not an oriented 2-manifold.
    #[error(transparent)]
    NotASurface(#[from] EnterError),
    /// The run was interrupted.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

impl From<StraightenError> for StepFailure {
    fn from(error: StraightenError) -> Self {
        match error {
            StraightenError::Cancelled(cancelled) => cancelled.into(),
            StraightenError::NoRegions => {
                Self::bad_input(error.to_string()).with_help("put a `partition` step before this one")
            }
            StraightenError::NotASurface(_) => Self::bad_input(error.to_string()),
        }
    }
}

/// Straightens the borders of the regions of `surface`.
///
/// # Errors
/// See [`StraightenError`].
pub fn straighten(
    surface: &Surface,
    params: &StraightenParams,
    watch: &Watch,
) -> Result<(Surface, StraightenStats), StraightenError> {
    let regions = surface.carried.regions.as_ref().ok_or(StraightenError::NoRegions)?;
    let edges = EdgeTable::new(surface);
    let borders = arcs(surface, &edges, &regions.labels).arcs;
    let mesh = HalfedgeMesh::new(surface, &ResolvedFreedom::free(surface))?;
    let is_fixed = fixed(surface, &mesh, &borders);
    let diagonal = Aabb::of(surface.points.iter().copied()).diagonal();
    let reach =
        params.max_deviation.map_or_else(|| DEVIATION_EDGES * mean_edge(surface), |length| length.resolve(diagonal));
    let leash = Leash::new(&paths(surface, &borders), reach);
    let mut stats = StraightenStats { curves: borders.len(), ..StraightenStats::default() };
    let mut network = match params.method {
        Method::Unfold => {
            let mut network = Network::new(&mesh, &is_fixed);
            for arc in &borders {
                network.add_arc(arc);
            }
            network
        }
        Method::FlipGeodesic => {
            watch.phase("flipping edges", None);
            let (network, flips) = flip(&mesh, &is_fixed, &borders, &leash, watch)?;
            (stats.flips, stats.moves) = (flips.flips, flips.moves);
            network
        }
    };
    watch.phase("unfolding", None);
    let sweeps = unfold(&mut network, &leash, params.rounds, watch)?;
    stats.rounds = sweeps.rounds;
    stats.moves += sweeps.moves;
    watch.phase("checking curves", None);
    let (curves, restored) = checked(surface, &edges, &borders, network.curves(), watch)?;
    stats.restored = restored;
    count(surface, &borders, &curves, &leash, &mut stats);
    let mut result = surface.clone();
    result.carried.curves = curves;
    Ok((result, stats))
}

fn count(surface: &Surface, borders: &[arcs::Arc], curves: &[Curve], leash: &Leash, stats: &mut StraightenStats) {
    stats.closed = borders.iter().filter(|arc| arc.is_closed).count();
    stats.locked = borders.iter().filter(|arc| is_locked(surface, arc)).count();
    stats.points = curves.iter().map(|curve| curve.points.len()).sum();
    stats.length_before = paths(surface, borders).iter().map(|path| length(path)).sum();
    stats.length = curves.iter().map(|curve| length(&drawn(surface, curve))).sum();
    stats.deviation = deviation(surface, leash, curves);
}

fn is_locked(surface: &Surface, arc: &arcs::Arc) -> bool {
    arc.edges().all(|[a, b]| surface.carried.marks.contains_key(&crate::mesh::edge_key(a, b)))
}

/// Vertices that curves keep and that others keep away from.
fn fixed(surface: &Surface, mesh: &HalfedgeMesh, borders: &[arcs::Arc]) -> IdVec<Vertex, bool> {
    let carried = &surface.carried;
    let marked = carried.marks.keys().flatten().chain(carried.pins.keys()).chain(carried.seams.keys());
    fixed_vertices(mesh, marked.copied(), borders)
}

/// The points of the arcs, the first of a closed one again at its end.
fn paths(surface: &Surface, borders: &[arcs::Arc]) -> Vec<Vec<glam::DVec3>> {
    let path = |arc: &arcs::Arc| {
        let closing = arc.is_closed.then(|| arc.vertices[0]);
        arc.vertices.iter().copied().chain(closing).map(|v| surface.points[v]).collect()
    };
    borders.iter().map(path).collect()
}

fn length(path: &[glam::DVec3]) -> f64 {
    path.windows(2).map(|pair| pair[0].distance(pair[1])).sum()
}

/// The points of a curve, the first of a closed one again at its end.
fn drawn(surface: &Surface, curve: &Curve) -> Vec<glam::DVec3> {
    let closing = if curve.is_closed { curve.points.first() } else { None };
    let at = |point: &SurfacePoint| match *point {
        SurfacePoint::Vertex(v) => surface.points[v],
        SurfacePoint::Edge { edge: [a, b], t } => surface.points[a] * (1.0 - t) + surface.points[b] * t,
    };
    curve.points.iter().chain(closing).map(at).collect()
}

fn deviation(surface: &Surface, leash: &Leash, curves: &[Curve]) -> f64 {
    let of = |(number, curve): (usize, &Curve)| {
        drawn(surface, curve).into_iter().map(|p| leash.distance(number, p)).fold(0.0, f64::max)
    };
    curves.iter().enumerate().map(of).fold(0.0, f64::max)
}

/// The course of an arc along edges.
fn original(arc: &arcs::Arc) -> Curve {
    let points = arc.vertices.iter().map(|&v| SurfacePoint::Vertex(v)).collect();
    Curve { points, is_closed: arc.is_closed, sides: arc.sides }
}

/// Cuts the surface along the curves on trial; those at fault get their old course back, with which nothing crosses.
fn checked(
    surface: &Surface,
    edges: &EdgeTable,
    borders: &[arcs::Arc],
    mut curves: Vec<Curve>,
    watch: &Watch,
) -> Result<(Vec<Curve>, usize), Cancelled> {
    let mut restored: BTreeSet<usize> = BTreeSet::new();
    for trial in 0..=MOST_TRIALS {
        watch.check()?;
        let Err(fault) = split_along(surface, edges, &curves, 0.0) else { break };
        let mut faulty: Vec<usize> = fault.curves().into_iter().filter(|curve| !restored.contains(curve)).collect();
        if faulty.is_empty() || trial + 1 >= MOST_TRIALS {
            faulty = (0..curves.len()).collect();
        }
        for curve in faulty {
            curves[curve] = original(&borders[curve]);
            restored.insert(curve);
        }
    }
    Ok((curves, restored.len()))
}

/// The room's entry in the catalog.
#[derive(Debug)]
pub struct Step;

impl StepContract for Step {
    const NAME: &'static str = "straighten";
    const REVISION: u32 = 1;
    const INPUTS: &'static [InputDef] =
        &[InputDef { name: "from", accepts: &[Port::Surface], required: true, doc: "a surface with regions" }];
    const OUTPUTS: &'static [OutputDef] = &[OutputDef { name: "main", port: OutPort::Is(Port::Surface), derive: None }];
    const CARRIES: &'static str = "everything; curves are replaced";
    const EXAMPLE: &'static str = "use = \"straighten\"\nfrom = \"parts\"\nrounds = 8\n";

    type Params = StraightenParams;
    type Stats = StraightenStats;

    fn run(
        inputs: &Inputs,
        _output: &str,
        params: &StraightenParams,
        _locks: &Locks,
        watch: &Watch,
    ) -> Result<Produced<StraightenStats>, StepFailure> {
        let surface = inputs.surface("from")?;
        watch.check()?;
        let (result, stats) = straighten(surface, params, watch)?;
        Ok(Produced { artifact: Artifact::Surface(Arc::new(result)), stats })
    }
}
