//! How far quads and surface are apart, certified both ways, and where sizes must get smaller for it.

use glam::DVec3;

use crate::mesh::bvh::SegmentBvh;
use crate::metric::distance::{Target, decide_where, upper_bound};
use crate::technique::ground::Ground;
use crate::technique::mixed::Mixed;
use crate::watch::{Cancelled, Watch};

/// The surface, ready to be measured against.
pub(super) struct Check {
    pub(super) surface: Target,
    /// The points of the surface.
    pub(super) corners: SegmentBvh,
    /// The region of each of its faces.
    regions: Vec<u32>,
}

/// A place where quads and surface are too far apart.
#[derive(Clone, Copy)]
pub(super) struct Fault {
    /// The face nearest to it.
    pub(super) face: u32,
    /// The surface's point there.
    pub(super) at: DVec3,
    /// How far.
    pub(super) distance: f64,
}

impl Check {
    pub(super) fn new(ground: &Ground<'_>) -> Self {
        let surface = ground.surface;
        let corners = SegmentBvh::new(surface.points.iter().map(|&p| [p, p]).collect());
        Self { surface: Target::of(&surface.to_soup()), corners, regions: ground.regions.clone() }
    }

    /// The places where the mesh and the surface are farther apart than `tolerance`, by a witness in each face at fault,
    /// in regions that are `awake`.
    pub(super) fn beyond(
        &self,
        mesh: &Mixed,
        tolerance: f64,
        awake: &[bool],
        watch: &Watch,
    ) -> Result<Vec<Fault>, Cancelled> {
        let quads = Target::of(&mesh.leave().0);
        let faces: Vec<u32> = mesh.faces().collect();
        let mut found = Vec::new();
        let ours = |f: crate::mesh::FaceId| awake[mesh.region(faces[f.index()]) as usize];
        let theirs = |f: crate::mesh::FaceId| awake[self.regions[f.index()] as usize];
        let decision = decide_where(&quads, &self.surface, tolerance, &ours, watch)?;
        for (face, p, distance) in decision.into_iter().flat_map(|d| d.beyond) {
            let at = self.surface.bvh().closest(p).map_or(p, |c| c.nearest.point);
            found.push(Fault { face: faces[face.index()], at, distance });
        }
        let decision = decide_where(&self.surface, &quads, tolerance, &theirs, watch)?;
        for (_, at, distance) in decision.into_iter().flat_map(|d| d.beyond) {
            if let Some(nearest) = quads.bvh().closest(at) {
                found.push(Fault { face: faces[quads.face(nearest.index).index()], at, distance });
            }
        }
        Ok(found)
    }

    /// The certified distance between quads and surface, the larger one of both ways.
    pub(super) fn distance(&self, mesh: &Mixed, watch: &Watch) -> Result<f64, Cancelled> {
        let quads = Target::of(&mesh.leave().0);
        let to = upper_bound(&quads, &self.surface, watch)?.unwrap_or(0.0);
        let from = upper_bound(&self.surface, &quads, watch)?.unwrap_or(0.0);
        Ok(to.max(from))
    }
}

/// A place, how far about it, and the size that faces are to have there.
pub(super) type Wish = (DVec3, f64, f64);

/// Where a fault is, how far about it, and the size that should do there, if faces are to have `side` now.
pub(super) fn smaller(mesh: &Mixed, fault: &Fault, side: f64, tolerance: f64) -> Wish {
    // Between what a round place needs, the square root, and what a pointed one does.
    let factor = libm::pow(0.75 * tolerance / fault.distance, 0.75).clamp(0.4, 0.82);
    (mesh.centre(fault.face), 1.2 * side, factor * side)
}

/// The mean length of a face's sides.
pub(super) fn mean_side(mesh: &Mixed, f: u32) -> f64 {
    let (sum, n) = mesh.sides(f).fold((0.0, 0.0), |(sum, n), h| (sum + mesh.length(h), n + 1.0));
    sum / n
}

/// The mean length of the sides that a face is to have.
pub(super) fn mean_size(mesh: &Mixed, f: u32) -> f64 {
    let corners = mesh.corners(f);
    corners.iter().map(|&v| mesh.size(v)).sum::<f64>() / corners.len() as f64
}
