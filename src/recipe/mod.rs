//! From the text of a recipe to its parts, with every value's place kept for messages.
//!
//! Nothing here opens a file, knows a step or runs anything: texts come from a loader, and what a step makes of its
//! table is for the plan to check.

mod argument;
mod circle;
pub mod diagnostic;
mod drop;
pub mod expression;
mod load;
pub mod scope;
pub mod source;
pub mod suggest;
#[cfg(test)]
mod tests;
pub mod tree;
mod unused;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

pub use circle::{Order, order};
pub use diagnostic::{Diagnostic, Diagnostics, Label, Severity, is_full};
pub use expression::Value;
pub use load::{LARGEST, Loader, normalize};
pub use scope::{Scope, node as node_of};
pub use source::{SourceMap, Span};
use suggest::did_you_mean;
pub use tree::{Entry, Node, Table, Tree};
pub use unused::names_used;

/// The sections of a recipe.
const SECTIONS: [&str; 12] = [
    "name",
    "description",
    "inputs",
    "params",
    "steps",
    "gates",
    "criteria",
    "limits",
    "outputs",
    "sweep",
    "extends",
    "drop",
];

/// What the command line replaces.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Overrides {
    /// `--set NAME=VALUE`.
    pub set: Vec<(String, String)>,
    /// `--input NAME=FILE`, relative to the working directory.
    pub inputs: Vec<(String, PathBuf)>,
    /// `-s NAME=VALUES`: axes of a sweep.
    pub axes: Vec<(String, String)>,
}

/// A node of the recipe's graph, as written.
#[derive(Clone, Debug)]
pub struct StepDecl {
    /// Its name.
    pub name: String,
    /// Where the name is written.
    pub place: Span,
    /// The kind of step, `use`.
    pub kind: String,
    /// Where the kind is written.
    pub kind_place: Span,
    /// Everything else.
    pub table: Table,
}

/// Reads a file of criteria with `loader`, and the files that it extends: its table, and the texts. `set` replaces
/// parameters that it has.
///
/// # Errors
/// When a text cannot be read or is not TOML, or does not extend what it says.
pub fn load_criteria(
    path: &Path,
    loader: Loader<'_>,
    set: &[(String, String)],
) -> Result<(Table, Arc<SourceMap>), Diagnostics> {
    let (mut sources, mut problems) = (SourceMap::default(), Vec::new());
    let mut table = load::load_criteria(path, loader, &mut sources, &mut problems);
    for (name, text) in set {
        let base = sources.add("--set", "", format!("{name}={text}"));
        let start = base + name.len() + 1;
        let params =
            table.as_mut().and_then(|table| table.entries.get_mut("params")).map(|entry| &mut entry.value.value);
        if let Some(Node::Table(params)) = params
            && let Some(entry) = params.entries.get_mut(name)
        {
            entry.value = Tree { span: Span { start, end: start + text.len() }, value: argument::value(text) };
        }
    }
    match table {
        Some(table) if problems.is_empty() => Ok((table, Arc::new(sources))),
        _ => Err(Diagnostics::new(Arc::new(sources), problems)),
    }
}

/// A recipe whose sections have the right form.
#[derive(Clone, Debug)]
pub struct Recipe {
    /// The texts.
    pub sources: Arc<SourceMap>,
    /// The file.
    pub path: PathBuf,
    /// Its name, fit for a folder.
    pub name: String,
    /// What it is for.
    pub description: String,
    /// Input files; the value is a text or, from the command line, a file.
    pub inputs: Table,
    /// Parameters, not yet evaluated.
    pub params: Table,
    /// Steps in the order they are written.
    pub steps: Vec<StepDecl>,
    /// Gates by step.
    pub gates: Table,
    /// Criteria by name, with what their files say below what the recipe says.
    pub criteria: Table,
    /// How long steps may take.
    pub limits: Table,
    /// Outputs by step.
    pub outputs: Table,
    /// The `[sweep]` section as it is.
    pub sweep: Table,
    /// What is wrong so far; a plan of the recipe adds its own and fails with all of them.
    pub problems: Vec<Diagnostic>,
}

