//! Topology of a mesh without half-edges: edges with their faces, adjacency, rims, components.
//!
//! Edges are numbered by their ends, smaller end first, so that equal meshes have equal numbers.
//! Works on any soup; O(n log n) time in the worst bucket, linear for bounded valence.

use super::carried::{EdgeKey, edge_key};
use super::id::{Edge, EdgeId, Face, FaceId, IdVec, Vertex, VertexId};
use super::soup::Soup;
use super::surface::Surface;

/// A mesh whose faces can be asked for their corners.
pub trait Faces {
    /// Number of vertices.
    fn vertex_count(&self) -> usize;
    /// Number of faces.
    fn face_count(&self) -> usize;
    /// The corners of a face in order.
    fn corners(&self, face: FaceId) -> &[VertexId];
}

impl Faces for Soup {
    fn vertex_count(&self) -> usize {
        self.points.len()
    }
    fn face_count(&self) -> usize {
        self.faces.len()
    }
    fn corners(&self, face: FaceId) -> &[VertexId] {
        self.faces[face].corners()
    }
}

impl Faces for Surface {
    fn vertex_count(&self) -> usize {
        self.points.len()
    }
    fn face_count(&self) -> usize {
        self.faces.len()
    }
    fn corners(&self, face: FaceId) -> &[VertexId] {
        &self.faces[face]
    }
}

/// The place of one side of a face: side `k` runs from corner `k` to the next.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct SideRef {
    /// The face.
    pub face: FaceId,
    /// The side's number.
    pub side: u8,
    /// Whether the side runs from the smaller end to the larger.
    pub is_forward: bool,
}

/// Lists of different length in one array.
#[derive(Clone, Debug)]
struct Lists<T> {
    offsets: Vec<u32>,
    items: Vec<T>,
}

impl<T> Lists<T> {
    fn get(&self, index: usize) -> &[T] {
        &self.items[self.offsets[index] as usize..self.offsets[index + 1] as usize]
    }

    fn len(&self) -> usize {
        self.offsets.len().saturating_sub(1)
    }
}

/// The edges of a mesh and the sides that meet at each.
#[derive(Clone, Debug)]
pub struct EdgeTable {
    keys: IdVec<Edge, EdgeKey>,
    sides: Lists<SideRef>,
}

impl EdgeTable {
    /// The edges of any mesh whose corners are in range.
    pub fn new(mesh: &impl Faces) -> Self {
        let mut all: Vec<(EdgeKey, SideRef)> = Vec::with_capacity(3 * mesh.face_count());
        for face in (0..mesh.face_count()).map(FaceId::new) {
            let corners = mesh.corners(face);
            for (side, &a) in corners.iter().enumerate() {
                let b = corners[(side + 1) % corners.len()];
                all.push((edge_key(a, b), SideRef { face, side: side as u8, is_forward: a < b }));
            }
        }
        all.sort_unstable();
        let mut table = Self { keys: IdVec::new(), sides: Lists { offsets: vec![0], items: Vec::new() } };
        for group in all.chunk_by(|a, b| a.0 == b.0) {
            table.keys.push(group[0].0);
            table.sides.items.extend(group.iter().map(|(_, side)| *side));
            table.sides.offsets.push(table.sides.items.len() as u32);
        }
        table
    }

    /// Number of edges.
    pub fn len(&self) -> usize {
        self.keys.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.keys.is_empty()
    }

    /// The ends of all edges, sorted.
    pub fn keys(&self) -> &IdVec<Edge, EdgeKey> {
        &self.keys
    }

    /// The ends of an edge.
    pub fn key(&self, edge: EdgeId) -> EdgeKey {
        self.keys[edge]
    }

    /// The edge with these ends.
    pub fn find(&self, key: EdgeKey) -> Option<EdgeId> {
        self.keys.as_slice().binary_search(&key).ok().map(EdgeId::new)
    }

    /// The sides at an edge, by face.
    pub fn sides(&self, edge: EdgeId) -> &[SideRef] {
        self.sides.get(edge.index())
    }

    /// Edges with their sides.
    pub fn iter(&self) -> impl Iterator<Item = (EdgeId, EdgeKey, &[SideRef])> {
        self.keys.enumerate().map(|(edge, &key)| (edge, key, self.sides(edge)))
    }

    /// The edges of each triangle; side `k` runs from corner `k` to the next. Quads lose their fourth side.
    pub fn edges_of_triangles(&self, faces: usize) -> IdVec<Face, [EdgeId; 3]> {
        let mut of = IdVec::filled([EdgeId::from_raw(0); 3], faces);
        for (edge, _, sides) in self.iter() {
            for side in sides {
                if let Some(slot) = of[side.face].get_mut(usize::from(side.side)) {
                    *slot = edge;
                }
            }
        }
        of
    }

    /// Whether every edge has exactly two sides.
    pub fn is_closed(&self) -> bool {
        (0..self.sides.len()).all(|e| self.sides.get(e).len() == 2)
    }
}

/// The faces at each vertex.
#[derive(Clone, Debug)]
pub struct VertexFaces {
    lists: Lists<FaceId>,
}

