//! Hierarchies as users have them: recorded by a simplification step, cut at any resolution.

use glam::{DVec3, dvec3};
use meshmill::mesh::geometry::{stretch, triangle_size};
use meshmill::mesh::hierarchy::NodeId;
use meshmill::mesh::topology::EdgeTable;
use meshmill::mesh::validate::validate_surface;
use meshmill::mesh::{Carried, Field, Hierarchy, LockRules, Soup, Support, Surface, VertexId};
use meshmill::metric::ToleranceMode;
use meshmill::step::{Length, Resolution, Share};
use meshmill::steps::adapt_curvature::{AdaptCurvatureParams, adapt_curvature};
use meshmill::steps::adapt_density::{AdaptDensityError, AdaptDensityParams, adapt_density};
use meshmill::steps::adapt_region::{AdaptRegionError, AdaptRegionParams, Ball, HalfSpace, adapt_region};
use meshmill::steps::control_properties::{
    ControlPropertiesInput, ControlPropertiesParams, ControlPropertiesStats, record_properties,
};
use meshmill::steps::improve_quality::{ImproveQualityInput, ImproveQualityParams, record_quality};
use meshmill::steps::resolution::{ResolutionError, ResolutionParams, resolution};
use meshmill::technique::hierarchy::{Front, extract};
use meshmill::watch::Watch;

/// A torus about the z axis with a field and two regions, of `2 m n` faces.
fn torus(m: u32, n: u32) -> Surface {
    let turn = |i: u32, count: u32| libm::sincos(std::f64::consts::TAU * f64::from(i) / f64::from(count));
    let at = |i: u32, j: u32| VertexId::from_raw((i % m) + m * (j % n));
    let place = |i: u32, j: u32| {
        let ((sin_u, cos_u), (sin_v, cos_v)) = (turn(i, m), turn(j, n));
        dvec3((3.0 + cos_v) * cos_u, (3.0 + cos_v) * sin_u, sin_v)
    };
    let points: Vec<DVec3> = (0..n).flat_map(|j| (0..m).map(move |i| place(i, j))).collect();
    let mut faces = Vec::new();
    for (j, i) in (0..n).flat_map(|j| (0..m).map(move |i| (j, i))) {
        let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
        faces.extend([[a, b, c], [a, c, d]]);
    }
    let values = points.iter().map(|p| p.x).collect();
    let mut carried = Carried::default();
    carried.set_field(Field { name: "x".into(), support: Support::Vertex, components: 1, values });
    carried.groups.faces.insert("first".into(), (0..20).map(meshmill::mesh::FaceId::new).collect());
    Surface { points: points.into(), faces: faces.into(), carried }
}

fn params() -> ControlPropertiesParams {
    ControlPropertiesParams {
        tolerance: Length::Percent(2.0),
        tolerance_mode: ToleranceMode::QuadricRms,
        min_stretch: 0.3,
        max_size: Some(Length::Absolute(1.2).into()),
        max_valence: 9,
        optimize: Some(false),
        ..ControlPropertiesParams::default()
    }
}

fn recorded(surface: &Surface, params: &ControlPropertiesParams) -> (Hierarchy, ControlPropertiesStats) {
    let input = ControlPropertiesInput { surface, reference: surface, locks: LockRules::default() };
    record_properties(input, params, &Watch::silent()).unwrap()
}

fn hierarchy() -> Hierarchy {
    recorded(&torus(48, 24), &params()).0
}

fn valences(mesh: &Surface) -> usize {
    let mut count = vec![0; mesh.points.len()];
    EdgeTable::new(mesh).keys().iter().flatten().for_each(|v| count[v.index()] += 1);
    count.into_iter().max().unwrap_or(0)
}

fn assert_thresholds(mesh: &Surface) {
    assert_eq!(validate_surface(mesh), []);
    assert!(valences(mesh) <= 9);
    for f in mesh.faces.ids() {
        let corners = mesh.corners(f);
        assert!(stretch(corners) >= 0.3 - 1e-6, "stretch {} of {f:?}", stretch(corners));
        assert!(triangle_size(corners) <= 1.2 * (1.0 + 1e-6), "size {} of {f:?}", triangle_size(corners));
    }
}

