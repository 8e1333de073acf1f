//! Fronts out of a hierarchy of 120 000 faces, in process after decoding: by count, by curvature and by density. Each
//! should take less than a tenth of a second.

mod shapes;

use criterion::{Criterion, criterion_group, criterion_main};
use meshmill::mesh::LockRules;
use meshmill::step::Length;
use meshmill::steps::control_properties::{ControlPropertiesInput, ControlPropertiesParams, record_properties};
use meshmill::technique::collapse::session::ToleranceMode;
use meshmill::technique::hierarchy::{Density, Front, curvature_thresholds, extract};
use meshmill::watch::Watch;

fn levels(criterion: &mut Criterion) {
    let surface = shapes::torus(173);
    let params = ControlPropertiesParams {
        tolerance: Length::Percent(2.0),
        tolerance_mode: ToleranceMode::QuadricRms,
        min_stretch: 0.3,
        max_valence: 9,
        optimize: Some(false),
        ..ControlPropertiesParams::default()
    };
    let input = ControlPropertiesInput { surface: &surface, reference: &surface, locks: LockRules::default() };
    let (hierarchy, _) = record_properties(input, &params, &Watch::silent()).expect("a closed torus");
    let thresholds = curvature_thresholds(&hierarchy, 0.5, 0.95, 1.0);

    let mut group = criterion.benchmark_group("fronts-of-120k");
    group.sample_size(10);
    group.bench_function("by-count", |b| b.iter(|| extract(&Front::with_faces(&hierarchy, 30_000))));
    group.bench_function("by-curvature", |b| {
        b.iter(|| {
            let mut front = Front::coarsest(&hierarchy);
            front.refine_to(&thresholds, &Watch::silent()).expect("nobody cancels");
            extract(&front)
        });
    });
    group.bench_function("by-density", |b| {
        b.iter(|| {
            let mut front = Front::with_faces(&hierarchy, 60_000);
            Density::of(&front).move_to(&mut front, 30_000, &Watch::silent()).expect("nobody cancels");
            extract(&front)
        });
    });
    group.finish();
}

criterion_group!(benches, levels);
criterion_main!(benches);
