//! Q-Morph: known answers, quads only, none inverted.

use std::path::Path;
use std::sync::Arc;

use glam::dvec3;
use meshmill::format::{Format, read};
use meshmill::mesh::geometry::Aabb;
use meshmill::mesh::{Quads, Soup, Surface};
use meshmill::metric::quad_shape::quad_shapes;
use meshmill::step::Artifact;
use meshmill::watch::Watch;
use serde_json::Value;

use super::golden::golden;
use crate::corpus::corpus;
use crate::shapes;
use crate::step::{run, surface};

/// The result, its statistics and its least and mean scaled Jacobian.
fn quads(mesh: Surface, parameters: &str) -> (Soup, Value, f64, f64) {
    let marked = run("features", "", &surface(mesh)).artifact;
    let made = run("q-morph", parameters, &marked);
    let Artifact::Quads(quads) = made.artifact else { panic!("no quads") };
    let jacobians = quad_shapes(&quads.mesh).column(|q| q.scaled_jacobian);
    let least = jacobians.iter().copied().fold(f64::INFINITY, f64::min);
    let mean = jacobians.iter().sum::<f64>() / jacobians.len() as f64;
    (quads.mesh.clone(), made.stats, least, mean)
}

fn plain(soup: &Soup) -> Surface {
    shapes::surface(soup)
}

#[test]
fn a_square_and_a_cube_become_regular_grids() {
    let (mesh, stats, least, _) = quads(plain(&shapes::grid(8)), "size = 0.1");
    assert_eq!((mesh.faces.len(), &stats["triangles"]), (100, &0.into()));
    assert!(least >= 0.999, "the square's worst quad is {least}");
    let (mesh, stats, least, _) = quads(plain(&shapes::cube()), "size = \"11.5%\"");
    assert_eq!(stats["regions"], 6);
    assert_eq!(mesh.faces.len() % 6, 0);
    let side = (mesh.faces.len() / 6).isqrt();
    assert_eq!(6 * side * side, mesh.faces.len(), "the cube is no grid");
    assert!(least > 0.999, "the cube's worst quad is {least}");
}

#[test]
fn an_odd_border_leaves_one_triangle_or_gets_one_edge_more() {
    let mut strip = plain(&shapes::grid(8));
    for p in &mut strip.points {
        *p = dvec3(8.0 * p.x, 5.0 * p.y + p.x * p.y, 0.0);
    }
    for size in [0.9, 1.0, 1.1] {
        let (_, stats, least, _) = quads(strip.clone(), &format!("size = {size}, all-quad = false"));
        let odd = stats["triangles"].as_u64().unwrap();
        assert!(odd <= 1 && least > 0.3, "size {size}: {odd} triangles, worst {least}");
        let (_, stats, least, _) = quads(strip.clone(), &format!("size = {size}"));
        assert_eq!((&stats["triangles"], &stats["parity-splits"]), (&0.into(), &odd.into()));
        assert!(least > 0.3, "size {size}: worst {least}");
    }
}

#[test]
fn rings_spheres_and_bars_are_all_quads() {
    let washer = quads(plain(&shapes::washer(40)), "size = \"4%\"");
    let sphere = quads(plain(&shapes::sphere(3)), "size = \"6%\"");
    let torus = quads(plain(&shapes::torus(24, 12)), "size = \"4%\"");
    let cylinder = quads(plain(&shapes::cylinder(24, 6)), "size = \"5%\"");
    for (name, (_, stats, least, mean)) in
        [("washer", washer), ("sphere", sphere), ("torus", torus), ("cylinder", cylinder)]
    {
        assert_eq!(stats["triangles"], 0, "{name}");
        assert_eq!(stats["regions-by-level"][3], 0, "{name} needed the last resort");
        assert!(least >= 0.4 && mean >= 0.9, "{name}: worst {least}, mean {mean}");
    }
}

#[test]
fn marks_nodes_and_groups_arrive() {
    let cube = plain(&shapes::cube());
    let top = run("select", "name = \"top\", normal = { direction = [0, 0, 1] }", &surface(cube)).artifact;
    let marked = run("features", "", &top).artifact;
    let made = run("q-morph", "size = \"20%\"", &marked).artifact;
    let mesh = &made.as_quads().unwrap().mesh;
    assert_eq!(mesh.carried.pins.len(), 8);
    let per_face = mesh.faces.len() / 6;
    assert_eq!(mesh.carried.groups.faces["top"].len(), per_face);
    assert_eq!(mesh.carried.marks.len(), 12 * per_face.isqrt());
}

/// A star-shaped polygon of random corners about the origin.
fn polygon(seed: u64) -> Option<Surface> {
    let mut state = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
    let mut random = move || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 11) as f64 / (1_u64 << 53) as f64
    };
    let corners = 3 + (random() * 10.0) as usize;
    let turns: Vec<f64> = (0..corners).map(|_| 0.25 + random()).collect();
    let sum: f64 = turns.iter().sum();
    let mut points = vec![glam::DVec3::ZERO];
    let mut at = 0.0;
    for turn in turns {
        at += turn / sum * std::f64::consts::TAU;
        let radius = 0.35 + 0.65 * random();
        points.push(dvec3(radius * libm::cos(at), radius * libm::sin(at), 0.0));
    }
    let faces: Vec<[usize; 3]> = (0..corners).map(|i| [0, 1 + i, 1 + (i + 1) % corners]).collect();
    let upright = |f: &[usize; 3]| (points[f[1]] - points[0]).cross(points[f[2]] - points[0]).z > 1e-3;
    let all = faces.iter().all(upright);
    all.then(|| plain(&shapes::triangles(points, &faces)))
}

