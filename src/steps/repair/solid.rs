//! Faces that run through each other: they are cut, and what is inside of bodies goes.
//!
//! Rounding after the cut, and whatever is cleaned after that, may let faces meet again, closely: the next round has a
//! coarser grid, on which what is so close is one. Published experience is that a few rounds do (S. Lazard, L. Valque.
//! Removing self-intersections in 3D meshes while preserving floating-point coordinates. SGP 2025); there is no proof.

use glam::DVec3;

use super::intersect::{Intersections, self_intersections};
use super::params::{Bodies, RepairParams};
use super::report::{Certificate, RemovalStats, RepairError, RepairStats};
use crate::mesh::contact::tell_contacts;
use crate::mesh::geometry::{Aabb, triangle_area};
use crate::mesh::predicate::Meeting;
use crate::mesh::topology::{EdgeTable, components};
use crate::mesh::{FaceId, Facet, Soup, Surface, VertexId};
use crate::technique::arrange::{Fault, Resolved, Shared, resolve};
use crate::watch::Watch;

/// By how many bits the grid of each round is coarser than the finest one.
const COARSER: [u32; 5] = [0, 2, 4, 6, 7];

/// Places of faces that still run through others that are told.
const LISTED: usize = 20;

/// What became of a surface.
pub(super) struct Removed {
    pub(super) surface: Surface,
    /// Pieces that are of no body's boundary any more.
    pub(super) pieces: Soup,
    /// What still meets.
    pub(super) left: Intersections,
}

/// Cuts until no faces meet, or no round is left. `settle` makes a surface of pieces within a movement.
pub(super) fn remove_intersections(
    mut surface: Surface,
    params: &RepairParams,
    limit: f64,
    stats: &mut RepairStats,
    watch: &Watch,
    settle: impl Fn(&Soup, f64) -> Result<(Surface, RepairStats), RepairError>,
) -> Result<Removed, RepairError> {
    let count = |surface: &Surface| -> Result<(Intersections, Vec<(u32, u32)>), RepairError> {
        let found = self_intersections(surface.faces.len(), |f| surface.corners(f), watch)?;
        let wanted = wanted_pairs(surface, &found, params.bodies);
        Ok((found, wanted))
    };
    let (mut left, mut wanted) = count(&surface)?;
    let mut removal = RemovalStats { pairs: wanted.len() as u64, ..RemovalStats::default() };
    let shared = if params.bodies == Bodies::Union { Shared::United } else { Shared::First };
    let (mut pieces, mut uncleaned) = (Soup::default(), None);
    for coarser in COARSER {
        if wanted.is_empty() {
            break;
        }
        let resolved = match resolve(&surface, &faces_of(&wanted), shared, coarser, watch) {
            Ok(resolved) => resolved,
            Err(Fault::Cancelled(cancelled)) => return Err(cancelled.into()),
            Err(fault) => {
                removal.stopped = Some(fault.to_string());
                break;
            }
        };
        let rest = limit - stats.max_move - resolved.moved;
        if !left.complete || rest < 0.0 {
            let why = if left.complete { "vertices would move farther than `max-move`" } else { "there are too many" };
            removal.stopped = Some(why.to_owned());
            break;
        }
        removal.count(&resolved, &surface);
        append(&mut pieces, &resolved.removed.to_soup(&surface));
        stats.max_move += resolved.moved;
        let cut = resolved.kept.to_soup(&surface);
        let more;
        (surface, more) = settle(&cut, rest)?;
        (left, wanted) = count(&surface)?;
        uncleaned = (!wanted.is_empty()).then_some((cut, stats.clone()));
        stats.go_on(more);
    }
    // Cleaning let them meet again: better faces without height than that.
    if let Some((cut, before)) = uncleaned {
        let (other, more) = settle(&cut, 0.0)?;
        let (meeting, unwanted) = count(&other)?;
        if unwanted.len() < wanted.len() {
            (surface, left, wanted, *stats) = (other, meeting, unwanted, before);
            stats.go_on(more);
        }
    }
    removal.pairs_left = wanted.len() as u64;
    if wanted.is_empty() {
        removal.stopped = None;
    }
    let middle = |f: u32| surface.corners(FaceId::from_raw(f)).iter().sum::<DVec3>() / 3.0;
    removal.left_at = faces_of(&wanted).into_iter().take(LISTED).map(|f| middle(f).to_array()).collect();
    stats.removal = (removal.pairs > 0).then_some(removal);
    Ok(Removed { surface, pieces, left })
}

/// What is certain of a surface whose pairs are counted already. O(F log F).
pub(super) fn certify(surface: &Surface, stats: &RepairStats) -> Certificate {
    let edges = EdgeTable::new(surface);
    let middle = Aabb::of(surface.points.iter().copied()).centre();
    let cone = |f: FaceId| {
        let [a, b, c] = surface.corners(f).map(|p| p - middle);
        a.dot(b.cross(c)) / 6.0
    };
    let closed = edges.is_closed();
    Certificate {
        closed,
        bodies: components(surface).count as u64,
        euler_characteristic: surface.points.len() as i64 - edges.len() as i64 + surface.faces.len() as i64,
        volume: closed.then(|| surface.faces.ids().map(cone).sum()),
        crossing_pairs: stats.self_intersections - stats.contacts,
        contacts: stats.contacts,
        farthest: stats.max_move,
    }
}

/// The pairs that are to be resolved: bodies that stay apart may touch.
fn wanted_pairs(surface: &Surface, found: &Intersections, bodies: Bodies) -> Vec<(u32, u32)> {
    let mut met = found.met.clone();
    if bodies == Bodies::Keep && !met.is_empty() {
        tell_contacts(surface.faces.as_slice(), |v| surface.points[v], &mut met);
        let of_face = components(surface).of_face;
        let is_own = |f: u32, g: u32| of_face[FaceId::from_raw(f)] == of_face[FaceId::from_raw(g)];
        met.retain(|&(f, g, meeting)| meeting != Meeting::Touching || is_own(f, g));
    }
    met.into_iter().map(|(f, g, _)| (f, g)).collect()
}

fn faces_of(pairs: &[(u32, u32)]) -> Vec<u32> {
    let mut faces: Vec<u32> = pairs.iter().flat_map(|&(f, g)| [f, g]).collect();
    faces.sort_unstable();
    faces.dedup();
    faces
}

/// Adds faces with their groups.
fn append(all: &mut Soup, more: &Soup) {
    let (points, faces) = (all.points.len(), all.faces.len());
    more.points.iter().for_each(|&p| {
        all.points.push(p);
    });
    for facet in &more.faces {
        let mut facet = *facet;
        facet.corners_mut().iter_mut().for_each(|v| *v = VertexId::new(v.index() + points));
        all.faces.push(facet);
    }
    for (name, members) in &more.carried.groups.faces {
        let group = all.carried.groups.faces.entry(name.clone()).or_default();
        group.extend(members.iter().map(|f| FaceId::new(f.index() + faces)));
    }
}

impl RemovalStats {
    fn count(&mut self, pieces: &Resolved, surface: &Surface) {
        self.rounds += 1;
        self.faces_cut = self.faces_cut.max(pieces.touched as u64);
        self.pieces_removed += pieces.removed.faces.len() as u64;
        let soup = pieces.removed.to_soup(surface);
        let area = |facet: &Facet| match *facet {
            Facet::Tri(corners) => triangle_area(corners.map(|v| soup.points[v])),
            Facet::Quad(_) => 0.0,
        };
        self.area_removed += soup.faces.iter().map(area).sum::<f64>();
        self.largest_move = self.largest_move.max(pieces.moved);
    }
}
