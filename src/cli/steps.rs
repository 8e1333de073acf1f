//! `meshmill steps`: the reference of the steps, in the terminal.

use super::exit::{Exit, Fault, data};
use crate::recipe::suggest;
use crate::step::{OutPort, StepDef};
use crate::steps::CATALOG;

/// List the steps that a recipe can use, or explain one.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    /// The step to explain.
    name: Option<String>,
}

pub(super) fn run(arguments: &Arguments) -> Result<Exit, Fault> {
    let Some(name) = &arguments.name else {
        data(&list());
        return Ok(Exit::Done);
    };
    let Some(step) = CATALOG.iter().find(|step| step.name == name) else {
        let help = suggest::did_you_mean(name, "there are", CATALOG.iter().map(|step| step.name));
        return Err(Fault::usage(format!("there is no step `{name}`")).help_opt(help));
    };
    data(&explain(step));
    Ok(Exit::Done)
}

fn list() -> String {
    let mut table = crate::report::table::plain(&["step", "in", "out", "what it does"]);
    for step in CATALOG {
        let inputs: Vec<&str> = step.inputs.iter().map(|input| input.name).collect();
        let outputs: Vec<String> = step.outputs.iter().map(|output| port(output.port)).collect();
        let schema = schema(step);
        let doc = schema.get("description").and_then(|text| text.as_str()).unwrap_or_default();
        let first = doc.split("\n\n").next().unwrap_or_default().replace('\n', " ");
        table.add_row([step.name.to_owned(), inputs.join(", "), outputs.join(", "), first]);
    }
    crate::report::table::text(&table)
}

fn port(port: OutPort) -> String {
    match port {
        OutPort::Is(port) => port.to_string(),
        OutPort::SameAsFrom => "same as from".to_owned(),
    }
}

/// The step's parameters as a schema of its own, with what it refers to.
fn schema(step: &StepDef) -> serde_json::Value {
    let mut generator =
        schemars::generate::SchemaSettings::draft07().with(|s| s.inline_subschemas = true).into_generator();
    serde_json::to_value((step.params_schema)(&mut generator)).unwrap_or_default()
}

fn explain(step: &StepDef) -> String {
    let schema = schema(step);
    let text =
        |value: &serde_json::Value, key: &str| value.get(key).and_then(|v| v.as_str()).unwrap_or_default().to_owned();
    let mut parts = vec![format!("{} (revision {})", step.name, step.revision), text(&schema, "description")];
    let mut lines = vec!["inputs".to_owned()];
    for input in step.inputs {
        let ports: Vec<String> = input.accepts.iter().map(ToString::to_string).collect();
        let needed = if input.required { "" } else { ", optional" };
        lines.push(format!("  {}: {}{needed}. {}", input.name, ports.join(" or "), input.doc));
    }
    lines.push("outputs".to_owned());
    lines.extend(step.outputs.iter().map(|output| format!("  {}: {}", output.name, port(output.port))));
    parts.push(lines.join("\n"));
    let mut lines = vec!["parameters".to_owned()];
    if let Some(properties) = schema.get("properties").and_then(|properties| properties.as_object()) {
        for (name, property) in properties {
            let default = property.get("default").map(|value| format!(" (default {value})")).unwrap_or_default();
            lines.push(format!("  {name}{default}"));
            lines.extend(text(property, "description").lines().map(|line| format!("      {line}")));
        }
    }
    if step.edits {
        lines.push("  keep, on-curve, only, boundary: what may change; common to all editing steps".to_owned());
    }
    parts.push(lines.join("\n"));
    parts.push(format!("carries\n  {}", step.carries));
    parts.push(format!("example\n{}", step.example.trim_matches('\n')));
    parts.retain(|part| !part.is_empty());
    parts.join("\n\n")
}
