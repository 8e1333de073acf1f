//! Adapt-region: one half of a sphere is fine.

use super::golden::golden;
use crate::levels::levels;
use crate::shapes;

#[test]
fn the_upper_half_of_a_sphere() {
    let parameters = "size = \"9%\", half-spaces = [{ point = [0, 0, 0.1], normal = [0, 0, 1] }]";
    let made = golden("adapt-region", "upper half of a sphere", parameters, &levels(&shapes::sphere(4)));
    let mesh = made.artifact.as_surface().unwrap();
    let above = mesh.points.iter().filter(|p| p.z > 0.1).count();
    assert!(above * 2 > mesh.points.len(), "{above} of {}", mesh.points.len());
    // Not on average only: no face at a vertex of the region has a longer side.
    let size = 0.09 * 12.0_f64.sqrt();
    for f in mesh.faces.ids().filter(|&f| mesh.corners(f).iter().any(|p| p.z > 0.1)) {
        let [a, b, c] = mesh.corners(f);
        assert!([a.distance(b), b.distance(c), c.distance(a)].iter().all(|&side| side <= 1.000_001 * size), "{f:?}");
    }
}
