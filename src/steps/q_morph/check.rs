//! How far quads and surface are apart, certified both ways, and where sizes must get smaller for it.

use glam::DVec3;

use crate::mesh::Surface;
use crate::mesh::bvh::SegmentBvh;
use crate::metric::distance::{Target, decide, one_sided};
use crate::technique::mixed::Mixed;
use crate::watch::{Cancelled, Watch};

/// The surface, ready to be measured against.
pub(super) struct Check {
    pub(super) surface: Target,
    /// The points of the surface.
    pub(super) corners: SegmentBvh,
}

/// A place where quads and surface are too far apart.
pub(super) struct Fault {
    /// The face nearest to it.
    pub(super) face: u32,
    /// The surface's point there.
    pub(super) at: DVec3,
    /// How far.
    pub(super) distance: f64,
}

impl Check {
    pub(super) fn new(surface: &Surface) -> Self {
        let corners = SegmentBvh::new(surface.points.iter().map(|&p| [p, p]).collect());
        Self { surface: Target::of(&surface.to_soup()), corners }
    }

    /// The places where the mesh and the surface are farther apart than `tolerance`, by a witness in each face at fault.
    pub(super) fn beyond(&self, mesh: &Mixed, tolerance: f64, watch: &Watch) -> Result<Vec<Fault>, Cancelled> {
        let quads = Target::of(&mesh.leave().0);
        let faces: Vec<u32> = mesh.faces().collect();
        let mut found = Vec::new();
        for (face, p, distance) in decide(&quads, &self.surface, tolerance, watch)?.into_iter().flat_map(|d| d.beyond) {
            let at = self.surface.bvh().closest(p).map_or(p, |c| c.nearest.point);
            found.push(Fault { face: faces[face.index()], at, distance });
        }
        for (_, at, distance) in decide(&self.surface, &quads, tolerance, watch)?.into_iter().flat_map(|d| d.beyond) {
            if let Some(nearest) = quads.bvh().closest(at) {
                found.push(Fault { face: faces[quads.face(nearest.index).index()], at, distance });
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

/// For each fault a middle, how far about it, and the size that should do there.
pub(super) fn smaller<'a>(
    mesh: &Mixed,
    faults: impl IntoIterator<Item = &'a Fault>,
    tolerance: f64,
) -> Vec<(DVec3, f64, f64)> {
    let place = |fault: &Fault| {
        let side = mean_side(mesh, fault.face);
        // Between what a round place needs, the square root, and what a pointed one does.
        let factor = libm::pow(0.75 * tolerance / fault.distance, 0.75).clamp(0.4, 0.82);
        (mesh.centre(fault.face), 1.2 * side, factor * side)
    };
    faults.into_iter().map(place).collect()
}

/// The mean length of a face's sides.
fn mean_side(mesh: &Mixed, f: u32) -> f64 {
    let (sum, n) = mesh.sides(f).fold((0.0, 0.0), |(sum, n), h| (sum + mesh.length(h), n + 1.0));
    sum / n
}
