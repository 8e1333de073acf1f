//! Least squares for control points: curves with fixed ends, surfaces with fixed borders.

use glam::DVec3;
use nalgebra::{DMatrix, DVector};

use crate::mesh::patches::{Patch, basis};

/// A place on a side where the derivative across it shall lie in a plane.
#[derive(Clone, Copy, Debug)]
pub struct Tangency {
    /// Where on the patch.
    pub place: [f64; 2],
    /// Whether the derivative along u is meant; else along v.
    pub is_along_u: bool,
    /// The normal of the plane, divided by the length of the derivative as it is.
    pub normal: DVec3,
}

/// A cubic B-spline curve.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Curve {
    /// Spans, all of one length.
    pub spans: usize,
    /// `spans + 3` points.
    pub controls: Vec<DVec3>,
}

impl Curve {
    /// The point at `t`.
    pub fn point(&self, t: f64) -> DVec3 {
        let (first, value, _) = basis(self.spans, t);
        (0..4).map(|k| self.controls[first + k] * value[k]).sum()
    }

    /// The same curve of more spans, a multiple of those it has; exact, for its knots are among the new ones.
    #[must_use]
    pub fn refined(&self, spans: usize) -> Self {
        if spans == self.spans {
            return self.clone();
        }
        // As many conditions as control points; the Greville abscissae make the system regular.
        let n = spans + 3;
        let knot = |i: usize| ((i as f64 - 3.0) / spans as f64).clamp(0.0, 1.0);
        let places: Vec<f64> = (0..n).map(|i| (knot(i + 1) + knot(i + 2) + knot(i + 3)) / 3.0).collect();
        let mut matrix = DMatrix::zeros(n, n);
        let mut right = DMatrix::zeros(n, 3);
        for (row, &t) in places.iter().enumerate() {
            let (first, value, _) = basis(spans, t);
            (0..4).for_each(|k| matrix[(row, first + k)] += value[k]);
            self.point(t).to_array().iter().enumerate().for_each(|(c, &x)| right[(row, c)] = x);
        }
        let Some(solution) = matrix.lu().solve(&right) else { return self.clone() };
        let mut controls: Vec<DVec3> =
            (0..n).map(|i| DVec3::from_array(std::array::from_fn(|c| solution[(i, c)]))).collect();
        controls[0] = self.controls[0];
        controls[n - 1] = self.controls[self.controls.len() - 1];
        Self { spans, controls }
    }
}

/// How strongly curvature of what no sample fixes is avoided, relative to the samples.
const FAIR_CURVE: f64 = 1e-6;

/// The curve of `spans` that fits points best at their share of the length; its ends are the first and last point.
pub fn fit_curve(points: &[DVec3], spans: usize) -> Curve {
    fit_curve_with(points, spans, [None; 2])
}

/// As [`fit_curve`], where the control points next to the ends may be given.
pub fn fit_curve_with(points: &[DVec3], spans: usize, next: [Option<DVec3>; 2]) -> Curve {
    let n = spans + 3;
    let (first, last) = (points[0], points[points.len() - 1]);
    let line = |i: usize| first.lerp(last, i as f64 / (n - 1) as f64);
    let fallback = || Curve { spans, controls: (0..n).map(line).collect() };
    let mut at = vec![0.0];
    for pair in points.windows(2) {
        at.push(at[at.len() - 1] + pair[0].distance(pair[1]));
    }
    let total = at[at.len() - 1];
    if points.len() < 3 || total <= 0.0 {
        return fallback();
    }
    let mut system = System::new(n, FAIR_CURVE);
    for k in 0..n - 2 {
        system.fair(&[(k, 1.0), (k + 1, -2.0), (k + 2, 1.0)]);
    }
    // Along an edge the curve should follow the edge, not its ends alone.
    for (pair, at) in points.windows(2).zip(at.windows(2)) {
        for share in [0.25, 0.75] {
            let (first, value, _) = basis(spans, ((at[0] + (at[1] - at[0]) * share) / total).min(1.0));
            let row: Vec<(usize, f64)> = (0..4).map(|k| (first + k, value[k])).collect();
            system.sample(&row, pair[0].lerp(pair[1], share), 1.0);
        }
    }
    system.fix(0, first);
    system.fix(n - 1, last);
    for (place, given) in [1, n - 2].into_iter().zip(next) {
        if let Some(p) = given {
            system.fix(place, p);
        }
    }
    system.solve().map_or_else(fallback, |controls| Curve { spans, controls })
}

