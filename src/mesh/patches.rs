//! Bicubic B-spline surfaces, one over each element of a coarse quad mesh.

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::soup::Soup;

/// A clamped, uniform, bicubic B-spline surface over the unit square; of one span a direction it is a Bézier patch.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Patch {
    /// Spans along u and v; the knots are 0, 1/n, 2/n … 1, the ends four times each.
    pub spans: [usize; 2],
    /// Control points, u running fastest: `spans[0] + 3` in each of `spans[1] + 3` rows.
    pub controls: Vec<DVec3>,
    /// Whether its side v = 1 is a single point: a patch over a triangle.
    pub is_triangle: bool,
    /// Largest distance between it and the surface, both ways.
    pub max_error: f64,
    /// Root of the mean square of these distances.
    pub rms_error: f64,
}

/// Where two patches meet.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Seam {
    /// The patches.
    pub patches: [u32; 2],
    /// Largest angle between their tangent planes along the seam; degrees.
    pub angle: f64,
    /// Whether the mesh is smooth there: no marked edge and no border of a region.
    pub is_smooth: bool,
}

/// Surfaces with a common boundary curve wherever their elements have a common edge.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Patches {
    /// One for each element, in their order.
    pub patches: Vec<Patch>,
    /// Inner edges.
    pub seams: Vec<Seam>,
    /// A conforming mesh sampled from the patches; its face groups are not kept, its field `patch` names the patch.
    pub tessellation: Soup,
}

/// The four cubic basis functions that are not zero at `t`, of `spans` uniform spans: the first one's number, values,
/// first derivatives.
pub fn basis(spans: usize, t: f64) -> (usize, [f64; 4], [f64; 4]) {
    if spans == 1 {
        let (s, n) = (1.0 - t, 3.0);
        let value = [s * s * s, n * s * s * t, n * s * t * t, t * t * t];
        return (0, value, [-n * s * s, n * s * (s - 2.0 * t), n * t * (2.0 * s - t), n * t * t]);
    }
    let n = spans as f64;
    let span = ((t * n) as usize).min(spans - 1);
    let knot = |i: usize| ((i as f64 - 3.0) / n).clamp(0.0, 1.0);
    let at = span + 3;
    let (mut value, mut slope) = ([1.0, 0.0, 0.0, 0.0], [0.0; 4]);
    for degree in 1..=3 {
        let lower = value;
        value = [0.0; 4];
        for r in 0..degree {
            let (left, right) = (knot(at + r + 1 - degree), knot(at + r + 1));
            let part = lower[r] / (right - left);
            value[r] += (right - t) * part;
            value[r + 1] += (t - left) * part;
            if degree == 3 {
                slope[r] -= 3.0 * part;
                slope[r + 1] += 3.0 * part;
            }
        }
    }
    (span, value, slope)
}

impl Patch {
    /// Control points a row.
    pub fn width(&self) -> usize {
        self.spans[0] + 3
    }

    /// The point at `u, v` and the derivatives along both.
    pub fn eval(&self, u: f64, v: f64) -> [DVec3; 3] {
        let ((i, a, da), (j, b, db)) = (basis(self.spans[0], u), basis(self.spans[1], v));
        let mut sums = [DVec3::ZERO; 3];
        for (l, row) in (j..j + 4).enumerate() {
            for (k, column) in (i..i + 4).enumerate() {
                let c = self.controls[row * self.width() + column];
                sums[0] += c * (a[k] * b[l]);
                sums[1] += c * (da[k] * b[l]);
                sums[2] += c * (a[k] * db[l]);
            }
        }
        sums
    }

    /// The point at `u, v`.
    pub fn point(&self, u: f64, v: f64) -> DVec3 {
        self.eval(u, v)[0]
    }

    /// Parameters of the point of the patch nearest to `p`, searched from `u, v`.
    pub fn foot(&self, p: DVec3, mut uv: [f64; 2]) -> [f64; 2] {
        /// Newton's steps; the last ones change nothing visible.
        const STEPS: usize = 6;
        for _ in 0..STEPS {
            let [s, su, sv] = self.eval(uv[0], uv[1]);
            let r = p - s;
            let (a, b, c) = (su.dot(su), su.dot(sv), sv.dot(sv));
            let det = a * c - b * b;
            if det <= 1e-14 * (a * c).max(f64::MIN_POSITIVE) {
                break;
            }
            let (f, g) = (su.dot(r), sv.dot(r));
            let next = [uv[0] + (c * f - b * g) / det, uv[1] + (a * g - b * f) / det].map(|x| x.clamp(0.0, 1.0));
            if self.point(next[0], next[1]).distance_squared(p) >= r.length_squared() {
                break;
            }
            uv = next;
        }
        uv
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn basis_functions_sum_to_one_and_interpolate_the_ends() {
        for spans in [1, 2, 5] {
            for k in 0..=20 {
                let (_, value, slope) = basis(spans, f64::from(k) / 20.0);
                assert!((value.iter().sum::<f64>() - 1.0).abs() < 1e-14, "{spans} {k}");
                assert!(slope.iter().sum::<f64>().abs() < 1e-12);
            }
            assert_eq!(basis(spans, 0.0).1[0], 1.0);
            let (first, value, _) = basis(spans, 1.0);
            assert_eq!((first + 3, value[3]), (spans + 2, 1.0));
        }
    }
}
