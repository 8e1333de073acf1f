//! The `[outputs]` section: which files are written of which step.

use std::collections::BTreeMap;
use std::path::{Component, Path, PathBuf};

use super::bind::BoundDecl;
use super::case::CaseContext;
use super::gates::is_mesh;
use super::wire::{Producer, Wiring, producer};
use crate::recipe::suggest::did_you_mean;
use crate::recipe::{Diagnostic, Entry, Node, Span, Table, Tree};
use crate::step::Port;

/// The keys of an output table.
pub const OUTPUT_KEYS: [&str; 6] = ["file", "element", "midside-on", "binary", "precision", "first-id"];

/// The shell elements of solver formats.
pub const ELEMENTS: [&str; 4] = ["S3", "S4", "S6", "S8R"];

/// Endings of files that hold a table of metrics.
pub const METRIC_ENDINGS: [&str; 2] = ["json", "ron"];

/// Files that a run writes itself.
const RESERVED: [&str; 2] = ["run.ron", "failed"];

/// A file to write, before its tasks have nodes.
#[derive(Clone, Debug, Default)]
pub(super) struct OutputDecl {
    /// As the recipe names it.
    pub(super) step: String,
    pub(super) producer: Option<Producer>,
    pub(super) file: PathBuf,
    pub(super) element: Option<String>,
    pub(super) midside_on: Option<Producer>,
    pub(super) binary: Option<bool>,
    pub(super) precision: Option<u32>,
    pub(super) first_id: Option<u64>,
}

/// Reads all outputs, in the order they are written.
pub(super) fn outputs<'r>(steps: &[BoundDecl<'r>], wiring: &Wiring, context: &mut CaseContext<'r>) -> Vec<OutputDecl> {
    let mut reader = Reader { steps, wiring, context, taken: BTreeMap::new() };
    let mut outputs = Vec::new();
    let recipe = reader.context.recipe;
    for (name, entry) in recipe.outputs.in_order() {
        let producer = producer(name, entry.key, reader.steps, reader.context);
        let port = producer.and_then(|producer| reader.wiring.port(producer));
        let items = match &entry.value.value {
            Node::List(items) => items.as_slice(),
            _ => std::slice::from_ref(&entry.value),
        };
        for item in items {
            let Some(mut output) = reader.output(name, port, item) else { continue };
            output.producer = producer;
            outputs.push(output);
        }
    }
    outputs
}

struct Reader<'a, 'r> {
    steps: &'a [BoundDecl<'r>],
    wiring: &'a Wiring,
    context: &'a mut CaseContext<'r>,
    /// Files by lower-case name, since some file systems do not tell cases apart.
    taken: BTreeMap<String, Span>,
}

impl Reader<'_, '_> {
    fn problem(&mut self, span: Span, message: impl Into<String>, help: Option<String>) {
        self.context.problems.push(Diagnostic::error(span, message).help_opt(help));
    }

    fn mesh_step(&mut self, name: &str, span: Span) -> Option<Producer> {
        let found = producer(name, span, self.steps, self.context)?;
        if let Some(port) = self.wiring.port(found)
            && !is_mesh(port)
        {
            self.problem(span, format!("`{name}` gives {port}, which is no mesh"), None);
        }
        Some(found)
    }

    fn output(&mut self, step: &str, port: Option<Port>, item: &Tree) -> Option<OutputDecl> {
        let recipe = self.context.recipe;
        let value = self.context.scope.substitute(item, &recipe.sources, &mut self.context.problems)?;
        let mut output = OutputDecl { step: step.to_owned(), ..OutputDecl::default() };
        match &value.value {
            Node::Text(_) => output.file = self.file(step, port, &value)?,
            Node::Table(table) => self.table(step, port, &value, table, &mut output)?,
            other => {
                let message = format!("an output is a file name or a table with `file`, got {}", other.kind());
                self.problem(value.span, message, None);
                return None;
            }
        }
        Some(output)
    }

