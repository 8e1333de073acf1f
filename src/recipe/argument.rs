//! Values written on the command line: `--set NAME=VALUE` and `-s NAME=VALUES`.

use std::collections::BTreeMap;

use toml::de::DeValue;

use super::source::{SourceMap, Span};
use super::tree::{Entry, Node, Table, Tree};
use super::{Diagnostic, Recipe};

/// The value of a `--set`: a number or bool as TOML reads it, else the text itself.
pub(super) fn value(text: &str) -> Node {
    match DeValue::parse(text.trim()).map(|value| Tree::from_toml(value, 0).value) {
        Ok(value @ (Node::Number(_) | Node::Bool(_) | Node::Text(_))) => value,
        Ok(Node::Date(_) | Node::List(_) | Node::Table(_) | Node::File(_)) | Err(_) => Node::Text(text.to_owned()),
    }
}

/// Lays an axis on the recipe's `[sweep.axes]`: `1,2,4`, or the range `1%..4%/5`, or `0.1%..1%/5/log`.
pub(super) fn lay_axis(recipe: &mut Recipe, name: &str, text: &str, sources: &mut SourceMap) {
    let base = sources.add("-s", "", format!("{name}={text}"));
    let key = Span { start: base, end: base + name.len() };
    let span = Span { start: key.end + 1, end: key.end + 1 + text.len() };
    let value = if text.contains("..") && !text.contains("../") {
        range(text, span)
    } else {
        let mut at = span.start;
        let mut items = Vec::new();
        for item in text.split(',') {
            let item_span = Span { start: at, end: at + item.len() };
            items.push(Tree { span: item_span, value: self::value(item) });
            at = item_span.end + 1;
        }
        Node::List(items)
    };
    let entry = Entry { key, value: Tree { span, value } };
    let place = |span| Entry { key: span, value: Tree { span, value: Node::Table(Table::default()) } };
    let axes = recipe.sweep.entries.entry("axes".to_owned()).or_insert_with(|| place(key));
    let Node::Table(axes) = &mut axes.value.value else { return };
    let Some(input) = name.strip_prefix("inputs.") else {
        if recipe.params.get(name).is_none()
            && recipe.inputs.get(name).is_some()
            && let Some(Entry { value: Tree { value: Node::Table(inputs), .. }, .. }) = axes.entries.get_mut("inputs")
        {
            inputs.entries.remove(name);
        }
        axes.entries.insert(name.to_owned(), entry);
        return;
    };
    let inputs = axes.entries.entry("inputs".to_owned()).or_insert_with(|| place(key));
    match &mut inputs.value.value {
        Node::Table(inputs) => drop(inputs.entries.insert(input.to_owned(), entry)),
        _ => recipe.problems.push(Diagnostic::error(key, "`sweep.axes.inputs` is not a table of inputs")),
    }
}

/// `FROM..TO`, `FROM..TO/COUNT`, `FROM..TO/COUNT/SCALE` as the table that a recipe would write.
fn range(text: &str, span: Span) -> Node {
    let (bounds, rest) = text.split_once('/').unwrap_or((text, ""));
    let (from, to) = bounds.split_once("..").unwrap_or((bounds, ""));
    let (count, scale) = rest.split_once('/').unwrap_or((rest, ""));
    let mut entries = BTreeMap::new();
    for (key, text) in [("from", from), ("to", to), ("count", count), ("scale", scale)] {
        if !text.is_empty() {
            let tree = Tree { span, value: value(text) };
            entries.insert(key.to_owned(), Entry { key: span, value: tree });
        }
    }
    Node::Table(Table { entries })
}
