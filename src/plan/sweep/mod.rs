//! The `[sweep]` section: which cases a parameter study has, and what is measured of each.
//!
//! ```toml
//! [sweep]
//! columns = ["fe.faces", { metric = "distance", of = "fe", to = "clean" }]
//! zip = [["size", "tolerance"]]     # these axes advance together
//!
//! [sweep.axes]
//! size = ["1%", "2%", "4%"]
//! tolerance = { from = "0.1%", to = "0.4%", count = 3, scale = "log" }
//!
//! [sweep.sample]                    # points of the axes' ranges in the place of their grid
//! method = "latin-hypercube"
//! n = 20
//! seed = 1
//!
//! [[sweep.case]]                    # and cases of their own
//! name = "coarse"
//! size = "8%"
//! ```
//!
//! # Invariants
//! - The cases and their order depend on the recipe, the command line and the names of files that globs find only.
//! - The first axis varies slowest, so that what it decides is shared by cases that follow each other.
//! - No sweep has more than [`LARGEST`] cases; their number is computed before any is made.

mod axis;
mod name;
mod sample;
#[cfg(test)]
mod tests;

use std::path::{Path, PathBuf};

use axis::{Axis, Values};
use name::Names;

use super::case::CaseSpec;
use super::columns::ColumnRequest;
use crate::recipe::suggest::did_you_mean;
use crate::recipe::{Diagnostic, Diagnostics, Entry, Node, Recipe, Span, Table, Tree, is_full};

/// The keys of the section.
pub const SWEEP_KEYS: [&str; 5] = ["axes", "zip", "case", "sample", "columns"];

/// The keys of a sample.
pub const SAMPLE_KEYS: [&str; 3] = ["method", "n", "seed"];

/// Most cases of a sweep, and most files of a glob.
pub const LARGEST: usize = 10_000;

/// Lists the files below a folder that fit a pattern, sorted, at most so many.
pub type Lister<'a> = &'a dyn Fn(&Path, &str, usize) -> Result<Vec<PathBuf>, String>;

/// The cases of a sweep.
#[derive(Clone, Debug, Default)]
pub struct Sweep {
    /// What varies: parameters, and inputs as `inputs.NAME`, in the order of the axes.
    pub varied: Vec<String>,
    /// The cases, each with a name of its own.
    pub cases: Vec<CaseSpec>,
    /// What is measured of each.
    pub columns: Vec<ColumnRequest>,
    /// Whether a pattern decided which files there are.
    pub lists_files: bool,
}

/// Whether the recipe or the command line says anything about a sweep.
pub fn has_sweep(recipe: &Recipe) -> bool {
    !recipe.sweep.entries.is_empty()
}

/// Reads the section.
///
/// # Errors
/// Everything that is wrong with it and with the form of the recipe, at once.
pub fn sweep(recipe: &Recipe, list: Lister<'_>) -> Result<Sweep, Diagnostics> {
    let mut reader = Reader { recipe, list, lists_files: false, problems: recipe.problems.clone() };
    let sweep = reader.sweep();
    match sweep {
        Some(sweep) if reader.problems.is_empty() => Ok(sweep),
        _ => Err(Diagnostics::new(std::sync::Arc::clone(&recipe.sources), reader.problems)),
    }
}

/// The section while it is taken apart.
pub(super) struct Reader<'a> {
    recipe: &'a Recipe,
    list: Lister<'a>,
    lists_files: bool,
    problems: Vec<Diagnostic>,
}

/// Axes that advance together, often a single one.
type Dimension = Vec<Axis>;

impl<'a> Reader<'a> {
    fn problem(&mut self, problem: Diagnostic) {
        self.problems.push(problem);
    }

    fn known_keys(&mut self, table: &Table, what: &str, keys: &[&str]) {
        for (key, entry) in table.in_order() {
            if !keys.contains(&key) && !is_full(&self.problems) {
                let help = did_you_mean(key, "keys", keys.iter().copied());
                self.problem(Diagnostic::error(entry.key, format!("{what} has no key `{key}`")).help_opt(help));
            }
        }
    }

