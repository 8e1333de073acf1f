//! The mesh while it is being repaired: triangles over exactly welded vertices, each with its origin.

use std::collections::BTreeMap;

use glam::DVec3;

use crate::mesh::id::{Face, Vertex};
use crate::mesh::{EdgeKey, FaceId, Facet, IdVec, Soup, VertexId, edge_key};

/// Where a face of the draft comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Origin {
    /// It is this face of the input, or a part of it.
    Input(FaceId),
    /// It fills a hole beside this face of the input.
    Filled(FaceId),
}

impl Origin {
    /// The input face that lends its region and its field values.
    pub(super) fn face(self) -> FaceId {
        match self {
            Self::Input(face) | Self::Filled(face) => face,
        }
    }
}

/// Triangles on the way from a soup to a surface.
///
/// Every pass leaves corners in range and points finite. Vertices that lost all faces stay until the end.
#[derive(Clone, Debug, Default)]
pub(super) struct Draft {
    /// Coordinates.
    pub(super) points: IdVec<Vertex, DVec3>,
    /// The vertex at the same place that this one is a copy of, or itself.
    pub(super) root: IdVec<Vertex, VertexId>,
    /// The mean of these gives the vertex its field values: input vertices.
    pub(super) sources: IdVec<Vertex, Sources>,
    /// Corners of each face.
    pub(super) faces: IdVec<Face, [VertexId; 3]>,
    /// Where each face comes from.
    pub(super) origin: IdVec<Face, Origin>,
    /// The draft vertex of each input vertex.
    pub(super) of_input: IdVec<Vertex, VertexId>,
    /// Vertices put on edges, by the edge's ends; the halves may have been split again.
    pub(super) splits: BTreeMap<EdgeKey, Vec<VertexId>>,
}

/// The input vertices that a vertex takes its field values from: their weighted mean.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Sources {
    /// One input vertex.
    One(VertexId),
    /// The mean of several, all with equal weight.
    Mean(Box<[VertexId]>),
}

impl Sources {
    /// The input vertices as a slice.
    pub(super) fn as_slice(&self) -> &[VertexId] {
        match self {
            Self::One(vertex) => std::slice::from_ref(vertex),
            Self::Mean(vertices) => vertices,
        }
    }
}

impl Draft {
    /// The coordinates of a face's corners.
    pub(super) fn corners(&self, face: FaceId) -> [DVec3; 3] {
        self.faces[face].map(|v| self.points[v])
    }

    /// A further vertex at the place of `vertex`.
    pub(super) fn copy_vertex(&mut self, vertex: VertexId) -> VertexId {
        let root = self.root[vertex];
        self.sources.push(self.sources[vertex].clone());
        self.root.push(root);
        self.points.push(self.points[vertex])
    }

    /// A new vertex whose field values are the mean of those at `between`.
    pub(super) fn new_vertex(&mut self, point: DVec3, between: &[VertexId]) -> VertexId {
        let sources: Vec<VertexId> = between.iter().flat_map(|&v| self.sources[v].as_slice()).copied().collect();
        self.sources.push(Sources::Mean(sources.into_boxed_slice()));
        let vertex = self.points.push(point);
        self.root.push(vertex);
        vertex
    }

    /// Appends a face.
    pub(super) fn push_face(&mut self, corners: [VertexId; 3], origin: Origin) -> FaceId {
        self.origin.push(origin);
        self.faces.push(corners)
    }

    /// Drops the faces for which `keep` is false; the others keep their order.
    pub(super) fn retain_faces(&mut self, keep: &[bool]) {
        let kept = |index: &usize| keep[*index];
        let faces = std::mem::take(&mut self.faces).into_vec();
        self.faces = (0..faces.len()).filter(kept).map(|i| faces[i]).collect();
        let origin = std::mem::take(&mut self.origin).into_vec();
        self.origin = (0..origin.len()).filter(kept).map(|i| origin[i]).collect();
    }

    /// An edge, and the parts of it where vertices were put on it, by the places of their ends.
    pub(super) fn parts_of_edge(&self, a: VertexId, b: VertexId) -> Vec<EdgeKey> {
        let mut parts = vec![edge_key(a, b)];
        let mut done = 0;
        // Each vertex lies strictly between two others, so that this ends; the bound holds even if that fails.
        while done < parts.len() && done < 3 * self.splits.len() + 1 {
            let [a, b] = parts[done];
            for &middle in self.splits.get(&parts[done]).into_iter().flatten() {
                parts.extend([edge_key(a, middle), edge_key(middle, b)]);
            }
            done += 1;
        }
        parts
    }

