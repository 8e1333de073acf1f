//! Refine: no edge stays too long.

use super::golden::golden;
use crate::shapes;
use crate::step::{run, surface};

#[test]
fn no_edge_is_longer_than_asked() {
    for (name, shape) in shapes::STANDARD.iter().take(11) {
        let made = run("refine", "max-edge = 0.3", &surface(shapes::surface(&shape()))).artifact;
        let made = made.as_surface().unwrap();
        for face in made.faces.ids() {
            let [a, b, c] = made.corners(face);
            let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
            assert!(longest <= 0.3, "{name}: face {face} has an edge of {longest}");
        }
    }
}

#[test]
fn a_long_bar_and_a_fan() {
    golden("refine", "cylinder", "max-edge = \"10%\"", &surface(shapes::surface(&shapes::cylinder(12, 1))));
    golden("refine", "fan", "max-edge = 0.25", &surface(shapes::surface(&shapes::fan(7))));
}
