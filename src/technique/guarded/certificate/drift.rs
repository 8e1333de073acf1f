//! How far an edit takes the surface from where it was, without a look at the reference.
//!
//! Old and new faces are seen from one side, along their common normal. Where both lie as one sheet over the same
//! polygon, every point of a new face has an old one straight below or above it, and the gap between the two is linear
//! between the corners of the overlay: the inner vertices of either and the crossings of their inner edges. So the
//! largest gap there, plus what the old faces below may be off the reference, bounds what a new face is off. Bounds add
//! up edit by edit until one exceeds the tolerance; then the face is held against the reference itself, and starts
//! anew. Only the common edits are seen: a star about one inner vertex, and the flip of an edge. Cost: a few hundred
//! products an edit; allocates nothing once its lists have grown.

use glam::DVec3;

use super::target::Triangle;
use crate::mesh::geometry::area_vector;

/// More faces than this are left to the full test.
const MOST_FACES: usize = 64;

/// A point as it is seen: its place in the plane of sight, and its height.
#[derive(Clone, Copy, Debug, Default)]
struct Seen {
    x: f64,
    y: f64,
    height: f64,
}

impl Seen {
    fn cross(self, other: Self) -> f64 {
        self.x * other.y - self.y * other.x
    }

    /// Whether the way to `other` is a turn to the left, by more than rounding.
    fn is_well_before(self, other: Self) -> bool {
        self.cross(other) > 1e-9 * (self.x.abs() + self.y.abs()) * (other.x.abs() + other.y.abs())
    }

    fn minus(self, other: Self) -> Self {
        Self { x: self.x - other.x, y: self.y - other.y, height: self.height - other.height }
    }
}

/// Where the eye is.
#[derive(Clone, Copy, Debug)]
struct View {
    origin: DVec3,
    right: DVec3,
    up: DVec3,
    normal: DVec3,
}

impl View {
    fn new(origin: DVec3, faces: &[Triangle]) -> Option<Self> {
        let normal = faces.iter().map(|&face| area_vector(face)).sum::<DVec3>().try_normalize()?;
        let (right, up) = normal.any_orthonormal_pair();
        Some(Self { origin, right, up, normal })
    }

    fn see(&self, p: DVec3) -> Seen {
        let d = p - self.origin;
        Seen { x: d.dot(self.right), y: d.dot(self.up), height: d.dot(self.normal) }
    }
}

/// A new face of a star: its second corner, and what lies under it.
#[derive(Clone, Copy, Debug)]
struct Sector {
    point: DVec3,
    spoke: Seen,
    next: usize,
    previous: usize,
    gap: f64,
    /// The largest bound of the old faces under it.
    under: f64,
}

impl Sector {
    fn meet(&mut self, gap: f64, under: f64) {
        self.gap = self.gap.max(gap);
        self.under = self.under.max(under);
    }
}

/// A vertex inside the old faces, and the largest bound of the faces round it.
#[derive(Clone, Copy, Debug)]
struct Inner {
    point: DVec3,
    seen: Seen,
    under: f64,
}

/// The overlay of an edit's old and new faces.
#[derive(Clone, Debug, Default)]
pub(in crate::technique::guarded) struct Drift {
    /// Whether the new faces were seen as one sheet, in which they meet in common corners and edges only.
    pub(super) is_sheet: bool,
    sectors: Vec<Sector>,
    inner: Vec<Inner>,
}

impl Drift {
    /// Bounds of the distance between each new face and the reference, given those of the old ones; infinite where the
    /// edit is not seen as one sheet.
    pub(super) fn bounds(&mut self, old: &[Triangle], strays: &[f64], new: &[Triangle], bounds: &mut Vec<f64>) {
        bounds.clear();
        self.is_sheet = false;
        if strays.iter().all(|stray| stray.is_finite()) {
            if let ([left, right], [first, second]) = (old, new) {
                let gap = flip_gap([*left, *right], [*first, *second]);
                let under = strays.iter().copied().fold(0.0, f64::max);
                bounds.extend(gap.map_or([f64::INFINITY; 2], |gap| [gap + under; 2]));
                return;
            }
            self.is_sheet = self.overlay(old, strays, new).is_some();
            if self.is_sheet {
                bounds.extend(self.sectors.iter().map(|sector| sector.gap + sector.under));
                return;
            }
        }
        bounds.resize(new.len(), f64::INFINITY);
    }

