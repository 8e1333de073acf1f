//! Turns a surface into quads, row by row from its curves and rims inwards.
//!
//! # Algorithm
//! The curves (marked edges, rims, borders of regions) are sampled at the size asked for, the regions between them
//! remeshed with nearly equilateral triangles, and the number of border edges of each region made even. Then the front
//! of Q-Morph turns triangles into quads ([`front`](crate::technique::front)), what it leaves is joined
//! ([`join`](crate::technique::join)), and topology and shapes are cleaned: by edits of a few quads, and by cavities of
//! up to 120 that are filled anew ([`clean_quads`](crate::technique::clean_quads)). All of it happens on the surface
//! itself: angles are those of the triangles, and vertices go back onto the region they belong to.
//!
//! Based on: R. Miyazaki, K. Harada. Transformation of a closed 3D triangular mesh to a quadrilateral mesh based on
//! feature edges; S. J. Owen, M. L. Staten, S. A. Canann, S. Saigal. Advancing front quadrilateral meshing using
//! triangle transformations. 7th International Meshing Roundtable, 1998. The cavities: G. Bunin. Non-local topological
//! clean-up. 15th International Meshing Roundtable, 2006.
//!
//! The distance between triangles and surface is certified both ways first, and sizes are lowered where it is too
//! large. The same is done with the finished quads: where they are too far away, single vertices are moved over the
//! ridges and tips that a face cuts off (`settle`); where that is not enough, or shapes are poor, sizes are lowered
//! there and the front runs again: first in a small piece about the place, whose rim stays, inside a region or across
//! curves (`rework`, `patch`), or a ring of quads makes faces smaller there (`pillows`); only where that does not do,
//! in the regions that change with the sizes (`attempts`, `search`). Where quads pass through each other even then, all
//! begins again from triangles that do not fold up at the ends of limbs (`untangle`). The best that was reached is
//! kept, and what is folded in it made flatter (`flatten`).
//!
//! # Invariants
//! - Curves stay chains of edges between the same nodes, and nodes stay where they are; borders of regions that
//!   `border-angle` speaks against are no curves, and their ends no nodes.
//! - With `all-quad` there is no triangle; without, at most one in each region.
//! - The Euler characteristic and the number of rims stay.
//!
//! # Cost
//! Linear in the faces of input and result, times a logarithm for the way back onto the surface. How often faces are
//! made anew has a limit that is a function of their number (`budget`), and nothing is made anew where hundreds of
//! quads are broken at first.
//!
//! # Departures
//! The papers take the triangles as they come and keep their border edges; sampling and remeshing first is what makes
//! the quads even. Where the paper leaves a triangle to keep a curve, the parity of the borders makes that unnecessary.

mod attempts;
mod budget;
mod carry;
mod check;
mod flatten;
mod lack;
mod midpoint;
mod patch;
mod pillows;
mod reuse;
mod rework;
mod search;
mod settle;
mod sizes;
#[cfg(test)]
mod testing;
mod untangle;

use std::sync::Arc;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::mesh::geometry::Aabb;
use crate::mesh::{Quads, Surface};
use crate::metric::number::number_text;
use crate::step::{
    Artifact, FailureKind, InputDef, Inputs, Length, Locks, OutPort, OutputDef, Port, Produced, Sizing,
    Step as StepContract, StepFailure,
};
use crate::technique::clean_quads::{census, clean, finish, sharpest_sector};
use crate::technique::ground::{Choice, Ground};
use crate::technique::isotropic::{Rules, curve_distance};
use crate::technique::mixed::Mixed;
use crate::technique::thickness::thinner_than;
use crate::watch::{Cancelled, Watch};

use attempts::morph;