/// Points that a patch shall pass through, with their parameters.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Samples {
    /// The points; mesh units.
    pub points: Vec<DVec3>,
    /// For each the parameters in the unit square.
    pub places: Vec<[f64; 2]>,
    /// How much each counts, such as the area around it: vertices may crowd where nothing is to be seen.
    pub weights: Vec<f64>,
}

/// Normal equations for points, of which some are given.
struct System {
    data: DMatrix<f64>,
    fair: DMatrix<f64>,
    right: DMatrix<f64>,
    fixed: Vec<Option<DVec3>>,
    fairness: f64,
    /// Derivatives as weights of points, with the normals that they shall be at right angles to.
    tangent: Vec<(Vec<(usize, f64)>, DVec3)>,
}

impl System {
    fn new(n: usize, fairness: f64) -> Self {
        Self {
            data: DMatrix::zeros(n, n),
            fair: DMatrix::zeros(n, n),
            right: DMatrix::zeros(n, 3),
            fixed: vec![None; n],
            fairness,
            tangent: Vec::new(),
        }
    }

    fn sample(&mut self, row: &[(usize, f64)], p: DVec3, weight: f64) {
        for &(i, a) in row {
            let a = a * weight;
            for &(j, b) in row {
                self.data[(i, j)] += a * b;
            }
            p.to_array().iter().enumerate().for_each(|(c, &x)| self.right[(i, c)] += a * x);
        }
    }

    fn fair(&mut self, row: &[(usize, f64)]) {
        for &(i, a) in row {
            for &(j, b) in row {
                self.fair[(i, j)] += a * b;
            }
        }
    }

    fn fix(&mut self, i: usize, p: DVec3) {
        self.fixed[i] = Some(p);
    }

    /// The points. Fairness decides only what the samples leave open: its bias is taken away by iteration.
    fn solve(&self) -> Option<Vec<DVec3>> {
        /// Each round multiplies the bias by about the fairness.
        const ROUNDS: usize = 4;
        let free: Vec<usize> = (0..self.fixed.len()).filter(|&i| self.fixed[i].is_none()).collect();
        let m = free.len();
        if m == 0 {
            return self.fixed.iter().copied().collect();
        }
        let scale = (0..m).map(|k| self.data[(free[k], free[k])]).sum::<f64>() / m.max(1) as f64;
        let weight = self.fairness * scale.max(f64::MIN_POSITIVE);
        let data = DMatrix::from_fn(m, m, |r, c| self.data[(free[r], free[c])]);
        let fair = DMatrix::from_fn(m, m, |r, c| self.fair[(free[r], free[c])]) * weight;
        let chol = (&data + &fair + DMatrix::identity(m, m) * (1e-13 * scale)).cholesky()?;
        let mut all: Vec<DVec3> = self.fixed.iter().map(|p| p.unwrap_or_default()).collect();
        for c in 0..3 {
            let known = |matrix: &DMatrix<f64>, r: usize| -> f64 {
                let terms = self.fixed.iter().enumerate();
                terms.filter_map(|(j, p)| p.map(|p| matrix[(free[r], j)] * p[c])).sum()
            };
            let right = DVector::from_fn(m, |r, _| self.right[(free[r], c)] - known(&self.data, r));
            let pull = DVector::from_fn(m, |r, _| -weight * known(&self.fair, r));
            let mut x = chol.solve(&(&right + pull));
            for _ in 1..ROUNDS {
                let rest = &right - &data * &x;
                x += chol.solve(&rest);
            }
            free.iter().enumerate().for_each(|(k, &i)| all[i][c] = x[k]);
        }
        all.iter().all(|p| p.is_finite()).then_some(all)
    }
}

