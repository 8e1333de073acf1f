//! What a tolerance means, and whether an edit keeps it.
//!
//! Three meanings: the sum of squared distances to the accumulated planes, as Date et al. print it (a squared length,
//! which grows with the density of the input); its root mean square (a length); and the certified two-sided distance
//! to a reference ([`super::certificate`]). Curves are bounded in the same meaning: by the quadrics of their lines, or
//! by their distance from the curves of the reference.

use glam::DVec3;

use super::certificate::Envelope;
use crate::mesh::bvh::SegmentBvh;
use crate::mesh::geometry::closest_on_segment;
use crate::technique::quadric::Quadric;

/// The meaning of the tolerance, with its value.
#[derive(Debug)]
pub(super) enum Keeper<'a> {
    /// Sum of squared plane distances, a squared length.
    QuadricSum {
        /// The largest sum.
        most: f64,
        /// The weight of the sharpest line, by which sums over lines are divided.
        weight: f64,
    },
    /// Root mean square of plane distances, a length.
    QuadricRms {
        /// The largest mean.
        most: f64,
    },
    /// Two-sided distance to a reference.
    Distance {
        /// The zone round the reference.
        envelope: Box<Envelope<'a>>,
        /// The curves of the reference.
        curves: Curves,
    },
}

impl Keeper<'_> {
    /// Whether a vertex with these planes and lines may lie at `x` (about the same origin), as far as quadrics say.
    pub(super) fn admits_point(&self, planes: &Quadric, lines: &Quadric, x: DVec3) -> bool {
        match *self {
            Self::QuadricSum { most, weight } => planes.eval(x) <= most && lines.eval(x) <= most * weight,
            Self::QuadricRms { most } => {
                let mean = |sum: f64, count: f64| if count > 0.0 { sum / count } else { 0.0 };
                let squared = most * most;
                mean(planes.eval(x), planes.trace()) <= squared
                    && (lines.trace() == 0.0 || mean(lines.eval(x), lines.trace() / 2.0) <= squared)
            }
            Self::Distance { .. } => true,
        }
    }

    /// Whether the tolerance is the certified distance.
    pub(super) fn is_certified(&self) -> bool {
        matches!(self, Self::Distance { .. })
    }

    /// The point of the reference nearest to `p`, where the tolerance has a reference.
    pub(super) fn project(&self, p: DVec3) -> Option<DVec3> {
        match self {
            Self::Distance { envelope, .. } => envelope.project(p).map(|(point, _)| point),
            Self::QuadricSum { .. } | Self::QuadricRms { .. } => None,
        }
    }

    /// As [`Keeper::project`] for many points near `middle`.
    pub(super) fn project_round(&self, middle: DVec3, points: &mut [DVec3]) {
        let Self::Distance { envelope, .. } = self else { return };
        let Some((_, face)) = envelope.project(middle) else { return };
        for p in points {
            *p = envelope.project_near(*p, face).unwrap_or(*p);
        }
    }

    /// The point of the reference's curves nearest to `p`, where the tolerance has a reference.
    pub(super) fn project_to_curve(&self, p: DVec3) -> Option<DVec3> {
        match self {
            Self::Distance { curves, .. } => curves.project(p),
            Self::QuadricSum { .. } | Self::QuadricRms { .. } => None,
        }
    }
}

/// Reference curves and how far marked edges may lie from them.
#[derive(Debug)]
pub struct Curves {
    segments: Vec<[DVec3; 2]>,
    tree: SegmentBvh,
    reach: f64,
}

/// Parts of a segment that one check looks at before it gives up.
const CHECK_BUDGET: usize = 256;

impl Curves {
    /// Curves made of these segments.
    pub fn new(segments: Vec<[DVec3; 2]>, reach: f64) -> Self {
        Self { tree: SegmentBvh::new(segments.clone()), segments, reach }
    }

    /// The nearest point of the curves.
    pub fn project(&self, p: DVec3) -> Option<DVec3> {
        self.tree.closest(p).map(|c| c.nearest.point)
    }

    /// Whether a segment lies within reach of the curves: the set of points near one of their segments is convex.
    pub fn admit(&self, segment: [DVec3; 2]) -> bool {
        let squared = self.reach * self.reach;
        let mut stack = vec![segment];
        for _ in 0..CHECK_BUDGET {
            let Some([a, b]) = stack.pop() else { return true };
            let middle = 0.5 * (a + b);
            let Some(closest) = self.tree.closest_within(middle, squared) else { return false };
            let other = self.segments[closest.index as usize];
            let is_near = |p| closest_on_segment(p, other).distance_squared <= squared;
            if !(is_near(a) && is_near(b)) && closest.distance() + 0.5 * (b - a).length() > self.reach {
                stack.extend([[a, middle], [middle, b]]);
            }
        }
        false
    }
}
