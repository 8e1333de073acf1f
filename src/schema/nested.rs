//! Parameters that are tables themselves: which keys they take, with an example of each.

use serde_json::Value;

use crate::step::parameters::{ParameterSchema, reference};

/// One form of a table that a parameter takes.
pub struct NestedTable {
    /// Its keys: name, type, and the default where it has one.
    pub keys: Vec<NestedKey>,
    /// The parameter with such a table, as a recipe writes it; empty where the schema gives none.
    pub example: String,
}

/// A key of a nested table.
pub struct NestedKey {
    /// The key.
    pub name: String,
    /// The schema of its value.
    pub schema: Value,
    /// Whether it must be there.
    pub required: bool,
}

/// The tables that a parameter takes; none where it takes no table with keys of its own.
pub fn nested_tables(name: &str, parameters: &ParameterSchema) -> Vec<NestedTable> {
    let mut tables = Vec::new();
    if let Some(schema) = parameters.properties.get(name) {
        collect(name, schema, parameters, false, &mut tables);
    }
    tables
}

fn collect(name: &str, schema: &Value, all: &ParameterSchema, in_list: bool, tables: &mut Vec<NestedTable>) {
    if let Some(definition) = reference(schema).and_then(|name| all.definitions.get(&name)) {
        collect(name, definition, all, in_list, tables);
    }
    for key in ["anyOf", "oneOf", "allOf"] {
        for choice in schema.get(key).and_then(Value::as_array).into_iter().flatten() {
            collect(name, choice, all, in_list, tables);
        }
    }
    if let Some(items) = schema.get("items") {
        collect(name, items, all, true, tables);
    }
    let Some(properties) = schema.get("properties").and_then(Value::as_object) else { return };
    let required = |key: &String| {
        let names = schema.get("required").and_then(Value::as_array);
        names.is_some_and(|names| names.iter().any(|name| name == key))
    };
    let key = |(key, value): (&String, &Value)| NestedKey {
        name: key.clone(),
        schema: value.clone(),
        required: required(key),
    };
    let example = schema.get("examples").and_then(|examples| examples.get(0)).map(|example| {
        let example = inline(example);
        if in_list { format!("{name} = [{example}]") } else { format!("{name} = {example}") }
    });
    tables.push(NestedTable { keys: properties.iter().map(key).collect(), example: example.unwrap_or_default() });
}

/// A value as TOML writes it in one line, with its keys in the order given.
fn inline(value: &Value) -> String {
    let list = |parts: Vec<String>| parts.join(", ");
    match value {
        Value::Null => String::new(),
        Value::Bool(_) => value.to_string(),
        // Whole numbers fit everywhere, and `0` is shorter than `0.0`.
        Value::Number(number) => number.as_f64().map(|number| number.to_string()).unwrap_or_default(),
        Value::String(text) => toml::Value::from(text.as_str()).to_string(),
        Value::Array(items) => format!("[{}]", list(items.iter().map(inline).collect())),
        Value::Object(table) => {
            format!("{{ {} }}", list(table.iter().map(|(key, value)| format!("{key} = {}", inline(value))).collect()))
        }
    }
}
