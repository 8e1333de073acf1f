//! A triangle that many points are held against: offsets of faces, tested fast.

use glam::DVec3;

use crate::mesh::geometry::closest_on_triangle;

pub(super) type Triangle = [DVec3; 3];

/// A triangle that many points are held against, with what does not depend on the point.
#[derive(Clone, Copy, Debug)]
pub(super) struct Target {
    pub(super) corners: Triangle,
    /// Its box, grown by the reach.
    low: DVec3,
    high: DVec3,
    reach: f64,
    pub(super) normal: DVec3,
    /// The square of the normal; 0 where the triangle is too thin to have one.
    pub(super) squared: f64,
}

impl Target {
    pub(super) fn new(corners: Triangle, reach: f64) -> Self {
        let [a, b, c] = corners;
        let normal = (b - a).cross(c - a);
        let size = (b - a).length_squared().max((c - b).length_squared()).max((a - c).length_squared());
        let squared = normal.length_squared();
        // Needles get no shortcut: their normal may be off.
        let squared = if squared > 1e-12 * size * size { squared } else { 0.0 };
        Self { corners, low: a.min(b).min(c) - reach, high: a.max(b).max(c) + reach, reach, normal, squared }
    }

    /// The side that `p` lies furthest beyond, or the longest one where the triangle is too thin to say.
    pub(super) fn side_towards(&self, p: DVec3) -> [DVec3; 2] {
        let [a, b, c] = self.corners;
        let beyond = |[p0, p1]: [DVec3; 2]| {
            let along = p1 - p0;
            if self.squared > 0.0 {
                let outward = along.cross(self.normal);
                outward.dot(p - p0) / outward.length()
            } else {
                along.length_squared()
            }
        };
        let sides = [[a, b], [b, c], [c, a]].map(|side| (beyond(side), side));
        sides.into_iter().max_by(|x, y| x.0.total_cmp(&y.0)).map_or([a, b], |(_, side)| side)
    }

    pub(super) fn distance_squared(&self, p: DVec3) -> f64 {
        closest_on_triangle(p, self.corners).distance_squared
    }

    /// Whether all corners of `part` lie within the root of `squared`: then all of `part` does.
    pub(super) fn covers(&self, part: &[DVec3], squared: f64) -> bool {
        part.iter().all(|&p| self.is_near(p, squared))
    }

    /// The squared distance of the furthest corner of `part`, and so of all of it, where that is at most `squared`.
    pub(super) fn furthest(&self, part: &[DVec3], squared: f64) -> Option<f64> {
        part.iter().try_fold(0.0, |most, &p| {
            let own = if self.is_off(p, squared) { f64::INFINITY } else { self.distance_squared(p) };
            (own <= squared).then_some(own.max(most))
        })
    }

    pub(super) fn is_near(&self, p: DVec3, squared: f64) -> bool {
        if self.squared > 0.0 {
            let [a, b, c] = self.corners;
            let (ab, ac, ap) = (b - a, c - a, p - a);
            let height = self.normal.dot(ap);
            if height * height > 1.000_001 * squared * self.squared {
                return false;
            }
            let (v, w) = (ap.cross(ac).dot(self.normal), ab.cross(ap).dot(self.normal));
            // Over the triangle its plane is what is nearest.
            if v >= 0.0 && w >= 0.0 && v + w <= self.squared {
                return height * height <= squared * self.squared;
            }
        }
        self.distance_squared(p) <= squared
    }

    /// Whether a point is further from the plane than that: by more than rounding, and so further from the triangle.
    fn is_off(&self, p: DVec3, squared: f64) -> bool {
        let height = self.normal.dot(p - self.corners[0]);
        self.squared > 0.0 && height * height > 1.000_001 * squared * self.squared
    }

    /// Whether a point is further from the box than that.
    fn is_out(&self, p: DVec3, squared: f64) -> bool {
        let beyond = (self.low + self.reach - p).max(p - (self.high - self.reach)).max(DVec3::ZERO);
        beyond.length_squared() > 1.000_001 * squared
    }

    /// Whether `part` reaches out of the box by more than the reach that the box was grown by.
    fn is_clear_of(&self, low: DVec3, high: DVec3) -> bool {
        low.cmplt(self.low).any() || high.cmpgt(self.high).any()
    }
}

/// A target that covers the part: the one that covered the last part, or the first of all.
pub(super) fn find_owner(part: &[DVec3], targets: &[Target], hint: &mut usize, squared: f64) -> Option<u32> {
    if targets.get(*hint).is_some_and(|target| target.covers(part, squared)) {
        return Some(*hint as u32);
    }
    let (low, high) = part.iter().fold((part[0], part[0]), |(low, high), &p| (low.min(p), high.max(p)));
    let owner = targets.iter().position(|target| !target.is_clear_of(low, high) && target.covers(part, squared))?;
    *hint = owner;
    Some(owner as u32)
}

/// Whether any target lies within the root of `squared`; `hint` is one that is likely to.
pub(super) fn is_near_any(p: DVec3, targets: &[Target], hint: usize, squared: f64) -> bool {
    targets.get(hint).is_some_and(|target| target.is_near(p, squared))
        || targets.iter().any(|target| !target.is_out(p, squared) && target.is_near(p, squared))
}

/// The target nearest to `p`, and its squared distance; `hint` is one that is likely to be near.
pub(super) fn nearest(p: DVec3, targets: &[Target], hint: usize) -> (u32, f64) {
    let hint = if hint < targets.len() { hint } else { 0 };
    let mut best = (hint as u32, targets.get(hint).map_or(f64::INFINITY, |target| target.distance_squared(p)));
    for (at, target) in targets.iter().enumerate() {
        if at == hint || target.is_off(p, best.1) || target.is_out(p, best.1) {
            continue;
        }
        let squared = target.distance_squared(p);
        if squared < best.1 {
            best = (at as u32, squared);
        }
    }
    best
}
