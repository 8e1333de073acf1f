//! Flip of an edge: the other diagonal of its two faces.

use glam::DVec3;

use super::gain::Gain;
use super::keeper::Keeper;
use super::mesh::GuardedMesh;
use super::normals::LEAST_TURN_COSINE;
use super::refused::Refused;
use crate::mesh::edit::{check_flip, flip};
use crate::mesh::geometry::area_vector;
use crate::mesh::halfedge::{halfedge_of, twin};
use crate::mesh::{EdgeId, FaceId, VertexId};

/// Without a certified distance, an edge is flipped only where its faces differ by less than 5 degrees.
const FLAT_COSINE: f64 = 0.996;

/// How far faces that count as one plane may be off it, as a part of the tolerance.
const FLAT: f64 = 1e-6;

impl GuardedMesh<'_> {
    /// Flips the edge where all tests admit it and it gains.
    ///
    /// # Errors
    /// The first test that refuses it; nothing is done then.
    pub fn flip(&mut self, edge: EdgeId, gain: Gain) -> Result<(), Refused> {
        let plan = check_flip(&self.mesh, edge)?;
        let h = halfedge_of(edge);
        let (Some(left), Some(right)) = (self.mesh.face(h), self.mesh.face(twin(h))) else {
            return Err(Refused::Topology);
        };
        if !self.flip_keeps_valence(plan.ends, plan.apexes, gain) {
            return Err(Refused::Valence);
        }
        let before = self.tally(&[left, right], gain);
        self.patch.clear();
        for (face, corners) in [left, right].into_iter().zip(plan.new_faces()) {
            let points = corners.map(|v| self.mesh.point(v));
            self.patch.change(face, points);
        }
        self.patch.is_same = self.is_plane(left, right);
        let normals = [left, right].map(|f| area_vector(self.mesh.corner_points(f)));
        let flat = normals[0].dot(normals[1]) >= FLAT_COSINE * (normals[0].length() * normals[1].length());
        if !(flat || self.keeper.is_certified()) {
            return Err(Refused::Tolerance);
        }
        self.gains(&before, gain)?;
        if self.flip_folds(normals) {
            return Err(Refused::FoldOver);
        }
        self.admit_patch()?;
        flip(&mut self.mesh, &plan);
        self.counts.flips += 1;
        self.settle();
        Ok(())
    }

    /// Valences move towards 6, or at least no apex gets more edges than allowed.
    fn flip_keeps_valence(&self, ends: [VertexId; 2], apexes: [VertexId; 2], gain: Gain) -> bool {
        let valence = |v: VertexId| self.mesh.valence(v) as i64;
        let least = |v: VertexId| if self.mesh.is_boundary_vertex(v) { 2 } else { 3 };
        if ends.iter().any(|&v| valence(v) <= least(v)) {
            return false;
        }
        let most = |v: VertexId| self.most_edges(v) as i64;
        let tallest = ends.map(valence).into_iter().max().unwrap_or(0);
        let is_worth_it = match gain {
            Gain::Mend(_) | Gain::LeastStretch | Gain::LeastAngle => true,
            Gain::Quality | Gain::Mean(_) | Gain::Keep(_) | Gain::None => false,
        };
        let may_be_taller = |v: VertexId| is_worth_it && self.mesh.seam(v).is_none() && valence(v) < tallest;
        apexes.iter().all(|&v| valence(v) < most(v) || may_be_taller(v))
    }

    /// Whether two faces lie in one plane, by far nearer than the tolerance: then a flip that does not fold leaves the
    /// surface as it is, as a set of points.
    pub fn is_plane(&self, left: FaceId, right: FaceId) -> bool {
        let Keeper::Distance { envelope, .. } = &self.keeper else { return false };
        let (near, faces) = (FLAT * envelope.reach(), [left, right].map(|f| self.mesh.corner_points(f)));
        let vectors = faces.map(area_vector);
        let large = usize::from(vectors[1].length_squared() > vectors[0].length_squared());
        let Some(normal) = vectors[large].try_normalize() else { return false };
        faces[1 - large].iter().all(|&p| normal.dot(p - faces[large][0]).abs() <= near)
    }

    /// Whether a new face of a flip turns away from both old ones.
    fn flip_folds(&self, old: [DVec3; 2]) -> bool {
        let sum = old[0].normalize_or_zero() + old[1].normalize_or_zero();
        self.patch.points.iter().any(|points| {
            let normal = area_vector(*points);
            let cosine = |m: DVec3| normal.dot(m) / (normal.length() * m.length()).max(f64::MIN_POSITIVE);
            cosine(sum) < LEAST_TURN_COSINE
        })
    }
}
