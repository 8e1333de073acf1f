//! What a recipe may say, derived from the catalog: a JSON Schema for editors, and a reference for readers.
//!
//! The schema keeps to draft-07 and to the part of it that TOML editors understand. Every value may also be an
//! expression, a string that begins with `=`. A step table without `use` is taken as it is: it changes a step of an
//! extended recipe, and which one only the loader knows.

mod criteria;
mod nested;
mod reference;
mod sweep;

use std::collections::BTreeSet;

use schemars::SchemaGenerator;
use schemars::generate::SchemaSettings;
use serde_json::{Map, Value, json};

pub use criteria::{criteria_schema, criteria_schema_text};
pub use nested::{NestedKey, NestedTable, nested_tables};
pub use reference::{kind, steps_reference};

use crate::metric::registry::{METRICS, MetricDef, Unit};
use crate::step::{InputDef, Locks, Port, StepDef};

/// The JSON Schema of recipes over a catalog. `endings` are those of files that can be written.
pub fn recipe_schema(catalog: &[StepDef], endings: &[&str]) -> Value {
    let mut generator = SchemaSettings::draft07().into_generator();
    let steps: Vec<Value> = catalog.iter().map(|def| step_schema(def, &mut generator)).collect();
    let mut definitions = generator.take_definitions(true);
    for definition in definitions.values_mut() {
        admit_expressions_inside(definition);
    }
    keep_used(&mut definitions, &steps);
    let mut choices = steps;
    choices.push(json!({
        "title": "a step of the extended recipe",
        "type": "object",
        "not": { "required": ["use"] }
    }));
    definitions.insert("Expression".to_owned(), expression());
    definitions.insert("Scalar".to_owned(), scalar());
    definitions.insert("Step".to_owned(), json!({ "oneOf": choices }));
    for (name, limit) in [("FlagCheck", flag_limit()), ("LengthCheck", length_limit()), ("NumberCheck", number_limit())]
    {
        definitions.insert(name.to_owned(), check(&limit));
    }
    definitions.insert("Gate".to_owned(), gate());
    definitions.insert("Criteria".to_owned(), criteria::section());
    definitions.extend(criteria::definitions().map(|(name, schema)| (name.to_owned(), schema)));
    definitions.insert("Output".to_owned(), output(endings));
    json!({
        "$schema": "http://json-schema.org/draft-07/schema#",
        "title": "meshmill recipe",
        "type": "object",
        "additionalProperties": false,
        "properties": {
            "name": { "type": "string", "description": "Name of the recipe; outputs go to out/NAME." },
            "description": { "type": "string", "description": "What the recipe is for." },
            "extends": {
                "type": "string",
                "description": "A recipe that this one changes: tables merge, arrays and other values replace."
            },
            "drop": {
                "description": "Entries of the extended recipe that this one takes away, such as \"gates.fe.closed\".",
                "anyOf": [{ "type": "string" }, { "type": "array", "items": { "type": "string" } }]
            },
            "inputs": {
                "type": "object",
                "description": "Input files, relative to the recipe; `--input NAME=FILE` replaces one.",
                "additionalProperties": { "type": "string" }
            },
            "params": {
                "type": "object",
                "description": "Values for expressions; `--set NAME=VALUE` replaces one.",
                "additionalProperties": { "$ref": "#/definitions/Scalar" }
            },
            "steps": {
                "type": "object",
                "description": "The nodes of the graph.",
                "additionalProperties": { "$ref": "#/definitions/Step" }
            },
            "gates": {
                "type": "object",
                "description": "By step, what its mesh must hold.",
                "additionalProperties": { "$ref": "#/definitions/Gate" }
            },
            "criteria": {
                "type": "object",
                "description": "Standards for elements by name; a gate names one with `criteria`.",
                "additionalProperties": { "$ref": "#/definitions/Criteria" }
            },
            "limits": limits(),
            "outputs": {
                "type": "object",
                "description": "By step, the files written of it.",
                "additionalProperties": {
                    "anyOf": [
                        { "$ref": "#/definitions/Output" },
                        { "type": "array", "items": { "$ref": "#/definitions/Output" } }
                    ]
                }
            },
            "sweep": sweep::sweep()
        },
        "definitions": definitions
    })
}

/// The schema as a file: two spaces, a line break at the end.
pub fn recipe_schema_text(catalog: &[StepDef], endings: &[&str]) -> String {
    let mut text = serde_json::to_string_pretty(&recipe_schema(catalog, endings)).unwrap_or_default();
    text.push('\n');
    text
}

