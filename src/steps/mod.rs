//! The catalog: every step that a recipe can use, one file and one line each.

pub mod adapt_curvature;
pub mod adapt_density;
pub mod adapt_region;
pub mod control_properties;
pub mod features;
pub mod fit_patches;
pub mod improve_quality;
pub mod measure;
pub mod partition;
pub mod q_morph;
pub mod read;
pub mod refine;
pub mod remesh;
pub mod remove_features;
pub mod repair;
pub mod resolution;
pub mod rough_quads;
pub mod select;
pub mod simplify_fit;
pub mod split;
pub mod straighten;
pub mod subdivide;

use crate::step::StepDef;

/// All steps, in the order of the workflow.
pub static CATALOG: &[StepDef] = &[
    StepDef::of::<read::Step>(),
    StepDef::of::<repair::Step>(),
    StepDef::of::<select::Step>(),
    StepDef::of::<features::Step>(),
    StepDef::of::<remove_features::Step>(),
    StepDef::of::<subdivide::Step>(),
    StepDef::of::<refine::Step>(),
    StepDef::of::<remesh::Step>(),
    StepDef::of::<improve_quality::Step>(),
    StepDef::of::<control_properties::Step>(),
    StepDef::of::<simplify_fit::Step>(),
    StepDef::of::<resolution::Step>(),
    StepDef::of::<adapt_curvature::Step>(),
    StepDef::of::<adapt_region::Step>(),
    StepDef::of::<adapt_density::Step>(),
    StepDef::of::<partition::Step>(),
    StepDef::of::<straighten::Step>(),
    StepDef::of::<split::Step>(),
    StepDef::of::<rough_quads::Step>(),
    StepDef::of::<fit_patches::Step>(),
    StepDef::of::<q_morph::Step>(),
    StepDef::of::<measure::Step>(),
];
