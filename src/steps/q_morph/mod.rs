//! Turns a surface into quads, row by row from its curves and rims inwards.
//!
//! # Algorithm
//! The curves (marked edges, rims, borders of regions) are sampled at the size asked for, the regions between them
//! remeshed with nearly equilateral triangles, and the number of border edges of each region made even. Then the front
//! of Q-Morph turns triangles into quads ([`front`](crate::technique::front)), what it leaves is joined
//! ([`join`](crate::technique::join)), and topology and shapes are cleaned
//! ([`clean_quads`](crate::technique::clean_quads)). All of it happens on the surface itself: angles are those of the
//! triangles, and vertices go back onto the region they belong to.
//!
//! Based on: R. Miyazaki, K. Harada. Transformation of a closed 3D triangular mesh to a quadrilateral mesh based on
//! feature edges; S. J. Owen, M. L. Staten, S. A. Canann, S. Saigal. Advancing front quadrilateral meshing using triangle
//! transformations. 7th International Meshing Roundtable, 1998.
//!
//! The distance between triangles and surface is certified both ways first, and sizes are lowered where it is too large.
//! The same is done with the finished quads: where they are too far away, single vertices are moved over the ridges and
//! tips that a face cuts off (`settle`); where that is not enough, sizes are lowered and the front runs again. The best of
//! a few attempts is kept.
//!
//! # Invariants
//! - Curves stay chains of edges between the same nodes, and nodes stay where they are; borders of regions that
//!   `border-angle` speaks against are no curves, and their ends no nodes.
//! - With `all-quad` there is no triangle; without, at most one in each region.
//! - The Euler characteristic and the number of rims stay.
//!
//! # Cost
//! Linear in the faces of input and result, times a logarithm for the way back onto the surface.
//!
//! # Departures
//! The papers take the triangles as they come and keep their border edges; sampling and remeshing first is what makes
//! the quads even. Where the paper leaves a triangle to keep a curve, the parity of the borders makes that unnecessary.

mod carry;
mod check;
mod midpoint;
mod settle;
mod sizes;

use std::sync::Arc;

use glam::DVec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::mesh::geometry::Aabb;
use crate::mesh::{Quads, Surface};
use crate::step::{
    Artifact, FailureKind, InputDef, Inputs, Length, Locks, OutPort, OutputDef, Port, Produced, Sizing,
    Step as StepContract, StepFailure,
};
use crate::technique::clean_quads::{census, clean, finish, sharpest_sector};
use crate::technique::front::advance;
use crate::technique::ground::{Choice, Ground};
use crate::technique::isotropic::{Rules, curve_distance, pair_up, polish, remesh, tighten};
use crate::technique::join::{join_along_paths, join_neighbours};
use crate::technique::mixed::Mixed;
use crate::watch::{Cancelled, Watch};

use check::{Check, Fault, smaller};
use settle::settle;

/// How often sizes are lowered where the quads prove too far from the surface.
const ATTEMPTS: usize = 3;
/// How often sizes are lowered beforehand, where the triangles are too far from the surface.
const PREPARATIONS: usize = 4;
/// The part of the tolerance that triangles may use.
const TRIANGLES: f64 = 0.7;
/// What an attempt lacks from where faces are inverted or triangles are left.
const BROKEN: f64 = 10.0;
/// How much farther from their curves edges may be where that spares broken faces.
const LOOSER: f64 = 2.0;
/// Faces below this shape are not worth smaller ones.
const USEFUL: f64 = 0.2;
/// Shapes above this count as good.
const FAIR: f64 = 0.5;

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
    /// Sizes are not lowered below this, except where nodes are closer. Length; default a quarter of the least `size`, and
    /// a sixteenth where the distance needs it.
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
    /// Borders of regions that were not followed.
    pub left_out: usize,
    /// Edges of curves that were halved so that each region has an even number of them.
    pub parity_splits: usize,
    /// Wedges of the front that were seamed.
    pub seams: usize,
    /// Edits of the clean-up.
    pub clean_edits: usize,
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
    /// The largest distance between quads and surface, certified both ways. Larger than `tolerance` where sizes must not
    /// get small enough.
    pub distance: f64,
    /// The largest distance between a curve and the edges on it.
    pub curve_distance: f64,
    /// Faces that are inverted or flat, with their middles; none in a sound result.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub inverted: Vec<InvertedFace>,
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
    #[error("about {0} faces would be made, and `max-faces` allows {1}")]
    TooManyFaces(usize, usize),
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
    let angle = params.border_angle.clamp(0.0, 90.0).to_radians();
    let choice = Choice { angle, reach: 0.5 * size, gap: 0.25 * size };
    let ground = Ground::following(surface, (angle > 0.0).then_some(&choice));
    let (mut mesh, mut stats) = morph(&ground, params, rules, 1.0, watch)?;
    if params.all_quad && stats.triangles > 0 {
        // A region without a partner for its last triangle: quads of double size, each cut into four.
        (mesh, stats) = morph(&ground, params, rules, 2.0, watch)?;
        mesh = midpoint::split_all(&mesh, &ground).ok_or(QMorphError::NotManifold)?;
        stats.regions_by_level = [0, 0, 0, ground.region_count()];
        stats.clean_edits += clean(&mut mesh, &ground, rules.curve_tolerance, watch)?.edits;
        stats.clean_edits += finish(&mut mesh, &ground, rules.curve_tolerance, watch)?.edits;
    }
    stats.curve_distance = curve_distance(&mesh, &ground);
    judge(&mesh, &mut stats);
    Ok((Quads { mesh: carry::leave(&mesh, &ground), cover: None }, stats))
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
    };
    positive("size", least)?;
    positive("min-size", rules.least_size)?;
    let area: f64 = surface.faces.ids().map(|f| crate::mesh::geometry::triangle_area(surface.corners(f))).sum();
    let faces = 2.5 * area / (least * least);
    if faces > params.max_faces as f64 {
        return Err(QMorphError::TooManyFaces(faces as usize, params.max_faces));
    }
    Ok((rules, least))
}

