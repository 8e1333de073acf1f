//! Points that are where planes and lines meet, kept as quotients of integers, and exact decisions about them.
//!
//! # Algorithm
//! Corners are integers of [`BITS`] bits. A plane through three of them has a normal of `2 BITS + 1` bits; the point
//! where a line through two corners passes it, four numbers of at most `4 BITS + 2`; the point where three planes meet,
//! of `7 BITS + 5`. So every determinant has a width that is known beforehand (M. Attene. Indirect predicates for
//! geometric constructions. CAD 126, 2020, has the idea to keep points as they were made). A float next to each point,
//! with a bound on its error, decides nearly all signs; the others are computed in integers.
//!
//! Points are one when their coordinates are equal: found by the residues of the quotients modulo a prime, which do not
//! depend on how a quotient is written, and then compared exactly.

use std::cmp::Ordering;

use glam::{DVec2, DVec3};
use rustc_hash::FxHashMap;

use super::wide::{Wide, inverse, times};
use crate::mesh::predicate::{Drop, Sign};

/// Bits of a corner's coordinate with its sign.
pub(super) const BITS: u32 = 30;

/// How far the float of a point may lie off it, along each axis: `2^BITS` times four units in the last place.
const BLUR: f64 = 1.0 / (1 << 21) as f64;

/// A corner on the grid.
pub(super) type Corner = [i64; 3];

/// No vertex: the point is where faces meet.
pub(super) const NONE: u32 = u32::MAX;

/// A point: the quotients of `x` over `d`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Point {
    x: [Wide<4>; 3],
    /// Above 0.
    d: Wide<4>,
    /// The point rounded, in units of the grid.
    pub(super) at: DVec3,
    /// The vertex of the mesh that it is.
    pub(super) vertex: u32,
}

impl Point {
    pub(super) fn corner(corner: Corner, vertex: u32) -> Self {
        let at = DVec3::from_array(corner.map(|x| x as f64));
        Self { x: corner.map(|x| Wide::new(i128::from(x))), d: Wide::new(1), at, vertex }
    }

    fn quotient(x: [Wide<4>; 3], d: Wide<4>) -> Self {
        let (x, d) = if d.sign() < 0 { (x.map(|v| -v), -d) } else { (x, d) };
        let below = d.to_f64();
        Self { x, d, at: DVec3::from_array(x.map(|v| v.to_f64() / below)), vertex: NONE }
    }

    /// Where the line through corners on different sides of a plane passes it.
    pub(super) fn on_line(p: Corner, q: Corner, plane: &Plane) -> Self {
        let (above, below) = (plane.height(p), plane.height(q));
        let x = std::array::from_fn(|k| Wide::new(above * i128::from(q[k]) - below * i128::from(p[k])));
        Self::quotient(x, Wide::new(above - below))
    }

    /// Where three planes meet; they must do so in one point.
    pub(super) fn of_planes(planes: [&Plane; 3]) -> Self {
        let [a, b, c] = planes;
        let crosses = [cross(b.normal, c.normal), cross(c.normal, a.normal), cross(a.normal, b.normal)];
        let product = |u: i128, v: i128| Wide::<4>::product(&Wide::<2>::new(u), &Wide::<2>::new(v));
        let sum = |term: &dyn Fn(usize) -> Wide<4>| term(0) + term(1) + term(2);
        let x = std::array::from_fn(|k| sum(&|i| product(planes[i].offset, crosses[i][k])));
        Self::quotient(x, sum(&|k| product(i128::from(a.normal[k]), crosses[0][k])))
    }

    /// The order by x, then y, then z.
    pub(super) fn compare(&self, other: &Self) -> Ordering {
        let along = |k| self.compare_along(other, k);
        along(0).then_with(|| along(1)).then_with(|| along(2))
    }

    fn compare_along(&self, other: &Self, k: usize) -> Ordering {
        let apart = self.at[k] - other.at[k];
        if apart.abs() > 2.0 * BLUR {
            return apart.total_cmp(&0.0);
        }
        let difference = Wide::<7>::product(&self.x[k], &other.d) - Wide::product(&other.x[k], &self.d);
        difference.sign().cmp(&0)
    }

    fn residues(&self) -> [u64; 3] {
        let below = if self.vertex == NONE { inverse(self.d.residue()) } else { 1 };
        self.x.map(|v| times(v.residue(), below))
    }
}

