//! Simplify-fit: fillets stay on their cylinders, flat faces stay flat, and what is promised is counted again.

use std::collections::BTreeMap;
use std::f64::consts::PI;
use std::sync::Arc;

use glam::DVec3;
use meshmill::format::{Format, read};
use meshmill::mesh::{Id, Support, Surface};
use meshmill::metric;
use meshmill::step::Artifact;
use meshmill::watch::Watch;

use super::golden::{golden, golden_of};
use crate::shapes;
use crate::step::{run, run_locked, surface};

const HALF: [f64; 3] = [20.0, 10.0, 5.0];
const RADIUS: f64 = 3.0;

/// A box with all edges rounded: flat faces of half sizes `half`, cut into `cells` squares a side and named `flat`,
/// fillets of `radius` with `segments` facets in 45 degrees, and corners of a sphere.
fn rounded_box(half: [f64; 3], radius: f64, segments: usize, cells: usize) -> Surface {
    // Along one side of a face: how far on the flat part, and the tangent of the angle on the fillet.
    let steps = |flat: f64| {
        let tangent = |i: usize| libm::tan(PI / 4.0 * (segments - i) as f64 / segments as f64);
        let before = (0..segments).map(move |i| (-flat, -tangent(i)));
        let middle = (0..=cells).map(move |i| (flat * (2.0 * i as f64 / cells as f64 - 1.0), 0.0));
        let after = (0..segments).rev().map(move |i| (flat, tangent(i)));
        before.chain(middle).chain(after).collect::<Vec<_>>()
    };
    let mut numbers: BTreeMap<[i64; 3], usize> = BTreeMap::new();
    let (mut points, mut faces, mut flat) = (Vec::new(), Vec::new(), Vec::new());
    for (axis, sign) in [(0, 1.0), (0, -1.0), (1, 1.0), (1, -1.0), (2, 1.0), (2, -1.0)] {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        let (along_u, along_v) = (steps(half[u]), steps(half[v]));
        let mut number = |i: usize, j: usize| {
            let (mut base, mut outward) = ([0.0; 3], [0.0; 3]);
            (base[axis], outward[axis]) = (sign * half[axis], sign);
            (base[u], outward[u]) = along_u[i];
            (base[v], outward[v]) = along_v[j];
            let p = DVec3::from(base) + radius * DVec3::from(outward).normalize();
            let key = p.to_array().map(|x| libm::round(x * 1e7) as i64);
            *numbers.entry(key).or_insert_with(|| {
                points.push(p);
                points.len() - 1
            })
        };
        for i in 0..along_u.len() - 1 {
            for j in 0..along_v.len() - 1 {
                let [a, b, c, d] = [number(i, j), number(i + 1, j), number(i + 1, j + 1), number(i, j + 1)];
                let inside = |at: usize| (segments..segments + cells).contains(&at);
                if inside(i) && inside(j) {
                    flat.extend([Id::new(faces.len()), Id::new(faces.len() + 1)]);
                }
                let quad = if sign > 0.0 { [[a, b, c], [a, c, d]] } else { [[a, c, b], [a, d, c]] };
                faces.extend(quad);
            }
        }
    }
    let faces = faces.iter().map(|face: &[usize; 3]| face.map(Id::new)).collect();
    let mut made = Surface { points: points.into(), faces, ..Surface::default() };
    made.carried.groups.faces.insert("flat".to_owned(), flat);
    made
}

/// How far a point lies off the rounded box.
fn off(p: DVec3) -> f64 {
    let inner = p.clamp(-DVec3::from(HALF), DVec3::from(HALF));
    (p.distance(inner) - RADIUS).abs()
}

fn values<'a>(mesh: &'a Surface, name: &str) -> &'a [f64] {
    &mesh.carried.field(Support::Vertex, name).unwrap_or_else(|| panic!("no field `{name}`")).values
}

#[test]
fn fillets_stay_on_their_radius_and_flat_faces_flat() {
    let mesh = rounded_box(HALF, RADIUS, 4, 6);
    let made = golden("simplify-fit", "rounded box", "remove = \"70%\", tolerance = 0.1", &surface(mesh.clone()));
    let result = made.artifact.as_surface().unwrap();
    assert_eq!(made.stats["status"], "target-reached");
    assert!(result.faces.len() * 10 <= mesh.faces.len() * 3, "{} faces", result.faces.len());
    let (kinds, radii) = (values(result, "fit-kind"), values(result, "fit-radius"));
    let mut on_fits = 0;
    for (v, p) in result.points.iter().enumerate().filter(|(v, _)| kinds[*v] > 0.0) {
        assert!((radii[v] - RADIUS).abs() < 0.01 * RADIUS, "vertex {v}: radius {}", radii[v]);
        assert!(off(*p) < 0.01 * RADIUS, "vertex {v} lies {} off its fillet", off(*p));
        on_fits += 1;
    }
    assert!(on_fits > 20, "only {on_fits} vertices lie on fits");
    // Twelve fillets and eight corners, all of one radius, and nothing else.
    let fillets = made.stats["fillets"].as_array().unwrap();
    let counts = fillets.iter().map(|bin| (bin["kind"].as_str().unwrap(), bin["count"].as_u64().unwrap()));
    assert_eq!(counts.collect::<Vec<_>>(), [("cylinder", 12), ("sphere", 8)]);
    assert!(fillets.iter().all(|bin| (bin["radius"].as_f64().unwrap() - RADIUS).abs() < 1e-6 * RADIUS));
    assert_eq!(made.stats["vertices-on-fits"].as_u64(), Some(on_fits));
    let flat = &result.carried.groups.faces["flat"];
    assert!(!flat.is_empty());
    for p in flat.iter().flat_map(|&f| result.corners(f)) {
        let sides = p.to_array().into_iter().zip(HALF).map(|(x, half)| (x.abs() - half - RADIUS).abs());
        let nearest = sides.fold(f64::INFINITY, f64::min);
        assert!(nearest < 1e-12, "{p} left its flat face by {nearest}");
    }
}

