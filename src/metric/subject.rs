//! A mesh that is being measured, perhaps against a reference; what several metrics need is computed once, on demand,
//! and for several who measure it once for all (`measured`).

use std::sync::Arc;

use glam::DVec3;

use super::distance::{self, Target, TwoSided};
use super::feature::{FeatureDeviation, feature_deviation};
use super::intersection::{Intersections, self_intersections};
use super::measured::{Alone, Extent, Measured, Pair, kept};
use super::quad_layout::{Layout, layout_counts};
use super::quad_shape::{QuadShapes, quad_shapes};
use super::shape::{TriangleShapes, triangle_shapes};
use super::summary;
use super::topology::{Topology, topology};
use crate::mesh::geometry::{Aabb, triangle_area};
use crate::mesh::{FaceId, Facet, Soup};
use crate::watch::Watch;

/// Where no part of the reference lies farther off than this part of its diagonal, none is taken for hidden.
const NOTHING_HIDDEN: f64 = 0.005;

/// A mesh under measurement.
pub struct Subject<'a> {
    mesh: &'a Soup,
    watch: &'a Watch,
    reference: Option<Box<Self>>,
    alone: Arc<Alone>,
    pair: Arc<Pair>,
}

impl<'a> Subject<'a> {
    /// A mesh, and the reference that it is compared with.
    pub fn new(mesh: &'a Soup, reference: Option<&'a Soup>, watch: &'a Watch) -> Self {
        let reference = reference.map(|reference| Box::new(Self::new(reference, None, watch)));
        Self { mesh, watch, reference, alone: Arc::default(), pair: Arc::default() }
    }

    /// The same of meshes that keep what is measured of them.
    pub fn kept(mesh: &'a Measured, reference: Option<&'a Arc<Measured>>, watch: &'a Watch) -> Self {
        Self {
            mesh: mesh.mesh(),
            watch,
            reference: reference.map(|reference| Box::new(Self::kept(reference, None, watch))),
            alone: Arc::clone(mesh.alone()),
            pair: reference.map_or_else(Arc::default, |reference| mesh.pair(reference)),
        }
    }

