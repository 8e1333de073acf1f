//! Repair on small meshes with one defect each: exact counts, and the promises of the step.

use glam::DVec3;
use meshmill::mesh::{Facet, Soup, Surface, VertexId};
use meshmill::steps::repair::{RepairError, RepairParams, RepairStats, repair};
use meshmill::watch::Watch;

/// A soup of points and triangles.
fn soup(points: &[[f64; 3]], faces: &[[u32; 3]]) -> Soup {
    Soup {
        points: points.iter().map(|&p| DVec3::from_array(p)).collect(),
        faces: faces.iter().map(|f| Facet::Tri(f.map(VertexId::from_raw))).collect(),
        ..Soup::default()
    }
}

/// Twelve triangles of the unit cube at `at`, outward, as an STL has them: no shared vertices.
fn cube(at: [f64; 3]) -> Soup {
    let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let corner = |i: u32| [at[0] + f64::from(i & 1), at[1] + f64::from(i >> 1 & 1), at[2] + f64::from(i >> 2 & 1)];
    let mut points = Vec::new();
    for [a, b, c, d] in quads {
        points.extend([a, b, c, a, c, d].map(corner));
    }
    let faces: Vec<[u32; 3]> = (0..12).map(|f| [3 * f, 3 * f + 1, 3 * f + 2]).collect();
    soup(&points, &faces)
}

/// Both soups as one.
fn merged(mut first: Soup, second: &Soup) -> Soup {
    let offset = first.points.len() as u32;
    for &p in &second.points {
        first.points.push(p);
    }
    for facet in &second.faces {
        let mut facet = *facet;
        for corner in facet.corners_mut() {
            *corner = VertexId::from_raw(corner.raw() + offset);
        }
        first.faces.push(facet);
    }
    first
}

fn run(soup: &Soup) -> (Surface, RepairStats) {
    run_with(soup, &RepairParams::default())
}

/// Repairs, and checks what must hold for every result.
fn run_with(soup: &Soup, params: &RepairParams) -> (Surface, RepairStats) {
    let (surface, stats) = repair(soup, params, &Watch::silent()).expect("repairs");
    check_manifold(&surface);
    let (again, _) = repair(&surface.to_soup(), params, &Watch::silent()).expect("repairs again");
    assert!(again == surface, "repairing again changes something");
    (surface, stats)
}

/// Every edge has at most two faces that run along it in opposite directions, and every vertex one fan.
fn check_manifold(surface: &Surface) {
    let mut leaving: Vec<Vec<(VertexId, VertexId)>> = vec![Vec::new(); surface.points.len()];
    for &[a, b, c] in &surface.faces {
        for [v, next, previous] in [[a, b, c], [b, c, a], [c, a, b]] {
            leaving[v.index()].push((next, previous));
        }
    }
    for (v, spokes) in leaving.iter_mut().enumerate() {
        assert!(!spokes.is_empty(), "vertex {v} has no face");
        spokes.sort_unstable();
        assert!(spokes.windows(2).all(|w| w[0].0 != w[1].0), "an edge at vertex {v} has two faces on one side");
        let step = |from: VertexId| spokes.iter().find(|s| s.0 == from).map(|s| s.1);
        let start = spokes.iter().find(|s| spokes.iter().all(|t| t.1 != s.0)).unwrap_or(&spokes[0]).0;
        let mut count = 0;
        let mut here = step(start);
        while let Some(next) = here {
            count += 1;
            here = if next == start { None } else { step(next) };
        }
        assert_eq!(count, spokes.len(), "vertex {v} has more than one fan");
    }
}

/// Vertices minus edges plus faces, and the number of border edges.
fn euler(surface: &Surface) -> (i64, usize) {
    let mut edges: Vec<[VertexId; 2]> = Vec::new();
    for &[a, b, c] in &surface.faces {
        edges.extend([[a.min(b), a.max(b)], [b.min(c), b.max(c)], [c.min(a), c.max(a)]]);
    }
    edges.sort_unstable();
    let border = edges.chunk_by(|a, b| a == b).filter(|c| c.len() == 1).count();
    edges.dedup();
    (surface.points.len() as i64 - edges.len() as i64 + surface.faces.len() as i64, border)
}

