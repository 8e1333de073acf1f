//! Unit tests of the workshop: edits, undo, the border.

use glam::{DVec3, dvec3};
use smallvec::smallvec;

use super::*;

/// A grid of n by n squares, each cut into two triangles.
fn grid(n: u32) -> Mixed {
    let points: Vec<DVec3> =
        (0..=n).flat_map(|y| (0..=n).map(move |x| dvec3(f64::from(x), f64::from(y), 0.0))).collect();
    let id = |x: u32, y: u32| y * (n + 1) + x;
    let mut faces: Vec<[u32; 3]> = Vec::new();
    for y in 0..n {
        for x in 0..n {
            faces.push([id(x, y), id(x + 1, y), id(x + 1, y + 1)]);
            faces.push([id(x, y), id(x + 1, y + 1), id(x, y + 1)]);
        }
    }
    let faces: Vec<&[u32]> = faces.iter().map(|f| &f[..]).collect();
    Mixed::of_faces(&points, &faces).unwrap()
}

#[test]
fn two_triangles_become_a_quad_and_again_two_triangles() {
    let mut mesh = grid(3);
    assert_eq!(mesh.faults(), [] as [String; 0]);
    mesh.begin();
    let made = mesh.replace(&[0, 1], &[smallvec![0, 1, 5, 4]], None).unwrap();
    mesh.commit();
    assert_eq!(mesh.faults(), [] as [String; 0]);
    assert_eq!(mesh.census(), (16, 1));
    assert!((mesh.quality(made[0]) - 1.0).abs() < 1e-15);
    mesh.begin();
    mesh.replace(&[made[0]], &[smallvec![0, 1, 4], smallvec![1, 5, 4]], None).unwrap();
    mesh.commit();
    assert_eq!(mesh.faults(), [] as [String; 0]);
    assert_eq!(mesh.census(), (18, 0));
}

#[test]
fn what_does_not_fit_is_undone() {
    let mut mesh = grid(2);
    let before = mesh.leave().0;
    mesh.begin();
    assert!(mesh.replace(&[0, 1], &[smallvec![0, 1, 4]], None).is_none());
    mesh.rollback();
    assert_eq!(mesh.leave().0, before);
    assert_eq!(mesh.faults(), [] as [String; 0]);
}

#[test]
fn a_corner_of_the_border_can_go_and_come_back() {
    let mut mesh = grid(2);
    mesh.begin();
    // The corner vertex 2 of the lower right square goes: its two faces become one triangle.
    mesh.replace(&[2, 3], &[smallvec![1, 5, 4]], None).unwrap();
    mesh.commit();
    assert_eq!(mesh.faults(), [] as [String; 0]);
    assert!(!mesh.is_vertex(2));
    assert_eq!(mesh.faces().count(), 7);
    let loops = mesh.edges().filter(|&h| mesh.face(h) == NONE || mesh.face(h ^ 1) == NONE).count();
    assert_eq!(loops, 7);
}

#[test]
fn a_star_can_be_drawn_into_a_neighbour() {
    let mut mesh = grid(3);
    let (gone, kept) = (5, 6);
    let old: Vec<u32> = mesh.faces_at(gone).collect();
    let mut new: Vec<Corners> = Vec::new();
    for &f in &old {
        let corners: Corners = mesh.corners(f).iter().map(|&v| if v == gone { kept } else { v }).collect();
        if corners.iter().filter(|&&v| v == kept).count() == 1 {
            new.push(corners);
        }
    }
    mesh.begin();
    mesh.replace(&old, &new, Some((gone, kept))).unwrap();
    mesh.commit();
    assert_eq!(mesh.faults(), [] as [String; 0]);
    assert_eq!(mesh.faces().count(), 16);
    mesh.compact();
    assert_eq!(mesh.faults(), [] as [String; 0]);
}

/// A fan of so many triangles about vertex 0, whose rim vertices have these numbers.
fn fan(rim: &[u32]) -> Option<Mixed> {
    let turn = std::f64::consts::TAU / rim.len() as f64;
    let on_rim = |i: usize| dvec3(libm::cos(turn * i as f64), libm::sin(turn * i as f64), 0.0);
    let points: Vec<DVec3> = std::iter::once(DVec3::ZERO).chain((0..rim.len()).map(on_rim)).collect();
    let faces: Vec<[u32; 3]> = (0..rim.len()).map(|i| [0, rim[i], rim[(i + 1) % rim.len()]]).collect();
    let faces: Vec<&[u32]> = faces.iter().map(|f| &f[..]).collect();
    Mixed::of_faces(&points, &faces)
}

#[test]
fn a_star_is_proper_where_no_vertex_is_in_it_twice_however_many_there_are() {
    for count in [5, 31, 33, 200] {
        let mut rim: Vec<u32> = (1..=count).collect();
        let mesh = fan(&rim).unwrap();
        assert!(mesh.is_proper(0, 3) && mesh.is_proper(0, count as usize) && !mesh.is_proper(0, count as usize + 1));
        rim[count as usize - 2] = 2;
        assert!(fan(&rim).is_none(), "{count}: vertex 2 is in the star twice");
    }
}
