//! `--json`: one shape of document for every command, for programs in any language.
//!
//! A document is an object with `kind` (`run`, `measure`, `diff`, `mesh-diff` or `sweep`), `units`, which gives the
//! unit of each metric in it that has one, and the content of that kind. Measured values are plain numbers and truth
//! values; a number that is not finite is null; where counting stopped, the number is a lower bound and its unit `or
//! more`. `schemas/output.schema.json`, which `meshmill schema output` prints, is the schema.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use schemars::generate::SchemaSettings;
use serde::Serialize;
use serde_json::{Map, Value as Json, json};

use super::Report;
use super::diff::{MeshDiff, RunDiff};
use super::measure::unit_text;
use super::sweep::SweepTable;
use crate::metric::Value;
use crate::metric::element;
use crate::metric::gate::criteria::CriteriaReport;
use crate::metric::registry::find;

/// What a document holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    /// A run: [`Report`].
    Run,
    /// The metrics of one mesh: [`Measured`].
    Measure,
    /// Two runs: [`RunDiff`].
    Diff,
    /// Two meshes: [`MeshDiff`].
    MeshDiff,
    /// A sweep: [`SweepTable`].
    Sweep,
}

/// The metrics of one mesh.
#[derive(Clone, Debug, Default, PartialEq, Serialize, JsonSchema)]
pub struct Measured {
    /// Values by metric name.
    pub metrics: BTreeMap<String, Value>,
    /// How well the mesh keeps the criteria that were asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub criteria: Option<CriteriaReport>,
}

/// The document of this content.
///
/// # Errors
/// Where the content is no JSON object.
pub fn document(kind: Kind, content: &impl Serialize) -> serde_json::Result<Json> {
    let mut content = serde_json::to_value(content)?;
    let mut units = Map::new();
    flatten(&mut content, &mut units);
    let mut document = Map::from_iter([("kind".to_owned(), serde_json::to_value(kind)?)]);
    document.insert("units".to_owned(), units.into());
    document.extend(serde_json::from_value::<Map<String, Json>>(content)?);
    Ok(document.into())
}

/// What the program calls a count that stopped.
const AT_LEAST: &str = "AtLeast";

/// Puts values in the place of what the program calls them, and notes the units of the metrics met.
fn flatten(json: &mut Json, units: &mut Map<String, Json>) {
    match json {
        Json::Array(items) => items.iter_mut().for_each(|item| flatten(item, units)),
        Json::Object(table) => {
            if let Some(value) = bare_value(table) {
                *json = value;
                return;
            }
            if let Some(Json::String(metric)) = table.get("metric") {
                note_unit(metric, units);
            }
            let metric = table.get("metric").and_then(Json::as_str).map(str::to_owned);
            for (name, item) in table {
                if item.get(AT_LEAST).is_some() {
                    let name = metric.as_ref().filter(|_| name == "measured").unwrap_or(name);
                    units.insert(name.clone(), "or more".into());
                }
                flatten(item, units);
                if !item.is_object() && !item.is_array() {
                    note_unit(name, units);
                }
            }
        }
        Json::Null | Json::Bool(_) | Json::Number(_) | Json::String(_) => {}
    }
}

/// The value of a [`Value`], which is named by its variant within the program.
fn bare_value(table: &Map<String, Json>) -> Option<Json> {
    let mut entries = table.iter();
    let (Some((name, value)), None) = (entries.next(), entries.next()) else { return None };
    let is_value = match name.as_str() {
        "Count" | "Integer" | AT_LEAST => value.is_i64() || value.is_u64(),
        "Number" => value.is_number() || value.is_null(),
        "Flag" => value.is_boolean(),
        _ => false,
    };
    is_value.then(|| value.clone())
}

fn note_unit(metric: &str, units: &mut Map<String, Json>) {
    let unit = find(metric).map(|metric| metric.unit).or_else(|| element::find(metric).map(|metric| metric.unit));
    if let Some(unit) = unit.map(unit_text).filter(|unit| !unit.is_empty()) {
        units.insert(metric.to_owned(), unit.into());
    }
}

/// The schema of all documents, draft 7.
pub fn schema() -> Json {
    let settings = SchemaSettings::draft07().for_serialize();
    let mut generator = settings.into_generator();
    let contents = [
        (Kind::Run, generator.subschema_for::<Report>()),
        (Kind::Measure, generator.subschema_for::<Measured>()),
        (Kind::Diff, generator.subschema_for::<RunDiff>()),
        (Kind::MeshDiff, generator.subschema_for::<MeshDiff>()),
        (Kind::Sweep, generator.subschema_for::<SweepTable>()),
    ];
    let envelope = |(kind, content): (Kind, schemars::Schema)| {
        json!({
            "allOf": [content, {
                "type": "object",
                "required": ["kind", "units"],
                "properties": { "kind": { "const": kind }, "units": { "$ref": "#/definitions/Units" } }
            }]
        })
    };
    let documents: Vec<Json> = contents.into_iter().map(envelope).collect();
    let mut definitions = generator.take_definitions(true);
    let unit = json!({ "enum": ["length", "area", "volume", "degrees", "share", "or more"] });
    definitions.insert("Units".to_owned(), json!({
        "description": "The unit of each metric of the document that has one. Lengths are in the units of the mesh. Counts \
            with `or more` are lower bounds: counting stopped there.",
        "type": "object",
        "additionalProperties": unit
    }));
    json!({
        "$schema": "http://json-schema.org/draft-07/schema#",
        "title": "Output of meshmill --json",
        "oneOf": documents,
        "definitions": definitions
    })
}

/// The same as text, as it is shipped.
pub fn schema_text() -> String {
    // A JSON value is always written.
    serde_json::to_string_pretty(&schema()).unwrap_or_default() + "\n"
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_bare_with_units_beside_them() {
        let values = [
            ("faces", Value::Count(12)),
            ("closed", Value::Flag(true)),
            ("area", Value::Number(6.5)),
            ("min-edge", Value::Number(f64::NAN)),
            ("euler-characteristic", Value::Integer(-2)),
            ("self-intersections", Value::AtLeast(1_000_000)),
        ];
        let metrics = values.map(|(name, value)| (name.to_owned(), value)).into();
        let expected = json!({
            "kind": "measure",
            "metrics": {
                "area": 6.5, "closed": true, "euler-characteristic": -2, "faces": 12, "min-edge": null,
                "self-intersections": 1_000_000,
            },
            "units": { "area": "area", "min-edge": "length", "self-intersections": "or more" },
        });
        assert_eq!(document(Kind::Measure, &Measured { metrics, criteria: None }).unwrap(), expected);
    }
}
