//! Where the merged vertex of a collapse goes: a short list of candidates, of which the first valid one wins.
//!
//! Date et al., JCISE 2005, section 4.2.1: the centroid of the ring, then the minimiser of the quadric; CAD &
//! Applications 2005: the midpoint first. Ours adds the minimiser nearest to the centroid, which keeps the even spacing
//! of the centroid and the surface of the quadric at once, and the two ends. Where freedom leaves only a curve or a
//! point, the candidates are those of the curve.

use glam::DVec3;

use crate::mesh::edit::Placement;
use crate::metric::ToleranceMode;
use crate::technique::guarded::Site;

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

impl Order {
    /// As printed where quadrics are the tolerance; else on the surface, as the tolerance is kept by other tests.
    pub fn of(mode: ToleranceMode) -> Self {
        match mode {
            ToleranceMode::QuadricSum | ToleranceMode::QuadricRms => Self::Printed,
            ToleranceMode::Distance => Self::OnSurface,
        }
    }

    /// The positions to try, best first; each is only computed when the ones before it have failed.
    pub fn candidates(self, site: &Site) -> impl Iterator<Item = DVec3> + '_ {
        (0..MOST).filter_map(move |i| match site.placement {
            Placement::Fixed(point) => (i == 0).then_some(point),
            Placement::Segment(a, b) => on_segment(site, i, [a, b]),
            Placement::Anywhere => self.anywhere(site, i),
        })
    }

    fn anywhere(self, site: &Site, i: usize) -> Option<DVec3> {
        let [p, q] = site.ends;
        let middle = 0.5 * (p + q);
        match (self, i) {
            (Self::Printed, 0) | (Self::OnSurface, 1) => Some(site.centroid),
            (Self::Printed, 1) | (Self::OnSurface, 2) => optimum(site, middle),
            (Self::Printed, 2) | (Self::OnSurface, 0) => optimum(site, site.centroid),
            (_, 3) => Some(p),
            (_, 4) => Some(q),
            _ => None,
        }
    }
}

fn on_segment(site: &Site, i: usize, [a, b]: [DVec3; 2]) -> Option<DVec3> {
    match i {
        0 => {
            let t = site.planes.plus(&site.lines).optimum_on(a - site.origin, b - site.origin);
            Some(a + t * (b - a))
        }
        1 => Some(0.5 * (a + b)),
        2 => Some(a),
        3 => Some(b),
        _ => None,
    }
}

/// The minimiser nearest to a point; `None` when a nearly singular quadric answers far away.
fn optimum(site: &Site, near: DVec3) -> Option<DVec3> {
    let x = site.planes.plus(&site.lines).optimum(near - site.origin) + site.origin;
    let [p, q] = site.ends;
    ((x - near).length_squared() <= 4.0 * (q - p).length_squared()).then_some(x)
}
