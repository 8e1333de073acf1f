//! Fits bicubic B-spline patches to the faces that the elements of a quad mesh cover.
//!
//! The common curves come first, least squares over the path with both ends fixed, so that neighbours share them; then
//! the control points inside, least squares over the covered vertices, and over places between them where there are
//! none, with a thin-plate term; the parameters are then corrected to the feet of these samples and the fit repeated. A
//! patch farther from the mesh than the tolerance, or the mesh from it, gets more spans, where that helps. Patches meet
//! in common curves, which follow the paths without their zigzag; the angle between their tangent planes is measured.
//! On demand smooth seams get a common plane at each of their points: curves leave their nodes in one plane, and the
//! control points next to a seam are drawn into the mean of the planes of both patches, by the same least squares, as
//! far as the tolerance allows and no patch folds. Patches whose smooth seams still bend too much get more spans. That
//! is tangent continuity within a tolerance, not to the last digit, which bicubic patches round any node cannot have.
//!
//! Based on: M. Eck, H. Hoppe. Automatic Reconstruction of B-Spline Surfaces of Arbitrary Topological Type. SIGGRAPH,
//! 1996; J. Hoschek. Intrinsic Parametrization for Approximation. CAGD 5, 1988.

mod fit;
mod flatten;
mod frame;
mod measure;
mod refine;
pub mod sample;
pub mod solve;
pub mod tangent;

use glam::DVec3;
use rayon::prelude::*;

use crate::mesh::patches::{Patch, Patches};
use crate::mesh::{Quads, Surface, VertexId};
use crate::technique::layout::Ground;
use crate::watch::{Cancelled, Watch};
use fit::Fit;
pub use frame::FrameError;
use frame::{Frame, covered, frame};
use measure::{Distances, seams};
use refine::Spans;
use solve::{Curve, fit_curve, fit_curve_with};
use tangent::{EndPlanes, end_planes, is_inside};

/// How patches are fitted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FitRules {
    /// Patches farther from the mesh, or the mesh from them, are refined; mesh units.
    pub tolerance: f64,
    /// Most spans in each direction.
    pub max_spans: usize,
    /// Weight of the thin-plate term against the samples.
    pub fairness: f64,
    /// Elements of the tessellation along each side of a patch.
    pub density: usize,
    /// Largest angle between tangent planes along smooth seams, degrees; beyond it patches are refined. `None`: planes
    /// are left as they come.
    pub smooth: Option<f64>,
}