fn cross(a: [i64; 3], b: [i64; 3]) -> [i128; 3] {
    let product = |i: usize, j: usize| i128::from(a[i]) * i128::from(b[j]);
    [product(1, 2) - product(2, 1), product(2, 0) - product(0, 2), product(0, 1) - product(1, 0)]
}

/// A plane through corners.
#[derive(Clone, Copy, Debug)]
pub(super) struct Plane {
    normal: [i64; 3],
    /// The product of normal and any of its points.
    offset: i128,
    rounded: DVec3,
    through: DVec3,
}

impl Plane {
    fn new(normal: [i64; 3], through: Corner) -> Self {
        let offset = (0..3).map(|k| i128::from(normal[k]) * i128::from(through[k])).sum();
        let [rounded, through] = [normal, through].map(|v| DVec3::from_array(v.map(|x| x as f64)));
        Self { normal, offset, rounded, through }
    }

    /// The plane of a triangle; `None` when its corners lie on a line.
    pub(super) fn of([a, b, c]: [Corner; 3]) -> Option<Self> {
        let [u, v] = [b, c].map(|p| [p[0] - a[0], p[1] - a[1], p[2] - a[2]]);
        let normal = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
        (normal != [0; 3]).then(|| Self::new(normal, a))
    }

    /// The plane through a line along the axis that is dropped.
    pub(super) fn along(drop: Drop, a: Corner, b: Corner) -> Self {
        let [x, y, z] = [b[0] - a[0], b[1] - a[1], b[2] - a[2]];
        let normal = match drop {
            Drop::X => [0, z, -y],
            Drop::Y => [-z, 0, x],
            Drop::Z => [y, -x, 0],
        };
        Self::new(normal, a)
    }

    /// The coordinate to drop so that its triangles keep most area, and their orientation then.
    pub(super) fn projection(&self) -> (Drop, Sign) {
        let size = self.normal.map(i64::abs);
        let (drop, k) = if size[0] >= size[1] && size[0] >= size[2] {
            (Drop::X, 0)
        } else if size[1] >= size[2] {
            (Drop::Y, 1)
        } else {
            (Drop::Z, 2)
        };
        (drop, self.normal[k].signum() as Sign)
    }

    fn height(&self, p: Corner) -> i128 {
        (0..3).map(|k| i128::from(self.normal[k]) * i128::from(p[k])).sum::<i128>() - self.offset
    }

    /// On which side a corner lies.
    pub(super) fn side_of_corner(&self, p: Corner) -> Sign {
        self.height(p).signum() as Sign
    }

    /// On which side a point lies.
    pub(super) fn side(&self, p: &Point) -> Sign {
        let height = self.rounded.dot(p.at - self.through);
        if height.abs() > 4.0 * BLUR * self.rounded.abs().element_sum() {
            return if height > 0.0 { 1 } else { -1 };
        }
        let term = |k: usize| Wide::<5>::product(&Wide::<2>::new(i128::from(self.normal[k])), &p.x[k]);
        let offset = Wide::<5>::product(&Wide::<2>::new(self.offset), &p.d);
        (term(0) + term(1) + term(2) - offset).sign()
    }

    /// Whether the normals of two equal planes point the same way.
    pub(super) fn agrees_with(&self, other: &Self) -> bool {
        self.dot(other) > 0
    }

    fn dot(&self, other: &Self) -> i128 {
        (0..3).map(|k| i128::from(self.normal[k]) * i128::from(other.normal[k])).sum()
    }

    /// For planes through one line: whether turning by less than half a circle about the line, seen against its
    /// direction of ascending coordinates, takes one normal to the other; 0 where they are parallel.
    pub(super) fn turn(&self, other: &Self) -> Sign {
        let axis = cross(self.normal, other.normal);
        axis.into_iter().find(|&x| x != 0).unwrap_or(0).signum() as Sign
    }
}

/// On which side of the line of `a b` another line through `p q` passes: the sign of the volume of the four.
pub(super) fn volume([p, q, a, b]: [Corner; 4]) -> Sign {
    let [u, v, w] = [q, a, b].map(|c| [c[0] - p[0], c[1] - p[1], c[2] - p[2]]);
    let minor = cross(u, v);
    (0..3).map(|k| minor[k] * i128::from(w[k])).sum::<i128>().signum() as Sign
}

