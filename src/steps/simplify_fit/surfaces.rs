//! Spheres and cylinders under the vertices: which were there before the first edit, trial fits of neighbourhoods where
//! none was, and which vertex lies on which.

use glam::DVec3;
use smallvec::SmallVec;

use crate::mesh::geometry::{angle, area_vector, centroid};
use crate::mesh::halfedge::{HalfedgeMesh, edge_of, twin};
use crate::mesh::{FaceId, Freedom, VertexId};
use crate::technique::fit::regions::{ENOUGH_POINTS, LEAST_OPENING, MOST_TILT, is_certain};
use crate::technique::fit::{FitQuality, FitRegion, Quadric, fit_cylinder, fit_sphere};

/// Corners of a region that was there before the first edit lie no further off its fit than this share of the
/// tolerance: those of a tessellation lie on it but for rounding. With room for noise, a fit would take a part of its
/// neighbour.
pub(super) const EXACT: f64 = 0.002_5;

/// A merged vertex comes from a fit while it lies no further off than this share of the tolerance.
const NEAR: f64 = 0.25;

/// Neighbouring faces whose normals differ by more than this many radians, 50 degrees, are no smooth continuation.
const SMOOTH: f64 = 0.873;

/// Faces of a neighbourhood at most.
const MOST_FACES: usize = 160;

/// How often a neighbourhood is widened.
const MOST_WIDENINGS: usize = 4;

const NONE: u32 = u32::MAX;

/// A kind of fit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Sphere,
    Cylinder,
}

/// The faces and vertices of a trial.
#[derive(Debug, Default)]
struct Patch {
    faces: Vec<FaceId>,
    vertices: Vec<VertexId>,
    points: Vec<DVec3>,
    vectors: Vec<DVec3>,
}

/// Numbers of fits.
pub(super) type Origins = SmallVec<[u32; 2]>;

/// Fits, and the vertices on them.
#[derive(Debug)]
pub(super) struct Surfaces {
    fits: Vec<Quadric>,
    /// The fit that a vertex lies on, to rounding.
    of_vertex: Vec<u32>,
    /// The fits of the part that a vertex comes from and lies near.
    origins: Vec<Origins>,
    /// Vertices that were moved and are on no fit: they say nothing of the surface that was there.
    moved: Vec<bool>,
    patch: Patch,
    tolerance: f64,
    pub(super) tried: [usize; 2],
    pub(super) accepted: [usize; 2],
}

impl Surfaces {
    pub(super) fn new(vertex_slots: usize, tolerance: f64) -> Self {
        Self {
            fits: Vec::new(),
            of_vertex: vec![NONE; vertex_slots],
            origins: vec![Origins::new(); vertex_slots],
            moved: vec![false; vertex_slots],
            patch: Patch::default(),
            tolerance,
            tried: [0; 2],
            accepted: [0; 2],
        }
    }

    /// Takes in the regions of the part, before the first edit.
    pub(super) fn know(&mut self, mesh: &HalfedgeMesh, regions: &[FitRegion]) {
        for region in regions {
            let number = self.fits.len() as u32;
            self.fits.push(region.quadric);
            for v in region.faces.iter().flat_map(|&f| mesh.corners(f)) {
                let origins = &mut self.origins[v.index()];
                if origins.last() != Some(&number) {
                    origins.push(number);
                }
            }
        }
    }

    /// The fits that some vertex of these comes from, and all of them lie near.
    pub(super) fn common(&self, mesh: &HalfedgeMesh, vertices: &[VertexId]) -> Origins {
        let mut common = Origins::new();
        for &fit in vertices.iter().filter_map(|v| self.origins.get(v.index())).flatten() {
            if !common.contains(&fit) && vertices.iter().all(|&v| self.is_near(fit, mesh.point(v))) {
                common.push(fit);
            }
        }
        common
    }

    fn is_near(&self, fit: u32, p: DVec3) -> bool {
        self.fits[fit as usize].distance(p).abs() <= NEAR * self.tolerance
    }

    /// Says that a vertex came to `at` out of others that come from `origins`; it comes from those that it lies near.
    pub(super) fn come_from(&mut self, v: VertexId, at: DVec3, mut origins: Origins) {
        self.reach(v);
        origins.retain(|fit| self.is_near(*fit, at));
        self.origins[v.index()] = origins;
    }

    /// The fits that some vertices come from.
    pub(super) fn origins(&self, vertices: &[VertexId]) -> Origins {
        let mut all: Origins = vertices.iter().filter_map(|v| self.origins.get(v.index())).flatten().copied().collect();
        all.sort_unstable();
        all.dedup();
        all
    }

    pub(super) fn quadric(&self, fit: u32) -> Quadric {
        self.fits[fit as usize]
    }

    /// The fit that a vertex lies on.
    pub(super) fn of(&self, v: VertexId) -> Option<&Quadric> {
        self.fits.get(*self.of_vertex.get(v.index())? as usize)
    }

    /// Takes in the fit of a trial, and gives its number.
    pub(super) fn add(&mut self, quadric: Quadric) -> u32 {
        self.fits.push(quadric);
        self.fits.len() as u32 - 1
    }

    /// Says that the vertex was put on a fit.
    pub(super) fn accept(&mut self, v: VertexId, fit: u32) {
        let kind = match self.quadric(fit) {
            Quadric::Sphere(_) => Kind::Sphere,
            Quadric::Cylinder(_) => Kind::Cylinder,
        };
        self.accepted[kind as usize] += 1;
        self.carry(v, Some(fit), false);
    }

