//! Q-Morph on shapes that fronts are known to fail on, and on those with a known answer.

use std::collections::BTreeMap;

use glam::{DVec3, dvec3};
use meshmill::mesh::{Soup, Surface};
use meshmill::metric::{self, Value};
use meshmill::step::Artifact;
use meshmill::watch::Watch;

use super::partition::capsule;
use crate::shapes;
use crate::step::{run, surface};

/// A mesh made of quads, and what the step says of it.
struct Made {
    mesh: Soup,
    stats: serde_json::Value,
}

impl Made {
    fn least(&self) -> f64 {
        self.stats["min-scaled-jacobian"].as_f64().expect("a number")
    }

    fn mean(&self) -> f64 {
        self.stats["mean-scaled-jacobian"].as_f64().expect("a number")
    }

    fn measured(&self, name: &str) -> Option<Value> {
        metric::measure(&self.mesh, None, &Watch::silent()).expect("not cancelled").get(name)
    }
}

fn morph(from: &Soup, parameters: &str) -> Made {
    let marked = run("features", "", &surface(shapes::surface(from))).artifact;
    let made = run("q-morph", parameters, &marked);
    let Artifact::Quads(quads) = made.artifact else { panic!("no quads") };
    Made { mesh: quads.mesh.clone(), stats: made.stats }
}

/// All quads, none inverted, as many rims and the same Euler characteristic as before, and not by the last resort.
fn assert_sound(name: &str, from: &Soup, made: &Made) {
    assert_eq!(made.stats["triangles"], 0, "{name}");
    assert!(made.least() > 0.0, "{name}: the worst quad is {}", made.least());
    assert_eq!(made.stats["regions-by-level"][3], 0, "{name} needed the last resort");
    let before = metric::measure(from, None, &Watch::silent()).expect("not cancelled");
    for property in ["euler-characteristic", "boundary-loops", "closed", "manifold", "oriented"] {
        assert_eq!(made.measured(property), before.get(property), "{name}: {property}");
    }
}

/// The unit cells of a drawing, each two triangles: `#` is a cell, the first line is the top.
fn cells(drawing: &[&str]) -> Soup {
    let mut number: BTreeMap<(usize, usize), usize> = BTreeMap::new();
    let (mut points, mut faces) = (Vec::new(), Vec::new());
    for (y, line) in drawing.iter().rev().enumerate() {
        for (x, _) in line.chars().enumerate().filter(|&(_, c)| c == '#') {
            let mut id = |x: usize, y: usize| {
                *number.entry((x, y)).or_insert_with(|| {
                    points.push(dvec3(x as f64, y as f64, 0.0));
                    points.len() - 1
                })
            };
            let [a, b, c, d] = [id(x, y), id(x + 1, y), id(x + 1, y + 1), id(x, y + 1)];
            faces.extend([[a, b, c], [a, c, d]]);
        }
    }
    shapes::triangles(points, &faces)
}

/// A polygon about the origin, which sees all its corners.
fn polygon(corners: &[(f64, f64)]) -> Soup {
    let points = std::iter::once(DVec3::ZERO).chain(corners.iter().map(|&(x, y)| dvec3(x, y, 0.0))).collect();
    let n = corners.len();
    let faces: Vec<[usize; 3]> = (0..n).map(|i| [0, 1 + i, 1 + (i + 1) % n]).collect();
    shapes::triangles(points, &faces)
}

fn circle(n: usize) -> Vec<(f64, f64)> {
    (0..n).map(|i| std::f64::consts::TAU * i as f64 / n as f64).map(|a| (libm::cos(a), libm::sin(a))).collect()
}

#[test]
fn an_ell_has_good_quads() {
    let ell = cells(&["##..", "##..", "####", "####"]);
    let made = morph(&ell, "size = 0.5");
    assert_sound("ell", &ell, &made);
    // A grid would have 48.
    assert!((44..=56).contains(&made.mesh.faces.len()), "{} quads", made.mesh.faces.len());
    assert!(made.least() > 0.5 && made.mean() > 0.92, "ell: {} and {}", made.least(), made.mean());
}

#[test]
fn a_disk_and_an_annulus_have_good_quads() {
    let disk = polygon(&circle(48));
    let made = morph(&disk, "size = 0.2");
    assert_sound("disk", &disk, &made);
    assert!(made.least() > 0.45 && made.mean() > 0.9, "disk: {} and {}", made.least(), made.mean());
    let n = 48;
    let ring = |radius: f64| circle(n).into_iter().map(move |(x, y)| dvec3(radius * x, radius * y, 0.0));
    let faces = (0..n).flat_map(|i| {
        let j = (i + 1) % n;
        [[i, n + i, n + j], [i, n + j, j]]
    });
    let annulus = shapes::triangles(ring(0.4).chain(ring(1.0)).collect(), &faces.collect::<Vec<_>>());
    for size in [0.1, 0.13, 0.2] {
        let made = morph(&annulus, &format!("size = {size}"));
        assert_sound("annulus", &annulus, &made);
        assert!(made.least() > 0.5 && made.mean() > 0.92, "annulus: {} and {}", made.least(), made.mean());
    }
}

