//! The parameters: where, and how fine.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::step::{Length, Resolution};

/// A ball.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
#[schemars(example = Self { centre: [10.0, 0.0, 0.0], radius: Length::Percent(5.0) })]
pub struct Ball {
    /// The centre, in mesh units.
    pub centre: [f64; 3],
    /// The radius; percents refer to the diagonal.
    pub radius: Length,
}

/// A box along the axes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
#[schemars(example = Self { min: [0.0; 3], max: [20.0, 20.0, 5.0] })]
pub struct BoxRegion {
    /// The corner with the smallest coordinates, in mesh units.
    pub min: [f64; 3],
    /// The corner with the largest coordinates, in mesh units.
    pub max: [f64; 3],
}

/// The side of a plane that its normal points to.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
#[schemars(example = Self { point: [0.0; 3], normal: [0.0, 0.0, 1.0] })]
pub struct HalfSpace {
    /// A point of the plane, in mesh units.
    pub point: [f64; 3],
    /// Its normal, of any length above 0.
    pub normal: [f64; 3],
}

/// A region as a recipe names it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum RegionName {
    /// By its number.
    Number(u32),
    /// By its name, or its number as text.
    Name(String),
}

/// Takes a mesh from a hierarchy that is fine in a region, or where a field asks for it, and coarse elsewhere.
///
/// The region is everything that is named, together. Give either `size` or `ratio`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default, rename_all = "kebab-case")]
pub struct AdaptRegionParams {
    /// The mesh to refine from: a number of faces or a percent of the finest mesh's. Default: the coarsest one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub base: Option<Resolution>,
    /// Longest side of the faces at vertices of the region; percents refer to the diagonal. It is kept but for sides of
    /// the finest mesh itself.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub size: Option<Length>,
    /// The same relative to the elements of `base` at each place: 0.5 asks for half their size. Above 0, at most 1.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub ratio: Option<f64>,
    /// Balls.
    pub spheres: Vec<Ball>,
    /// Boxes along the axes.
    pub boxes: Vec<BoxRegion>,
    /// Sides of planes.
    pub half_spaces: Vec<HalfSpace>,
    /// Face groups.
    pub groups: Vec<String>,
    /// Regions, by name or by number.
    pub regions: Vec<RegionName>,
    /// Points, in mesh units: the vertex of the finest mesh closest to each.
    pub points: Vec<[f64; 3]>,
    /// Faces of the finest mesh by number, from 0: `resolution` with `share = "100%"` writes that mesh.
    pub elements: Vec<u32>,
    /// The field of the input `values` that sizes are made of.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub field: Option<String>,
    /// Pairs of a value of the field and the size of elements there, `[[100, "4%"], [200, "1%"]]`, by rising value.
    /// Between two pairs sizes are interpolated; below the first one any size will do, above the last one its size
    /// holds.
    pub field_sizes: Vec<(f64, Length)>,
    /// Betters the mesh by flips and relaxation, each certified: stretch, size and valence stay within what the mesh
    /// has without it, and so does the distance from the finest mesh, which is itself off the reference of its
    /// simplification. Its faces then are no longer those that were recorded. Default false.
    pub polish: bool,
}
