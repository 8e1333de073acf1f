//! Carries fields from one surface to another that lies close to it, by closest points.
//!
//! A vertex takes the values at its closest point of the source, linear in the face there; a face takes those of the
//! face closest to its centroid. Editing steps drop fields and call this when they are done.
//! Invariants: a surface transferred onto itself has the same fields; linear fields on flat faces are exact.
//! Cost: O(n log n), in parallel, with results in id order.

use rayon::prelude::*;

use super::bvh::TriangleBvh;
use super::carried::{Field, Support};
use super::geometry::centroid;
use super::id::{FaceId, VertexId};
use super::surface::Surface;

/// Where values come from: a face of the source and weights of its corners.
type Origin = Option<(FaceId, [f64; 3])>;

/// Gives `target` the fields of `source`, whose hierarchy is `tree`. Fields of the same name and support are replaced.
pub fn transfer_fields(source: &Surface, tree: &TriangleBvh, target: &mut Surface) {
    let fields = &source.carried.fields;
    let find = |p| tree.closest(p).map(|found| (found.face(), found.nearest.weights));
    let mut at_vertices: Vec<Origin> = Vec::new();
    if fields.iter().any(|field| field.support == Support::Vertex) {
        at_vertices = target.points.as_slice().par_iter().map(|&p| find(p)).collect();
    }
    let mut at_faces: Vec<Origin> = Vec::new();
    if fields.iter().any(|field| field.support == Support::Face) {
        let points = &target.points;
        at_faces = target.faces.as_slice().par_iter().map(|c| find(centroid(c.map(|v| points[v])))).collect();
    }
    for field in fields {
        let values = match field.support {
            Support::Vertex => vertex_values(source, field, &at_vertices),
            Support::Face => face_values(field, &at_faces),
        };
        target.carried.set_field(Field { values, ..field.clone() });
    }
}

/// Gives `target` the fields of `source` where there are any, see [`transfer_fields`].
pub fn inherit_fields(source: &Surface, target: &mut Surface) {
    if !source.carried.fields.is_empty() {
        transfer_fields(source, &TriangleBvh::of_surface(source), target);
    }
}

fn vertex_values(source: &Surface, field: &Field, origins: &[Origin]) -> Vec<f64> {
    let n = field.components;
    let at = |v: VertexId, k: usize| field.values.get(n * v.index() + k).copied().unwrap_or(f64::NAN);
    let mut values = Vec::with_capacity(n * origins.len());
    for origin in origins {
        values.extend((0..n).map(|k| match *origin {
            // A weight of zero must not carry over a value that is no number.
            Some((face, weights)) => {
                (0..3).filter(|&c| weights[c] != 0.0).map(|c| weights[c] * at(source.faces[face][c], k)).sum()
            }
            None => f64::NAN,
        }));
    }
    values
}

fn face_values(field: &Field, origins: &[Origin]) -> Vec<f64> {
    let n = field.components;
    let mut values = Vec::with_capacity(n * origins.len());
    for origin in origins {
        let at = |k: usize| origin.and_then(|(face, _)| field.values.get(n * face.index() + k).copied());
        values.extend((0..n).map(|k| at(k).unwrap_or(f64::NAN)));
    }
    values
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::halfedge::tests::{surface, tetrahedron};

    fn with_fields(mut mesh: Surface) -> Surface {
        let values = mesh.points.iter().map(|p| p.x + 2.0 * p.y).collect();
        mesh.carried.set_field(Field { name: "f".into(), support: Support::Vertex, components: 1, values });
        let values = (0..2 * mesh.faces.len()).map(|k| k as f64).collect();
        mesh.carried.set_field(Field { name: "g".into(), support: Support::Face, components: 2, values });
        mesh
    }

    #[test]
    fn a_surface_onto_itself_has_the_same_fields() {
        let mesh = with_fields(tetrahedron());
        let mut target = tetrahedron();
        transfer_fields(&mesh, &TriangleBvh::of_surface(&mesh), &mut target);
        assert_eq!(target, mesh);
    }

    #[test]
    fn linear_fields_are_exact_between_vertices() {
        let points = [[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
        let mesh = with_fields(surface(&points, &[[0, 1, 2], [0, 2, 3]]));
        let inner = [[0.5, 0.25, 0.0], [0.75, 0.25, 0.0], [0.25, 0.5, 0.0]];
        let mut target = surface(&inner, &[[0, 1, 2]]);
        transfer_fields(&mesh, &TriangleBvh::of_surface(&mesh), &mut target);
        assert_eq!(target.carried.field(Support::Vertex, "f").map(|f| f.values.clone()), Some(vec![1.0, 1.25, 1.25]));
    }
}
