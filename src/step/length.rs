//! Quantities of recipes: lengths that may be percents, shares, angles, and sizes that vary over the mesh.

use std::collections::BTreeMap;
use std::fmt;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::{self, MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// A length: a number in mesh units, or a percent of the bounding-box diagonal of the step's reference.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Length {
    /// Mesh units.
    Absolute(f64),
    /// Percent of the diagonal, as written: `"2%"` is 2.
    Percent(f64),
}

impl Length {
    /// The length in mesh units, where `diagonal` is the bounding-box diagonal it refers to.
    pub fn resolve(self, diagonal: f64) -> f64 {
        match self {
            Self::Absolute(length) => length,
            Self::Percent(percent) => percent / 100.0 * diagonal,
        }
    }

    fn check<E: de::Error>(self) -> Result<Self, E> {
        let (Self::Absolute(value) | Self::Percent(value)) = self;
        if value.is_finite() && value >= 0.0 {
            Ok(self)
        } else {
            Err(E::custom(format!("a length must be finite and not negative, got `{self}`")))
        }
    }
}

impl fmt::Display for Length {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Absolute(value) => write!(f, "{value}"),
            Self::Percent(value) => write!(f, "{value}%"),
        }
    }
}

fn parse_percent<E: de::Error>(text: &str, what: &str) -> Result<f64, E> {
    text.strip_suffix('%')
        .and_then(|number| number.trim().parse::<f64>().ok())
        .ok_or_else(|| E::custom(format!("expected {what}: a number, or a percent such as \"2%\", got \"{text}\"")))
}

struct LengthVisitor;

impl Visitor<'_> for LengthVisitor {
    type Value = Length;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a length: a number in mesh units, or a percent such as \"2%\"")
    }
    fn visit_f64<E: de::Error>(self, value: f64) -> Result<Length, E> {
        Length::Absolute(value).check()
    }
    fn visit_i64<E: de::Error>(self, value: i64) -> Result<Length, E> {
        self.visit_f64(value as f64)
    }
    fn visit_u64<E: de::Error>(self, value: u64) -> Result<Length, E> {
        self.visit_f64(value as f64)
    }
    fn visit_str<E: de::Error>(self, text: &str) -> Result<Length, E> {
        Length::Percent(parse_percent(text, "a length")?).check()
    }
}

impl<'de> Deserialize<'de> for Length {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(LengthVisitor)
    }
}

impl Serialize for Length {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Absolute(value) => serializer.serialize_f64(*value),
            Self::Percent(value) => serializer.collect_str(&format_args!("{value}%")),
        }
    }
}

impl JsonSchema for Length {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "Length".into()
    }
    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "description": "A length: a number in mesh units, or a percent of the bounding-box diagonal such as \"2%\".",
            "anyOf": [
                { "type": "number", "minimum": 0 },
                { "type": "string", "pattern": "^\\s*[0-9.eE+-]+\\s*%$" }
            ]
        })
    }
}

/// A share of something: 0 to 1, or a percent such as `"75%"`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(transparent)]
pub struct Share(pub f64);

struct ShareVisitor;

impl Visitor<'_> for ShareVisitor {
    type Value = Share;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a share: a number from 0 to 1, or a percent such as \"75%\"")
    }
    fn visit_f64<E: de::Error>(self, value: f64) -> Result<Share, E> {
        if (0.0..=1.0).contains(&value) {
            Ok(Share(value))
        } else {
            Err(E::custom(format!("a share lies between 0 and 1 (or \"0%\" and \"100%\"), got {value}")))
        }
    }
    fn visit_i64<E: de::Error>(self, value: i64) -> Result<Share, E> {
        self.visit_f64(value as f64)
    }
    fn visit_u64<E: de::Error>(self, value: u64) -> Result<Share, E> {
        self.visit_f64(value as f64)
    }
    fn visit_str<E: de::Error>(self, text: &str) -> Result<Share, E> {
        self.visit_f64(parse_percent(text, "a share")? / 100.0)
    }
}

impl<'de> Deserialize<'de> for Share {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(ShareVisitor)
    }
}

impl JsonSchema for Share {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "Share".into()
    }
    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "description": "A share: a number from 0 to 1, or a percent such as \"75%\".",
            "anyOf": [
                { "type": "number", "minimum": 0, "maximum": 1 },
                { "type": "string", "pattern": "^\\s*[0-9.eE+-]+\\s*%$" }
            ]
        })
    }
}

/// An angle in degrees, from 0 to 180.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd, Serialize, JsonSchema)]
#[serde(transparent)]
pub struct Angle(#[schemars(range(min = 0.0, max = 180.0))] pub f64);

impl Angle {
    /// The angle in radians.
    pub fn radians(self) -> f64 {
        self.0.to_radians()
    }
}

impl<'de> Deserialize<'de> for Angle {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let degrees = f64::deserialize(deserializer)?;
        if (0.0..=180.0).contains(&degrees) {
            Ok(Self(degrees))
        } else {
            Err(de::Error::custom(format!("an angle lies between 0 and 180 degrees, got {degrees}")))
        }
    }
}

