//! Known answers of the collapse.

use super::*;
use crate::mesh::carried::{EdgeMark, Freedom, MarkCause, edge_key};
use crate::mesh::halfedge::tests::{enter, surface, tetrahedron};
use crate::mesh::{HalfedgeMesh, LockRules, Surface, VertexId, resolve_freedom};

fn octahedron() -> Surface {
    surface(
        &[[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, -1.0]],
        &[[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]],
    )
}

/// A grid of `n` times `n` squares, two triangles each.
fn grid(n: u32) -> Surface {
    let at = |x: u32, y: u32| y * (n + 1) + x;
    let points: Vec<[f64; 3]> = (0..=n).flat_map(|y| (0..=n).map(move |x| [f64::from(x), f64::from(y), 0.0])).collect();
    let mut faces = Vec::new();
    for (x, y) in (0..n).flat_map(|y| (0..n).map(move |x| (x, y))) {
        faces.push([at(x, y), at(x + 1, y), at(x + 1, y + 1)]);
        faces.push([at(x, y), at(x + 1, y + 1), at(x, y + 1)]);
    }
    surface(&points, &faces)
}

fn enter_locked(surface: &Surface) -> HalfedgeMesh {
    let freedom = resolve_freedom(surface, &LockRules::default()).expect("no unknown groups");
    HalfedgeMesh::new(surface, &freedom).expect("a surface")
}

/// Collapses the first edge that may, until none may; checks the mesh after each.
fn collapse_all(mesh: &mut HalfedgeMesh) -> usize {
    let (mut done, chi, loops) = (0, mesh.euler_characteristic(), mesh.boundary_loops().len());
    while let Some(plan) = { mesh.edges().find_map(|e| check_collapse(mesh, e).ok()) } {
        let star: Vec<_> = plan.new_star(mesh).collect();
        let valence = plan.new_valence(mesh);
        let mut ring = collapse::Ring::new();
        plan.ring(mesh, &mut ring);
        let middle = (mesh.point(plan.removed) + mesh.point(plan.kept)) / 2.0;
        collapse(mesh, &plan, middle);
        done += 1;
        assert_eq!(mesh.valence(plan.kept), valence);
        assert_eq!(ring.len(), valence);
        assert!(mesh.neighbours(plan.kept).all(|v| ring.contains(&v)));
        assert_eq!(star.len(), mesh.faces_around(plan.kept).count());
        for (face, corners) in star {
            let now = mesh.corners(face);
            assert!((0..3).any(|r| [corners[r], corners[(r + 1) % 3], corners[(r + 2) % 3]] == now));
        }
        assert_eq!((mesh.euler_characteristic(), mesh.boundary_loops().len()), (chi, loops));
        let left = mesh.clone().leave().surface;
        let again = enter(&left);
        assert_eq!(again.edge_count(), mesh.edge_count());
        assert!(
            mesh.vertices().all(|v| { mesh.is_boundary_vertex(v) == mesh.outgoing(v).any(|h| mesh.face(h).is_none()) })
        );
    }
    done
}

#[test]
fn a_tetrahedron_has_no_valid_collapse() {
    let mesh = enter(&tetrahedron());
    assert!(mesh.edges().all(|e| check_collapse(&mesh, e) == Err(Refusal::FourFaces)));
}

#[test]
fn an_octahedron_collapses_until_four_faces_are_left() {
    let mut mesh = enter(&octahedron());
    assert_eq!(collapse_all(&mut mesh), 2);
    assert_eq!(mesh.face_count(), 4);
}

#[test]
fn a_flat_grid_keeps_its_corners() {
    for n in 1..6 {
        let square = grid(n);
        let mut mesh = enter_locked(&square);
        collapse_all(&mut mesh);
        assert_eq!(mesh.face_count(), 2, "n = {n}");
        for corner in [0, n, n * (n + 1), (n + 1) * (n + 1) - 1].map(VertexId::from_raw) {
            assert_eq!(mesh.point(corner), square.points[corner]);
            assert!(mesh.vertex_is_live(corner));
        }
    }
}

#[test]
fn a_free_rim_collapses_to_one_triangle() {
    let mut mesh = enter(&grid(3));
    collapse_all(&mut mesh);
    assert_eq!(mesh.face_count(), 1);
}

