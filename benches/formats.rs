//! Reading and writing, one thread: a wavy sheet of a million triangles as binary STL, and a smaller one in each
//! format.

use std::hint::black_box;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use glam::DVec3;
use meshmill::format::{Format, WriteOptions, read, write};
use meshmill::mesh::{Facet, Soup, VertexId};
use meshmill::watch::Watch;

/// `2 n²` triangles.
fn sheet(n: usize) -> Soup {
    let height = |i: usize, j: usize| libm::sin(0.05 * i as f64) * libm::cos(0.03 * j as f64);
    let mut soup = Soup::default();
    for i in 0..=n {
        for j in 0..=n {
            soup.points.push(DVec3::new(0.1 * i as f64, 0.1 * j as f64, height(i, j)));
        }
    }
    let at = |i: usize, j: usize| VertexId::new(i * (n + 1) + j);
    for i in 0..n {
        for j in 0..n {
            soup.faces.push(Facet::Tri([at(i, j), at(i + 1, j), at(i + 1, j + 1)]));
            soup.faces.push(Facet::Tri([at(i, j), at(i + 1, j + 1), at(i, j + 1)]));
        }
    }
    soup
}

fn million_triangles(criterion: &mut Criterion) {
    let options = WriteOptions { binary: true, ..WriteOptions::default() };
    let bytes = write(Format::Stl, &sheet(708), &options).expect("a finite sheet");
    let mut group = criterion.benchmark_group("million-triangles");
    group.sample_size(10).throughput(Throughput::Bytes(bytes.len() as u64));
    group.bench_function("read-and-weld-binary-stl", |bencher| {
        bencher.iter(|| read(Format::Stl, black_box(&bytes), &Watch::silent()));
    });
    group.finish();
}

fn each_format(criterion: &mut Criterion) {
    let soup = sheet(160);
    let mut group = criterion.benchmark_group("50k-triangles");
    group.sample_size(10);
    for &format in Format::ALL {
        for binary in [false, true] {
            let options = WriteOptions { binary, ..WriteOptions::default() };
            let bytes = write(format, &soup, &options).expect("a finite sheet");
            let kind = format!("{}-{}", format.name(), if binary { "binary" } else { "text" });
            group.throughput(Throughput::Bytes(bytes.len() as u64));
            group.bench_function(BenchmarkId::new("read", &kind), |bencher| {
                bencher.iter(|| read(format, black_box(&bytes), &Watch::silent()));
            });
            group.bench_function(BenchmarkId::new("write", &kind), |bencher| {
                bencher.iter(|| write(format, black_box(&soup), &options));
            });
        }
    }
    group.finish();
}

criterion_group!(benches, million_triangles, each_format);
criterion_main!(benches);
