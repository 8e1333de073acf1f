//! Subdivide: the law of counts, and the shape stays.

use super::golden::golden;
use crate::shapes;
use crate::step::{run, surface};

#[test]
fn a_round_makes_four_of_one() {
    for (name, shape) in shapes::STANDARD.iter().take(11) {
        let from = surface(shapes::surface(&shape()));
        for times in 0..3 {
            let made = run("subdivide", &format!("times = {times}"), &from).artifact;
            let (before, after) = (from.as_surface().unwrap(), made.as_surface().unwrap());
            assert_eq!(after.faces.len(), before.faces.len() << (2 * times), "{name}");
        }
    }
}

#[test]
fn a_torus_keeps_its_shape() {
    golden("subdivide", "torus", "times = 1", &surface(shapes::surface(&shapes::torus(12, 6))));
}

#[test]
fn marks_are_inherited() {
    let marked = run("features", "", &surface(shapes::surface(&shapes::cube()))).artifact;
    let made = golden("subdivide", "marked cube", "times = 2", &marked);
    assert_eq!(made.artifact.as_surface().unwrap().carried.marks.len(), 12 * 4);
}
