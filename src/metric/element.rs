//! Metrics of one element: the functions behind criteria, one definition each.
//!
//! # Algorithm
//! A row of [`ELEMENT_METRICS`] is a function of the corners of a triangle, of those of a quad, or of both; two rows
//! look at more: one at the reference, one at the whole mesh. [`values`] applies a row to all faces that it is defined
//! on.
//!
//! # Source
//! The checks that finite-element preprocessors agree on, by the words of their manuals: Altair HyperMesh, "How Element
//! Quality is Calculated" (lengths, edge ratio, warpage, skew, Jacobian, taper, chordal deviation); Verdict (Knupp et
//! al., SAND2007-1751) for scaled Jacobian, aspect ratio and stretch of quads; the LS-DYNA theory manual, time step of
//! shells, for the characteristic length; OpenFOAM's `meshQualityDict` for flatness and twist of faces.
//!
//! # Invariants
//! - A value is a function of the element alone (and of the reference), not of its neighbours or of the order of faces.
//! - Ratios and angles do not depend on the unit of length: corners are scaled before anything is multiplied.
//! - Where an element is too degenerate for a value, the value is not a number, which every judge takes for the worst.
//!
//! # Cost
//! O(1) a face; `chordal-deviation` one search in a box hierarchy for each edge of a face.

use rayon::prelude::*;

use super::Subject;
use super::registry::{Direction, Unit};
use crate::mesh::{FaceId, Facet};
use glam::DVec3;

mod length;
mod quad;
mod triangle;

/// What a metric is defined on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum On {
    /// Triangles.
    Triangles,
    /// Quads.
    Quads,
    /// Triangles and quads.
    Faces,
    /// The whole mesh, which counts as one element.
    Mesh,
}

impl On {
    /// In words.
    pub fn text(self) -> &'static str {
        match self {
            Self::Triangles => "triangles",
            Self::Quads => "quads",
            Self::Faces => "faces",
            Self::Mesh => "the mesh",
        }
    }
}