/// Turns a surface into quads of a given size that follow its marked curves.
///
/// Use it after `features`, or after `split` on a part without edges. Open surfaces and plates need no marks.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default, rename_all = "kebab-case")]
pub struct QMorphParams {
    /// Edge length aimed for: a length, a field, or lengths by face group. Percents refer to the diagonal of `from`.
    /// Default 2 %. Sizes get smaller where the tolerances or narrow strips need it.
    pub size: Sizing,
    /// Elements round a full circle of the surface's curvature; 0 (default) leaves curvature to `tolerance`.
    /// Range 0 to 360.
    #[schemars(range(min = 0.0, max = 360.0))]
    pub size_curvature: f64,
    /// Sizes are not lowered below this, except where nodes are closer. Length; default a quarter of the least `size`,
    /// and a sixteenth where the distance needs it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub min_size: Option<Length>,
    /// How much longer edges may get over a unit of length. Range 0.05 to 2, default 0.3.
    #[schemars(range(min = 0.05, max = 2.0))]
    pub gradation: f64,
    /// Distance from the surface that sizes are chosen for. Length, default 0.3 %.
    pub tolerance: Length,
    /// Distance from the curves that sizes on them are chosen for. Length, default 0.1 %.
    pub curve_tolerance: Length,
    /// Borders of regions that meet another curve at less than this angle, or leave no room for an edge, are not
    /// followed; marked edges and borders of groups always are. Degrees, default 30; 0 follows all. Range 0 to 90.
    #[schemars(range(min = 0.0, max = 90.0))]
    pub border_angle: f64,
    /// Whether there must be no triangle. Default true; false leaves one in each region with an odd number of border
    /// edges, and no curve gets an edge more for it.
    pub all_quad: bool,
    /// How often the front may run over regions where distance or shapes are not good enough: two thirds of it with
    /// small pieces about poor places meshed anew, and where that does not do, so often without and half as often with
    /// pieces again; in all, with what begins otherwise, at most four times as often. Default 8; 1 takes what the first
    /// run gives.
    #[schemars(range(min = 1, max = 1000))]
    pub attempts: usize,
    /// The step fails before it begins if the result would have more faces. Default 20 million.
    #[schemars(range(min = 1))]
    pub max_faces: usize,
}

impl Default for QMorphParams {
    fn default() -> Self {
        Self {
            size: Length::Percent(2.0).into(),
            size_curvature: 0.0,
            min_size: None,
            gradation: 0.3,
            tolerance: Length::Percent(0.3),
            curve_tolerance: Length::Percent(0.1),
            border_angle: 30.0,
            all_quad: true,
            attempts: 8,
            max_faces: 20_000_000,
        }
    }
}

/// What was done.
#[derive(Clone, Debug, Default, PartialEq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub struct QMorphStats {
    /// Quads made.
    pub quads: usize,
    /// Triangles left.
    pub triangles: usize,
    /// Regions between the curves.
    pub regions: usize,
    /// Regions by what they needed: the front alone; neighbours joined; triangles joined along paths; one midpoint
    /// split of everything.
    pub regions_by_level: [usize; 4],
    /// The same for each region.
    #[serde(skip)]
    pub levels: Vec<usize>,
    /// Borders of regions that were not followed.
    pub left_out: usize,
    /// Edges of curves that were halved so that each region has an even number of them.
    pub parity_splits: usize,
    /// Wedges of the front that were seamed.
    pub seams: usize,
    /// Edits of the clean-up.
    pub clean_edits: usize,
    /// Pieces of quads that were meshed anew, and rings put in.
    pub reworked: usize,
    /// Least scaled Jacobian.
    pub min_scaled_jacobian: f64,
    /// The sharpest angle between two curves next to each other at a node, in degrees; a corner there is no wider, so
    /// that its sine bounds the least scaled Jacobian.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sharpest_angle: Option<f64>,
    /// Mean scaled Jacobian.
    pub mean_scaled_jacobian: f64,
    /// Share of vertices off the rims that have four edges.
    pub regular_share: f64,
    /// How often the front was run: once, and again where distance or shapes were not good enough.
    pub attempts: usize,
    /// Whether the work that a part of this size may cost was done before distance and shapes were good everywhere, or
    /// hundreds of quads were broken at first, so that no work would mend them: the result is then the best that was
    /// reached. Larger sizes or tolerances leave less to do.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub work_limit_reached: bool,
    /// The largest distance between quads and surface, certified both ways. Larger than `tolerance` where sizes must
    /// not get small enough.
    pub distance: f64,
    /// The largest distance between a curve and the edges on it.
    pub curve_distance: f64,
    /// Faces that are inverted or flat, with their middles; none in a sound result.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub inverted: Vec<InvertedFace>,
    /// Walls that the tolerance does not keep apart; a run says it.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub warnings: Vec<String>,
}

