//! Meshes that the benches make themselves.

use std::f64::consts::TAU;

use glam::{DVec3, dvec3};
use meshmill::mesh::{Carried, Surface, VertexId};

/// A torus with a little relief, of `4 n²` triangles.
pub(crate) fn torus(n: u32) -> Surface {
    let at = |i: u32, j: u32| VertexId::from_raw((i % (2 * n)) * n + j % n);
    let place = |i: u32, j: u32| {
        let (u, v) = (TAU * f64::from(i) / f64::from(2 * n), TAU * f64::from(j) / f64::from(n));
        let radius = 3.0 + libm::cos(v) + 0.05 * libm::sin(9.0 * u) * libm::cos(4.0 * v);
        dvec3(radius * libm::cos(u), radius * libm::sin(u), libm::sin(v))
    };
    let points: Vec<DVec3> = (0..2 * n).flat_map(|i| (0..n).map(move |j| place(i, j))).collect();
    let mut faces = Vec::with_capacity(4 * (n * n) as usize);
    for (i, j) in (0..2 * n).flat_map(|i| (0..n).map(move |j| (i, j))) {
        let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
        faces.extend([[a, b, c], [a, c, d]]);
    }
    Surface { points: points.into(), faces: faces.into(), carried: Carried::default() }
}
