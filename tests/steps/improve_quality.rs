//! Improve-quality: slivers go, shape, curves and topology stay.

use std::sync::Arc;

use meshmill::metric;
use meshmill::step::{Artifact, FileBytes};
use meshmill::watch::Watch;

use super::golden::golden;
use crate::shapes;
use crate::step::{run, run_locked, surface};

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

#[test]
fn beside_kept_edges_no_face_gets_worse_than_what_was_there() {
    // The top of the part keeps its needles, so that nothing can be mended beside it.
    let bytes = include_bytes!("../../examples/meshes/simple_part.stl").to_vec();
    let file = Artifact::File(Arc::new(FileBytes { name: "simple_part.stl".to_owned(), bytes }));
    let read = run_locked("read", "main", "", "", &[("file", file)]).unwrap().artifact;
    let clean = run("repair", "", &read).artifact;
    let top = run("select", "name = \"top\", normal = { direction = [0, 0, 1], angle = 40 }", &clean).artifact;
    let marked = run("features", "angle = 35", &top).artifact;
    let made = |step: &str, parameters: &str| {
        let inputs = [("from", marked.clone())];
        let made = run_locked(step, "main", parameters, "keep = [\"top\"]", &inputs).unwrap().artifact;
        let measured = metric::measure(&made.to_soup().unwrap(), None, &Watch::silent()).unwrap();
        measured.get("min-stretch").unwrap().as_f64()
    };
    let refined = made("refine", "max-edge = \"4%\"");
    let improved = made("improve-quality", "max-edge = \"4%\", tolerance = \"0.2%\"");
    assert!(improved >= refined.min(0.2) * (1.0 - 1e-9), "{improved} after {refined}");
}
