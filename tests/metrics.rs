//! Shape metrics do not depend on scale, place or the order of corners.

use glam::{DVec3, dvec3};
use meshmill::mesh::{Facet, Soup, VertexId};
use meshmill::metric::measure;
use meshmill::watch::Watch;

fn tetrahedron(order: [u32; 3], map: impl Fn(DVec3) -> DVec3) -> Soup {
    let corners = [DVec3::ZERO, DVec3::X, dvec3(0.3, 1.1, 0.0), dvec3(0.2, 0.4, 0.9)];
    let faces = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]];
    let turned = |f: [u32; 3]| Facet::Tri(order.map(|i| VertexId::from_raw(f[i as usize])));
    Soup {
        points: corners.into_iter().map(map).collect(),
        faces: faces.into_iter().map(turned).collect(),
        ..Soup::default()
    }
}

fn shape(mesh: &Soup) -> Vec<f64> {
    let table = measure(mesh, None, &Watch::silent()).expect("not cancelled");
    let names = ["min-stretch", "mean-stretch", "max-aspect-ratio", "min-angle", "max-angle", "euler-characteristic"];
    names.iter().map(|name| table.get(name).expect("defined").as_f64()).collect()
}

#[test]
fn shape_is_invariant() {
    let plain = shape(&tetrahedron([0, 1, 2], |p| p));
    let far = dvec3(1e3, -2e3, 5e2);
    for other in [
        tetrahedron([0, 1, 2], |p| 1e6 * p),
        tetrahedron([0, 1, 2], |p| 1e-6 * p),
        tetrahedron([0, 1, 2], |p| p + far),
        tetrahedron([0, 1, 2], |p| dvec3(p.y, p.z, p.x)),
        tetrahedron([0, 2, 1], |p| dvec3(-p.x, p.y, p.z)),
        tetrahedron([1, 2, 0], |p| p),
    ] {
        for (a, b) in plain.iter().zip(shape(&other)) {
            assert!((a - b).abs() < 1e-9 * a.abs().max(1.0), "{a} is not {b}");
        }
    }
}

/// A prism along y over an outline of triangles in x and z, ends from `low` to `high`, all looking outward.
fn prism(outline: &[[f64; 2]], caps: &[[usize; 3]], [low, high]: [f64; 2]) -> Soup {
    let n = outline.len();
    let at = |y: f64| outline.iter().map(move |&[x, z]| dvec3(x, y, z));
    let mut faces: Vec<[usize; 3]> = Vec::new();
    for i in 0..n {
        let j = (i + 1) % n;
        faces.extend([[i, j, n + j], [i, n + j, n + i]]);
    }
    // The outline runs anticlockwise as seen from above with x to the right and z up, so against y.
    faces.extend(caps.iter().map(|&[a, b, c]| [a, c, b]));
    faces.extend(caps.iter().map(|&[a, b, c]| [n + a, n + b, n + c]));
    let turned = |[a, b, c]: [usize; 3]| Facet::Tri([a, c, b].map(VertexId::new));
    Soup {
        points: at(low).chain(at(high)).collect(),
        faces: faces.into_iter().map(turned).collect(),
        ..Soup::default()
    }
}

fn block([x, y, z]: [[f64; 2]; 3]) -> Soup {
    prism(&[[x[0], z[0]], [x[1], z[0]], [x[1], z[1]], [x[0], z[1]]], &[[0, 1, 2], [0, 2, 3]], y)
}

fn together(parts: &[Soup]) -> Soup {
    let mut all = Soup::default();
    for part in parts {
        let base = all.points.len();
        part.points.iter().for_each(|&p| {
            all.points.push(p);
        });
        for facet in &part.faces {
            let mut facet = *facet;
            facet.corners_mut().iter_mut().for_each(|v| *v = VertexId::new(v.index() + base));
            all.faces.push(facet);
        }
    }
    all
}

/// Pairs that run through each other, and pairs that touch; the same however the mesh is scaled, mirrored or listed.
fn meetings(mesh: &Soup) -> [f64; 2] {
    let count = |mesh: &Soup| {
        let table = measure(mesh, None, &Watch::silent()).expect("not cancelled");
        ["self-intersections", "contacts"].map(|name| table.get(name).expect("defined").as_f64())
    };
    let found = count(mesh);
    let mut mirrored = mesh.clone();
    mirrored.points.iter_mut().for_each(|p| *p *= dvec3(-64.0, 64.0, 64.0));
    mirrored.faces.iter_mut().for_each(|facet| facet.corners_mut().swap(1, 2));
    assert_eq!(count(&mirrored), found);
    let mut listed = mesh.clone();
    listed.faces = mesh.faces.iter().rev().copied().collect();
    listed.faces.iter_mut().for_each(|facet| facet.corners_mut().rotate_left(1));
    assert_eq!(count(&listed), found);
    found
}

