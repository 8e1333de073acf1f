//! Rays against triangles.

use glam::DVec3;

use super::{Aabb, Node, Stack, Triangle, TriangleBvh};

/// A half line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Where it starts.
    pub origin: DVec3,
    /// Where it goes; need not be a unit vector, must not be zero.
    pub direction: DVec3,
}

/// A triangle that a ray meets.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RayHit {
    /// The triangle's index.
    pub index: u32,
    /// The hit is at `origin + t * direction`.
    pub t: f64,
    /// Barycentric coordinates of the hit. A zero says that the ray runs through an edge or a corner, and that the
    /// neighbours are hit as well: count such hits with care.
    pub weights: [f64; 3],
    /// Whether the ray comes from the side to which the normal points.
    pub front: bool,
}

/// The constants of one ray: the axis it follows most becomes z, and a shear makes it run along z.
struct Upright {
    origin: DVec3,
    axes: [usize; 3],
    shear: DVec3,
    inverse: DVec3,
}

impl Upright {
    fn new(ray: &Ray) -> Self {
        let d = ray.direction;
        let z = d.abs().max_position();
        let (mut x, mut y) = ((z + 1) % 3, (z + 2) % 3);
        if d[z] < 0.0 {
            (x, y) = (y, x);
        }
        Self {
            origin: ray.origin,
            axes: [x, y, z],
            shear: DVec3::new(d[x] / d[z], d[y] / d[z], 1.0 / d[z]),
            inverse: d.recip(),
        }
    }

    /// Whether the ray meets the box at a parameter of at most `limit`. Errs on the side of yes.
    fn meets(&self, bounds: &Aabb, limit: f64) -> bool {
        let (low, high) = (bounds.min - self.origin, bounds.max - self.origin);
        let (t0, t1) = (low * self.inverse, high * self.inverse);
        let (mut near, mut far) = (0.0_f64, limit);
        for axis in 0..3 {
            // Along an axis that the ray does not follow it stays inside or outside.
            if self.inverse[axis].is_infinite() {
                if low[axis] > 0.0 || high[axis] < 0.0 {
                    return false;
                }
                continue;
            }
            near = near.max(t0[axis].min(t1[axis]));
            far = far.min(t0[axis].max(t1[axis]));
        }
        // Three roundings on either side: widen by four units of the last place.
        near <= far * (1.0 + 8.0 * f64::EPSILON)
    }

    fn hit(&self, triangle: &Triangle, index: u32) -> Option<RayHit> {
        let [kx, ky, kz] = self.axes;
        let [a, b, c] = triangle.map(|p| {
            let p = p - self.origin;
            DVec3::new(p[kx] - self.shear.x * p[kz], p[ky] - self.shear.y * p[kz], self.shear.z * p[kz])
        });
        let u = c.x * b.y - c.y * b.x;
        let v = a.x * c.y - a.y * c.x;
        let w = b.x * a.y - b.y * a.x;
        let negative = u < 0.0 || v < 0.0 || w < 0.0;
        let positive = u > 0.0 || v > 0.0 || w > 0.0;
        let sum = u + v + w;
        if (negative && positive) || sum == 0.0 {
            return None;
        }
        let weights = [u / sum, v / sum, w / sum];
        // Adding a zero makes -0 a 0: hits at one place are equal whatever the sign of the weights.
        let t = weights[0] * a.z + weights[1] * b.z + weights[2] * c.z + 0.0;
        (t >= 0.0 && t.is_finite()).then_some(RayHit { index, t, weights, front: sum > 0.0 })
    }
}

impl TriangleBvh {
    fn walk(&self, ray: &Ray, mut limit: impl FnMut(Option<RayHit>) -> f64) {
        let upright = Upright::new(ray);
        let mut stack: Stack<u32> = Stack::new();
        if !self.nodes.is_empty() && ray.direction != DVec3::ZERO {
            stack.push(0);
        }
        while let Some(node) = stack.pop() {
            let Node { bounds, first, count } = self.nodes[node as usize];
            if !upright.meets(&bounds, limit(None)) {
                continue;
            }
            if count == 0 {
                let along = |n: u32| self.nodes[n as usize].bounds.centre().dot(ray.direction);
                let left_first = along(first) <= along(first + 1);
                let (near, far) = if left_first { (first, first + 1) } else { (first + 1, first) };
                stack.extend([far, near]);
                continue;
            }
            for i in first as usize..(first + count) as usize {
                if let Some(hit) = upright.hit(&self.primitives[i], self.indices[i]) {
                    limit(Some(hit));
                }
            }
        }
    }

    /// The first triangle that the ray meets; of several at one place the one with the lowest index.
    pub fn first_hit(&self, ray: &Ray) -> Option<RayHit> {
        let mut best: Option<RayHit> = None;
        self.walk(ray, |hit| {
            if let Some(hit) = hit
                && best.is_none_or(|b| (hit.t, hit.index) < (b.t, b.index))
            {
                best = Some(hit);
            }
            best.map_or(f64::INFINITY, |b| b.t)
        });
        best
    }

    /// All triangles that the ray meets, by distance, then by index.
    pub fn all_hits(&self, ray: &Ray) -> Vec<RayHit> {
        let mut hits = Vec::new();
        self.walk(ray, |hit| {
            hits.extend(hit);
            f64::INFINITY
        });
        hits.sort_by(|a, b| a.t.total_cmp(&b.t).then(a.index.cmp(&b.index)));
        hits
    }
}
