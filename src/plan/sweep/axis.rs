//! One axis of a sweep: a parameter or an input, and the values it takes.
//!
//! ```toml
//! [sweep.axes]
//! size = ["1%", "2%", "4%"]                                           # a list
//! tolerance = { from = "0.05%", to = "0.4%", count = 4, scale = "log" }  # a range
//! inputs.part = { glob = "../scans/*.stl" }                           # the files that are there
//! ```

use std::path::PathBuf;

use super::{LARGEST, Reader};
use crate::recipe::suggest::did_you_mean;
use crate::recipe::{Diagnostic, Entry, Node, Span, Table, Tree, Value, is_full, node_of};

/// The keys of a range.
pub(super) const RANGE_KEYS: [&str; 4] = ["from", "to", "count", "scale"];

/// A parameter or input that varies.
#[derive(Clone, Debug)]
pub(super) struct Axis {
    /// As cases name it: a parameter, or `inputs.NAME`.
    pub(super) name: String,
    pub(super) span: Span,
    pub(super) values: Values,
}

/// The values of an axis.
#[derive(Clone, Debug)]
pub(super) enum Values {
    /// These, in this order.
    Listed(Vec<Tree>),
    /// Everything between two numbers; so many of them where they are counted.
    Range(Range),
}

/// Numbers or percents from one to another.
#[derive(Clone, Copy, Debug)]
pub(super) struct Range {
    pub(super) from: f64,
    pub(super) to: f64,
    pub(super) percent: bool,
    pub(super) log: bool,
    pub(super) count: Option<usize>,
    pub(super) span: Span,
}

impl Range {
    /// The value at a part of the way, 0 to 1, with so many significant digits that it is written shortly.
    pub(super) fn at(&self, part: f64, digits: usize) -> Tree {
        let value = if part <= 0.0 {
            self.from
        } else if part >= 1.0 {
            self.to
        } else if self.log {
            let (from, to) = (libm::log(self.from), libm::log(self.to));
            rounded(libm::exp(from + part * (to - from)), digits)
        } else {
            rounded(self.from + part * (self.to - self.from), digits)
        };
        Tree {
            span: self.span,
            value: node_of(if self.percent { Value::Percent(value) } else { Value::Number(value) }),
        }
    }

    fn counted(&self, count: usize) -> Vec<Tree> {
        let last = count.saturating_sub(1).max(1) as f64;
        (0..count).map(|index| self.at(index as f64 / last, 12)).collect()
    }
}

/// A number with so many significant digits.
fn rounded(value: f64, digits: usize) -> f64 {
    format!("{value:.*e}", digits - 1).parse().unwrap_or(value)
}

impl Axis {
    /// How many values a grid takes; `None` for a range that is not counted.
    pub(super) fn len(&self) -> Option<usize> {
        match &self.values {
            Values::Listed(values) => Some(values.len()),
            Values::Range(range) => range.count,
        }
    }

    /// The values that a grid takes.
    pub(super) fn listed(&self) -> Vec<Tree> {
        match &self.values {
            Values::Listed(values) => values.clone(),
            Values::Range(range) => range.counted(range.count.unwrap_or(0)),
        }
    }

    /// The value at a part of the way, 0 to less than 1: in a list, the one whose share of the way it lies in.
    pub(super) fn sampled(&self, part: f64) -> Option<Tree> {
        match &self.values {
            Values::Listed(values) => {
                let index = (part * values.len() as f64) as usize;
                values.get(index.min(values.len().saturating_sub(1))).cloned()
            }
            Values::Range(range) => Some(range.at(part, 6)),
        }
    }
}

