//! The two metrics of shape, the proxies that they make best, and sums from which errors of unions follow at once.

use glam::{DVec3, Vec3};

use super::Metric;
use crate::mesh::geometry::{Aabb, centroid, triangle_area};
use crate::mesh::id::Face;
use crate::mesh::{FaceId, IdVec, Surface};
use crate::technique::eigen::symmetric_eigen;

/// Of two faces that fit a proxy equally well the nearer one is taken first: a plane is cut into compact regions, not
/// into arms. A distance of the whole diagonal counts like an angle of half a degree, which no shape notices.
const COMPACTNESS: f32 = 1e-4;
/// The same for distances from planes: the diagonal counts like a thousandth of it.
const FLAT_COMPACTNESS: f32 = 1e-6;

/// A plane that stands for a region.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Proxy {
    /// A point of the plane: the region's centroid.
    pub point: DVec3,
    /// Its unit normal.
    pub normal: DVec3,
}

/// A face as flooding sees it, in one cache line; lengths in diagonals from the box's centre.
#[derive(Clone, Copy)]
struct Facet {
    normal: Vec3,
    area: f32,
    centre: Vec3,
}

/// What errors are computed from.
pub(super) struct Shape<'a> {
    surface: &'a Surface,
    pub(super) metric: Metric,
    pub(super) normals: IdVec<Face, DVec3>,
    facets: Vec<Facet>,
    centre: DVec3,
    scale: f64,
}

/// A proxy in the units of [`Facet`].
#[derive(Clone, Copy)]
pub(super) struct Target {
    normal: Vec3,
    point: Vec3,
}

/// Sums over the faces of a region.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Moments {
    pub(super) area: f64,
    normal: DVec3,
    centre: DVec3,
    square: [f64; 6],
}

impl Moments {
    pub(super) fn plus(mut self, other: &Self) -> Self {
        self.area += other.area;
        self.normal += other.normal;
        self.centre += other.centre;
        for (a, b) in self.square.iter_mut().zip(other.square) {
            *a += b;
        }
        self
    }
}

fn outer(p: DVec3) -> [f64; 6] {
    [p.x * p.x, p.x * p.y, p.x * p.z, p.y * p.y, p.y * p.z, p.z * p.z]
}

impl<'a> Shape<'a> {
    pub(super) fn new(surface: &'a Surface, metric: Metric, normals: IdVec<Face, DVec3>) -> Self {
        let bounds = Aabb::of(surface.points.iter().copied());
        let scale = if bounds.diagonal() > 0.0 { 1.0 / bounds.diagonal() } else { 1.0 };
        let mut shape = Self { surface, metric, normals, facets: Vec::new(), centre: bounds.centre(), scale };
        // Areas relative to their mean keep single precision away from its limits.
        let total: f64 = surface.faces.ids().map(|f| shape.area(f)).sum();
        let mean = if total > 0.0 { total / surface.faces.len() as f64 } else { 1.0 };
        shape.facets = surface
            .faces
            .ids()
            .map(|f| Facet {
                normal: shape.normals[f].as_vec3(),
                area: (shape.area(f) / mean) as f32,
                centre: shape.local(centroid(surface.corners(f))).as_vec3(),
            })
            .collect();
        shape
    }

    pub(super) fn surface(&self) -> &'a Surface {
        self.surface
    }

    /// The place in diagonals from the box's centre.
    pub(super) fn local(&self, p: DVec3) -> DVec3 {
        (p - self.centre) * self.scale
    }

    pub(super) fn area(&self, f: FaceId) -> f64 {
        triangle_area(self.surface.corners(f))
    }

    pub(super) fn target(&self, proxy: &Proxy) -> Target {
        Target { normal: proxy.normal.as_vec3(), point: self.local(proxy.point).as_vec3() }
    }

    /// The error of a face against a proxy, by which flooding is ordered.
    #[inline]
    pub(super) fn error(&self, face: u32, target: &Target) -> f32 {
        self.deviation(face, target) * self.facets[face as usize].area
    }

    /// The error an area.
    #[inline]
    pub(super) fn deviation(&self, face: u32, target: &Target) -> f32 {
        let facet = &self.facets[face as usize];
        let away = facet.centre.distance_squared(target.point);
        match self.metric {
            Metric::L21 => facet.normal.distance_squared(target.normal) + COMPACTNESS * away,
            Metric::L2 => self.mean_square(face, target) + FLAT_COMPACTNESS * away,
        }
    }

    /// How badly a face stands for its region: by fit, and in flat regions by the distance from the centre.
    pub(super) fn eccentricity(&self, face: u32, target: &Target) -> f32 {
        let away = self.facets[face as usize].centre.distance_squared(target.point);
        self.deviation(face, target) + 100.0 * COMPACTNESS * away
    }

    /// The mean of the squared distances of a face from a plane.
    fn mean_square(&self, face: u32, target: &Target) -> f32 {
        let [a, b, c] = self.surface.corners(FaceId::from_raw(face)).map(|p| {
            let p = self.local(p);
            (p - target.point.as_dvec3()).dot(target.normal.as_dvec3())
        });
        ((a * a + b * b + c * c + a * b + b * c + c * a) / 6.0) as f32
    }

    /// The sums of one face.
    pub(super) fn moments(&self, f: FaceId) -> Moments {
        let corners = self.surface.corners(f);
        let area = triangle_area(corners);
        let mut square = [0.0; 6];
        if self.metric == Metric::L2 {
            let [a, b, c] = corners.map(|p| p - self.centre);
            let parts = [outer(a), outer(b), outer(c), outer(a + b + c)];
            square = std::array::from_fn(|k| area / 12.0 * (parts[0][k] + parts[1][k] + parts[2][k] + parts[3][k]));
        }
        Moments { area, normal: area * self.normals[f], centre: area * (centroid(corners) - self.centre), square }
    }

    /// The best proxy for these sums, and its error.
    pub(super) fn fit(&self, sums: &Moments) -> (Proxy, f64) {
        let centre = if sums.area > 0.0 { sums.centre / sums.area } else { DVec3::ZERO };
        let mean_normal = sums.normal.normalize_or(DVec3::Z);
        match self.metric {
            Metric::L21 => {
                let error = 2.0 * (sums.area - sums.normal.length()).max(0.0);
                (Proxy { point: self.centre + centre, normal: mean_normal }, error)
            }
            Metric::L2 => {
                let mean = outer(centre);
                let covariance = std::array::from_fn(|k| sums.square[k] - sums.area * mean[k]);
                let (error, normal) = symmetric_eigen(&covariance)[0];
                let normal = if normal.dot(mean_normal) < 0.0 { -normal } else { normal };
                (Proxy { point: self.centre + centre, normal }, error.max(0.0))
            }
        }
    }
}