#[test]
fn bodies_that_touch_have_contacts_and_no_crossings() {
    let first = block([[0.0, 1.0]; 3]);
    let beside = [
        // By a face, by a part of one, by one that is larger, flush below.
        [[1.0, 2.0], [0.0, 1.0], [0.0, 1.0]],
        [[1.0, 2.0], [0.25, 0.75], [0.5, 1.5]],
        [[1.0, 2.0], [-1.0, 2.0], [-1.0, 2.0]],
        [[1.0, 2.0], [0.0, 1.0], [0.0, 2.0]],
        // By a part of an edge, by a corner, by an edge on a face.
        [[1.0, 2.0], [1.0, 2.0], [0.5, 1.5]],
        [[1.0, 2.0], [1.0, 2.0], [1.0, 2.0]],
    ];
    for bounds in beside {
        let [crossings, contacts] = meetings(&together(&[first.clone(), block(bounds)]));
        assert!(
            crossings == 0.0 && (contacts > 0.0 || bounds == [[1.0, 2.0]; 3]),
            "{bounds:?}: {crossings}, {contacts}"
        );
    }
    let wedge = prism(&[[0.5, 1.0], [0.75, 2.0], [0.25, 2.0]], &[[0, 1, 2]], [0.25, 0.75]);
    let [crossings, contacts] = meetings(&together(&[first.clone(), wedge]));
    assert!(crossings == 0.0 && contacts > 0.0);
    // Copies: their faces have the same corners.
    assert_eq!(meetings(&together(&[first.clone(), first])), [0.0, 12.0]);
}

#[test]
fn bodies_that_overlap_have_crossings_though_no_face_passes_through_another_one() {
    let plate = || block([[0.0, 4.0], [0.0, 4.0], [0.0, 1.0]]);
    // Sunk by half, with edges along the plate's top: within it, and beyond its rim.
    for y in [[1.0, 2.0], [-1.0, 2.0]] {
        let square = prism(&[[1.0, 1.0], [1.5, 0.5], [2.0, 1.0], [1.5, 1.5]], &[[0, 1, 2], [0, 2, 3]], y);
        assert!(meetings(&together(&[plate(), square]))[0] > 0.0);
    }
    // Standing on the plate and diving beside where it stands.
    let outline = [[1.0, 1.0], [2.0, 1.0], [2.0, 0.5], [3.0, 0.5], [3.0, 1.0], [3.0, 2.0], [1.0, 2.0]];
    let caps = [[1, 2, 3], [1, 3, 4], [0, 1, 4], [0, 4, 5], [0, 5, 6]];
    assert!(meetings(&together(&[plate(), prism(&outline, &caps, [1.0, 2.0])]))[0] > 0.0);
    // Flush on all sides but two.
    let [left, right] = [[0.0, 2.0], [1.0, 3.0]].map(|x| block([x, [0.0, 1.0], [0.0, 1.0]]));
    assert!(meetings(&together(&[left, right]))[0] > 0.0);
}

#[test]
fn sheets_that_end_on_others_touch_and_folds_overlap() {
    let sheet = |points: [[f64; 3]; 4]| Soup {
        points: points.into_iter().map(DVec3::from_array).collect(),
        faces: [[0, 1, 2], [0, 2, 3]].map(|f: [u32; 3]| Facet::Tri(f.map(VertexId::from_raw))).into_iter().collect(),
        ..Soup::default()
    };
    let flat = || sheet([[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [4.0, 4.0, 0.0], [0.0, 4.0, 0.0]]);
    for height in [1.0, -1.0] {
        let rib = sheet([[1.0, 1.0, 0.0], [2.0, 1.5, 0.0], [2.0, 1.5, height], [1.0, 1.0, height]]);
        let [crossings, contacts] = meetings(&together(&[flat(), rib]));
        assert!(crossings == 0.0 && contacts > 0.0);
    }
    // The second half turned over onto the first one.
    let folded = sheet([[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [4.0, 4.0, 0.0], [3.0, 1.0, 0.0]]);
    assert_eq!(meetings(&folded), [1.0, 0.0]);
}
