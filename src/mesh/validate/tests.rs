//! Each defect on the smallest mesh that has it.

use super::*;
use crate::mesh::carried::{EdgeMark, Field, Freedom, MarkCause, Regions};
use crate::mesh::halfedge::tests::{enter, surface, tetrahedron};
use glam::DVec3;

const CORNER: [[f64; 3]; 5] = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]];

#[test]
fn a_tetrahedron_has_no_defect() {
    assert_eq!(validate_surface(&tetrahedron()), []);
    assert_eq!(validate_soup(&tetrahedron().to_soup()), []);
    assert_eq!(validate_workshop(&enter(&tetrahedron())), []);
}

#[test]
fn topological_defects_are_named() {
    let v = VertexId::new;
    let f = FaceId::new;
    let fin = surface(&CORNER, &[[0, 1, 2], [1, 0, 3], [0, 1, 4]]);
    assert_eq!(validate_surface(&fin), [Defect::NonManifoldEdge { ends: [v(0), v(1)], faces: vec![f(0), f(1), f(2)] }]);
    let against = surface(&CORNER[..4], &[[0, 1, 2], [0, 1, 3]]);
    assert_eq!(
        validate_surface(&against),
        [Defect::InconsistentOrientation { ends: [v(0), v(1)], faces: [f(0), f(1)] }]
    );
    let bow_tie = surface(&CORNER, &[[0, 1, 2], [0, 3, 4]]);
    assert_eq!(validate_surface(&bow_tie), [Defect::NonFanVertex { vertex: v(0), fans: 2 }]);
    let unused = surface(&CORNER[..4], &[[0, 1, 2]]);
    assert_eq!(validate_surface(&unused), [Defect::UnusedVertex { vertex: v(3) }]);
    let range = surface(&CORNER[..3], &[[0, 1, 1], [0, 1, 9]]);
    assert_eq!(
        validate_surface(&range),
        [Defect::RepeatedCorner { face: f(0), corner: v(1) }, Defect::CornerOutOfRange { face: f(1), corner: v(9) }]
    );
    let twice = surface(&CORNER[..3], &[[0, 1, 2], [2, 1, 0]]);
    assert_eq!(validate_surface(&twice), [Defect::DuplicateFaces { faces: vec![f(0), f(1)] }]);
    let mut far = tetrahedron();
    far.points[v(2)] = DVec3::new(f64::NAN, 0.0, 0.0);
    assert_eq!(validate_surface(&far), [Defect::NonFinitePoint { vertex: v(2) }]);
}

#[test]
fn defects_of_what_is_carried_are_named() {
    let v = VertexId::new;
    let mut mesh = tetrahedron();
    let carried = &mut mesh.carried;
    carried.groups.faces.insert("top".into(), vec![FaceId::new(2), FaceId::new(1)]);
    carried.groups.edges.insert("rim".into(), vec![[v(0), v(9)]]);
    carried.regions = Some(Regions { labels: vec![0, 0, 5].into(), names: vec!["a".into()] });
    let field = Field { name: "h".into(), support: Support::Vertex, components: 1, values: vec![1.0] };
    carried.fields = vec![field.clone(), field];
    carried.mark([v(0), v(7)], EdgeMark { freedom: Freedom::Keep, cause: MarkCause::Locked });
    carried.pin(v(8), Freedom::Keep);
    carried.seams.insert(v(1), SeamId(3));
    let defects = validate_surface(&mesh);
    assert_eq!(defects.len(), 10, "{defects:#?}");
    assert_eq!(defects[0], Defect::UnsortedGroup { kind: GroupKind::Faces, name: "top".into() });
    assert_eq!(defects[9], Defect::SeamWithoutPartner { vertex: v(1), seam: SeamId(3) });
}