/// One run from the surface to clean quads, with all sizes times `scale`.
fn morph(
    ground: &Ground<'_>,
    params: &QMorphParams,
    rules: Rules,
    scale: f64,
    watch: &Watch,
) -> Result<(Mixed, QMorphStats), QMorphError> {
    let stats = QMorphStats { regions: ground.region_count(), left_out: ground.left_out, ..QMorphStats::default() };
    let check = Check::new(ground.surface);
    let work = Morpher { ground, params, check: &check, scale, watch };
    let mut best = work.attempts(rules, ATTEMPTS, &stats)?;
    // Many pieces on a curve that is rough may be what broke it: none shorter than the least size, then a looser curve.
    let longer = Rules { shortest: rules.least_size, ..rules };
    let looser = Rules { curve_tolerance: LOOSER * rules.curve_tolerance, ..longer };
    for (rules, attempts) in [(longer, ATTEMPTS), (looser, 1)] {
        if best.lack < BROKEN {
            break;
        }
        let other = work.attempts(rules, attempts, &stats)?;
        let attempts = best.stats.attempts + other.stats.attempts;
        if other.lack < best.lack {
            best = other;
        }
        best.stats.attempts = attempts;
    }
    let Best { mesh, mut stats, .. } = best;
    stats.distance = check.distance(&mesh, watch)?;
    stats.triangles = mesh.census().0;
    Ok((mesh, stats))
}

/// The best attempt so far.
struct Best {
    lack: f64,
    mesh: Mixed,
    stats: QMorphStats,
}

/// What all attempts share.
struct Morpher<'a, 'g> {
    ground: &'a Ground<'g>,
    params: &'a QMorphParams,
    check: &'a Check,
    scale: f64,
    watch: &'a Watch,
}

impl Morpher<'_, '_> {
    /// Remeshes, and runs the front at most so many times, with smaller sizes where quads prove too far away.
    fn attempts(&self, rules: Rules, most: usize, stats: &QMorphStats) -> Result<Best, QMorphError> {
        let (ground, watch) = (self.ground, self.watch);
        let mut mesh = ground.workshop().ok_or(QMorphError::NotManifold)?;
        sizes::set(&mut mesh, ground.surface, self.params, self.scale).map_err(QMorphError::Size)?;
        watch.phase("remeshing between the curves", None);
        remesh(&mut mesh, ground, rules, watch)?;
        prepare(&mut mesh, ground, self.check, rules, watch)?;
        let mut best: Option<Best> = None;
        for attempt in 1..=most {
            let mut quads = mesh.clone();
            let mut now = stats.clone();
            advance_and_clean(&mut quads, ground, self.params, rules, &mut now, watch)?;
            now.clean_edits += finish(&mut quads, ground, rules.curve_tolerance, watch)?.edits;
            let faults = settle(&mut quads, ground, self.check, rules.tolerance, watch)?;
            let lack = lack(&quads, &faults, rules.tolerance);
            let places = wanting(&quads, &faults, rules.tolerance);
            if best.as_ref().is_none_or(|best| lack < best.lack) {
                best = Some(Best { lack, mesh: quads, stats: now });
            }
            if let Some(best) = &mut best {
                best.stats.attempts = attempt;
            }
            if places.is_empty() || attempt == most {
                break;
            }
            tighten(&mut mesh, ground, rules, &places, watch)?;
        }
        best.ok_or(QMorphError::Empty)
    }
}

