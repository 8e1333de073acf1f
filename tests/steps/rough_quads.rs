//! Rough quads: known answers, and the promises of a conforming complex that covers its surface.

use glam::dvec3;
use meshmill::mesh::topology::{EdgeTable, components, euler_characteristic};
use meshmill::mesh::{Facet, Id, Quads, Regions, Soup, Surface};
use meshmill::step::Artifact;
use meshmill::technique::layout::cut_again;

use super::golden::golden;
use crate::shapes;
use crate::step::{run, run_locked, surface};

/// A grid of `n` by `n` cells of size 1 / `n`, of which `keep` says which ones are there.
fn plate(n: usize, keep: impl Fn(f64, f64) -> bool) -> Surface {
    let whole = shapes::grid(n);
    let faces = shapes::faces(&whole);
    let cells: Vec<[usize; 3]> = faces
        .chunks(2)
        .filter(|cell| {
            let sum: glam::DVec3 = cell.iter().flatten().map(|&v| whole.points[Id::new(v)]).sum();
            keep(sum.x / 6.0, sum.y / 6.0)
        })
        .flatten()
        .copied()
        .collect();
    let mut number = vec![usize::MAX; whole.points.len()];
    let mut points = Vec::new();
    let faces: Vec<[usize; 3]> = cells
        .iter()
        .map(|cell| {
            cell.map(|v| {
                if number[v] == usize::MAX {
                    number[v] = points.len();
                    points.push(whole.points[Id::new(v)]);
                }
                number[v]
            })
        })
        .collect();
    shapes::surface(&shapes::triangles(points, &faces))
}

/// A ring of radii 1 and 2.
fn annulus(n: usize, m: usize) -> Surface {
    let at = |i: usize, j: usize| {
        let (r, a) = (2.0 - j as f64 / m as f64, std::f64::consts::TAU * i as f64 / n as f64);
        dvec3(r * libm::cos(a), r * libm::sin(a), 0.0)
    };
    let points = (0..n * (m + 1)).map(|k| at(k % n, k / n)).collect();
    let id = |i: usize, j: usize| i % n + j * n;
    let cell = |k: usize| {
        let (i, j) = (k % n, k / n);
        [[id(i, j), id(i + 1, j), id(i + 1, j + 1)], [id(i, j), id(i + 1, j + 1), id(i, j + 1)]]
    };
    shapes::surface(&shapes::triangles(points, &(0..n * m).flat_map(cell).collect::<Vec<_>>()))
}

fn quads(artifact: &Artifact) -> &Quads {
    artifact.as_quads().unwrap()
}

/// A conforming complex of the surface's Euler number, whose elements cover every face once, each a connected set.
fn check(surface: &Surface, made: &Quads) {
    let mesh = &made.mesh;
    let cuts = &made.cover.as_ref().unwrap().cuts;
    let from = &cut_again(surface, cuts).expect("the cuts belong to the surface");
    assert_eq!(cuts.is_empty(), from.faces.len() == surface.faces.len());
    let edges = EdgeTable::new(mesh);
    assert!(edges.iter().all(|(_, _, sides)| sides.len() <= 2), "an edge has three elements");
    let opposed = |sides: &[meshmill::mesh::topology::SideRef]| sides[0].is_forward != sides[1].is_forward;
    assert!(edges.iter().all(|(_, _, sides)| sides.len() == 1 || opposed(sides)), "elements are not oriented alike");
    assert_eq!(euler_characteristic(mesh, &edges), euler_characteristic(from, &EdgeTable::new(from)));
    assert_eq!(components(mesh).count, components(from).count);
    let cover = made.cover.as_ref().unwrap();
    assert_eq!(cover.surface, surface.shape_hash());
    let mut covered: Vec<_> = cover.faces.iter().flatten().copied().collect();
    covered.sort_unstable();
    assert_eq!(covered, from.faces.ids().collect::<Vec<_>>(), "each face is covered once");
    for (element, faces) in cover.faces.enumerate() {
        let part: Vec<_> = faces.iter().map(|&f| Facet::Tri(from.faces[f])).collect();
        let part = Soup { points: from.points.clone(), faces: part.into(), ..Soup::default() };
        assert_eq!(euler_characteristic(&part, &EdgeTable::new(&part)), 1, "element {element} is no disk");
        for corner in mesh.faces[element].corners() {
            let at = mesh.points[*corner];
            let has = faces.iter().flat_map(|&f| from.corners(f)).any(|p| p == at);
            assert!(has, "a corner of element {element} is not on what it covers");
        }
    }
}

