//! Thresholds on elements: what the faces round a changed vertex must keep.

use std::sync::Arc;

use glam::DVec3;

use crate::mesh::Surface;
use crate::mesh::bvh::TriangleBvh;

/// A length that may vary over the surface.
#[derive(Clone, Debug)]
pub enum SizeField {
    /// The same everywhere; infinite where there is no limit.
    Uniform(f64),
    /// Values at the corners of the faces of a surface, interpolated at its nearest point.
    Varying {
        /// The faces that the values belong to.
        tree: Arc<TriangleBvh>,
        /// Three values a face.
        values: Arc<[[f64; 3]]>,
    },
}

impl SizeField {
    /// A field with three values a face of `surface`.
    pub fn varying(surface: &Surface, values: Vec<[f64; 3]>) -> Self {
        Self::Varying { tree: Arc::new(TriangleBvh::of_surface(surface)), values: values.into() }
    }

    /// The length at a point.
    pub fn at(&self, p: DVec3) -> f64 {
        match self {
            Self::Uniform(length) => *length,
            Self::Varying { tree, values } => tree.closest(p).map_or(f64::INFINITY, |c| {
                let (at, weights) = (values[c.index as usize], c.nearest.weights);
                at[0] * weights[0] + at[1] * weights[1] + at[2] * weights[2]
            }),
        }
    }

    /// Whether there is no limit anywhere.
    pub fn is_unlimited(&self) -> bool {
        matches!(self, Self::Uniform(length) if *length == f64::INFINITY)
    }
}

/// The thresholds C2 to C4 of Date et al.
#[derive(Clone, Debug)]
pub struct Limits {
    /// Faces have at least this stretch.
    pub min_stretch: f64,
    /// Faces have no longer side than this.
    pub max_size: SizeField,
    /// Vertices have at most this many edges.
    pub max_valence: usize,
}

/// What the new star of a merged vertex must keep besides the limits, tolerance and embedding.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StarRules {
    /// Least stretch of the new faces; where a face of the old star is below it, no less than that one.
    pub min_stretch: f64,
    /// Least mean stretch of the new faces; where the mean of the old star is below it, no less than that.
    pub mean_stretch: f64,
    /// Where given, the star must come nearer to this stretch: see [`super::Tally::mends`].
    pub mend_below: Option<f64>,
}

/// The least stretch of a new face, where the faces that it replaces reach down to `before`: the limit, or what was
/// there already where that breaks it. Allows for the single precision in which stretch is kept.
pub(super) fn least_stretch(limit: f64, before: f64) -> f64 {
    if before < limit * (1.0 - 1e-6) { before } else { limit }
}

impl Limits {
    /// The longest side of a new face near `p`, where the faces that it replaces reach `before`: the limit, or what was
    /// there already where that breaks it. The comparison allows for the single precision in which sizes are kept.
    pub(super) fn ceiling(&self, p: DVec3, before: f64) -> f64 {
        let limit = self.max_size.at(p);
        if before > limit * (1.0 + 1e-6) { before } else { limit }
    }
}
