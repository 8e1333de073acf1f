//! When an edit is worth it.

use glam::DVec3;

use super::limits::least_stretch;
use super::mesh::GuardedMesh;
use super::refused::Refused;
use super::tally::Tally;
use crate::mesh::FaceId;
use crate::mesh::geometry::{stretch, triangle_size};

/// When an edit is worth it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Gain {
    /// The faces come nearer to this stretch: see [`Tally::mends`].
    Mend(f64),
    /// The least stretch rises.
    LeastStretch,
    /// The smallest angle rises: in a plane such flips end in the Delaunay triangulation.
    LeastAngle,
    /// The product of least and mean stretch rises, and the least does not fall below the threshold.
    Quality,
    /// The mean stretch rises, and no face falls below this stretch that was not.
    Mean(f64),
    /// Nothing asked, except that no face falls below this stretch that was not.
    Keep(f64),
    /// Nothing asked, except that no face falls below the threshold.
    None,
}

impl GuardedMesh<'_> {
    /// The tally of live faces, as the gain wants it.
    pub(super) fn tally(&self, faces: &[FaceId], gain: Gain) -> Tally {
        let mut tally = match gain {
            Gain::Mend(threshold) => Tally::short_of(threshold),
            Gain::LeastStretch | Gain::LeastAngle | Gain::Quality | Gain::Mean(_) | Gain::Keep(_) | Gain::None => {
                Tally::new()
            }
        };
        for &f in faces {
            tally.add(self.stretch(f), self.size(f));
        }
        tally
    }

    /// Whether the patch is worth it, and breaks no threshold that held.
    pub(super) fn gains(&self, before: &Tally, gain: Gain) -> Result<(), Refused> {
        let mut after = Tally::short_of(before.threshold);
        let limit = &self.limits.max_size;
        for points in &self.patch.points {
            let size = triangle_size(*points);
            if !limit.is_unlimited() && size > self.limits.ceiling(points[0], before.size_max) {
                return Err(Refused::Shape);
            }
            after.add(stretch(*points), size);
        }
        let floor = least_stretch(self.limits.min_stretch, before.stretch_min);
        let (floor, is_worth_it) = match gain {
            Gain::Mend(_) => (least_stretch(before.threshold, before.stretch_min), after.mends(before)),
            Gain::LeastStretch => (0.0, after.stretch_min > before.stretch_min * (1.0 + 1e-3)),
            Gain::LeastAngle => (floor, self.least_sine_rises()),
            Gain::Quality => (floor, after.quality() > before.quality() * (1.0 + 2e-3)),
            Gain::Mean(least) => {
                let floor = least_stretch(least, before.stretch_min).max(floor);
                (floor, after.mean() > before.mean() * (1.0 + 1e-3))
            }
            Gain::Keep(least) => (least_stretch(least, before.stretch_min).max(floor), true),
            Gain::None => (floor, true),
        };
        match (after.stretch_min >= floor, is_worth_it) {
            (true, true) => Ok(()),
            (true, false) => Err(Refused::Gain),
            (false, _) => Err(Refused::Shape),
        }
    }

    fn least_sine_rises(&self) -> bool {
        let old = self.patch.old.iter().map(|&f| least_sine(self.mesh.corner_points(f)));
        let new = self.patch.points.iter().map(|&points| least_sine(points));
        new.fold(1.0, f64::min) > old.fold(1.0, f64::min) * (1.0 + 1e-6)
    }
}

/// The sine of the smallest angle: twice the area over the product of the two longer sides.
fn least_sine([a, b, c]: [DVec3; 3]) -> f64 {
    let squares = [(b - a).length_squared(), (c - b).length_squared(), (a - c).length_squared()];
    let [x, y, z] = squares;
    let longer = (x * y).max(y * z).max(z * x);
    if longer > 0.0 { ((b - a).cross(c - a).length_squared() / longer).sqrt() } else { 0.0 }
}