fn share(stats: &serde_json::Value, name: &str) -> f64 {
    stats[name].as_f64().unwrap()
}

#[test]
fn a_grid_and_an_annulus_are_all_quads_and_nearly_regular() {
    for (from, interval) in [(plate(48, |_, _| true), 0.2), (annulus(120, 24), 0.34)] {
        let made = run("rough-quads", &format!("interval = {interval}"), &surface(from.clone()));
        check(&from, quads(&made.artifact));
        assert_eq!(made.stats["triangles"], 0);
        assert!(share(&made.stats, "irregular-share") <= 0.08, "{}", made.stats);
    }
}

#[test]
fn rows_run_through_an_annulus_from_rim_to_rim() {
    let from = annulus(120, 24);
    for optimize in [false, true] {
        let made = run("rough-quads", &format!("interval = 0.34, optimize = {optimize}"), &surface(from.clone()));
        check(&from, quads(&made.artifact));
        assert_eq!(made.stats["triangles"], 0);
        assert_eq!(share(&made.stats, "irregular-share"), 0.0, "{}", made.stats);
    }
}

#[test]
fn every_mode_gives_a_complex_on_plates_with_corners_and_holes() {
    let hole = |x: f64, y: f64, at: f64| (x - at).abs() < 0.125 && (y - 0.5).abs() < 0.125;
    let plates = [plate(48, |x, y| x < 0.5 || y < 0.5), plate(48, |x, y| !hole(x, y, 0.25) && !hole(x, y, 0.75))];
    for from in plates {
        for optimize in [false, true] {
            let made = run("rough-quads", &format!("interval = 0.17, optimize = {optimize}"), &surface(from.clone()));
            check(&from, quads(&made.artifact));
            if optimize {
                assert!(share(&made.stats, "triangle-share") <= 0.05, "{}", made.stats);
            }
        }
    }
}

#[test]
fn a_mesh_too_coarse_for_its_elements_is_cut_where_it_has_to_be() {
    // Regions a few triangles wide, whose borders leave corners without an edge inside.
    let mut cut = 0;
    for (level, optimize) in [(2, false), (2, true), (3, false), (3, true)] {
        let ball = surface(shapes::surface(&shapes::sphere(level)));
        let parts = run("partition", "regions = 6", &ball).artifact;
        let made = run("rough-quads", &format!("interval = 0.3, optimize = {optimize}"), &parts);
        let from = parts.as_surface().unwrap();
        check(from, quads(&made.artifact));
        cut += made.stats["cut-faces"].as_u64().unwrap();
        // What was cut is cut again for the patches, or the quads would not fit their surface.
        let count = made.stats["quads"].as_u64().unwrap() + made.stats["triangles"].as_u64().unwrap();
        let given = [("from", made.artifact), ("surface", parts)];
        let fitted = run_locked("fit-patches", "main", "", "", &given).unwrap();
        assert_eq!(fitted.stats["patches"].as_u64(), Some(count), "{}", fitted.stats);
    }
    assert!(cut > 0);
}

#[test]
fn a_half_sphere_is_capped_with_few_irregular_nodes() {
    let ball = shapes::sphere(5);
    let upper = |f: &[usize; 3]| f.iter().all(|&v| ball.points[Id::new(v)].z >= 0.0);
    let faces: Vec<[usize; 3]> = shapes::faces(&ball).into_iter().filter(upper).collect();
    let mut number = vec![usize::MAX; ball.points.len()];
    let mut points = Vec::new();
    let faces: Vec<[usize; 3]> = faces
        .into_iter()
        .map(|f| {
            f.map(|v| {
                if number[v] == usize::MAX {
                    number[v] = points.len();
                    points.push(ball.points[Id::new(v)]);
                }
                number[v]
            })
        })
        .collect();
    let from = shapes::surface(&shapes::triangles(points, &faces));
    let made = golden("rough-quads", "half sphere", "interval = 0.3", &surface(from.clone()));
    check(&from, quads(&made.artifact));
    assert!(share(&made.stats, "triangle-share") <= 0.03, "{}", made.stats);
}

