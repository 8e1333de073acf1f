//! The parameters of a step as its schema tells them, for checks, messages and the reference.

use schemars::generate::SchemaSettings;
use serde_json::{Map, Value};

use super::StepDef;

/// The schema of a step's parameters, with the definitions it refers to.
#[derive(Clone, Debug, Default)]
pub struct ParameterSchema {
    /// Schema by parameter name.
    pub properties: Map<String, Value>,
    /// Parameters without a default.
    pub required: Vec<String>,
    /// What `$ref`s in the schemas point to, as `#/definitions/NAME`.
    pub definitions: Map<String, Value>,
    /// The text of the parameter type: what the step is for.
    pub description: String,
}

impl ParameterSchema {
    /// The parameters of a step.
    pub fn of(def: &StepDef) -> Self {
        Self::from_generator(def.params_schema)
    }

    /// The statistics of a step, which have the same form.
    pub fn of_stats(def: &StepDef) -> Self {
        Self::from_generator(def.stats_schema)
    }

    fn from_generator(schema: fn(&mut schemars::SchemaGenerator) -> schemars::Schema) -> Self {
        let mut generator = SchemaSettings::draft07().into_generator();
        let mut root = schema(&mut generator).to_value();
        let mut definitions = generator.take_definitions(true);
        if let Some(name) = reference(&root) {
            root = definitions.remove(&name).unwrap_or(Value::Null);
        }
        let properties = root.get("properties").and_then(Value::as_object).cloned().unwrap_or_default();
        let required = root.get("required").and_then(Value::as_array).map(Vec::as_slice).unwrap_or_default();
        Self {
            properties,
            required: required.iter().filter_map(Value::as_str).map(str::to_owned).collect(),
            definitions,
            description: root.get("description").and_then(Value::as_str).unwrap_or_default().to_owned(),
        }
    }
}

/// The name that a schema refers to.
pub fn reference(schema: &Value) -> Option<String> {
    schema.get("$ref")?.as_str()?.rsplit('/').next().map(str::to_owned)
}
