//! Select: the right elements, sorted, and nothing else changed.

use super::golden::golden;
use crate::shapes;
use crate::step::surface;

#[test]
fn the_top_of_a_cube_by_its_normal() {
    let cube = shapes::surface(&shapes::subdivided(&shapes::cube(), 1));
    let made = golden(
        "select",
        "top of a cube",
        "name = \"top\", normal = { direction = [0, 0, 1], angle = 5 }",
        &surface(cube.clone()),
    );
    let mut selected = (**made.artifact.as_surface().unwrap()).clone();
    let top = selected.carried.groups.faces.remove("top").unwrap();
    assert_eq!(top.len(), 8);
    assert!(top.is_sorted() && top.iter().all(|&f| cube.corners(f).iter().all(|p| p.z == 1.0)));
    assert_eq!(selected, cube, "the rest stays");
}

#[test]
fn vertices_in_a_box() {
    let cube = surface(shapes::surface(&shapes::subdivided(&shapes::cube(), 1)));
    let inside = "name = \"low\", of = \"vertices\", box = { min = [-1, -1, -1], max = [2, 2, 0] }";
    let made = golden("select", "foot of a cube", inside, &cube);
    assert_eq!(made.artifact.as_surface().unwrap().carried.groups.vertices["low"].len(), 9);
}

#[test]
fn edges_of_the_rim_of_a_hole() {
    let grid = surface(shapes::surface(&shapes::hole(shapes::grid(6), 30)));
    let made = golden("select", "rims", "name = \"rim\", of = \"edges\", boundary-loop = {}", &grid);
    assert_eq!(made.artifact.as_surface().unwrap().carried.groups.edges["rim"].len(), 24 + 3);
}