#[test]
fn a_sphere_keeps_its_radius_where_a_fit_is_accepted() {
    let mesh = shapes::surface(&shapes::sphere(4));
    let made = run("simplify-fit", "dispersion-threshold = 1, tolerance = \"1%\"", &surface(mesh));
    let result = made.artifact.as_surface().unwrap();
    let radii = values(result, "fit-radius");
    let on_fits = result.points.iter().zip(radii).filter(|(_, radius)| **radius > 0.0);
    let mut count = 0;
    for (p, radius) in on_fits {
        assert!((p.length() - 1.0).abs() < 1e-9 && (radius - 1.0).abs() < 1e-9, "{p}, radius {radius}");
        count += 1;
    }
    assert!(count > 100, "only {count} vertices lie on fits");
}

#[test]
fn what_is_promised_holds_when_counted_again() {
    for (name, mesh) in [("torus", shapes::torus(48, 24)), ("cylinder", shapes::cylinder(40, 12))] {
        let from = run("features", "", &surface(shapes::surface(&mesh))).artifact;
        let made = golden("simplify-fit", name, "remove = \"60%\", tolerance = \"0.5%\"", &from);
        let (result, before) = (made.artifact.to_soup().unwrap(), from.to_soup().unwrap());
        let measured = metric::measure(&result, Some(&before), &Watch::silent()).unwrap();
        let number = |name: &str| measured.get(name).unwrap().as_f64();
        assert_eq!(number("self-intersections"), 0.0, "{name}");
        assert_eq!(number("euler-characteristic"), if name == "torus" { 0.0 } else { 2.0 });
        assert!(number("distance") - number("distance-slack") <= made.stats["tolerance"].as_f64().unwrap(), "{name}");
        assert_eq!(made.stats["faces-after"].as_u64().unwrap() as usize, result.faces.len());
    }
}

#[test]
fn no_face_grows_beyond_the_size_allowed() {
    let mesh = rounded_box(HALF, RADIUS, 4, 16);
    let made = run("simplify-fit", "remove = \"90%\", tolerance = 0.1, max-size = 5.0", &surface(mesh.clone()));
    let result = made.artifact.as_surface().unwrap();
    let sides = result.faces.ids().flat_map(|f| {
        let [a, b, c] = result.corners(f);
        [a.distance(b), b.distance(c), c.distance(a)]
    });
    let longest = sides.fold(0.0, f64::max);
    assert!(longest <= 5.0 * (1.0 + 1e-9), "a side is {longest} long");
    assert!(result.faces.len() < mesh.faces.len() / 2, "{} faces", result.faces.len());
}

#[test]
fn what_bars_more_is_told_for_every_edge_that_is_left() {
    let from = surface(rounded_box(HALF, RADIUS, 4, 6));
    let tight = run("simplify-fit", "target-faces = 20, tolerance = 0.05", &from);
    assert_eq!(tight.stats["status"], "stuck");
    let bars = tight.stats["barred"].as_object().unwrap();
    let sum: u64 = bars.values().map(|count| count.as_u64().unwrap()).sum();
    assert_eq!(2 * sum, 3 * tight.stats["faces-after"].as_u64().unwrap());
    assert!(bars["tolerance"].as_u64().unwrap() > 0, "{bars:?}");
    let loose = run("simplify-fit", "remove = \"30%\", tolerance = 0.1", &from);
    assert_eq!(loose.stats["status"], "target-reached");
    assert!(loose.stats.get("barred").is_none());
}

