//! Property control on one thread: pure collapse by quadrics at three sizes, which shows the growth, and the certified
//! distance with and without optimisation beside its own quadric mode.
//!
//! With `MESHMILL_CORPUS` also the scan of a million triangles, down to 50 000.

mod corpus;
mod shapes;

use std::hint::black_box;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use meshmill::mesh::{LockRules, Surface};
use meshmill::metric::ToleranceMode;
use meshmill::step::Length;
use meshmill::steps::control_properties::{ControlPropertiesInput, ControlPropertiesParams, control_properties};
use meshmill::watch::Watch;

fn params(mode: ToleranceMode, optimize: bool, target: usize) -> ControlPropertiesParams {
    ControlPropertiesParams {
        tolerance: Length::Percent(0.5),
        tolerance_mode: mode,
        optimize: Some(optimize),
        target_faces: Some(target),
        ..ControlPropertiesParams::default()
    }
}

fn run(surface: &Surface, params: &ControlPropertiesParams) -> usize {
    let input = ControlPropertiesInput { surface, reference: surface, locks: LockRules::default() };
    let (result, _) = control_properties(black_box(input), params, &Watch::silent()).expect("a closed torus");
    result.faces.len()
}

fn growth(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("quadric-rms");
    group.sample_size(10);
    for n in [125, 250, 500] {
        let surface = shapes::torus(n);
        let faces = surface.faces.len();
        let params = params(ToleranceMode::QuadricRms, false, faces / 20);
        group.throughput(Throughput::Elements(faces as u64));
        group.bench_with_input(BenchmarkId::from_parameter(faces), &surface, |b, s| b.iter(|| run(s, &params)));
    }
    if let Some(scan) = corpus::from_corpus("cad/crankshaft_scan.stl") {
        let params = params(ToleranceMode::QuadricRms, false, 50_000);
        group.throughput(Throughput::Elements(scan.faces.len() as u64));
        group.bench_with_input("crankshaft-scan", &scan, |b, s| b.iter(|| run(s, &params)));
    }
    group.finish();
}

fn distance(criterion: &mut Criterion) {
    let surface = shapes::torus(125);
    let target = surface.faces.len() / 5;
    let mut group = criterion.benchmark_group("62k-to-a-fifth");
    group.sample_size(10);
    for (name, mode, optimize) in [
        ("quadric-rms", ToleranceMode::QuadricRms, false),
        ("distance", ToleranceMode::Distance, false),
        ("distance-optimize", ToleranceMode::Distance, true),
    ] {
        let params = params(mode, optimize, target);
        group.bench_function(name, |b| b.iter(|| run(&surface, &params)));
    }
    group.finish();
}

criterion_group!(benches, growth, distance);
criterion_main!(benches);
