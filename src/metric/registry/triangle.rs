//! Metrics of triangles.

use super::super::summary::{below, count, finite_mean, max, mean, min, number, percentile, share_below};
use super::Direction::{Higher, Lower, Neutral};
use super::Needs::Triangles;
use super::Unit::{Count, Degrees, Length, Ratio, Share};
use super::{LOW_STRETCH, MetricDef, metric};

pub(super) static METRICS: &[MetricDef] = &[
    metric(
        "min-stretch",
        Ratio,
        Higher,
        Triangles,
        "Least of √12 · inradius / longest side; 0 to 1, equilateral 1.",
        |s| number(min(&s.triangles().stretch)),
    ),
    metric("mean-stretch", Ratio, Higher, Triangles, "Mean stretch.", |s| number(mean(&s.triangles().stretch))),
    metric("p1-stretch", Ratio, Higher, Triangles, "First percentile of stretch, interpolated linearly.", |s| {
        number(percentile(&s.triangles().stretch, 1.0))
    }),
    metric("p5-stretch", Ratio, Higher, Triangles, "Fifth percentile of stretch.", |s| {
        number(percentile(&s.triangles().stretch, 5.0))
    }),
    metric("p50-stretch", Ratio, Higher, Triangles, "Median stretch.", |s| {
        number(percentile(&s.triangles().stretch, 50.0))
    }),
    metric("max-stretch", Ratio, Higher, Triangles, "Largest stretch.", |s| number(max(&s.triangles().stretch))),
    metric("low-stretch-faces", Count, Lower, Triangles, "Triangles of stretch below 0.2.", |s| {
        count(below(&s.triangles().stretch, LOW_STRETCH))
    }),
    metric("low-stretch-share", Share, Lower, Triangles, "Share of triangles of stretch below 0.2.", |s| {
        number(share_below(&s.triangles().stretch, LOW_STRETCH))
    }),
    metric("min-size", Length, Neutral, Triangles, "Least longest side of a triangle.", |s| {
        number(min(&s.triangles().size))
    }),
    metric("mean-size", Length, Neutral, Triangles, "Mean longest side.", |s| number(mean(&s.triangles().size))),
    metric("max-size", Length, Lower, Triangles, "Largest longest side.", |s| number(max(&s.triangles().size))),
    metric("min-edge", Length, Higher, Triangles, "Shortest side of a triangle.", |s| {
        number(min(&s.triangles().shortest))
    }),
    metric("mean-edge", Length, Neutral, Triangles, "Mean side, each side of each triangle counted.", |s| {
        number(mean(&s.triangles().perimeter).map(|p| p / 3.0))
    }),
    metric(
        "min-aspect-ratio",
        Ratio,
        Lower,
        Triangles,
        "Least of (√3/2) · longest side / height on it; from 1.",
        |s| number(min(&s.triangles().aspect)),
    ),
    metric("mean-aspect-ratio", Ratio, Lower, Triangles, "Mean of the finite aspect ratios.", |s| {
        number(finite_mean(&s.triangles().aspect))
    }),
    metric(
        "max-aspect-ratio",
        Ratio,
        Lower,
        Triangles,
        "Largest aspect ratio; infinite where a triangle has no area.",
        |s| number(max(&s.triangles().aspect)),
    ),
    metric("low-aspect-ratio-share", Share, Higher, Triangles, "Share of triangles of aspect ratio below 20.", |s| {
        number(share_below(&s.triangles().aspect, 20.0))
    }),
    metric("min-angle", Degrees, Higher, Triangles, "Least angle of a triangle.", |s| {
        number(min(&s.triangles().min_angle))
    }),
    metric("p1-min-angle", Degrees, Higher, Triangles, "First percentile of the least angles.", |s| {
        number(percentile(&s.triangles().min_angle, 1.0))
    }),
    metric("p5-min-angle", Degrees, Higher, Triangles, "Fifth percentile of the least angles.", |s| {
        number(percentile(&s.triangles().min_angle, 5.0))
    }),
    metric("mean-min-angle", Degrees, Higher, Triangles, "Mean of the least angles.", |s| {
        number(mean(&s.triangles().min_angle))
    }),
    metric("max-angle", Degrees, Lower, Triangles, "Largest angle of a triangle.", |s| {
        number(max(&s.triangles().max_angle))
    }),
    metric(
        "low-angle-share",
        Share,
        Lower,
        Triangles,
        "Share of triangles whose least angle is below 30 degrees.",
        |s| number(share_below(&s.triangles().min_angle, 30.0)),
    ),
];