fn step_schema(def: &StepDef, generator: &mut SchemaGenerator) -> Value {
    let mut params = resolved((def.params_schema)(generator).to_value(), generator);
    let description = params.get("description").cloned().unwrap_or_default();
    let own = params.get_mut("properties").and_then(Value::as_object_mut).map(std::mem::take).unwrap_or_default();
    let required_params = params.get("required").and_then(Value::as_array).cloned().unwrap_or_default();
    let mut properties = Map::new();
    properties.insert("use".to_owned(), json!({ "const": def.name, "description": description }));
    let mut required = vec![Value::from("use")];
    for input in def.inputs {
        properties.insert(input.name.to_owned(), json!({ "type": "string", "description": input_doc(input) }));
        if input.required {
            required.push(Value::from(input.name));
        }
    }
    if def.edits {
        let mut locks = resolved(generator.subschema_for::<Locks>().to_value(), generator);
        let keys = locks.get_mut("properties").and_then(Value::as_object_mut).map(std::mem::take).unwrap_or_default();
        for (key, schema) in keys {
            properties.insert(key, admitting_expressions(schema));
        }
    }
    for (key, schema) in own {
        properties.insert(key, admitting_expressions(schema));
    }
    required.extend(required_params);
    json!({
        "title": def.name,
        "type": "object",
        "properties": properties,
        "required": required,
        "additionalProperties": false
    })
}

/// A schema with its own reference followed.
fn resolved(schema: Value, generator: &SchemaGenerator) -> Value {
    match crate::step::parameters::reference(&schema) {
        Some(name) => generator.definitions().get(&name).cloned().unwrap_or(schema),
        None => schema,
    }
}

fn input_doc(input: &InputDef) -> String {
    let accepted = input.accepts.iter().map(Port::to_string).collect::<Vec<_>>().join(" or ");
    format!("{} ({accepted})", input.doc)
}

fn expression() -> Value {
    json!({
        "type": "string",
        "pattern": "^=",
        "description": "An expression over [params] and inputs.NAME; `==` begins a string with `=`."
    })
}

fn scalar() -> Value {
    json!({ "type": ["number", "boolean", "string"] })
}

/// The schema or an expression; what a reader sees first stays outside.
fn admitting_expressions(mut schema: Value) -> Value {
    admit_expressions_inside(&mut schema);
    let mut outer = Map::new();
    if let Some(inner) = schema.as_object_mut() {
        for key in ["title", "description", "default"] {
            if let Some(value) = inner.remove(key).filter(|value| !value.is_null()) {
                outer.insert(key.to_owned(), value);
            }
        }
    }
    outer.insert("anyOf".to_owned(), json!([schema, { "$ref": "#/definitions/Expression" }]));
    Value::Object(outer)
}

/// Lets every value inside a schema be an expression too. TOML has no null, so what admits one is left out.
fn admit_expressions_inside(schema: &mut Value) {
    let Some(schema) = schema.as_object_mut() else { return };
    without_null(schema);
    for (key, value) in schema.iter_mut() {
        match (key.as_str(), value) {
            ("properties", Value::Object(properties)) => {
                for property in properties.values_mut() {
                    *property = admitting_expressions(property.take());
                }
            }
            ("items" | "additionalProperties", value @ Value::Object(_)) => {
                *value = admitting_expressions(value.take());
            }
            ("anyOf" | "oneOf" | "allOf", Value::Array(choices)) => {
                choices.iter_mut().for_each(admit_expressions_inside);
            }
            _ => {}
        }
    }
}

fn without_null(schema: &mut Map<String, Value>) {
    let null = Value::from("null");
    if let Some(Value::Array(types)) = schema.get_mut("type") {
        types.retain(|name| *name != null);
        if let [only] = types.as_slice() {
            let only = only.clone();
            schema.insert("type".to_owned(), only);
        }
    }
    for key in ["anyOf", "oneOf"] {
        if let Some(Value::Array(choices)) = schema.get_mut(key) {
            choices.retain(|choice| choice.get("type") != Some(&null));
        }
    }
    if let Some(Value::Array(values)) = schema.get_mut("enum") {
        values.retain(|value| !value.is_null());
    }
}

/// Drops the definitions that no step refers to, directly or through others.
fn keep_used(definitions: &mut Map<String, Value>, steps: &[Value]) {
    let mut used = BTreeSet::new();
    let mut open: Vec<&Value> = steps.iter().collect();
    while let Some(value) = open.pop() {
        if let Some(name) = crate::step::parameters::reference(value)
            && let Some(definition) = definitions.get(&name)
            && used.insert(name)
        {
            open.push(definition);
        }
        match value {
            Value::Array(items) => open.extend(items),
            Value::Object(table) => open.extend(table.values()),
            Value::Null | Value::Bool(_) | Value::Number(_) | Value::String(_) => {}
        }
    }
    definitions.retain(|name, _| used.contains(name));
}

