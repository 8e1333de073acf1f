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
