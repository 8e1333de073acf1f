//! Welds vertices of identical coordinates, for measuring a file.
//!
//! Formats such as STL repeat a vertex for every face; a mesh from a file is measured as the surface that it means.
//! Minus zero equals zero. Steps' results are measured as they are. Vertex fields are dropped, everything else follows.

use rustc_hash::FxHashMap;

use crate::mesh::{Facet, Soup, Support, VertexId, edge_key};

/// The same mesh with every point once; the first vertex of a place stays, order is kept.
pub fn weld_identical(mesh: &Soup) -> Soup {
    let mut places: FxHashMap<[u64; 3], VertexId> = FxHashMap::default();
    let mut points = crate::mesh::IdVec::new();
    let mut target = Vec::with_capacity(mesh.points.len());
    for &p in &mesh.points {
        let key = p.to_array().map(|x| (x + 0.0).to_bits());
        target.push(*places.entry(key).or_insert_with(|| points.push(p)));
    }
    let map = |v: VertexId| target[v.index()];
    let mut faces = mesh.faces.clone();
    for corner in faces.iter_mut().flat_map(Facet::corners_mut) {
        *corner = map(*corner);
    }
    let mut carried = mesh.carried.clone();
    carried.marks.clear();
    carried.pins.clear();
    carried.seams.clear();
    for (&[a, b], &mark) in &mesh.carried.marks {
        carried.mark(edge_key(map(a), map(b)), mark);
    }
    for (&v, &freedom) in &mesh.carried.pins {
        carried.pin(map(v), freedom);
    }
    for members in carried.groups.edges.values_mut() {
        for key in members.iter_mut() {
            *key = edge_key(map(key[0]), map(key[1]));
        }
        members.sort_unstable();
        members.dedup();
    }
    for members in carried.groups.vertices.values_mut() {
        for v in members.iter_mut() {
            *v = map(*v);
        }
        members.sort_unstable();
        members.dedup();
    }
    carried.fields.retain(|field| field.support != Support::Vertex);
    Soup { points, faces, carried }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DVec3, dvec3};

    #[test]
    fn a_soup_of_two_triangles_shares_an_edge() {
        let points = vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::X, dvec3(1.0, 1.0, 0.0), dvec3(-0.0, 1.0, 0.0)];
        let tri = |i: u32| Facet::Tri([i, i + 1, i + 2].map(VertexId::from_raw));
        let soup = Soup { points: points.into(), faces: vec![tri(0), tri(3)].into(), ..Soup::default() };
        let welded = weld_identical(&soup);
        assert_eq!(welded.points.len(), 4);
        assert_eq!(welded.faces.as_slice()[1], Facet::Tri([1, 3, 2].map(VertexId::from_raw)));
    }
}