impl VertexFaces {
    /// The faces at each vertex of any mesh whose corners are in range; a face with a repeated corner comes twice.
    pub fn new(mesh: &impl Faces) -> Self {
        let faces = || (0..mesh.face_count()).map(FaceId::new);
        let mut offsets = vec![0_u32; mesh.vertex_count() + 1];
        for v in faces().flat_map(|f| mesh.corners(f)) {
            offsets[v.index() + 1] += 1;
        }
        for i in 1..offsets.len() {
            offsets[i] += offsets[i - 1];
        }
        let mut items = vec![FaceId::from_raw(0); offsets.last().map_or(0, |&n| n as usize)];
        let mut fill = offsets.clone();
        for f in faces() {
            for v in mesh.corners(f) {
                items[fill[v.index()] as usize] = f;
                fill[v.index()] += 1;
            }
        }
        Self { lists: Lists { offsets, items } }
    }

    /// The faces at a vertex, in order.
    pub fn of(&self, vertex: VertexId) -> &[FaceId] {
        self.lists.get(vertex.index())
    }
}

/// Rims of a surface: the vertices of each loop in order round the hole, beginning with the lowest; loops by that one.
///
/// A rim runs against the faces' orientation, so that a face filling the hole has its corners in this order. At a
/// vertex where several rims touch, the next half-edge is the one of the lowest target.
pub fn boundary_loops(edges: &EdgeTable) -> Vec<Vec<VertexId>> {
    let mut next: Vec<(VertexId, VertexId)> = edges
        .iter()
        .filter(|(_, _, sides)| sides.len() == 1)
        .map(|(_, [a, b], sides)| if sides[0].is_forward { (b, a) } else { (a, b) })
        .collect();
    next.sort_unstable();
    let mut used = vec![false; next.len()];
    let mut loops = Vec::new();
    for start in 0..next.len() {
        let mut at = start;
        let mut vertices = Vec::new();
        while !used[at] {
            used[at] = true;
            let (from, to) = next[at];
            vertices.push(from);
            let first = next.partition_point(|&(origin, _)| origin < to);
            let following = (first..next.len()).take_while(|&k| next[k].0 == to).find(|&k| !used[k]);
            let Some(following) = following else { break };
            at = following;
        }
        if !vertices.is_empty() {
            loops.push(vertices);
        }
    }
    loops
}

/// The component of each face: faces that share a vertex belong together; numbered by their lowest face.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Components {
    /// Component of each face.
    pub of_face: IdVec<Face, u32>,
    /// How many there are.
    pub count: usize,
}

/// The components of a mesh, joined by shared vertices.
pub fn components(mesh: &impl Faces) -> Components {
    let mut union = Union::new(mesh.vertex_count());
    let faces = || (0..mesh.face_count()).map(FaceId::new);
    for f in faces() {
        for pair in mesh.corners(f).windows(2) {
            union.join(pair[0].index(), pair[1].index());
        }
    }
    let mut number: IdVec<Vertex, u32> = IdVec::filled(u32::MAX, mesh.vertex_count());
    let mut result = Components::default();
    for f in faces() {
        let Some(&corner) = mesh.corners(f).first() else { continue };
        let root = VertexId::new(union.root(corner.index()));
        if number[root] == u32::MAX {
            number[root] = result.count as u32;
            result.count += 1;
        }
        result.of_face.push(number[root]);
    }
    result
}

/// `V − E + F`, counting the vertices that faces use.
pub fn euler_characteristic(mesh: &impl Faces, edges: &EdgeTable) -> i64 {
    let mut used = vec![false; mesh.vertex_count()];
    for v in (0..mesh.face_count()).map(FaceId::new).flat_map(|f| mesh.corners(f)) {
        used[v.index()] = true;
    }
    let vertices = used.iter().filter(|&&u| u).count();
    vertices as i64 - edges.len() as i64 + mesh.face_count() as i64
}

/// Disjoint sets with path halving; the root of a set is its lowest member.
struct Union {
    parent: Vec<u32>,
}

impl Union {
    fn new(len: usize) -> Self {
        Self { parent: (0..len as u32).collect() }
    }

    fn root(&mut self, mut at: usize) -> usize {
        while self.parent[at] as usize != at {
            let up = self.parent[at] as usize;
            self.parent[at] = self.parent[up];
            at = up;
        }
        at
    }

    fn join(&mut self, a: usize, b: usize) {
        let (a, b) = (self.root(a), self.root(b));
        self.parent[a.max(b)] = a.min(b) as u32;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::halfedge::tests::{surface, tetrahedron};

    #[test]
    fn a_tetrahedron_is_closed_and_one_piece() {
        let mesh = tetrahedron();
        let edges = EdgeTable::new(&mesh);
        assert_eq!((edges.len(), edges.is_closed(), euler_characteristic(&mesh, &edges)), (6, true, 2));
        assert_eq!(components(&mesh).count, 1);
        assert!(boundary_loops(&edges).is_empty());
        assert_eq!(VertexFaces::new(&mesh).of(VertexId::new(3)), [1, 2, 3].map(FaceId::new));
    }

    #[test]
    fn a_rim_runs_round_the_hole() {
        let points = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [5.0, 0.0, 0.0], [6.0, 0.0, 0.0], [5.0, 1.0, 0.0]];
        let two = surface(&points, &[[0, 1, 2], [3, 4, 5]]);
        let edges = EdgeTable::new(&two);
        assert_eq!(boundary_loops(&edges), [[0, 2, 1].map(VertexId::new), [3, 5, 4].map(VertexId::new)]);
        assert_eq!(components(&two).of_face.as_slice(), [0, 1]);
        assert_eq!(edges.find([VertexId::new(0), VertexId::new(2)]), Some(EdgeId::new(1)));
        assert_eq!(edges.find([VertexId::new(0), VertexId::new(5)]), None);
    }
}
