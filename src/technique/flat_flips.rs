//! Flips of edges between faces of one plane, which make faces better and leave the surface as it is.
//!
//! Marked and grouped edges and borders of groups and regions stay; faces keep their numbers. The sides of a
//! quadrilateral are looked at again after its flip, so a measure that each flip raises ends it. O((F + flips) log F).

use std::collections::BTreeSet;

use glam::DVec3;

use crate::mesh::edit::{FlipPlan, check_flip, flip};
use crate::mesh::geometry::{area_vector, stretch};
use crate::mesh::halfedge::{EnterError, edge_of, halfedge_of, twin};
use crate::mesh::{EdgeId, FaceId, FreedomError, HalfedgeMesh, LockRules, Surface, VertexId, resolve_freedom};

/// Two faces count as one plane if their quadrilateral, cut either way, differs in area by less than this share: the
/// share is half the square of the angle between them, so this is a thousandth of a degree.
const FLAT: f64 = 1e-10;
/// A flip must raise the worse face by this factor, so that rounding never flips back and forth.
const GAIN: f64 = 1.0 + 1e-6;

/// Why no edge can be flipped.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FlipError {
    /// It is no surface.
    #[error(transparent)]
    NotASurface(#[from] EnterError),
    /// Its groups contradict each other.
    #[error(transparent)]
    Freedom(#[from] FreedomError),
}

/// Two faces whose common edge may become the other diagonal of their quadrilateral.
#[derive(Clone, Copy, Debug)]
pub struct Pair {
    /// The faces, which keep their numbers.
    pub faces: [FaceId; 2],
    /// Their corners after the flip.
    pub new: [[VertexId; 3]; 2],
    /// The corners on the edge now, then those that the flip joins.
    pub corners: [DVec3; 4],
}

impl Pair {
    fn new(mesh: &HalfedgeMesh, plan: &FlipPlan) -> Option<Self> {
        let h = halfedge_of(plan.edge);
        let faces = [mesh.face(h)?, mesh.face(twin(h))?];
        let ([i, j], [c, d]) = (plan.ends, plan.apexes);
        Some(Self { faces, new: plan.new_faces(), corners: [i, j, c, d].map(|v| mesh.point(v)) })
    }

    /// The faces as they are.
    pub fn before(&self) -> [[DVec3; 3]; 2] {
        let [i, j, c, d] = self.corners;
        [[i, j, c], [j, i, d]]
    }

    /// The faces as they would be.
    pub fn after(&self) -> [[DVec3; 3]; 2] {
        let [i, j, c, d] = self.corners;
        [[d, c, i], [c, d, j]]
    }

    /// Twice the area of the quadrilateral, along its normal.
    pub fn area_vector(&self) -> DVec3 {
        self.before().into_iter().map(area_vector).sum()
    }

    /// Whether both diagonals make the same flat quadrilateral, up to a thousandth of a degree.
    fn is_flat(&self) -> bool {
        let area = |faces: [[DVec3; 3]; 2]| faces.into_iter().map(|f| area_vector(f).length()).sum::<f64>();
        let whole = self.area_vector().length();
        whole > 0.0 && area(self.before()) <= (1.0 + FLAT) * whole && area(self.after()) <= (1.0 + FLAT) * whole
    }
}

/// Whether a measure of the worse face rises.
pub fn raises(pair: &Pair, measure: impl Fn([DVec3; 3]) -> f64) -> bool {
    let worst = |faces: [[DVec3; 3]; 2]| faces.into_iter().map(&measure).fold(f64::INFINITY, f64::min);
    worst(pair.after()) > GAIN * worst(pair.before())
}

/// Flips edges of flat pairs of faces at the vertices from number `first` on while the worse face gets better in
/// stretch. Returns how many were flipped.
///
/// # Errors
/// See [`FlipError`].
pub fn flip_beside(surface: &mut Surface, first: usize) -> Result<usize, FlipError> {
    let gains = |pair: &Pair| pair.is_flat() && raises(pair, stretch);
    flip_where(surface, &LockRules::default(), first, gains)
}

/// Flips the edges at vertices from number `first` on for which `gains` says so. Returns how many were flipped.
///
/// # Errors
/// See [`FlipError`].
pub fn flip_where(
    surface: &mut Surface,
    locks: &LockRules<'_>,
    first: usize,
    mut gains: impl FnMut(&Pair) -> bool,
) -> Result<usize, FlipError> {
    let freedom = resolve_freedom(surface, locks)?;
    let mut mesh = HalfedgeMesh::new(surface, &freedom)?;
    let is_beside = |mesh: &HalfedgeMesh, e: EdgeId| {
        let apexes = check_flip(mesh, e).map_or([None; 2], |plan| plan.apexes.map(Some));
        mesh.ends(e).into_iter().map(Some).chain(apexes).flatten().any(|v| v.index() >= first)
    };
    let mut waiting: BTreeSet<EdgeId> = mesh.edges().filter(|&e| is_beside(&mesh, e)).collect();
    let mut flips = 0;
    while let Some(e) = waiting.pop_first() {
        let Ok(plan) = check_flip(&mesh, e) else { continue };
        if Pair::new(&mesh, &plan).is_some_and(|pair| gains(&pair)) {
            flip(&mut mesh, &plan);
            flips += 1;
            let h = halfedge_of(e);
            let sides = [h, twin(h)].into_iter().flat_map(|h| [mesh.next(h), mesh.prev(h)]);
            waiting.extend(sides.map(edge_of).filter(|&f| is_beside(&mesh, f)));
        }
    }
    for f in surface.faces.ids() {
        surface.faces[f] = mesh.corners(f);
    }
    Ok(flips)
}
