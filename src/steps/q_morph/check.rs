//! How far quads and surface are apart, certified both ways, and where sizes must get smaller for it.

use glam::DVec3;

use crate::mesh::Surface;
use crate::metric::distance::{Target, decide, one_sided};
use crate::technique::mixed::Mixed;
use crate::watch::{Cancelled, Watch};

/// The surface, ready to be measured against.
pub(super) struct Check {
    surface: Target,
}

/// What a check found.
pub(super) struct Found {
    /// A middle, how far about it, and the size that should do there.
    pub(super) places: Vec<(DVec3, f64, f64)>,
    /// The largest distance known.
    pub(super) worst: f64,
}

impl Check {
    pub(super) fn new(surface: &Surface) -> Self {
        Self { surface: Target::of(&surface.to_soup()) }
    }

    /// The places where quads and surface are farther apart than `tolerance`, by a witness in each face at fault.
    pub(super) fn beyond(&self, mesh: &Mixed, tolerance: f64, watch: &Watch) -> Result<Found, Cancelled> {
        let quads = Target::of(&mesh.leave().0);
        let faces: Vec<u32> = mesh.faces().collect();
        let mut found = Found { places: Vec::new(), worst: 0.0 };
        let mut note = |f: u32, distance: f64| {
            let (sum, n) = mesh.sides(f).fold((0.0, 0.0), |(sum, n), h| (sum + mesh.length(h), n + 1.0));
            // Between what a round place needs, the square root, and what a pointed one does.
            let factor = libm::pow(0.75 * tolerance / distance, 0.75).clamp(0.4, 0.82);
            found.places.push((mesh.centre(f), 1.2 * sum / n, factor * sum / n));
            found.worst = f64::max(found.worst, distance);
        };
        for (face, _, distance) in decide(&quads, &self.surface, tolerance, watch)?.into_iter().flat_map(|d| d.beyond) {
            note(faces[face.index()], distance);
        }
        for (_, at, distance) in decide(&self.surface, &quads, tolerance, watch)?.into_iter().flat_map(|d| d.beyond) {
            if let Some(nearest) = quads.bvh().closest(at) {
                note(faces[quads.face(nearest.index).index()], distance);
            }
        }
        Ok(found)
    }

    /// The certified distance between quads and surface, the larger one of both ways.
    pub(super) fn distance(&self, mesh: &Mixed, watch: &Watch) -> Result<f64, Cancelled> {
        let quads = Target::of(&mesh.leave().0);
        let to = one_sided(&quads, &self.surface, watch)?.map_or(0.0, |d| d.upper);
        let from = one_sided(&self.surface, &quads, watch)?.map_or(0.0, |d| d.upper);
        Ok(to.max(from))
    }
}
