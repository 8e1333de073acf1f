//! Opening a guarded workshop for a step, and recounting the thresholds on what came out of it.
//!
//! A step never claims a threshold: [`recount`] measures the result anew and names the faces that break one, with the
//! cause where geometry or the user forbids better.

use glam::DVec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::corners::free_close_corners;
use super::editor::Editor;
use super::envelope::Envelope;
use super::keeper::{Curves, Keeper};
use super::limits::{Limits, SizeField};
use crate::mesh::bvh::TriangleBvh;
use crate::mesh::geometry::{Aabb, angle, stretch, triangle_size};
use crate::mesh::halfedge::{EnterError, HalfedgeMesh};
use crate::mesh::{FaceId, Freedom, IdVec, ResolvedFreedom, Surface, VertexId, edge_key};
use crate::metric::shape::best_stretch_with_angle;

/// What a tolerance means.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum ToleranceMode {
    /// The sum of squared distances to the planes of all faces merged so far: the measure of the papers. A squared
    /// length, so a plain number; it grows with the density of the input.
    QuadricSum,
    /// The root mean square of the distances to those planes: a length. Fast, and no bound of the distance.
    QuadricRms,
    /// The largest distance between result and reference, both ways, kept by certified tests: a length.
    #[default]
    Distance,
}

/// What a workshop is opened with.
#[derive(Clone, Debug)]
pub struct Setup {
    /// The meaning of `tolerance`.
    pub mode: ToleranceMode,
    /// In mesh units, or their square in [`ToleranceMode::QuadricSum`].
    pub tolerance: f64,
    /// How far marked curves may move, in mesh units.
    pub feature_tolerance: f64,
    /// The weight of the sharpest lines in the quadrics.
    pub feature_weight: f64,
    /// Thresholds.
    pub limits: Limits,
    /// Whether corners nearer to each other than `feature_tolerance` may become one; not where elements are locked.
    pub may_merge_corners: bool,
}

/// The hierarchy over the reference that a tolerance of this meaning needs: an empty one for the quadrics.
pub fn reference_tree(mode: ToleranceMode, reference: &Surface) -> TriangleBvh {
    match mode {
        ToleranceMode::Distance => TriangleBvh::of_surface(reference),
        ToleranceMode::QuadricSum | ToleranceMode::QuadricRms => TriangleBvh::new(Vec::new()),
    }
}

/// The diagonal of a surface's bounding box.
pub fn diagonal(surface: &Surface) -> f64 {
    Aabb::of(surface.points.iter().copied()).diagonal()
}

/// Opens a guarded workshop on `surface`, held against `reference`; `tree` is [`reference_tree`].
///
/// # Errors
/// A surface that is no oriented 2-manifold.
pub fn open<'a>(
    surface: &Surface,
    freedom: &ResolvedFreedom,
    reference: &'a Surface,
    tree: &'a TriangleBvh,
    setup: Setup,
) -> Result<Editor<'a>, EnterError> {
    let mut mesh = HalfedgeMesh::new(surface, freedom)?;
    if setup.may_merge_corners
        && let Some(loosened) = free_close_corners(&mesh, freedom, setup.feature_tolerance)
    {
        mesh = HalfedgeMesh::new(surface, &loosened)?;
    }
    let keeper = match setup.mode {
        ToleranceMode::QuadricSum => Keeper::QuadricSum { most: setup.tolerance, weight: setup.feature_weight },
        ToleranceMode::QuadricRms => Keeper::QuadricRms { most: setup.tolerance },
        ToleranceMode::Distance => {
            let is_same = surface.faces == reference.faces && surface.points == reference.points;
            let own = (!is_same).then(|| TriangleBvh::of_surface(surface));
            let envelope = Envelope::new(reference, tree, setup.tolerance, &mesh, own.as_ref());
            let curves = Curves::new(curve_segments(surface, &mesh, reference), setup.feature_tolerance);
            Keeper::Distance { envelope: Box::new(envelope), curves }
        }
    };
    Ok(Editor::new(mesh, keeper, setup.limits, setup.feature_weight))
}

/// The curves that marked edges are held against: the reference's own where it has any, and those of the mesh.
fn curve_segments(surface: &Surface, mesh: &HalfedgeMesh, reference: &Surface) -> Vec<[DVec3; 2]> {
    let marked = reference.carried.marks.keys().map(|key| key.map(|v| reference.points[v]));
    if reference.carried.marks.is_empty() {
        let edges = mesh.edges().filter(|&e| mesh.edge_freedom(e) != Freedom::Free);
        return edges.map(|e| mesh.ends(e).map(|v| surface.points[v])).collect();
    }
    // Rims are curves even where nobody marked them.
    let rims = mesh.edges().filter(|&e| mesh.is_boundary_edge(e)).map(|e| mesh.ends(e).map(|v| surface.points[v]));
    marked.chain(rims).collect()
}

/// Why a face breaks a threshold.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case", tag = "kind")]
pub enum Cause {
    /// Marked curves meet in a corner of the face at an angle that no good triangle has.
    CurvesMeet {
        /// The angle in degrees.
        degrees: f64,
    },
    /// All corners are kept as they are.
    Kept,
    /// No edit that keeps tolerance, curves and the other thresholds makes it better.
    Stuck,
}