#[test]
fn no_element_stands_for_a_limb() {
    /// Of the area that its corners span; the belts alone make elements of up to half of this.
    const MOST: f64 = 15.0;
    let mut horn = plate(48, |_, _| true);
    for v in horn.points.ids() {
        let p = &mut horn.points[v];
        let r = (p.x - 0.5).powi(2) + (p.y - 0.5).powi(2);
        p.z = 1.2 * libm::exp(-r / 0.01);
    }
    let produced = run("rough-quads", "interval = 0.15", &surface(horn.clone()));
    let made = quads(&produced.artifact);
    check(&horn, made);
    let cover = made.cover.as_ref().unwrap();
    let from = cut_again(&horn, &cover.cuts).unwrap();
    let area = |[a, b, c]: [glam::DVec3; 3]| (b - a).cross(c - a).length() / 2.0;
    for (element, faces) in cover.faces.enumerate() {
        let held: f64 = faces.iter().map(|&f| area(from.corners(f))).sum();
        let corners: Vec<_> = made.mesh.faces[element].corners().iter().map(|&v| made.mesh.points[v]).collect();
        let middle = corners.iter().sum::<glam::DVec3>() / corners.len() as f64;
        let spanned: f64 =
            (0..corners.len()).map(|k| area([middle, corners[k], corners[(k + 1) % corners.len()]])).sum();
        assert!(held <= 9.0 * 0.15 * 0.15, "element {element} holds {held} of a mesh at intervals of 0.15");
        assert!(held <= MOST * spanned, "element {element} holds {:.1} times what it spans", held / spanned);
    }
}

#[test]
fn elements_follow_a_spiral() {
    /// Edges along the spiral, and how many of them lie on a turn.
    const STEPS: [usize; 2] = [360, 120];
    const ACROSS: usize = 5;
    let at = |k: usize| {
        let (i, j) = (k / (ACROSS + 1), k % (ACROSS + 1));
        let turns = i as f64 / STEPS[1] as f64;
        let (r, a) = (0.4 + 0.2 * turns + 0.1 * j as f64 / ACROSS as f64, std::f64::consts::TAU * turns);
        dvec3(r * libm::cos(a), r * libm::sin(a), 0.0)
    };
    let points = (0..(STEPS[0] + 1) * (ACROSS + 1)).map(at).collect();
    let cell = |k: usize| {
        let a = k / ACROSS * (ACROSS + 1) + k % ACROSS;
        let b = a + ACROSS + 1;
        [[a, b + 1, b], [a, a + 1, b + 1]]
    };
    let from = shapes::surface(&shapes::triangles(points, &(0..STEPS[0] * ACROSS).flat_map(cell).collect::<Vec<_>>()));
    for optimize in [false, true] {
        let produced = run("rough-quads", &format!("interval = 0.2, optimize = {optimize}"), &surface(from.clone()));
        let made = quads(&produced.artifact);
        check(&from, made);
        for (element, facet) in made.mesh.faces.enumerate() {
            let corners: Vec<_> = facet.corners().iter().map(|&v| made.mesh.points[v]).collect();
            for (k, a) in corners.iter().enumerate() {
                let side = a.distance(corners[(k + 1) % corners.len()]);
                assert!(side < 0.6, "a side of element {element} is {side} long at intervals of 0.2");
            }
        }
    }
}

#[test]
fn regions_of_a_closed_surface_conform() {
    let mut from = shapes::surface(&shapes::subdivided(&shapes::cube(), 5));
    let side = |f: meshmill::mesh::FaceId| {
        let n = (from.corners(f)[1] - from.corners(f)[0]).cross(from.corners(f)[2] - from.corners(f)[0]);
        let axis = if n.x.abs() > n.y.abs().max(n.z.abs()) {
            0
        } else if n.y.abs() > n.z.abs() {
            1
        } else {
            2
        };
        2 * axis + u32::from(n[axis as usize] > 0.0)
    };
    let labels = from.faces.ids().map(side).collect();
    let names = (0..6).map(|k| format!("side-{k}")).collect();
    from.carried.regions = Some(Regions { labels, names });
    let made = run("rough-quads", "interval = 0.25", &surface(from.clone()));
    check(&from, quads(&made.artifact));
    let regions = quads(&made.artifact).mesh.carried.regions.as_ref().unwrap();
    assert_eq!((regions.names.len(), made.stats["domains"].as_u64()), (6, Some(6)));
    assert_eq!(made.stats["triangles"], 0);
}

#[test]
fn what_cannot_be_cut_is_refused_with_its_place() {
    let ball = surface(shapes::surface(&shapes::sphere(3)));
    let failure = run_locked("rough-quads", "main", "interval = 0.3", "", &[("from", ball)]).unwrap_err();
    assert!(failure.message.contains("no border"), "{failure}");
    assert!(failure.elements[0].at.is_some());
    let sheet = surface(plate(8, |_, _| true));
    let failure = run_locked("rough-quads", "main", "interval = 0", "", &[("from", sheet)]).unwrap_err();
    assert!(failure.message.contains("interval"), "{failure}");
}
