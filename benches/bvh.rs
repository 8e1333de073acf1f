//! The tree of faces on one thread: building, nearest points from near and far, and anything near enough.

mod shapes;

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use glam::DVec3;
use meshmill::mesh::VertexId;
use meshmill::mesh::bvh::TriangleBvh;

fn bvh(criterion: &mut Criterion) {
    let surface = shapes::torus(250);
    let tree = TriangleBvh::of_surface(&surface);
    // Corners moved off the surface: all over it, and in no order that a cache would like.
    let queries: Vec<DVec3> =
        (0..10_000).map(|i| surface.points[VertexId::new(i * 7919 % surface.points.len())]).collect();
    let near: Vec<DVec3> = queries.iter().map(|&p| 1.001 * p).collect();
    let far: Vec<DVec3> = queries.iter().map(|&p| 1.5 * p).collect();
    let edge = 0.02_f64;

    let mut group = criterion.benchmark_group("bvh-250k");
    group.sample_size(10).throughput(Throughput::Elements(surface.faces.len() as u64));
    group.bench_function("build", |b| b.iter(|| TriangleBvh::of_surface(black_box(&surface))));
    group.throughput(Throughput::Elements(queries.len() as u64));
    for (name, points) in [("closest-near", &near), ("closest-far", &far)] {
        group.bench_function(name, |b| b.iter(|| points.iter().filter_map(|&p| tree.closest(p)).count()));
    }
    group.bench_function("closest-within", |b| {
        b.iter(|| near.iter().filter_map(|&p| tree.closest_within(p, edge * edge)).count());
    });
    group.bench_function("near-enough", |b| {
        b.iter(|| near.iter().filter_map(|&p| tree.near(p, edge * edge, 0.25 * edge * edge)).count());
    });
    group.finish();
}

criterion_group!(benches, bvh);
criterion_main!(benches);
