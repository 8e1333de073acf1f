//! Every step on generated shapes: golden statistics and metrics, the invariants of its head comment, its example;
//! random damage to what steps give, and whole recipes on random meshes.

#![expect(clippy::print_stderr, reason = "a skipped test says so")]

#[path = "common/corpus.rs"]
mod corpus;
#[path = "common/levels.rs"]
mod levels;
#[path = "common/shapes.rs"]
mod shapes;
#[path = "common/snapshot.rs"]
mod snapshot;
#[path = "common/step.rs"]
mod step;

mod steps {
    mod adapt_curvature;
    mod adapt_density;
    mod adapt_region;
    mod control_properties;
    mod example;
    mod features;
    mod fit_patches;
    mod fuzz;
    mod gates;
    mod golden;
    mod improve_quality;
    mod measure;
    mod partition;
    mod promises;
    mod q_morph;
    mod q_morph_shapes;
    mod read;
    mod refine;
    mod remesh;
    mod remove_features;
    mod repair;
    mod resolution;
    mod rough_quads;
    mod select;
    mod simplify_fit;
    mod split;
    mod straighten;
    mod subdivide;
}
