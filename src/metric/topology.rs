//! Counts and topology of faces of any kind.
//!
//! Everything is computed on the faces without a repeated corner and on the vertices that they use. Corners are joined
//! over shared edges by union-find: a vertex with two groups of corners is not manifold.

use rayon::prelude::*;
use rustc_hash::FxHashSet;

use crate::mesh::{EdgeKey, FaceId, Soup, VertexId, edge_key};

/// One side of a face.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Side {
    key: EdgeKey,
    face: FaceId,
    /// Which corner of the face it starts at.
    corner: u32,
}

/// Counts of a mesh, and the elements at which it is not a closed, oriented manifold.
#[derive(Clone, Debug, Default)]
pub struct Topology {
    /// Vertices that any face uses.
    pub vertices: usize,
    /// Vertices used by faces without repeated corners.
    pub proper_vertices: usize,
    /// Faces without repeated corners.
    pub proper_faces: usize,
    /// Faces that have a corner twice.
    pub repeated: Vec<FaceId>,
    /// Distinct edges.
    pub edges: usize,
    /// Edges with one face, with that face.
    pub boundary: Vec<(EdgeKey, FaceId)>,
    /// Edges with more than two faces, with the first of them.
    pub non_manifold_edges: Vec<(EdgeKey, FaceId)>,
    /// Edges whose two faces run them in the same way, with the first of them.
    pub inconsistent: Vec<(EdgeKey, FaceId)>,
    /// Vertices of several fans, or on a non-manifold edge.
    pub non_manifold_vertices: Vec<VertexId>,
    /// Parts connected over vertices.
    pub components: usize,
    /// Parts connected over edges.
    pub shells: usize,
    /// Connected components of the boundary edges.
    pub boundary_loops: usize,
    /// Number of edges at each vertex; 0 where unused.
    pub valence: Vec<u32>,
    /// Whether each vertex lies on an edge that has not exactly two faces.
    pub on_border: Vec<bool>,
    /// Faces with the corners of an earlier face of the same kind.
    pub duplicates: Vec<FaceId>,
}

impl Topology {
    /// Vertices − edges + faces.
    pub fn euler(&self) -> i64 {
        self.proper_vertices as i64 - self.edges as i64 + self.proper_faces as i64
    }

    /// Whether there is a face and every edge has two.
    pub fn is_closed(&self) -> bool {
        self.proper_faces > 0 && self.boundary.is_empty() && self.non_manifold_edges.is_empty()
    }

    /// Whether no edge has more than two faces.
    pub fn is_edge_manifold(&self) -> bool {
        self.non_manifold_edges.is_empty()
    }

    /// Whether the faces at every vertex form one fan.
    pub fn is_vertex_manifold(&self) -> bool {
        self.non_manifold_vertices.is_empty()
    }

    /// Whether neighbours run their common edge in opposite ways everywhere.
    pub fn is_oriented(&self) -> bool {
        self.is_edge_manifold() && self.inconsistent.is_empty()
    }

    /// Handles of all shells together; `None` unless manifold and oriented.
    pub fn genus(&self) -> Option<f64> {
        let fit = self.is_oriented() && self.is_vertex_manifold() && self.proper_faces > 0;
        fit.then(|| (2.0 * self.shells as f64 - self.boundary_loops as f64 - self.euler() as f64) / 2.0)
    }
}

struct UnionFind(Vec<u32>);

impl UnionFind {
    fn new(len: usize) -> Self {
        Self((0..len as u32).collect())
    }

    fn find(&mut self, mut i: u32) -> u32 {
        while self.0[i as usize] != i {
            self.0[i as usize] = self.0[self.0[i as usize] as usize];
            i = self.0[i as usize];
        }
        i
    }

    /// The lower root stays, so that roots do not depend on the order of unions.
    fn union(&mut self, a: u32, b: u32) {
        let (a, b) = (self.find(a), self.find(b));
        self.0[a.max(b) as usize] = a.min(b);
    }
}

fn has_repeats(corners: &[VertexId]) -> bool {
    (1..corners.len()).any(|i| corners[..i].contains(&corners[i]))
}

