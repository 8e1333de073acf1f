//! Repair on small meshes with one defect each: exact counts, and the promises of the step.

#[path = "repair/gaps.rs"]
mod gaps;
#[path = "repair/refused.rs"]
mod refused;
#[path = "repair/solid.rs"]
mod solid;

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
fn a_fin_that_goes_on_from_a_wall_does_not_open_the_box() {
    // From the edge x = 1, z = 1 upward, in the plane of the wall x = 1, which is flatter than the corner to the lid.
    let fin = soup(&[[1.0, 0.0, 1.0], [1.0, 1.0, 1.0], [1.0, 1.0, 1.5], [1.0, 0.0, 1.5]], &[[0, 1, 2], [0, 2, 3]]);
    let (surface, stats) = run(&merged(cube([0.0; 3]), &fin));
    assert_eq!((stats.components, stats.non_manifold_edges_cut), (2, 1));
    assert_eq!(euler(&surface), (3, 4));
    assert_eq!(surface.faces.len(), 14);
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

#[test]
fn bodies_that_run_through_each_other_are_reported() {
    let (surface, stats) = run(&merged(cube([0.0; 3]), &cube([0.5, 0.4, 0.3])));
    assert_eq!((stats.components, stats.cavities, euler(&surface)), (2, 0, (4, 0)));
    assert!(stats.self_intersections > 0 && stats.self_intersections == stats.self_intersections_before);
    assert!(!stats.self_intersecting_faces.is_empty());
    assert_eq!(run(&cube([0.0; 3])).1.self_intersections, 0);
    assert_eq!(run(&sphere(16, 0, 16)).1.self_intersections, 0);
}

/// Three plates of two squares each that meet along the y axis.
fn t_joint() -> Soup {
    let mut points = Vec::new();
    for end in [[-1.0, 0.0], [1.0, 0.0], [0.0, 1.0]] {
        for y in [0.0, 1.0] {
            let [a, b, c, d] =
                [[0.0, y], [0.0, y + 1.0], [1.0, y + 1.0], [1.0, y]].map(|[s, y]| [s * end[0], y, s * end[1]]);
            points.extend([a, b, c, a, c, d]);
        }
    }
    let faces: Vec<[u32; 3]> = (0..points.len() as u32 / 3).map(|f| [3 * f, 3 * f + 1, 3 * f + 2]).collect();
    soup(&points, &faces)
}

#[test]
fn joint_of_three_plates_keeps_its_seam() {
    use meshmill::mesh::{Freedom, MarkCause};
    use meshmill::steps::repair::NonManifold;
    let params = RepairParams { non_manifold: NonManifold::Seam, ..RepairParams::default() };
    let (surface, stats) = run_with(&t_joint(), &params);
    // The straight plates stay one sheet; the third has its own copy of the three vertices of the joint.
    assert_eq!((stats.components, surface.points.len(), stats.non_manifold_edges_cut), (2, 15, 2));
    assert_eq!(surface.carried.seams.len(), 6);
    let seam_edges: Vec<_> = surface.carried.marks.values().collect();
    assert_eq!(seam_edges.len(), 4);
    assert!(seam_edges.iter().all(|m| m.freedom == Freedom::Keep && m.cause == MarkCause::Seam));
    let written = meshmill::format::welded_seams(&surface.to_soup()).into_owned();
    assert_eq!((written.points.len(), written.faces.len()), (12, 12));
    let (cut, _) = run(&t_joint());
    assert!(cut.carried.seams.is_empty() && cut.points.len() == 15);
}

#[test]
fn groups_regions_and_fields_follow() {
    use meshmill::mesh::{FaceId, Field, Regions, Support, edge_key};
    let mut input = cube([0.0; 3]);
    input.faces.push(Facet::Tri([0, 1, 1].map(VertexId::from_raw)));
    let count = input.faces.len();
    let carried = &mut input.carried;
    carried.groups.faces.insert("Top".into(), vec![FaceId::new(2), FaceId::new(3)]);
    carried.groups.vertices.insert("corner".into(), vec![VertexId::from_raw(0)]);
    carried.groups.edges.insert("edge".into(), vec![edge_key(VertexId::from_raw(0), VertexId::from_raw(1))]);
    carried.regions = Some(Regions {
        labels: (0..count as u32).map(|f| f / 2 % 6).collect(),
        names: (0..6).map(|r| r.to_string()).collect(),
    });
    let values = |n: usize| (0..n).map(|i| i as f64).collect::<Vec<f64>>();
    let (vertices, faces) = (values(input.points.len()), values(count));
    carried.set_field(Field { name: "u".into(), support: Support::Vertex, components: 1, values: vertices });
    carried.set_field(Field { name: "w".into(), support: Support::Face, components: 1, values: faces });
    let (surface, _) = run(&input);
    let carried = &surface.carried;
    assert_eq!(carried.groups.faces["Top"], [FaceId::new(2), FaceId::new(3)]);
    assert_eq!((carried.groups.vertices["corner"].len(), carried.groups.edges["edge"].len()), (1, 1));
    assert_eq!(carried.regions.as_ref().map(|r| r.labels.len()), Some(12));
    assert_eq!(carried.field(Support::Face, "w").map(|f| f.values.len()), Some(12));
    assert_eq!(carried.field(Support::Vertex, "u").map(|f| f.values[0]), Some(0.0));
}

/// Two cubes on one edge, one of them with a turned, a repeated and a split face.
fn broken_cubes() -> Soup {
    let mut input = merged(cube([0.0; 3]), &cube([1.0, 1.0, 0.0]));
    input.faces.iter_mut().nth(3).expect("a face").corners_mut().swap(0, 1);
    let Facet::Tri([a, b, c]) = *input.faces.iter().nth(20).expect("a face") else { unreachable!("all are triangles") };
    input.faces.push(Facet::Tri([b, c, a]));
    let Facet::Tri([a, b, c]) = *input.faces.iter().nth(8).expect("a face") else { unreachable!("all are triangles") };
    let middle = input.points.push(input.points[a].midpoint(input.points[b]));
    *input.faces.iter_mut().nth(8).expect("a face") = Facet::Tri([a, middle, c]);
    input.faces.push(Facet::Tri([middle, b, c]));
    input
}

#[test]
fn scaled_moved_mirrored_and_reordered_input_gives_the_same_counts() {
    let counts = |soup: &Soup| {
        let (surface, s) = run(soup);
        let counts = [s.vertices_merged, s.repeated_faces, s.t_junctions, s.vertex_copies, s.components];
        (counts, surface.points.len(), surface.faces.len(), euler(&surface), volume(&surface) > 0.0)
    };
    let input = broken_cubes();
    let expected = counts(&input);
    assert_eq!((expected.0, expected.3), ([58, 1, 1, 2, 2], (4, 0)));
    let moved =
        |map: &dyn Fn(DVec3) -> DVec3| Soup { points: input.points.iter().map(|&p| map(p)).collect(), ..input.clone() };
    assert_eq!(counts(&moved(&|p| p * 1e6)), expected);
    assert_eq!(counts(&moved(&|p| p * 1e-6)), expected);
    assert_eq!(counts(&moved(&|p| p + DVec3::new(3e4, -2e4, 1e4))), expected);
    assert_eq!(counts(&moved(&|p| DVec3::new(-p.x, p.y, p.z))), expected);
    let reversed = Soup { faces: input.faces.iter().rev().copied().collect(), ..input.clone() };
    assert_eq!(counts(&reversed), expected);
}

/// The same soups on every machine.
const SEED: proptest::test_runner::RngSeed = proptest::test_runner::RngSeed::Fixed(2009);

proptest::proptest! {
    #![proptest_config(proptest::test_runner::Config { cases: 1000, rng_seed: SEED, failure_persistence: None, ..Default::default() })]
    #[test]
    fn broken_soup_gives_a_manifold_or_a_typed_error(
        base in 0_usize..4,
        edits in proptest::collection::vec((0_u8..7, 0_usize..1000, 0_usize..1000), 0..12),
        fill in proptest::bool::ANY,
        seam in proptest::bool::ANY,
    ) {
        repairs_for_good(base, &edits, fill, seam);
    }
}

#[test]
fn copies_joined_again_may_collapse_a_face() {
    let edits = [(0, 58, 0), (2, 51, 0), (6, 729, 138), (2, 19, 0), (3, 763, 0), (3, 258, 1)];
    repairs_for_good(0, &edits, false, false);
}

/// Breaks a soup and asserts that repair gives a manifold, or says why not, and changes nothing when done again.
fn repairs_for_good(base: usize, edits: &[(u8, usize, usize)], fill: bool, seam: bool) {
    let base = [cube([0.0; 3]), broken_cubes(), sphere(5, 0, 4), merged(sphere(4, 0, 4), &t_joint())][base].clone();
    let input = edits.iter().fold(base, |soup, &(kind, i, j)| break_it(soup, kind, i, j));
    let mut params = if fill { fill_all() } else { RepairParams::default() };
    if seam {
        params.non_manifold = meshmill::steps::repair::NonManifold::Seam;
    }
    if let Ok((surface, stats)) = repair(&input, &params, &Watch::silent()) {
        check_manifold(&surface);
        assert!(stats.max_move <= 1e-4 * 10.0);
        let (again, _) = repair(&surface.to_soup(), &params, &Watch::silent()).expect("repairs again");
        check_manifold(&again);
        assert!(fill || again == surface, "repairing again changes something");
    }
}

/// Drops, turns, repeats, splits, collapses, moves or bends an element of a soup.
fn break_it(mut soup: Soup, kind: u8, i: usize, j: usize) -> Soup {
    let mut faces: Vec<Facet> = soup.faces.iter().copied().collect();
    if faces.is_empty() {
        return soup;
    }
    let (f, g) = (i % faces.len(), j % faces.len());
    let (v, w) = (faces[f].corners()[j % 3], faces[g].corners()[i % 3]);
    match kind {
        0 => {
            faces.remove(f);
        }
        1 => faces[f].corners_mut().swap(0, 1),
        2 => faces.push(faces[f]),
        3 => {
            let [a, b, c] = [0, 1, 2].map(|k| faces[f].corners()[k]);
            let middle = soup.points.push(soup.points[a].lerp(soup.points[b], 0.1 + 0.8 * (j as f64 / 1000.0)));
            faces[f] = Facet::Tri([a, middle, c]);
            faces.push(Facet::Tri([middle, b, c]));
        }
        4 => faces[f].corners_mut()[0] = w,
        5 => soup.points[v] += DVec3::splat(1e-7),
        _ => soup.points[v] = soup.points[w],
    }
    soup.faces = faces.into();
    soup
}
