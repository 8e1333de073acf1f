//! The values of parameters and inputs, and their substitution into the rest of a recipe.

use std::collections::BTreeMap;
use std::path::PathBuf;

use super::circle;
use super::diagnostic::{Diagnostic, Label, is_full};
use super::expression::{self, Expression, ExpressionError, Value};
use super::source::{SourceMap, Span};
use super::suggest::did_you_mean;
use super::tree::{Entry, Node, Table, Tree};

/// Parameters and inputs with their values. A name that is known but whose own value is wrong has `None`, so that the
/// fault is reported once and not wherever the name is used.
#[derive(Clone, Debug, Default)]
pub struct Scope {
    /// Parameters.
    pub params: BTreeMap<String, Option<Value>>,
    /// Paths of input files, as they are opened.
    pub inputs: BTreeMap<String, Option<PathBuf>>,
    /// Where the parameters are written whose values do not stand in the recipe's own section: on the command line, or
    /// in the axes of a sweep.
    pub origins: BTreeMap<String, Span>,
}

impl Scope {
    /// Evaluates the parameters over the inputs. `problems` receives what is wrong with them.
    pub(super) fn new(
        params: &Table,
        inputs: BTreeMap<String, Option<PathBuf>>,
        sources: &SourceMap,
        problems: &mut Vec<Diagnostic>,
    ) -> Self {
        let mut scope = Self { params: BTreeMap::new(), inputs, origins: BTreeMap::new() };
        let names: Vec<&str> = params.entries.keys().map(String::as_str).collect();
        let mut formulas: Vec<Option<(Expression, Span)>> = Vec::new();
        for (name, entry) in &params.entries {
            let (value, formula) = match plain(&entry.value, sources) {
                Ok(Plain::Value(value)) => (Some(value), None),
                Ok(Plain::Formula(formula, text)) => (None, Some((formula, text))),
                Err(problem) => {
                    problems.push(problem);
                    (None, None)
                }
            };
            scope.params.insert(name.clone(), value);
            formulas.push(formula);
        }
        let position = |name: &str| names.binary_search(&name).ok();
        let needs: Vec<Vec<usize>> = formulas
            .iter()
            .map(|formula| formula.iter().flat_map(|(f, _)| f.names()).filter_map(|(n, _)| position(n)).collect())
            .collect();
        let found = circle::order(&needs);
        for path in &found.circles {
            problems.push(circle_problem(path, &names, params));
        }
        for index in found.sorted {
            if is_full(problems) {
                break;
            }
            let Some((formula, text)) = &formulas[index] else { continue };
            match scope.evaluate(formula, *text, sources) {
                Ok(value) => drop(scope.params.insert(names[index].to_owned(), Some(value))),
                Err(problem) => problems.extend(problem),
            }
        }
        scope
    }

    /// The scope of a table with parameters of its own, each of which may be an expression over this scope.
    #[must_use]
    pub fn within(&self, params: &Table, sources: &SourceMap, problems: &mut Vec<Diagnostic>) -> Self {
        let mut scope = self.clone();
        for (name, entry) in &params.entries {
            let value = match plain(&entry.value, sources) {
                Ok(Plain::Value(value)) => Ok(value),
                Ok(Plain::Formula(formula, at)) => self.evaluate(&formula, at, sources),
                Err(problem) => Err(Some(problem)),
            };
            scope.origins.remove(name);
            scope.params.insert(name.clone(), value.map_err(|problem| problems.extend(problem)).ok());
        }
        scope
    }

    /// The value of a formula; `Err(None)` when it uses a name whose own fault is reported already.
    fn evaluate(&self, formula: &Expression, text: Span, sources: &SourceMap) -> Result<Value, Option<Diagnostic>> {
        let lookup = |name: &str| self.lookup(name);
        expression::evaluate(formula, &lookup)
            .map_err(|error| (!error.message.is_empty()).then(|| diagnostic(error, text, sources)))
    }

