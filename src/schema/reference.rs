//! The reference of steps and metrics, as Markdown.

use std::fmt::Write;

use serde_json::Value;

use super::nested::{NestedKey, nested_tables};
use crate::metric::element::ELEMENT_METRICS;
use crate::metric::registry::{Direction, METRICS, Needs, Unit};
use crate::step::parameters::{ParameterSchema, reference};
use crate::step::{OutPort, Port, StepDef};

/// What every step of a catalog takes, makes and means, and every metric that a gate can check.
pub fn steps_reference(catalog: &[StepDef]) -> String {
    let mut page = String::from(
        "# Steps\n\n\
         Generated from the code; a test keeps it up to date. A value may always be an expression such as `\"=2*size\"`.\n\n\
         - A **length** is a number in mesh units, or a percent of the diagonal of the bounding box of `reference` where \
         the step has one, else of its main input.\n\
         - A **share** is a number from 0 to 1 or a percent. An **angle** is in degrees.\n\
         - A **sizing** is a length, `{ field = \"NAME\" }`, or `{ default = LENGTH, groups = { NAME = LENGTH } }`.\n\
         - Steps that edit also take `keep`, `on-curve` and `only` (lists of groups) and `boundary` (`\"exact\"`, \
         `\"curve\"`, `\"free\"`): elements of `keep` are identical in the result, `on-curve` ones change only along \
         their curve, everything outside `only` is kept.\n\n",
    );
    for def in catalog {
        let _ = writeln!(page, "- [{0}](#{0})", def.name);
    }
    page.push_str("- [Metrics](#metrics)\n");
    for def in catalog {
        step(def, &mut page);
    }
    metrics(&mut page);
    page
}

fn step(def: &StepDef, page: &mut String) {
    let params = ParameterSchema::of(def);
    let stats = ParameterSchema::of_stats(def);
    let _ = writeln!(page, "\n## {}\n\n{}\n", def.name, params.description.trim());
    for input in def.inputs {
        let need = if input.required { "" } else { ", may be left out" };
        let _ = writeln!(page, "- input `{}`: {}{need}. {}", input.name, ports(input.accepts), sentence(input.doc));
    }
    for output in def.outputs {
        let port = match output.port {
            OutPort::Is(port) => port.to_string(),
            OutPort::SameAsFrom => "the same as `from`".to_owned(),
        };
        let _ = writeln!(page, "- output `{}`: {port}", output.name);
    }
    let edits = if def.edits { " It edits, and takes `keep`, `on-curve`, `only` and `boundary`." } else { "" };
    let _ = writeln!(page, "- Revision {}.{edits}", def.revision);
    let _ = writeln!(page, "- Carries: {}", sentence(def.carries));
    if !params.properties.is_empty() {
        page.push_str("\n| parameter | type | default | range | meaning |\n|---|---|---|---|---|\n");
        for (name, schema) in &params.properties {
            let default = if params.required.contains(name) { "required".to_owned() } else { default(schema) };
            let (kind, range) = (kind(schema, &params), range(schema));
            let _ = writeln!(page, "| `{name}` | {kind} | {default} | {range} | {} |", cell(doc(schema)));
        }
    }
    let before = page.len();
    tables(&params, page);
    if page.len() > before {
        page.insert(before, '\n');
    }
    if !stats.properties.is_empty() {
        page.push_str("\n| statistic | type | meaning |\n|---|---|---|\n");
        for (name, schema) in &stats.properties {
            let _ = writeln!(page, "| `{name}` | {} | {} |", kind(schema, &stats), cell(doc(schema)));
        }
    }
    let example = def.example.trim();
    if !example.is_empty() {
        let head = if example.starts_with('[') { String::new() } else { "[steps.NAME]\n".to_owned() };
        let _ = writeln!(page, "\n```toml\n{head}{example}\n```");
    }
}

fn ports(ports: &[Port]) -> String {
    ports.iter().map(Port::to_string).collect::<Vec<_>>().join(" or ")
}

/// With a capital and a full stop.
fn sentence(text: &str) -> String {
    let text = text.trim().trim_end_matches('.');
    let mut characters = text.chars();
    match characters.next() {
        Some(first) => format!("{}{}.", first.to_uppercase(), characters.as_str()),
        None => String::new(),
    }
}

fn doc(schema: &Value) -> &str {
    schema.get("description").and_then(Value::as_str).unwrap_or_default()
}

fn cell(text: &str) -> String {
    text.replace('\n', " ").replace('|', "\\|")
}

fn default(schema: &Value) -> String {
    match schema.get("default") {
        None | Some(Value::Null) => "none".to_owned(),
        Some(value) => format!("`{}`", cell(&value.to_string())),
    }
}

fn range(schema: &Value) -> String {
    let bound = |name: &str| schema.get(name).and_then(Value::as_f64);
    let low = bound("minimum").map(|v| format!("≥ {v}")).or(bound("exclusiveMinimum").map(|v| format!("> {v}")));
    let high = bound("maximum").map(|v| format!("≤ {v}")).or(bound("exclusiveMaximum").map(|v| format!("< {v}")));
    [low, high].into_iter().flatten().collect::<Vec<_>>().join(", ")
}

