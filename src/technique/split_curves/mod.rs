//! Makes the segments of curves on a surface into edges of it, without changing its shape.
//!
//! R. Miyazaki and K. Harada, *Transformation of a closed 3D triangular mesh to a quadrilateral mesh based on feature
//! edges*, section 3.3: the corners and crossings of a face in a loop, cut by one segment after the other. Nothing is
//! computed but the order of points: crossings are shared by both faces of an edge, and two segments of a face cross if
//! their ends alternate round it. Crossings near a vertex snap to it, which spares slivers; a crossing beside it on the
//! way, from which the curve would turn along an edge, goes with it. The paper's fan of triangles may take three points
//! of one side; here each cell is cut so that its worst triangle is best.
//!
//! Invariants: all new vertices lie on old edges, so the surface stays as a point set; every segment of a curve is an
//! edge; labels change over curves only, and each curve has its own labels on its sides. O(n log n) for n faces, and
//! cubic in the crossings of one face up to a limit.

mod cells;
mod inherit;
mod labels;
mod sites;
#[cfg(test)]
mod tests;

use glam::DVec3;
use rustc_hash::FxHashMap;

use crate::mesh::id::{Face, Vertex};
use crate::mesh::topology::EdgeTable;
use crate::mesh::{Curve, EdgeKey, FaceId, IdVec, Surface, VertexId};

use sites::Sites;

/// Why curves cannot become edges.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SplitError {
    /// A point that is on no vertex and inside no edge.
    #[error("point {point} of curve {curve} lies on no vertex and inside no edge")]
    OffTheSurface {
        /// The curve.
        curve: usize,
        /// Its point.
        point: usize,
    },
    /// Neighbouring points without a common face.
    #[error("curve {curve} leaves the surface behind its point {point}")]
    LeavesTheSurface {
        /// The curve.
        curve: usize,
        /// The point before.
        point: usize,
    },
    /// Two segments that cross, or that are the same.
    #[error("curves {} and {} cross in face {face}", curves[0], curves[1])]
    Crossing {
        /// The curves; the same one twice where it crosses itself.
        curves: [usize; 2],
        /// The face.
        face: FaceId,
        /// A corner of it.
        at: DVec3,
    },
    /// A curve that crosses a seam: the copies of the edge would differ.
    #[error("curve {curve} crosses a seam")]
    CrossesSeam {
        /// The curve.
        curve: usize,
        /// Where.
        at: DVec3,
    },
    /// Faces that curves give one label, and other curves another.
    #[error("the sides of curves {} and {} contradict each other: regions {} and {} meet", curves[0], curves[1], labels[0], labels[1])]
    Labels {
        /// The curves.
        curves: [usize; 2],
        /// The labels.
        labels: [u32; 2],
        /// A point of the place.
        at: DVec3,
    },
}

impl SplitError {
    /// The curves at fault.
    pub fn curves(&self) -> Vec<usize> {
        match self {
            Self::OffTheSurface { curve, .. }
            | Self::LeavesTheSurface { curve, .. }
            | Self::CrossesSeam { curve, .. } => {
                vec![*curve]
            }
            Self::Crossing { curves, .. } | Self::Labels { curves, .. } => curves.to_vec(),
        }
    }

    /// Where it is, where that is known.
    pub fn at(&self) -> Option<DVec3> {
        match self {
            Self::OffTheSurface { .. } | Self::LeavesTheSurface { .. } => None,
            Self::Crossing { at, .. } | Self::CrossesSeam { at, .. } | Self::Labels { at, .. } => Some(*at),
        }
    }
}

/// A surface cut along curves.
#[derive(Clone, Debug)]
pub struct Split {
    /// The surface with everything that the old one carried but curves; its regions are those beside the curves.
    pub surface: Surface,
    /// The face that each face was cut from.
    pub parents: IdVec<Face, FaceId>,
    /// The edges and places of the new vertices, which follow the old ones.
    pub crossings: Vec<(EdgeKey, f64)>,
    /// The vertices of each curve; the first is not repeated at the end of a closed one.
    pub chains: Vec<Vec<VertexId>>,
    /// Points that snapped to a vertex.
    pub snapped: usize,
    /// Points moved along their edge to leave room.
    pub shifted: usize,
}

/// A segment of a curve in its direction: what lies left of it, and whose it is.
#[derive(Clone, Copy, Debug)]
struct Flank {
    label: u32,
    curve: usize,
}

/// The segments of all curves in both directions.
type Flanks = FxHashMap<[VertexId; 2], Flank>;

/// Cuts a surface along its `curves`. Points within the share `snap` of an edge from a vertex that no curve touches
/// snap to it, and so do those from which the curve would then go along their edge; other points keep that distance
/// from vertices and from each other where there is room.
///
/// # Errors
/// See [`SplitError`].
pub fn split_along(surface: &Surface, edges: &EdgeTable, curves: &[Curve], snap: f64) -> Result<Split, SplitError> {
    let mut sites = Sites::collect(surface, edges, curves)?;
    let snapped = sites.snap(snap);
    let is_marked = |e| surface.carried.marks.contains_key(&edges.key(e)) || edges.sides(e).len() != 2;
    let cut_corners = if snap > 0.0 { sites.cut_corners(&|e| !is_marked(e)) } else { 0 };
    let shifted = sites.spread(snap);
    let layout = sites.number();
    let mut points: IdVec<Vertex, DVec3> = surface.points.clone();
    for &([a, b], t) in &layout.crossings {
        points.push(surface.points[a] * (1.0 - t) + surface.points[b] * t);
    }
    let segments = sites::segments(surface, edges, curves, &layout)?;
    let (faces, parents) = cells::cut_faces(surface, edges, &points, &layout, &segments.chords)?;
    let mut result = Surface { points, faces, ..Surface::default() };
    let labels = labels::flood(surface, &result, &parents, &segments.flanks)?;
    result.carried = inherit::inherit(surface, edges, &layout, &parents, labels, result.points.len());
    let sites::Layout { crossings, chains, .. } = layout;
    Ok(Split { surface: result, parents, crossings, chains, snapped: snapped + cut_corners, shifted })
}