fn volume(surface: &Surface) -> f64 {
    surface.faces.ids().map(|f| surface.corners(f)).map(|[a, b, c]| a.dot(b.cross(c)) / 6.0).sum()
}

#[test]
fn cube_of_loose_triangles_is_welded() {
    let (surface, stats) = run(&cube([0.0; 3]));
    assert_eq!((surface.points.len(), surface.faces.len(), euler(&surface)), (8, 12, (2, 0)));
    assert_eq!(stats.vertices_merged, 28);
    assert_eq!(stats.max_move, 0.0);
    assert!((volume(&surface) - 1.0).abs() < 1e-12);
}

#[test]
fn turned_faces_are_turned_back() {
    let mut input = cube([0.0; 3]);
    for facet in input.faces.iter_mut().step_by(3) {
        facet.corners_mut().swap(0, 1);
    }
    let (surface, stats) = run(&input);
    assert_eq!(stats.faces_turned, 4);
    assert!((volume(&surface) - 1.0).abs() < 1e-12);
}

#[test]
fn cubes_that_share_an_edge_come_apart() {
    let (surface, stats) = run(&merged(cube([0.0; 3]), &cube([1.0, 1.0, 0.0])));
    assert_eq!((stats.components, stats.non_manifold_edges_cut, stats.vertex_copies), (2, 1, 2));
    assert_eq!(euler(&surface), (4, 0));
    assert!((volume(&surface) - 2.0).abs() < 1e-12);
}

#[test]
fn cubes_that_share_a_vertex_come_apart() {
    let (surface, stats) = run(&merged(cube([0.0; 3]), &cube([1.0; 3])));
    assert_eq!((stats.components, stats.vertices_cut, euler(&surface)), (2, 1, (4, 0)));
}

#[test]
fn jitter_is_welded_and_moves_no_further_than_the_tolerance() {
    let mut input = cube([0.0; 3]);
    for (i, point) in input.points.iter_mut().enumerate() {
        *point += DVec3::new((i % 7) as f64, (i % 5) as f64, (i % 3) as f64) * 1e-8;
    }
    let (surface, stats) = run(&input);
    assert_eq!((surface.points.len(), euler(&surface)), (8, (2, 0)));
    assert!(stats.vertices_welded > 0 && stats.max_move <= 1e-6 * 3_f64.sqrt() && stats.max_move > 0.0);
}

#[test]
fn shell_inside_a_shell_looks_inward() {
    let mut inner = cube([0.0; 3]);
    for point in &mut inner.points {
        *point = *point * 0.5 + DVec3::splat(0.25);
    }
    let (surface, stats) = run(&merged(cube([0.0; 3]), &inner));
    assert_eq!((stats.cavities, stats.components_turned), (1, 1));
    assert!((volume(&surface) - 0.875).abs() < 1e-12);
}

#[test]
fn moebius_strip_is_cut_and_reported() {
    let count = 12_u32;
    let mut points = Vec::new();
    for i in 0..count {
        let angle = std::f64::consts::TAU * f64::from(i) / f64::from(count);
        let (sin, cos) = libm::sincos(angle);
        let (half_sin, half_cos) = libm::sincos(angle / 2.0);
        for side in [-0.3, 0.3] {
            let r = 1.0 + side * half_cos;
            points.push([r * cos, r * sin, side * half_sin]);
        }
    }
    let mut faces = Vec::new();
    for i in 0..count {
        let (a, b) = (2 * i, 2 * i + 1);
        let (c, d) = if i + 1 == count { (1, 0) } else { (a + 2, b + 2) };
        faces.extend([[a, c, b], [b, c, d]]);
    }
    let (surface, stats) = run(&soup(&points, &faces));
    assert!(stats.one_sided_edges_cut > 0);
    assert_eq!(surface.faces.len(), 24);
    assert_eq!(euler(&surface).0, 1);
}

