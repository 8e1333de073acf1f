//! Remesh: shape, size and distance as asked, topology, curves and groups as they were.

use glam::DVec3;
use meshmill::mesh::{Soup, Surface};
use meshmill::metric;
use meshmill::step::Artifact;
use meshmill::watch::Watch;

use super::golden::{golden, golden_of};
use crate::shapes;
use crate::step::{run, soup, surface};

fn marked(mesh: &Soup) -> Artifact {
    run("features", "angle = 40", &surface(shapes::surface(mesh))).artifact
}

/// Looks metrics of a result up, measured against what it was made from.
fn measured(result: &Artifact, before: &Artifact) -> impl Fn(&str) -> f64 + use<> {
    let reference = before.to_soup().unwrap();
    let measured = metric::measure(&result.to_soup().unwrap(), Some(&reference), &Watch::silent()).unwrap();
    move |name| measured.get(name).unwrap_or_else(|| panic!("no metric {name}")).as_f64()
}

#[test]
fn what_is_asked_for_holds_on_needles_planes_and_round_shapes() {
    for (name, mesh) in [
        ("cube", shapes::cube()),
        ("needles", shapes::cylinder(48, 1)),
        ("washer", shapes::washer(64)),
        ("sphere", shapes::sphere(3)),
        ("torus", shapes::torus(48, 24)),
        ("sheet", shapes::grid(7)),
    ] {
        let before = marked(&mesh);
        let made = run("remesh", "max-size = \"8%\", tolerance = \"0.3%\"", &before);
        let (old, new) = (measured(&before, &before), measured(&made.artifact, &before));
        let diagonal = old("diagonal");
        assert!(new("distance") - new("distance-slack") <= 0.003 * diagonal * (1.0 + 1e-9), "{name}: distance");
        assert!(new("max-size") <= 0.08 * diagonal * (1.0 + 1e-9), "{name}: {}", new("max-size"));
        assert!(new("min-stretch") >= 0.4, "{name}: {}", new("min-stretch"));
        assert!(new("mean-stretch") >= 0.8, "{name}: {}", new("mean-stretch"));
        assert!(new("max-valence") <= 10.0, "{name}");
        assert!(new("feature-deviation") <= 0.0015 * diagonal * (1.0 + 1e-9), "{name}");
        for same in ["euler-characteristic", "boundary-loops", "components", "self-intersections"] {
            assert_eq!(new(same), old(same), "{name}: {same}");
        }
        assert_eq!(made.stats["guarded-all-along"], false, "{name}");
        assert!(made.stats["distance-bound"].as_f64().unwrap() <= 0.003 * diagonal * (1.0 + 1e-9), "{name}");
    }
}

#[test]
fn elements_get_smaller_where_curvature_asks_for_it_and_nowhere_else() {
    // Six flat sides and six round edges of a tenth of the cube.
    let coarse = run("remesh", "max-size = \"50%\", tolerance = \"2%\"", &marked(&shapes::sphere(3)));
    let fine = run("remesh", "max-size = \"50%\", tolerance = \"0.1%\"", &marked(&shapes::sphere(3)));
    let count = |made: &meshmill::step::Produced<serde_json::Value>| made.stats["faces-after"].as_u64().unwrap();
    assert!(count(&fine) > 3 * count(&coarse), "{} and {}", count(&fine), count(&coarse));
    let flat = |tolerance: &str| {
        let parameters = format!("max-size = \"15%\", tolerance = \"{tolerance}\"");
        count(&run("remesh", &parameters, &marked(&shapes::cube())))
    };
    assert_eq!(flat("2%"), flat("0.1%"));
}

#[test]
fn a_cube_a_washer_and_plates_that_meet() {
    golden("remesh", "cube", "max-size = \"15%\"", &marked(&shapes::cube()));
    golden("remesh", "washer", "max-size = \"10%\"", &marked(&shapes::washer(32)));
    let seamed = run("repair", "non-manifold = \"seam\"", &soup(shapes::t_joint(4))).artifact;
    let joint = golden("remesh", "t-joint", "max-size = \"12%\"", &run("features", "", &seamed).artifact);
    assert_shape("seamed joint", &joint.stats, [0.4, 0.88]);
    let top = "name = \"top\", normal = { direction = [0, 0, 1], angle = 40 }";
    let named = run("select", top, &marked(&shapes::cylinder(24, 2))).artifact;
    let made = golden_of("remesh", "kept top", "max-size = \"12%\"", "keep = [\"top\"]", &[("from", named.clone())]);
    assert_shape("kept top", &made.stats, [0.35, 0.88]);
    let points = |of: &Artifact| of.as_surface().unwrap().points.iter().map(DVec3::to_array).collect::<Vec<_>>();
    let (before, after) = (named.as_surface().unwrap(), points(&made.artifact));
    let kept = &before.carried.groups.faces["top"];
    for v in kept.iter().flat_map(|&f| before.faces[f]) {
        assert!(after.contains(&before.points[v].to_array()), "a kept point is gone");
    }
    assert_eq!(made.artifact.as_surface().unwrap().carried.groups.faces["top"].len(), kept.len());
}

