//! The schema of criteria: tables of a recipe, and files of their own.

use serde_json::{Map, Value, json};

use super::{admitting_expressions, expression, length_limit, number_limit, scalar};
use crate::metric::element::{ELEMENT_METRICS, ElementMetric};
use crate::metric::gate::criteria::LEVELS;
use crate::metric::registry::Unit;

/// A table of the `[criteria]` section of a recipe.
pub(super) fn section() -> Value {
    let mut properties = properties();
    let file = json!({
        "type": "string",
        "description": "A file of criteria, relative to the recipe; entries beside it change what it says."
    });
    properties.insert("file".to_owned(), file);
    json!({ "type": "object", "additionalProperties": false, "properties": properties })
}

/// `criteria` of a gate.
pub(super) fn of_gate() -> Value {
    let name = json!({ "type": "string", "description": "A table of the [criteria] section." });
    let one = json!({
        "anyOf": [
            name,
            {
                "type": "object",
                "additionalProperties": false,
                "required": ["use"],
                "properties": {
                    "use": name,
                    "to": { "type": "string", "description": "The step that criteria which compare are measured to." },
                    "except": {
                        "description": "Face groups that are not judged.",
                        "anyOf": [{ "type": "string" }, { "type": "array", "items": { "type": "string" } }]
                    }
                }
            }
        ]
    });
    json!({
        "description": "The criteria that no element may fail.",
        "anyOf": [one, { "type": "array", "items": one }]
    })
}

/// The JSON Schema of a file of criteria, draft 7.
pub fn criteria_schema() -> Value {
    let mut properties = properties();
    properties.insert(
        "extends".to_owned(),
        json!({ "type": "string", "description": "A file of criteria that this one changes." }),
    );
    properties.insert(
        "drop".to_owned(),
        json!({
            "description": "Entries of the extended file that this one takes away, such as \"skew\".",
            "anyOf": [{ "type": "string" }, { "type": "array", "items": { "type": "string" } }]
        }),
    );
    let mut shared = Map::from_iter([("Expression".to_owned(), expression()), ("Scalar".to_owned(), scalar())]);
    shared.extend(definitions().map(|(name, schema)| (name.to_owned(), schema)));
    json!({
        "$schema": "http://json-schema.org/draft-07/schema#",
        "title": "meshmill criteria",
        "type": "object",
        "additionalProperties": false,
        "properties": properties,
        "definitions": shared
    })
}

/// The same as text, as it is shipped.
pub fn criteria_schema_text() -> String {
    serde_json::to_string_pretty(&criteria_schema()).unwrap_or_default() + "\n"
}

fn properties() -> Map<String, Value> {
    let number = json!({ "type": "number", "minimum": 0 });
    let mut properties = Map::new();
    properties
        .insert("description".to_owned(), json!({ "type": "string", "description": "What the criteria are for." }));
    properties.insert(
        "params".to_owned(),
        json!({
            "type": "object",
            "description": "Values for the expressions of these criteria.",
            "additionalProperties": { "$ref": "#/definitions/Scalar" }
        }),
    );
    properties.insert(
        "penalties".to_owned(),
        json!({
            "description": "Penalties at ideal, good, warn, fail and worst: [0, 0, 0.8, 1, 10] where none are given.",
            "type": "array", "items": number, "minItems": 5, "maxItems": 5
        }),
    );
    properties.extend(ELEMENT_METRICS.iter().map(|metric| (metric.name.to_owned(), criterion(metric))));
    properties
}

/// What a metric of this unit is told by.
fn criterion(metric: &ElementMetric) -> Value {
    let kind = match metric.unit {
        Unit::Length | Unit::Share => "LengthCriterion",
        _ => "NumberCriterion",
    };
    json!({ "description": metric.doc, "allOf": [{ "$ref": format!("#/definitions/{kind}") }] })
}

/// The definitions that criteria refer to, by name.
pub(super) fn definitions() -> [(&'static str, Value); 2] {
    [("LengthCriterion", length_limit()), ("NumberCriterion", number_limit())].map(|(name, level)| {
        let mut properties: Map<String, Value> =
            LEVELS.iter().map(|name| ((*name).to_owned(), level.clone())).collect();
        let weight = json!({ "type": "number", "minimum": 0, "default": 1 });
        properties.insert("weight".to_owned(), admitting_expressions(weight));
        properties.insert("on".to_owned(), admitting_expressions(json!({ "type": "boolean", "default": true })));
        let table = json!({ "type": "object", "additionalProperties": false, "properties": properties });
        (name, json!({ "anyOf": [{ "const": false }, table] }))
    })
}
