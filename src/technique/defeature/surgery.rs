//! Taking cavities out of a surface, one after the other, each under the same guards.

use std::collections::BTreeSet;

use glam::DVec3;
use rustc_hash::FxHashSet;

use super::cavity::Cavity;
use super::fill::Fill;
use super::patches::Patches;
use super::{Reason, Removed};
use crate::mesh::bvh::TriangleBvh;
use crate::mesh::geometry::Aabb;
use crate::mesh::id::{Face, Vertex};
use crate::mesh::topology::VertexFaces;
use crate::mesh::{EdgeKey, FaceId, Freedom, FreedomError, IdVec, LockRules, MarkCause, Rim, Surface, VertexId};
use crate::mesh::{edge_key, resolve_freedom};
use crate::watch::{Cancelled, Watch};

/// One round on one surface.
pub(super) struct Surgery<'a> {
    surface: &'a Surface,
    patches: &'a Patches,
    fans: VertexFaces,
    pub(super) tree: TriangleBvh,
    freedom: IdVec<Vertex, Freedom>,
    pub(super) goes: IdVec<Face, bool>,
    pub(super) fills: Vec<Fill>,
    /// The triangles of each fill.
    filled: Vec<Filled>,
    /// Their edges between rim vertices.
    taken: FxHashSet<EdgeKey>,
}

impl<'a> Surgery<'a> {
    pub(super) fn new(surface: &'a Surface, patches: &'a Patches, locks: &LockRules<'_>) -> Result<Self, FreedomError> {
        Ok(Self {
            surface,
            patches,
            fans: VertexFaces::new(surface),
            tree: TriangleBvh::of_surface(surface),
            freedom: locked(surface, locks)?,
            goes: IdVec::filled(false, surface.faces.len()),
            fills: Vec::new(),
            filled: Vec::new(),
            taken: FxHashSet::default(),
        })
    }

    /// Takes a cavity out and fills its rims, or says why not.
    pub(super) fn remove(
        &mut self,
        cavity: &Cavity,
        mean_size: f64,
        watch: &Watch,
    ) -> Result<Result<Removed, Reason>, Cancelled> {
        let faces: Vec<FaceId> =
            cavity.patches.iter().flat_map(|&p| &self.patches.all[p as usize].faces).copied().collect();
        let is_held = |v: &VertexId| self.freedom[*v] != Freedom::Free;
        if faces.iter().flat_map(|&f| &self.surface.faces[f]).any(is_held) {
            return Ok(Err(Reason::Locked));
        }
        let goes: FxHashSet<FaceId> = faces.iter().copied().collect();
        let mut fills: Vec<Fill> = Vec::new();
        for &(patch, rim) in &cavity.rims {
            let Some(coarse) = self.coarse(patch, rim, &goes, &fills) else { return Ok(Err(Reason::NoFill)) };
            let own: Vec<Filled> = fills.iter().map(|fill| Filled::new(fill.corners(self.surface))).collect();
            let is_harmless = |fill: &Fill| !self.meets(fill, &goes, &own);
            let fine = coarse.improved(self.surface, mean_size, watch)?;
            let Some(fill) = fine.into_iter().chain([coarse]).find(is_harmless) else {
                return Ok(Err(Reason::Obstructed));
            };
            fills.push(fill);
        }
        let rims = cavity.rims.iter().map(|&(p, rim)| self.centre(p, rim)).sum::<DVec3>();
        let axis = cavity.axis;
        let turned = if axis[axis.abs().max_position()] < 0.0 { -axis } else { axis };
        let removed = Removed {
            kind: cavity.kind,
            centre: rims / cavity.rims.len().max(1) as f64,
            axis: turned,
            diameter: cavity.diameter,
            bores: cavity.bores.len(),
            faces_removed: faces.len(),
            faces_added: fills.iter().map(|fill| fill.triangles.len()).sum(),
        };
        for f in faces {
            self.goes[f] = true;
        }
        for fill in fills {
            self.filled.push(Filled::new(fill.corners(self.surface)));
            self.taken.extend(fill.rim_edges());
            self.fills.push(fill);
        }
        Ok(Ok(removed))
    }