#[test]
fn topology_is_kept_on_many_meshes() {
    let shipped = |file: &str| {
        let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/meshes").join(file);
        let bytes = std::fs::read(path).unwrap();
        let soup = read(Format::detect(file, &bytes).unwrap(), &bytes, &Watch::silent()).unwrap().0;
        run("repair", "", &Artifact::Soup(Arc::new(soup))).artifact
    };
    let meshes = [
        ("box", surface(rounded_box(HALF, RADIUS, 2, 3))),
        ("cube", surface(shapes::surface(&shapes::subdivided(&shapes::cube(), 3)))),
        ("sphere", surface(shapes::surface(&shapes::sphere(3)))),
        ("torus", surface(shapes::surface(&shapes::torus(30, 12)))),
        ("bracket", shipped("l_bracket.stl")),
        ("part", shipped("simple_part.stl")),
        ("open plate with holes", shipped("plate_holes_open.stl")),
        ("tee", shipped("t_joint.obj")),
    ];
    for (name, mesh) in meshes {
        // Far beyond what the meshes have to give: topology is lost where collapses run out.
        for parameters in ["remove = \"99%\", tolerance = \"2%\"", "remove = \"60%\", tolerance-mode = \"plane\""] {
            let from = run("features", "", &mesh).artifact;
            let made = run("simplify-fit", parameters, &from);
            let measured = [&from, &made.artifact].map(|artifact| {
                let soup = artifact.to_soup().unwrap();
                metric::measure(&soup, None, &Watch::silent()).unwrap()
            });
            for of in ["components", "euler-characteristic", "boundary-loops", "closed", "manifold", "oriented"] {
                let [before, after] = [0, 1].map(|i| measured[i].get(of).map(|m| format!("{m:?}")));
                assert!(before.is_some() && before == after, "{name}, {parameters}: {of} {before:?} to {after:?}");
            }
        }
    }
}

#[test]
fn kept_faces_are_identical_in_the_result() {
    let mesh = surface(shapes::surface(&shapes::subdivided(&shapes::cube(), 3)));
    let named = run("select", "name = \"top\", normal = { direction = [0, 0, 1] }", &mesh).artifact;
    let marked = run("features", "", &named).artifact;
    let made = golden_of("simplify-fit", "kept top", "", "keep = [\"top\"]", &[("from", marked.clone())]);
    let corners = |artifact: &meshmill::step::Artifact| {
        let mesh = artifact.as_surface().unwrap();
        let faces = mesh.carried.groups.faces["top"].iter().map(|&f| mesh.corners(f).map(|p| p.to_array()));
        let mut faces: Vec<_> = faces.collect();
        for face in &mut faces {
            face.sort_by(|a, b| a.partial_cmp(b).unwrap());
        }
        faces.sort_by(|a, b| a.partial_cmp(b).unwrap());
        faces
    };
    assert_eq!(corners(&made.artifact), corners(&marked));
}

#[test]
fn every_mode_reaches_its_target_and_says_so() {
    let mesh = surface(rounded_box(HALF, RADIUS, 3, 4));
    for parameters in [
        "target-faces = 500, tolerance = 0.2",
        "target-faces = 500, tolerance = 0.2, tolerance-mode = \"plane\"",
        "target-faces = 500, tolerance = 0.2, fit = \"none\"",
        "target-faces = 500, tolerance = 0.2, dispersion = \"std\", k-m = 0",
    ] {
        let made = run("simplify-fit", parameters, &mesh);
        assert_eq!(made.stats["status"], "target-reached", "{parameters}: {}", made.stats);
        assert!(made.artifact.as_surface().unwrap().faces.len() <= 500);
        assert_eq!(made.stats["distance-bound"].is_null(), parameters.contains("plane"));
        assert_eq!(made.stats["share-below-20"], 1.0, "{parameters}");
    }
}

#[test]
fn what_cannot_be_reached_is_told() {
    let mesh = surface(rounded_box(HALF, RADIUS, 3, 4));
    let made = run("simplify-fit", "remove = \"99%\", tolerance = 0.001", &mesh);
    assert_eq!(made.stats["status"], "stuck");
    let both = run_locked("simplify-fit", "main", "remove = 0.5, target-faces = 9", "", &[("from", mesh.clone())]);
    assert!(both.unwrap_err().message.contains("both"));
    let wild = run_locked("simplify-fit", "main", "k-m = 9", "", &[("from", mesh)]);
    assert!(wild.unwrap_err().message.contains("k-m"));
}

/// A bar ten thousand times as long as thick: vertices in its needles would make hundreds of needles out of a few.
#[test]
fn needles_that_cannot_be_mended_stay_as_few_as_they_are() {
    let mut mesh = shapes::surface(&shapes::cylinder(8, 2));
    for p in &mut mesh.points {
        p.z *= 1e4;
    }
    let needles = |mesh: &Surface| {
        let aspect = |f| meshmill::mesh::geometry::aspect_ratio(mesh.corners(f));
        mesh.faces.ids().filter(|&f| aspect(f) > 20.0).count()
    };
    let before = (mesh.faces.len(), needles(&mesh));
    let made = run("simplify-fit", "remove = 0, tolerance = \"0.01%\"", &surface(mesh));
    let result = made.artifact.as_surface().unwrap();
    assert!(before.1 > 0 && made.stats["without-new-vertices"] == true);
    assert!(
        needles(result) <= before.1 && result.faces.len() <= before.0,
        "{} of {}",
        needles(result),
        result.faces.len()
    );
    let measured = metric::measure(&made.artifact.to_soup().unwrap(), None, &Watch::silent()).unwrap();
    assert_eq!(measured.get("self-intersections").unwrap().as_f64(), 0.0);
}