/// The topology of a mesh.
pub fn topology(mesh: &Soup) -> Topology {
    let mut out = Topology {
        valence: vec![0; mesh.points.len()],
        on_border: vec![false; mesh.points.len()],
        ..Topology::default()
    };
    let sides = collect_sides(mesh, &mut out);
    let mut fans = UnionFind::new(4 * mesh.faces.len());
    let mut shells = UnionFind::new(mesh.faces.len());
    for around in sides.chunk_by(|a, b| a.key == b.key) {
        classify_edge(mesh, around, &mut out);
        for pair in around.windows(2) {
            shells.union(pair[0].face.raw(), pair[1].face.raw());
            for end in around[0].key {
                fans.union(corner_at(mesh, &pair[0], end), corner_at(mesh, &pair[1], end));
            }
        }
    }
    out.proper_vertices = out.valence.iter().filter(|&&n| n > 0).count();
    out.components = count_components(mesh, &sides, &out);
    let mut roots: Vec<u32> = sides.iter().map(|s| shells.find(s.face.raw())).collect();
    roots.sort_unstable();
    roots.dedup();
    out.shells = roots.len();
    out.non_manifold_vertices = non_manifold_vertices(mesh, &sides, &mut fans, &out);
    out.boundary_loops = count_loops(&out.boundary);
    out.duplicates = duplicates(mesh, &out.repeated);
    out
}

/// All sides of proper faces, sorted by edge, then by face.
fn collect_sides(mesh: &Soup, out: &mut Topology) -> Vec<Side> {
    let mut used = vec![false; mesh.points.len()];
    let mut sides = Vec::with_capacity(3 * mesh.faces.len());
    for (face, facet) in mesh.faces.enumerate() {
        let corners = facet.corners();
        for v in corners {
            used[v.index()] = true;
        }
        if has_repeats(corners) {
            out.repeated.push(face);
            continue;
        }
        out.proper_faces += 1;
        for (i, &v) in corners.iter().enumerate() {
            let key = edge_key(v, corners[(i + 1) % corners.len()]);
            sides.push(Side { key, face, corner: i as u32 });
        }
    }
    out.vertices = used.iter().filter(|&&u| u).count();
    sides.par_sort_unstable();
    sides
}

fn start_of(mesh: &Soup, side: &Side) -> VertexId {
    mesh.faces[side.face].corners()[side.corner as usize]
}

/// The corner of the side's face at one end of the edge, as a number.
fn corner_at(mesh: &Soup, side: &Side, end: VertexId) -> u32 {
    let count = mesh.faces[side.face].corners().len() as u32;
    let corner = if start_of(mesh, side) == end { side.corner } else { (side.corner + 1) % count };
    4 * side.face.raw() + corner
}

fn classify_edge(mesh: &Soup, around: &[Side], out: &mut Topology) {
    let entry = (around[0].key, around[0].face);
    out.edges += 1;
    for end in entry.0 {
        out.valence[end.index()] += 1;
        out.on_border[end.index()] |= around.len() != 2;
    }
    match around {
        [_] => out.boundary.push(entry),
        [a, b] => {
            if start_of(mesh, a) == start_of(mesh, b) {
                out.inconsistent.push(entry);
            }
        }
        _ => out.non_manifold_edges.push(entry),
    }
}

fn count_components(mesh: &Soup, sides: &[Side], out: &Topology) -> usize {
    let mut parts = UnionFind::new(mesh.points.len());
    for side in sides {
        parts.union(side.key[0].raw(), side.key[1].raw());
    }
    (0..mesh.points.len()).filter(|&v| out.valence[v] > 0 && parts.find(v as u32) == v as u32).count()
}

fn non_manifold_vertices(mesh: &Soup, sides: &[Side], fans: &mut UnionFind, out: &Topology) -> Vec<VertexId> {
    let mut bad = vec![false; mesh.points.len()];
    for (key, _) in &out.non_manifold_edges {
        bad[key[0].index()] = true;
        bad[key[1].index()] = true;
    }
    let mut fan_of = vec![u32::MAX; mesh.points.len()];
    for side in sides {
        let v = start_of(mesh, side);
        let fan = fans.find(4 * side.face.raw() + side.corner);
        let seen = &mut fan_of[v.index()];
        bad[v.index()] |= *seen != u32::MAX && *seen != fan;
        *seen = fan;
    }
    (0..bad.len()).filter(|&v| bad[v]).map(VertexId::new).collect()
}