/// A face that did not come out right.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub struct InvertedFace {
    /// The face of the result.
    pub face: u32,
    /// Its middle.
    pub at: [f64; 3],
    /// Its scaled Jacobian.
    pub scaled_jacobian: f64,
}

/// Why there are no quads.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum QMorphError {
    /// The lengths cannot be had on this surface.
    #[error(transparent)]
    Size(StepFailure),
    /// There is nothing to mesh.
    #[error("the surface has no faces")]
    Empty,
    /// A length is zero or not finite.
    #[error("`{0}` must be positive, got {1}")]
    NotPositive(&'static str, f64),
    /// The size is too small for the limit.
    #[error("about {0:.3e} faces would be made, and `max-faces` allows {1}")]
    TooManyFaces(f64, usize),
    /// Sizes near curves ask for far more than the size itself.
    #[error(
        "curves and narrow strips lower the sizes so far that more than {most} triangles would be made, where the size \
         asked for needs about {wanted:.0}: long thin faces carry the sizes of their ends along all their length"
    )]
    LoweredSizes {
        /// Triangles that may be made.
        most: usize,
        /// Faces that the size asked for makes.
        wanted: f64,
    },
    /// The surface is no oriented manifold.
    #[error("an edge has more than two faces, or two of the same direction")]
    NotManifold,
    /// The run was interrupted.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

impl From<QMorphError> for StepFailure {
    fn from(error: QMorphError) -> Self {
        let message = error.to_string();
        match error {
            QMorphError::Size(failure) => failure,
            QMorphError::Cancelled(cancelled) => cancelled.into(),
            QMorphError::TooManyFaces(..) => {
                Self::failed(message).with_help("raise `size`, or raise `max-faces` if there is memory for it")
            }
            QMorphError::LoweredSizes { .. } => Self::failed(message).with_help(
                "put `refine` with flips = true and the size as `max-edge` before it, raise `curve-tolerance` or \
                 `min-size`, or take the small parts away with `remove-features`",
            ),
            QMorphError::NotManifold => Self::new(FailureKind::BadInput, message).with_help("run `repair` first"),
            QMorphError::Empty | QMorphError::NotPositive(..) => Self::new(FailureKind::BadInput, message),
        }
    }
}

/// Turns `surface` into quads.
///
/// # Errors
/// See [`QMorphError`].
pub fn q_morph(surface: &Surface, params: &QMorphParams, watch: &Watch) -> Result<(Quads, QMorphStats), QMorphError> {
    if surface.faces.is_empty() {
        return Err(QMorphError::Empty);
    }
    let diagonal = Aabb::of(surface.points.iter().copied()).diagonal();
    let (rules, size) = rules(surface, params, diagonal)?;
    let thin = thin_walls(surface, rules.tolerance);
    if let Some(thin) = &thin {
        tracing::warn!("{thin}");
    }
    let angle = params.border_angle.clamp(0.0, 90.0).to_radians();
    let choice = Choice { angle, reach: 0.5 * size, gap: 0.25 * size };
    let ground = Ground::following(surface, (angle > 0.0).then_some(&choice));
    let (mut mesh, mut stats) = morph(&ground, params, rules, 1.0, watch)?;
    if params.all_quad && stats.triangles > 0 {
        // A region without a partner for its last triangle: quads of double size, each cut into four.
        (mesh, stats) = morph(&ground, params, rules, 2.0, watch)?;
        mesh = midpoint::split_all(&mesh, &ground).ok_or(QMorphError::NotManifold)?;
        stats.regions_by_level = [0, 0, 0, ground.region_count()];
        let all = vec![true; ground.region_count()];
        stats.clean_edits += clean(&mut mesh, &ground, rules.curve_tolerance, &all, watch)?.edits;
        stats.clean_edits += finish(&mut mesh, &ground, rules.curve_tolerance, &all, watch)?.edits;
    }
    stats.curve_distance = curve_distance(&mesh, &ground);
    judge(&mesh, &mut stats);
    stats.warnings = thin.into_iter().collect();
    Ok((Quads { mesh: carry::leave(&mesh, &ground), cover: None }, stats))
}