#[test]
fn thresholds_hold_on_random_fronts() {
    let (hierarchy, stats) = recorded(&torus(48, 24), &params());
    let report = stats.hierarchy.unwrap();
    assert_eq!(report.finest_faces, 2304);
    assert!(report.coarsest_faces < 600, "{report:?}");
    let mut front = Front::coarsest(&hierarchy);
    let mut dice = 0x9e37_79b9_7f4a_7c15_u64;
    for round in 0..900 {
        dice ^= dice << 13;
        dice ^= dice >> 7;
        dice ^= dice << 17;
        let node = NodeId::new((dice >> 8) as usize % hierarchy.node_count());
        match dice % 3 {
            0 => drop(front.force_split(node)),
            1 => drop(front.force_merge(node)),
            _ => drop(front.split(node) || front.merge(node)),
        }
        if round % 30 == 0 {
            let mesh = extract(&front);
            assert_thresholds(&mesh);
        }
    }
}

#[test]
fn optimised_hierarchies_keep_distance_and_thresholds_at_their_coarse_end() {
    let surface = torus(36, 18);
    let params = ControlPropertiesParams { tolerance_mode: ToleranceMode::Distance, optimize: None, ..params() };
    let (hierarchy, stats) = recorded(&surface, &params);
    assert!(stats.distance_bound.is_some() && stats.faces_violating == 0, "{stats:?}");
    assert_thresholds(&extract(&Front::coarsest(&hierarchy)));
    assert_thresholds(&hierarchy.finest);
    assert!(stats.faces_after * 2 < stats.faces_before);
}

#[test]
fn quality_hierarchies_refine_first() {
    let surface = torus(24, 12);
    let input = ImproveQualityInput { surface: &surface, reference: &surface, locks: LockRules::default() };
    let params = ImproveQualityParams { max_edge: Some(Length::Absolute(0.4).into()), ..Default::default() };
    let (hierarchy, stats) = record_quality(input, &params, &Watch::silent()).unwrap();
    assert!(stats.faces_refined > surface.faces.len());
    assert!(hierarchy.merges.len() > 100 && hierarchy.defect().is_none());
    assert!(stats.hierarchy.unwrap().finest_min_stretch >= 0.2);
}

#[test]
fn resolutions_reach_their_number_of_faces_and_carry_fields() {
    let hierarchy = hierarchy();
    let watch = Watch::silent();
    for faces in [900, 1500, 2200] {
        let params = ResolutionParams { faces: Some(faces), ..ResolutionParams::default() };
        let (mesh, stats) = resolution(&hierarchy, &params, &watch).unwrap();
        assert!(stats.target_reached && mesh.faces.len().abs_diff(faces) <= 1);
        assert_thresholds(&mesh);
        assert!(stats.front.distance_bound.unwrap() < 0.5 && stats.front.fold_overs == 0, "{stats:?}");
        let field = mesh.carried.field(Support::Vertex, "x").unwrap();
        for (value, p) in field.values.iter().zip(mesh.points.iter()) {
            assert!((value - p.x).abs() < 0.5);
        }
    }
    let whole = ResolutionParams { share: Some(Share(1.0)), ..ResolutionParams::default() };
    let (mesh, stats) = resolution(&hierarchy, &whole, &watch).unwrap();
    assert_eq!(mesh, hierarchy.finest);
    assert_eq!(stats.front.distance_bound, Some(0.0));
    let beyond = ResolutionParams { faces: Some(10), ..ResolutionParams::default() };
    assert!(!resolution(&hierarchy, &beyond, &watch).unwrap().1.target_reached);
    assert_eq!(resolution(&hierarchy, &ResolutionParams::default(), &watch), Err(ResolutionError::NotOne));
}

#[test]
fn curvature_puts_faces_where_a_high_ring_bends() {
    let mut high = torus(48, 24);
    high.points.iter_mut().for_each(|p| p.z *= 2.0);
    let unlimited = ControlPropertiesParams { max_size: None, ..params() };
    let (hierarchy, _) = recorded(&high, &unlimited);
    let params = AdaptCurvatureParams { smallest: Length::Absolute(0.3), ..AdaptCurvatureParams::default() };
    let (mesh, stats) = adapt_curvature(&hierarchy, &params, &Watch::silent()).unwrap();
    let count = |test: &dyn Fn(DVec3) -> bool| mesh.points.iter().filter(|p| test(**p)).count();
    assert!(count(&|p| p.z.abs() > 1.7) > count(&|p| p.z.abs() < 1.0), "{stats:?}");
    assert!(stats.base_faces < stats.front.faces && stats.front.faces < stats.front.finest_faces, "{stats:?}");

    let [largest, smallest] = [1.2, 0.7];
    let params = AdaptCurvatureParams {
        largest: Some(Length::Absolute(largest)),
        smallest: Length::Absolute(smallest),
        ..AdaptCurvatureParams::default()
    };
    let (mesh, stats) = adapt_curvature(&hierarchy, &params, &Watch::silent()).unwrap();
    let size = |f| triangle_size(mesh.corners(f));
    assert!(mesh.faces.ids().all(|f| size(f) <= largest), "no face is larger than asked: {stats:?}");
    assert_eq!(stats.vertices_coarser, 0, "{stats:?}");
}