#[test]
fn repeated_and_collapsed_faces_go() {
    let mut input = cube([0.0; 3]);
    input.faces.push(Facet::Tri([0, 1, 2].map(VertexId::from_raw)));
    input.faces.push(Facet::Tri([2, 1, 0].map(VertexId::from_raw)));
    input.faces.push(Facet::Tri([0, 1, 0].map(VertexId::from_raw)));
    let (surface, stats) = run(&input);
    assert_eq!((surface.faces.len(), euler(&surface)), (12, (2, 0)));
    assert_eq!((stats.repeated_faces, stats.collapsed_faces), (2, 1));
}

#[test]
fn nothing_to_repair_is_an_error() {
    let failed = |soup: &Soup| repair(soup, &RepairParams::default(), &Watch::silent()).map(|_| ());
    assert_eq!(failed(&Soup::default()), Err(RepairError::Empty));
    let collapsed = soup(&[[0.0; 3], [1.0, 0.0, 0.0]], &[[0, 1, 1]]);
    assert_eq!(failed(&collapsed), Err(RepairError::NothingLeft { collapsed: 1, dropped: 0 }));
}

/// A sphere of radius 1 in `2 n` sectors and `n` bands; bands from `first` to `last` only.
fn sphere(n: u32, first: u32, last: u32) -> Soup {
    let at = |i: u32, j: u32| {
        let (sin_t, cos_t) = libm::sincos(std::f64::consts::PI * f64::from(j) / f64::from(n));
        let (sin_p, cos_p) = libm::sincos(std::f64::consts::PI * f64::from(i % (2 * n)) / f64::from(n));
        [sin_t * cos_p, sin_t * sin_p, cos_t]
    };
    let mut points = Vec::new();
    for i in 0..2 * n {
        for j in first..last {
            if j + 1 < n {
                points.extend([at(i, j), at(i, j + 1), at(i + 1, j + 1)]);
            }
            if j > 0 {
                points.extend([at(i, j), at(i + 1, j + 1), at(i + 1, j)]);
            }
        }
    }
    let faces: Vec<[u32; 3]> = (0..points.len() as u32 / 3).map(|f| [3 * f, 3 * f + 1, 3 * f + 2]).collect();
    soup(&points, &faces)
}

fn fill_all() -> RepairParams {
    RepairParams { fill_holes: meshmill::steps::repair::FillHoles::All, ..RepairParams::default() }
}

#[test]
fn cube_without_a_face_is_filled_as_it_was() {
    let mut input = cube([0.0; 3]);
    input.faces = input.faces.iter().take(10).copied().collect();
    let (open, _) = run(&input);
    assert_eq!(euler(&open), (1, 4));
    let (surface, stats) = run_with(&input, &fill_all());
    assert_eq!((surface.faces.len(), surface.points.len(), euler(&surface)), (12, 8, (2, 0)));
    assert_eq!((stats.holes_filled, stats.faces_filled, stats.boundary_loops), (1, 2, 1));
    assert!((volume(&surface) - 1.0).abs() < 1e-12);
    assert_eq!(surface.carried.groups.faces["filled"].len(), 2);
}

#[test]
fn hemisphere_is_closed_by_a_flat_disc() {
    let (surface, stats) = run_with(&sphere(24, 0, 12), &fill_all());
    assert_eq!((euler(&surface), stats.holes_filled), ((2, 0), 1));
    let full = run(&sphere(24, 0, 24)).0;
    assert!((volume(&surface) / (0.5 * volume(&full)) - 1.0).abs() < 0.01);
}

#[test]
fn hole_in_a_smooth_surface_is_filled_smoothly() {
    let (surface, _) = run_with(&sphere(24, 4, 24), &fill_all());
    let full = run(&sphere(24, 0, 24)).0;
    assert_eq!(euler(&surface), (2, 0));
    assert!((volume(&surface) / volume(&full) - 1.0).abs() < 0.01);
}

#[test]
fn outline_of_a_plate_stays_open() {
    let plate = soup(&[[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]], &[[0, 1, 2], [0, 2, 3]]);
    let (surface, stats) = run_with(&plate, &fill_all());
    assert_eq!((surface.faces.len(), stats.holes_filled), (2, 0));
}