impl Recipe {
    /// Reads the recipe at `path` with `loader`, and lays the overrides on it.
    ///
    /// # Errors
    /// When there is no tree to look at: a text cannot be read, or is not TOML. Other problems are in
    /// [`Recipe::problems`], so that they are reported together with those of the plan.
    pub fn load(path: &Path, loader: Loader<'_>, overrides: &Overrides) -> Result<Self, Diagnostics> {
        let (mut sources, mut problems) = (SourceMap::default(), Vec::new());
        let Some(root) = load::load(path, loader, &mut sources, &mut problems) else {
            return Err(Diagnostics::new(Arc::new(sources), problems));
        };
        let mut parts = Parts { root, problems };
        let name = match parts.text("name") {
            Some((name, span)) => parts.folder_name(name, span),
            None => default_name(path),
        };
        let mut recipe = Self {
            path: path.to_path_buf(),
            name,
            description: parts.text("description").map(|(text, _)| text).unwrap_or_default(),
            inputs: parts.table("inputs"),
            params: parts.table("params"),
            steps: parts.steps(),
            gates: parts.table("gates"),
            criteria: parts.table("criteria"),
            limits: parts.table("limits"),
            outputs: parts.table("outputs"),
            sweep: parts.table("sweep"),
            sources: Arc::default(),
            problems: Vec::new(),
        };
        parts.leftover();
        recipe.problems = parts.problems;
        recipe.check_names();
        recipe.lay_on(overrides, &mut sources);
        for (name, text) in &overrides.axes {
            argument::lay_axis(&mut recipe, name, text, &mut sources);
        }
        recipe.sources = Arc::new(sources);
        Ok(recipe)
    }

    /// The values of parameters and inputs, where `varied` replaces some: parameters by name, inputs as `inputs.NAME`.
    /// Problems are added to `problems`.
    pub fn scope(&self, varied: &[(String, Tree)], problems: &mut Vec<Diagnostic>) -> Scope {
        let mut params = self.params.clone();
        let mut files: BTreeMap<&str, Option<PathBuf>> = BTreeMap::new();
        for (name, value) in varied {
            if let Some(input) = name.strip_prefix("inputs.").filter(|input| self.inputs.get(input).is_some()) {
                files.insert(input, self.file(value));
                continue;
            }
            match params.entries.get_mut(name) {
                Some(entry) => entry.value = value.clone(),
                None => problems.push(unknown("parameter", "parameters", name, value.span, &self.params)),
            }
        }
        let input = |(name, entry): (&String, &Entry)| {
            let path = files.remove(name.as_str()).unwrap_or_else(|| self.file(&entry.value));
            (name.clone(), path)
        };
        let inputs: BTreeMap<_, _> = self.inputs.entries.iter().map(input).collect();
        let mut scope = Scope::new(&params, inputs, &self.sources, problems);
        let is_foreign = |name: &str, span: Span| {
            let own = self.params.get(name).map(|entry| entry.value.span);
            own != Some(span) || self.sources.file(span).is_some_and(|file| file.name.starts_with("--"))
        };
        let places = params.entries.iter().map(|(name, entry)| (name.clone(), entry.value.span));
        scope.origins = places.filter(|(name, span)| is_foreign(name, *span)).collect();
        scope
    }

    /// The path of a file that a value names, as it is opened; `None` when the value is no text.
    pub fn file(&self, value: &Tree) -> Option<PathBuf> {
        match &value.value {
            Node::File(path) => Some(path.clone()),
            Node::Text(text) => Some(self.sources.folder(value.span).join(text)),
            Node::Number(_) | Node::Bool(_) | Node::Date(_) | Node::List(_) | Node::Table(_) => None,
        }
    }

    /// One problem for each parameter that nothing uses. Only a recipe that is right otherwise can tell.
    pub fn unused(&self) -> Vec<Diagnostic> {
        unused::unused(self)
    }

    /// The step of this name.
    pub fn step(&self, name: &str) -> Option<&StepDecl> {
        self.steps.iter().find(|step| step.name == name)
    }

    fn check_names(&mut self) {
        for (name, entry) in self.inputs.in_order() {
            if !matches!(entry.value.value, Node::Text(_)) {
                let message = format!("the input `{name}` is {}, not the name of a file", entry.value.value.kind());
                self.problems.push(Diagnostic::error(entry.value.span, message));
            }
        }
        let names = self.params.in_order().into_iter().chain(self.inputs.in_order());
        for (name, entry) in names {
            let reserved = ["true", "false", "inputs"].contains(&name);
            if !is_name(name) || reserved {
                let message = format!("`{name}` cannot be the name of a parameter or input");
                let help = "a name begins with a letter and goes on with letters, digits, `-` and `_`";
                let help = if reserved { "the name has a meaning in expressions" } else { help };
                self.problems.push(Diagnostic::error(entry.key, message).help(help));
            }
        }
    }