    /// A whole number from `least` to [`LARGEST`].
    fn count(&mut self, key: &str, entry: &Entry, least: usize) -> Option<usize> {
        let range = least as f64..=LARGEST as f64;
        let number = entry.value.as_number().filter(|n| n.fract() == 0.0 && range.contains(n));
        if number.is_none() {
            let message = format!("`{key}` is a whole number from {least} to {LARGEST}");
            self.problem(Diagnostic::error(entry.value.span, message));
        }
        number.map(|number| number as usize)
    }

    fn section(&mut self, key: &str) -> Option<&'a Table> {
        let recipe: &'a Recipe = self.recipe;
        let entry = recipe.sweep.get(key)?;
        if let Node::Table(table) = &entry.value.value {
            return Some(table);
        }
        let message = format!("`sweep.{key}` is a section, got {}", entry.value.value.kind());
        self.problem(Diagnostic::error(entry.value.span, message).help(format!("write [sweep.{key}]")));
        None
    }

    fn sweep(&mut self) -> Option<Sweep> {
        let recipe = self.recipe;
        self.known_keys(&recipe.sweep, "the section `sweep`", &SWEEP_KEYS);
        let axes = self.section("axes").map(|table| self.axes(table)).unwrap_or_default();
        let mut varied: Vec<String> = axes.iter().map(|axis| axis.name.clone()).collect();
        let dimensions = self.zipped(axes);
        let mut names = Names::new(recipe.path.parent().unwrap_or(Path::new("")));
        let mut cases = match self.section("sample") {
            Some(table) => self.sampled(table, &dimensions)?,
            None => self.grid(&dimensions, &mut names)?,
        };
        for case in self.explicit(&mut names) {
            varied.extend(case.params.iter().map(|(name, _)| name.clone()));
            cases.push(case);
        }
        let mut seen = std::collections::BTreeSet::new();
        varied.retain(|name| seen.insert(name.clone()));
        let columns = self.columns();
        if cases.is_empty() && self.problems.is_empty() {
            let help = "write [sweep.axes] and below it size = [\"1%\", \"2%\"], or give -s size=1%,2%";
            let message = format!("the recipe `{}` says nothing about a sweep", recipe.name);
            let bare = Diagnostic { labels: Vec::new(), ..Diagnostic::error(Span::default(), message) };
            self.problem(bare.help(help));
        }
        Some(Sweep { varied, cases, columns, lists_files: self.lists_files })
    }

    /// Joins the axes that `zip` names.
    fn zipped(&mut self, axes: Vec<Axis>) -> Vec<Dimension> {
        let mut dimensions: Vec<Dimension> = axes.into_iter().map(|axis| vec![axis]).collect();
        let Some(entry) = self.recipe.sweep.get("zip") else { return dimensions };
        let groups = match &entry.value.value {
            // One group may be written without the outer list.
            Node::List(items) if items.iter().all(|item| matches!(item.value, Node::Text(_))) => {
                vec![items.as_slice()]
            }
            Node::List(items) if items.iter().all(|item| matches!(item.value, Node::List(_))) => items
                .iter()
                .filter_map(|item| if let Node::List(names) = &item.value { Some(names.as_slice()) } else { None })
                .collect(),
            _ => {
                let message = "`zip` is a list of lists of axes: zip = [[\"size\", \"tolerance\"]]";
                self.problem(Diagnostic::error(entry.value.span, message));
                return dimensions;
            }
        };
        for group in groups {
            self.join(group, &mut dimensions);
        }
        dimensions
    }

    fn join(&mut self, group: &[Tree], dimensions: &mut Vec<Dimension>) {
        let mut joined: Option<usize> = None;
        for item in group {
            let Node::Text(name) = &item.value else {
                self.problem(Diagnostic::error(item.span, format!("`zip` names axes, got {}", item.value.kind())));
                continue;
            };
            let is_named = |axis: &Axis| axis.name == *name || axis.name.strip_prefix("inputs.") == Some(name);
            let Some(at) = dimensions.iter().position(|dimension| dimension.iter().any(is_named)) else {
                let names = dimensions.iter().flatten().map(|axis| axis.name.as_str());
                let help = did_you_mean(name, "axes", names);
                self.problem(Diagnostic::error(item.span, format!("there is no axis `{name}`")).help_opt(help));
                continue;
            };
            match joined {
                None => joined = Some(at),
                Some(first) if first == at => {}
                Some(first) => {
                    let moved = dimensions.remove(at);
                    let first = if at < first { first - 1 } else { first };
                    joined = Some(first);
                    dimensions[first].extend(moved);
                }
            }
        }
        if let Some(dimension) = joined.map(|at| dimensions[at].clone()) {
            self.same_length(&dimension);
        }
    }

    fn same_length(&mut self, dimension: &Dimension) {
        let Some(first) = dimension.first() else { return };
        for other in &dimension[1..] {
            if let (Some(a), Some(b)) = (first.len(), other.len())
                && a != b
            {
                let message =
                    format!("`{}` has {a} values and `{}` has {b}, so they cannot be zipped", first.name, other.name);
                self.problem(Diagnostic::error(other.span, message).label(first.span, ""));
            }
        }
    }

    /// Every combination, the last axis fastest.
    fn grid(&mut self, dimensions: &[Dimension], names: &mut Names<'_>) -> Option<Vec<CaseSpec>> {
        if dimensions.is_empty() {
            return Some(Vec::new());
        }
        let mut lengths = Vec::new();
        for axis in dimensions.iter().flatten() {
            if axis.len().is_none() {
                let message = format!("the range of `{}` does not say how many values it has", axis.name);
                self.problem(
                    Diagnostic::error(axis.span, message)
                        .help("give `count`, on the command line as in `1%..4%/5`, or sample with [sweep.sample]"),
                );
            }
        }
        for dimension in dimensions {
            lengths.push(dimension.iter().map(Axis::len).collect::<Option<Vec<_>>>()?.into_iter().min()?);
        }
        let number = lengths.iter().try_fold(1_usize, |product, length| product.checked_mul(*length));
        if number.is_none_or(|number| number > LARGEST) {
            let factors: Vec<String> = lengths.iter().map(ToString::to_string).collect();
            let message = format!("the sweep would have {} cases, and {LARGEST} is the most", factors.join(" x "));
            let help = "take fewer values, zip axes, or draw a few points of the ranges with [sweep.sample]";
            self.problem(Diagnostic::error(dimensions[0][0].span, message).help(help));
            return None;
        }
        let values: Vec<Vec<Vec<Tree>>> =
            dimensions.iter().map(|dimension| dimension.iter().map(Axis::listed).collect()).collect();
        let mut cases = Vec::new();
        for number in 0..number.unwrap_or(0) {
            let (mut rest, mut indices) = (number, vec![0; lengths.len()]);
            for (index, length) in indices.iter_mut().zip(&lengths).rev() {
                (*index, rest) = (rest % length, rest / length);
            }
            let mut params = Vec::new();
            for ((dimension, values), index) in dimensions.iter().zip(&values).zip(&indices) {
                let values = values.iter().map(|values| values[*index].clone());
                params.extend(dimension.iter().map(|axis| axis.name.clone()).zip(values));
            }
            cases.push(CaseSpec { name: names.of(&params), params });
        }
        Some(cases)
    }

    /// Points of a Latin hypercube over the axes.
    fn sampled(&mut self, table: &Table, dimensions: &[Dimension]) -> Option<Vec<CaseSpec>> {
        self.known_keys(table, "a sample", &SAMPLE_KEYS);
        if let Some(entry) = table.get("method")
            && !matches!(&entry.value.value, Node::Text(method) if method == "latin-hypercube")
        {
            self.problem(Diagnostic::error(entry.value.span, "`method` is \"latin-hypercube\""));
        }
        let section = self.recipe.sweep.get("sample").map(|entry| entry.key).unwrap_or_default();
        if dimensions.is_empty() {
            self.problem(Diagnostic::error(section, "a sample needs [sweep.axes] to draw from"));
        }
        let Some(entry) = table.get("n") else {
            self.problem(Diagnostic::error(section, "a sample says with `n` how many points it has"));
            return None;
        };
        let n = self.count("n", entry, 1)?;
        let seed = match table.get("seed") {
            None => 0,
            Some(entry) => {
                let seed = entry.value.as_number().filter(|n| n.fract() == 0.0 && (0.0..=9e15).contains(n));
                if seed.is_none() {
                    self.problem(Diagnostic::error(entry.value.span, "`seed` is a whole number, 0 or more"));
                }
                seed? as u64
            }
        };
        let digits = n.to_string().len();
        let points = sample::latin_hypercube(n, dimensions.len(), seed);
        let case = |(number, point): (usize, &Vec<f64>)| {
            let axes = dimensions.iter().zip(point).flat_map(|(axes, part)| axes.iter().map(move |axis| (axis, *part)));
            let params = axes.filter_map(|(axis, part)| Some((axis.name.clone(), axis.sampled(part)?))).collect();
            CaseSpec { name: format!("sample-{:0digits$}", number + 1), params }
        };
        Some(points.iter().enumerate().map(case).collect())
    }

    /// The `[[sweep.case]]` tables.
    fn explicit(&mut self, names: &mut Names<'_>) -> Vec<CaseSpec> {
        let Some(entry) = self.recipe.sweep.get("case") else { return Vec::new() };
        let Node::List(items) = &entry.value.value else {
            let message = format!("cases are written as [[sweep.case]], got {}", entry.value.value.kind());
            self.problem(Diagnostic::error(entry.value.span, message));
            return Vec::new();
        };
        if items.len() > LARGEST {
            self.problem(Diagnostic::error(entry.key, format!("{} cases, and {LARGEST} is the most", items.len())));
            return Vec::new();
        }
        items.iter().filter_map(|item| self.case(item, names)).collect()
    }

    fn case(&mut self, item: &Tree, names: &mut Names<'_>) -> Option<CaseSpec> {
        let Node::Table(table) = &item.value else {
            let message = format!("a case is a table of parameters, got {}", item.value.kind());
            self.problem(Diagnostic::error(item.span, message));
            return None;
        };
        let mut table = table.clone();
        let name = table.take("name");
        let mut params = Vec::new();
        for axis in self.axes(&Table { entries: table.entries.into_iter().map(single).collect() }) {
            match axis.values {
                Values::Listed(mut values) if values.len() == 1 => params.extend(values.pop().map(|v| (axis.name, v))),
                Values::Listed(_) | Values::Range(_) => {
                    self.problem(Diagnostic::error(axis.span, "a case gives one value to a parameter"));
                }
            }
        }
        let name = match name.map(|entry| (entry.value.value, entry.value.span)) {
            None => names.of(&params),
            Some((Node::Text(text), _)) if name::is_folder(&text) && names.take(&text) => text,
            Some((_, span)) => {
                let message = "the name of a case is the name of a folder that no other case has";
                let help = "letters, digits, `-`, `_`, `=` and `.`, not the first one a dot";
                self.problem(Diagnostic::error(span, message).help(help));
                return None;
            }
        };
        Some(CaseSpec { name, params })
    }

    fn columns(&mut self) -> Vec<ColumnRequest> {
        let Some(entry) = self.recipe.sweep.get("columns") else { return Vec::new() };
        let items = match &entry.value.value {
            Node::List(items) => items.as_slice(),
            _ => std::slice::from_ref(&entry.value),
        };
        items.iter().filter_map(|item| ColumnRequest::read(item, &mut self.problems)).collect()
    }
}

/// A value of a case as a list of one, which is what axes are made of.
fn single((key, entry): (String, Entry)) -> (String, Entry) {
    let Entry { key: at, value } = entry;
    let wrap = |value: Tree| Tree { span: value.span, value: Node::List(vec![value]) };
    let value = match value {
        Tree { span, value: Node::Table(table) } if key == "inputs" => {
            let entries = table.entries.into_iter().map(single).collect();
            Tree { span, value: Node::Table(Table { entries }) }
        }
        value @ Tree { value: Node::List(_) | Node::Table(_), .. } => value,
        value => wrap(value),
    };
    (key, Entry { key: at, value })
}
