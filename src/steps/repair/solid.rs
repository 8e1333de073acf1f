//! Faces that run through each other: they are cut, and what is inside of bodies goes.
//!
//! Rounding after the cut, and whatever is cleaned after that, may let faces meet again, closely: the next round has a
//! coarser grid, on which what is so close is one. Published experience is that a few rounds do (S. Lazard, L. Valque.
//! Removing self-intersections in 3D meshes while preserving floating-point coordinates. SGP 2025); there is no proof.

use glam::DVec3;

use super::intersect::{Intersections, self_intersections};
use super::params::{Bodies, RepairParams};
use super::report::{RemovalStats, RepairError, RepairStats};
use crate::mesh::geometry::{area_vector, triangle_area};
use crate::mesh::topology::components;
use crate::mesh::{FaceId, Facet, IdVec, Soup, Surface, VertexId};
use crate::technique::arrange::{Fault, Part, resolve};
use crate::watch::Watch;

/// By how many bits the grid of each round is coarser than the finest one.
const COARSER: [u32; 5] = [0, 2, 4, 6, 7];

/// Places of faces that still run through others that are told.
const LISTED: usize = 20;

/// What became of a surface.
pub(super) struct Removed {
    pub(super) surface: Surface,
    /// Pieces that were inside of bodies.
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
    let count = |surface: &Surface| self_intersections(surface.faces.len(), |f| surface.corners(f), watch);
    let mut left = count(&surface)?;
    let mut removal = RemovalStats { pairs: left.pairs, ..RemovalStats::default() };
    let (mut pieces, mut uncleaned) = (Soup::default(), None);
    for coarser in COARSER {
        let wanted = wanted_pairs(&surface, &left, params.bodies);
        if wanted.is_empty() || removal.stopped.is_some() {
            break;
        }
        let resolved = match resolve_bodies(&surface, &wanted, coarser, params.bodies, watch) {
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
        left = count(&surface)?;
        uncleaned = (left.pairs > 0).then_some((cut, stats.clone()));
        stats.go_on(more);
    }
    // Cleaning let them meet again: better faces without height than that.
    if let Some((cut, before)) = uncleaned {
        let (other, more) = settle(&cut, 0.0)?;
        let meeting = count(&other)?;
        if meeting.pairs < left.pairs {
            (surface, left, *stats) = (other, meeting, before);
            stats.go_on(more);
        }
    }
    removal.pairs_left = left.pairs;
    if left.pairs == 0 {
        removal.stopped = None;
    }
    let middle = |f: u32| surface.corners(FaceId::from_raw(f)).iter().sum::<DVec3>() / 3.0;
    removal.left_at = left.faces.iter().take(LISTED).map(|&f| middle(f).to_array()).collect();
    stats.removal = (removal.pairs > 0).then_some(removal);
    Ok(Removed { surface, pieces, left })
}

/// What cutting gave.
#[derive(Default)]
pub(super) struct Pieces {
    pub(super) kept: Part,
    pub(super) removed: Part,
    pub(super) moved: f64,
    pub(super) touched: usize,
}

/// The pairs that are to be resolved: with bodies that stay apart, those within one body.
fn wanted_pairs(surface: &Surface, found: &Intersections, bodies: Bodies) -> Vec<(u32, u32)> {
    let pairs = found.met.iter().map(|&(f, g, _)| (f, g));
    if bodies == Bodies::Union || found.met.is_empty() {
        return pairs.collect();
    }
    let of_face = components(surface).of_face;
    pairs.filter(|&(f, g)| of_face[FaceId::from_raw(f)] == of_face[FaceId::from_raw(g)]).collect()
}

fn faces_of(pairs: &[(u32, u32)]) -> Vec<u32> {
    let mut faces: Vec<u32> = pairs.iter().flat_map(|&(f, g)| [f, g]).collect();
    faces.sort_unstable();
    faces.dedup();
    faces
}

/// All bodies together, or each by itself.
fn resolve_bodies(
    surface: &Surface,
    pairs: &[(u32, u32)],
    coarser: u32,
    bodies: Bodies,
    watch: &Watch,
) -> Result<Pieces, Fault> {
    let meeting = faces_of(pairs);
    if bodies == Bodies::Union {
        let all = resolve(surface, &meeting, coarser, watch)?;
        return Ok(Pieces { kept: all.kept, removed: all.removed, moved: all.moved, touched: all.touched });
    }
    let parts = components(surface);
    let mut of_part: Vec<(Vec<FaceId>, Vec<u32>)> = vec![Default::default(); parts.count];
    for (f, &part) in parts.of_face.enumerate() {
        of_part[part as usize].0.push(f);
    }
    for &f in &meeting {
        of_part[parts.of_face[FaceId::from_raw(f)] as usize].1.push(f);
    }
    let mut pieces = Pieces::default();
    let mut untouched = Vec::new();
    for (faces, meeting) in of_part {
        if meeting.is_empty() {
            untouched.extend(faces);
            continue;
        }
        pieces.add_body(surface, &faces, &meeting, coarser, watch)?;
    }
    untouched.sort_unstable();
    let (whole, vertices) = part_of(surface, &untouched, false);
    pieces.kept.append(Part::whole(&whole), &vertices, &untouched);
    Ok(pieces)
}

impl Pieces {
    /// Cuts one body by itself. One that bounds a cavity is turned for it.
    fn add_body(
        &mut self,
        surface: &Surface,
        faces: &[FaceId],
        meeting: &[u32],
        coarser: u32,
        watch: &Watch,
    ) -> Result<(), Fault> {
        let middle = surface.points[surface.faces[faces[0]][0]];
        let cone = |&f: &FaceId| {
            let corners = surface.corners(f).map(|p| p - middle);
            area_vector(corners).dot(corners[0])
        };
        let is_cavity = faces.iter().map(cone).sum::<f64>() < 0.0;
        let (body, vertices) = part_of(surface, faces, is_cavity);
        let number = |&f: &u32| faces.binary_search(&FaceId::from_raw(f)).unwrap_or(0) as u32;
        let meeting: Vec<u32> = meeting.iter().map(number).collect();
        let mut found = resolve(&body, &meeting, coarser, watch)?;
        if is_cavity {
            found.kept.faces.iter_mut().chain(&mut found.removed.faces).for_each(|face| face.swap(1, 2));
        }
        self.moved = self.moved.max(found.moved);
        self.touched += found.touched;
        self.kept.append(found.kept, &vertices, faces);
        self.removed.append(found.removed, &vertices, faces);
        Ok(())
    }
}

/// Some faces as a surface that carries nothing, turned or not, and which vertices it has.
fn part_of(surface: &Surface, faces: &[FaceId], is_turned: bool) -> (Surface, Vec<VertexId>) {
    let mut number: IdVec<crate::mesh::id::Vertex, Option<VertexId>> = IdVec::filled(None, surface.points.len());
    let (mut part, mut vertices) = (Surface::default(), Vec::new());
    for &f in faces {
        let mut corners = surface.faces[f].map(|v| {
            *number[v].get_or_insert_with(|| {
                vertices.push(v);
                part.points.push(surface.points[v])
            })
        });
        if is_turned {
            corners.swap(1, 2);
        }
        part.faces.push(corners);
    }
    (part, vertices)
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
    fn count(&mut self, pieces: &Pieces, surface: &Surface) {
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
