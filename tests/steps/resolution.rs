//! Resolution: the number of faces asked for, and the finest mesh as it is.

use std::sync::Arc;

use super::golden::golden;
use crate::levels::levels;
use crate::shapes;
use crate::step::run;
use meshmill::step::Artifact;

#[test]
fn half_of_a_sphere() {
    let made = golden("resolution", "half a sphere", "share = \"50%\"", &levels(&shapes::sphere(3)));
    assert_eq!(made.stats["target-reached"], true);
}

#[test]
fn the_whole_is_the_finest_mesh() {
    let hierarchy = levels(&shapes::torus(24, 12));
    let made = run("resolution", "share = \"100%\"", &hierarchy).artifact;
    assert_eq!(made.as_surface().unwrap(), &Arc::new(hierarchy.as_hierarchy().unwrap().finest.clone()));
}

#[test]
fn one_of_two_keys_is_needed() {
    let hierarchy = levels(&shapes::sphere(2));
    for wrong in ["", "faces = 50, share = 0.5"] {
        let inputs: [(&str, Artifact); 1] = [("from", hierarchy.clone())];
        let failure = crate::step::run_locked("resolution", "main", wrong, "", &inputs).unwrap_err();
        assert_eq!(failure.message, "give either `faces` or `share`");
    }
}
