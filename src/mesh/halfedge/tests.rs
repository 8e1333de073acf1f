//! Entering and leaving on tiny meshes.

use super::*;
use crate::mesh::{Carried, EdgeMark, MarkCause, Regions, ResolvedFreedom, SeamId, Surface, edge_key};

pub(crate) fn surface(points: &[[f64; 3]], faces: &[[u32; 3]]) -> Surface {
    Surface {
        points: points.iter().map(|&p| DVec3::from_array(p)).collect(),
        faces: faces.iter().map(|&f| f.map(VertexId::from_raw)).collect(),
        carried: Carried::default(),
    }
}

pub(crate) fn enter(surface: &Surface) -> HalfedgeMesh {
    HalfedgeMesh::new(surface, &ResolvedFreedom::free(surface)).expect("a surface")
}

pub(crate) fn tetrahedron() -> Surface {
    surface(
        &[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        &[[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]],
    )
}

#[test]
fn counts_of_a_tetrahedron() {
    let mesh = enter(&tetrahedron());
    assert_eq!((mesh.vertex_count(), mesh.edge_count(), mesh.face_count()), (4, 6, 4));
    assert_eq!(mesh.euler_characteristic(), 2);
    assert!(mesh.vertices().all(|v| mesh.valence(v) == 3 && !mesh.is_boundary_vertex(v)));
    assert!(mesh.boundary_loops().is_empty());
}

#[test]
fn leaving_without_an_edit_gives_the_same_surface() {
    let mut square =
        surface(&[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]], &[[0, 1, 2], [0, 2, 3]]);
    let diagonal = edge_key(VertexId::new(2), VertexId::new(0));
    square.carried.mark(diagonal, EdgeMark { freedom: Freedom::OnCurve, cause: MarkCause::Feature });
    square.carried.pin(VertexId::new(1), Freedom::Keep);
    square.carried.seams.insert(VertexId::new(3), SeamId(7));
    square.carried.regions = Some(Regions { labels: vec![1, 0].into(), names: vec!["A".into(), "b".into()] });
    square.carried.groups.faces.insert("Left".into(), vec![FaceId::new(1)]);
    square.carried.groups.faces.insert("all".into(), vec![FaceId::new(0), FaceId::new(1)]);
    square.carried.groups.edges.insert("cut".into(), vec![diagonal]);
    square.carried.groups.vertices.insert("none".into(), vec![]);
    let left = enter(&square).leave();
    assert_eq!(left.surface, square);
    assert_eq!(left.vertices.get(VertexId::new(3)), Some(VertexId::new(3)));
}

#[test]
fn a_rim_is_one_linked_loop_and_comes_first() {
    let square =
        surface(&[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]], &[[0, 1, 2], [0, 2, 3]]);
    let mesh = enter(&square);
    assert_eq!(mesh.boundary_loops().len(), 1);
    assert!(mesh.vertices().all(|v| mesh.is_boundary_vertex(v) && mesh.face(mesh.vertex_halfedge(v)).is_none()));
    for h in mesh.next.ids() {
        assert_eq!(mesh.next(mesh.prev(h)), h);
        assert_eq!(mesh.prev(mesh.next(h)), h);
    }
}

#[test]
fn refuses_what_is_no_surface_and_says_where() {
    let points = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]];
    let fin = surface(&points, &[[0, 1, 2], [1, 0, 3], [0, 1, 4]]);
    let error = HalfedgeMesh::new(&fin, &ResolvedFreedom::free(&fin)).unwrap_err();
    assert_eq!(error.edges.len(), 1);
    assert_eq!(error.edges[0].faces, [FaceId::new(0), FaceId::new(1), FaceId::new(2)]);
    let flipped = surface(&points[..4], &[[0, 1, 2], [0, 1, 3]]);
    let error = HalfedgeMesh::new(&flipped, &ResolvedFreedom::free(&flipped)).unwrap_err();
    assert_eq!(error.edges[0].ends, [VertexId::new(0), VertexId::new(1)]);
    let bow_tie = surface(&points, &[[0, 1, 2], [0, 3, 4]]);
    let error = HalfedgeMesh::new(&bow_tie, &ResolvedFreedom::free(&bow_tie)).unwrap_err();
    assert_eq!(error.vertices, [NonFan { vertex: VertexId::new(0) }]);
    let unused = surface(&points[..4], &[[0, 1, 2]]);
    let error = HalfedgeMesh::new(&unused, &ResolvedFreedom::free(&unused)).unwrap_err();
    assert_eq!(error.unused, [VertexId::new(3)]);
    let twice = surface(&points[..3], &[[0, 1, 1], [0, 1, 9]]);
    let error = HalfedgeMesh::new(&twice, &ResolvedFreedom::free(&twice)).unwrap_err();
    assert_eq!(error.faces, [FaceId::new(0), FaceId::new(1)]);
}

#[test]
fn an_edge_state_survives_its_byte() {
    for freedom in FREEDOMS {
        assert_eq!(EdgeState::new(freedom, None).mark(), None);
        for cause in CAUSES {
            let mark = EdgeMark { freedom: Freedom::OnCurve, cause };
            let state = EdgeState::new(freedom, Some(mark));
            assert_eq!((state.freedom(), state.mark()), (freedom, Some(mark)));
        }
    }
}
