//! Improve-quality: slivers go, shape, curves and topology stay.

use super::golden::golden;
use crate::shapes;
use crate::step::{run, surface};

#[test]
fn the_slivers_of_a_cylinder_go() {
    let marked = run("features", "angle = 40", &surface(shapes::surface(&shapes::cylinder(24, 1)))).artifact;
    let made = golden("improve-quality", "cylinder", "max-edge = \"10%\", tolerance = \"1%\"", &marked);
    assert!(made.stats["min-stretch"].as_f64().unwrap() >= 0.2, "{}", made.stats);
}

#[test]
fn by_quadrics_as_the_paper_does() {
    let torus = surface(shapes::surface(&shapes::torus(32, 16)));
    let parameters = "max-edge = \"8%\", tolerance = \"0.5%\", tolerance-mode = \"quadric-rms\", target-faces = 600";
    golden("improve-quality", "torus by quadrics", parameters, &torus);
}

#[test]
fn a_rim_keeps_its_corners() {
    let marked = run("features", "", &surface(shapes::surface(&shapes::grid(8)))).artifact;
    let made = golden("improve-quality", "grid", "max-edge = 0.2, tolerance = \"1%\"", &marked);
    let made = made.artifact.as_surface().unwrap();
    for corner in [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]] {
        assert!(made.points.iter().any(|p| p.to_array() == corner), "the corner {corner:?} is gone");
    }
}