    fn table(
        &mut self,
        step: &str,
        port: Option<Port>,
        value: &Tree,
        table: &Table,
        output: &mut OutputDecl,
    ) -> Option<()> {
        for (key, entry) in table.in_order() {
            match key {
                "file" => {}
                "element" => output.element = self.element(entry),
                "midside-on" => {
                    output.midside_on = match &entry.value.value {
                        Node::Text(name) => self.mesh_step(name, entry.value.span),
                        other => {
                            let message = format!("`midside-on` names a step, got {}", other.kind());
                            self.problem(entry.value.span, message, None);
                            None
                        }
                    };
                }
                "binary" => match entry.value.value {
                    Node::Bool(binary) => output.binary = Some(binary),
                    _ => self.problem(entry.value.span, "`binary` is true or false", None),
                },
                "precision" => output.precision = self.whole(key, entry, 1.0, 17.0).map(|digits| digits as u32),
                "first-id" => output.first_id = self.whole(key, entry, 1.0, 1e9).map(|id| id as u64),
                _ => {
                    let help = did_you_mean(key, "keys", OUTPUT_KEYS);
                    self.problem(entry.key, format!("an output has no key `{key}`"), help);
                }
            }
        }
        match table.get("file") {
            Some(entry) => output.file = self.file(step, port, &entry.value)?,
            None => self.problem(value.span, "this output does not name its `file`", None),
        }
        self.check_element(step, port, table, output);
        Some(())
    }

    /// An element that the faces or the file cannot have, which would be passed over in silence.
    fn check_element(&mut self, step: &str, port: Option<Port>, table: &Table, output: &OutputDecl) {
        let element = output.element.as_deref();
        let is_second = |name: &str| matches!(name, "S6" | "S8R");
        if let (Some(name), Some(entry)) = (element, table.get("element")) {
            let span = entry.value.span;
            let other = match (port, name) {
                (Some(Port::Surface), "S4") => Some(("triangles", "S3")),
                (Some(Port::Surface), "S8R") => Some(("triangles", "S6")),
                (Some(Port::Quads | Port::Patches), "S3") => Some(("quads", "S4")),
                (Some(Port::Quads | Port::Patches), "S6") => Some(("quads", "S8R")),
                _ => None,
            };
            if let Some((faces, other)) = other {
                let message = format!("the faces of `{step}` are {faces}, which no `{name}` has");
                self.problem(span, message, Some(format!("write element = \"{other}\"")));
            }
            let ending = output.file.extension().map(|ending| ending.to_string_lossy().to_lowercase());
            let ending = ending.unwrap_or_default();
            if is_second(name) && !ending.is_empty() && !self.context.second_order.contains(&ending.as_str()) {
                let message = format!("a file `.{ending}` has no elements with mid-side nodes such as `{name}`");
                let help = format!("formats that have: {}", self.context.second_order.join(", "));
                self.problem(span, message, Some(help));
            }
        }
        // An element that there is not has been reported.
        let is_known = element.is_some() || table.get("element").is_none();
        if let Some(entry) = table.get("midside-on")
            && is_known
            && !element.is_some_and(is_second)
        {
            let message = "`midside-on` places mid-side nodes, and this output has none";
            let help = "write element = \"S6\" for triangles or \"S8R\" for quads, or leave `midside-on` out";
            self.problem(entry.key, message, Some(help.to_owned()));
        }
    }

    fn element(&mut self, entry: &Entry) -> Option<String> {
        if let Node::Text(name) = &entry.value.value {
            if ELEMENTS.contains(&name.as_str()) {
                return Some(name.clone());
            }
            let upper = name.to_uppercase();
            let help = did_you_mean(&upper, "elements", ELEMENTS);
            self.problem(entry.value.span, format!("there is no shell element `{name}`"), help);
        } else {
            let help = did_you_mean("", "elements", ELEMENTS);
            self.problem(entry.value.span, "`element` names a shell element", help);
        }
        None
    }

    fn whole(&mut self, key: &str, entry: &Entry, least: f64, most: f64) -> Option<f64> {
        let number = entry.value.as_number().filter(|n| n.fract() == 0.0 && (least..=most).contains(n));
        if number.is_none() {
            let message = format!("`{key}` is a whole number from {least} to {most}");
            self.problem(entry.value.span, message, None);
        }
        number
    }

