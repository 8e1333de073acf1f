//! From a surface into the workshop: pairing half-edges, linking rims, interning groups.
//!
//! Half-edges are bucketed by their smaller end and paired inside the bucket, so edges are numbered by their ends.
//! O(F) time for bounded valence, O(F log F) at worst; 16 bytes a half-edge of scratch memory.

use super::seams::Seams;
use super::{EdgeState, HalfedgeId, HalfedgeMesh, NONE, Names};
use crate::mesh::carried::{Freedom, edge_key};
use crate::mesh::classes::{ClassId, Classes};
use crate::mesh::freedom::ResolvedFreedom;
use crate::mesh::id::{EdgeId, FaceId, IdVec, VertexId};
use crate::mesh::surface::Surface;

/// An edge that does not have one face on each side.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NonManifoldEdge {
    /// Its ends.
    pub ends: [VertexId; 2],
    /// All faces at it.
    pub faces: Vec<FaceId>,
}

/// A vertex whose faces do not form one fan.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NonFan {
    /// The vertex.
    pub vertex: VertexId,
}

/// Why a surface cannot enter the workshop: it is none.
#[derive(Clone, Debug, Default, PartialEq, Eq, thiserror::Error)]
#[error(
    "not an oriented 2-manifold: {} bad edges, {} vertices without a fan, {} unused vertices, {} bad faces",
    edges.len(), vertices.len(), unused.len(), faces.len()
)]
pub struct EnterError {
    /// Edges with more than two faces, or with two faces of opposite orientation.
    pub edges: Vec<NonManifoldEdge>,
    /// Vertices whose faces form more than one fan.
    pub vertices: Vec<NonFan>,
    /// Vertices of no face.
    pub unused: Vec<VertexId>,
    /// Faces with a corner out of range or twice the same corner.
    pub faces: Vec<FaceId>,
}

impl EnterError {
    fn is_empty(&self) -> bool {
        self.edges.is_empty() && self.vertices.is_empty() && self.unused.is_empty() && self.faces.is_empty()
    }
}

/// One side of a face, waiting for its partner: the larger end and the place `3 f + corner`.
#[derive(Clone, Copy)]
struct Side {
    high: u32,
    place: u32,
}

impl HalfedgeMesh {
    /// Enters the workshop. Fields stay outside.
    ///
    /// # Errors
    /// All edges, vertices and faces that keep the mesh from being an oriented 2-manifold.
    pub fn new(surface: &Surface, freedom: &ResolvedFreedom) -> Result<Self, EnterError> {
        let mut error = EnterError { faces: bad_faces(surface), ..EnterError::default() };
        if !error.is_empty() {
            return Err(error);
        }
        let (offsets, sides) = bucket_sides(surface);
        let mut mesh = Self::bare(surface);
        mesh.pair_sides(surface, &offsets, &sides, &mut error);
        if !error.is_empty() {
            return Err(error);
        }
        drop((offsets, sides));
        mesh.link_rims(&mut error);
        mesh.check_fans(&mut error);
        if !error.is_empty() {
            return Err(error);
        }
        mesh.carry(surface, freedom);
        Ok(mesh)
    }

    fn bare(surface: &Surface) -> Self {
        let (vertices, faces) = (surface.points.len(), surface.faces.len());
        let edges = faces * 3 / 2 + 1;
        let names = Names {
            face_groups: surface.carried.groups.faces.keys().cloned().collect(),
            edge_groups: surface.carried.groups.edges.keys().cloned().collect(),
            vertex_groups: surface.carried.groups.vertices.keys().cloned().collect(),
            regions: surface.carried.regions.as_ref().map(|r| r.names.clone()),
        };
        let regions = names.regions.as_ref().map_or(0, Vec::len);
        Self {
            points: surface.points.clone(),
            vertex_halfedge: IdVec::filled(NONE, vertices),
            vertex_freedom: IdVec::filled(Freedom::Free, vertices),
            vertex_class: IdVec::filled(0, vertices),
            vertex_version: IdVec::filled(0, vertices),
            next: IdVec::with_capacity(2 * edges),
            origin: IdVec::with_capacity(2 * edges),
            halfedge_face: IdVec::with_capacity(2 * edges),
            edge_state: IdVec::with_capacity(edges),
            edge_class: IdVec::new(),
            face_halfedge: IdVec::filled(NONE, faces),
            face_class: IdVec::filled(0, faces),
            vertex_classes: Classes::new(names.vertex_groups.len()),
            edge_classes: Classes::new(names.edge_groups.len()),
            face_classes: Classes::new(names.face_groups.len() + regions),
            names,
            pins: surface.carried.pins.clone(),
            seams: Seams::new(&surface.carried.seams),
            live_vertices: vertices,
            live_edges: 0,
            live_faces: faces,
        }
    }

