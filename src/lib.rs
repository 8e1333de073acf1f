//! meshmill: recipes that turn any triangle mesh into a finite-element surface mesh, run as a cached graph.

pub mod cli;
pub mod format;
pub mod mesh;
pub mod metric;
pub mod plan;
pub mod recipe;
pub mod report;
pub mod run;
pub mod schema;
pub mod step;
pub mod steps;
pub mod store;
pub mod technique;
pub mod terminal;
pub mod watch;