/// Lowers sizes where the triangles are too far from the surface: what they miss, quads miss more.
fn prepare(mesh: &mut Mixed, ground: &Ground<'_>, check: &Check, rules: Rules, watch: &Watch) -> Result<(), Cancelled> {
    let tolerance = TRIANGLES * rules.tolerance;
    for _ in 0..PREPARATIONS {
        let faults = check.beyond(mesh, tolerance, watch)?;
        if faults.is_empty() {
            break;
        }
        let places = smaller(mesh, &faults, tolerance);
        tighten(mesh, ground, rules, &places, watch)?;
    }
    Ok(())
}

/// How much an attempt lacks: 0 where it holds to the tolerance with sound shapes.
fn lack(mesh: &Mixed, faults: &[Fault], tolerance: f64) -> f64 {
    let worst = faults.iter().map(|f| f.distance / tolerance - 1.0).fold(0.0, f64::max);
    let fair = fair(mesh);
    let (mut inverted, mut least, mut triangles) = (0.0, fair, 0.0);
    for f in mesh.faces() {
        let quality = mesh.quality(f);
        inverted += f64::from(quality <= 0.0);
        triangles += f64::from(mesh.is_triangle(f));
        least = least.min(quality);
    }
    100.0 * triangles + 10.0 * inverted + 4.0 * worst + (fair - least)
}

/// The shape that each face could have: good, or as good as the sharpest corner allows.
fn fair(mesh: &Mixed) -> f64 {
    sharpest_sector(mesh).map_or(FAIR, |angle| FAIR.min(0.9 * libm::sin(angle)))
}

/// Where another attempt should have smaller faces: at faults of sound faces. Smaller ones would not mend the others.
fn wanting(mesh: &Mixed, faults: &[Fault], tolerance: f64) -> Vec<(DVec3, f64, f64)> {
    let sound = |fault: &&Fault| mesh.quality(fault.face) > USEFUL;
    smaller(mesh, faults.iter().filter(sound), tolerance)
}

/// From triangles to clean quads.
fn advance_and_clean(
    mesh: &mut Mixed,
    ground: &Ground<'_>,
    params: &QMorphParams,
    rules: Rules,
    stats: &mut QMorphStats,
    watch: &Watch,
) -> Result<(), Cancelled> {
    if params.all_quad {
        stats.parity_splits = pair_up(mesh, ground, rules);
    }
    polish(mesh, ground, rules, 4);
    watch.phase("advancing the front", None);
    stats.seams = advance(mesh, ground, watch)?.seams;
    let after_front = triangles_by_region(mesh, stats.regions);
    join_neighbours(mesh);
    let after_pairs = triangles_by_region(mesh, stats.regions);
    join_along_paths(mesh, ground);
    stats.regions_by_level = [0; 4];
    for (front, pairs) in after_front.iter().zip(&after_pairs) {
        let level = if *front <= 1 { 0 } else { 1 + usize::from(*pairs > 1) };
        stats.regions_by_level[level] += 1;
    }
    watch.phase("cleaning up", None);
    stats.clean_edits = clean(mesh, ground, rules.curve_tolerance, watch)?.edits;
    Ok(())
}

fn triangles_by_region(mesh: &Mixed, regions: usize) -> Vec<usize> {
    let mut count = vec![0; regions];
    for f in mesh.faces().filter(|&f| mesh.is_triangle(f)) {
        count[mesh.region(f) as usize] += 1;
    }
    count
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
    const REVISION: u32 = 7;
    const INPUTS: &'static [InputDef] = &[InputDef {
        name: "from",
        accepts: &[Port::Surface],
        required: true,
        doc: "the surface, with marked curves where it has features",
    }];
    const OUTPUTS: &'static [OutputDef] = &[OutputDef { name: "main", port: OutPort::Is(Port::Quads) }];
    const CARRIES: &'static str = "face groups and regions go to the quads on them, edge groups and marks to the edges \
        along their curves, vertex groups to the nearest vertex; seams and fields are dropped";
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