/// A point seen along an axis.
#[derive(Clone, Copy, Debug)]
pub(super) struct Flat {
    u: Wide<4>,
    v: Wide<4>,
    d: Wide<4>,
    /// The point rounded.
    pub(super) at: DVec2,
}

impl Flat {
    pub(super) fn new(point: &Point, drop: Drop) -> Self {
        let (u, v) = match drop {
            Drop::X => (1, 2),
            Drop::Y => (2, 0),
            Drop::Z => (0, 1),
        };
        Self { u: point.x[u], v: point.x[v], d: point.d, at: drop.apply(point.at) }
    }

    /// A point in the plane alone.
    pub(super) fn of_integers(u: i64, v: i64) -> Self {
        let [wide_u, wide_v] = [u, v].map(|x| Wide::new(i128::from(x)));
        Self { u: wide_u, v: wide_v, d: Wide::new(1), at: DVec2::new(u as f64, v as f64) }
    }

    /// The order by the first, then the second coordinate.
    pub(super) fn compare(&self, other: &Self) -> Ordering {
        let order = |a: (&Wide<4>, f64), b: (&Wide<4>, f64)| {
            if (a.1 - b.1).abs() > 2.0 * BLUR {
                return a.1.total_cmp(&b.1);
            }
            (Wide::<7>::product(a.0, &other.d) - Wide::product(b.0, &self.d)).sign().cmp(&0)
        };
        order((&self.u, self.at.x), (&other.u, other.at.x))
            .then_with(|| order((&self.v, self.at.y), (&other.v, other.at.y)))
    }
}

/// 1 when `a b c` turn counter-clockwise, −1 when clockwise, 0 when they lie on a line.
pub(super) fn orient(a: &Flat, b: &Flat, c: &Flat) -> Sign {
    let (p, q) = (b.at - a.at, c.at - a.at);
    let (left, right) = (p.x * q.y, p.y * q.x);
    let sum = p.x.abs() + p.y.abs() + q.x.abs() + q.y.abs();
    let noise = 4.0 * BLUR * (sum + BLUR) + 1e-14 * (left.abs() + right.abs());
    let area = left - right;
    if area.abs() > noise {
        return if area > 0.0 { 1 } else { -1 };
    }
    let minor =
        |a: &Wide<4>, b: &Wide<4>, c: &Wide<4>, d: &Wide<4>| Wide::<7>::product(a, b) - Wide::<7>::product(c, d);
    let term = |of: &Wide<4>, by: Wide<7>| Wide::<10>::product(of, &by);
    let first = term(&a.u, minor(&b.v, &c.d, &c.v, &b.d));
    let second = term(&a.v, minor(&b.u, &c.d, &c.u, &b.d));
    let third = term(&a.d, minor(&b.u, &c.v, &c.u, &b.v));
    (first - second + third).sign()
}

/// All points, no two at one place.
#[derive(Debug, Default)]
pub(super) struct Points {
    all: Vec<Point>,
    /// Points by residues; asked, never iterated.
    by_residues: FxHashMap<[u64; 3], u32>,
}

/// A point with what it is found by, so that this can be computed apart.
#[derive(Clone, Copy, Debug)]
pub(super) struct Found {
    point: Point,
    key: [u64; 3],
}

impl From<Point> for Found {
    fn from(point: Point) -> Self {
        Self { point, key: point.residues() }
    }
}

impl Points {
    /// The number of the point at this place, new or not.
    pub(super) fn number(&mut self, found: Found) -> u32 {
        let Found { point, mut key } = found;
        loop {
            match self.by_residues.get(&key) {
                None => {
                    let number = self.all.len() as u32;
                    self.by_residues.insert(key, number);
                    self.all.push(point);
                    return number;
                }
                Some(&number) if self[number].compare(&point).is_eq() => return number,
                // Other quotients with these residues.
                Some(_) => key[0] = key[0].wrapping_add(1),
            }
        }
    }

    pub(super) fn len(&self) -> usize {
        self.all.len()
    }
}

impl std::ops::Index<u32> for Points {
    type Output = Point;
    fn index(&self, number: u32) -> &Point {
        &self.all[number as usize]
    }
}
