//! The best case of a search as a recipe.

use std::fmt::Write;
use std::path::Path;

use super::context::relative;
use crate::plan::CaseSpec;
use crate::recipe::{Node, Recipe, Value};

/// A recipe that extends the one searched, with every parameter filled in. `head` is what it says of itself, `file`
/// where it will stand.
pub(super) fn recipe(recipe: &Recipe, case: &CaseSpec, head: &[String], file: &Path) -> String {
    let folder = file.parent().unwrap_or(Path::new(""));
    let slashes = |path: &Path| quoted(&relative(path, folder).to_string_lossy().replace('\\', "/"));
    let mut lines = String::new();
    for line in head {
        // Writing to a string cannot fail.
        let _ = writeln!(lines, "# {}", line.replace(char::is_control, " "));
    }
    let name = quoted(&format!("{}-best", recipe.name));
    let _ = writeln!(lines, "extends = {}\nname = {name}\n", slashes(&recipe.path));
    let inputs = recipe.inputs.in_order().into_iter().filter_map(|(name, entry)| match &entry.value.value {
        Node::File(path) => Some(format!("{name} = {}\n", slashes(path))),
        _ => None,
    });
    let inputs: String = inputs.collect();
    if !inputs.is_empty() {
        let _ = writeln!(lines, "[inputs]\n{inputs}");
    }
    lines.push_str("[params]\n");
    for (name, value) in &recipe.scope(&case.params, &mut Vec::new()).params {
        let value = match value {
            Some(Value::Text(text)) if text.starts_with('=') => quoted(&format!("={text}")),
            Some(value @ (Value::Text(_) | Value::Percent(_))) => quoted(&value.to_string()),
            Some(value @ (Value::Number(_) | Value::Bool(_))) => value.to_string(),
            Some(Value::File(_)) | None => continue,
        };
        let key = if name.is_ascii() { name.clone() } else { quoted(name) };
        let _ = writeln!(lines, "{key} = {value}");
    }
    lines
}

fn quoted(text: &str) -> String {
    toml::Value::from(text).to_string()
}
