//! Feature deviation: how far the marked edges of two meshes lie apart, both ways.
//!
//! Marked edges are those that the meshes carry, whatever their cause: detecting features again on a result would
//! measure noise. Each is sampled at both ends and at steps of the reference's diagonal / 2000; every sample looks for
//! the nearest marked edge of the other mesh, so that the figures are lower bounds, short by at most half a step.

use glam::DVec3;
use rayon::prelude::*;

use super::summary;
use crate::mesh::Soup;
use crate::mesh::bvh::{Segment, SegmentBvh};
use crate::mesh::geometry::Aabb;

/// Samples along the diagonal, and at most in all.
const STEPS: f64 = 2000.0;
const MOST_SAMPLES: f64 = 2e6;

/// Deviation of marked edges.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FeatureDeviation {
    /// Largest distance from the reference's marked edges to the mesh's.
    pub loss: f64,
    /// Where that is.
    pub loss_at: DVec3,
    /// Largest distance from the mesh's marked edges to the reference's.
    pub spur: f64,
    /// Where that is.
    pub spur_at: DVec3,
    /// Root mean square of the first.
    pub loss_rms: f64,
    /// Root mean square of the second.
    pub spur_rms: f64,
}

fn marked(mesh: &Soup) -> Vec<Segment> {
    let ends = |key: &[crate::mesh::VertexId; 2]| Some([*mesh.points.get(key[0])?, *mesh.points.get(key[1])?]);
    mesh.carried.marks.keys().filter_map(ends).collect()
}

fn samples(segments: &[Segment], step: f64) -> Vec<DVec3> {
    let mut points = Vec::new();
    for [a, b] in segments {
        let pieces = if step > 0.0 { ((*b - *a).length() / step).ceil().max(1.0) as usize } else { 1 };
        points.extend((0..=pieces).map(|i| a.lerp(*b, i as f64 / pieces as f64)));
    }
    points
}

fn one_way(from: &[Segment], to: &SegmentBvh, step: f64) -> (f64, DVec3, f64) {
    let points = samples(from, step);
    let distances: Vec<f64> = points.par_iter().map(|&p| to.closest(p).map_or(0.0, |c| c.distance())).collect();
    let mut most = (0.0, points.first().copied().unwrap_or_default());
    for (&d, &p) in distances.iter().zip(&points) {
        if d > most.0 {
            most = (d, p);
        }
    }
    (most.0, most.1, summary::rms(&distances).unwrap_or(0.0))
}

/// The deviation between the marked edges of a mesh and of its reference; zero where neither has one, `None` where only
/// one has.
pub fn feature_deviation(mesh: &Soup, reference: &Soup) -> Option<FeatureDeviation> {
    let (ours, theirs) = (marked(mesh), marked(reference));
    match (ours.is_empty(), theirs.is_empty()) {
        (true, true) => return Some(FeatureDeviation::default()),
        (true, false) | (false, true) => return None,
        (false, false) => {}
    }
    let diagonal = Aabb::of(reference.points.iter().copied()).diagonal();
    let total: f64 = ours.iter().chain(&theirs).map(|[a, b]| (*b - *a).length()).sum();
    let step = (diagonal / STEPS).max(total / MOST_SAMPLES);
    let (spur, spur_at, spur_rms) = one_way(&ours, &SegmentBvh::new(theirs.clone()), step);
    let (loss, loss_at, loss_rms) = one_way(&theirs, &SegmentBvh::new(ours), step);
    Some(FeatureDeviation { loss, loss_at, spur, spur_at, loss_rms, spur_rms })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{EdgeMark, Freedom, MarkCause, VertexId, edge_key};

    fn line(points: &[DVec3]) -> Soup {
        let mut soup = Soup { points: points.to_vec().into(), ..Soup::default() };
        let mark = EdgeMark { freedom: Freedom::OnCurve, cause: MarkCause::Feature };
        for i in 1..points.len() {
            soup.carried.mark(edge_key(VertexId::new(i - 1), VertexId::new(i)), mark);
        }
        soup
    }

    #[test]
    fn a_lost_end_counts_one_way_and_a_spur_the_other() {
        let long = line(&[DVec3::ZERO, DVec3::X, 2.0 * DVec3::X]);
        let short = line(&[DVec3::ZERO, DVec3::X]);
        let lost = feature_deviation(&short, &long).expect("both are marked");
        assert_eq!((lost.loss, lost.spur, lost.loss_at), (1.0, 0.0, 2.0 * DVec3::X));
        let spur = feature_deviation(&long, &short).expect("both are marked");
        assert_eq!((spur.loss, spur.spur), (0.0, 1.0));
        assert!(spur.spur_rms > 0.0 && spur.spur_rms < 1.0);
    }

    #[test]
    fn without_marks_there_is_nothing_to_lose() {
        let none = Soup::default();
        assert_eq!(feature_deviation(&none, &none), Some(FeatureDeviation::default()));
        assert_eq!(feature_deviation(&none, &line(&[DVec3::ZERO, DVec3::X])), None);
    }
}
