//! How fine a mesh taken from a hierarchy is: a number of faces, or a share of the finest mesh's.

use std::fmt;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::{self, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// A number of faces, or a percent of the faces of the finest mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Resolution {
    /// Faces.
    Faces(u64),
    /// Percent of the finest mesh, as written: `"25%"` is 25.
    Percent(f64),
}

impl Resolution {
    /// The number of faces, where the finest mesh has `finest`.
    pub fn faces(self, finest: usize) -> usize {
        match self {
            Self::Faces(faces) => usize::try_from(faces).unwrap_or(usize::MAX),
            Self::Percent(percent) => (percent / 100.0 * finest as f64).round() as usize,
        }
    }
}

impl fmt::Display for Resolution {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Faces(faces) => write!(f, "{faces}"),
            Self::Percent(percent) => write!(f, "{percent}%"),
        }
    }
}

struct ResolutionVisitor;

impl Visitor<'_> for ResolutionVisitor {
    type Value = Resolution;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a number of faces, or a percent of the finest mesh such as \"25%\"")
    }
    fn visit_u64<E: de::Error>(self, value: u64) -> Result<Resolution, E> {
        Ok(Resolution::Faces(value))
    }
    fn visit_i64<E: de::Error>(self, value: i64) -> Result<Resolution, E> {
        let faces = u64::try_from(value);
        faces.map(Resolution::Faces).map_err(|_| E::custom(format!("a number of faces is not negative, got {value}")))
    }
    fn visit_f64<E: de::Error>(self, value: f64) -> Result<Resolution, E> {
        if value.fract() == 0.0 && (0.0..9e15).contains(&value) {
            Ok(Resolution::Faces(value as u64))
        } else {
            Err(E::custom(format!("a number of faces is whole and not negative, got {value}")))
        }
    }
    fn visit_str<E: de::Error>(self, text: &str) -> Result<Resolution, E> {
        let number = text.strip_suffix('%').and_then(|number| number.trim().parse::<f64>().ok());
        match number {
            Some(percent) if (0.0..=100.0).contains(&percent) => Ok(Resolution::Percent(percent)),
            Some(percent) => Err(E::custom(format!("a percent of the faces lies from 0 to 100, got {percent}"))),
            None => Err(E::custom(format!("expected a number of faces, or a percent such as \"25%\", got \"{text}\""))),
        }
    }
}

impl<'de> Deserialize<'de> for Resolution {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(ResolutionVisitor)
    }
}

impl Serialize for Resolution {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Faces(faces) => serializer.serialize_u64(*faces),
            Self::Percent(percent) => serializer.collect_str(&format_args!("{percent}%")),
        }
    }
}

impl JsonSchema for Resolution {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "Resolution".into()
    }
    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "description": "A number of faces, or a percent of the finest mesh's such as \"25%\".",
            "anyOf": [
                { "type": "integer", "minimum": 0 },
                { "type": "string", "pattern": "^\\s*[0-9.eE+-]+\\s*%$" }
            ]
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Resolution, String> {
        toml::from_str::<std::collections::BTreeMap<String, Resolution>>(&format!("x = {text}"))
            .map(|map| map["x"])
            .map_err(|error| error.message().to_owned())
    }

    #[test]
    fn faces_and_percents_are_read() {
        assert_eq!(read("5000"), Ok(Resolution::Faces(5000)));
        assert_eq!(read("5000.0"), Ok(Resolution::Faces(5000)));
        assert_eq!(read("\"25%\"").map(|r| r.faces(1000)), Ok(250));
        for wrong in ["-1", "2.5", "\"25\"", "\"120%\"", "true"] {
            assert!(read(wrong).is_err(), "{wrong}");
        }
    }
}
