//! What a remesher with a certified distance is made of: the certificate of a whole result, both ways, at three sizes
//! that show the growth, and beside it edits that are certified one by one.

mod shapes;

use std::hint::black_box;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use meshmill::mesh::{LockRules, Surface};
use meshmill::metric::distance::{Target, upper_bound};
use meshmill::step::Length;
use meshmill::steps::improve_quality::{ImproveQualityInput, ImproveQualityParams, improve_quality};
use meshmill::steps::remesh::{RemeshParams, remesh};
use meshmill::watch::Watch;

/// Better shaped, within the tolerance of the pipelines, with half the faces.
fn improved(surface: &Surface) -> usize {
    let params = ImproveQualityParams {
        tolerance: Length::Percent(0.2),
        target_faces: Some(surface.faces.len() / 2),
        ..ImproveQualityParams::default()
    };
    let input = ImproveQualityInput { surface, reference: surface, locks: LockRules::default() };
    improve_quality(black_box(input), &params, &Watch::silent()).expect("a closed torus").0.faces.len()
}

/// Bounds of the distance of the smaller mesh from the larger, and back.
fn certificate(mesh: &Target, reference: &Target) -> f64 {
    let bound = |from, to| upper_bound(from, to, &Watch::silent()).expect("not cancelled").expect("two meshes");
    bound(black_box(mesh), reference).max(bound(reference, mesh))
}

fn growth(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("certificate");
    group.sample_size(10);
    for n in [125, 250, 500] {
        // As many faces as a result has: a twenty-fifth.
        let [mesh, reference] = [n / 5, n].map(|n| Target::of(&shapes::torus(n).to_soup()));
        let faces = reference.triangles().len();
        group.throughput(Throughput::Elements(faces as u64));
        group.bench_with_input(BenchmarkId::from_parameter(faces), &mesh, |b, m| b.iter(|| certificate(m, &reference)));
    }
    group.finish();
}

fn edits(criterion: &mut Criterion) {
    let surface = shapes::torus(125);
    let mut group = criterion.benchmark_group("certified-edits");
    group.sample_size(10);
    group.throughput(Throughput::Elements(surface.faces.len() as u64));
    group.bench_function("62k-to-a-half", |b| b.iter(|| improved(&surface)));
    group.finish();
}

/// The whole step, at three sizes.
fn whole(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("remesh");
    group.sample_size(10);
    for n in [125, 250, 500] {
        let surface = shapes::torus(n);
        group.throughput(Throughput::Elements(surface.faces.len() as u64));
        group.bench_with_input(BenchmarkId::from_parameter(surface.faces.len()), &surface, |b, s| {
            b.iter(|| {
                let (params, locks) = (RemeshParams::default(), LockRules::default());
                remesh(black_box(s), &params, &locks, &Watch::silent()).expect("a closed torus").0.faces.len()
            });
        });
    }
    group.finish();
}

criterion_group!(benches, growth, edits, whole);
criterion_main!(benches);