impl System {
    /// The points where derivatives count too, which couples the coordinates.
    fn solve_tangent(&self) -> Option<Vec<DVec3>> {
        let free: Vec<usize> = (0..self.fixed.len()).filter(|&i| self.fixed[i].is_none()).collect();
        let m = free.len();
        let mut number = vec![None; self.fixed.len()];
        free.iter().enumerate().for_each(|(k, &i)| number[i] = Some(k));
        let scale = (0..m).map(|k| self.data[(free[k], free[k])]).sum::<f64>() / m.max(1) as f64;
        let weight = self.fairness * scale.max(f64::MIN_POSITIVE);
        let mut matrix = DMatrix::zeros(3 * m, 3 * m);
        let mut right = DVector::zeros(3 * m);
        for (r, &i) in free.iter().enumerate() {
            for (j, &known) in self.fixed.iter().enumerate() {
                let value = self.data[(i, j)] + weight * self.fair[(i, j)];
                for c in 0..3 {
                    match (number[j], known) {
                        (Some(k), _) => matrix[(3 * r + c, 3 * k + c)] += value,
                        (None, p) => right[3 * r + c] -= value * p.unwrap_or_default()[c],
                    }
                }
            }
            for c in 0..3 {
                matrix[(3 * r + c, 3 * r + c)] += 1e-13 * scale;
                right[3 * r + c] += self.right[(i, c)];
            }
        }
        for (row, normal) in &self.tangent {
            // What the fixed points give to the slope.
            let given: f64 = row.iter().filter_map(|&(i, a)| self.fixed[i].map(|p| a * normal.dot(p))).sum();
            let terms: Vec<(usize, f64)> = row
                .iter()
                .filter_map(|&(i, a)| number[i].map(|k| (k, a)))
                .flat_map(|(k, a)| (0..3).map(move |c| (3 * k + c, a * normal[c])))
                .collect();
            for &(p, a) in &terms {
                right[p] -= a * given;
                for &(q, b) in &terms {
                    matrix[(p, q)] += a * b;
                }
            }
        }
        let x = matrix.cholesky()?.solve(&right);
        let mut all: Vec<DVec3> = self.fixed.iter().map(|p| p.unwrap_or_default()).collect();
        free.iter().enumerate().for_each(|(k, &i)| all[i] = DVec3::new(x[3 * k], x[3 * k + 1], x[3 * k + 2]));
        all.iter().all(|p| p.is_finite()).then_some(all)
    }
}

/// Fills in the inner control points of a patch whose border is given, so that it fits the samples.
pub fn fit_inside(patch: &mut Patch, samples: &Samples, fairness: f64) {
    if let Some(controls) = system_inside(patch, samples, fairness).solve() {
        patch.controls = controls;
    }
}

/// As [`fit_inside`], with derivatives across the border drawn into planes: a slope of one counts as a distance of
/// `reach` at as many samples as there are.
pub fn fit_tangent(patch: &mut Patch, samples: &Samples, fairness: f64, (planes, reach): (&[Tangency], f64)) {
    let mut system = system_inside(patch, samples, fairness);
    let all: f64 = samples.weights.iter().sum();
    let weight = reach * reach * all.max(f64::MIN_POSITIVE) / planes.len().max(1) as f64;
    for plane in planes {
        let row = slope(patch, plane.place, plane.is_along_u);
        system.tangent.push((row, plane.normal * weight.sqrt()));
    }
    if let Some(controls) = system.solve_tangent() {
        patch.controls = controls;
    }
}

fn system_inside(patch: &Patch, samples: &Samples, fairness: f64) -> System {
    let (w, h) = (patch.width(), patch.spans[1] + 3);
    let mut system = System::new(w * h, fairness);
    let at = |i: usize, j: usize| j * w + i;
    for j in 0..h {
        for i in 0..w {
            if i + 2 < w {
                system.fair(&[(at(i, j), 1.0), (at(i + 1, j), -2.0), (at(i + 2, j), 1.0)]);
            }
            if j + 2 < h {
                system.fair(&[(at(i, j), 1.0), (at(i, j + 1), -2.0), (at(i, j + 2), 1.0)]);
            }
            if i + 1 < w && j + 1 < h {
                let twist = [(at(i, j), 1.0), (at(i + 1, j), -1.0), (at(i, j + 1), -1.0), (at(i + 1, j + 1), 1.0)];
                system.fair(&twist.map(|(k, a)| (k, a * std::f64::consts::SQRT_2)));
            }
            if i == 0 || j == 0 || i == w - 1 || j == h - 1 {
                system.fix(at(i, j), patch.controls[at(i, j)]);
            }
        }
    }
    for ((&p, &[u, v]), &weight) in samples.points.iter().zip(&samples.places).zip(&samples.weights) {
        system.sample(&tensor(patch, u, v), p, weight);
    }
    system
}

