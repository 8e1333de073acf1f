//! Adapt-curvature: a torus is fine where it bends.

use super::golden::golden;
use crate::shapes;
use crate::step::levels;

#[test]
fn a_torus() {
    golden("adapt-curvature", "torus", "smallest = \"6%\"", &levels(&shapes::torus(32, 16)));
}