#[test]
fn a_region_is_as_fine_as_asked_and_the_rest_stays_coarse() {
    let hierarchy = hierarchy();
    let watch = Watch::silent();
    let half = HalfSpace { point: [2.0, 0.0, 0.0], normal: [5.0, 0.0, 0.0] };
    let params = AdaptRegionParams {
        size: Some(Length::Absolute(0.6)),
        half_spaces: vec![half],
        ..AdaptRegionParams::default()
    };
    let (mesh, stats) = adapt_region(&hierarchy, None, &params, &watch).unwrap();
    assert_thresholds(&mesh);
    assert_eq!(stats.vertices_coarser, 0);
    let count = |test: &dyn Fn(DVec3) -> bool| mesh.points.iter().filter(|p| test(**p)).count();
    assert!(count(&|p| p.x > 2.0) > 2 * count(&|p| p.x < -2.0), "{stats:?}");

    let ball = Ball { centre: [4.0, 0.0, 0.0], radius: Length::Absolute(0.5) };
    let params = AdaptRegionParams {
        ratio: Some(0.5),
        spheres: vec![ball],
        groups: vec!["first".into()],
        points: vec![[-4.0, 0.0, 0.0]],
        elements: vec![100],
        ..AdaptRegionParams::default()
    };
    let (mesh, stats) = adapt_region(&hierarchy, None, &params, &watch).unwrap();
    assert_thresholds(&mesh);
    assert!(stats.front.faces > stats.base_faces && stats.vertices_selected > 20, "{stats:?}");
}

#[test]
fn a_field_asks_for_sizes() {
    let hierarchy = hierarchy();
    let values = torus(20, 10).to_soup();
    let params = AdaptRegionParams {
        field: Some("x".into()),
        field_sizes: vec![(1.0, Length::Absolute(0.8)), (3.0, Length::Absolute(0.4))],
        ..AdaptRegionParams::default()
    };
    let (mesh, stats) = adapt_region(&hierarchy, Some(&values), &params, &Watch::silent()).unwrap();
    assert_thresholds(&mesh);
    let count = |test: &dyn Fn(DVec3) -> bool| mesh.points.iter().filter(|p| test(**p)).count();
    assert!(count(&|p| p.x > 2.0) > 2 * count(&|p| p.x < -2.0), "{stats:?}");
}

#[test]
fn values_of_points_without_faces_ask_for_sizes() {
    let hierarchy = hierarchy();
    let finest = &hierarchy.finest;
    let values = finest.to_soup();
    let mut cloud = Soup { points: finest.points.clone(), ..Soup::default() };
    cloud.carried.set_field(values.carried.field(Support::Vertex, "x").expect("the torus has one").clone());
    let asked = AdaptRegionParams {
        field: Some("x".into()),
        field_sizes: vec![(1.0, Length::Absolute(0.8)), (3.0, Length::Absolute(0.4))],
        ..AdaptRegionParams::default()
    };
    let cut = |values: &Soup| adapt_region(&hierarchy, Some(values), &asked, &Watch::silent()).unwrap().0;
    assert_eq!(cut(&cloud), cut(&values), "at the vertices both say the same");
}

