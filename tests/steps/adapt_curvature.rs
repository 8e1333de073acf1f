//! Adapt-curvature: a torus is fine where it bends.

use super::golden::golden;
use crate::levels::levels;
use crate::shapes;

#[test]
fn a_torus() {
    golden("adapt-curvature", "torus", "smallest = \"6%\"", &levels(&shapes::torus(32, 16)));
}
