//! Recounting the thresholds on what came out of a guarded mesh.
//!
//! A step never claims a threshold: [`recount`] measures the result anew and names the faces that break one, with the
//! cause where geometry or the user forbids better.

use glam::DVec3;
use schemars::JsonSchema;
use serde::Serialize;

use super::limits::{Limits, SizeField};
use crate::mesh::geometry::{angle, stretch, triangle_size};
use crate::mesh::{FaceId, Freedom, IdVec, ResolvedFreedom, Surface, VertexId, edge_key};
use crate::metric::shape::best_stretch_with_angle;

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
