//! The schema of the `[sweep]` section.

use serde_json::{Value, json};

/// The section: axes, zips, samples, cases and columns.
pub(super) fn sweep() -> Value {
    json!({
        "type": "object",
        "description": "A parameter study, read by `meshmill sweep` only.",
        "additionalProperties": false,
        "properties": {
            "axes": {
                "type": "object",
                "description": "By parameter, or by input as inputs.NAME, the values it takes.",
                "properties": { "inputs": { "type": "object", "additionalProperties": files() } },
                "additionalProperties": { "anyOf": [list(), range(), files()] }
            },
            "zip": {
                "description": "Axes that advance together, as lists of names.",
                "type": "array",
                "items": { "anyOf": [{ "type": "string" }, { "type": "array", "items": { "type": "string" } }] }
            },
            "case": {
                "description": "Cases besides those of the axes.",
                "type": "array",
                "maxItems": 10_000,
                "items": case()
            },
            "sample": sample(),
            "columns": {
                "description": "Metrics in the table of results; faces and stretch of the result where none is named.",
                "anyOf": [column(), { "type": "array", "items": column() }]
            }
        }
    })
}

fn list() -> Value {
    json!({ "type": "array", "minItems": 1, "items": { "$ref": "#/definitions/Scalar" } })
}

fn range() -> Value {
    let bound = json!({ "anyOf": [{ "type": "number" }, { "type": "string", "pattern": "%$" }] });
    json!({
        "type": "object",
        "required": ["from", "to"],
        "additionalProperties": false,
        "properties": {
            "from": bound,
            "to": bound,
            "count": {
                "type": "integer",
                "minimum": 1,
                "maximum": 10_000,
                "description": "How many values; a sample needs none."
            },
            "scale": { "enum": ["linear", "log"], "description": "How the values lie between the bounds." }
        }
    })
}

fn files() -> Value {
    let name = json!({ "type": "string", "description": "A file, or a pattern with * and ?." });
    json!({
        "anyOf": [
            name,
            { "type": "array", "minItems": 1, "items": name },
            {
                "type": "object",
                "required": ["glob"],
                "additionalProperties": false,
                "properties": { "glob": name }
            }
        ]
    })
}

fn case() -> Value {
    json!({
        "type": "object",
        "properties": {
            "name": { "type": "string", "description": "Folder of the case's files." },
            "inputs": { "type": "object", "additionalProperties": { "type": "string" } }
        },
        "additionalProperties": { "$ref": "#/definitions/Scalar" }
    })
}

fn sample() -> Value {
    json!({
        "type": "object",
        "description": "Points drawn from the axes in the place of their grid.",
        "required": ["n"],
        "additionalProperties": false,
        "properties": {
            "method": { "const": "latin-hypercube", "description": "Each axis sees each of its n parts once." },
            "n": { "type": "integer", "minimum": 1, "maximum": 10_000, "description": "How many points." },
            "seed": { "type": "integer", "minimum": 0, "description": "Another seed draws other points; default 0." }
        }
    })
}

fn column() -> Value {
    json!({
        "anyOf": [
            { "type": "string", "description": "METRIC of the result, or STEP.METRIC." },
            {
                "type": "object",
                "required": ["metric"],
                "additionalProperties": false,
                "properties": {
                    "metric": { "type": "string", "description": "A metric of the registry." },
                    "of": { "type": "string", "description": "The step measured; the result where none is named." },
                    "to": { "type": "string", "description": "The step compared with." }
                }
            }
        ]
    })
}
