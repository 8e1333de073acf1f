//! Remove-features: a hole goes, the rest stays.

use super::golden::golden;
use crate::shapes;
use crate::step::{run, surface};

#[test]
fn the_hole_of_a_washer_goes() {
    let marked = run("features", "", &surface(shapes::surface(&shapes::washer(24)))).artifact;
    let made = golden("remove-features", "washer", "max-diameter = 0.8", &marked);
    assert_eq!(made.stats["through-holes"], 1);
    let same = run("remove-features", "max-diameter = 0.5", &marked);
    assert_eq!(same.stats["through-holes"], 0, "a hole wider than asked stays");
}