    /// Moves problems with an expression to where the values in it were set, when that is not the recipe: what is wrong
    /// is the argument, and the recipe only uses it.
    pub fn blame(&self, problems: &mut [Diagnostic], sources: &SourceMap) {
        for problem in problems {
            let Some(formula) = problem.labels.first().and_then(|first| formula_at(first.span, sources)) else {
                continue;
            };
            let mut places: Vec<Span> =
                formula.names().into_iter().filter_map(|(name, _)| self.origins.get(name)).copied().collect();
            places.sort_unstable();
            places.dedup();
            let set = places.into_iter().map(|span| Label { span, text: String::new() });
            let labels: Vec<Label> = set.chain(problem.labels.drain(..)).collect();
            problem.labels = labels;
        }
    }

    fn lookup(&self, name: &str) -> Result<Value, ExpressionError> {
        let error = |message: String, help| ExpressionError { range: 0..0, message, help };
        let known = if let Some(input) = name.strip_prefix("inputs.") {
            let Some(path) = self.inputs.get(input) else {
                let help = did_you_mean(input, "inputs", self.inputs.keys().map(String::as_str));
                return Err(error(format!("there is no input `{input}`"), help));
            };
            path.clone().map(Value::File)
        } else {
            let Some(value) = self.params.get(name) else {
                return Err(error(format!("there is no parameter `{name}`"), self.meant(name)));
            };
            value.clone()
        };
        known.ok_or_else(|| error(String::new(), None))
    }

    fn meant(&self, name: &str) -> Option<String> {
        if let Some((left, right)) = name.split_once('-')
            && (self.params.contains_key(left) || self.params.contains_key(right))
        {
            return Some(format!("a minus needs spaces around it, as in `{left} - {right}`"));
        }
        if self.inputs.contains_key(name) {
            return Some(format!("did you mean `inputs.{name}`?"));
        }
        did_you_mean(name, "parameters", self.params.keys().map(String::as_str))
    }

    /// A value with every expression in it replaced by its value, at the place where it is written. `None` when one of
    /// them has no value; then `problems` says why, or has said so before.
    pub fn substitute(&self, tree: &Tree, sources: &SourceMap, problems: &mut Vec<Diagnostic>) -> Option<Tree> {
        if is_full(problems) {
            return None;
        }
        let value = match &tree.value {
            Node::Text(text) if text.starts_with('=') => match plain(tree, sources) {
                Ok(Plain::Value(Value::Text(text))) => Node::Text(text),
                Ok(Plain::Value(value)) => node(value),
                Ok(Plain::Formula(formula, at)) => match self.evaluate(&formula, at, sources) {
                    Ok(value) => node(value),
                    Err(problem) => {
                        problems.extend(problem);
                        return None;
                    }
                },
                Err(problem) => {
                    problems.push(problem);
                    return None;
                }
            },
            Node::List(items) => {
                let items: Vec<_> = items.iter().map(|item| self.substitute(item, sources, problems)).collect();
                Node::List(items.into_iter().collect::<Option<_>>()?)
            }
            Node::Table(table) => {
                let (table, lost) = self.substitute_table(table, sources, problems);
                if !lost.is_empty() {
                    return None;
                }
                Node::Table(table)
            }
            Node::Text(_) | Node::Number(_) | Node::Bool(_) | Node::Date(_) | Node::File(_) => tree.value.clone(),
        };
        Some(Tree { span: tree.span, value })
    }

    /// A table with its expressions replaced, and the keys whose values could not be.
    pub fn substitute_table(
        &self,
        table: &Table,
        sources: &SourceMap,
        problems: &mut Vec<Diagnostic>,
    ) -> (Table, Vec<String>) {
        let (mut entries, mut lost) = (BTreeMap::new(), Vec::new());
        for (key, entry) in &table.entries {
            match self.substitute(&entry.value, sources, problems) {
                Some(value) => drop(entries.insert(key.clone(), Entry { key: entry.key, value })),
                None => lost.push(key.clone()),
            }
        }
        (Table { entries }, lost)
    }
}

enum Plain {
    Value(Value),
    /// A formula and the place of its text.
    Formula(Expression, Span),
}

