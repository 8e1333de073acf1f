//! Measure: all metrics of shapes whose figures are known.

use std::f64::consts::PI;

use meshmill::step::Artifact;

use super::golden::golden_of;
use crate::shapes;
use crate::step::soup;

fn number(artifact: &Artifact, name: &str) -> f64 {
    let Artifact::Metrics(table) = artifact else { panic!("a table") };
    table.get(name).unwrap_or_else(|| panic!("no {name}")).as_f64()
}

#[test]
fn a_cube() {
    let made = golden_of("measure", "cube", "", "", &[("from", soup(shapes::cube()))]).artifact;
    for (name, value) in [("area", 6.0), ("volume", 1.0), ("euler-characteristic", 2.0), ("genus", 0.0)] {
        assert!((number(&made, name) - value).abs() < 1e-12, "{name}");
    }
    assert!((number(&made, "max-angle") - 90.0).abs() < 1e-12);
}

#[test]
fn a_coarse_sphere_against_a_fine_one() {
    let inputs = [("from", soup(shapes::sphere(2))), ("reference", soup(shapes::sphere(4)))];
    let made = golden_of("measure", "spheres", "", "", &inputs).artifact;
    assert!(number(&made, "distance") >= number(&made, "rms-distance"));
    assert!(number(&made, "volume") < 4.0 / 3.0 * PI);
}

#[test]
fn defects_are_counted() {
    let made = golden_of("measure", "moebius", "", "", &[("from", soup(shapes::moebius(12)))]).artifact;
    assert_eq!(number(&made, "oriented"), 0.0);
    let made = golden_of("measure", "t-joint", "", "", &[("from", soup(shapes::t_joint(3)))]).artifact;
    assert_eq!((number(&made, "manifold"), number(&made, "non-manifold-edges")), (0.0, 3.0));
}