#[test]
fn a_curve_stays_where_it_was_and_kept_edges_stay() {
    let mut square = grid(4);
    let v = |x: u32, y: u32| VertexId::from_raw(y * 5 + x);
    for x in 0..4 {
        let mark = EdgeMark { freedom: Freedom::OnCurve, cause: MarkCause::Feature };
        square.carried.mark(edge_key(v(x, 2), v(x + 1, 2)), mark);
    }
    let kept = edge_key(v(1, 1), v(2, 1));
    square.carried.mark(kept, EdgeMark { freedom: Freedom::Keep, cause: MarkCause::Locked });
    let mut mesh = enter_locked(&square);
    collapse_all(&mut mesh);
    let left = mesh.leave().surface;
    let length = |edge: &[VertexId; 2]| left.points[edge[0]].distance(left.points[edge[1]]);
    let curve: Vec<_> = left.carried.marks.iter().filter(|(_, m)| m.cause == MarkCause::Feature).collect();
    assert_eq!(curve.iter().map(|(edge, _)| length(edge)).sum::<f64>(), 4.0);
    assert!(curve.iter().all(|(edge, _)| edge.iter().all(|&v| left.points[v].y == 2.0)));
    let (edge, _) = left.carried.marks.iter().find(|(_, m)| m.cause == MarkCause::Locked).expect("kept");
    assert_eq!(edge.map(|v| left.points[v].to_array()), [[1.0, 1.0, 0.0], [2.0, 1.0, 0.0]]);
}

#[test]
fn a_group_keeps_its_last_face() {
    let mut square = grid(4);
    square.carried.groups.faces.insert("one".into(), vec![crate::mesh::FaceId::new(9)]);
    square.carried.groups.vertices.insert("middle".into(), vec![VertexId::new(12)]);
    let mut mesh = enter_locked(&square);
    collapse_all(&mut mesh);
    let groups = mesh.leave().surface.carried.groups;
    assert_eq!(groups.faces["one"].len(), 1);
    assert_eq!(groups.vertices["middle"].len(), 1);
}

/// A small linear congruential generator: the same edits in every run.
struct Dice(u64);

impl Dice {
    fn roll(&mut self, sides: usize) -> usize {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((self.0 >> 33) as usize) % sides
    }
}

fn random_edit(mesh: &mut HalfedgeMesh, dice: &mut Dice) -> bool {
    let edge = crate::mesh::EdgeId::new(dice.roll(mesh.edge_slots()));
    if !mesh.edge_is_live(edge) {
        return false;
    }
    let [a, b] = mesh.ends(edge).map(|v| mesh.point(v));
    let middle = (a + b) / 2.0;
    match dice.roll(4) {
        0 => check_split(mesh, edge).map(|plan| split(mesh, &plan, middle)).is_ok(),
        1 => check_flip(mesh, edge).map(|plan| flip(mesh, &plan)).is_ok(),
        _ => check_collapse(mesh, edge).map(|plan| collapse(mesh, &plan, middle)).is_ok(),
    }
}

#[test]
fn random_edits_keep_the_mesh_valid() {
    use crate::mesh::validate::{validate_surface, validate_workshop};
    let mut marked = grid(5);
    let v = |x: u32, y: u32| VertexId::from_raw(y * 6 + x);
    for x in 0..5 {
        let mark = EdgeMark { freedom: Freedom::OnCurve, cause: MarkCause::Feature };
        marked.carried.mark(edge_key(v(x, 2), v(x + 1, 2)), mark);
    }
    marked.carried.groups.faces.insert("half".into(), (0..25).map(crate::mesh::FaceId::new).collect());
    marked.carried.groups.edges.insert("cut".into(), vec![edge_key(v(0, 2), v(1, 2))]);
    marked.carried.groups.vertices.insert("row".into(), (6..12).map(VertexId::new).collect());
    for (case, shape) in [octahedron(), grid(5), marked].iter().enumerate() {
        for seed in 0..20 {
            let mut mesh = if case == 1 { enter(shape) } else { enter_locked(shape) };
            let mut dice = Dice(seed);
            let (chi, loops) = (mesh.euler_characteristic(), mesh.boundary_loops().len());
            for step in 0..300 {
                if random_edit(&mut mesh, &mut dice) {
                    assert_eq!(validate_workshop(&mesh), [], "case {case}, seed {seed}, step {step}");
                    assert_eq!((mesh.euler_characteristic(), mesh.boundary_loops().len()), (chi, loops));
                }
            }
            let left = mesh.leave().surface;
            assert_eq!(validate_surface(&left), []);
            let groups = &left.carried.groups;
            assert!(groups.list().all(|(_, _, members)| members > 0));
            let curve = left.carried.marks.iter().filter(|(_, m)| m.cause == MarkCause::Feature);
            let length: f64 = curve.map(|(e, _)| left.points[e[0]].distance(left.points[e[1]])).sum();
            assert!(case != 2 || (length - 5.0).abs() < 1e-12, "{length}");
        }
    }
}
