//! Where the merged vertex of a collapse goes: a short list of candidates, of which the first valid one wins.
//!
//! Date et al., JCISE 2005, section 4.2.1: the centroid of the ring, then the minimiser of the quadric; CAD &
//! Applications 2005: the midpoint first. Ours adds the minimiser nearest to the centroid, which keeps the even spacing
//! of the centroid and the surface of the quadric at once, and the two ends. Where freedom leaves only a curve or a
//! point, the candidates are those of the curve.

use glam::DVec3;

use crate::mesh::edit::Placement;
use crate::technique::quadric::Quadric;

/// In what order positions are tried.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Order {
    /// As printed: ring centroid, quadric optimum, then ours.
    Printed,
    /// The optimum nearest to the ring centroid first: stays on the surface, which leaves the tolerance to others.
    OnSurface,
}

/// How many candidates there are at most.
const MOST: usize = 5;

/// What placement looks at.
#[derive(Clone, Copy, Debug)]
pub struct Site {
    /// Where the merged vertex may lie.
    pub placement: Placement,
    /// The positions of its ends: the vanishing one and the kept one.
    pub ends: [DVec3; 2],
    /// The centroid of the ring.
    pub centroid: DVec3,
    /// Planes of both ends, about `origin`; empty where nothing asks for them.
    pub planes: Quadric,
    /// Lines of both ends, about `origin`; empty where nothing asks for them.
    pub lines: Quadric,
    /// The local origin of the quadrics.
    pub origin: DVec3,
}

impl Site {
    /// The positions to try, best first; each is only computed when the ones before it have failed.
    pub fn candidates(&self, order: Order) -> impl Iterator<Item = DVec3> + '_ {
        (0..MOST).filter_map(move |i| match self.placement {
            Placement::Fixed(point) => (i == 0).then_some(point),
            Placement::Segment(a, b) => self.on_segment(i, a, b),
            Placement::Anywhere => self.anywhere(order, i),
        })
    }

    fn on_segment(&self, i: usize, a: DVec3, b: DVec3) -> Option<DVec3> {
        match i {
            0 => {
                let t = self.planes.plus(&self.lines).optimum_on(a - self.origin, b - self.origin);
                Some(a + t * (b - a))
            }
            1 => Some(0.5 * (a + b)),
            2 => Some(a),
            3 => Some(b),
            _ => None,
        }
    }

    fn anywhere(&self, order: Order, i: usize) -> Option<DVec3> {
        let [p, q] = self.ends;
        let middle = 0.5 * (p + q);
        match (order, i) {
            (Order::Printed, 0) | (Order::OnSurface, 1) => Some(self.centroid),
            (Order::Printed, 1) | (Order::OnSurface, 2) => self.optimum(middle),
            (Order::Printed, 2) | (Order::OnSurface, 0) => self.optimum(self.centroid),
            (_, 3) => Some(p),
            (_, 4) => Some(q),
            _ => None,
        }
    }

    /// The minimiser nearest to a point; `None` when a nearly singular quadric answers far away.
    fn optimum(&self, near: DVec3) -> Option<DVec3> {
        let x = self.planes.plus(&self.lines).optimum(near - self.origin) + self.origin;
        let [p, q] = self.ends;
        ((x - near).length_squared() <= 4.0 * (q - p).length_squared()).then_some(x)
    }
}