/// Reads a scalar: a number, a percent, a bool, a string, or a formula.
fn plain(tree: &Tree, sources: &SourceMap) -> Result<Plain, Diagnostic> {
    let wrong = |message: String| Diagnostic::error(tree.span, message);
    match &tree.value {
        Node::Number(spelling) => match tree.as_number() {
            Some(number) if number.is_finite() => Ok(Plain::Value(Value::Number(number))),
            _ => Err(wrong(format!("`{spelling}` is not a finite number"))),
        },
        Node::Bool(value) => Ok(Plain::Value(Value::Bool(*value))),
        Node::Text(text) => match text.strip_prefix('=') {
            Some(escaped) if escaped.starts_with('=') => Ok(Plain::Value(Value::Text(escaped.to_owned()))),
            Some(formula) => {
                let at = formula_span(tree.span, formula, sources);
                match expression::parse(formula) {
                    Ok(formula) => Ok(Plain::Formula(formula, at)),
                    Err(error) => Err(diagnostic(error, at, sources)),
                }
            }
            None => Ok(Plain::Value(percent(text).map_or_else(|| Value::Text(text.clone()), Value::Percent))),
        },
        Node::File(path) => Ok(Plain::Value(Value::File(path.clone()))),
        Node::Date(_) | Node::List(_) | Node::Table(_) => {
            let message = format!("a parameter is a number, a percent, a bool or a string, not {}", tree.value.kind());
            Err(wrong(message))
        }
    }
}

fn percent(text: &str) -> Option<f64> {
    text.strip_suffix('%')?.trim().parse().ok().filter(|value: &f64| value.is_finite())
}

/// The formula, or the part of one, that stands at a place. A key of the same spelling is none.
fn formula_at(span: Span, sources: &SourceMap) -> Option<Expression> {
    let file = sources.file(span)?;
    let start = file.local(span).start;
    let before = &file.text[file.line(file.line_of(start)).start..start];
    let written = sources.text(span).trim_matches(['"', '\'']);
    let whole = written.strip_prefix('=');
    let inside = before.contains("\"=") || before.contains("'=");
    expression::parse(whole.or(inside.then_some(written))?).ok()
}

/// Where the formula of a value stands in its text. An escaped string cannot be mapped; then the whole value.
fn formula_span(value: Span, formula: &str, sources: &SourceMap) -> Span {
    match sources.text(value).find(formula) {
        Some(offset) if !formula.is_empty() => {
            let start = value.start + offset;
            Span { start, end: start + formula.len() }
        }
        _ => value,
    }
}

fn diagnostic(error: ExpressionError, text: Span, sources: &SourceMap) -> Diagnostic {
    // The text of an escaped string is longer than the formula, and the place inside it is not known.
    let inside = sources.text(text).len() == text.end - text.start && error.range.end <= text.end - text.start;
    let span = if inside && !sources.text(text).starts_with(['"', '\'']) {
        Span { start: text.start + error.range.start, end: text.start + error.range.end }
    } else {
        text
    };
    Diagnostic::error(span, error.message).help_opt(error.help)
}

fn circle_problem(path: &[usize], names: &[&str], params: &Table) -> Diagnostic {
    let mut shown: Vec<&str> = path.iter().chain(path.first()).take(12).map(|index| names[*index]).collect();
    if path.len() >= 12 {
        shown.push("…");
    }
    let place = |index: &usize| params.get(names[*index]).map(|entry| entry.value.span).unwrap_or_default();
    let first = path.first().map(place).unwrap_or_default();
    let message = format!("parameters need each other in a circle: {}", shown.join(" -> "));
    path.iter()
        .skip(1)
        .take(3)
        .fold(Diagnostic::error(first, message), |problem, index| problem.label(place(index), ""))
}

/// A value as a recipe would write it; whole numbers as integers, so that they fit integer parameters.
pub fn node(value: Value) -> Node {
    match value {
        Value::Number(number) if number.fract() == 0.0 && number.abs() < 9e15 => {
            Node::Number(format!("{}", number as i64))
        }
        Value::Number(number) => Node::Number(format!("{number:?}")),
        Value::Percent(percent) => Node::Text(format!("{percent}%")),
        Value::Bool(value) => Node::Bool(value),
        Value::Text(text) => Node::Text(text),
        Value::File(path) => Node::File(path),
    }
}