    /// Lays the old faces under the star.
    fn overlay(&mut self, old: &[Triangle], strays: &[f64], new: &[Triangle]) -> Option<()> {
        let view = self.spread(new)?;
        self.inner.clear();
        let (mut rims, mut tips) = (0, 0);
        for (face, &under) in old.iter().zip(strays) {
            let seen = face.map(|p| view.see(p));
            if !seen[1].minus(seen[0]).is_well_before(seen[2].minus(seen[0])) {
                return None;
            }
            let places = face.map(|p| self.sectors.iter().position(|sector| sector.point == p));
            tips += usize::from(self.find_tip(seen, under));
            for (from, to) in [(0, 1), (1, 2), (2, 0)] {
                match (places[from], places[to]) {
                    (Some(at), Some(end)) if self.sectors[at].next == end => {
                        self.sectors[at].meet(0.0, under);
                        rims += 1;
                    }
                    (Some(_), Some(_)) => return None,
                    _ => self.cross(seen[from], seen[to], under),
                }
                if places[from].is_none() {
                    self.remember(face[from], seen[from], under);
                }
            }
        }
        (rims == new.len() && tips > 0 && self.place_inner()).then_some(())
    }

    /// Whether the faces are a star that is seen as one sheet: then they meet in common corners and edges only.
    pub(in crate::technique::guarded) fn sees_sheet(&mut self, star: &[Triangle]) -> bool {
        self.spread(star).is_some()
    }

    /// The view in which the faces lie side by side, all round a common corner.
    fn spread(&mut self, star: &[Triangle]) -> Option<View> {
        if !(3..=MOST_FACES).contains(&star.len()) {
            return None;
        }
        let tip = star[0].into_iter().find(|p| star.iter().all(|face| face.contains(p)))?;
        let view = View::new(tip, star)?;
        self.close(&view, star)?;
        Some(view)
    }

    /// The sectors of a star that surrounds its tip once.
    fn close(&mut self, view: &View, new: &[Triangle]) -> Option<()> {
        self.sectors.clear();
        let after_tip = |face: &Triangle| face.iter().position(|&p| p == view.origin).map_or(1, |at| at + 1);
        self.sectors.extend(new.iter().map(|face| {
            let point = face[after_tip(face) % 3];
            Sector { point, spoke: view.see(point), next: 0, previous: usize::MAX, gap: 0.0, under: 0.0 }
        }));
        let mut turns = 0;
        for (at, face) in new.iter().enumerate() {
            let last = face[(after_tip(face) + 1) % 3];
            let next = self.sectors.iter().position(|sector| sector.point == last)?;
            let (spoke, other) = (self.sectors[at].spoke, self.sectors[next].spoke);
            if self.sectors[next].previous != usize::MAX || !spoke.is_well_before(other) {
                return None;
            }
            self.sectors[at].next = next;
            self.sectors[next].previous = at;
            turns += usize::from(spoke.y < 0.0 && other.y >= 0.0);
        }
        (turns == 1).then_some(())
    }

    /// Whether an old face lies under the tip; then it lies under all sectors.
    fn find_tip(&mut self, [a, b, c]: [Seen; 3], under: f64) -> bool {
        let (u, v, w) = (b.cross(c), c.cross(a), a.cross(b));
        let is_under = u >= 0.0 && v >= 0.0 && w >= 0.0;
        if is_under {
            let gap = ((u * a.height + v * b.height + w * c.height) / (u + v + w)).abs();
            for sector in &mut self.sectors {
                sector.meet(gap, under);
            }
        }
        is_under
    }

    /// Crosses an inner edge of the old faces with all spokes.
    fn cross(&mut self, from: Seen, to: Seen, under: f64) {
        let along = to.minus(from);
        let of_tip = from.cross(to);
        for at in 0..self.sectors.len() {
            let Sector { spoke, previous, .. } = self.sectors[at];
            let (before, after) = (spoke.cross(from), spoke.cross(to));
            let of_end = along.cross(spoke.minus(from));
            if before * after >= 0.0 || of_tip * of_end >= 0.0 {
                continue;
            }
            let old = from.height + along.height * (before / (before - after));
            let gap = (spoke.height * (of_tip / (of_tip - of_end)) - old).abs();
            self.sectors[at].meet(gap, under);
            self.sectors[previous].meet(gap, under);
        }
    }