    fn reach(&mut self, v: VertexId) {
        if v.index() >= self.of_vertex.len() {
            self.of_vertex.resize(v.index() + 1, NONE);
            self.origins.resize(v.index() + 1, Origins::new());
            self.moved.resize(v.index() + 1, false);
        }
    }

    /// Says that the vertex stayed on the fit of one whose place it took, or is on none; and whether it was moved.
    pub(super) fn carry(&mut self, v: VertexId, fit: Option<u32>, moved: bool) {
        self.reach(v);
        self.of_vertex[v.index()] = fit.unwrap_or(NONE);
        self.moved[v.index()] = moved;
    }

    /// Whether the vertex was moved and is on no fit.
    pub(super) fn was_moved(&self, v: VertexId) -> bool {
        self.moved.get(v.index()).copied().unwrap_or(false)
    }

    /// The number of the fit that a vertex lies on.
    pub(super) fn number(&self, v: VertexId) -> Option<u32> {
        self.of_vertex.get(v.index()).copied().filter(|&fit| fit != NONE)
    }

    /// Whether a point lies on a fit, up to rounding.
    pub(super) fn holds(&self, fit: u32, p: DVec3) -> bool {
        self.fits.get(fit as usize).is_some_and(|fit| fit.distance(p).abs() <= 1e-9 * fit.radius())
    }

    /// A fit to the neighbourhood of some vertices that is as good as an accepted one must be.
    pub(super) fn trial(&mut self, mesh: &HalfedgeMesh, ends: &[VertexId], kind: Kind) -> Option<Quadric> {
        self.tried[kind as usize] += 1;
        self.patch.first_ring(mesh, ends, &self.moved);
        let mut widened = 0;
        loop {
            let patch = &self.patch;
            let fit = match kind {
                _ if patch.points.len() < ENOUGH_POINTS => None,
                Kind::Sphere => fit_sphere(&patch.points).ok().map(|(s, q)| (Quadric::Sphere(s), q)),
                Kind::Cylinder => {
                    fit_cylinder(&patch.points, &patch.vectors).ok().map(|(c, q)| (Quadric::Cylinder(c), q))
                }
            };
            match fit {
                Some((quadric, quality)) if quality.opening >= LEAST_OPENING => {
                    return (self.is_good(&quadric, &quality) && self.is_radial(mesh, &quadric)).then_some(quadric);
                }
                _ if widened == MOST_WIDENINGS => return None,
                _ => {
                    widened += 1;
                    let before = self.patch.faces.len();
                    self.patch.widen(mesh, &self.moved);
                    if self.patch.faces.len() == before {
                        return None;
                    }
                }
            }
        }
    }

    fn is_good(&self, quadric: &Quadric, quality: &FitQuality) -> bool {
        quality.rms <= 0.5 * self.tolerance && is_certain(quadric, quality)
    }

    /// Whether the faces' normals point along the fit's, all to one side.
    fn is_radial(&self, mesh: &HalfedgeMesh, quadric: &Quadric) -> bool {
        let (mut out, mut inwards, mut total) = (0.0, 0.0, 0.0);
        for (&f, vector) in self.patch.faces.iter().zip(&self.patch.vectors) {
            let Some(normal) = quadric.normal(centroid(mesh.corner_points(f))) else { return false };
            let area = vector.length();
            let tilt = angle(normal, *vector);
            out += area * tilt;
            inwards += area * (std::f64::consts::PI - tilt);
            total += area;
        }
        f64::min(out, inwards) <= MOST_TILT * total
    }
}

impl Patch {
    /// The faces round some vertices, without those behind a curve.
    fn first_ring(&mut self, mesh: &HalfedgeMesh, ends: &[VertexId], moved: &[bool]) {
        self.faces.clear();
        for &v in ends {
            for f in mesh.faces_around(v) {
                if !self.faces.contains(&f) && self.faces.len() < MOST_FACES {
                    self.faces.push(f);
                }
            }
        }
        self.gather(mesh, moved);
    }

    /// Adds the faces round all vertices, as far as the surface goes on smoothly and no curve is crossed.
    fn widen(&mut self, mesh: &HalfedgeMesh, moved: &[bool]) {
        let mut at = 0;
        let inner = self.vertices.clone();
        while at < self.faces.len() {
            let f = self.faces[at];
            at += 1;
            let own = area_vector(mesh.corner_points(f));
            let first = mesh.face_halfedge(f);
            for h in [first, mesh.next(first), mesh.prev(first)] {
                let Some(g) = mesh.face(twin(h)) else { continue };
                let touches = mesh.corners(g).iter().any(|v| inner.contains(v));
                let crosses = mesh.edge_freedom(edge_of(h)) != Freedom::Free;
                if crosses || !touches || self.faces.len() >= MOST_FACES || self.faces.contains(&g) {
                    continue;
                }
                if angle(own, area_vector(mesh.corner_points(g))) <= SMOOTH {
                    self.faces.push(g);
                }
            }
        }
        self.gather(mesh, moved);
    }

    fn gather(&mut self, mesh: &HalfedgeMesh, moved: &[bool]) {
        let mut vertices: SmallVec<[VertexId; 64]> = self.faces.iter().flat_map(|&f| mesh.corners(f)).collect();
        vertices.sort_unstable();
        vertices.dedup();
        self.vertices.clear();
        self.vertices.extend_from_slice(&vertices);
        self.points.clear();
        let told = vertices.iter().filter(|v| !moved.get(v.index()).copied().unwrap_or(false));
        self.points.extend(told.map(|&v| mesh.point(v)));
        self.vectors.clear();
        self.vectors.extend(self.faces.iter().map(|&f| area_vector(mesh.corner_points(f))));
    }
}
