//! The spheres and cylinders that a surface consists of, each with its faces.
//!
//! A tessellation tells its fillets best before anything is edited: whole strips of vertices lie exactly on them. So
//! regions are grown from seeds over the whole part. The candidates of a seed are the cylinder through two neighbouring
//! facets, whose planes both hold the direction of the axis, which finds strips of a few long facets, and the cylinder
//! and the sphere through a neighbourhood, which finds fine and uneven triangles. A candidate takes in faces over
//! unmarked edges while their corners lie on it and their normals point along its own, and is fitted anew to all of
//! them; that candidate which takes in the most faces is the region.
//!
//! Growing from seeds with verification: R. Schnabel, R. Wahl, R. Klein, *Efficient RANSAC for point-cloud shape
//! detection*, Computer Graphics Forum 2007, with all seeds in the order of the faces in place of random ones.
//!
//! Invariants: a face is in one region at most; the corners of a region's faces lie within `near` of its fit; every fit
//! sees an arc of [`LEAST_OPENING`] to both sides, and its radius is certain to [`MOST_DEVIATION`].
//! Cost: linear in the faces, times the size of a neighbourhood where the surface turns.

use glam::DVec3;

use super::cylinder::cylinder_along;
use super::{FitQuality, Quadric, fit_cylinder, fit_sphere};
use crate::mesh::geometry::{angle, area_vector, centroid};
use crate::mesh::halfedge::{HalfedgeMesh, edge_of, twin};
use crate::mesh::{FaceId, Freedom, HalfedgeId, VertexId};
use crate::watch::{Cancelled, Watch};

/// The least half opening of a fit, in radians: 15 degrees, an arc of 30.
pub const LEAST_OPENING: f64 = 0.262;

/// The largest share of the radius by which it may be uncertain: one standard deviation, so that hardly a radius is
/// off by a hundredth.
pub const MOST_DEVIATION: f64 = 0.004;

/// The largest angle in radians between the normal of a face and that of its fit: 20 degrees.
pub const MOST_TILT: f64 = 0.35;

/// The least number of points that can bear witness to a fit.
pub const ENOUGH_POINTS: usize = 8;

/// Corners lie no further off a fit than this share of its radius.
const NEAREST: f64 = 0.01;

/// Two facets that turn less, in radians, half a degree, tell no axis.
const LEAST_BEND: f64 = 0.009;

/// A neighbourhood is widened until normals turn by this angle in radians, 15 degrees, or until it has so many faces.
const SPREAD: f64 = 0.262;

/// A face that so many refused candidates took in is no seed: else a large area that is nearly a fit would be grown
/// over again from each of its faces.
const MOST_VAIN: u8 = 8;

/// A neighbourhood has no more faces than these, and so many round a seed in vain are no seeds.
const MOST_FACES: usize = 32;
const MOST_PASSED: usize = 8;

/// Fits to a region, each to what the one before took in.
const MOST_FITS: usize = 3;

/// Faces that a fit to a region looks at, at most, evenly out of all.
const MOST_FITTED: usize = 48;

const NONE: u32 = u32::MAX;

/// A part of the surface that lies on one sphere or cylinder.
#[derive(Clone, Debug, PartialEq)]
pub struct FitRegion {
    /// What it lies on.
    pub quadric: Quadric,
    /// The faces, in ascending order.
    pub faces: Vec<FaceId>,
}

/// Which kinds of regions are looked for, and how exact they must be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wanted {
    /// Whether spheres are.
    pub spheres: bool,
    /// Whether cylinders are.
    pub cylinders: bool,
    /// The largest distance of a corner from its fit, in mesh units; a hundredth of the radius is the limit beside it.
    pub near: f64,
}

/// Finds the regions, in the order of their first seeds.
///
/// # Errors
/// [`Cancelled`] only.
pub fn fit_regions(mesh: &HalfedgeMesh, wanted: Wanted, watch: &Watch) -> Result<Vec<FitRegion>, Cancelled> {
    let slots = mesh.face_slots();
    let mut finder = Finder {
        mesh,
        wanted,
        of_face: vec![NONE; slots],
        vain: vec![0; slots],
        stamp: vec![0; slots],
        round: 0,
        found: Vec::new(),
    };
    watch.phase("recognise fillets", Some(slots as u64));
    for (place, f) in mesh.faces().enumerate() {
        if place.is_multiple_of(1024) {
            watch.check()?;
            watch.advance(place as u64, || format!("{} found", finder.found.len()));
        }
        if finder.of_face[f.index()] == NONE && finder.vain[f.index()] < MOST_VAIN {
            finder.seed(f);
        }
    }
    Ok(finder.found)
}

struct Finder<'a> {
    mesh: &'a HalfedgeMesh,
    wanted: Wanted,
    of_face: Vec<u32>,
    /// How often a candidate took a face in and was refused; seeds that came to nothing have the most.
    vain: Vec<u8>,
    stamp: Vec<u32>,
    round: u32,
    found: Vec<FitRegion>,
}

