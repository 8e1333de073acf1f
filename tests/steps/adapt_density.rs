//! Adapt-density: fewer faces, spread as before.

use super::golden::golden;
use crate::levels::levels;
use crate::shapes;

#[test]
fn a_third_of_a_sphere() {
    let parameters = "base = \"70%\", share = \"35%\"";
    let made = golden("adapt-density", "third of a sphere", parameters, &levels(&shapes::sphere(3)));
    assert_eq!(made.stats["target-reached"], true);
}