#[test]
fn an_odd_rectangle_keeps_exactly_one_triangle() {
    // Rims of 5 + 4 + 5 + 3 edges: the upper left corner is cut.
    let odd = polygon(&[(2.5, -2.0), (2.5, 2.0), (-1.5, 2.0), (-2.5, 1.0), (-2.5, -2.0)]);
    let mut odds = 0;
    for size in [0.5, 0.7, 0.9, 1.0, 1.1] {
        let made = morph(&odd, &format!("size = {size}, all-quad = false"));
        let edges = made.measured("boundary-edges");
        let triangles = made.stats["triangles"].as_u64().expect("a count");
        let is_odd = matches!(edges, Some(Value::Count(n)) if n % 2 == 1);
        assert_eq!(triangles, u64::from(is_odd), "size {size}: {edges:?} edges of rims");
        odds += triangles;
        assert!(made.least() > 0.0);
        assert_sound("odd rectangle", &odd, &morph(&odd, &format!("size = {size}")));
    }
    assert!(odds > 0, "no size gave an odd rim");
}

/// The ways in which open implementations of the method fail, each with the shape that brings it about.
#[test]
fn what_fronts_fail_on_becomes_quads() {
    let sharp = |angle: f64| polygon(&[(1.0, -libm::tan(0.5 * angle)), (1.0, libm::tan(0.5 * angle)), (-0.2, 0.0)]);
    let star: Vec<(f64, f64)> = circle(14)
        .iter()
        .enumerate()
        .map(|(i, &(x, y))| if i % 2 == 0 { (x, y) } else { (0.3 * x, 0.3 * y) })
        .collect();
    let slit = vec![(1.0, -1.0), (1.0, 1.0), (0.05, 1.0), (0.0, 0.15), (-0.05, 1.0), (-1.0, 1.0), (-1.0, -1.0)];
    let shapes: Vec<(&str, Soup, &str)> = vec![
        // A hole smaller than a quad must not be swallowed.
        ("tiny hole", cells(&["#########", "#########", "####.####", "#########", "#########"]), "size = 2.5"),
        ("two holes side by side", cells(&["#######", "#######", "##.#.##", "#######", "#######"]), "size = 1.0"),
        // Fronts meet at once: rows recovered across quads, loops cut in two of odd length.
        ("strip of one quad", cells(&["##########"]), "size = 1.0"),
        ("strip of less than a quad", cells(&["##########"]), "size = 2.0"),
        ("comb", cells(&["#.#.#.#.#", "#.#.#.#.#", "#########"]), "size = 0.7"),
        ("spiral", cells(&["#####", "#...#", "###.#", "#...#", "#####"]), "size = 0.6"),
        ("one cell", cells(&["#"]), "size = 3.0"),
        // Wedges: seams of both rims, whose ends must not be joined; rays that leave their segment.
        ("wedge of 8 degrees", sharp(0.14), "size = 0.05"),
        ("wedge of 20 degrees", sharp(0.35), "size = 0.08"),
        ("star", polygon(&star), "size = 0.12"),
        ("slit", polygon(&slit), "size = 0.2"),
        // Sizes that differ ten times: transitions must come to an end.
        ("steep sizes", cells(&["############", "############"]), "size = 2.0, gradation = 2.0, min-size = 0.05"),
        // Obtuse everywhere: chevrons must not be taken out for ever.
        ("polygon of 24 corners", polygon(&circle(24)), "size = 0.26"),
        ("triangle", polygon(&circle(3)), "size = 0.15"),
        ("coarse triangle", polygon(&circle(3)), "size = 3.0"),
    ];
    for (name, from, parameters) in shapes {
        assert_sound(name, &from, &morph(&from, parameters));
    }
}

/// Needles that end in nearly one place are halved in nearly one place: what comes of it must not stay.
#[test]
fn a_fan_of_needles_leaves_no_trace() {
    let rim = [(0.0, -1.0), (1.0, -1.0), (2.0, -1.0), (2.0, 0.0), (2.0, 1.0), (1.0, 1.0), (0.0, 1.0)];
    for (count, gap) in [(12, 1e-4), (9, 1e-2)] {
        let end = |k: usize| dvec3(1.5, 0.1 + gap * (k as f64 - 0.5 * count as f64) * [1.0, 1.3][k % 2], 0.0);
        let mut points: Vec<DVec3> = rim.iter().map(|&(x, y)| dvec3(x, y, 0.0)).collect();
        points.push(dvec3(0.5, 0.1, 0.0));
        points.extend((0..count).map(end));
        let (tip, low, high) = (7, 8, 7 + count);
        let mut faces = vec![[tip, high, 5], [high, 3, 4], [high, 4, 5], [tip, 5, 6], [tip, 6, 0], [tip, 0, 1]];
        faces.extend([[tip, 1, low], [low, 1, 2], [low, 2, 3]]);
        faces.extend((low..high).flat_map(|k| [[tip, k, k + 1], [3, k + 1, k]]));
        let soup = shapes::triangles(points, &faces);
        let made = morph(&soup, "size = 0.1");
        assert_sound("fan of needles", &soup, &made);
        assert!(made.least() > 0.7, "{count} needles: the worst quad is {}", made.least());
    }
}

#[test]
fn a_capsule_of_three_regions_keeps_their_borders() {
    let mesh = capsule(24, 8);
    let from: Surface = shapes::surface(&mesh);
    let parts = run("partition", "regions = 3", &surface(from)).artifact;
    let cut = run("split", "", &run("straighten", "", &parts).artifact).artifact;
    let made = run("q-morph", "size = 0.25, border-angle = 0", &cut);
    assert_eq!((&made.stats["regions"], &made.stats["triangles"]), (&3.into(), &0.into()));
    let Artifact::Quads(quads) = made.artifact else { panic!("no quads") };
    let least = made.stats["min-scaled-jacobian"].as_f64().expect("a number");
    assert!(least > 0.45, "the worst quad is {least}");
    let regions = quads.mesh.carried.regions.as_ref().expect("regions");
    assert_eq!(regions.names.len().max(3), 3);
    assert!(quads.mesh.carried.marks.len() >= 24, "both borders are edges");
}
