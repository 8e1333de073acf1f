//! Removes small round features: through holes, blind holes and bosses below a diameter.
//!
//! Marked edges cut the surface into patches. A ring of faces between two circles whose normals are perpendicular to its
//! axis is the side of a hole, if they point to the axis, or of a boss; see `cavity` for steps, chamfers and floors.
//! The faces of a feature are taken out, its rims are filled without new vertices by the triangulation of the least bend
//! ([`triangulate_loop`](super::triangulate_loop)), and the fill is refined and improved while its rim stays as it is. A
//! feature is left alone if a lock holds any of its vertices or if its fill would meet something. After a round the
//! marks of vanished rims are gone, so that a boss with a hole is a boss in the next one.
//!
//! Based on: H. Date, S. Kanai, T. Kishinami, I. Nishigaki, T. Dohi. *High-Quality and Property Controlled Finite Element
//! Mesh Generation From Triangular Meshes using the Multiresolution Technique*, JCISE 5(4), 2005, section 6.3.2.
//! Departure: the paper refines a fill to the mean size of the mesh; where the edges of its rim are shorter, we refine to
//! 1.5 times their mean, because a fan over a fine rim would be all slivers.
//!
//! # Invariants
//! Faces that belong to no removed feature, and all vertices of rims, are identical in the result; the surface stays an
//! oriented manifold; no new self-intersection; a flat rim gets a flat fill.
//!
//! # Cost
//! O(F log F) a round, and O(n³) for a rim of n ≤ 500 edges.

mod cavity;
mod fill;
mod patches;
mod rebuild;
mod round;
#[cfg(test)]
mod tests;

use std::collections::BTreeSet;

use glam::DVec3;
use rustc_hash::FxHashSet;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::mesh::bvh::TriangleBvh;
use crate::mesh::geometry::triangle_size;
use crate::mesh::id::{Face, Vertex};
use crate::mesh::topology::VertexFaces;
use crate::mesh::{EdgeKey, FaceId, Freedom, FreedomError, IdVec, LockRules, MarkCause, Rim, Surface, VertexId};
use crate::mesh::{edge_key, resolve_freedom};
use crate::watch::{Cancelled, Watch};
use cavity::{Cavity, Finder};
use fill::Fill;
use patches::Patches;
use rebuild::rebuild;

/// Rounds at most: each removes what the round before has laid open.
const MOST_ROUNDS: usize = 8;

/// Sorts of features.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    /// Open at both ends; with counterbores and countersinks.
    ThroughHoles,
    /// With a floor.
    BlindHoles,
    /// Round and standing out.
    Bosses,
}

/// Why something that looks like a feature stays.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Reason {
    /// Its diameter is above the limit.
    TooLarge,
    /// A rim is no circle: a slot, an ellipse.
    NotRound,
    /// Other features open into its side.
    CutByOthers,
    /// It lies on the border of an open surface.
    OpenRim,
    /// A lock or a seam holds it.
    Locked,
    /// No fill of its rims does without repeating an edge of the surface or folding back.
    NoFill,
    /// Its fill would meet the surface.
    Obstructed,
}

/// A feature that was removed.
#[derive(Clone, Debug, PartialEq)]
pub struct Removed {
    /// What it was.
    pub kind: Kind,
    /// The middle of its rims' centres.
    pub centre: DVec3,
    /// The direction of its axis.
    pub axis: DVec3,
    /// The diameter of its widest side.
    pub diameter: f64,
    /// Faces taken out.
    pub faces_removed: usize,
    /// Faces of its fills.
    pub faces_added: usize,
}

/// What looked like a feature and stays.
#[derive(Clone, Debug, PartialEq)]
pub struct Rejected {
    /// The middle of its rims' centres.
    pub centre: DVec3,
    /// The largest diameter of its rims, or of the circles nearest to them.
    pub diameter: f64,
    /// Why it stays.
    pub reason: Reason,
}

/// What was done.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Report {
    /// In the order of removal.
    pub removed: Vec<Removed>,
    /// What was left after the last round.
    pub rejected: Vec<Rejected>,
}

