//! One element on its way to a patch: its samples, and the fits of the patch under curves and planes.

use glam::DVec3;

use super::flatten::flatten;
use super::frame::Frame;
use super::solve::{Curve, Samples, Tangency, fit_inside, fit_tangent};
use super::{FitRules, normal, on_side};
use crate::mesh::geometry::{self, Aabb};
use crate::mesh::patches::Patch;

/// An element on its way to a patch.
pub(super) struct Fit {
    pub(super) spans: usize,
    pub(super) samples: Samples,
    pub(super) patch: Patch,
    /// The parameters of the samples as they were flattened. Every fit starts from them: corrected ones of a fit that
    /// was refined since crowd where that one swung, and lead the next one there.
    flat: Vec<[f64; 2]>,
    /// What the stages began with last time, and what they came to.
    last: [Option<(Start, State)>; 3],
}

/// The patch and the parameters of its samples.
type State = (Patch, Vec<[f64; 2]>);

/// The state before a stage, and the planes that it shall reach.
type Start = (State, Vec<Vec<(f64, DVec3)>>);

impl Fit {
    /// The samples of an element, still without a patch.
    pub(super) fn begin(frame: &Frame<'_>, element: usize) -> Self {
        let samples = flatten(frame, element);
        Self { spans: 0, flat: samples.places.clone(), samples, patch: Patch::default(), last: Default::default() }
    }

    /// Fits the inside under the border that was set, and corrects the parameters.
    pub(super) fn solve(&mut self, rules: &FitRules) {
        /// Rounds of parameter correction; later ones change little.
        const ROUNDS: usize = 3;
        self.samples.places.clone_from(&self.flat);
        self.stage(0, Vec::new(), |fit| {
            for _ in 0..ROUNDS {
                fit.fill(rules.fairness);
                fit.correct();
            }
            fit.fill(rules.fairness);
        });
    }

    /// Fits the inside again under a border that was levelled.
    pub(super) fn solve_level(&mut self, rules: &FitRules) {
        self.stage(1, Vec::new(), |fit| fit.fill(rules.fairness));
    }

    /// Does the work of a stage, unless it would begin with the same as last time.
    fn stage(&mut self, number: usize, planes: Vec<Vec<(f64, DVec3)>>, work: impl FnOnce(&mut Self)) {
        let start = (self.state(), planes);
        match &self.last[number] {
            Some((last, end)) if *last == start => self.set_state(end.clone()),
            _ => {
                work(self);
                self.last[number] = Some((start, self.state()));
            }
        }
    }

    fn state(&self) -> State {
        (self.patch.clone(), self.samples.places.clone())
    }

    fn set_state(&mut self, state: State) {
        (self.patch, self.samples.places) = state;
    }

    /// Fits the inside. Where vertices crowd in a part of a winding element, they say little of the rest, and the fit
    /// may swing out into space: then evenness counts more, and at last the inside stays as it was, at first a Coons
    /// patch.
    pub(super) fn fill(&mut self, fairness: f64) {
        const EVENER: [f64; 4] = [1.0, 30.0, 1e3, 1e6];
        let before = self.patch.controls.clone();
        for factor in EVENER {
            fit_inside(&mut self.patch, &self.samples, factor * fairness);
            if !self.swings() {
                return;
            }
        }
        self.patch.controls = before;
    }

    /// Whether control points lie far outside of the box of the vertices and the border.
    fn swings(&self) -> bool {
        /// Of the diagonal of that box.
        const FAR: f64 = 0.25;
        let (width, controls) = (self.patch.width(), &self.patch.controls);
        let height = controls.len() / width;
        let is_border = |k: usize| [0, width - 1].contains(&(k % width)) || [0, height - 1].contains(&(k / width));
        let border = controls.iter().enumerate().filter(|&(k, _)| is_border(k)).map(|(_, &p)| p);
        let bounds = Aabb::of(self.samples.points.iter().copied().chain(border));
        let room = bounds.grown(FAR * bounds.diagonal());
        !controls.iter().all(|p| p.cmpge(room.min).all() && p.cmple(room.max).all())
    }

    /// Starts from the curves given.
    pub(super) fn set_border(&mut self, frame: &Frame<'_>, element: usize, spans: usize, curves: &[Curve]) {
        let sides = &frame.sides[element];
        // The finest of its curves decides, so that each is reproduced exactly.
        let most = sides.iter().map(|&(arc, _)| curves[arc].spans).max().unwrap_or(1).max(spans);
        self.spans = most;
        let border: Vec<Vec<DVec3>> = sides
            .iter()
            .map(|&(arc, is_along)| {
                let mut controls = curves[arc].refined(most).controls;
                if !is_along {
                    controls.reverse();
                }
                controls
            })
            .collect();
        self.patch = with_border(most, &border);
    }

    /// Fits the inside with the derivatives across smooth seams in the planes given, as far as the tolerance allows.
    pub(super) fn solve_tangent(
        &mut self,
        frame: &Frame<'_>,
        element: usize,
        normals: &[Vec<(f64, DVec3)>],
        rules: &FitRules,
    ) {
        /// Rounds of tangency and corrected parameters.
        const ROUNDS: usize = 3;
        let own: Vec<Vec<(f64, DVec3)>> = frame.sides[element].iter().map(|&(arc, _)| normals[arc].clone()).collect();
        if own.iter().all(Vec::is_empty) {
            return;
        }
        self.stage(2, own.clone(), |fit| {
            for _ in 0..ROUNDS {
                fit.reach_planes(&fit.tangencies(&frame.sides[element], &own), rules);
            }
        });
    }

