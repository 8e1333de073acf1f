//! `meshmill steps`: the reference of the steps, in the terminal.

use super::exit::{Exit, Fault, data};
use crate::recipe::suggest;
use crate::report::table::wrapped;
use crate::schema::{kind, nested_tables};
use crate::step::parameters::ParameterSchema;
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
    let mut lines = Vec::new();
    for step in CATALOG {
        let inputs: Vec<&str> = step.inputs.iter().map(|input| input.name).collect();
        let outputs: Vec<String> = step.outputs.iter().map(|output| port(output.port)).collect();
        lines.extend(wrapped(&format!("{}: {} → {}", step.name, inputs.join(", "), outputs.join(", ")), 0));
        let doc = ParameterSchema::of(step).description;
        lines.extend(wrapped(doc.split("\n\n").next().unwrap_or_default(), 4));
    }
    lines.push(String::new());
    lines.push("`meshmill steps NAME` explains one, with its parameters and an example".to_owned());
    lines.join("\n")
}

fn port(port: OutPort) -> String {
    match port {
        OutPort::Is(port) => port.to_string(),
        OutPort::SameAsFrom => "same as from".to_owned(),
    }
}

fn explain(step: &StepDef) -> String {
    let schema = ParameterSchema::of(step);
    let paragraphs = schema.description.split("\n\n").map(|paragraph| wrapped(paragraph, 0).join("\n"));
    let mut parts = vec![format!("{} (revision {})", step.name, step.revision)];
    parts.extend(paragraphs);
    let mut lines = vec!["inputs".to_owned()];
    for input in step.inputs {
        let ports: Vec<String> = input.accepts.iter().map(ToString::to_string).collect();
        let needed = if input.required { "" } else { ", optional" };
        lines.extend(wrapped(&format!("{}: {}{needed}. {}", input.name, ports.join(" or "), input.doc), 2));
    }
    lines.push("outputs".to_owned());
    lines.extend(step.outputs.iter().map(|output| format!("  {}: {}", output.name, port(output.port))));
    parts.push(lines.join("\n"));
    parts.push(parameters(step, &schema).join("\n"));
    let carries = wrapped(step.carries, 2).join("\n");
    parts.push(format!("carries\n{carries}"));
    parts.push(format!("example\n{}", step.example.trim_matches('\n')));
    parts.retain(|part| !part.is_empty());
    parts.join("\n\n")
}

fn parameters(step: &StepDef, schema: &ParameterSchema) -> Vec<String> {
    let text = |value: &serde_json::Value| {
        let text = value.get("description").and_then(serde_json::Value::as_str);
        text.unwrap_or_default().to_owned()
    };
    let default = |value: &serde_json::Value| match value.get("default") {
        Some(value) if !value.is_null() => format!(" (default {value})"),
        _ => String::new(),
    };
    let mut lines = vec!["parameters".to_owned()];
    for (name, property) in &schema.properties {
        lines.push(format!("  {name}{}", default(property)));
        lines.extend(wrapped(&text(property), 6));
        for table in nested_tables(name, schema) {
            lines.push("      a table:".to_owned());
            for key in &table.keys {
                let optional = if key.required || !default(&key.schema).is_empty() { "" } else { ", optional" };
                let head = format!("{}: {}{optional}{}", key.name, kind(&key.schema, schema), default(&key.schema));
                lines.extend(wrapped(&format!("{head}. {}", text(&key.schema)), 8));
            }
            lines.push(format!("      {}", table.example));
        }
    }
    if step.edits {
        let common = "keep, on-curve, only, boundary: what may change; common to all editing steps";
        lines.extend(wrapped(common, 2));
    }
    lines
}