    /// The vertices of the draft in which each is replaced by `target`; faces and the input's map follow.
    pub(super) fn redirect(&mut self, target: &IdVec<Vertex, VertexId>) {
        for corners in &mut self.faces {
            *corners = corners.map(|v| target[v]);
        }
        for vertex in &mut self.of_input {
            *vertex = target[*vertex];
        }
        for ([a, b], between) in std::mem::take(&mut self.splits) {
            let entry = self.splits.entry(edge_key(target[a], target[b])).or_default();
            entry.extend(between.into_iter().map(|v| target[v]));
        }
    }
}

/// The soup as triangles over vertices of which no two have equal coordinates.
///
/// Vertices are numbered by their first occurrence among the input's vertices.
pub(super) fn triangulate_and_weld_exactly(soup: &Soup) -> Draft {
    let mut draft = weld_exactly(soup);
    let quads = soup.faces.iter().filter(|facet| matches!(facet, Facet::Quad(_))).count();
    draft.faces = IdVec::with_capacity(soup.faces.len() + quads);
    draft.origin = IdVec::with_capacity(soup.faces.len() + quads);
    for (id, facet) in soup.faces.enumerate() {
        match facet {
            Facet::Tri(corners) => {
                draft.push_face(corners.map(|v| draft.of_input[v]), Origin::Input(id));
            }
            Facet::Quad(corners) => {
                for triangle in split_quad(&draft.points, corners.map(|v| draft.of_input[v])) {
                    draft.push_face(triangle, Origin::Input(id));
                }
            }
        }
    }
    draft
}

/// Both triangles of a quad, cut along the diagonal that leaves the better worse triangle.
fn split_quad(points: &IdVec<Vertex, DVec3>, [a, b, c, d]: [VertexId; 4]) -> [[VertexId; 3]; 2] {
    let along_ac = [[a, b, c], [a, c, d]];
    let along_bd = [[b, c, d], [b, d, a]];
    let worst = |pair: [[VertexId; 3]; 2]| {
        let [first, second] = pair.map(|t| t.map(|v| points[v]));
        let folded = normal(first).dot(normal(second)) < 0.0;
        (if folded { -1.0 } else { 1.0 }) * flatness(first).min(flatness(second))
    };
    let (ac, bd) = (worst(along_ac), worst(along_bd));
    // Equal diagonals, as in every rectangle: the one at the lowest vertex, whichever corner the file names first.
    if ac > bd || (ac == bd && a.min(c) <= b.min(d)) { along_ac } else { along_bd }
}

/// Twice the area vector of a triangle.
pub(super) fn normal([a, b, c]: [DVec3; 3]) -> DVec3 {
    (b - a).cross(c - a)
}

/// Height over the longest edge divided by that edge: 0 for a collapsed triangle, 0.866 for an equilateral one.
pub(super) fn flatness(corners: [DVec3; 3]) -> f64 {
    let [a, b, c] = corners;
    let longest = (b - a).length_squared().max((c - b).length_squared()).max((a - c).length_squared());
    if longest > 0.0 { normal(corners).length() / longest } else { 0.0 }
}

/// A draft without faces whose vertices are the distinct points of the soup.
fn weld_exactly(soup: &Soup) -> Draft {
    let count = soup.points.len();
    let mut draft = Draft { of_input: IdVec::with_capacity(count), ..Draft::default() };
    // Open addressing over vertex numbers only: a table of keys would double the peak memory of a large scan.
    let slots = (2 * count).next_power_of_two().max(2);
    let shift = 64 - slots.trailing_zeros();
    let mut table = vec![u32::MAX; slots];
    for (id, point) in soup.points.enumerate() {
        // Adding zero turns a negative zero into zero, so that both are one place.
        let point = *point + DVec3::ZERO;
        let mut slot = (hash_point(point) >> shift) as usize;
        let vertex = loop {
            match table[slot] {
                u32::MAX => {
                    let vertex = draft.points.push(point);
                    draft.root.push(vertex);
                    draft.sources.push(Sources::One(id));
                    table[slot] = vertex.raw();
                    break vertex;
                }
                raw if draft.points[VertexId::from_raw(raw)] == point => break VertexId::from_raw(raw),
                _ => slot = (slot + 1) & (slots - 1),
            }
        };
        draft.of_input.push(vertex);
    }
    draft
}

fn hash_point(point: DVec3) -> u64 {
    const ODD: u64 = 0x9e37_79b9_7f4a_7c15;
    let mix = |state: u64, value: f64| (state.rotate_left(23) ^ value.to_bits()).wrapping_mul(ODD);
    let state = mix(mix(mix(0, point.x), point.y), point.z);
    (state ^ (state >> 29)).wrapping_mul(ODD)
}