/// The weights of the control points in a derivative at a place.
fn slope(patch: &Patch, [u, v]: [f64; 2], is_along_u: bool) -> Vec<(usize, f64)> {
    let ((i, a, da), (j, b, db)) = (basis(patch.spans[0], u), basis(patch.spans[1], v));
    let (a, b) = if is_along_u { (da, b) } else { (a, db) };
    (0..16).map(|k| ((j + k / 4) * patch.width() + i + k % 4, a[k % 4] * b[k / 4])).collect()
}

/// The weights of the control points in the point at a place.
fn tensor(patch: &Patch, u: f64, v: f64) -> Vec<(usize, f64)> {
    let ((i, a, _), (j, b, _)) = (basis(patch.spans[0], u), basis(patch.spans[1], v));
    (0..16).map(|k| ((j + k / 4) * patch.width() + i + k % 4, a[k % 4] * b[k / 4])).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bicubic(u: f64, v: f64) -> DVec3 {
        DVec3::new(u + 0.1 * v * v * v, v - 0.2 * u * u * v, 0.5 * u * u * u * v * v + u * v - v * v * v)
    }

    #[test]
    fn an_exact_bicubic_surface_is_recovered() {
        let side = |f: &dyn Fn(f64) -> DVec3, spans| {
            // The border of the exact patch, by interpolation at as many places as it has control points.
            let n = spans + 3;
            let knot = |i: usize| ((i as f64 - 3.0) / spans as f64).clamp(0.0, 1.0);
            let mut matrix = DMatrix::zeros(n, n);
            let mut right = DMatrix::zeros(n, 3);
            for row in 0..n {
                let t = (knot(row + 1) + knot(row + 2) + knot(row + 3)) / 3.0;
                let (first, value, _) = basis(spans, t);
                (0..4).for_each(|k| matrix[(row, first + k)] += value[k]);
                (0..3).for_each(|c| right[(row, c)] = f(t)[c]);
            }
            let x = matrix.lu().solve(&right).unwrap();
            (0..n).map(|i| DVec3::from_array(std::array::from_fn(|c| x[(i, c)]))).collect::<Vec<_>>()
        };
        for spans in [1, 2] {
            let n = spans + 3;
            let mut patch = Patch { spans: [spans; 2], controls: vec![DVec3::ZERO; n * n], ..Patch::default() };
            for (k, p) in side(&|t| bicubic(t, 0.0), spans).into_iter().enumerate() {
                patch.controls[k] = p;
            }
            for (k, p) in side(&|t| bicubic(t, 1.0), spans).into_iter().enumerate() {
                patch.controls[(n - 1) * n + k] = p;
            }
            for (k, p) in side(&|t| bicubic(0.0, t), spans).into_iter().enumerate() {
                patch.controls[k * n] = p;
            }
            for (k, p) in side(&|t| bicubic(1.0, t), spans).into_iter().enumerate() {
                patch.controls[k * n + n - 1] = p;
            }
            let places: Vec<[f64; 2]> =
                (0..400).map(|k| [f64::from(k % 20) / 19.0, f64::from(k / 20) / 19.0]).collect();
            let points: Vec<DVec3> = places.iter().map(|p| bicubic(p[0], p[1])).collect();
            let weights = (0..400).map(|k| 1.0 + f64::from(k % 7)).collect();
            fit_inside(&mut patch, &Samples { points, places, weights }, 1e-6);
            for k in 0..121 {
                let [u, v] = [f64::from(k % 11) / 10.0, f64::from(k / 11) / 10.0];
                let error = patch.point(u, v).distance(bicubic(u, v));
                assert!(error < 1e-9, "{spans} spans: {error} at {u} {v}");
            }
        }
    }

    #[test]
    fn a_curve_of_more_spans_is_the_same_curve() {
        let curve = Curve { spans: 2, controls: (0..5).map(|k| bicubic(f64::from(k) / 4.0, 0.3)).collect() };
        let finer = curve.refined(8);
        for k in 0..=50 {
            let t = f64::from(k) / 50.0;
            assert!(curve.point(t).distance(finer.point(t)) < 1e-12);
        }
    }
}