fn limits() -> Value {
    let timeout = json!({
        "description": "How long a step may take: seconds, or such as \"90 s\", \"10 min\", \"2 h\". Metrics and gates take as \
            long as they take.",
        "anyOf": [{ "type": "number", "exclusiveMinimum": 0 }, { "type": "string" }]
    });
    let memory = json!({
        "description": "How much memory a step may take beyond what is there when it begins: bytes, or such as \"500 MB\", \
            \"2 GB\", \"1.5 GiB\".",
        "anyOf": [{ "type": "number", "exclusiveMinimum": 0 }, { "type": "string" }]
    });
    let retries = json!({
        "description": "How often a step is tried again that was over a limit, or whose files the disk did not take.",
        "anyOf": [{ "type": "integer", "minimum": 0, "maximum": 100 }, { "type": "string", "pattern": "^=" }]
    });
    let or_none = |limit: &Value| json!({ "anyOf": [limit, { "const": false }] });
    json!({
        "type": "object",
        "description": "Limits of every step; one that is over its limit fails, and the others go on.",
        "additionalProperties": false,
        "properties": {
            "timeout": timeout,
            "memory": memory,
            "retries": retries,
            "steps": {
                "type": "object",
                "description": "By step, its own limits; `timeout = false` and `memory = false` for none.",
                "additionalProperties": {
                    "type": "object",
                    "additionalProperties": false,
                    "properties": { "timeout": or_none(&timeout), "memory": or_none(&memory), "retries": retries }
                }
            }
        }
    })
}

fn gate() -> Value {
    let property = |metric: &MetricDef| {
        let kind = match metric.unit {
            Unit::Flag => "FlagCheck",
            Unit::Length | Unit::Share => "LengthCheck",
            Unit::Count | Unit::Area | Unit::Volume | Unit::Degrees | Unit::Ratio => "NumberCheck",
        };
        let schema = json!({
            "description": metric.doc,
            "allOf": [{ "$ref": format!("#/definitions/{kind}") }]
        });
        (metric.name.to_owned(), schema)
    };
    let mut properties: Map<String, Value> = METRICS.iter().map(property).collect();
    properties.insert("criteria".to_owned(), criteria::of_gate());
    json!({ "type": "object", "properties": properties, "additionalProperties": false })
}

fn flag_limit() -> Value {
    json!({ "anyOf": [{ "type": "boolean" }, { "$ref": "#/definitions/Expression" }] })
}

fn number_limit() -> Value {
    json!({ "anyOf": [{ "type": "number" }, { "$ref": "#/definitions/Expression" }] })
}

fn length_limit() -> Value {
    json!({ "anyOf": [
        { "type": "number" },
        { "type": "string", "pattern": "^(=|\\s*[0-9.eE+-]+\\s*%$)" }
    ] })
}

fn check(limit: &Value) -> Value {
    let step = |doc: &str| json!({ "type": "string", "description": doc });
    json!({
        "anyOf": [
            limit,
            {
                "type": "object",
                "additionalProperties": false,
                "properties": {
                    "at-least": limit,
                    "at-most": limit,
                    "equals": limit,
                    "to": step("The step compared with."),
                    "of": step("The step compared with."),
                    "same-as": step("The step whose value must be equal."),
                    "no-more-than": step("The step whose value must not be exceeded."),
                    "except": {
                        "description": "Face groups that are not judged.",
                        "anyOf": [{ "type": "string" }, { "type": "array", "items": { "type": "string" } }]
                    },
                    "files": {
                        "description": "`groups-kept` only: the files written must hold the groups too.",
                        "type": "boolean"
                    }
                }
            }
        ]
    })
}

fn output(endings: &[&str]) -> Value {
    let file = json!({
        "type": "string",
        "description": "File below the folder of the outputs; {param}, {name} and {step} are filled in. Patches go to JSON.",
        "pattern": format!("^=|\\.({}|json)$", endings.join("|"))
    });
    let or_expression = |schema: Value| json!({ "anyOf": [schema, { "$ref": "#/definitions/Expression" }] });
    json!({
        "anyOf": [
            file,
            {
                "type": "object",
                "required": ["file"],
                "additionalProperties": false,
                "properties": {
                    "file": file,
                    "element": or_expression(json!({ "enum": ["S3", "S4", "S6", "S8R"] })),
                    "midside-on": { "type": "string", "description": "The step on whose surface mid-side nodes lie." },
                    "binary": or_expression(json!({ "type": "boolean" })),
                    "precision": or_expression(json!({ "type": "integer", "minimum": 1, "maximum": 17 })),
                    "first-id": or_expression(json!({ "type": "integer", "minimum": 1, "maximum": 1_000_000_000 }))
                }
            }
        ]
    })
}