    fn lay_on(&mut self, overrides: &Overrides, sources: &mut SourceMap) {
        for (name, text) in &overrides.set {
            let base = sources.add("--set", "", format!("{name}={text}"));
            let key = Span { start: base, end: base + name.len() };
            let span = Span { start: key.end + 1, end: key.end + 1 + text.len() };
            if let Some(entry) = self.params.entries.get_mut(name) {
                entry.value = Tree { span, value: argument::value(text) };
                continue;
            }
            let mut problem = unknown("parameter", "parameters", name, key, &self.params);
            if self.inputs.get(name).is_some() {
                problem = problem.help(format!("it is an input: write `--input {name}={text}`"));
            }
            self.problems.push(problem);
        }
        for (name, path) in &overrides.inputs {
            let shown = path.display().to_string();
            let base = sources.add("--input", "", format!("{name}={shown}"));
            let key = Span { start: base, end: base + name.len() };
            let span = Span { start: key.end + 1, end: key.end + 1 + shown.len() };
            match self.inputs.entries.get_mut(name) {
                Some(entry) => entry.value = Tree { span, value: Node::File(path.clone()) },
                None => self.problems.push(unknown("input", "inputs", name, key, &self.inputs)),
            }
        }
    }
}

fn unknown(what: &str, choices: &str, name: &str, span: Span, table: &Table) -> Diagnostic {
    let help = did_you_mean(name, choices, table.entries.keys().map(String::as_str))
        .unwrap_or_else(|| format!("the recipe has no {choices}"));
    Diagnostic::error(span, format!("the recipe has no {what} `{name}`")).help(help)
}

/// Letters, digits, minus and underline, beginning with a letter.
fn is_name(name: &str) -> bool {
    name.chars().next().is_some_and(char::is_alphabetic)
        && name.len() <= 100
        && name.chars().all(|c| c.is_alphanumeric() || c == '-' || c == '_')
        && !name.ends_with('-')
        && !name.contains("--")
}

fn default_name(path: &Path) -> String {
    path.file_stem().map_or_else(|| "recipe".to_owned(), |stem| stem.to_string_lossy().into_owned())
}

/// The sections while they are taken apart.
struct Parts {
    root: Table,
    problems: Vec<Diagnostic>,
}

impl Parts {
    fn text(&mut self, key: &str) -> Option<(String, Span)> {
        let entry = self.root.take(key)?;
        match entry.value.value {
            Node::Text(text) => Some((text, entry.value.span)),
            other => {
                let message = format!("`{key}` is a string, got {}", other.kind());
                self.problems.push(Diagnostic::error(entry.value.span, message));
                None
            }
        }
    }

    fn folder_name(&mut self, name: String, span: Span) -> String {
        if is_name(&name) {
            return name;
        }
        let help = "a name begins with a letter and goes on with letters, digits, `-` and `_`";
        self.problems.push(Diagnostic::error(span, "this name cannot be the name of a folder").help(help));
        "recipe".to_owned()
    }

    fn table(&mut self, key: &str) -> Table {
        match self.root.take(key) {
            None => Table::default(),
            Some(Entry { value: Tree { value: Node::Table(table), .. }, .. }) => table,
            Some(entry) => {
                let message = format!("`{key}` is a section, got {}", entry.value.value.kind());
                self.problems.push(Diagnostic::error(entry.value.span, message).help(format!("write [{key}]")));
                Table::default()
            }
        }
    }

    fn steps(&mut self) -> Vec<StepDecl> {
        let mut steps: Vec<StepDecl> = Vec::new();
        for (name, entry) in self.table("steps").entries {
            match step(name, entry) {
                Ok(step) => steps.push(step),
                Err(problem) => self.problems.push(problem),
            }
        }
        steps.sort_by_key(|step| step.place.start);
        steps
    }

    fn leftover(&mut self) {
        for (key, entry) in self.root.in_order() {
            if is_full(&self.problems) {
                break;
            }
            let help = did_you_mean(key, "sections", SECTIONS);
            let problem = Diagnostic::error(entry.key, format!("a recipe has no section `{key}`")).help_opt(help);
            self.problems.push(problem);
        }
    }
}

/// A step's table taken apart.
fn step(name: String, entry: Entry) -> Result<StepDecl, Diagnostic> {
    let place = entry.key;
    if !is_name(&name) {
        let help = "a name begins with a letter and goes on with letters, digits, `-` and `_`";
        return Err(Diagnostic::error(place, format!("`{name}` cannot be the name of a step")).help(help));
    }
    let kind = entry.value.value.kind();
    let Node::Table(mut table) = entry.value.value else {
        return Err(Diagnostic::error(entry.value.span, format!("the step `{name}` is a table, got {kind}")));
    };
    let Some(kind) = table.take("use") else {
        let help = "write use = \"repair\"; `meshmill steps` lists the kinds";
        return Err(Diagnostic::error(place, format!("the step `{name}` does not say what it is")).help(help));
    };
    match kind.value.value {
        Node::Text(text) => Ok(StepDecl { name, place, kind: text, kind_place: kind.value.span, table }),
        other => Err(Diagnostic::error(kind.value.span, format!("`use` names a kind of step, got {}", other.kind()))),
    }
}