/// Why features could not be removed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum DefeatureError {
    /// The locks name a group that the surface does not have.
    #[error(transparent)]
    Locks(#[from] FreedomError),
    /// The run was interrupted.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

/// Removes the features of these kinds up to a diameter; the surface's marks say where faces end.
///
/// # Errors
/// See [`DefeatureError`].
pub fn remove_features(
    surface: &Surface,
    most: f64,
    kinds: &[Kind],
    locks: &LockRules<'_>,
    watch: &Watch,
) -> Result<(Surface, Report), DefeatureError> {
    let sizes: f64 = surface.faces.ids().map(|f| triangle_size(surface.corners(f))).sum();
    let mean_size = sizes / surface.faces.len().max(1) as f64;
    let mut report = Report::default();
    let mut current = surface.clone();
    for _ in 0..MOST_ROUNDS {
        watch.check()?;
        let patches = Patches::new(&current);
        let (cavities, rejected) = Finder::new(&current, &patches, most).find(kinds);
        report.rejected = rejected;
        if cavities.is_empty() {
            break;
        }
        let before = report.removed.len();
        let mut surgery = Surgery::new(&current, &patches, locks)?;
        watch.phase("removing features", Some(cavities.len() as u64));
        for (i, cavity) in cavities.iter().enumerate() {
            watch.check()?;
            match surgery.remove(cavity, mean_size, watch)? {
                Ok(removed) => report.removed.push(removed),
                Err(reason) => {
                    let (centre, diameter) = (cavity.ring.centre, cavity.diameter);
                    report.rejected.push(Rejected { centre, diameter, reason });
                }
            }
            watch.advance(i as u64 + 1, || format!("{} removed", report.removed.len()));
        }
        if report.removed.len() == before {
            break;
        }
        current = rebuild(&current, &surgery.goes, &surgery.fills, &surgery.tree);
    }
    Ok((current, report))
}

/// One round on one surface.
struct Surgery<'a> {
    surface: &'a Surface,
    patches: &'a Patches,
    fans: VertexFaces,
    tree: TriangleBvh,
    freedom: IdVec<Vertex, Freedom>,
    goes: IdVec<Face, bool>,
    fills: Vec<Fill>,
    /// The triangles of all fills.
    filled: Vec<[DVec3; 3]>,
    /// Their edges between rim vertices.
    taken: BTreeSet<EdgeKey>,
}

impl<'a> Surgery<'a> {
    fn new(surface: &'a Surface, patches: &'a Patches, locks: &LockRules<'_>) -> Result<Self, FreedomError> {
        Ok(Self {
            surface,
            patches,
            fans: VertexFaces::new(surface),
            tree: TriangleBvh::of_surface(surface),
            freedom: locked(surface, locks)?,
            goes: IdVec::filled(false, surface.faces.len()),
            fills: Vec::new(),
            filled: Vec::new(),
            taken: BTreeSet::new(),
        })
    }

    fn remove(&mut self, cavity: &Cavity, mean_size: f64, watch: &Watch) -> Result<Result<Removed, Reason>, Cancelled> {
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
            let others: Vec<[DVec3; 3]> =
                fills.iter().flat_map(|f| f.corners(self.surface)).chain(self.filled.iter().copied()).collect();
            let stays = |f: FaceId| !self.goes[f] && !goes.contains(&f);
            let is_harmless = |fill: &Fill| !fill.meets(self.surface, &self.tree, stays, &others);
            let fine = coarse.improved(self.surface, mean_size, watch)?;
            let Some(fill) = fine.into_iter().chain([coarse]).find(is_harmless) else {
                return Ok(Err(Reason::Obstructed));
            };
            fills.push(fill);
        }
        let rims = cavity.rims.iter().map(|&(p, rim)| self.centre(p, rim)).sum::<DVec3>();
        let axis = cavity.ring.axis;
        let turned = if axis[axis.abs().max_position()] < 0.0 { -axis } else { axis };
        let removed = Removed {
            kind: cavity.kind,
            centre: rims / cavity.rims.len().max(1) as f64,
            axis: turned,
            diameter: cavity.diameter,
            faces_removed: faces.len(),
            faces_added: fills.iter().map(|fill| fill.triangles.len()).sum(),
        };
        for f in faces {
            self.goes[f] = true;
        }
        for fill in fills {
            self.filled.extend(fill.corners(self.surface));
            self.taken.extend(fill.rim_edges());
            self.fills.push(fill);
        }
        Ok(Ok(removed))
    }

    /// The mean of a rim's vertices.
    fn centre(&self, patch: u32, rim: usize) -> DVec3 {
        let rim = &self.patches.all[patch as usize].rims[rim].vertices;
        rim.iter().map(|&v| self.surface.points[v]).sum::<DVec3>() / rim.len().max(1) as f64
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
        let mut taken: FxHashSet<EdgeKey> = self.taken.iter().copied().collect();
        taken.extend(before.iter().flat_map(Fill::rim_edges));
        for f in vertices.iter().flat_map(|&v| self.fans.of(v)).filter(|f| !goes.contains(f)) {
            let [a, b, c] = self.surface.faces[*f];
            taken.extend([edge_key(a, b), edge_key(b, c), edge_key(c, a)]);
        }
        Fill::coarse(self.surface, vertices, beside, &taken)
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
