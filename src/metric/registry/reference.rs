//! Metrics of a mesh against its reference.

use super::super::distance::TwoSided;
use super::super::summary::number;
use super::Direction::{Higher, Lower};
use super::Needs::Reference;
use super::Unit::{Flag, Length, Share};
use super::mesh::enclosed;
use super::{MetricDef, flag, metric};
use crate::mesh::Soup;

fn drift(value: f64, reference: f64) -> Option<f64> {
    (reference != 0.0).then(|| (value / reference - 1.0).abs())
}

/// Names of groups, with their kind, and of regions that have elements in the reference and none in the mesh.
pub fn lost_groups(mesh: &Soup, reference: &Soup) -> Vec<String> {
    let groups = |soup: &Soup| -> Vec<(String, String)> {
        let mut names: Vec<_> = soup
            .carried
            .groups
            .list()
            .filter(|(.., members)| *members > 0)
            .map(|(kind, name, _)| (kind.to_owned(), name.to_owned()))
            .collect();
        if let Some(regions) = &soup.carried.regions {
            let mut used = vec![false; regions.names.len()];
            for &label in &regions.labels {
                if let Some(seen) = used.get_mut(label as usize) {
                    *seen = true;
                }
            }
            let named = regions.names.iter().zip(used).filter(|(_, seen)| *seen);
            names.extend(named.map(|(name, _)| ("region".to_owned(), name.clone())));
        }
        names
    };
    let ours = groups(mesh);
    groups(reference).into_iter().filter(|g| !ours.contains(g)).map(|(kind, name)| format!("{kind} `{name}`")).collect()
}

pub(super) static METRICS: &[MetricDef] = &[
    metric("distance", Length, Lower, Reference, "Certified upper bound of the two-sided Hausdorff distance.", |s| {
        number(s.distance().map(TwoSided::upper))
    }),
    metric(
        "distance-slack",
        Length,
        Lower,
        Reference,
        "By how much at most the bound `distance` exceeds the true distance.",
        |s| number(s.distance().map(|d| d.upper() - d.lower())),
    ),
    metric(
        "distance-to-reference",
        Length,
        Lower,
        Reference,
        "Certified upper bound of the largest distance from the mesh to the reference.",
        |s| number(s.distance().map(|d| d.to_reference.upper)),
    ),
    metric(
        "distance-from-reference",
        Length,
        Lower,
        Reference,
        "Certified upper bound of the largest distance from the reference to the mesh.",
        |s| number(s.distance().map(|d| d.from_reference.upper)),
    ),
    metric(
        "outer-distance",
        Length,
        Lower,
        Reference,
        "The same as `distance`, where parts of the reference inside of the mesh's closed bodies do not count.",
        |s| number(s.bound(false).zip(s.outer_bound()).map(|(to, from)| to.max(from))),
    ),
    metric(
        "outer-distance-from-reference",
        Length,
        Lower,
        Reference,
        "The same as `distance-from-reference`, where parts of it inside of the mesh's closed bodies do not count.",
        |s| number(s.outer_bound()),
    ),
    metric(
        "mean-distance-to-reference",
        Length,
        Lower,
        Reference,
        "Mean distance of area-uniform samples of the mesh.",
        |s| number(s.distance().map(|d| d.to_reference.mean)),
    ),
    metric(
        "mean-distance-from-reference",
        Length,
        Lower,
        Reference,
        "Mean distance of area-uniform samples of the reference.",
        |s| number(s.distance().map(|d| d.from_reference.mean)),
    ),
    metric("mean-distance", Length, Lower, Reference, "The larger of the two mean distances.", |s| {
        number(s.distance().map(|d| d.to_reference.mean.max(d.from_reference.mean)))
    }),
    metric(
        "rms-distance-to-reference",
        Length,
        Lower,
        Reference,
        "Root mean square distance of samples of the mesh.",
        |s| number(s.distance().map(|d| d.to_reference.rms)),
    ),
    metric(
        "rms-distance-from-reference",
        Length,
        Lower,
        Reference,
        "Root mean square distance of samples of the reference.",
        |s| number(s.distance().map(|d| d.from_reference.rms)),
    ),
    metric("rms-distance", Length, Lower, Reference, "The larger of the two root mean squares.", |s| {
        number(s.distance().map(|d| d.to_reference.rms.max(d.from_reference.rms)))
    }),
    metric(
        "feature-loss",
        Length,
        Lower,
        Reference,
        "Largest distance from marked edges of the reference to marked edges of the mesh, at samples of diagonal / 2000.",
        |s| number(s.features().map(|f| f.loss)),
    ),
    metric(
        "feature-spur",
        Length,
        Lower,
        Reference,
        "Largest distance from marked edges of the mesh to marked edges of the reference.",
        |s| number(s.features().map(|f| f.spur)),
    ),
    metric("feature-deviation", Length, Lower, Reference, "The larger of feature loss and feature spur.", |s| {
        number(s.features().map(|f| f.loss.max(f.spur)))
    }),
    metric("rms-feature-deviation", Length, Lower, Reference, "The larger root mean square of the two ways.", |s| {
        number(s.features().map(|f| f.loss_rms.max(f.spur_rms)))
    }),
    metric("area-drift", Share, Lower, Reference, "|area / area of the reference − 1|.", |s| {
        number(drift(s.extent().area, s.reference()?.extent().area))
    }),
    metric("volume-drift", Share, Lower, Reference, "|volume / volume of the reference − 1|, both closed.", |s| {
        number(drift(enclosed(s)?, enclosed(s.reference()?)?))
    }),
    metric(
        "groups-kept",
        Flag,
        Higher,
        Reference,
        "Every group and region name of the reference still has elements.",
        |s| flag(lost_groups(s.mesh(), s.reference()?.mesh()).is_empty()),
    ),
];