    /// The mesh.
    pub fn mesh(&self) -> &'a Soup {
        self.mesh
    }

    /// Progress and cancellation.
    pub fn watch(&self) -> &'a Watch {
        self.watch
    }

    /// The reference, where there is one.
    pub fn reference(&self) -> Option<&Self> {
        self.reference.as_deref()
    }

    /// Bounding box, area and volume.
    pub fn extent(&self) -> &Extent {
        kept(&self.alone.extent, || {
            let corners = self.mesh.faces.iter().flat_map(|f| f.corners().iter().map(|&v| self.mesh.points[v]));
            let bounds = Aabb::of(corners);
            // The volume of a closed, oriented mesh does not depend on the origin, and cancels least about its centre.
            let solid = self.topology().is_closed() && self.topology().is_oriented();
            let origin = if solid { bounds.centre() } else { DVec3::ZERO };
            let parts: Vec<(f64, f64)> =
                self.mesh.faces.iter().map(|f| area_and_volume(self.mesh, f, origin)).collect();
            Extent {
                bounds,
                area: summary::sum(parts.iter().map(|p| p.0)),
                volume: summary::sum(parts.iter().map(|p| p.1)),
            }
        })
    }

    /// Counts and topology.
    pub fn topology(&self) -> &Topology {
        kept(&self.alone.topology, || topology(self.mesh))
    }

    /// Figures of each triangle.
    pub fn triangles(&self) -> &TriangleShapes {
        kept(&self.alone.triangles, || triangle_shapes(self.mesh))
    }

    /// Figures of each quad.
    pub fn quads(&self) -> &QuadShapes {
        kept(&self.alone.quads, || quad_shapes(self.mesh))
    }

    /// Irregular vertices of a layout of quads.
    pub fn layout(&self) -> &Layout {
        kept(&self.alone.layout, || layout_counts(self.mesh))
    }

    /// Pairs of faces that intersect. Empty when cancelled; ask the watch afterwards.
    pub fn intersections(&self) -> &Intersections {
        kept(&self.alone.intersections, || self_intersections(self.mesh, self.watch).unwrap_or_default())
    }

    /// The mesh prepared for distances.
    pub fn target(&self) -> &Target {
        kept(&self.alone.target, || Target::of(self.mesh))
    }

    /// Distances to and from the reference. Absent without reference, without triangles, or when cancelled.
    pub fn distance(&self) -> Option<&TwoSided> {
        let reference = self.reference()?;
        let compute = || distance::two_sided(self.target(), reference.target(), self.watch).ok().flatten();
        kept(&self.pair.distance, compute).as_ref()
    }

    /// A certified upper bound of the distance to the reference, or from it. Absent as [`Self::distance`] is; several
    /// times cheaper than that.
    pub fn bound(&self, from_reference: bool) -> Option<f64> {
        let reference = self.reference()?;
        let (from, to) = if from_reference { (reference, self) } else { (self, reference) };
        let compute = || distance::upper_bound(from.target(), to.target(), self.watch).ok().flatten();
        *kept(&self.pair.bounds[usize::from(from_reference)], compute)
    }

    /// A certified upper bound of the distance from those parts of the reference that are not inside of the mesh's
    /// bodies: that of all parts where it is small, since then nothing hidden lies far away, and to look for what is
    /// hidden costs many times more. Absent as [`Self::distance`] is.
    pub fn outer_bound(&self) -> Option<f64> {
        let reference = self.reference()?;
        let of_all = self.bound(true)?;
        if of_all <= NOTHING_HIDDEN * reference.target().bvh().bounds().diagonal() {
            return Some(of_all);
        }
        let hidden = distance::Inside::of(self.mesh);
        distance::outside_bound(reference.target(), self.target(), &hidden, self.watch).ok().flatten()
    }

    /// Deviation of marked edges from those of the reference.
    pub fn features(&self) -> Option<&FeatureDeviation> {
        let reference = self.reference()?;
        kept(&self.pair.features, || feature_deviation(self.mesh, reference.mesh)).as_ref()
    }

    /// Inner vertices, and those among them whose valence is not 4.
    pub fn inner_and_irregular(&self) -> (usize, Vec<usize>) {
        let topology = self.topology();
        let inner = |v: &usize| topology.valence[*v] > 0 && !topology.on_border[*v];
        let all = (0..topology.valence.len()).filter(inner);
        (all.clone().count(), all.filter(|&v| topology.valence[v] != 4).collect())
    }

    /// Faces that are degenerate: a corner twice, or next to no area for their size.
    pub fn degenerate(&self) -> Vec<FaceId> {
        /// Height / longest side of a triangle, area / squared longest side of a quad.
        const THIN: f64 = 1e-6;
        let (triangles, quads) = (self.triangles(), self.quads());
        let thin_triangles = triangles.faces.iter().zip(&triangles.flatness).filter(|(_, f)| **f < THIN);
        let thin = |q: &super::quad_shape::QuadShape| q.area.abs() < THIN * q.longest * q.longest;
        let thin_quads = quads.faces.iter().zip(&quads.shapes).filter(|(_, q)| thin(q));
        let mut faces = self.topology().repeated.clone();
        faces.extend(thin_triangles.map(|(f, _)| *f).chain(thin_quads.map(|(f, _)| *f)));
        faces.sort_unstable();
        faces.dedup();
        faces
    }
}

/// Area and signed volume of a face against `origin`; a quad is the mean of its two cuts.
fn area_and_volume(mesh: &Soup, face: &Facet, origin: DVec3) -> (f64, f64) {
    let of = |t: [usize; 3], corners: &[crate::mesh::VertexId]| {
        let p = t.map(|i| mesh.points[corners[i]] - origin);
        (triangle_area(p), p[0].dot(p[1].cross(p[2])) / 6.0)
    };
    match face {
        Facet::Tri(corners) => of([0, 1, 2], corners),
        Facet::Quad(corners) => {
            let cuts = [[0, 1, 2], [0, 2, 3], [0, 1, 3], [1, 2, 3]].map(|t| of(t, corners));
            (cuts.iter().map(|c| c.0).sum::<f64>() / 2.0, cuts.iter().map(|c| c.1).sum::<f64>() / 2.0)
        }
    }
}