    /// Whether a fill meets itself, a face that stays or another fill, of which only those nearby are looked at.
    fn meets(&self, fill: &Fill, goes: &FxHashSet<FaceId>, own: &[Filled]) -> bool {
        let stays = |f: FaceId| !self.goes[f] && !goes.contains(&f);
        let bounds = Aabb::of(fill.corners(self.surface).into_iter().flatten());
        let near = self.filled.iter().chain(own).filter(|other| other.bounds.overlaps(&bounds));
        let others: Vec<[DVec3; 3]> = near.flat_map(|other| &other.corners).copied().collect();
        fill.meets(self.surface, &self.tree, stays, &others)
    }

    /// The middle of a rim's line, so that it does not depend on how the line is divided.
    fn centre(&self, patch: u32, rim: usize) -> DVec3 {
        let rim = &self.patches.all[patch as usize].rims[rim].vertices;
        let at = |i: usize| self.surface.points[rim[i % rim.len()]];
        let (mut sum, mut length) = (DVec3::ZERO, 0.0);
        for i in 0..rim.len() {
            let along = at(i).distance(at(i + 1));
            sum += 0.5 * along * (at(i) - at(0) + at(i + 1) - at(0));
            length += along;
        }
        if length > 0.0 { at(0) + sum / length } else { at(0) }
    }

    fn coarse(&self, patch: u32, rim: usize, goes: &FxHashSet<FaceId>, before: &[Fill]) -> Option<Fill> {
        let rim = &self.patches.all[patch as usize].rims[rim];
        let mut vertices = rim.vertices.clone();
        vertices.reverse();
        // Edge `i` of the turned rim is the edge that ended in its first vertex.
        let mut beside: Vec<FaceId> = rim.beyond.iter().copied().collect::<Option<_>>()?;
        beside.reverse();
        beside.rotate_left(1);
        if beside.iter().any(|f| goes.contains(f)) {
            return None;
        }
        let mut near: FxHashSet<EdgeKey> = before.iter().flat_map(Fill::rim_edges).collect();
        for f in vertices.iter().flat_map(|&v| self.fans.of(v)).filter(|f| !goes.contains(f)) {
            let [a, b, c] = self.surface.faces[*f];
            near.extend([edge_key(a, b), edge_key(b, c), edge_key(c, a)]);
        }
        Fill::coarse(self.surface, vertices, beside, &|edge| near.contains(&edge) || self.taken.contains(&edge))
    }
}

/// The triangles of a fill with their bounds.
struct Filled {
    corners: Vec<[DVec3; 3]>,
    bounds: Aabb,
}

impl Filled {
    fn new(corners: Vec<[DVec3; 3]>) -> Self {
        let bounds = Aabb::of(corners.iter().flatten().copied());
        Self { corners, bounds }
    }
}

/// What locks, seams and locked marks hold, without the marks of features.
fn locked(surface: &Surface, locks: &LockRules<'_>) -> Result<IdVec<Vertex, Freedom>, FreedomError> {
    let is_ours = |cause: MarkCause| match cause {
        MarkCause::Boundary | MarkCause::Feature | MarkCause::RegionBorder => true,
        MarkCause::Seam | MarkCause::Locked => false,
    };
    let mut bare = surface.clone();
    let carried = &mut bare.carried;
    let marks = &surface.carried.marks;
    let ours: BTreeSet<VertexId> =
        marks.iter().filter(|(_, mark)| is_ours(mark.cause)).flat_map(|(edge, _)| *edge).collect();
    carried.marks.retain(|_, mark| !is_ours(mark.cause));
    carried.pins.retain(|v, _| !ours.contains(v));
    Ok(resolve_freedom(&bare, &LockRules { rim: Rim::Free, ..*locks })?.vertices)
}