    fn remember(&mut self, point: DVec3, seen: Seen, under: f64) {
        match self.inner.iter_mut().find(|inner| inner.point == point) {
            Some(inner) => inner.under = inner.under.max(under),
            None => self.inner.push(Inner { point, seen, under }),
        }
    }

    /// Finds the sectors over the inner vertices of the old faces.
    fn place_inner(&mut self) -> bool {
        let sectors = &mut self.sectors;
        self.inner.iter().all(|inner| {
            let mut is_found = false;
            for at in 0..sectors.len() {
                let (spoke, other) = (sectors[at].spoke, sectors[sectors[at].next].spoke);
                let (u, v) = (inner.seen.cross(other), spoke.cross(inner.seen));
                if u >= 0.0 && v >= 0.0 {
                    let height = (u * spoke.height + v * other.height) / spoke.cross(other);
                    sectors[at].meet((height - inner.seen.height).abs(), inner.under);
                    is_found = true;
                }
            }
            is_found
        })
    }
}

/// The gap between the two diagonals of a quad where they cross: the largest one between its two pairs of triangles.
fn flip_gap(old: [Triangle; 2], new: [Triangle; 2]) -> Option<f64> {
    let apex = |of: Triangle, other: Triangle| {
        let mut rest = of.into_iter().filter(|p| !other.contains(p));
        rest.next().filter(|_| rest.next().is_none())
    };
    let [a, b] = [apex(new[0], new[1])?, apex(new[1], new[0])?];
    let [c, d] = [apex(old[0], old[1])?, apex(old[1], old[0])?];
    if !new.iter().all(|face| face.contains(&c) && face.contains(&d)) {
        return None;
    }
    let view = View::new(a, &old)?;
    let [b, c, d] = [b, c, d].map(|p| view.see(p));
    let (before, after) = (b.cross(c), b.cross(d));
    let along = d.minus(c);
    let (of_start, of_end) = (c.cross(d), along.cross(b.minus(c)));
    if before * after >= 0.0 || of_start * of_end >= 0.0 {
        return None;
    }
    let other = c.height + along.height * (before / (before - after));
    Some((b.height * (of_start / (of_start - of_end)) - other).abs())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::geometry::closest_on_triangle;
    use proptest::prelude::*;

    /// A wavy surface.
    fn lift(x: f64, y: f64) -> DVec3 {
        DVec3::new(x, y, 0.3 * libm::sin(2.0 * x) * libm::cos(1.7 * y) + 0.1 * x)
    }

    /// The corners of a rim round the origin.
    fn rim(radii: &[f64]) -> Vec<DVec3> {
        let step = std::f64::consts::TAU / radii.len() as f64;
        radii
            .iter()
            .enumerate()
            .map(|(at, r)| lift(r * libm::cos(at as f64 * step), r * libm::sin(at as f64 * step)))
            .collect()
    }

    fn fan(tip: DVec3, rim: &[DVec3]) -> Vec<Triangle> {
        (0..rim.len()).map(|at| [tip, rim[at], rim[(at + 1) % rim.len()]]).collect()
    }

    /// A rim filled by the stars of `a` and `b`, which share an edge.
    fn pair(a: DVec3, b: DVec3, rim: &[DVec3]) -> Vec<Triangle> {
        let (half, count) = (rim.len() / 2, rim.len());
        let side = |tip: DVec3, from: usize, to: usize| (from..to).map(move |at| [tip, rim[at], rim[(at + 1) % count]]);
        side(a, 0, half).chain(side(b, half, count)).chain([[b, a, rim[half]], [a, b, rim[0]]]).collect()
    }

    fn far_from(p: DVec3, faces: &[Triangle]) -> f64 {
        faces.iter().map(|&face| closest_on_triangle(p, face).distance_squared.sqrt()).fold(f64::INFINITY, f64::min)
    }

    fn holds(old: &[Triangle], strays: &[f64], new: &[Triangle]) -> Result<bool, TestCaseError> {
        let (mut drift, mut bounds) = (Drift::default(), Vec::new());
        drift.bounds(old, strays, new, &mut bounds);
        prop_assert_eq!(bounds.len(), new.len());
        for (&[a, b, c], &bound) in new.iter().zip(&bounds) {
            for (i, j) in (0..=12).flat_map(|i| (0..=12 - i).map(move |j| (i, j))) {
                let (v, w) = (f64::from(i) / 12.0, f64::from(j) / 12.0);
                let p = a + v * (b - a) + w * (c - a);
                let far = old.iter().zip(strays).map(|(&face, stray)| far_from(p, &[face]) + stray);
                prop_assert!(far.fold(f64::INFINITY, f64::min) <= bound + 1e-12);
            }
        }
        Ok(bounds.iter().all(|bound| bound.is_finite()))
    }

    proptest! {
        #[test]
        fn no_point_strays_further_than_its_bound(
            radii in prop::collection::vec(0.6..1.0f64, 6..11),
            ends in prop::array::uniform4(-0.3..0.3f64),
            tip in prop::array::uniform3(-0.2..0.2f64),
            strays in prop::collection::vec(0.0..0.1f64, 16),
        ) {
            let rim = rim(&radii);
            let [a, b] = [lift(ends[0], 0.1 + ends[1].abs()), lift(ends[2], -0.1 - ends[3].abs())];
            let old = pair(a, b, &rim);
            let tip = lift(tip[0], tip[1]) + 0.2 * tip[2] * DVec3::Z;
            holds(&old, &strays[..old.len()], &fan(tip, &rim))?;
            // A move of the only inner vertex, with corners in any order, and back.
            let moved: Vec<Triangle> = fan(tip, &rim).into_iter().map(|[a, b, c]| [b, c, a]).collect();
            holds(&fan(a, &rim), &strays[..rim.len()], &moved)?;
        }

        #[test]
        fn no_flip_strays_further_than_its_bound(heights in prop::array::uniform4(-0.3..0.3f64), stray in 0.0..0.1f64) {
            let at = |x: f64, y: f64, z: f64| DVec3::new(x, y, z);
            let [a, b] = [at(-1.0, 0.1, heights[0]), at(1.0, 0.0, heights[1])];
            let [c, d] = [at(0.1, -1.0, heights[2]), at(0.0, 1.0, heights[3])];
            prop_assert!(holds(&[[a, c, d], [c, b, d]], &[stray; 2], &[[a, c, b], [a, b, d]])?);
        }
    }

    #[test]
    fn a_plane_does_not_stray() {
        let flat = |radii: &[f64]| rim(radii).into_iter().map(|p| DVec3::new(p.x, p.y, 0.0)).collect::<Vec<_>>();
        let rim = flat(&[1.0; 8]);
        let old = pair(DVec3::new(0.1, 0.3, 0.0), DVec3::new(-0.1, -0.3, 0.0), &rim);
        let (mut drift, mut bounds) = (Drift::default(), Vec::new());
        drift.bounds(&old, &[0.25; 10], &fan(DVec3::new(0.2, 0.1, 0.0), &rim), &mut bounds);
        assert!(drift.is_sheet && bounds.iter().all(|bound| (bound - 0.25).abs() < 1e-15), "{bounds:?}");
    }

    #[test]
    fn what_is_no_sheet_has_no_bound() {
        let rim = rim(&[1.0; 8]);
        let old = pair(lift(0.0, 0.3), lift(0.0, -0.3), &rim);
        let (mut drift, mut bounds) = (Drift::default(), Vec::new());
        let mut bounds_of = |old: &[Triangle], stray: f64, new: &[Triangle]| {
            drift.bounds(old, &vec![stray; old.len()], new, &mut bounds);
            bounds.iter().all(|bound| bound.is_finite())
        };
        let tip = lift(0.1, 0.1);
        assert!(bounds_of(&old, 0.0, &fan(tip, &rim)));
        // Unknown before, unknown after.
        assert!(!bounds_of(&old, f64::INFINITY, &fan(tip, &rim)));
        // Beyond the rim, an open star, and a rim that is another one.
        assert!(!bounds_of(&old, 0.0, &fan(lift(1.5, 0.0), &rim)));
        assert!(!bounds_of(&old, 0.0, &fan(tip, &rim)[..7]));
        assert!(!bounds_of(&old[1..], 0.0, &fan(tip, &rim)));
    }
}
