//! Signs and meetings of triangles: by hand, against a test of all edges, in any order of corners.

use glam::{DVec3, dvec2, dvec3};
use proptest::prelude::*;

use super::*;

const A: [DVec3; 3] = [DVec3::ZERO, DVec3::new(4.0, 0.0, 0.0), DVec3::new(0.0, 4.0, 0.0)];

fn meets(b: [[f64; 3]; 3], expected: Meeting) {
    let b = b.map(DVec3::from_array);
    for turn in 0..3 {
        for (a, b) in [(A, b), (b, A), ([A[1], A[0], A[2]], b), (A, [b[2], b[1], b[0]])] {
            let mut b = b;
            b.rotate_left(turn);
            assert_eq!(triangle_triangle(a, b), expected, "{b:?}");
        }
    }
}

#[test]
fn signs_follow_their_doc() {
    assert_eq!(orient3d(DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z), 1);
    assert_eq!(orient2d(dvec2(0.0, 0.0), dvec2(1.0, 0.0), dvec2(0.0, 1.0)), 1);
    assert_eq!(incircle(dvec2(0.0, 0.0), dvec2(1.0, 0.0), dvec2(0.0, 1.0), dvec2(0.5, 0.5)), 1);
    assert_eq!(incircle(dvec2(0.0, 0.0), dvec2(1.0, 0.0), dvec2(0.0, 1.0), dvec2(1.0, 1.0)), 0);
}

#[test]
fn apart_and_crossing_and_touching() {
    meets([[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]], Meeting::Disjoint);
    meets([[5.0, 5.0, -1.0], [6.0, 5.0, 1.0], [5.0, 6.0, 1.0]], Meeting::Disjoint);
    // Pierces the inside.
    meets([[1.0, 1.0, -1.0], [1.0, 1.5, 1.0], [1.5, 1.0, 1.0]], Meeting::Crossing);
    // Each sticks through an edge of the other.
    meets([[1.0, -1.0, -1.0], [1.0, -1.0, 1.0], [1.0, 1.0, 0.0]], Meeting::Crossing);
    // A corner, and an edge, on the inside.
    meets([[1.0, 1.0, 0.0], [1.0, 2.0, 1.0], [2.0, 1.0, 1.0]], Meeting::Touching);
    meets([[1.0, 1.0, 0.0], [2.0, 1.0, 0.0], [2.0, 1.0, 1.0]], Meeting::Touching);
    // Two edges meet in one point.
    meets([[1.0, 0.0, -1.0], [1.0, 0.0, 1.0], [1.0, -1.0, 0.0]], Meeting::Touching);
    // An edge in the plane beside the triangle.
    meets([[5.0, 0.0, 0.0], [5.0, 1.0, 0.0], [5.0, 0.0, 1.0]], Meeting::Disjoint);
}

#[test]
fn neighbours_over_an_edge_meet_only_when_folded() {
    meets([[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, -4.0, 0.0]], Meeting::Disjoint);
    meets([[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [1.0, 1.0, 3.0]], Meeting::Disjoint);
    meets([[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [1.0, 1.0, 0.0]], Meeting::Overlapping);
    meets([[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0]], Meeting::Duplicate);
}

#[test]
fn neighbours_at_a_corner_meet_only_elsewhere() {
    meets([[0.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]], Meeting::Disjoint);
    meets([[0.0, 0.0, 0.0], [-1.0, 0.0, 1.0], [0.0, -1.0, 1.0]], Meeting::Disjoint);
    // The insides overlap in the plane.
    meets([[0.0, 0.0, 0.0], [1.0, 1.0, 0.0], [1.0, 2.0, 0.0]], Meeting::Overlapping);
    // The edges lie on each other, the insides apart.
    meets([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [1.0, -2.0, 0.0]], Meeting::Touching);
    meets([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [1.0, -2.0, 1.0]], Meeting::Touching);
    // The opposite edge pierces.
    meets([[0.0, 0.0, 0.0], [1.0, 1.0, 1.0], [1.0, 1.0, -1.0]], Meeting::Crossing);
    // The plane is crossed outside the triangle.
    meets([[0.0, 0.0, 0.0], [-1.0, 1.0, 1.0], [-1.0, 1.0, -1.0]], Meeting::Disjoint);
}

#[test]
fn coplanar_triangles() {
    meets([[1.0, 1.0, 0.0], [9.0, 1.0, 0.0], [1.0, 9.0, 0.0]], Meeting::Overlapping);
    meets([[1.0, 1.0, 0.0], [1.5, 1.0, 0.0], [1.0, 1.5, 0.0]], Meeting::Overlapping);
    meets([[2.0, 2.0, 0.0], [9.0, 2.0, 0.0], [2.0, 9.0, 0.0]], Meeting::Touching);
    meets([[3.0, 3.0, 0.0], [9.0, 3.0, 0.0], [3.0, 9.0, 0.0]], Meeting::Disjoint);
}

#[test]
fn triangles_without_area_are_told() {
    meets([[1.0, 1.0, -1.0], [1.0, 1.0, 0.0], [1.0, 1.0, 1.0]], Meeting::Degenerate);
    assert!(is_degenerate([DVec3::ZERO, DVec3::ONE, 3.0 * DVec3::ONE]));
    assert!(!is_degenerate([DVec3::ZERO, DVec3::ONE, dvec3(3.0, 3.0, 3.000_000_000_000_001)]));
}

#[test]
fn segments_and_triangles() {
    assert!(segment_triangle([dvec3(1.0, 1.0, -1.0), dvec3(1.0, 1.0, 1.0)], A));
    assert!(segment_triangle([dvec3(2.0, 2.0, 0.0), dvec3(1.0, 1.0, 1.0)], A));
    assert!(segment_triangle([dvec3(-1.0, 1.0, 0.0), dvec3(9.0, 1.0, 0.0)], A));
    assert!(!segment_triangle([dvec3(3.0, 3.0, -1.0), dvec3(3.0, 3.0, 1.0)], A));
    assert!(!segment_triangle([dvec3(1.0, 1.0, 1.0), dvec3(1.0, 1.0, 2.0)], A));
}

/// Whether two triangles have a common point, by the definition: all edges of each against the other.
fn brute_force(a: [DVec3; 3], b: [DVec3; 3]) -> bool {
    (0..3).any(|i| segment_triangle([a[i], a[(i + 1) % 3]], b) || segment_triangle([b[i], b[(i + 1) % 3]], a))
}

fn grid_triangle() -> impl Strategy<Value = [DVec3; 3]> {
    // A small integer grid makes touching and coplanar cases frequent.
    prop::array::uniform3(prop::array::uniform3(0..4_i32).prop_map(|p| dvec3(p[0].into(), p[1].into(), p[2].into())))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(4000))]

    #[test]
    fn the_answer_is_that_of_all_edges(a in grid_triangle(), b in grid_triangle()) {
        let meeting = triangle_triangle(a, b);
        let shared = a.iter().filter(|p| b.contains(p)).count();
        if meeting != Meeting::Degenerate && shared == 0 {
            prop_assert_eq!(meeting.is_intersection(), brute_force(a, b));
        }
        if meeting.is_intersection() {
            prop_assert!(brute_force(a, b));
        }
    }

    #[test]
    fn the_answer_does_not_depend_on_order(a in grid_triangle(), b in grid_triangle()) {
        let meeting = triangle_triangle(a, b);
        prop_assert_eq!(meeting, triangle_triangle(b, a));
        prop_assert_eq!(meeting, triangle_triangle([a[2], a[0], a[1]], [b[1], b[0], b[2]]));
    }
}
