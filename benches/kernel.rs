//! The kernel on one thread: repair, validation and the tree of faces, on a torus of a hundred thousand triangles.

use std::f64::consts::TAU;
use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use glam::DVec3;
use meshmill::mesh::bvh::TriangleBvh;
use meshmill::mesh::validate::validate_surface;
use meshmill::mesh::{FaceId, Facet, Soup, VertexId};
use meshmill::steps::repair::{RepairParams, repair};
use meshmill::watch::Watch;

/// Corners round the tube; there are twice as many round the axis.
const ROUND: usize = 160;

/// A closed torus of `4 n²` triangles, each with vertices of its own, as from an STL file that nobody welded.
fn loose_torus(n: usize) -> Soup {
    let place = |i: usize, j: usize| {
        let (along, around) = (TAU * (i % (2 * n)) as f64 / (2 * n) as f64, TAU * (j % n) as f64 / n as f64);
        let radius = 3.0 + libm::cos(around);
        DVec3::new(radius * libm::cos(along), radius * libm::sin(along), libm::sin(around))
    };
    let mut soup = Soup::default();
    for (i, j) in (0..2 * n).flat_map(|i| (0..n).map(move |j| (i, j))) {
        let [a, b, c, d] = [place(i, j), place(i + 1, j), place(i + 1, j + 1), place(i, j + 1)];
        for corners in [[a, b, c], [a, c, d]] {
            let triangle: [VertexId; 3] = corners.map(|p| soup.points.push(p));
            soup.faces.push(Facet::Tri(triangle));
        }
    }
    soup
}

fn kernel(criterion: &mut Criterion) {
    let soup = loose_torus(ROUND);
    let watch = Watch::silent();
    let params = RepairParams::default();
    let (surface, _) = repair(&soup, &params, &watch).expect("a torus is closed");
    let corners: Vec<[DVec3; 3]> = (0..surface.faces.len()).map(|f| surface.corners(FaceId::new(f))).collect();
    let tree = TriangleBvh::new(corners.clone());

    let mut group = criterion.benchmark_group("torus");
    group.sample_size(10).throughput(Throughput::Elements(surface.faces.len() as u64));
    group.bench_function("repair", |bencher| bencher.iter(|| repair(black_box(&soup), &params, &watch)));
    group.bench_function("validate", |bencher| bencher.iter(|| validate_surface(black_box(&surface))));
    group.bench_function("tree-build", |bencher| bencher.iter(|| TriangleBvh::new(black_box(&corners).clone())));
    group.bench_function("tree-closest-points", |bencher| {
        let closest = |corners: &[DVec3; 3]| tree.closest(1.01 * corners[0]);
        bencher.iter(|| corners.iter().filter_map(closest).count());
    });
    group.finish();
}

criterion_group!(benches, kernel);
criterion_main!(benches);