/// Which threshold a face breaks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Threshold {
    /// `min-stretch`.
    MinStretch,
    /// `max-size`.
    MaxSize,
}

/// A face that breaks a threshold.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub struct Violation {
    /// Its number in the result.
    pub face: u32,
    /// Its centroid.
    pub at: [f64; 3],
    /// The threshold.
    pub threshold: Threshold,
    /// What was reached.
    pub value: f64,
    /// Why.
    pub cause: Cause,
}

/// The thresholds, counted on a result.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Recount {
    /// Least stretch.
    pub min_stretch: f64,
    /// Mean stretch.
    pub mean_stretch: f64,
    /// The same of the faces all whose vertices are free; `None` where there is none.
    pub free_mean_stretch: Option<f64>,
    /// Largest size.
    pub max_size: f64,
    /// Largest valence.
    pub max_valence: usize,
    /// Vertices with more edges than allowed.
    pub over_valence: usize,
    /// Faces that break a threshold, in order.
    pub violations: Vec<Violation>,
}

impl Recount {
    /// Violations that geometry or the user made unavoidable.
    pub fn excused(&self) -> usize {
        self.violations.iter().filter(|v| v.cause != Cause::Stuck).count()
    }
}

/// Counts the thresholds on a surface.
pub fn recount(surface: &Surface, freedom: &ResolvedFreedom, limits: &Limits) -> Recount {
    let mut out = Recount { min_stretch: 1.0, ..Recount::default() };
    let (mut sum, mut free) = (0.0, (0.0, 0_usize));
    for f in surface.faces.ids() {
        let corners = surface.corners(f);
        let (shape, size) = (stretch(corners), triangle_size(corners));
        sum += shape;
        if surface.faces[f].iter().all(|&v| freedom.vertices[v] == Freedom::Free) {
            free = (free.0 + shape, free.1 + 1);
        }
        out.min_stretch = out.min_stretch.min(shape);
        out.max_size = out.max_size.max(size);
        let centre = (corners[0] + corners[1] + corners[2]) / 3.0;
        let mut report = |threshold, value, cause| {
            out.violations.push(Violation { face: f.raw(), at: centre.to_array(), threshold, value, cause });
        };
        if shape < limits.min_stretch {
            report(Threshold::MinStretch, shape, cause(surface, freedom, f, limits.min_stretch));
        }
        if size > most_at(&limits.max_size, corners) * (1.0 + 1e-9) {
            let kept = surface.faces[f].iter().all(|&v| freedom.vertices[v] == Freedom::Keep);
            report(Threshold::MaxSize, size, if kept { Cause::Kept } else { Cause::Stuck });
        }
    }
    out.mean_stretch = if surface.faces.is_empty() { 0.0 } else { sum / surface.faces.len() as f64 };
    out.free_mean_stretch = (free.1 > 0).then(|| free.0 / free.1 as f64);
    let valences = valences(surface);
    out.max_valence = valences.iter().copied().max().unwrap_or(0);
    out.over_valence = valences.iter().filter(|&&n| n > limits.max_valence).count();
    out
}

/// The largest limit that a guard may have looked up for a face: sizes are checked at one corner.
fn most_at(field: &SizeField, corners: [DVec3; 3]) -> f64 {
    match field {
        SizeField::Uniform(length) => *length,
        SizeField::Varying { .. } => corners.into_iter().map(|p| field.at(p)).fold(0.0, f64::max),
    }
}

/// Edges at each vertex.
fn valences(surface: &Surface) -> IdVec<crate::mesh::id::Vertex, usize> {
    let mut edges: Vec<[VertexId; 2]> = Vec::with_capacity(3 * surface.faces.len());
    for &[a, b, c] in &surface.faces {
        edges.extend([edge_key(a, b), edge_key(b, c), edge_key(c, a)]);
    }
    edges.sort_unstable();
    edges.dedup();
    let mut valences = IdVec::filled(0, surface.points.len());
    for v in edges.into_iter().flatten() {
        valences[v] += 1;
    }
    valences
}

/// Why a face is below a stretch.
pub fn cause(surface: &Surface, freedom: &ResolvedFreedom, f: FaceId, threshold: f64) -> Cause {
    let corners = surface.faces[f];
    for at in 0..3 {
        let (v, a, b) = (corners[at], corners[(at + 1) % 3], corners[(at + 2) % 3]);
        let is_curve = |w| freedom.edge(edge_key(v, w)) != Freedom::Free;
        let opening = angle(surface.points[a] - surface.points[v], surface.points[b] - surface.points[v]);
        if is_curve(a) && is_curve(b) && opening < 0.5 && best_stretch_with_angle(opening) < threshold {
            return Cause::CurvesMeet { degrees: opening.to_degrees() };
        }
    }
    if corners.iter().all(|&v| freedom.vertices[v] == Freedom::Keep) { Cause::Kept } else { Cause::Stuck }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_threshold_of_a_fifth_is_seven_degrees() {
        assert!(best_stretch_with_angle(7.08_f64.to_radians()) > 0.2);
        assert!(best_stretch_with_angle(7.0_f64.to_radians()) < 0.2);
    }
}
