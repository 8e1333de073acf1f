//! Repair: every defect of a generated shape is mended and counted.

use super::golden::golden;
use crate::shapes::{self, duplicate_face, flipped_face, hole};
use crate::step::{run, soup, surface};

#[test]
fn a_good_cube_stays() {
    let cube = shapes::cube();
    let made = golden("repair", "cube", "", &soup(cube.clone()));
    assert_eq!(**made.artifact.as_surface().unwrap(), shapes::surface(&cube));
}

#[test]
fn a_face_that_is_there_twice_goes() {
    golden("repair", "duplicate face", "", &soup(duplicate_face(shapes::sphere(1), 5)));
}

#[test]
fn a_flipped_face_is_turned_back() {
    let made = golden("repair", "flipped face", "", &soup(flipped_face(shapes::sphere(1), 5)));
    assert_eq!(made.stats["faces-turned"], 1);
}

#[test]
fn a_hole_is_filled_where_wanted() {
    let open = soup(hole(shapes::sphere(2), 17));
    golden("repair", "hole left open", "", &open);
    golden("repair", "hole filled", "fill-holes = \"all\"", &open);
}

#[test]
fn a_moebius_strip_is_cut_once() {
    golden("repair", "moebius", "", &soup(shapes::moebius(12)));
}

#[test]
fn a_joint_of_three_plates_is_cut_or_kept_as_a_seam() {
    let joint = soup(shapes::t_joint(4));
    golden("repair", "t-joint cut", "", &joint);
    let made = golden("repair", "t-joint seam", "non-manifold = \"seam\"", &joint);
    let seams = made.artifact.as_surface().unwrap().carried.seams.len();
    assert_eq!(seams, 10, "five places on the line, each on two sheets");
}

#[test]
fn repairing_again_changes_nothing() {
    for (name, shape) in shapes::STANDARD {
        let once = run("repair", "non-manifold = \"seam\"", &soup(shape()));
        let once = once.artifact.as_surface().unwrap();
        let twice = run("repair", "non-manifold = \"seam\"", &surface((**once).clone()));
        assert_eq!(twice.artifact.as_surface().unwrap(), once, "{name}");
    }
}