fn count_loops(boundary: &[(EdgeKey, FaceId)]) -> usize {
    let mut ends: Vec<VertexId> = boundary.iter().flat_map(|(key, _)| *key).collect();
    ends.sort_unstable();
    ends.dedup();
    let place = |v: VertexId| ends.binary_search(&v).unwrap_or_default() as u32;
    let mut parts = UnionFind::new(ends.len());
    for (key, _) in boundary {
        parts.union(place(key[0]), place(key[1]));
    }
    (0..ends.len() as u32).filter(|&i| parts.find(i) == i).count()
}

fn duplicates(mesh: &Soup, repeated: &[FaceId]) -> Vec<FaceId> {
    let mut seen = FxHashSet::default();
    let mut found = Vec::new();
    for (face, facet) in mesh.faces.enumerate() {
        if repeated.binary_search(&face).is_ok() {
            continue;
        }
        let mut key = *facet;
        key.corners_mut().sort_unstable();
        if !seen.insert(key) {
            found.push(face);
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::Facet;
    use glam::DVec3;

    fn soup(faces: &[&[u32]]) -> Soup {
        let count = faces.iter().flat_map(|f| f.iter()).max().map_or(0, |&v| v as usize + 1);
        let id = VertexId::from_raw;
        Soup {
            points: vec![DVec3::ZERO; count].into(),
            faces: faces
                .iter()
                .map(|f| match **f {
                    [a, b, c] => Facet::Tri([id(a), id(b), id(c)]),
                    [a, b, c, d] => Facet::Quad([id(a), id(b), id(c), id(d)]),
                    _ => unreachable!("three or four corners"),
                })
                .collect(),
            ..Soup::default()
        }
    }

    #[test]
    fn a_tetrahedron_is_a_sphere() {
        let t = topology(&soup(&[&[0, 2, 1], &[0, 1, 3], &[1, 2, 3], &[2, 0, 3]]));
        assert!(t.is_closed() && t.is_oriented() && t.is_vertex_manifold());
        assert_eq!((t.euler(), t.genus(), t.components, t.shells, t.edges), (2, Some(0.0), 1, 1, 6));
        assert_eq!(t.valence, [3; 4]);
    }

    #[test]
    fn a_quad_has_one_rim() {
        let t = topology(&soup(&[&[0, 1, 2, 3]]));
        assert_eq!((t.boundary.len(), t.boundary_loops, t.euler(), t.genus()), (4, 1, 1, Some(0.0)));
    }

    #[test]
    fn a_bow_tie_of_two_triangles_is_not_vertex_manifold() {
        let t = topology(&soup(&[&[0, 1, 2], &[0, 3, 4]]));
        assert_eq!(t.non_manifold_vertices, [VertexId::from_raw(0)]);
        assert_eq!((t.components, t.shells, t.genus()), (1, 2, None));
    }

    #[test]
    fn flipped_repeated_and_duplicate_faces_are_found() {
        let t = topology(&soup(&[&[0, 1, 2], &[0, 1, 3], &[4, 4, 5], &[1, 2, 0]]));
        assert_eq!(t.repeated, [FaceId::from_raw(2)]);
        assert_eq!(t.duplicates, [FaceId::from_raw(3)]);
        assert_eq!((t.vertices, t.proper_vertices), (6, 4));
        assert_eq!(t.non_manifold_edges.len(), 1);
        let flipped = topology(&soup(&[&[0, 1, 2], &[0, 1, 3]]));
        assert_eq!(flipped.inconsistent.len(), 1);
        assert!(!flipped.is_oriented());
    }

    #[test]
    fn nothing_is_not_closed() {
        let t = topology(&Soup::default());
        assert!(!t.is_closed() && t.is_edge_manifold() && t.genus().is_none());
    }
}
