//! What was measured of a mesh, kept for the next who measures it.
//!
//! One result is measured by a step, by several gates, and by each column of a sweep. Topology, shapes, crossings and
//! the hierarchy over its triangles belong to the mesh alone, distances to the mesh and a reference; each is computed
//! when it is first asked for and kept as long as the mesh is.
//!
//! # Invariants
//! - What is kept depends on the meshes alone, so that the figures do not depend on who measures first, or whether
//!   anybody did before. Only what was interrupted is kept wrong: a run that was interrupted uses no figure.
//! - Nobody waits within a pool of threads for another who computes the same: work on a pool is taken up on the stack
//!   of work that waits, and would wait for itself. Two who ask at once both compute. Who can wait, outside of the
//!   pool, takes the mesh's `turn` first.

use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError, Weak};

use super::distance::{Target, TwoSided};
use super::feature::FeatureDeviation;
use super::intersection::Intersections;
use super::quad_layout::Layout;
use super::quad_shape::QuadShapes;
use super::shape::TriangleShapes;
use super::topology::Topology;
use crate::mesh::Soup;
use crate::mesh::geometry::Aabb;

/// Bounding box, area and volume.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Extent {
    /// The box of all vertices that a face uses.
    pub bounds: Aabb,
    /// Sum of face areas.
    pub area: f64,
    /// Signed volume.
    pub volume: f64,
}

/// What belongs to one mesh.
#[derive(Debug, Default)]
pub(super) struct Alone {
    pub(super) extent: OnceLock<Extent>,
    pub(super) topology: OnceLock<Topology>,
    pub(super) triangles: OnceLock<TriangleShapes>,
    pub(super) quads: OnceLock<QuadShapes>,
    pub(super) layout: OnceLock<Layout>,
    pub(super) intersections: OnceLock<Intersections>,
    pub(super) target: OnceLock<Target>,
}

/// What belongs to a mesh and a reference.
#[derive(Debug, Default)]
pub(super) struct Pair {
    pub(super) distance: OnceLock<Option<TwoSided>>,
    /// Certified bounds, to the reference and from it.
    pub(super) bounds: [OnceLock<Option<f64>>; 2],
    pub(super) features: OnceLock<Option<FeatureDeviation>>,
}

/// What `cell` holds, computed where it holds nothing yet.
pub(super) fn kept<T>(cell: &OnceLock<T>, compute: impl FnOnce() -> T) -> &T {
    if let Some(known) = cell.get() {
        return known;
    }
    let made = compute();
    cell.get_or_init(|| made)
}

/// A mesh with what was measured of it.
#[derive(Debug)]
pub struct Measured {
    mesh: Arc<Soup>,
    alone: Arc<Alone>,
    pairs: Mutex<Vec<(Weak<Measured>, Arc<Pair>)>>,
    turn: Mutex<()>,
}

impl Measured {
    /// A mesh of which nothing was measured yet.
    pub fn new(mesh: Arc<Soup>) -> Self {
        Self { mesh, alone: Arc::default(), pairs: Mutex::default(), turn: Mutex::default() }
    }

    /// The mesh.
    pub fn mesh(&self) -> &Soup {
        &self.mesh
    }

    /// Held by who is about to measure, so that the next finds what it needs. Never to be asked for within a pool.
    pub fn turn(&self) -> MutexGuard<'_, ()> {
        self.turn.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(super) fn alone(&self) -> &Arc<Alone> {
        &self.alone
    }

    /// What is known of this mesh and a reference.
    pub(super) fn pair(&self, reference: &Arc<Self>) -> Arc<Pair> {
        let reference = Arc::downgrade(reference);
        let mut pairs = self.pairs.lock().unwrap_or_else(PoisonError::into_inner);
        pairs.retain(|(known, _)| known.strong_count() > 0);
        if let Some((_, pair)) = pairs.iter().find(|(known, _)| known.ptr_eq(&reference)) {
            return Arc::clone(pair);
        }
        let pair = Arc::default();
        pairs.push((reference, Arc::clone(&pair)));
        pair
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{Facet, VertexId};
    use crate::metric::gate::{Check, Limit, judge};
    use crate::metric::{Subject, measure, measure_kept};
    use crate::watch::Watch;
    use glam::{DVec3, dvec3};

    /// A tetrahedron, and one that is a little higher.
    fn meshes() -> [Arc<Soup>; 2] {
        [0.9, 0.95].map(|height| {
            let points = vec![DVec3::ZERO, DVec3::X, dvec3(0.3, 1.1, 0.0), dvec3(0.2, 0.4, height)];
            let face = |face: [u32; 3]| Facet::Tri(face.map(VertexId::from_raw));
            let faces = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]].map(face);
            Arc::new(Soup { points: points.into(), faces: faces.to_vec().into(), ..Soup::default() })
        })
    }

    #[test]
    fn what_was_computed_once_is_not_computed_again() {
        let [mesh, reference] = meshes().map(|mesh| Arc::new(Measured::new(mesh)));
        let watch = Watch::silent();
        let subjects = [0, 1].map(|_| Subject::kept(&mesh, Some(&reference), &watch));
        let [first, second] = &subjects;
        assert!(std::ptr::eq(first.topology(), second.topology()));
        assert!(std::ptr::eq(first.intersections(), second.intersections()));
        assert!(std::ptr::eq(first.distance().unwrap(), second.distance().unwrap()));
        let targets = subjects.each_ref().map(|subject| subject.reference().unwrap().target());
        assert!(std::ptr::eq(targets[0], targets[1]));
        // Another reference is another pair.
        let other = Arc::new(Measured::new(Arc::clone(&mesh.mesh)));
        let to_itself = Subject::kept(&mesh, Some(&other), &watch);
        assert!(to_itself.distance().unwrap().upper() < 1e-12 && first.distance().unwrap().upper() > 0.01);
        // The reference is a mesh of its own.
        assert!(std::ptr::eq(targets[0], Subject::kept(&reference, None, &watch).target()));
    }

    #[test]
    fn whoever_measures_first_the_figures_are_those_of_each_alone() {
        let (watch, [mesh, reference]) = (Watch::silent(), meshes());
        let alone = measure(&mesh, Some(&reference), &watch).unwrap();
        let checks: Vec<Check> =
            ["distance", "distance-to-reference", "self-intersections", "max-size", "volume-drift"]
                .into_iter()
                .map(|metric| Check {
                    metric: metric.to_owned(),
                    at_most: Some(Limit::Percent(5.0)),
                    ..Check::default()
                })
                .collect();
        let verdicts = crate::metric::gate::evaluate(&mesh, Some(&reference), &checks, &watch).unwrap();
        for gate_first in [false, true] {
            let [mesh, reference] = [&mesh, &reference].map(|mesh| Arc::new(Measured::new(Arc::clone(mesh))));
            let subject = || Subject::kept(&mesh, Some(&reference), &watch);
            for is_gate in [gate_first, !gate_first] {
                if is_gate {
                    assert_eq!(judge(&subject(), &checks).unwrap(), verdicts);
                } else {
                    assert_eq!(measure_kept(&subject()).unwrap(), alone);
                }
            }
        }
    }
}
