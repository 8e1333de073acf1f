//! What several steps share: algorithms on surfaces that are no step of their own.

pub mod arcs;
pub mod belts;
pub mod collapse;
pub mod curvature;
pub mod decimate;
pub mod defeature;
pub mod eigen;
pub mod feature;
pub mod halve_edges;
pub mod heap;
pub mod hierarchy;
pub mod layout;
pub mod levels;
pub mod patches;
pub mod quadric;
pub mod refine;
pub mod remesh;
pub mod split_curves;
pub mod surface_curve;
pub mod triangulate_loop;
pub mod vsa;
