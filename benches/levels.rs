//! Fronts out of hierarchies of 120 000 and of a million faces, in process after decoding: by count, by curvature and
//! by density. Each should take less than a tenth of a second, and less than a second.

mod shapes;

use criterion::{Criterion, criterion_group, criterion_main};
use meshmill::mesh::{Hierarchy, LockRules, Surface};
use meshmill::metric::ToleranceMode;
use meshmill::step::Length;
use meshmill::steps::control_properties::{ControlPropertiesInput, ControlPropertiesParams, record_properties};
use meshmill::technique::hierarchy::{Density, Front, curvature_thresholds, extract};
use meshmill::watch::Watch;

fn levels(criterion: &mut Criterion) {
    fronts(criterion, "fronts-of-120k", 173);
    fronts(criterion, "fronts-of-1m", 500);
}

/// Fronts of a torus of four faces times `side` squared, the largest of a quarter of them.
fn fronts(criterion: &mut Criterion, name: &str, side: u32) {
    let surface = shapes::torus(side);
    let quarter = surface.faces.len() / 4;
    let hierarchy = recorded(&surface);
    let thresholds = curvature_thresholds(&hierarchy, 0.5, 0.95, 1.0);

    let mut group = criterion.benchmark_group(name);
    group.sample_size(10);
    group.bench_function("by-count", |b| b.iter(|| extract(&Front::with_faces(&hierarchy, quarter))));
    group.bench_function("by-curvature", |b| {
        b.iter(|| {
            let mut front = Front::coarsest(&hierarchy);
            front.refine_to(&thresholds, &Watch::silent()).expect("nobody cancels");
            extract(&front)
        });
    });
    group.bench_function("by-density", |b| {
        b.iter(|| {
            let mut front = Front::with_faces(&hierarchy, 2 * quarter);
            Density::of(&front).move_to(&mut front, quarter, &Watch::silent()).expect("nobody cancels");
            extract(&front)
        });
    });
    group.finish();
}

/// The record of pure collapse.
fn recorded(surface: &Surface) -> Hierarchy {
    let params = ControlPropertiesParams {
        tolerance: Length::Percent(2.0),
        tolerance_mode: ToleranceMode::QuadricRms,
        min_stretch: 0.3,
        max_valence: 9,
        optimize: Some(false),
        ..ControlPropertiesParams::default()
    };
    let input = ControlPropertiesInput { surface, reference: surface, locks: LockRules::default() };
    record_properties(input, &params, &Watch::silent()).expect("a closed torus").0
}

criterion_group!(benches, levels);
criterion_main!(benches);