impl Reader<'_> {
    /// All axes, in the order they are written.
    pub(super) fn axes(&mut self, table: &Table) -> Vec<Axis> {
        let mut axes = Vec::new();
        for (name, entry) in table.in_order() {
            if name == "inputs"
                && let Node::Table(inputs) = &entry.value.value
            {
                for (name, entry) in inputs.in_order() {
                    axes.extend(self.axis(&format!("inputs.{name}"), entry));
                }
            } else {
                axes.extend(self.axis(name, entry));
            }
        }
        axes
    }

    /// What a name in a sweep means: itself for a parameter, `inputs.NAME` for an input; nothing where there are
    /// enough problems already.
    pub(super) fn target(&mut self, name: &str, span: Span) -> Option<String> {
        if is_full(&self.problems) {
            return None;
        }
        let recipe = self.recipe;
        let input = name.strip_prefix("inputs.");
        if input.is_none() && recipe.params.get(name).is_some() {
            return Some(name.to_owned());
        }
        if recipe.inputs.get(input.unwrap_or(name)).is_some() {
            return Some(format!("inputs.{}", input.unwrap_or(name)));
        }
        let names = recipe.params.entries.keys().chain(recipe.inputs.entries.keys()).map(String::as_str);
        let help = did_you_mean(input.unwrap_or(name), "there are", names);
        self.problem(Diagnostic::error(span, format!("the recipe has no parameter or input `{name}`")).help_opt(help));
        None
    }

    fn axis(&mut self, name: &str, entry: &Entry) -> Option<Axis> {
        let name = self.target(name, entry.key)?;
        let is_input = name.starts_with("inputs.");
        let span = entry.value.span;
        let values = match &entry.value.value {
            Node::List(items) if is_input => Values::Listed(self.files(items)?),
            Node::List(items) => Values::Listed(self.scalars(items)?),
            Node::Table(table) if table.get("glob").is_some() => Values::Listed(self.glob(&name, table)?),
            Node::Table(table) if !is_input => Values::Range(self.range(table, span)?),
            Node::Text(_) if is_input => Values::Listed(self.files(std::slice::from_ref(&entry.value))?),
            other => {
                let message = format!("an axis is a list of values or a table, got {}", other.kind());
                let help = if is_input {
                    "write [\"a.stl\", \"b.stl\"] or { glob = \"parts/*.stl\" }"
                } else {
                    "write [1, 2, 4] or { from = 1, to = 4, count = 3 }"
                };
                self.problem(Diagnostic::error(span, message).help(help));
                return None;
            }
        };
        if matches!(&values, Values::Listed(values) if values.is_empty()) {
            self.problem(Diagnostic::error(span, format!("the axis `{name}` has no value")));
            return None;
        }
        Some(Axis { name, span, values })
    }

    fn scalars(&mut self, items: &[Tree]) -> Option<Vec<Tree>> {
        let mut whole = true;
        for item in items {
            if matches!(item.value, Node::List(_) | Node::Table(_) | Node::Date(_) | Node::File(_)) {
                let message =
                    format!("a parameter is a number, a percent, a bool or a string, not {}", item.value.kind());
                self.problem(Diagnostic::error(item.span, message));
                whole = false;
            }
        }
        whole.then(|| items.to_vec())
    }

    /// Files by name; a name with `*`, `?` or `[` stands for those that are there.
    fn files(&mut self, items: &[Tree]) -> Option<Vec<Tree>> {
        let mut files = Vec::new();
        for item in items {
            let Node::Text(name) = &item.value else {
                let message = format!("an input is the name of a file, got {}", item.value.kind());
                self.problem(Diagnostic::error(item.span, message));
                return None;
            };
            let found = if name.contains(['*', '?', '[']) {
                self.matching(name, item.span)?
            } else {
                vec![self.recipe.sources.folder(item.span).join(name)]
            };
            files.extend(found.into_iter().map(|path| Tree { span: item.span, value: Node::File(path) }));
        }
        Some(files)
    }

    fn glob(&mut self, name: &str, table: &Table) -> Option<Vec<Tree>> {
        self.known_keys(table, "a glob", &["glob"]);
        let entry = table.get("glob")?;
        if !name.starts_with("inputs.") {
            let message = format!("`glob` names files, and `{name}` is a parameter, not an input");
            self.problem(Diagnostic::error(entry.key, message));
            return None;
        }
        let Node::Text(pattern) = &entry.value.value else {
            let message = format!("`glob` is a string, got {}", entry.value.value.kind());
            self.problem(Diagnostic::error(entry.value.span, message));
            return None;
        };
        let files = self.matching(pattern, entry.value.span)?;
        Some(files.into_iter().map(|path| Tree { span: entry.value.span, value: Node::File(path) }).collect())
    }

    /// The files that a pattern names, sorted. It must name some.
    fn matching(&mut self, pattern: &str, span: Span) -> Option<Vec<PathBuf>> {
        let problem = |message: String, help: &str| Diagnostic::error(span, message).help(help);
        if pattern.contains("**") {
            let help = "name the folders: `parts/*/*.stl`";
            self.problem(problem("`**` would search whole trees of folders".to_owned(), help));
            return None;
        }
        // What the folder is called is no pattern.
        let folder = self.recipe.sources.folder(span);
        self.lists_files = true;
        let found = match (self.list)(folder, pattern, LARGEST) {
            Ok(found) => found,
            Err(reason) => {
                self.problem(problem(
                    format!("cannot list `{pattern}`: {reason}"),
                    "`*` and `?` stand for any letters",
                ));
                return None;
            }
        };
        if found.is_empty() {
            let help = "a pattern is relative to the recipe that writes it, and `-s` to the working folder";
            self.problem(problem(format!("no file is called `{pattern}` in `{}`", shown(folder)), help));
            return None;
        }
        if found.len() >= LARGEST {
            self.problem(problem(format!("`{pattern}` names {LARGEST} files or more"), "use a narrower pattern"));
            return None;
        }
        Some(found)
    }

    /// Reads `{ from, to, count, scale }`.
    pub(super) fn range(&mut self, table: &Table, span: Span) -> Option<Range> {
        self.known_keys(table, "a range", &RANGE_KEYS);
        let (from, percent) = self.bound(table, "from", span)?;
        let (to, other) = self.bound(table, "to", span)?;
        if percent != other {
            self.problem(Diagnostic::error(
                span,
                "a range goes from a number to a number or from a percent to a percent",
            ));
            return None;
        }
        let log = match table.get("scale").map(|entry| (&entry.value.value, entry.value.span)) {
            None => false,
            Some((Node::Text(scale), _)) if scale == "linear" => false,
            Some((Node::Text(scale), _)) if scale == "log" => true,
            Some((_, at)) => {
                self.problem(Diagnostic::error(at, "`scale` is \"linear\" or \"log\""));
                return None;
            }
        };
        if log && (from <= 0.0 || to <= 0.0) {
            self.problem(Diagnostic::error(span, "a logarithmic range has bounds above 0"));
            return None;
        }
        let count = match table.get("count") {
            None => None,
            Some(entry) => Some(self.count("count", entry, if from == to { 1 } else { 2 })?),
        };
        Some(Range { from, to, percent, log, count, span })
    }

    /// A bound of a range, and whether it is a percent.
    fn bound(&mut self, table: &Table, key: &str, span: Span) -> Option<(f64, bool)> {
        let Some(entry) = table.get(key) else {
            self.problem(Diagnostic::error(span, format!("a range says where it begins and ends; `{key}` is missing")));
            return None;
        };
        let value = match &entry.value.value {
            Node::Number(_) => entry.value.as_number().map(|number| (number, false)),
            Node::Text(text) => {
                text.strip_suffix('%').and_then(|text| text.trim().parse().ok()).map(|value: f64| (value, true))
            }
            _ => None,
        };
        let value = value.filter(|(value, _)| value.is_finite());
        if value.is_none() {
            let message = format!("`{key}` is a number or a percent such as \"2%\", got {}", entry.value.value.kind());
            self.problem(Diagnostic::error(entry.value.span, message));
        }
        value
    }
}

fn shown(folder: &std::path::Path) -> String {
    if folder.as_os_str().is_empty() { ".".to_owned() } else { folder.display().to_string() }
}
