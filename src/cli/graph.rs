//! `meshmill graph`: the tasks of a recipe as a drawing.

use std::fmt::Write;

use clap::ValueEnum;

use super::context::RecipeArguments;
use super::exit::{Exit, Fault, data};
use crate::plan::{Plan, Task};

/// Print the graph of tasks for Graphviz or Mermaid.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    #[command(flatten)]
    recipe: RecipeArguments,
    /// Language of the drawing.
    #[arg(long, value_name = "FORMAT", default_value = "dot")]
    format: GraphFormat,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum GraphFormat {
    Dot,
    Mermaid,
}

pub(super) fn run(arguments: &Arguments) -> Result<Exit, Fault> {
    let planned = arguments.recipe.plan()?;
    let text = match arguments.format {
        GraphFormat::Dot => dot(&planned.recipe.name, &planned.plan),
        GraphFormat::Mermaid => mermaid(&planned.plan),
    };
    data(text.trim_end());
    Ok(Exit::Done)
}

/// Writing to a string cannot fail, so the results of `write!` are dropped here and below.
fn dot(name: &str, plan: &Plan) -> String {
    let mut text = format!("digraph \"{}\" {{\n  rankdir=LR;\n  node [shape=box, style=rounded];\n", quoted(name));
    for id in plan.order() {
        let node = plan.node(id);
        let (label, shape) = match &node.task {
            Task::Source(_) => (quoted(&node.label), ", shape=note, style=\"\""),
            Task::Step(step) => (format!("{}\\n{}", quoted(&node.label), step.def.name), ""),
            Task::Gate(_) => (quoted(&node.label), ", shape=hexagon, style=\"\""),
        };
        let _ = writeln!(text, "  t{} [label=\"{label}\"{shape}];", id.index());
    }
    for id in plan.order() {
        for (name, input) in plan.inputs(id) {
            let label = if name == "from" { String::new() } else { format!(" [label=\"{name}\"]") };
            let _ = writeln!(text, "  t{} -> t{}{label};", input.index(), id.index());
        }
    }
    for (number, (task, file)) in outputs(plan).enumerate() {
        let _ = writeln!(text, "  o{number} [label=\"{}\", shape=note, style=\"\"];", quoted(&file));
        let _ = writeln!(text, "  t{task} -> o{number};");
    }
    text + "}\n"
}

fn mermaid(plan: &Plan) -> String {
    let mut text = "flowchart LR\n".to_owned();
    for id in plan.order() {
        let node = plan.node(id);
        let label = node.label.replace('"', "'");
        let _ = match &node.task {
            Task::Source(_) => writeln!(text, "  t{}[/\"{label}\"/]", id.index()),
            Task::Step(step) => writeln!(text, "  t{}[\"{label}<br/>{}\"]", id.index(), step.def.name),
            Task::Gate(_) => writeln!(text, "  t{}{{{{\"{label}\"}}}}", id.index()),
        };
    }
    for id in plan.order() {
        for (name, input) in plan.inputs(id) {
            let arrow = if name == "from" { "-->".to_owned() } else { format!("-->|{name}|") };
            let _ = writeln!(text, "  t{} {arrow} t{}", input.index(), id.index());
        }
    }
    for (number, (task, file)) in outputs(plan).enumerate() {
        let _ = writeln!(text, "  t{task} --> o{number}[/\"{}\"/]", file.replace('"', "'"));
    }
    text
}

fn outputs(plan: &Plan) -> impl Iterator<Item = (usize, String)> {
    let cases = plan.cases().iter();
    cases.flat_map(|case| {
        case.outputs.iter().map(|output| {
            let file = std::path::Path::new(&case.name).join(&output.file);
            (output.task.index(), file.display().to_string())
        })
    })
}

fn quoted(text: &str) -> String {
    text.replace('\\', "\\\\").replace('"', "\\\"")
}