    /// The file of an output, which is new, has a known ending and stays in the folder of the outputs.
    fn file(&mut self, step: &str, port: Option<Port>, value: &Tree) -> Option<PathBuf> {
        let Node::Text(template) = &value.value else {
            self.problem(value.span, format!("`file` is a file name, got {}", value.value.kind()), None);
            return None;
        };
        let name = self.fill(template, step, value.span)?;
        let path = Path::new(&name);
        let plain = path.components().all(|part| matches!(part, Component::Normal(_) | Component::CurDir));
        let odd = name.chars().any(|c| c.is_control() || "\\:*?\"<>|".contains(c));
        if name.is_empty() || !plain || odd || name.len() > 200 {
            let message = format!("`{name}` is not a file name below the folder of the outputs");
            let help = "no absolute path, no `..`; `--out` moves the folder";
            self.problem(value.span, message, Some(help.to_owned()));
            return None;
        }
        if !self.ending_fits(path, &name, port, value.span) {
            return None;
        }
        let first = path.components().find(|part| *part != Component::CurDir);
        if first.is_some_and(|part| RESERVED.iter().any(|name| part.as_os_str() == *name)) {
            self.problem(value.span, format!("`{name}` is kept for what a run writes itself"), None);
            return None;
        }
        let file: PathBuf = path.components().filter(|part| *part != Component::CurDir).collect();
        self.check_folders(&file, &name, value.span);
        if let Some(earlier) = self.taken.insert(lower(&file), value.span) {
            let problem = Diagnostic::error(value.span, format!("two outputs write the file `{name}`"))
                .note("written again here")
                .label(earlier, "first written here")
                .help("give each output its own name; `{step}` in a name stands for the step");
            self.context.problems.push(problem);
            return None;
        }
        Some(file)
    }

    /// A file cannot be the folder of another one.
    fn check_folders(&mut self, file: &Path, name: &str, span: Span) {
        let above = file.ancestors().skip(1).find_map(|folder| self.taken.get(&lower(folder)));
        // What lies in a folder of this name sorts right behind the name with its slash.
        let inside = format!("{}/", lower(file));
        let below = || self.taken.range(inside.clone()..).next().filter(|(other, _)| other.starts_with(&inside));
        let Some(earlier) = above.copied().or_else(|| below().map(|(_, span)| *span)) else {
            return;
        };
        let problem = Diagnostic::error(span, format!("`{name}` would be a file and a folder at once"))
            .label(earlier, "the other output is here");
        self.context.problems.push(problem);
    }

    /// Whether the ending names a format that what the step gives can be written in.
    fn ending_fits(&mut self, path: &Path, name: &str, port: Option<Port>, span: Span) -> bool {
        let ending = path.extension().map(|ending| ending.to_string_lossy().to_lowercase()).unwrap_or_default();
        let table = METRIC_ENDINGS.contains(&ending.as_str());
        // Patches go to JSON as they are, to a mesh file as their tessellation.
        if port == Some(Port::Patches) && ending == "json" {
            return true;
        }
        if !self.context.endings.contains(&ending.as_str()) {
            let help = did_you_mean(&ending, "endings", self.context.endings.iter().copied());
            self.problem(span, format!("`{name}` has no ending of a format that can be written"), help);
            return false;
        }
        let Some(port) = port.filter(|port| is_mesh(*port) == table) else { return true };
        let help = format!("meshes go to mesh files, metrics to files that end in {}", METRIC_ENDINGS.join(" or "));
        self.problem(span, format!("{port} cannot be written to `{name}`"), Some(help));
        false
    }

    /// Puts parameters, the recipe's name and the step's name into a template.
    fn fill(&mut self, template: &str, step: &str, span: Span) -> Option<String> {
        let mut name = String::new();
        let mut rest = template;
        while let Some(open) = rest.find('{') {
            name.push_str(&rest[..open]);
            let Some(length) = rest[open..].find('}') else {
                self.problem(span, format!("`{template}` has a `{{` without `}}`"), None);
                return None;
            };
            let variable = &rest[open + 1..open + length];
            match variable {
                "step" => name.push_str(step),
                "name" => name.push_str(&self.context.recipe.name),
                _ => name.push_str(&self.param(variable, span)?),
            }
            rest = &rest[open + length + 1..];
        }
        name.push_str(rest);
        Some(name)
    }

    fn param(&mut self, variable: &str, span: Span) -> Option<String> {
        if let Some(known) = self.context.scope.params.get(variable) {
            // A parameter without a value has been reported.
            return known.as_ref().map(|value| value.to_string().replace('%', "pct"));
        }
        let params = self.context.scope.params.keys().map(String::as_str);
        let help = did_you_mean(variable, "names", params.chain(["step", "name"]));
        self.problem(span, format!("there is no parameter `{variable}` to put into the file name"), help);
        None
    }
}

/// A file's name as file systems that do not tell cases apart see it, with slashes everywhere.
fn lower(file: &Path) -> String {
    let parts: Vec<String> = file.iter().map(|part| part.to_string_lossy().to_lowercase()).collect();
    parts.join("/")
}