#[test]
fn a_polished_front_keeps_what_it_had_and_is_better() {
    let hierarchy = hierarchy();
    let cut = |polish| {
        let asked = ResolutionParams { share: Some(Share(0.4)), polish, ..ResolutionParams::default() };
        resolution(&hierarchy, &asked, &Watch::silent()).unwrap()
    };
    let ((plain, before), (mesh, after)) = (cut(false), cut(true));
    let (before, after) = (before.front, after.front);
    assert_thresholds(&mesh);
    assert_eq!(mesh.faces.len(), plain.faces.len());
    let work = after.polish.expect("polished");
    assert!(before.polish.is_none() && work.flips + work.moves > 0);
    assert_eq!((work.min_stretch_before, work.mean_stretch_before), (before.min_stretch, before.mean_stretch));
    assert!(after.mean_stretch > before.mean_stretch + 0.01, "{} to {}", before.mean_stretch, after.mean_stretch);
    assert!(after.min_stretch >= before.min_stretch * (1.0 - 2e-6));
    assert!(after.max_valence <= before.max_valence && after.fold_overs == 0);
    let (reach, reached) = (before.distance_bound.unwrap(), after.distance_bound.unwrap());
    // Both are upper bounds with some slack.
    assert!(reached <= 1.1 * reach, "{reached} beyond {reach}");
}

#[test]
fn regions_that_cannot_be_are_refused() {
    let hierarchy = hierarchy();
    let refused = |params: AdaptRegionParams, values: Option<&Soup>| {
        adapt_region(&hierarchy, values, &params, &Watch::silent()).unwrap_err()
    };
    let sized = || AdaptRegionParams { size: Some(Length::Absolute(0.5)), ..AdaptRegionParams::default() };
    assert_eq!(refused(sized(), None), AdaptRegionError::NoRegion);
    let far = Ball { centre: [40.0, 0.0, 0.0], radius: Length::Absolute(0.5) };
    assert_eq!(refused(AdaptRegionParams { spheres: vec![far], ..sized() }, None), AdaptRegionError::Empty);
    let two = AdaptRegionParams { points: vec![[0.0; 3]], ratio: Some(0.5), ..sized() };
    assert_eq!(refused(two, None), AdaptRegionError::NotOne);
    let half = AdaptRegionParams { points: vec![[0.0; 3]], field: Some("x".into()), ..sized() };
    assert_eq!(refused(half, None), AdaptRegionError::HalfAField);
    let unknown = AdaptRegionParams { groups: vec!["rim".into()], ..sized() };
    assert_eq!(refused(unknown, None).to_string(), "there is no face group `rim`; there are: first");
    let face = AdaptRegionParams { elements: vec![9999], ..sized() };
    assert_eq!(refused(face, None), AdaptRegionError::NoSuchFace { face: 9999, faces: 2304 });
    let soup = Soup::default();
    let field = AdaptRegionParams {
        field: Some("stress".into()),
        field_sizes: vec![(0.0, Length::Absolute(1.0))],
        ..AdaptRegionParams::default()
    };
    assert_eq!(
        refused(field, Some(&soup)).to_string(),
        "`values` has no field `stress` with one number an element; it has: none"
    );
}

#[test]
fn density_is_kept_while_the_number_of_faces_changes() {
    let hierarchy = hierarchy();
    let watch = Watch::silent();
    let params = AdaptDensityParams {
        faces: Some(1400),
        base: Some(Resolution::Percent(50.0)),
        ..AdaptDensityParams::default()
    };
    let (mesh, stats) = adapt_density(&hierarchy, None, &params, &watch).unwrap();
    assert_thresholds(&mesh);
    assert!(stats.target_reached, "{stats:?}");

    let region = AdaptRegionParams {
        size: Some(Length::Absolute(0.4)),
        half_spaces: vec![HalfSpace { point: [2.0, 0.0, 0.0], normal: [1.0, 0.0, 0.0] }],
        ..AdaptRegionParams::default()
    };
    let (like, _) = adapt_region(&hierarchy, None, &region, &watch).unwrap();
    let params = AdaptDensityParams { faces: Some(1200), ..AdaptDensityParams::default() };
    let (mesh, stats) = adapt_density(&hierarchy, Some(&like), &params, &watch).unwrap();
    assert!(stats.target_reached, "{stats:?}");
    assert_thresholds(&mesh);
    let share = |mesh: &Surface| mesh.points.iter().filter(|p| p.x > 2.0).count() as f64 / mesh.points.len() as f64;
    assert!((share(&mesh) - share(&like)).abs() < 0.2, "{} for {}", share(&mesh), share(&like));
    let none = adapt_density(&hierarchy, None, &AdaptDensityParams::default(), &watch);
    assert_eq!(none, Err(AdaptDensityError::NotOne));
}