    /// Makes the edges: bucket by bucket, each pair of sides in order of its larger end.
    fn pair_sides(&mut self, surface: &Surface, offsets: &[u32], sides: &[Side], error: &mut EnterError) {
        let mut side_halfedge = vec![NONE; 3 * surface.faces.len()];
        for low in 0..surface.points.len() {
            let bucket = &sides[offsets[low] as usize..offsets[low + 1] as usize];
            for group in bucket.chunk_by(|a, b| a.high == b.high) {
                self.make_edge(surface, low as u32, group, &mut side_halfedge, error);
            }
        }
        if !error.is_empty() {
            return;
        }
        for f in surface.faces.ids() {
            let base = 3 * f.index();
            for corner in 0..3 {
                let h = HalfedgeId::from_raw(side_halfedge[base + corner]);
                self.next[h] = side_halfedge[base + (corner + 1) % 3];
                self.halfedge_face[h] = f.raw();
            }
            self.face_halfedge[f] = side_halfedge[base];
        }
    }

    fn make_edge(
        &mut self,
        surface: &Surface,
        low: u32,
        group: &[Side],
        side_halfedge: &mut [u32],
        error: &mut EnterError,
    ) {
        let forward = |side: &Side| {
            let face = surface.faces[FaceId::from_raw(side.place / 3)];
            face[side.place as usize % 3].raw() == low
        };
        let proper = match group {
            [_] => true,
            [a, b] => forward(a) != forward(b),
            _ => false,
        };
        if !proper {
            error.edges.push(NonManifoldEdge {
                ends: [VertexId::from_raw(low), VertexId::from_raw(group[0].high)],
                faces: group.iter().map(|s| FaceId::from_raw(s.place / 3)).collect(),
            });
            return;
        }
        let edge = self.edge_state.push(EdgeState::default());
        for origin in [low, group[0].high] {
            self.origin.push(origin);
            self.next.push(NONE);
            self.halfedge_face.push(NONE);
        }
        for side in group {
            side_halfedge[side.place as usize] = 2 * edge.raw() + u32::from(!forward(side));
        }
    }

    /// Gives each vertex its half-edge and links the boundary half-edges round their loops.
    fn link_rims(&mut self, error: &mut EnterError) {
        for h in self.next.ids() {
            let v = self.origin(h);
            let is_rim = self.halfedge_face[h] == NONE;
            let known = self.vertex_halfedge[v];
            let known_is_rim = known != NONE && self.halfedge_face[HalfedgeId::from_raw(known)] == NONE;
            if is_rim && known_is_rim {
                error.vertices.push(NonFan { vertex: v });
            } else if known == NONE || is_rim {
                self.vertex_halfedge[v] = h.raw();
            }
        }
        error.vertices.sort_by_key(|n| n.vertex);
        error.vertices.dedup();
        error.unused = self.points.ids().filter(|&v| self.vertex_halfedge[v] == NONE).collect();
        for h in self.next.ids() {
            if self.halfedge_face[h] == NONE {
                self.next[h] = self.vertex_halfedge[self.target(h)];
            }
        }
    }

    /// A vertex whose half-edges are not all reached by turning round it has several fans.
    fn check_fans(&self, error: &mut EnterError) {
        if !error.is_empty() {
            return;
        }
        let mut outgoing = vec![0_u32; self.points.len()];
        for h in self.next.ids() {
            outgoing[self.origin[h] as usize] += 1;
        }
        let limit = self.next.len();
        for v in self.points.ids() {
            let turned = self.outgoing(v).take(limit).count();
            if turned != outgoing[v.index()] as usize {
                error.vertices.push(NonFan { vertex: v });
            }
        }
    }