impl Finder<'_> {
    /// The best region that holds a face.
    fn seed(&mut self, f: FaceId) {
        let near = self.neighbourhood(f);
        let mut best: Option<FitRegion> = None;
        for candidate in self.candidates(f, &near) {
            let Some(region) = self.region(f, candidate) else { continue };
            if best.as_ref().is_none_or(|best| best.faces.len() < region.faces.len()) {
                best = Some(region);
            }
        }
        match best {
            Some(region) => {
                for &f in &region.faces {
                    self.of_face[f.index()] = self.found.len() as u32;
                }
                self.found.push(region);
            }
            None => self.pass_over(&near),
        }
    }

    fn candidates(&self, f: FaceId, near: &[FaceId]) -> Vec<Quadric> {
        let mut candidates = Vec::new();
        if self.wanted.cylinders {
            candidates.extend(self.through_facets(f));
        }
        let vectors: Vec<DVec3> = near.iter().map(|&g| self.vector(g)).collect();
        let own = self.vector(f);
        let widest = vectors.iter().map(|&v| angle(own, v)).fold(0.0, f64::max);
        if widest < 0.5 * SPREAD {
            return candidates;
        }
        let points = self.points(near);
        if self.wanted.cylinders {
            candidates.extend(fit_cylinder(&points, &vectors).ok().map(|(c, _)| Quadric::Cylinder(c)));
        }
        if self.wanted.spheres {
            candidates.extend(fit_sphere(&points).ok().map(|(s, _)| Quadric::Sphere(s)));
        }
        candidates
    }

    /// The cylinder through a face and that neighbour which turns most from it.
    fn through_facets(&self, f: FaceId) -> Option<Quadric> {
        let n = self.vector(f).try_normalize()?;
        let bends = self.sides(f).into_iter().filter_map(|h| {
            let g = self.over(h)?;
            Some((n.cross(self.vector(g).try_normalize()?), g))
        });
        let (across, g) = bends.max_by(|a, b| a.0.length_squared().total_cmp(&b.0.length_squared()))?;
        (across.length() >= LEAST_BEND).then_some(())?;
        cylinder_along(&self.points(&[f, g]), across.normalize()).ok().map(Quadric::Cylinder)
    }

    /// What a candidate takes in, fitted anew until that stays; `None` where it is no fit to rely on.
    fn region(&mut self, f: FaceId, mut quadric: Quadric) -> Option<FitRegion> {
        let mut faces = self.grow(f, &quadric);
        let mut quality = None;
        for _ in 0..MOST_FITS {
            // Two faces and their neighbours are what a candidate is made of.
            if faces.len() < 4 {
                return None;
            }
            let (better, figures) = self.fit(&faces, &quadric)?;
            let next = self.grow(f, &better);
            let is_settled = next.len() == faces.len();
            (quadric, quality, faces) = (better, Some(figures), next);
            if is_settled {
                break;
            }
        }
        let is_good = quality.is_some_and(|q| is_certain(&quadric, &q) && q.points >= ENOUGH_POINTS);
        if !is_good || faces.len() < 4 {
            for &f in &faces {
                let vain = &mut self.vain[f.index()];
                *vain = vain.saturating_add(1);
            }
            return None;
        }
        faces.sort_unstable();
        Some(FitRegion { quadric, faces })
    }

    fn fit(&self, faces: &[FaceId], like: &Quadric) -> Option<(Quadric, FitQuality)> {
        let step = faces.len().div_ceil(MOST_FITTED).max(1);
        let faces: Vec<FaceId> = faces.iter().copied().step_by(step).collect();
        let points = self.points(&faces);
        match like {
            Quadric::Sphere(_) => fit_sphere(&points).ok().map(|(s, q)| (Quadric::Sphere(s), q)),
            Quadric::Cylinder(_) => {
                let vectors: Vec<DVec3> = faces.iter().map(|&g| self.vector(g)).collect();
                fit_cylinder(&points, &vectors).ok().map(|(c, q)| (Quadric::Cylinder(c), q))
            }
        }
    }

    /// The faces that lie on a quadric, from one on over unmarked edges.
    fn grow(&mut self, f: FaceId, quadric: &Quadric) -> Vec<FaceId> {
        let near = f64::min(self.wanted.near, NEAREST * quadric.radius());
        let Some(outward) = quadric.normal(centroid(self.mesh.corner_points(f))) else { return Vec::new() };
        let sign = if outward.dot(self.vector(f)) < 0.0 { -1.0 } else { 1.0 };
        let lies_on = |g: FaceId| {
            let corners = self.mesh.corner_points(g);
            let tilt = quadric.normal(centroid(corners)).map(|n| angle(sign * n, area_vector(corners)));
            tilt.is_some_and(|tilt| tilt <= MOST_TILT) && corners.iter().all(|&p| quadric.distance(p).abs() <= near)
        };
        let mut faces = Vec::new();
        if !lies_on(f) {
            return faces;
        }
        self.round += 1;
        self.stamp[f.index()] = self.round;
        faces.push(f);
        let mut at = 0;
        while at < faces.len() {
            for h in self.sides(faces[at]) {
                let Some(g) = self.over(h) else { continue };
                if self.stamp[g.index()] != self.round && self.of_face[g.index()] == NONE && lies_on(g) {
                    self.stamp[g.index()] = self.round;
                    faces.push(g);
                }
            }
            at += 1;
        }
        faces
    }

    /// The faces round a face, ring by ring over unmarked edges, until their normals spread.
    fn neighbourhood(&mut self, f: FaceId) -> Vec<FaceId> {
        self.round += 1;
        self.stamp[f.index()] = self.round;
        let own = self.vector(f);
        let mut faces = vec![f];
        let (mut at, mut ring) = (0, 1);
        while at < faces.len() && faces.len() < MOST_FACES {
            for h in self.sides(faces[at]) {
                let Some(g) = self.over(h) else { continue };
                if self.stamp[g.index()] != self.round {
                    self.stamp[g.index()] = self.round;
                    faces.push(g);
                }
            }
            at += 1;
            if at == ring {
                ring = faces.len();
                let spread = faces.iter().map(|&g| angle(own, self.vector(g))).fold(0.0, f64::max);
                if spread >= SPREAD && faces.len() >= ENOUGH_POINTS {
                    break;
                }
            }
        }
        faces
    }

    /// What lies round a face in vain is hardly a better seed.
    fn pass_over(&mut self, near: &[FaceId]) {
        for g in near.iter().take(MOST_PASSED) {
            self.vain[g.index()] = MOST_VAIN;
        }
    }

    fn sides(&self, f: FaceId) -> [HalfedgeId; 3] {
        let h = self.mesh.face_halfedge(f);
        [h, self.mesh.next(h), self.mesh.prev(h)]
    }

    /// The face over an unmarked side.
    fn over(&self, h: HalfedgeId) -> Option<FaceId> {
        let is_free = self.mesh.edge_freedom(edge_of(h)) == Freedom::Free;
        self.mesh.face(twin(h)).filter(|_| is_free)
    }

    fn vector(&self, f: FaceId) -> DVec3 {
        area_vector(self.mesh.corner_points(f))
    }

    fn points(&self, faces: &[FaceId]) -> Vec<DVec3> {
        let mut vertices: Vec<VertexId> = faces.iter().flat_map(|&f| self.mesh.corners(f)).collect();
        vertices.sort_unstable();
        vertices.dedup();
        vertices.into_iter().map(|v| self.mesh.point(v)).collect()
    }
}

