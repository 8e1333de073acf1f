//! A plan as a picture: Graphviz DOT and Mermaid, tasks in plan order.

use std::fmt::Write;

use super::{Node, Plan, Task, TaskId};

/// How a node looks.
struct Shape {
    dot: &'static str,
    open: &'static str,
    close: &'static str,
}

fn shape(task: &Task) -> Shape {
    match task {
        Task::Source(_) => Shape { dot: "note", open: "[/", close: "/]" },
        Task::Step(_) => Shape { dot: "box", open: "[", close: "]" },
        Task::Gate(_) => Shape { dot: "diamond", open: "{{", close: "}}" },
    }
}

/// The lines of a node: what it is called, and what it does.
fn lines(node: &Node) -> Vec<String> {
    match &node.task {
        Task::Source(_) => vec![node.label.clone()],
        Task::Step(step) => vec![node.label.clone(), step.def.name.to_owned()],
        Task::Gate(gate) => {
            let metrics = gate.checks.iter().map(|check| check.metric.clone());
            std::iter::once(node.label.clone()).chain(metrics).collect()
        }
    }
}

/// The edges with the input's name, which is left out where there is only one input.
fn edges(plan: &Plan) -> Vec<(TaskId, TaskId, Option<&'static str>)> {
    let mut edges = Vec::new();
    for id in plan.order() {
        let inputs = plan.inputs(id);
        let single = inputs.len() == 1;
        edges.extend(inputs.into_iter().map(|(name, input)| (input, id, (!single).then_some(name))));
    }
    edges
}

/// Files that the cases write, as `case/file`, with their tasks.
fn written(plan: &Plan) -> Vec<(TaskId, String)> {
    let mut files = Vec::new();
    for case in plan.cases() {
        for output in &case.outputs {
            let file = output.file.display().to_string().replace('\\', "/");
            let name = if case.name.is_empty() { file } else { format!("{}/{file}", case.name) };
            files.push((output.task, name));
        }
    }
    files
}

/// The plan for Graphviz.
pub fn dot(plan: &Plan) -> String {
    let quote = |text: &str| text.replace('\\', "\\\\").replace('"', "\\\"");
    let mut text = String::from("digraph plan {\n  rankdir = LR;\n  node [fontname = \"sans-serif\"];\n");
    for id in plan.order() {
        let node = plan.node(id);
        let label = lines(node).iter().map(|line| quote(line)).collect::<Vec<_>>().join("\\n");
        let _ = writeln!(text, "  t{} [shape = {}, label = \"{label}\"];", id.index(), shape(&node.task).dot);
    }
    for (from, to, name) in edges(plan) {
        let label = name.map(|name| format!(" [label = \"{name}\"]")).unwrap_or_default();
        let _ = writeln!(text, "  t{} -> t{}{label};", from.index(), to.index());
    }
    for (index, (task, file)) in written(plan).iter().enumerate() {
        let _ = writeln!(text, "  o{index} [shape = note, style = dashed, label = \"{}\"];", quote(file));
        let _ = writeln!(text, "  t{} -> o{index} [style = dashed];", task.index());
    }
    text.push_str("}\n");
    text
}

/// The plan for Mermaid.
pub fn mermaid(plan: &Plan) -> String {
    let quote = |text: &str| text.replace('&', "&amp;").replace('"', "&quot;").replace('<', "&lt;");
    let mut text = String::from("flowchart LR\n");
    for id in plan.order() {
        let node = plan.node(id);
        let label = lines(node).iter().map(|line| quote(line)).collect::<Vec<_>>().join("<br/>");
        let Shape { open, close, .. } = shape(&node.task);
        let _ = writeln!(text, "  t{}{open}\"{label}\"{close}", id.index());
    }
    for (from, to, name) in edges(plan) {
        let arrow = name.map_or_else(|| "-->".to_owned(), |name| format!("-- {name} -->"));
        let _ = writeln!(text, "  t{} {arrow} t{}", from.index(), to.index());
    }
    for (index, (task, file)) in written(plan).iter().enumerate() {
        let _ = writeln!(text, "  o{index}[/\"{}\"/]", quote(file));
        let _ = writeln!(text, "  t{} -.-> o{index}", task.index());
    }
    text
}
