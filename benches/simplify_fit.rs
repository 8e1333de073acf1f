//! Simplification with fits to a quarter of the faces, on one thread, at three sizes: the growth is `n log n`.
//!
//! With `MESHMILL_CORPUS` also the scan of a million triangles.

mod corpus;
mod shapes;

use std::hint::black_box;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use meshmill::mesh::{LockRules, Surface};
use meshmill::step::{Length, Share};
use meshmill::steps::simplify_fit::{FitTolerance, SimplifyFitInput, SimplifyFitParams, simplify_fit};
use meshmill::watch::Watch;

fn run(surface: &Surface, tolerance_mode: FitTolerance) -> usize {
    let params = SimplifyFitParams {
        remove: Some(Share(0.75)),
        tolerance: Length::Percent(0.1),
        tolerance_mode,
        ..SimplifyFitParams::default()
    };
    let input = SimplifyFitInput { surface, reference: surface, locks: LockRules::default() };
    let (result, _) = simplify_fit(black_box(input), &params, &Watch::silent()).expect("a closed surface");
    result.faces.len()
}

fn growth(criterion: &mut Criterion) {
    for (name, mode) in [("distance", FitTolerance::Distance), ("plane", FitTolerance::Plane)] {
        let mut group = criterion.benchmark_group(format!("simplify-fit-{name}"));
        group.sample_size(10);
        for n in [125, 250, 500] {
            let surface = shapes::torus(n);
            let faces = surface.faces.len();
            group.throughput(Throughput::Elements(faces as u64));
            group.bench_with_input(BenchmarkId::from_parameter(faces), &surface, |b, s| b.iter(|| run(s, mode)));
        }
        if let Some(scan) = corpus::from_corpus("cad/crankshaft_scan.stl") {
            group.throughput(Throughput::Elements(scan.faces.len() as u64));
            group.bench_with_input("crankshaft-scan", &scan, |b, s| b.iter(|| run(s, mode)));
        }
        group.finish();
    }
}

criterion_group!(benches, growth);
criterion_main!(benches);
