//! Fit-patches: errors, seams, conforming tessellations, and the surface that the quads belong to.

use meshmill::mesh::topology::EdgeTable;
use meshmill::mesh::{Quads, Surface};
use meshmill::step::Artifact;

use super::golden::golden_of;
use crate::shapes;
use crate::step::{run, run_locked, surface};

/// A wavy sheet.
fn sheet() -> Surface {
    let mut mesh = shapes::grid(40);
    mesh.points.iter_mut().for_each(|p| p.z = 0.15 * libm::sin(4.0 * p.x) * libm::cos(3.0 * p.y));
    shapes::surface(&mesh)
}

fn rough(from: &Artifact) -> Artifact {
    run("rough-quads", "interval = 0.25", from).artifact
}

#[test]
fn a_wavy_sheet_is_met_within_the_tolerance() {
    let from = surface(sheet());
    let given = [("from", rough(&from)), ("surface", from.clone())];
    let made = golden_of("fit-patches", "sheet", "tolerance = \"0.1%\"", "", &given);
    let (error, tolerance) = (made.stats["max-error"].as_f64().unwrap(), made.stats["tolerance"].as_f64().unwrap());
    assert!(error <= tolerance, "{}", made.stats);
    assert_eq!(made.stats["patches-beyond"], 0);
}

#[test]
fn the_second_output_is_a_conforming_quad_mesh() {
    let from = surface(sheet());
    let given = [("from", rough(&from)), ("surface", from.clone())];
    let made = run_locked("fit-patches", "quads", "density = 3", "", &given).unwrap();
    let mesh = &made.artifact.as_quads().unwrap().mesh;
    assert_eq!(mesh.faces.len(), 9 * made.stats["patches"].as_u64().unwrap() as usize);
    let edges = EdgeTable::new(mesh);
    assert!(edges.iter().all(|(_, _, sides)| sides.len() <= 2));
    let euler = meshmill::mesh::topology::euler_characteristic(mesh, &edges);
    assert_eq!(euler, 1);
}

#[test]
fn another_surface_is_an_error() {
    let from = surface(sheet());
    let quads = rough(&from);
    let other = surface(shapes::surface(&shapes::grid(40)));
    let given = [("from", quads.clone()), ("surface", other)];
    let failure = run_locked("fit-patches", "main", "", "", &given).unwrap_err();
    assert!(failure.message.contains("another surface"), "{failure}");
    let bare = Quads { mesh: quads.as_quads().unwrap().mesh.clone(), cover: None };
    let given = [("from", Artifact::Quads(std::sync::Arc::new(bare))), ("surface", from)];
    let failure = run_locked("fit-patches", "main", "", "", &given).unwrap_err();
    assert!(failure.message.contains("which faces they cover"), "{failure}");
}

#[test]
fn smooth_seams_get_common_tangent_planes() {
    let from = surface(sheet());
    let given = [("from", rough(&from)), ("surface", from.clone())];
    let made = |params: &str| run_locked("fit-patches", "main", params, "", &given).unwrap().stats;
    let (plain, smooth) = (made("g1 = false"), made("g1 = true"));
    assert!(plain["max-seam-angle"].as_f64() > Some(2.0), "{plain}");
    assert!(smooth["max-seam-angle"].as_f64() <= Some(2.0), "{smooth}");
    assert_eq!(smooth["seams-beyond"], 0, "{smooth}");
    assert!(smooth["max-error"].as_f64() <= smooth["tolerance"].as_f64(), "{smooth}");
}

#[test]
fn crowded_vertices_and_long_triangles_do_not_bend_patches() {
    let mut mesh = shapes::grid(60);
    // Towards one side ever closer, so that triangles are up to a hundred times as long as wide.
    mesh.points.iter_mut().for_each(|p| p.x = p.x * p.x * p.x);
    mesh.points.iter_mut().for_each(|p| p.z = 0.15 * libm::sin(4.0 * p.x) * libm::cos(3.0 * p.y));
    let from = surface(shapes::surface(&mesh));
    let given = [("from", rough(&from)), ("surface", from.clone())];
    let stats = run_locked("fit-patches", "main", "g1 = true", "", &given).unwrap().stats;
    assert!(stats["max-error"].as_f64() <= stats["tolerance"].as_f64(), "{stats}");
    assert_eq!(stats["seams-beyond"], 0, "{stats}");
}
