//! Known answers and promises of the two simplification steps.

use glam::{DVec3, dvec3};
use meshmill::mesh::bvh::TriangleBvh;
use meshmill::mesh::geometry::{Aabb, stretch};
use meshmill::mesh::{
    EdgeMark, Freedom, HalfedgeMesh, LockRules, MarkCause, Surface, VertexId, edge_key, resolve_freedom,
};
use meshmill::metric::ToleranceMode;
use meshmill::step::{Length, Sizing};
use meshmill::steps::control_properties::{
    ControlPropertiesInput, ControlPropertiesParams, ControlPropertiesStats, OnInfeasible, Status, control_properties,
};
use meshmill::steps::improve_quality::{ImproveQualityInput, ImproveQualityParams, improve_quality};
use meshmill::technique::guarded::Cause;
use meshmill::watch::Watch;

fn surface(points: Vec<DVec3>, faces: &[[usize; 3]]) -> Surface {
    Surface { points: points.into(), faces: faces.iter().map(|f| f.map(VertexId::new)).collect(), ..Surface::default() }
}

fn octahedron() -> Surface {
    let points = vec![DVec3::X, DVec3::Y, DVec3::NEG_X, DVec3::NEG_Y, DVec3::Z, DVec3::NEG_Z];
    let faces = [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4], [1, 0, 5], [2, 1, 5], [3, 2, 5], [0, 3, 5]];
    surface(points, &faces)
}