/// A size or tolerance that may vary over the mesh.
///
/// In a recipe: a length; `{ field = "name" }`, values in mesh units on vertices or faces; or a table per group,
/// `{ default = "2%", groups = { rim = 0.5 } }`. Where groups overlap, the smallest length holds.
#[derive(Clone, Debug, PartialEq)]
pub enum Sizing {
    /// The same everywhere.
    Uniform(Length),
    /// The values of a field.
    Field(String),
    /// By face group; `default` elsewhere.
    Groups {
        /// Where no group of the table applies.
        default: Length,
        /// Lengths by face group.
        groups: BTreeMap<String, Length>,
    },
}

impl Sizing {
    /// What a number of mesh units that makes far too many elements was perhaps meant to be: `0.03` as `"3%"`, `2` as
    /// `"2%"`.
    pub fn perhaps_meant(&self) -> Option<String> {
        let Self::Uniform(Length::Absolute(length)) = *self else { return None };
        // Rounded, so that 0.07 times 100 is 7.
        let percent = if length < 0.5 { (length * 1e8).round() / 1e6 } else { length };
        (0.01..=20.0).contains(&percent).then(|| format!("did you mean \"{percent}%\"?"))
    }
}

impl From<Length> for Sizing {
    fn from(length: Length) -> Self {
        Self::Uniform(length)
    }
}

struct SizingVisitor;

impl<'de> Visitor<'de> for SizingVisitor {
    type Value = Sizing;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a length, `{ field = \"name\" }`, or `{ default = LENGTH, groups = { NAME = LENGTH } }`")
    }
    fn visit_f64<E: de::Error>(self, value: f64) -> Result<Sizing, E> {
        LengthVisitor.visit_f64(value).map(Sizing::Uniform)
    }
    fn visit_i64<E: de::Error>(self, value: i64) -> Result<Sizing, E> {
        LengthVisitor.visit_i64(value).map(Sizing::Uniform)
    }
    fn visit_u64<E: de::Error>(self, value: u64) -> Result<Sizing, E> {
        LengthVisitor.visit_u64(value).map(Sizing::Uniform)
    }
    fn visit_str<E: de::Error>(self, text: &str) -> Result<Sizing, E> {
        LengthVisitor.visit_str(text).map(Sizing::Uniform)
    }
    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Sizing, A::Error> {
        let (mut field, mut default, mut groups) = (None, None, None);
        while let Some(key) = map.next_key::<String>()? {
            match key.as_str() {
                "field" => field = Some(map.next_value::<String>()?),
                "default" => default = Some(map.next_value::<Length>()?),
                "groups" => groups = Some(map.next_value::<BTreeMap<String, Length>>()?),
                other => return Err(de::Error::unknown_field(other, &["field", "default", "groups"])),
            }
        }
        match (field, default, groups) {
            (Some(field), None, None) => Ok(Sizing::Field(field)),
            (None, Some(default), groups) => Ok(Sizing::Groups { default, groups: groups.unwrap_or_default() }),
            (None, None, Some(_)) => Err(de::Error::missing_field("default")),
            _ => Err(de::Error::custom("give either `field`, or `default` with `groups`")),
        }
    }
}

impl<'de> Deserialize<'de> for Sizing {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(SizingVisitor)
    }
}

impl Serialize for Sizing {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        use serde::ser::SerializeMap;
        match self {
            Self::Uniform(length) => length.serialize(serializer),
            Self::Field(name) => {
                let mut map = serializer.serialize_map(Some(1))?;
                map.serialize_entry("field", name)?;
                map.end()
            }
            Self::Groups { default, groups } => {
                let mut map = serializer.serialize_map(Some(2))?;
                map.serialize_entry("default", default)?;
                map.serialize_entry("groups", groups)?;
                map.end()
            }
        }
    }
}

impl JsonSchema for Sizing {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "Sizing".into()
    }
    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let length = generator.subschema_for::<Length>();
        json_schema!({
            "description": "A length, a field of lengths, or a table of lengths per face group.",
            "anyOf": [
                length,
                {
                    "type": "object",
                    "properties": {
                        "field": {
                            "type": "string",
                            "description": "The name of a field with a length, in mesh units, at each vertex or face."
                        }
                    },
                    "required": ["field"],
                    "additionalProperties": false,
                    "examples": [{ "field": "size" }]
                },
                {
                    "type": "object",
                    "properties": {
                        "default": {
                            "allOf": [length],
                            "description": "The length where no group of the table is."
                        },
                        "groups": {
                            "type": "object",
                            "description": "Lengths by face group; where groups overlap, the smallest one holds.",
                            "additionalProperties": length
                        }
                    },
                    "required": ["default"],
                    "additionalProperties": false,
                    "examples": [{ "default": "2%", "groups": { "rim": "0.5%" } }]
                }
            ]
        })
    }
}