/// Whether a fit sees enough of its surface, and knows its radius.
pub fn is_certain(quadric: &Quadric, quality: &FitQuality) -> bool {
    quality.opening >= LEAST_OPENING && quality.radius_deviation <= MOST_DEVIATION * quadric.radius()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::halfedge::tests::{enter, surface};

    /// A strip of needles round an arc of a cylinder, as a file of single precision has it.
    fn strip(radius: f64, length: f64, facets: usize, degrees: f64) -> HalfedgeMesh {
        let (mut points, mut faces) = (Vec::new(), Vec::new());
        for i in 0..=facets {
            let (sin, cos) = libm::sincos((degrees * i as f64 / facets as f64).to_radians());
            for z in [2.0, 2.0 + length] {
                points.push([13.1 + radius * cos, 5.1 + radius * sin, z].map(|x| f64::from(x as f32)));
            }
            if i > 0 {
                let k = 2 * i as u32;
                faces.extend([[k - 2, k, k - 1], [k, k + 1, k - 1]]);
            }
        }
        enter(&surface(&points, &faces))
    }

    #[test]
    fn a_strip_of_needles_is_a_cylinder() {
        for (length, facets) in [(22.1, 11), (1.0, 11), (5.0, 4), (100.0, 20)] {
            let mesh = strip(1.4, length, facets, 90.0);
            let wanted = Wanted { spheres: true, cylinders: true, near: 0.01 };
            let found = fit_regions(&mesh, wanted, &Watch::silent()).unwrap();
            assert_eq!(found.len(), 1, "{length} {facets}");
            assert_eq!(found[0].faces.len(), 2 * facets);
            assert!(matches!(found[0].quadric, Quadric::Cylinder(c) if (c.radius - 1.4).abs() < 1e-4), "{found:?}");
        }
    }

    #[test]
    fn a_plane_or_three_facets_bear_no_witness() {
        let wanted = Wanted { spheres: true, cylinders: true, near: 0.01 };
        for mesh in [strip(1e6, 1.0, 20, 1e-4), strip(1.4, 5.0, 2, 90.0)] {
            assert_eq!(fit_regions(&mesh, wanted, &Watch::silent()).unwrap(), []);
        }
    }

    #[test]
    fn only_the_kinds_that_are_wanted_are_found() {
        let mesh = strip(1.4, 5.0, 12, 90.0);
        let wanted = Wanted { spheres: true, cylinders: false, near: 0.01 };
        assert_eq!(fit_regions(&mesh, wanted, &Watch::silent()).unwrap(), []);
    }
}
