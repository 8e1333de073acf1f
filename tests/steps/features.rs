//! Features: sharp edges, rims and corners of shapes on which everybody would draw the same ones.

use meshmill::step::Artifact;

use super::golden::golden;
use crate::shapes;
use crate::step::{run, surface};

fn of(mesh: &meshmill::mesh::Soup) -> Artifact {
    surface(shapes::surface(mesh))
}

#[test]
fn a_cube_has_twelve_edges_and_eight_corners() {
    let made = golden("features", "cube", "angle = 30", &of(&shapes::subdivided(&shapes::cube(), 2)));
    assert_eq!((&made.stats["curves"], &made.stats["corners"]), (&12.into(), &8.into()));
    assert_eq!(made.stats["sharp-edges"], 12 * 4);
}

#[test]
fn a_cylinder_has_two_circles_without_a_corner() {
    let made = golden("features", "cylinder", "angle = 40", &of(&shapes::cylinder(24, 4)));
    assert_eq!((&made.stats["curves"], &made.stats["corners"]), (&2.into(), &0.into()));
}

#[test]
fn a_rim_is_a_curve() {
    let made = golden("features", "grid", "", &of(&shapes::grid(6)));
    assert_eq!((&made.stats["rim-edges"], &made.stats["corners"]), (&24.into(), &4.into()));
}

#[test]
fn a_coarse_cylinder_makes_the_angle_doubtful() {
    let made = golden("features", "coarse cylinder", "angle = 40", &of(&shapes::cylinder(12, 4)));
    assert_eq!(made.stats["angle-is-doubtful"], true);
}

#[test]
fn points_and_faces_stay_and_a_second_run_changes_nothing() {
    for (name, shape) in shapes::STANDARD.iter().take(11) {
        let plain = of(&shape());
        let once = run("features", "", &plain).artifact;
        let twice = run("features", "", &once).artifact;
        let [plain, once, twice] = [&plain, &once, &twice].map(|a| a.as_surface().unwrap());
        assert_eq!((&plain.points, &plain.faces), (&once.points, &once.faces), "{name}");
        assert_eq!(once, twice, "{name}");
    }
}