/// What is said where the sides of walls may come to lie on each other, in time to stop the work.
fn thin_walls(surface: &Surface, tolerance: f64) -> Option<String> {
    /// The thin ends of wedges are no walls.
    const TELLING: f64 = 0.05;
    let walls = thinner_than(surface, tolerance).filter(|walls| walls.share >= TELLING)?;
    let (share, thinnest) = (100.0 * walls.share, number_text(walls.thinnest));
    Some(format!(
        "on {share:.0}% of the part the walls are thinner than `tolerance`, {thinnest} where it is {}: their sides may come \
         to lie on each other; lower `tolerance` below that, or mesh one side as a shell",
        number_text(tolerance)
    ))
}

/// The rules, and the least size.
fn rules(surface: &Surface, params: &QMorphParams, diagonal: f64) -> Result<(Rules, f64), QMorphError> {
    let least = params.size.resolve(surface, diagonal).map_err(QMorphError::Size)?.least();
    let positive = |name, value: f64| {
        if value > 0.0 && value.is_finite() { Ok(value) } else { Err(QMorphError::NotPositive(name, value)) }
    };
    let rules = Rules {
        tolerance: positive("tolerance", params.tolerance.resolve(diagonal))?,
        curve_tolerance: positive("curve-tolerance", params.curve_tolerance.resolve(diagonal))?,
        shortest: 0.0,
        least_size: params.min_size.map_or(0.25 * least, |length| length.resolve(diagonal)),
        floor: params.min_size.map_or(least / 16.0, |length| length.resolve(diagonal)),
        gradation: params.gradation.clamp(0.05, 2.0),
        most_faces: usize::MAX,
    };
    positive("size", least)?;
    positive("min-size", rules.least_size)?;
    let area: f64 = surface.faces.ids().map(|f| crate::mesh::geometry::triangle_area(surface.corners(f))).sum();
    let faces = 2.5 * area / (least * least);
    if faces > params.max_faces as f64 {
        return Err(QMorphError::TooManyFaces(faces, params.max_faces));
    }
    Ok((Rules { most_faces: budget::most_triangles(faces), ..rules }, least))
}

/// Recounts the result.
fn judge(mesh: &Mixed, stats: &mut QMorphStats) {
    (stats.triangles, stats.quads) = mesh.census();
    let (mut least, mut sum) = (f64::INFINITY, 0.0);
    for (face, f) in mesh.faces().enumerate() {
        let quality = mesh.quality(f);
        if !mesh.is_triangle(f) {
            least = least.min(quality);
            sum += quality;
        }
        if quality <= 0.0 {
            let at = mesh.centre(f).to_array();
            stats.inverted.push(InvertedFace { face: face as u32, at, scaled_jacobian: quality });
        }
    }
    stats.min_scaled_jacobian = if least.is_finite() { least } else { 0.0 };
    stats.mean_scaled_jacobian = sum / stats.quads.max(1) as f64;
    stats.sharpest_angle = sharpest_sector(mesh).map(f64::to_degrees);
    let census = census(mesh);
    stats.regular_share = 1.0 - census.irregular as f64 / census.inner.max(1) as f64;
}

/// The room's entry in the catalog.
#[derive(Debug)]
pub struct Step;

impl StepContract for Step {
    const NAME: &'static str = "q-morph";
    const REVISION: u32 = 20;
    const INPUTS: &'static [InputDef] = &[InputDef {
        name: "from",
        accepts: &[Port::Surface],
        required: true,
        doc: "the surface, with marked curves where it has features",
    }];
    const OUTPUTS: &'static [OutputDef] = &[OutputDef { name: "main", port: OutPort::Is(Port::Quads), derive: None }];
    const CARRIES: &'static str = "face groups and regions go to the quads on them, edge groups and marks to the edges \
        along their curves, vertex groups to the nearest vertices and those \
        on faces and curve edges that are in them; seams and fields are dropped";
    const EXAMPLE: &'static str = "use = \"q-morph\"\nfrom = \"clean\"\nsize = \"5%\"\n";

    type Params = QMorphParams;
    type Stats = QMorphStats;

    fn run(
        inputs: &Inputs,
        _output: &str,
        params: &QMorphParams,
        _locks: &Locks,
        watch: &Watch,
    ) -> Result<Produced<QMorphStats>, StepFailure> {
        let (quads, stats) = q_morph(inputs.surface("from")?, params, watch)?;
        Ok(Produced { artifact: Artifact::Quads(Arc::new(quads)), stats })
    }
}