    /// Fits the inside with derivatives in the planes given, as strongly as brings the patch nearest to them.
    fn reach_planes(&mut self, planes: &[Tangency], rules: &FitRules) {
        /// A slope of one counts as much as a distance of so many times the tolerance: of 100, two degrees as three and
        /// a half. Less where the patch would leave the tolerance or fold for it.
        const REACH: [f64; 5] = [100.0, 30.0, 10.0, 3.0, 300.0];
        /// The thin-plate term counts more here, for slopes alone leave room to swing.
        const FAIR: f64 = 1e-3;
        /// Of the angle allowed: nearer than this, nothing stronger or weaker is tried.
        const NEAR: f64 = 0.5;
        let near = NEAR * rules.smooth.unwrap_or(0.0);
        let (before, folds) = (self.state(), self.folds());
        let mut best = (self.bend(planes), before.clone());
        for reach in REACH {
            self.set_state(before.clone());
            fit_tangent(&mut self.patch, &self.samples, rules.fairness.max(FAIR), (planes, reach * rules.tolerance));
            self.correct();
            let bend = self.bend(planes);
            if bend < best.0 && self.error() <= rules.tolerance && self.folds() <= folds && !self.swings() {
                best = (bend, self.state());
                if bend <= near {
                    break;
                }
            }
        }
        self.set_state(best.1);
    }

    /// The largest angle of the patch with planes that it shall have, degrees.
    fn bend(&self, planes: &[Tangency]) -> f64 {
        let bend = |plane: &Tangency| {
            let angle = geometry::angle(normal(&self.patch, plane.place), plane.normal).to_degrees();
            angle.min(180.0 - angle)
        };
        planes.iter().map(bend).fold(0.0, f64::max)
    }

    /// Where the patch shall have the planes given.
    fn tangencies(&self, sides: &[(usize, bool)], normals: &[Vec<(f64, DVec3)>]) -> Vec<Tangency> {
        /// Of the patch's size, what a derivative counts as at least.
        const LEAST: f64 = 0.2;
        let size = self.samples.weights.iter().sum::<f64>().max(0.0).sqrt().max(f64::MIN_POSITIVE);
        let mut planes = Vec::new();
        for (side, &(_, is_along)) in sides.iter().enumerate() {
            for &(t, normal) in &normals[side] {
                let place = on_side(side, sides.len(), if is_along { t } else { 1.0 - t });
                // Of a triangle the side v = 1 is a point, and the last side is u = 0.
                let is_along_u = side % 2 == 1 || sides.len() == 3 && side == 2;
                let [_, su, sv] = self.patch.eval(place[0], place[1]);
                // Next to a flat corner the derivative is about nothing, and must not count without bound for that.
                let length = if is_along_u { su } else { sv }.length().max(LEAST * size);
                planes.push(Tangency { place, is_along_u, normal: normal / length });
            }
        }
        planes
    }

    /// The largest distance of a sample from the point of the patch that it belongs to.
    fn error(&self) -> f64 {
        let pairs = self.samples.points.iter().zip(&self.samples.places);
        pairs.map(|(&p, &[u, v])| self.patch.point(u, v).distance(p)).fold(0.0, f64::max)
    }

    /// At how many places of a grid, sides included, the patch looks away from where it looks as a whole.
    fn folds(&self) -> usize {
        const PLACES: usize = 13;
        let at = |k: usize| k as f64 / (PLACES - 1) as f64;
        let across = |k: usize| {
            let [_, su, sv] = self.patch.eval(at(k % PLACES), at(k / PLACES));
            su.cross(sv)
        };
        let all: Vec<DVec3> = (0..PLACES * PLACES).map(across).collect();
        let mean: DVec3 = all.iter().sum();
        all.iter().filter(|normal| normal.dot(mean) < 0.0).count()
    }

    fn correct(&mut self) {
        for (place, &p) in self.samples.places.iter_mut().zip(&self.samples.points) {
            *place = self.patch.foot(p, *place);
        }
    }
}

/// A patch with these sides, counter-clockwise, its inside a Coons patch of the control points.
fn with_border(spans: usize, sides: &[Vec<DVec3>]) -> Patch {
    let n = spans + 3;
    let is_triangle = sides.len() == 3;
    let mut patch = Patch { spans: [spans; 2], controls: vec![DVec3::ZERO; n * n], is_triangle, ..Patch::default() };
    let apex = sides[sides.len() - 1][0];
    let top = |i: usize| if is_triangle { apex } else { sides[2][n - 1 - i] };
    let left = |j: usize| sides[sides.len() - 1][n - 1 - j];
    let (bottom, right) = (|i: usize| sides[0][i], |j: usize| sides[1][j]);
    for j in 0..n {
        for i in 0..n {
            let (u, v) = (i as f64 / (n - 1) as f64, j as f64 / (n - 1) as f64);
            let ruled = bottom(i) * (1.0 - v) + top(i) * v + left(j) * (1.0 - u) + right(j) * u;
            let corners = bottom(0).lerp(bottom(n - 1), u) * (1.0 - v) + top(0).lerp(top(n - 1), u) * v;
            patch.controls[j * n + i] = match (i, j) {
                (_, 0) => bottom(i),
                (_, _) if j == n - 1 => top(i),
                (0, _) => left(j),
                (_, _) if i == n - 1 => right(j),
                _ => ruled - corners,
            };
        }
    }
    patch
}
