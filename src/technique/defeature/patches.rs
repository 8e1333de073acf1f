//! The pieces into which marked edges cut a surface, with their rims.
//!
//! Marks have gaps where curves run so close to each other that only one of them is kept; there the angle between faces
//! shows where the other one runs.

use glam::DVec3;
use rustc_hash::FxHashMap;

use crate::mesh::geometry::angle;
use crate::mesh::id::{Edge, Face};
use crate::mesh::topology::{EdgeTable, SideRef};
use crate::mesh::{EdgeId, EdgeKey, FaceId, IdVec, MarkCause, Surface, VertexId};

/// An unmarked edge is sharp from this angle between the normals on, in degrees: what marks are given for by default.
const SHARP: f64 = 30.0;
/// Faces that turn by less than this are flat, in degrees: below the first step of a rounding, above rounded
/// coordinates.
const BENT: f64 = 1.0;

/// The marked edges.
pub(super) fn marked(surface: &Surface, edges: &EdgeTable) -> IdVec<Edge, bool> {
    edges.keys().iter().map(|key| surface.carried.marks.contains_key(key)).collect()
}

/// The edges marked as sharp and all that are so without a mark; `None` on a surface without such marks, which nobody
/// has searched for them.
pub(super) fn sharp(surface: &Surface, edges: &EdgeTable, normals: &IdVec<Face, DVec3>) -> Option<IdVec<Edge, bool>> {
    let marks = &surface.carried.marks;
    let is_marked = |key: &EdgeKey| marks.get(key).is_some_and(|mark| mark.cause == MarkCause::Feature);
    if !edges.keys().iter().any(is_marked) {
        return None;
    }
    let is_sharp = |sides: &[SideRef]| match sides {
        [a, b] => angle(normals[a.face], normals[b.face]).to_degrees() >= SHARP,
        _ => true,
    };
    Some(edges.iter().map(|(_, key, sides)| is_marked(&key) || is_sharp(sides)).collect())
}

/// The edges at which faces turn at all: what they bound is flat, and ends where a rounding begins.
pub(super) fn bent(edges: &EdgeTable, normals: &IdVec<Face, DVec3>) -> IdVec<Edge, bool> {
    let is_bent = |sides: &[SideRef]| match sides {
        [a, b] => angle(normals[a.face], normals[b.face]).to_degrees() >= BENT,
        _ => true,
    };
    edges.iter().map(|(_, _, sides)| is_bent(sides)).collect()
}

/// One closed chain of edges round a patch.
#[derive(Clone, Debug)]
pub(super) struct Rim {
    /// Its vertices in the direction of the patch's faces; edge `i` goes from vertex `i` to the next one.
    pub(super) vertices: Vec<VertexId>,
    /// The patch's face at each edge.
    pub(super) own: Vec<FaceId>,
    /// The face beyond each edge; `None` on the border of an open surface.
    pub(super) beyond: Vec<Option<FaceId>>,
}

/// Connected faces with no cut between them.
#[derive(Clone, Debug)]
pub(super) struct Patch {
    pub(super) faces: Vec<FaceId>,
    /// Empty where rims touch each other or themselves at a vertex.
    pub(super) rims: Vec<Rim>,
    /// The rim that each vertex of one lies on, sorted.
    rim_of: Vec<(VertexId, usize)>,
    /// Euler characteristic.
    pub(super) characteristic: i64,
}

/// All patches, numbered by their lowest face.
#[derive(Debug)]
pub(super) struct Patches {
    pub(super) of_face: IdVec<Face, u32>,
    pub(super) all: Vec<Patch>,
}

