//! Control-properties: thresholds hold when counted again, and what is kept stays.

use meshmill::metric;
use meshmill::watch::Watch;

use super::golden::{golden, golden_of};
use crate::shapes;
use crate::step::{run, surface};

const LIMITS: &str = "min-stretch = 0.3, max-size = \"20%\", max-valence = 9, tolerance = \"1%\"";

#[test]
fn the_thresholds_hold_when_counted_again() {
    for (name, mesh) in [("sphere", shapes::sphere(4)), ("torus", shapes::torus(40, 20))] {
        let from = surface(shapes::surface(&mesh));
        let made = golden("control-properties", name, LIMITS, &from);
        let (result, before) = (made.artifact.to_soup().unwrap(), from.to_soup().unwrap());
        let measured = metric::measure(&result, Some(&before), &Watch::silent()).unwrap();
        let number = |name: &str| measured.get(name).unwrap().as_f64();
        assert!(result.faces.len() < before.faces.len() / 2, "{name}: {} faces", result.faces.len());
        assert!(number("min-stretch") >= 0.3 && number("max-valence") <= 9.0, "{name}");
        assert!(number("max-size") <= 0.2 * number("diagonal") && number("self-intersections") == 0.0, "{name}");
        assert!(number("distance") - number("distance-slack") <= made.stats["tolerance"].as_f64().unwrap(), "{name}");
        assert_eq!(number("euler-characteristic"), if name == "torus" { 0.0 } else { 2.0 });
    }
}

#[test]
fn the_distance_bound_is_no_larger_than_what_moved() {
    let bound = |parameters: &str, mesh: &meshmill::mesh::Soup| {
        let marked = run("features", "", &surface(shapes::surface(mesh))).artifact;
        let stats = run("control-properties", parameters, &marked).stats;
        let edits: u64 = ["collapses", "flips", "splits", "moves"].iter().map(|n| stats[n].as_u64().unwrap()).sum();
        (edits, stats["distance-bound"].as_f64().unwrap(), stats["tolerance"].as_f64().unwrap())
    };
    let pure = "optimize = false, min-stretch = 0.0, tolerance = \"1%\"";
    let (edits, far, _) = bound(&format!("{pure}, target-faces = 100000"), &shapes::sphere(3));
    assert_eq!((edits, far), (0, 0.0), "nothing was done");
    let (edits, far, _) = bound(pure, &shapes::subdivided(&shapes::cube(), 3));
    assert!(edits > 0 && far < 1e-9, "{edits} edits in planes are {far} off");
    let (edits, far, tolerance) = bound(pure, &shapes::sphere(3));
    assert!(edits > 0 && far > 0.0 && far <= tolerance, "{edits} edits, {far} of {tolerance}");
}

#[test]
fn kept_faces_are_identical_in_the_result() {
    let mesh = surface(shapes::surface(&shapes::subdivided(&shapes::cube(), 3)));
    let named = run("select", "name = \"top\", normal = { direction = [0, 0, 1] }", &mesh).artifact;
    let marked = run("features", "", &named).artifact;
    let made = golden_of("control-properties", "kept top", LIMITS, "keep = [\"top\"]", &[("from", marked.clone())]);
    let corners = |artifact: &meshmill::step::Artifact| {
        let mesh = artifact.as_surface().unwrap();
        let mut faces: Vec<_> =
            mesh.carried.groups.faces["top"].iter().map(|&f| mesh.corners(f).map(|p| p.to_array())).collect();
        for face in &mut faces {
            face.sort_by(|a, b| a.partial_cmp(b).unwrap());
        }
        faces.sort_by(|a, b| a.partial_cmp(b).unwrap());
        faces
    };
    assert_eq!(corners(&made.artifact), corners(&marked));
}

#[test]
fn by_quadrics_to_a_number_of_faces() {
    let sphere = surface(shapes::surface(&shapes::sphere(4)));
    let parameters = "tolerance-mode = \"quadric-sum\", tolerance = 0.01, min-stretch = 0.2, target-faces = 500";
    let made = golden("control-properties", "sphere by quadrics", parameters, &sphere);
    assert_eq!(made.stats["status"], "target-reached");
}

#[test]
fn both_sheets_of_a_seam_change_alike() {
    let joint = crate::step::soup(shapes::t_joint(16));
    let seamed = run("repair", "non-manifold = \"seam\"", &joint).artifact;
    let marked = run("features", "", &seamed).artifact;
    let made = golden("control-properties", "t-joint", LIMITS, &marked);
    let made = made.artifact.as_surface().unwrap();
    for (vertex, seam) in &made.carried.seams {
        let twins = made.carried.seams.iter().filter(|(v, s)| *s == seam && made.points[**v] == made.points[*vertex]);
        assert_eq!(twins.count(), 2, "vertex {vertex} has lost its twin");
    }
}

#[test]
fn the_needles_of_a_washer_go() {
    // They go only where a split may make a face worse for a while.
    let washer = surface(shapes::surface(&shapes::washer(20)));
    let marked = run("features", "angle = 35", &washer).artifact;
    let made = run("control-properties", "max-size = \"25%\", tolerance = \"2%\"", &marked).artifact;
    let least = |mesh: &meshmill::step::Artifact| {
        let measured = metric::measure(&mesh.to_soup().unwrap(), None, &Watch::silent()).unwrap();
        measured.get("min-stretch").unwrap().as_f64()
    };
    assert!(least(&marked) < 0.1 && least(&made) > 0.4, "{} after {}", least(&made), least(&marked));
}