/// Why nothing was fitted.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum FitError {
    /// See [`FrameError`].
    #[error(transparent)]
    Frame(#[from] FrameError),
    /// The run was interrupted.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

/// Fits patches to the faces that each element covers.
///
/// # Errors
/// See [`FitError`].
pub fn fit_patches(surface: &Surface, quads: &Quads, rules: &FitRules, watch: &Watch) -> Result<Patches, FitError> {
    let surface = covered(surface, quads)?;
    let ground = Ground::new(&surface);
    let frame = frame(&ground, quads)?;
    watch.phase("fit", None);
    let mut fits: Vec<Fit> = (0..frame.sides.len()).into_par_iter().map(|e| Fit::begin(&frame, e)).collect();
    let mut spans = Spans::new(fits.len());
    let mut distances = Distances::from(&surface);
    loop {
        watch.check()?;
        let counts = spans.counts();
        let mut curves = curves(&frame, counts, rules);
        fits.par_iter_mut().enumerate().for_each(|(e, fit)| {
            fit.set_border(&frame, e, counts[e], &curves);
            fit.solve(rules);
        });
        if rules.smooth.is_some() {
            watch.check()?;
            let planes = level(&frame, &mut curves);
            smooth(&frame, &mut fits, counts, (&curves, &planes), rules);
        }
        watch.check()?;
        let errors = distances.of(&frame, &fits);
        for (fit, error) in fits.iter_mut().zip(&errors) {
            (fit.patch.max_error, fit.patch.rms_error) = *error;
        }
        let largest: Vec<f64> = errors.iter().map(|error| error.0).collect();
        let room: Vec<usize> = fits.iter().map(|fit| fit.samples.points.len()).collect();
        let is_finer = spans.refine(&largest, &room, rules);
        if !(spans.level(&seams(&frame, &fits), &largest, &room, rules) || is_finer) {
            break;
        }
    }
    let seams = seams(&frame, &fits);
    let patches: Vec<Patch> = fits.into_iter().map(|fit| fit.patch).collect();
    let tessellation = sample::tessellate(&frame, &patches, rules.density);
    Ok(Patches { patches, seams, tessellation })
}

/// Makes curves leave each node in the planes that their sectors have there; these.
fn level(frame: &Frame<'_>, curves: &mut [Curve]) -> Vec<EndPlanes> {
    let planes = end_planes(frame, curves);
    curves.par_iter_mut().enumerate().for_each(|(arc, curve)| {
        let n = curve.controls.len();
        let into = |end: usize, next: usize, normal: Option<DVec3>| {
            let (from, to) = (curve.controls[end], curve.controls[next]);
            normal.map(|normal| to - normal * normal.dot(to - from))
        };
        let next = [into(0, 1, planes[arc][0]), into(n - 1, n - 2, planes[arc][1])];
        if next.iter().any(Option::is_some) {
            *curve = fit_curve_with(&frame.arcs[arc].points, curve.spans, next);
        }
    });
    planes
}

/// Fits the patches again under curves that were levelled, with common planes along smooth seams.
fn smooth(
    frame: &Frame<'_>,
    fits: &mut [Fit],
    spans: &[usize],
    (curves, planes): (&[Curve], &[EndPlanes]),
    rules: &FitRules,
) {
    fits.par_iter_mut().enumerate().for_each(|(e, fit)| {
        fit.set_border(frame, e, spans[e], curves);
        fit.solve_level(rules);
    });
    // Planes are chosen once: later ones would follow what they made.
    let normals: Vec<Vec<(f64, DVec3)>> = (0..frame.arcs.len())
        .into_par_iter()
        .map(|arc| seam_normals(frame, fits, curves, (arc, planes[arc])))
        .collect();
    fits.par_iter_mut().enumerate().for_each(|(e, fit)| fit.solve_tangent(frame, e, &normals, rules));
}

/// Along a smooth seam: shares of the curve, with the normal midway between both patches and across the curve.
fn seam_normals(
    frame: &Frame<'_>,
    fits: &[Fit],
    curves: &[Curve],
    (arc, planes): (usize, EndPlanes),
) -> Vec<(f64, DVec3)> {
    /// Cosine between normals that tell the same plane.
    const ALIKE: f64 = 0.7;
    if !is_inside(frame, arc) {
        return Vec::new();
    }
    let places = (6 * curves[arc].spans).max(12);
    let tangent = |t: f64| {
        let step = 0.25 / places as f64;
        (curves[arc].point(t + step) - curves[arc].point(t - step)).try_normalize()
    };
    let across = |t: f64, normal: DVec3| {
        let tangent = tangent(t)?;
        (normal - tangent * normal.dot(tangent)).try_normalize()
    };
    let of_mesh = path_normals(frame, &frame.arcs[arc]);
    let normal_at = |k: usize| {
        let t = (k as f64 + 0.5) / places as f64;
        let mesh = of_mesh[of_mesh.partition_point(|&(end, _)| end < t).min(of_mesh.len() - 1)].1;
        // Next to a flat corner a patch may be folded: its normal then points the other way, or anywhere.
        let sides = at_seam(frame, arc, t)?.map(|(e, uv)| normal(&fits[e].patch, uv));
        let [na, nb] = sides.map(|n| if n.dot(mesh) < 0.0 { -n } else { n });
        let sum = if na.dot(nb) > ALIKE && mesh.dot(na + nb) > ALIKE { na + nb } else { mesh };
        Some((t, across(t, sum)?))
    };
    let raw: Vec<(f64, DVec3)> = (0..places).filter_map(normal_at).collect();
    smoothed(&raw, planes).into_iter().filter_map(|(t, normal)| Some((t, across(t, normal)?))).collect()
}

/// Normals along a seam without what is finer than a parabola, such as the facets of a coarse mesh, and as the planes
/// at its ends have them there: the curves that meet in a node fix the planes of the patches.
fn smoothed(normals: &[(f64, DVec3)], ends: EndPlanes) -> Vec<(f64, DVec3)> {
    let row = |t: f64| nalgebra::Vector3::new(1.0, t, t * t);
    let (mut matrix, mut right) = (nalgebra::Matrix3::zeros(), nalgebra::Matrix3::zeros());
    for &(t, n) in normals {
        matrix += row(t) * row(t).transpose();
        right += row(t) * nalgebra::Vector3::from(n.to_array()).transpose();
    }
    let Some(inverse) = matrix.try_inverse() else { return normals.to_vec() };
    let solution = inverse * right;
    let at = |t: f64| DVec3::from_array((solution.transpose() * row(t)).into());
    let short = [0.0, 1.0].map(at).into_iter().zip(ends).map(|(own, end)| match end {
        Some(end) => end * end.dot(own).signum() - own,
        None => DVec3::ZERO,
    });
    let short: Vec<DVec3> = short.collect();
    let bent = |t: f64| at(t) + short[0] * (1.0 - t).powi(2) + short[1] * t.powi(2);
    normals.iter().filter_map(|&(t, _)| Some((t, bent(t).try_normalize()?))).collect()
}

/// The mean normal of the faces beside each edge of a path, with the share of the length at which the edge ends.
fn path_normals(frame: &Frame<'_>, arc: &frame::Arc) -> Vec<(f64, DVec3)> {
    let ground = frame.layout.ground;
    let mut at = 0.0;
    let edge = |w: &[VertexId]| {
        let sides = [ground.side_between(w[0], w[1]), ground.side_between(w[1], w[0])];
        at += ground.point(w[0]).distance(ground.point(w[1]));
        (at, sides.into_iter().flatten().map(|side| ground.normal(side.face)).sum::<DVec3>().normalize_or_zero())
    };
    let mut normals: Vec<(f64, DVec3)> = arc.path.windows(2).map(edge).collect();
    for (end, _) in &mut normals {
        *end /= at.max(f64::MIN_POSITIVE);
    }
    normals
}

/// The curves of all arcs, each with the spans of the finer element beside it.
fn curves(frame: &Frame<'_>, spans: &[usize], rules: &FitRules) -> Vec<Curve> {
    let fit = |arc: &frame::Arc| {
        let wanted = arc.beside.iter().map(|&(e, _)| spans[e]).max().unwrap_or(1);
        let mut count = 1;
        // A curve cannot say more than its path; spans stay powers of two times the least, so that knots are nested.
        while count < wanted && 2 * count < arc.path.len() {
            count *= 2;
        }
        fit_curve(&arc.points, count.min(wanted).min(rules.max_spans))
    };
    frame.arcs.par_iter().map(fit).collect()
}

/// Where a side runs on a patch: the place at `t` along the side.
fn on_side(side: usize, count: usize, t: f64) -> [f64; 2] {
    match (side, count) {
        (0, _) => [t, 0.0],
        (1, _) => [1.0, t],
        (2, 4) => [1.0 - t, 1.0],
        _ => [0.0, 1.0 - t],
    }
}

fn normal(patch: &Patch, [u, v]: [f64; 2]) -> DVec3 {
    let [_, su, sv] = patch.eval(u, v);
    su.cross(sv).normalize_or_zero()
}

/// Places of both patches beside an arc at a share of its length.
fn at_seam(frame: &Frame<'_>, arc: usize, t: f64) -> Option<[(usize, [f64; 2]); 2]> {
    let [first, second] = frame.arcs[arc].beside[..] else { return None };
    let place = |(e, side): (usize, usize)| {
        let (_, is_along) = frame.sides[e][side];
        (e, on_side(side, frame.sides[e].len(), if is_along { t } else { 1.0 - t }))
    };
    Some([place(first), place(second)])
}