impl Patches {
    /// Cuts the surface along some of its edges.
    pub(super) fn new(surface: &Surface, edges: &EdgeTable, is_cut: &IdVec<Edge, bool>) -> Self {
        let sides = edges.edges_of_triangles(surface.faces.len());
        let mut of_face = IdVec::<Face, u32>::filled(u32::MAX, surface.faces.len());
        let mut all: Vec<Patch> = Vec::new();
        for first in surface.faces.ids() {
            if of_face[first] != u32::MAX {
                continue;
            }
            let number = all.len() as u32;
            let mut faces = vec![first];
            of_face[first] = number;
            let mut at = 0;
            while let Some(&f) = faces.get(at) {
                at += 1;
                for e in sides[f].into_iter().filter(|e| !is_cut[*e]) {
                    for side in edges.sides(e) {
                        if of_face[side.face] == u32::MAX {
                            of_face[side.face] = number;
                            faces.push(side.face);
                        }
                    }
                }
            }
            faces.sort_unstable();
            all.push(Patch { faces, rims: Vec::new(), rim_of: Vec::new(), characteristic: 0 });
        }
        let mut this = Self { of_face, all };
        for number in 0..this.all.len() {
            this.find_rims(surface, edges, &sides, number);
        }
        this
    }

    fn find_rims(&mut self, surface: &Surface, edges: &EdgeTable, sides: &IdVec<Face, [EdgeId; 3]>, number: usize) {
        let faces = &self.all[number].faces;
        let mut out: Vec<Side> = Vec::new();
        let mut vertices: Vec<VertexId> = Vec::with_capacity(3 * faces.len());
        let (mut inner, mut is_pinched) = (0_usize, false);
        for &f in faces {
            let corners = surface.faces[f];
            vertices.extend(corners);
            for k in 0..3 {
                let beyond = edges.sides(sides[f][k]).iter().map(|s| s.face).find(|&g| g != f);
                if beyond.is_some_and(|g| self.of_face[g] == number as u32) {
                    inner += 1;
                } else {
                    out.push((corners[k], corners[(k + 1) % 3], f, beyond));
                }
            }
        }
        vertices.sort_unstable();
        vertices.dedup();
        let count = vertices.len() as i64 - (inner / 2 + out.len()) as i64 + faces.len() as i64;
        out.sort_unstable();
        is_pinched |= out.windows(2).any(|pair| pair[0].0 == pair[1].0);
        let rims = if is_pinched { Vec::new() } else { chains(&out) };
        self.all[number].characteristic = count;
        let on = rims.iter().enumerate().flat_map(|(k, rim)| rim.vertices.iter().map(move |&v| (v, k)));
        self.all[number].rim_of = on.collect();
        self.all[number].rim_of.sort_unstable();
        self.all[number].rims = rims;
    }

    /// The one patch beyond a rim, where it is bounded there by the same rim: its number and its rim's.
    pub(super) fn across(&self, rim: &Rim) -> Option<(u32, usize)> {
        let first = self.of_face[(*rim.beyond.first()?)?];
        if rim.beyond.iter().any(|f| f.is_none_or(|f| self.of_face[f] != first)) {
            return None;
        }
        let patch = &self.all[first as usize];
        let found = patch.rim_of.binary_search_by_key(rim.vertices.first()?, |&(v, _)| v).ok()?;
        let at = patch.rim_of[found].1;
        (patch.rims[at].vertices.len() == rim.vertices.len()).then_some((first, at))
    }
}

/// A directed edge of a patch's border, the patch's face at it and the one beyond.
type Side = (VertexId, VertexId, FaceId, Option<FaceId>);

/// Closed chains out of directed edges, at most one of which leaves a vertex.
fn chains(out: &[Side]) -> Vec<Rim> {
    let next: FxHashMap<VertexId, usize> = out.iter().enumerate().map(|(i, side)| (side.0, i)).collect();
    let mut used = vec![false; out.len()];
    let mut rims = Vec::new();
    for first in 0..out.len() {
        let mut rim = Rim { vertices: Vec::new(), own: Vec::new(), beyond: Vec::new() };
        let mut at = first;
        while !std::mem::replace(&mut used[at], true) {
            rim.vertices.push(out[at].0);
            rim.own.push(out[at].2);
            rim.beyond.push(out[at].3);
            let Some(&following) = next.get(&out[at].1) else { break };
            at = following;
        }
        if !rim.vertices.is_empty() {
            rims.push(rim);
        }
    }
    rims
}