/// How a value is found.
#[derive(Clone, Copy, Debug)]
pub enum Measure {
    /// Of the corners of a triangle.
    Triangle(fn([DVec3; 3]) -> f64),
    /// Of the corners of a quad.
    Quad(fn([DVec3; 4]) -> f64),
    /// Of either.
    Face(fn([DVec3; 3]) -> f64, fn([DVec3; 4]) -> f64),
    /// Of the edges of a face, against the reference.
    Reference,
    /// Of the whole mesh.
    Mesh(fn(&Subject<'_>) -> Option<f64>),
}

/// A metric of an element.
#[derive(Clone, Copy, Debug)]
pub struct ElementMetric {
    /// Its name in criteria.
    pub name: &'static str,
    /// Its unit.
    pub unit: Unit,
    /// Which values are good: [`Direction::Higher`] or [`Direction::Lower`].
    pub direction: Direction,
    /// Formula and range.
    pub doc: &'static str,
    /// How it is found.
    pub measure: Measure,
}

impl ElementMetric {
    /// What it is defined on.
    pub fn on(&self) -> On {
        match self.measure {
            Measure::Triangle(_) => On::Triangles,
            Measure::Quad(_) => On::Quads,
            Measure::Face(..) | Measure::Reference => On::Faces,
            Measure::Mesh(_) => On::Mesh,
        }
    }

    /// Whether it compares with a reference.
    pub fn needs_reference(&self) -> bool {
        matches!(self.measure, Measure::Reference)
    }
}

const fn metric(
    name: &'static str,
    unit: Unit,
    direction: Direction,
    measure: Measure,
    doc: &'static str,
) -> ElementMetric {
    ElementMetric { name, unit, direction, doc, measure }
}

/// All metrics of elements, in the order of tables.
pub static ELEMENT_METRICS: &[ElementMetric] = {
    use Direction::{Higher, Lower};
    use Measure::{Face, Quad, Reference, Triangle};
    use Unit::{Area, Degrees, Length, Ratio, Share};
    &[
        metric("min-length", Length, Higher, Face(length::shortest, length::shortest), "Shortest side."),
        metric("max-length", Length, Lower, Face(length::longest, length::longest), "Longest side."),
        metric(
            "characteristic-length",
            Length,
            Higher,
            Face(triangle::characteristic_length, quad::characteristic_length),
            "Length that bounds an explicit time step: area / longest side of a quad, 2 · area / longest side of a triangle.",
        ),
        metric("area", Area, Higher, Face(triangle::area, quad::area), "Area; a quad is the mean of its two cuts."),
        metric(
            "edge-ratio",
            Ratio,
            Lower,
            Face(length::edge_ratio, length::edge_ratio),
            "Longest side / shortest side; from 1.",
        ),
        metric(
            "aspect-ratio",
            Ratio,
            Lower,
            Face(triangle::aspect_ratio, quad::aspect_ratio),
            "Triangle: (√3/2) · longest side / height on it. Quad: longest side · perimeter / (4 · area). From 1.",
        ),
        metric(
            "stretch",
            Ratio,
            Higher,
            Face(triangle::stretch, quad::stretch),
            "Triangle: √12 · inradius / longest side. Quad: √2 · shortest side / longer diagonal. 0 to 1.",
        ),
        metric(
            "skew",
            Degrees,
            Lower,
            Face(triangle::skew, quad::skew),
            "90 less the least angle between the lines through midpoints of opposite sides (quad), or between a median and \
             the line through the midpoints of the sides beside it (triangle); 0 to 90.",
        ),
        metric(
            "equiangle-skew",
            Ratio,
            Lower,
            Face(triangle::equiangle_skew, quad::equiangle_skew),
            "Larger of (largest angle − e) / (180 − e) and (e − least angle) / e, e = 60 or 90; 0 to 1, more where reflex.",
        ),
        metric("min-tria-angle", Degrees, Higher, Triangle(triangle::min_angle), "Least angle of a triangle; 0 to 60."),
        metric(
            "max-tria-angle",
            Degrees,
            Lower,
            Triangle(triangle::max_angle),
            "Largest angle of a triangle; 60 to 180.",
        ),
        metric("min-quad-angle", Degrees, Higher, Quad(quad::min_angle), "Least corner angle of a quad; 0 to 90."),
        metric(
            "max-quad-angle",
            Degrees,
            Lower,
            Quad(quad::max_angle),
            "Largest corner angle of a quad; from 90, above 180 at a reflex corner.",
        ),
        metric(
            "warp-angle",
            Degrees,
            Lower,
            Quad(quad::warp_angle),
            "Largest angle between the normals of the two triangles of a cut, over both cuts; planar 0, 0 to 180.",
        ),
        metric(
            "jacobian",
            Ratio,
            Higher,
            Quad(quad::jacobian),
            "Least / largest determinant of the bilinear map at its 2 × 2 Gauss points, along the centre normal; \
             parallelogram 1, inverted below 0.",
        ),
        metric(
            "scaled-jacobian",
            Ratio,
            Higher,
            Quad(quad::scaled_jacobian),
            "Least corner area along the centre normal / product of its sides; −1 to 1, rectangle 1.",
        ),
        metric(
            "taper",
            Ratio,
            Lower,
            Quad(quad::taper),
            "1 − least corner triangle / half of the quad's area; parallelogram 0, triangle 1.",
        ),
        metric(
            "flatness",
            Ratio,
            Higher,
            Quad(quad::flatness),
            "Length of the sum of the area vectors of the triangles round the centre / sum of their areas; planar 1.",
        ),
        metric(
            "twist",
            Ratio,
            Higher,
            Quad(quad::twist),
            "Least cosine between the normal of a quad and those of the triangles round its centre; planar 1.",
        ),
        metric(
            "triangle-twist",
            Ratio,
            Higher,
            Quad(quad::triangle_twist),
            "Least cosine between the normals of neighbouring triangles round the centre of a quad; planar 1.",
        ),
        metric(
            "chordal-deviation",
            Length,
            Lower,
            Reference,
            "Largest distance from the midpoint of a side to the reference.",
        ),
        metric(
            "triangle-share",
            Share,
            Lower,
            Measure::Mesh(|subject| {
                let (triangles, faces) = (subject.triangles().faces.len(), subject.mesh().faces.len());
                (faces > 0).then(|| triangles as f64 / faces as f64)
            }),
            "Triangles / faces of the mesh.",
        ),
    ]
};

/// The metric of this name.
pub fn find(name: &str) -> Option<&'static ElementMetric> {
    ELEMENT_METRICS.iter().find(|metric| metric.name == name)
}

/// Faces between two looks at the watch.
const PART: usize = 1 << 14;

/// The value of each face that the metric is defined on, in order of face id. Empty for a metric of the whole mesh, and
/// for one that compares where there is no reference. When the watch is cancelled some are missing; ask it afterwards.
pub fn values(subject: &Subject<'_>, metric: &ElementMetric) -> Vec<(FaceId, f64)> {
    let mesh = subject.mesh();
    let at = |v: &crate::mesh::VertexId| mesh.points[*v];
    let target = subject.reference().map(Subject::target);
    let value = |facet: &Facet| match (metric.measure, facet) {
        (Measure::Triangle(of) | Measure::Face(of, _), Facet::Tri(corners)) => Some(of(corners.each_ref().map(at))),
        (Measure::Quad(of) | Measure::Face(_, of), Facet::Quad(corners)) => Some(of(corners.each_ref().map(at))),
        (Measure::Reference, facet) => {
            let corners: Vec<DVec3> = facet.corners().iter().map(at).collect();
            Some(length::chordal_deviation(&corners, target?.bvh()))
        }
        (Measure::Triangle(_) | Measure::Quad(_) | Measure::Mesh(_), _) => None,
    };
    let mut all: Vec<Option<f64>> = Vec::with_capacity(mesh.faces.len());
    for part in mesh.faces.as_slice().chunks(PART) {
        if subject.watch().is_cancelled() {
            break;
        }
        all.par_extend(part.par_iter().map(value));
    }
    mesh.faces.ids().zip(all).filter_map(|(face, value)| Some((face, value?))).collect()
}

/// Corners moved to the first one and scaled to about 1; `None` without extent, or where it is no number.
fn scaled<const N: usize>(corners: [DVec3; N]) -> Option<[DVec3; N]> {
    let largest = |p: &[DVec3; N]| p.iter().map(|p| p.abs().max_element()).fold(0.0, f64::max);
    // Halved first, so that the difference of two large numbers is one.
    let halves = corners.map(|p| 0.5 * p);
    let local = halves.map(|p| p - halves[0]);
    let size = largest(&local);
    (size > 0.0 && size.is_finite()).then(|| local.map(|p| p / size))
}

#[cfg(test)]
mod tests;