fn tetrahedron() -> Surface {
    let points = vec![dvec3(1.0, 1.0, 1.0), dvec3(-1.0, -1.0, 1.0), dvec3(-1.0, 1.0, -1.0), dvec3(1.0, -1.0, -1.0)];
    surface(points, &[[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
}

/// The octahedron, each face cut into four `times` times, pushed onto the unit sphere.
fn sphere(times: u32) -> Surface {
    let watch = Watch::silent();
    let mut mesh = octahedron();
    for _ in 0..times {
        mesh = meshmill::technique::refine::subdivide(&mesh, 1, 1_000_000, &LockRules::default(), &watch).unwrap().0;
        for p in &mut mesh.points {
            *p = p.normalize();
        }
    }
    mesh
}

/// A square of `n` by `n` cells of side 1.
fn grid(n: usize) -> Surface {
    let at = |i: usize, j: usize| j * (n + 1) + i;
    let mut points = Vec::new();
    let mut faces = Vec::new();
    for j in 0..=n {
        for i in 0..=n {
            points.push(dvec3(i as f64, j as f64, 0.0));
            if i < n && j < n {
                faces.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
                faces.push([at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
            }
        }
    }
    surface(points, &faces)
}

/// The unit cube with `2^times` cells along each edge, its twelve edges marked and its corners pinned.
fn cube(times: u32) -> Surface {
    let points = (0..8).map(|i| dvec3(f64::from(i & 1), f64::from((i >> 1) & 1), f64::from(i >> 2))).collect();
    let faces = [
        [0, 2, 3],
        [0, 3, 1],
        [4, 5, 7],
        [4, 7, 6],
        [0, 1, 5],
        [0, 5, 4],
        [2, 6, 7],
        [2, 7, 3],
        [0, 4, 6],
        [0, 6, 2],
        [1, 3, 7],
        [1, 7, 5],
    ];
    let mut cube = surface(points, &faces);
    let mark = EdgeMark { freedom: Freedom::OnCurve, cause: MarkCause::Feature };
    for i in 0..8_usize {
        cube.carried.pin(VertexId::new(i), Freedom::Keep);
        for bit in [1, 2, 4] {
            if i & bit == 0 {
                cube.carried.mark(edge_key(VertexId::new(i), VertexId::new(i | bit)), mark);
            }
        }
    }
    let (cube, _) =
        meshmill::technique::refine::subdivide(&cube, times, 1_000_000, &LockRules::default(), &Watch::silent())
            .unwrap();
    cube
}

fn control(mesh: &Surface, params: &ControlPropertiesParams) -> (Surface, ControlPropertiesStats) {
    let input = ControlPropertiesInput { surface: mesh, reference: mesh, locks: LockRules::default() };
    control_properties(input, params, &Watch::silent()).expect("the parameters fit")
}

fn tolerance(length: f64) -> ControlPropertiesParams {
    ControlPropertiesParams { tolerance: Length::Absolute(length), ..ControlPropertiesParams::default() }
}

/// The largest distance of dense samples of `from` to `to`.
fn sampled_distance(from: &Surface, to: &Surface) -> f64 {
    let tree = TriangleBvh::of_surface(to);
    let steps = 12;
    let mut largest = 0.0_f64;
    for f in from.faces.ids() {
        let [a, b, c] = from.corners(f);
        for i in 0..=steps {
            for j in 0..=steps - i {
                let (u, v) = (f64::from(i) / f64::from(steps), f64::from(j) / f64::from(steps));
                let p = a + u * (b - a) + v * (c - a);
                largest = largest.max(tree.closest(p).map_or(f64::INFINITY, |c| c.distance()));
            }
        }
    }
    largest
}

fn euler(mesh: &Surface) -> i64 {
    let freedom = resolve_freedom(mesh, &LockRules::default()).expect("no locks");
    HalfedgeMesh::new(mesh, &freedom).expect("a 2-manifold").euler_characteristic()
}

fn least_stretch(mesh: &Surface) -> f64 {
    mesh.faces.ids().map(|f| stretch(mesh.corners(f))).fold(1.0, f64::min)
}

#[test]
fn a_tetrahedron_has_nothing_to_collapse() {
    let (result, stats) = control(&tetrahedron(), &tolerance(10.0));
    assert_eq!(stats.counts.collapses, 0);
    assert_eq!(result.faces.len(), 4);
}

#[test]
fn an_octahedron_never_loses_its_topology() {
    for mode in [ToleranceMode::QuadricRms, ToleranceMode::Distance] {
        let params = ControlPropertiesParams { min_stretch: 0.0, tolerance_mode: mode, ..tolerance(10.0) };
        let (result, _) = control(&octahedron(), &params);
        assert_eq!(euler(&result), 2);
        assert!(result.faces.len() >= 4);
    }
}

#[test]
fn a_flat_grid_keeps_its_outline_and_its_plane() {
    let params = ControlPropertiesParams { optimize: Some(false), ..tolerance(0.1) };
    let (result, stats) = control(&grid(16), &params);
    assert!(result.faces.len() < 512 / 4, "{} faces are left", result.faces.len());
    let area: f64 = result.faces.ids().map(|f| meshmill::mesh::geometry::triangle_area(result.corners(f))).sum();
    assert!((area - 256.0).abs() < 1e-9, "the area is {area}");
    assert!(result.points.iter().all(|p| p.z.abs() < 1e-12));
    assert_eq!(stats.faces_violating, 0);
    assert_eq!(stats.distance_bound, Some(0.1));
}

#[test]
fn a_flat_grid_is_coarsened_with_optimisation_too() {
    let (result, stats) = control(&grid(16), &tolerance(0.1));
    assert!(result.faces.len() < 512 / 2, "{} faces are left", result.faces.len());
    assert!(stats.min_stretch >= 0.3 && stats.mean_stretch >= 0.6, "{stats:?}");
}

#[test]
fn a_cube_keeps_its_creases_exactly() {
    let mesh = cube(4);
    let params = ControlPropertiesParams { optimize: Some(false), ..tolerance(0.01) };
    let (result, stats) = control(&mesh, &params);
    assert!(result.faces.len() < mesh.faces.len() / 4, "{} faces are left", result.faces.len());
    assert!(stats.min_stretch >= 0.2);
    assert!(sampled_distance(&mesh, &result).max(sampled_distance(&result, &mesh)) < 1e-12);
    for key in result.carried.marks.keys() {
        let ends = key.map(|v| result.points[v]);
        let fixed = (0..3).filter(|&axis| ends.iter().all(|p| p[axis].abs() < 1e-12 || (p[axis] - 1.0).abs() < 1e-12));
        assert!(fixed.count() >= 2, "a marked edge {ends:?} left its crease");
    }
}

#[test]
fn a_sphere_stays_within_the_tolerance_both_ways() {
    let mesh = sphere(4);
    for part in [0.002, 0.01, 0.03] {
        let (result, stats) = control(&mesh, &tolerance(part));
        let distance = sampled_distance(&mesh, &result).max(sampled_distance(&result, &mesh));
        assert!(distance <= part, "{distance} is beyond {part}");
        assert_eq!(stats.distance_bound, Some(part));
        assert_eq!(euler(&result), 2);
        assert!(least_stretch(&result) >= 0.2);
    }
}

#[test]
fn thresholds_hold_on_the_result() {
    let params = ControlPropertiesParams {
        max_size: Some(Sizing::Uniform(Length::Absolute(0.4))),
        max_valence: 8,
        min_stretch: 0.4,
        ..tolerance(0.05)
    };
    let (result, stats) = control(&sphere(4), &params);
    assert_eq!(stats.status, Status::Satisfied);
    assert!(stats.max_size <= 0.4 && stats.max_valence <= 8 && least_stretch(&result) >= 0.4);
}

#[test]
fn the_target_is_reached_in_every_mode() {
    for (mode, length) in
        [(ToleranceMode::QuadricSum, 10.0), (ToleranceMode::QuadricRms, 0.5), (ToleranceMode::Distance, 0.05)]
    {
        let params = ControlPropertiesParams { target_faces: Some(500), tolerance_mode: mode, ..tolerance(length) };
        let (result, stats) = control(&sphere(4), &params);
        assert_eq!(stats.status, Status::TargetReached, "{mode:?}");
        assert!(result.faces.len() <= 500 && least_stretch(&result) >= 0.2);
    }
}

#[test]
fn corners_closer_than_the_curves_tolerance_become_one() {
    let mut mesh = cube(0);
    let near = mesh.points.push(dvec3(5e-4, 0.0, 0.0));
    let [origin, along] = [VertexId::new(0), VertexId::new(1)];
    for face in mesh.faces.ids().collect::<Vec<_>>() {
        let corners = mesh.faces[face];
        if corners.contains(&origin) && corners.contains(&along) {
            mesh.faces[face] = corners.map(|v| if v == along { near } else { v });
            mesh.faces.push(corners.map(|v| if v == origin { near } else { v }));
        }
    }
    let mark = mesh.carried.marks.remove(&edge_key(origin, along)).expect("an edge of the cube");
    mesh.carried.mark(edge_key(origin, near), mark);
    mesh.carried.mark(edge_key(near, along), mark);
    mesh.carried.pin(near, Freedom::Keep);
    let dense =
        meshmill::technique::refine::subdivide(&mesh, 3, 1_000_000, &LockRules::default(), &Watch::silent()).unwrap().0;
    let (result, stats) = control(&dense, &tolerance(0.01));
    let at = mesh.points[near];
    let has_both = |mesh: &Surface| mesh.points.iter().filter(|p| p.distance(at) < 1e-3).count() > 1;
    assert!(stats.min_stretch >= 0.2 && !has_both(&result), "{stats:?}");
    assert_eq!(euler(&result), 2);
    let strict = ControlPropertiesParams { feature_tolerance: Some(Length::Absolute(1e-4)), ..tolerance(0.01) };
    assert!(has_both(&control(&dense, &strict).0), "the curves' tolerance forbids it");
}

#[test]
fn what_cannot_be_reached_is_reported_or_refused() {
    // Rims that meet at less than three degrees leave no good triangle in the corner.
    let sharp = surface(vec![DVec3::ZERO, dvec3(10.0, 0.0, 0.0), dvec3(10.0, 0.5, 0.0)], &[[0, 1, 2]]);
    let sharp = meshmill::technique::refine::subdivide(&sharp, 4, 1_000_000, &LockRules::default(), &Watch::silent())
        .unwrap()
        .0;
    let (_, stats) = control(&sharp, &tolerance(0.01));
    assert_eq!(stats.status, Status::Stuck);
    assert!(stats.violations.iter().any(|v| matches!(v.cause, Cause::CurvesMeet { degrees } if degrees < 3.0)));
    let strict = ControlPropertiesParams { on_infeasible: OnInfeasible::Error, ..tolerance(0.01) };
    let input = ControlPropertiesInput { surface: &sharp, reference: &sharp, locks: LockRules::default() };
    let refusal = control_properties(input, &strict, &Watch::silent()).expect_err("a threshold does not hold");
    assert!(refusal.to_string().contains("marked curves meet there at 2.86 degrees"), "{refusal}");
    assert!(
        control_properties(
            ControlPropertiesInput { surface: &grid(4), reference: &grid(4), ..input },
            &strict,
            &Watch::silent()
        )
        .is_ok()
    );
}

#[test]
fn a_mean_stretch_is_reached_or_told() {
    let params = ControlPropertiesParams { mean_stretch: 0.88, ..tolerance(0.02) };
    let (_, stats) = control(&sphere(4), &params);
    assert_eq!(stats.status, Status::Satisfied);
    assert!(stats.mean_stretch >= 0.88 && stats.faces_after < stats.faces_before / 2, "{stats:?}");
    // A sliver has no even triangles.
    let sliver = surface(vec![DVec3::ZERO, dvec3(10.0, 0.0, 0.0), dvec3(10.0, 0.5, 0.0)], &[[0, 1, 2]]);
    let params = ControlPropertiesParams { mean_stretch: 0.9, min_stretch: 0.0, ..tolerance(0.01) };
    let (_, stats) = control(&sliver, &params);
    assert_eq!((stats.status, stats.faces_violating), (Status::Stuck, 0));
    let strict = ControlPropertiesParams { on_infeasible: OnInfeasible::Error, ..params };
    let input = ControlPropertiesInput { surface: &sliver, reference: &sliver, locks: LockRules::default() };
    let refusal = control_properties(input, &strict, &Watch::silent()).expect_err("the mean is not reached");
    assert!(refusal.to_string().starts_with("the mean stretch is 0.0"), "{refusal}");
}

#[test]
fn equal_input_gives_equal_output() {
    let mesh = sphere(3);
    assert_eq!(control(&mesh, &tolerance(0.02)).0, control(&mesh, &tolerance(0.02)).0);
}

#[test]
fn scale_and_place_do_not_matter() {
    let mesh = sphere(3);
    let faces = |scale: f64, offset: DVec3| {
        let mut other = mesh.clone();
        for p in &mut other.points {
            *p = scale * *p + offset;
        }
        let (result, stats) = control(&other, &tolerance(0.02 * scale));
        assert_eq!(stats.distance_bound, Some(0.02 * scale));
        result.faces.len() as f64
    };
    let here = faces(1.0, DVec3::ZERO);
    for there in [faces(1e6, DVec3::ZERO), faces(1e-6, DVec3::ZERO), faces(1.0, DVec3::splat(1e6))] {
        assert!((there / here - 1.0).abs() < 0.1, "{there} faces instead of {here}");
    }
}

#[test]
fn needles_become_good_triangles() {
    // A cylinder's wall as a tessellation has it: long needles, here bent into a half pipe.
    let (around, length) = (24, 40.0);
    let mut points = Vec::new();
    let mut faces = Vec::new();
    for i in 0..=around {
        let (sin, cos) = libm::sincos(std::f64::consts::PI * f64::from(i) / f64::from(around));
        points.extend([dvec3(5.0 * cos, 5.0 * sin, 0.0), dvec3(5.0 * cos, 5.0 * sin, length)]);
        let a = 2 * i as usize;
        if i < around {
            faces.extend([[a, a + 2, a + 3], [a, a + 3, a + 1]]);
        }
    }
    let mesh = surface(points, &faces);
    let diagonal = Aabb::of(mesh.points.iter().copied()).diagonal();
    let params = ImproveQualityParams {
        max_edge: Some(Sizing::Uniform(Length::Percent(5.0))),
        ..ImproveQualityParams::default()
    };
    let input = ImproveQualityInput { surface: &mesh, reference: &mesh, locks: LockRules::default() };
    let (result, stats) = improve_quality(input, &params, &Watch::silent()).expect("the parameters fit");
    assert!(stats.min_stretch_before < 0.06);
    assert!(stats.min_stretch >= 0.2 && stats.mean_stretch >= 0.75, "{stats:?}");
    assert!(stats.max_size <= 0.05 * diagonal * 1.0001);
    assert_eq!(stats.distance_bound, Some(0.002 * diagonal));
    assert_eq!(euler(&result), 1);
}

#[test]
fn a_mean_stretch_ends_coarsening() {
    // A wavy sheet of even triangles: its bends ask for small ones, its valleys do not.
    let mut mesh = grid(40);
    for p in &mut mesh.points {
        (p.x, p.y) = (p.x - 0.5 * p.y, 0.75_f64.sqrt() * p.y);
        p.z = 2.0 * libm::sin(0.4 * p.x) * libm::cos(0.15 * p.y);
    }
    let input = ControlPropertiesInput { surface: &mesh, reference: &mesh, locks: LockRules::default() };
    let [free, even] = [0.0, 0.91].map(|mean_stretch| {
        let tolerance = Length::Percent(1.0);
        let params = ControlPropertiesParams { tolerance, mean_stretch, ..ControlPropertiesParams::default() };
        control_properties(input, &params, &Watch::silent()).expect("the parameters fit").1
    });
    assert!(free.mean_stretch < 0.91, "{free:?}");
    assert!(even.mean_stretch >= 0.91 && even.faces_after < even.faces_before, "{even:?}");
}

#[test]
fn a_percent_is_no_squared_length() {
    let mesh = octahedron();
    let params = ControlPropertiesParams {
        tolerance_mode: ToleranceMode::QuadricSum,
        tolerance: Length::Percent(1.0),
        ..ControlPropertiesParams::default()
    };
    let input = ControlPropertiesInput { surface: &mesh, reference: &mesh, locks: LockRules::default() };
    assert!(control_properties(input, &params, &Watch::silent()).is_err());
}

#[test]
fn a_size_that_asks_for_too_many_faces_is_refused() {
    let mesh = tetrahedron();
    let input = ControlPropertiesInput { surface: &mesh, reference: &mesh, locks: LockRules::default() };
    for size in [0.0, -1.0, 1e-6, f64::NAN] {
        let params = ControlPropertiesParams { max_size: Some(Length::Absolute(size).into()), ..tolerance(10.0) };
        let refused = control_properties(input, &params, &Watch::silent()).expect_err("no mesh has so many faces");
        assert!(refused.to_string().contains("max-size"), "{refused}");
    }
}
