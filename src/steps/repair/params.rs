//! What repair can be told.

use std::fmt;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::{self, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::step::{Length, Share};

/// Turns a soup of triangles and quads into an oriented surface without non-manifold edges or vertices.
///
/// Use it on everything that was read; all later steps need its result.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default, rename_all = "kebab-case")]
pub struct RepairParams {
    /// Vertices on open edges move onto a vertex within this length, and onto an open edge within it. Length;
    /// default `"0.0001%"`. Vertices at exactly the same place are always one.
    pub weld: Length,
    /// Cracks up to this width are zipped: borders that run beside each other meet in the middle, where each lies as
    /// the other one's face would go on. Nothing else is joined, so that this may be far larger than `weld`. Length;
    /// default: not done.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gaps: Option<Length>,
    /// Which holes are filled: `"none"` (default), `"all"`, or those whose rim is no longer than this length. A rim
    /// whose fill would fold back onto the surface, as the outline of a plate, stays open.
    pub fill_holes: FillHoles,
    /// Which connected components stay: `"all"` (default), `"largest"` by area, or those with at least this share of
    /// the whole area.
    pub keep_components: KeepComponents,
    /// What becomes of edges with more than two faces: `"cut"` (default) takes the sheets apart, `"seam"` also
    /// remembers that they belong together, so that later steps treat them alike and the written mesh is joined again.
    pub non_manifold: NonManifold,
    /// What becomes of faces that run through each other: `"report"` (default) counts them; `"remove"` cuts them along
    /// where they meet and drops what is inside of bodies, so that no two faces meet any more. Sheets are cut and stay.
    /// Faces that meet none keep their coordinates.
    pub self_intersections: SelfIntersections,
    /// With `"remove"`, what becomes of bodies that run through or touch each other: `"keep"` (default) leaves each one
    /// by itself, and what two have in common to the one that comes first in the file, so that they touch at most;
    /// `"union"` makes them one. Bodies inside of others that they do not touch stay.
    pub bodies: Bodies,
    /// Along how much, in all, faces of the result may run through each other; faces that lie on each other count with
    /// the area that they share over the diagonal. Where it is more, no finer mesh keeps to the same crossings: repair
    /// then fails and says where, before any other work is done. Length; default: not looked at.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub crossing_length: Option<Length>,
    /// The surface moves no further than this outside filled holes, by all corrections together. Length; default: the
    /// weld length, or `gaps` where that is larger.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_move: Option<Length>,
}

impl Default for RepairParams {
    fn default() -> Self {
        Self {
            weld: Length::Percent(1e-4),
            gaps: None,
            fill_holes: FillHoles::None,
            keep_components: KeepComponents::All,
            non_manifold: NonManifold::Cut,
            self_intersections: SelfIntersections::Report,
            bodies: Bodies::Keep,
            crossing_length: None,
            max_move: None,
        }
    }
}

impl RepairParams {
    /// Whether bodies are cut to lie beside each other.
    pub(super) fn keeps_bodies(&self) -> bool {
        self.self_intersections == SelfIntersections::Remove && self.bodies == Bodies::Keep
    }
}

/// What becomes of edges with more than two faces.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum NonManifold {
    /// The sheets come apart.
    #[default]
    Cut,
    /// The sheets come apart, and their common vertices share seam ids.
    Seam,
}

/// What becomes of faces that run through each other.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum SelfIntersections {
    /// They are counted, and the first ones are listed.
    #[default]
    Report,
    /// They are cut, and what is inside of bodies goes.
    Remove,
}

/// What becomes of bodies that run through or touch each other.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Bodies {
    /// Each stays one by itself; what they have in common is of the first.
    #[default]
    Keep,
    /// They become one.
    Union,
}

/// Which holes are filled.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum FillHoles {
    /// No hole.
    #[default]
    None,
    /// Every hole.
    All,
    /// Holes whose rim is no longer than this.
    UpTo(Length),
}

/// Which components stay.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum KeepComponents {
    /// Every component.
    #[default]
    All,
    /// The one with the largest area.
    Largest,
    /// Those with at least this share of the whole area.
    Share(Share),
}

/// Reads a word, or else what the word stands beside.
struct WordOr<T> {
    expected: &'static str,
    word: fn(&str) -> Option<T>,
    number: fn(f64) -> Result<T, String>,
    text: fn(&str) -> Result<T, String>,
}

impl<T> Visitor<'_> for WordOr<T> {
    type Value = T;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.expected)
    }
    fn visit_f64<E: de::Error>(self, value: f64) -> Result<T, E> {
        (self.number)(value).map_err(E::custom)
    }
    fn visit_i64<E: de::Error>(self, value: i64) -> Result<T, E> {
        self.visit_f64(value as f64)
    }
    fn visit_u64<E: de::Error>(self, value: u64) -> Result<T, E> {
        self.visit_f64(value as f64)
    }
    fn visit_str<E: de::Error>(self, text: &str) -> Result<T, E> {
        if let Some(value) = (self.word)(text) {
            return Ok(value);
        }
        if text.ends_with('%') {
            return (self.text)(text).map_err(E::custom);
        }
        Err(E::custom(format!("expected {}, got \"{text}\"", self.expected)))
    }
}

fn parse<'a, T: Deserialize<'a>, D: de::IntoDeserializer<'a, de::value::Error>>(value: D) -> Result<T, String> {
    T::deserialize(value.into_deserializer()).map_err(|error| error.to_string())
}

impl<'de> Deserialize<'de> for FillHoles {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(WordOr {
            expected: "\"none\", \"all\", or a length such as 12.5 or \"5%\"",
            word: |text| match text {
                "none" => Some(Self::None),
                "all" => Some(Self::All),
                _ => None,
            },
            number: |value| parse(value).map(Self::UpTo),
            text: |text| parse(text).map(Self::UpTo),
        })
    }
}

impl Serialize for FillHoles {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::None => serializer.serialize_str("none"),
            Self::All => serializer.serialize_str("all"),
            Self::UpTo(length) => length.serialize(serializer),
        }
    }
}

impl JsonSchema for FillHoles {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "FillHoles".into()
    }
    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let length = generator.subschema_for::<Length>();
        json_schema!({
            "description": "`\"none\"`, `\"all\"`, or the longest rim that is filled, as a length.",
            "anyOf": [{ "type": "string", "enum": ["none", "all"] }, length]
        })
    }
}

impl<'de> Deserialize<'de> for KeepComponents {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(WordOr {
            expected: "\"all\", \"largest\", or a share of the area such as 0.01 or \"1%\"",
            word: |text| match text {
                "all" => Some(Self::All),
                "largest" => Some(Self::Largest),
                _ => None,
            },
            number: |value| parse(value).map(Self::Share),
            text: |text| parse(text).map(Self::Share),
        })
    }
}

impl Serialize for KeepComponents {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::All => serializer.serialize_str("all"),
            Self::Largest => serializer.serialize_str("largest"),
            Self::Share(share) => share.serialize(serializer),
        }
    }
}

impl JsonSchema for KeepComponents {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "KeepComponents".into()
    }
    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let share = generator.subschema_for::<Share>();
        json_schema!({
            "description": "`\"all\"`, `\"largest\"`, or the smallest share of the whole area that a component needs.",
            "anyOf": [{ "type": "string", "enum": ["all", "largest"] }, share]
        })
    }
}