    fn carry(&mut self, surface: &Surface, freedom: &ResolvedFreedom) {
        self.live_edges = self.edge_state.len();
        self.edge_class = IdVec::filled(0, self.live_edges);
        self.vertex_freedom = freedom.vertices.clone();
        for e in self.edge_state.ids() {
            let [a, b] = self.ends(e);
            let key = edge_key(a, b);
            let mark = surface.carried.marks.get(&key).copied();
            let state = EdgeState::new(freedom.edge(key), mark);
            let is_on_seam = freedom.edge(key) == Freedom::Keep && freedom.may_halve(key);
            self.edge_state[e] = if is_on_seam { state.on_seam_only() } else { state };
        }
        let groups = &surface.carried.groups;
        for (label, members) in groups.vertices.values().enumerate() {
            join(&mut self.vertex_classes, label, members.iter().copied(), &mut self.vertex_class);
        }
        for (label, members) in groups.faces.values().enumerate() {
            join(&mut self.face_classes, label, members.iter().copied(), &mut self.face_class);
        }
        if let Some(regions) = &surface.carried.regions {
            for (face, &label) in regions.labels.enumerate() {
                let label = groups.faces.len() + label as usize;
                join(&mut self.face_classes, label, std::iter::once(face), &mut self.face_class);
            }
        }
        for (label, members) in groups.edges.values().enumerate() {
            let edges: Vec<EdgeId> = members.iter().filter_map(|&key| self.find_edge(key)).collect();
            join(&mut self.edge_classes, label, edges.into_iter(), &mut self.edge_class);
        }
    }

    fn find_edge(&self, [a, b]: [VertexId; 2]) -> Option<EdgeId> {
        (a.index() < self.points.len()).then(|| self.find_halfedge(a, b).map(super::edge_of)).flatten()
    }
}

/// Adds `label` to the classes of `members` and counts them.
fn join<K>(
    classes: &mut Classes,
    label: usize,
    members: impl Iterator<Item = crate::mesh::id::Id<K>>,
    of: &mut IdVec<K, ClassId>,
) {
    for member in members {
        if of.get(member).is_some() {
            let old = of[member];
            classes.remove(old);
            let new = classes.with(old, label as u32);
            classes.add(new);
            of[member] = new;
        }
    }
}

fn bad_faces(surface: &Surface) -> Vec<FaceId> {
    let count = surface.points.len();
    let bad = |&[a, b, c]: &[VertexId; 3]| a == b || b == c || c == a || [a, b, c].iter().any(|v| v.index() >= count);
    surface.faces.enumerate().filter(|(_, corners)| bad(corners)).map(|(f, _)| f).collect()
}

/// The sides of all faces by their smaller end; in a bucket by larger end, then by place.
fn bucket_sides(surface: &Surface) -> (Vec<u32>, Vec<Side>) {
    let mut offsets = vec![0_u32; surface.points.len() + 1];
    let sides_of = |corners: &[VertexId; 3]| {
        let [a, b, c] = corners.map(VertexId::raw);
        [(a.min(b), a.max(b)), (b.min(c), b.max(c)), (c.min(a), c.max(a))]
    };
    for corners in &surface.faces {
        for (low, _) in sides_of(corners) {
            offsets[low as usize + 1] += 1;
        }
    }
    for i in 1..offsets.len() {
        offsets[i] += offsets[i - 1];
    }
    let mut sides = vec![Side { high: 0, place: 0 }; 3 * surface.faces.len()];
    let mut fill = offsets.clone();
    for (f, corners) in surface.faces.enumerate() {
        for (corner, (low, high)) in sides_of(corners).into_iter().enumerate() {
            let slot = &mut fill[low as usize];
            sides[*slot as usize] = Side { high, place: 3 * f.raw() + corner as u32 };
            *slot += 1;
        }
    }
    for bucket in offsets.windows(2) {
        sides[bucket[0] as usize..bucket[1] as usize].sort_unstable_by_key(|s| (s.high, s.place));
    }
    (offsets, sides)
}