/// The nested tables of the parameters: their keys, and an example of each.
fn tables(params: &ParameterSchema, page: &mut String) {
    for name in params.properties.keys() {
        for table in nested_tables(name, params) {
            let key = |key: &NestedKey| {
                let default = match key.schema.get("default") {
                    Some(value) if !value.is_null() => format!(", default {}", default(&key.schema)),
                    _ if key.required => String::new(),
                    _ => ", may be left out".to_owned(),
                };
                let doc = doc(&key.schema).replace('\n', " ");
                let doc = if doc.is_empty() { doc } else { format!(": {}", doc.trim_end_matches('.')) };
                format!("`{}` ({}{default}){doc}", key.name, kind(&key.schema, params))
            };
            let keys: Vec<String> = table.keys.iter().map(key).collect();
            let _ = writeln!(page, "- table `{name}`: {}. Example: `{}`", keys.join("; "), table.example);
        }
    }
}

/// A schema's type in a reader's words.
pub fn kind(schema: &Value, all: &ParameterSchema) -> String {
    if let Some(name) = reference(schema) {
        return match name.as_str() {
            "Length" | "Share" | "Angle" | "Sizing" => name.to_lowercase(),
            _ => all.definitions.get(&name).map_or(name.clone(), |definition| kind(definition, all)),
        };
    }
    if let Some(values) = schema.get("enum").and_then(Value::as_array) {
        return values.iter().map(|value| format!("`{value}`")).collect::<Vec<_>>().join(", ");
    }
    if let Some(value) = schema.get("const") {
        return format!("`{value}`");
    }
    for key in ["anyOf", "oneOf", "allOf"] {
        if let Some(choices) = schema.get(key).and_then(Value::as_array) {
            let mut kinds: Vec<String> = Vec::new();
            for choice in choices {
                let kind = kind(choice, all);
                if !kinds.contains(&kind) && kind != "null" {
                    kinds.push(kind);
                }
            }
            return kinds.join(" or ");
        }
    }
    let plain = |name: &str| match name {
        "boolean" => "bool".to_owned(),
        "integer" => "whole number".to_owned(),
        "array" => match schema.get("items") {
            Some(items) => format!("list of {}", kind(items, all)),
            None => "list".to_owned(),
        },
        "object" => "table".to_owned(),
        other => other.to_owned(),
    };
    match schema.get("type") {
        Some(Value::String(name)) => plain(name),
        Some(Value::Array(names)) => names
            .iter()
            .filter_map(Value::as_str)
            .filter(|name| *name != "null")
            .map(plain)
            .collect::<Vec<_>>()
            .join(" or "),
        _ => "any".to_owned(),
    }
}

fn metrics(page: &mut String) {
    page.push_str(
        "\n## Metrics\n\n\
         A gate checks any of them: `min-stretch = { at-least = 0.2 }`, `distance = { to = \"STEP\", at-most = \"0.2%\" }`, \
         `closed = true`, `euler-characteristic = { same-as = \"STEP\" }`, `groups-kept = { of = \"STEP\" }`, \
         `self-intersections = { no-more-than = \"STEP\" }`; `except` names face groups that are not judged. \
         Every file is read back before it is written, and what rounding moved is judged again; \
         `groups-kept = { of = \"STEP\", files = true }` asks the files for their groups as well.\n\n\
         | metric | unit | measured on | meaning |\n|---|---|---|---|\n",
    );
    for metric in METRICS.iter() {
        let needs = match metric.needs {
            Needs::Mesh => "any mesh",
            Needs::Triangles => "triangles",
            Needs::Quads => "quads",
            Needs::Reference => "a mesh and a reference",
        };
        let _ = writeln!(page, "| `{}` | {} | {needs} | {} |", metric.name, unit(metric.unit), cell(metric.doc));
    }
    page.push_str(
        "\n## Metrics of elements\n\n\
         Criteria name them, each with its levels: `skew = { ideal = 0, good = 10, warn = 35, fail = 45, worst = 70 }`; \
         see `docs/criteria.md`.\n\n\
         | metric | unit | of | good is | meaning |\n|---|---|---|---|---|\n",
    );
    for metric in ELEMENT_METRICS {
        let (name, on, doc) = (metric.name, metric.on().text(), cell(metric.doc));
        let better = if metric.direction == Direction::Higher { "more" } else { "less" };
        let _ = writeln!(page, "| `{name}` | {} | {on} | {better} | {doc} |", unit(metric.unit));
    }
}

fn unit(unit: Unit) -> &'static str {
    match unit {
        Unit::Count => "count",
        Unit::Flag => "true or false",
        Unit::Length => "length",
        Unit::Area => "area",
        Unit::Volume => "volume",
        Unit::Degrees => "degrees",
        Unit::Share => "share",
        Unit::Ratio => "number",
    }
}
