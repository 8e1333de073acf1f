//! Generated meshes for tests: closed, open, one-sided, joined, and with defects.

use std::collections::BTreeMap;
use std::f64::consts::{PI, TAU};

use glam::{DVec3, dvec3};
use meshmill::mesh::{Facet, Id, Soup, Surface};

/// A shape and its name.
pub(crate) type Named = (&'static str, fn() -> Soup);

/// The standard shapes; all but the last three are manifold and oriented.
pub(crate) const STANDARD: &[Named] = &[
    ("tetrahedron", tetrahedron),
    ("octahedron", octahedron),
    ("cube", cube),
    ("subdivided-cube", || subdivided(&cube(), 2)),
    ("sphere", || sphere(2)),
    ("torus", || torus(16, 8)),
    ("cylinder", || cylinder(16, 4)),
    ("washer", || washer(20)),
    ("grid", || grid(6)),
    ("fan", || fan(7)),
    ("grid-with-a-hole", || hole(grid(6), 30)),
    ("cube-with-a-flipped-face", || flipped_face(cube(), 3)),
    ("moebius", || moebius(12)),
    ("t-joint", || t_joint(4)),
];

/// A mesh of triangles.
pub(crate) fn triangles(points: Vec<DVec3>, faces: &[[usize; 3]]) -> Soup {
    let faces = faces.iter().map(|face| Facet::Tri(face.map(Id::new))).collect();
    Soup { points: points.into(), faces, ..Soup::default() }
}

/// The corners of the faces, all of which are triangles.
pub(crate) fn faces(mesh: &Soup) -> Vec<[usize; 3]> {
    mesh.faces.iter().map(|face| std::array::from_fn(|corner| face.corners()[corner].index())).collect()
}

/// A manifold mesh of triangles as a surface, without repair.
pub(crate) fn surface(mesh: &Soup) -> Surface {
    let faces = faces(mesh).iter().map(|face| face.map(Id::new)).collect();
    Surface { points: mesh.points.clone(), faces, carried: mesh.carried.clone() }
}

pub(crate) fn tetrahedron() -> Soup {
    let points = vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
    triangles(points, &[[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])
}

pub(crate) fn octahedron() -> Soup {
    let points = vec![DVec3::X, DVec3::Y, DVec3::Z, -DVec3::X, -DVec3::Y, -DVec3::Z];
    let top = [[0, 1, 2], [1, 3, 2], [3, 4, 2], [4, 0, 2]];
    triangles(points, &[top, top.map(|[a, b, _]| [b, a, 5])].concat())
}

/// The unit cube, two triangles a side.
pub(crate) fn cube() -> Soup {
    let points = (0..8).map(|i| dvec3(f64::from(i & 1), f64::from(i >> 1 & 1), f64::from(i >> 2))).collect();
    let sides = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [1, 3, 7, 5], [3, 2, 6, 7], [2, 0, 4, 6]];
    triangles(points, &sides.map(|[a, b, c, d]| [[a, b, c], [a, c, d]]).concat())
}

/// Every face cut into four at its midpoints, `times` times.
pub(crate) fn subdivided(mesh: &Soup, times: usize) -> Soup {
    let mut points = mesh.points.as_slice().to_vec();
    let mut all = faces(mesh);
    for _ in 0..times {
        let mut midpoints = BTreeMap::new();
        let mut cut = Vec::new();
        for [a, b, c] in all {
            let mut middle = |i: usize, j: usize| {
                *midpoints.entry((i.min(j), i.max(j))).or_insert_with(|| {
                    points.push((points[i] + points[j]) / 2.0);
                    points.len() - 1
                })
            };
            let (x, y, z) = (middle(a, b), middle(b, c), middle(c, a));
            cut.extend([[a, x, z], [x, b, y], [z, y, c], [x, y, z]]);
        }
        all = cut;
    }
    triangles(points, &all)
}

/// The unit sphere: an octahedron subdivided `times` times and pushed out.
pub(crate) fn sphere(times: usize) -> Soup {
    let mut mesh = subdivided(&octahedron(), times);
    mesh.points.iter_mut().for_each(|point| *point = point.normalize());
    mesh
}

/// A sheet of `m` by `n` quads, each cut in two; at `wrap` its end is its beginning.
fn sheet(m: usize, n: usize, wrap: [bool; 2], at: impl Fn(f64, f64) -> DVec3) -> Soup {
    let (columns, rows) = (m + usize::from(!wrap[0]), n + usize::from(!wrap[1]));
    let share = |i: usize, n: usize| i as f64 / n as f64;
    let points = (0..columns * rows).map(|i| at(share(i % columns, m), share(i / columns, n))).collect();
    let id = |i: usize, j: usize| i % columns + j % rows * columns;
    let quads = (0..m * n).map(|q| (q % m, q / m));
    let cut = quads.flat_map(|(i, j)| {
        let [a, b, c, d] = [id(i, j), id(i + 1, j), id(i + 1, j + 1), id(i, j + 1)];
        [[a, b, c], [a, c, d]]
    });
    triangles(points, &cut.collect::<Vec<_>>())
}

/// The unit square of `n` by `n` cells.
pub(crate) fn grid(n: usize) -> Soup {
    sheet(n, n, [false; 2], |u, v| dvec3(u, v, 0.0))
}

/// A torus of radii 1 and 0.4.
pub(crate) fn torus(m: usize, n: usize) -> Soup {
    sheet(m, n, [true; 2], |u, v| {
        let radius = 1.0 + 0.4 * libm::cos(TAU * v);
        dvec3(radius * libm::cos(TAU * u), radius * libm::sin(TAU * u), 0.4 * libm::sin(TAU * v))
    })
}

/// A closed cylinder of radius 1 and height 4 with `n` sides, in `layers`.
pub(crate) fn cylinder(n: usize, layers: usize) -> Soup {
    let side = sheet(n, layers, [true, false], |u, v| dvec3(libm::cos(TAU * u), libm::sin(TAU * u), 4.0 * v));
    let (mut all, last) = (faces(&side), layers * n);
    let [bottom, top] = [side.points.len(), side.points.len() + 1];
    all.extend((0..n).flat_map(|i| [[bottom, (i + 1) % n, i], [top, last + i, last + (i + 1) % n]]));
    let mut points = side.points.into_vec();
    points.extend([DVec3::ZERO, DVec3::Z * 4.0]);
    triangles(points, &all)
}

/// A disc of radius 2 and height 1 with a hole of radius 0.3, of `n` facets each.
pub(crate) fn washer(n: usize) -> Soup {
    turned(n, [(2.0, -0.5), (2.0, 0.5), (0.3, 0.5), (0.3, -0.5)])
}

/// A profile of radii and heights, turned round in `n` facets.
pub(crate) fn turned(n: usize, profile: [(f64, f64); 4]) -> Soup {
    sheet(n, 4, [true; 2], |u, v| {
        let (radius, z) = profile[(4.0 * v) as usize % 4];
        dvec3(radius * libm::cos(TAU * u), radius * libm::sin(TAU * u), z)
    })
}

/// `n` triangles round a vertex, a half turn wide.
pub(crate) fn fan(n: usize) -> Soup {
    let rim = (0..=n).map(|i| PI * i as f64 / n as f64).map(|a| dvec3(libm::cos(a), libm::sin(a), 0.0));
    let faces: Vec<_> = (1..=n).map(|i| [0, i, i + 1]).collect();
    triangles(std::iter::once(DVec3::ZERO).chain(rim).collect(), &faces)
}

/// A Moebius strip of `n` cells: no orientation fits all its faces.
pub(crate) fn moebius(n: usize) -> Soup {
    let rib = |i: usize| {
        let turn = TAU * i as f64 / n as f64;
        let (out, up) = (0.3 * libm::cos(turn / 2.0), 0.3 * libm::sin(turn / 2.0));
        [1.0 - out, 1.0 + out].map(|r| dvec3(r * libm::cos(turn), r * libm::sin(turn), if r < 1.0 { -up } else { up }))
    };
    let id = |i: usize, side: usize| if i < n { 2 * i + side } else { 1 - side };
    let cell = |i| [[id(i, 0), id(i + 1, 0), id(i + 1, 1)], [id(i, 0), id(i + 1, 1), id(i, 1)]];
    triangles((0..n).flat_map(rib).collect(), &(0..n).flat_map(cell).collect::<Vec<_>>())
}

/// Three plates that meet along the line x = z = 0, of `n` by `n` cells each.
pub(crate) fn t_joint(n: usize) -> Soup {
    let plates = [-DVec3::X, DVec3::X, DVec3::Z];
    let joined = plates.map(|out| {
        let mut plate = grid(n);
        plate.points.iter_mut().for_each(|p| *p = out * p.x + DVec3::Y * p.y);
        plate
    });
    welded(&joined)
}

/// The meshes as one, where points at the same place are one.
fn welded(meshes: &[Soup]) -> Soup {
    let (mut points, mut all, mut known) = (Vec::new(), Vec::new(), BTreeMap::new());
    for mesh in meshes {
        let ids: Vec<usize> = (mesh.points.iter())
            .map(|point| {
                *known.entry(point.to_array().map(|x| (x + 0.0).to_bits())).or_insert_with(|| {
                    points.push(*point);
                    points.len() - 1
                })
            })
            .collect();
        all.extend(faces(mesh).iter().map(|face| face.map(|corner| ids[corner])));
    }
    triangles(points, &all)
}

/// With one face twice.
pub(crate) fn duplicate_face(mut mesh: Soup, face: usize) -> Soup {
    let twice = mesh.faces[Id::new(face)];
    mesh.faces.push(twice);
    mesh
}

/// With one face looking the wrong way.
pub(crate) fn flipped_face(mut mesh: Soup, face: usize) -> Soup {
    mesh.faces[Id::new(face)].corners_mut().reverse();
    mesh
}

/// Without one face.
pub(crate) fn hole(mesh: Soup, face: usize) -> Soup {
    let mut left = mesh.faces.into_vec();
    left.remove(face);
    Soup { faces: left.into(), ..mesh }
}