/// `MESHMILL_POLYGONS` sets how many are tried: 300 in a usual run, 10 000 in a thorough one.
#[test]
fn random_polygons_never_give_an_inverted_quad() {
    let count = std::env::var("MESHMILL_POLYGONS").ok().and_then(|n| n.parse().ok()).unwrap_or(300);
    for seed in 1..=count {
        let Some(mesh) = polygon(seed) else { continue };
        let size = 0.06 + 0.2 * (seed % 7) as f64 / 7.0;
        let made = run("q-morph", &format!("size = {size}"), &surface(mesh));
        let least = made.stats["min-scaled-jacobian"].as_f64().unwrap();
        assert_eq!(made.stats["triangles"], 0, "polygon {seed}");
        assert!(least > 0.0, "polygon {seed} has a quad of {least}");
    }
}

#[test]
fn golden_files() {
    golden("q-morph", "square", "size = 0.2", &surface(plain(&shapes::grid(6))));
    golden("q-morph", "washer", "size = \"6%\"", &run("features", "", &surface(plain(&shapes::washer(20)))).artifact);
    golden("q-morph", "curved", "size = \"9%\", size-curvature = 24", &surface(plain(&shapes::torus(16, 8))));
}

fn stl(part: &Path) -> Soup {
    read(Format::Stl, &std::fs::read(part).unwrap(), &Watch::silent()).unwrap().0
}

/// The quads of a part by the steps of `quads-closed.toml`, and the statistics of the last one.
fn chained(part: Soup, parameters: &str) -> (Arc<Quads>, Value) {
    let mut artifact = Artifact::Soup(Arc::new(part));
    let chain = [
        ("repair", "fill-holes = \"all\""),
        ("features", "angle = 40, min-gap = \"0.4%\""),
        ("partition", "max-angle = 45"),
        ("straighten", ""),
        ("split", ""),
    ];
    for (step, parameters) in chain {
        artifact = run(step, parameters, &artifact).artifact;
    }
    let made = run("q-morph", parameters, &artifact);
    let Artifact::Quads(quads) = made.artifact else { panic!("no quads") };
    (quads, made.stats)
}

#[test]
fn walls_of_bores_are_meshed_however_coarse() {
    // Needles from rim to rim have no vertex inside that knows where the wall looks. At this size the triangles that
    // quads are made of came to span the bores, and a dozen quads were inverted after minutes.
    let part = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/examples/meshes/simple_part.stl"));
    let (quads, _) = chained(stl(part), "size = 1.249, tolerance = \"1%\", curve-tolerance = \"0.3%\"");
    let least = quad_shapes(&quads.mesh).column(|q| q.scaled_jacobian).iter().copied().fold(1.0, f64::min);
    assert!(least > 0.1, "the worst quad is {least}");
    assert!(quads.mesh.faces.len() < 6000, "{} quads, three thousand were asked for", quads.mesh.faces.len());
}

#[test]
fn a_part_comes_within_the_tolerance_with_sound_shapes() {
    // Attempts that mend one region make those beside it worse: only what is mended on from there holds everywhere.
    let Some(part) = corpus("cad/phone_panel.stl") else { return };
    let (quads, stats) = chained(stl(&part), "size = \"3%\", tolerance = \"0.3%\"");
    let diagonal = Aabb::of(quads.mesh.points.iter().copied()).diagonal();
    let number = |name: &str| stats[name].as_f64().unwrap();
    assert!(number("distance") <= 0.003 * diagonal, "{} from the surface", number("distance"));
    assert!(number("curve-distance") <= 0.0011 * diagonal, "{} from the curves", number("curve-distance"));
    assert!(number("min-scaled-jacobian") >= 0.5, "the worst quad is {}", number("min-scaled-jacobian"));
    assert_eq!(stats["triangles"], 0);
}

#[test]
fn thin_walls_have_both_their_edges() {
    // A wall as thick as a third of a percent of the part, which the tolerance would let pass for nothing: with one
    // edge round its rim, the quads inside and outside passed through each other.
    let ring = shapes::turned(64, [(1.0, 0.0), (1.0, 0.5), (0.99, 0.5), (0.99, 0.0)]);
    let (quads, stats) = chained(ring, "size = \"3%\", tolerance = \"0.3%\"");
    assert!(stats["min-scaled-jacobian"].as_f64().unwrap() > 0.5, "{stats}");
    let volume: f64 = quads
        .mesh
        .faces
        .iter()
        .map(|face| {
            let [a, b, c, d] = [0, 1, 2, 3].map(|k| quads.mesh.points[face.corners()[k]]);
            a.dot((b - a).cross(c - a) + (c - a).cross(d - a)) / 6.0
        })
        .sum();
    let wall = 0.5 * 0.5 * 64.0 * libm::sin(std::f64::consts::TAU / 64.0) * (1.0 - 0.99 * 0.99);
    assert!((volume / wall - 1.0).abs() < 0.05, "a volume of {volume}, not {wall}");
}
