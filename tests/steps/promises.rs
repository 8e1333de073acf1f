//! What steps promise of their results, recounted on the results by code that the steps do not use.

use glam::{DVec3, dvec3};
use meshmill::mesh::{Facet, Soup};
use meshmill::metric;
use meshmill::step::{Artifact, Produced};
use meshmill::watch::Watch;
use serde_json::Value;

use crate::shapes;
use crate::step::{run, surface};

/// A shape with its sharp edges marked.
fn marked(mesh: &Soup) -> Artifact {
    run("features", "", &surface(shapes::surface(mesh))).artifact
}

/// Looks metrics of a result up, measured against what it was made from.
fn measured(result: &Soup, before: &Artifact) -> impl Fn(&str) -> f64 + use<> {
    let measured = metric::measure(result, Some(&before.to_soup().unwrap()), &Watch::silent()).unwrap();
    move |name| measured.get(name).unwrap_or_else(|| panic!("no metric {name}")).as_f64()
}

/// A square plate of side 2 with a hole of radius 0.05.
fn plate_with_a_small_hole() -> Soup {
    let at = |i: usize| {
        let turn = std::f64::consts::TAU * (i % 48) as f64 / 48.0;
        dvec3(libm::cos(turn), libm::sin(turn), 0.0)
    };
    let points = (0..48).map(|i| 0.05 * at(i)).chain((0..48).map(|i| at(i) / at(i).abs().max_element())).collect();
    let faces: Vec<[usize; 3]> = (0..48)
        .flat_map(|i| {
            let next = (i + 1) % 48;
            [[i, 48 + i, 48 + next], [i, 48 + next, next]]
        })
        .collect();
    shapes::triangles(points, &faces)
}

/// The middles of the faces with their mean edge length.
fn sizes(mesh: &Soup) -> Vec<(DVec3, f64)> {
    mesh.faces
        .iter()
        .map(|face| {
            let p: Vec<DVec3> = face.corners().iter().map(|&v| mesh.points[v]).collect();
            let length: f64 = (0..p.len()).map(|i| p[i].distance(p[(i + 1) % p.len()])).sum();
            (p.iter().sum::<DVec3>() / p.len() as f64, length / p.len() as f64)
        })
        .collect()
}

/// The mean size in rings about the hole, the innermost first: distance from the rim of the hole, and size. Single
/// faces scatter about their size; rings do not.
fn rings(mesh: &Soup) -> Vec<(f64, f64)> {
    let mut all: Vec<Vec<(f64, f64)>> = vec![Vec::new(); 12];
    for (middle, size) in sizes(mesh) {
        let from_rim = middle.abs().max_element() - 0.05;
        all[((12.0 * from_rim) as usize).min(11)].push((from_rim, size));
    }
    all.retain(|ring| ring.len() >= 4);
    let mean =
        |ring: &Vec<(f64, f64)>, of: fn(&(f64, f64)) -> f64| ring.iter().map(of).sum::<f64>() / ring.len() as f64;
    all.iter().map(|ring| (mean(ring, |r| r.0), mean(ring, |r| r.1))).collect()
}

fn edges(mesh: &Soup) -> Vec<f64> {
    let around = |face: &Facet| {
        let p: Vec<DVec3> = face.corners().iter().map(|&v| mesh.points[v]).collect();
        (0..p.len()).map(|i| p[i].distance(p[(i + 1) % p.len()])).collect::<Vec<_>>()
    };
    mesh.faces.iter().flat_map(around).collect()
}

/// Quads of a marked shape.
fn quads(before: &Artifact, parameters: &str) -> (Soup, Produced<Value>) {
    let made = run("q-morph", parameters, before);
    (made.artifact.to_soup().unwrap().as_ref().clone(), made)
}

#[test]
fn curves_stay_within_the_feature_tolerance() {
    let before = marked(&shapes::cylinder(96, 12));
    let diagonal = measured(&before.to_soup().unwrap(), &before)("diagonal");
    for (step, coarse) in [("control-properties", ""), ("improve-quality", ""), ("remesh", "max-size = \"40%\", ")] {
        for share in [0.1, 0.5] {
            let parameters = format!("{coarse}tolerance = \"2%\", feature-tolerance = \"{share}%\"");
            let made = run(step, &parameters, &before);
            let figure = measured(&made.artifact.to_soup().unwrap(), &before);
            let (far, limit) = (figure("feature-deviation"), 0.01 * share * diagonal);
            assert!(far > 0.3 * limit, "{step}: the curves did not move, which shows nothing");
            assert!(far <= limit * (1.0 + 1e-9), "{step}: {far} of {limit}");
        }
    }
}

#[test]
fn quads_stay_within_their_tolerances_and_cross_nothing() {
    for (name, mesh) in [
        ("cylinder", shapes::cylinder(96, 12)),
        ("washer", shapes::washer(96)),
        ("torus", shapes::torus(48, 24)),
        ("plate", plate_with_a_small_hole()),
    ] {
        let before = marked(&mesh);
        let (result, made) = quads(&before, "size = \"12%\", tolerance = \"0.3%\", curve-tolerance = \"0.1%\"");
        let figure = measured(&result, &before);
        let diagonal = figure("diagonal");
        assert_eq!(figure("self-intersections"), 0.0, "{name}");
        assert!(figure("distance") - figure("distance-slack") <= 0.003 * diagonal * 1.01, "{name}: distance");
        assert!(made.stats["distance"].as_f64().unwrap() >= figure("distance") - figure("distance-slack"), "{name}");
        if name != "torus" {
            assert!(figure("feature-deviation") <= 0.001 * diagonal * 1.01, "{name}: {}", figure("feature-deviation"));
        }
    }
}

#[test]
fn sizes_of_quads_grow_no_faster_than_the_gradation() {
    // Quads come out up to twice as large as the sizes wanted; without gradation they would be four times as large
    // here.
    const SLACK: f64 = 2.2;
    let before = marked(&plate_with_a_small_hole());
    for gradation in [0.1, 0.2] {
        let (result, _) = quads(&before, &format!("size = 0.5, gradation = {gradation}"));
        let rings = rings(&result);
        let (_, least) = rings[0];
        assert!(rings.iter().any(|r| r.1 > 2.0 * least), "all of one size, which shows nothing");
        for (from_rim, size) in rings {
            assert!(
                size <= SLACK * (least + gradation * from_rim),
                "{size} at {from_rim} from the rim with {gradation}"
            );
        }
    }
}

#[test]
fn no_edge_of_quads_is_shorter_than_the_least_size() {
    let before = marked(&shapes::cylinder(96, 12));
    for least in [0.1, 0.2] {
        let (result, _) =
            quads(&before, &format!("size = 1.0, min-size = {least}, tolerance = 0.5, curve-tolerance = 0.5"));
        let all = edges(&result);
        let shortest = all.iter().copied().fold(f64::INFINITY, f64::min);
        assert!(shortest >= 0.5 * least, "an edge of {shortest}");
    }
}