#[test]
fn sizes_differ_by_group() {
    let top = "name = \"top\", normal = { direction = [0, 0, 1], angle = 40 }";
    let named = run("select", top, &marked(&shapes::cube())).artifact;
    let made = run("remesh", "max-size = { default = \"30%\", groups = { top = \"5%\" } }", &named).artifact;
    let mesh = made.as_surface().unwrap();
    let longest = |f| {
        let [a, b, c]: [DVec3; 3] = mesh.corners(f);
        a.distance(b).max(b.distance(c)).max(c.distance(a))
    };
    let top = &mesh.carried.groups.faces["top"];
    let most = |of: &mut dyn Iterator<Item = f64>| of.fold(0.0, f64::max);
    let diagonal = 3.0_f64.sqrt();
    let of_top = most(&mut top.iter().map(|&f| longest(f)));
    assert!(of_top <= 0.05 * diagonal * 1.01, "{of_top} of {}", 0.05 * diagonal);
    assert!(most(&mut mesh.faces.ids().map(longest)) > 0.1 * diagonal);
}

#[test]
fn scale_by_powers_of_two_and_mirrors_change_nothing_that_counts() {
    let before = marked(&shapes::washer(32));
    let parameters = "max-size = \"12%\", tolerance = \"0.3%\"";
    let made = |map: &dyn Fn(DVec3) -> DVec3| {
        let surface: &Surface = before.as_surface().unwrap();
        let points = surface.points.iter().map(|&p| map(p)).collect();
        let moved = surface_of(Surface { points, ..surface.clone() });
        run("remesh", parameters, &moved)
    };
    let plain = made(&|p| p);
    for exponent in [-20, 20] {
        let scale = libm::exp2(f64::from(exponent));
        let scaled = made(&|p| p * scale);
        let (a, b) = (plain.artifact.as_surface().unwrap(), scaled.artifact.as_surface().unwrap());
        assert_eq!(a.faces, b.faces, "2^{exponent}");
        assert!(a.points.iter().zip(&b.points).all(|(p, q)| *p * scale == *q), "2^{exponent}");
    }
    for (name, map) in [("far", DVec3::new(3e5, -2e5, 1e5)), ("near", DVec3::new(30.0, -20.0, 10.0))] {
        let moved = made(&|p| p + map);
        let bound = moved.stats["distance-bound"].as_f64();
        assert!(bound.is_some() && moved.stats["min-stretch"].as_f64().unwrap() >= 0.4, "{name}: {}", moved.stats);
    }
}

/// Floors of the least and the mean stretch.
fn assert_shape(name: &str, stats: &serde_json::Value, [least, mean]: [f64; 2]) {
    let of = |figure: &str| stats[figure].as_f64().unwrap();
    assert!(of("min-stretch") >= least, "{name}: {}", of("min-stretch"));
    assert!(of("mean-stretch") >= mean, "{name}: {}", of("mean-stretch"));
}

#[test]
fn small_parts_reach_the_mean_and_keep_far_from_needles() {
    let floors = [("cube", shapes::cube(), "15%", 0.55, 0.885), ("washer", shapes::washer(32), "10%", 0.5, 0.87)];
    for (name, mesh, size, least, mean) in floors {
        let made = run("remesh", &format!("max-size = \"{size}\""), &marked(&mesh));
        assert_shape(name, &made.stats, [least, mean]);
    }
}

#[test]
fn any_number_of_threads_makes_the_same_mesh() {
    let before = marked(&shapes::torus(48, 24));
    let made = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let made = pool.install(|| run("remesh", "max-size = \"3%\", tolerance = \"0.2%\"", &before));
        (made.artifact.to_soup().unwrap(), made.stats)
    };
    let one = made(1);
    assert!(one.0.faces.len() > 3000, "{}", one.0.faces.len());
    for threads in [2, 5, 8] {
        assert!(made(threads) == one, "{threads} threads");
    }
}

#[test]
fn vertices_in_the_bottom_of_small_holes_lose_edges() {
    // A disc of 24 faces that meet in one vertex, whose rim must stay.
    let mesh = shapes::cylinder(24, 1);
    let made = run("remesh", "max-size = \"100%\", tolerance = \"0.5%\", max-valence = 8", &marked(&mesh));
    assert!(made.stats["max-valence"].as_u64().unwrap() <= 8, "{}", made.stats["max-valence"]);
}

fn surface_of(surface: Surface) -> Artifact {
    Artifact::Surface(std::sync::Arc::new(surface))
}

#[test]
fn bad_parameters_are_refused_with_the_remedy() {
    let cube = marked(&shapes::cube());
    for (parameters, words) in [
        ("tolerance = 0", "tolerance must be above 0"),
        ("max-size = 0", "max-size must be above 0"),
        ("min-stretch = 0.99", "min-stretch must be from 0 to 0.95"),
        ("max-valence = 4", "max-valence must be at least 7"),
        ("max-size = 1e-6", "above `max-faces` = 20000000"),
    ] {
        let inputs = [("from", cube.clone())];
        let failure = crate::step::run_locked("remesh", "main", parameters, "", &inputs).unwrap_err();
        assert!(failure.message.contains(words), "{parameters}: {}", failure.message);
    }
}
