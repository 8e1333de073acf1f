//! Metrics of quads.

use super::super::Value;
use super::super::subject::Subject;
use super::super::summary::{count, finite_mean, max, mean, min, number, percentile, share_below};
use super::Direction::{Higher, Lower, Neutral};
use super::Needs::Quads;
use super::Unit::{Count, Degrees, Ratio, Share};
use super::{FOLDED, LOW_SCALED_JACOBIAN, MetricDef, metric};

fn with_quads(s: &Subject<'_>, figure: impl Fn(&Subject<'_>) -> usize) -> Option<Value> {
    if s.quads().faces.is_empty() { None } else { count(figure(s)) }
}

fn layout_share(s: &Subject<'_>, count: usize) -> Option<Value> {
    number((!s.quads().faces.is_empty()).then(|| count as f64 / s.layout().vertices.max(1) as f64))
}

pub(super) static METRICS: &[MetricDef] = &[
    metric(
        "min-scaled-jacobian",
        Ratio,
        Higher,
        Quads,
        "Least corner area along the centre normal / product of its sides; −1 to 1, square 1.",
        |s| number(min(&s.quads().column(|q| q.scaled_jacobian))),
    ),
    metric("mean-scaled-jacobian", Ratio, Higher, Quads, "Mean scaled Jacobian.", |s| {
        number(mean(&s.quads().column(|q| q.scaled_jacobian)))
    }),
    metric("p1-scaled-jacobian", Ratio, Higher, Quads, "First percentile of the scaled Jacobian.", |s| {
        number(percentile(&s.quads().column(|q| q.scaled_jacobian), 1.0))
    }),
    metric("low-scaled-jacobian-share", Share, Lower, Quads, "Share of quads of scaled Jacobian below 0.2.", |s| {
        number(share_below(&s.quads().column(|q| q.scaled_jacobian), LOW_SCALED_JACOBIAN))
    }),
    metric("folded-quad-share", Share, Lower, Quads, "Share of quads of a warp angle above 30 degrees.", |s| {
        number(share_below(&s.quads().column(|q| -q.warp_angle), -FOLDED))
    }),
    metric("inverted-quads", Count, Lower, Quads, "Quads of scaled Jacobian 0 or less.", |s| {
        with_quads(s, |s| s.quads().shapes.iter().filter(|q| q.scaled_jacobian <= 0.0).count())
    }),
    metric("min-quad-angle", Degrees, Higher, Quads, "Least corner angle of a quad.", |s| {
        number(min(&s.quads().column(|q| q.min_angle)))
    }),
    metric(
        "max-quad-angle",
        Degrees,
        Lower,
        Quads,
        "Largest corner angle of a quad; above 180 at a reflex corner.",
        |s| number(max(&s.quads().column(|q| q.max_angle))),
    ),
    metric(
        "mean-quad-aspect",
        Ratio,
        Lower,
        Quads,
        "Mean of longest side · perimeter / (4 · area), where finite; square 1.",
        |s| number(finite_mean(&s.quads().column(|q| q.aspect))),
    ),
    metric("max-quad-aspect", Ratio, Lower, Quads, "Largest quad aspect ratio.", |s| {
        number(max(&s.quads().column(|q| q.aspect)))
    }),
    metric(
        "min-warpage",
        Ratio,
        Higher,
        Quads,
        "Least cube of the smaller cosine between opposite corner normals; planar 1.",
        |s| number(min(&s.quads().column(|q| q.warpage))),
    ),
    metric("mean-warpage", Ratio, Higher, Quads, "Mean warpage.", |s| number(mean(&s.quads().column(|q| q.warpage)))),
    metric("max-warp-angle", Degrees, Lower, Quads, "Largest angle between opposite corner normals.", |s| {
        number(max(&s.quads().column(|q| q.warp_angle)))
    }),
    metric("mean-skew", Ratio, Lower, Quads, "Mean of |cosine| between the principal axes; rectangle 0.", |s| {
        number(mean(&s.quads().column(|q| q.skew)))
    }),
    metric("max-skew", Ratio, Lower, Quads, "Largest skew.", |s| number(max(&s.quads().column(|q| q.skew)))),
    metric(
        "mean-taper",
        Ratio,
        Lower,
        Quads,
        "Mean of cross derivative / shorter principal axis; parallelogram 0.",
        |s| number(finite_mean(&s.quads().column(|q| q.taper))),
    ),
    metric("max-taper", Ratio, Lower, Quads, "Largest taper.", |s| number(max(&s.quads().column(|q| q.taper)))),
    metric(
        "min-quad-stretch",
        Ratio,
        Higher,
        Quads,
        "Least of √2 · shortest side / longer diagonal; square 1.",
        |s| number(min(&s.quads().column(|q| q.stretch))),
    ),
    metric("irregular-vertices", Count, Lower, Quads, "Inner vertices whose valence is not 4.", |s| {
        with_quads(s, |s| s.inner_and_irregular().1.len())
    }),
    metric(
        "irregular-patch-share",
        Share,
        Lower,
        Quads,
        "Vertices inside of other than 4 faces, and on smooth borders of other than 2, / all vertices.",
        |s| layout_share(s, s.layout().irregular.len()),
    ),
    metric(
        "forced-irregular-share",
        Share,
        Neutral,
        Quads,
        "Irregular vertices that the Euler number and the corners force, / all vertices.",
        |s| layout_share(s, s.layout().forced),
    ),
    metric("irregular-share", Share, Lower, Quads, "Share of irregular among inner vertices.", |s| {
        let (inner, irregular) = s.inner_and_irregular();
        number((!s.quads().faces.is_empty()).then(|| irregular.len() as f64 / inner.max(1) as f64))
    }),
];
