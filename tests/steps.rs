//! Every step on generated shapes: golden statistics and metrics, the invariants of its head comment, its example.

#[path = "common/shapes.rs"]
mod shapes;
#[path = "common/snapshot.rs"]
mod snapshot;
#[path = "common/step.rs"]
mod step;

mod steps {
    mod control_properties;
    mod example;
    mod features;
    mod golden;
    mod improve_quality;
    mod measure;
    mod read;
    mod refine;
    mod repair;
    mod select;
    mod subdivide;
}
