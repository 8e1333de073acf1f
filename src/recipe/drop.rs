//! `drop = ["gates.fe.closed", "outputs.fe"]`: what a recipe takes away of the one that it extends, before it lays its
//! own entries on it. An entry that is dropped and written anew is replaced whole.

use toml::de::{DeTable, DeValue};

use super::diagnostic::Diagnostic;
use super::source::Span;
use super::suggest::did_you_mean;
use super::tree::{Entry, Node, Table};

const EXAMPLE: &str = "write drop = [\"gates.fe.closed\", \"outputs.fe\"]";

/// Takes the entries that `drop` names out of `base`; a problem for each name that cannot be followed.
pub(super) fn take_away(base: &mut Table, drop: &Entry, problems: &mut Vec<Diagnostic>) {
    let names = match &drop.value.value {
        Node::List(items) => items.as_slice(),
        _ => std::slice::from_ref(&drop.value),
    };
    for name in names {
        let result = match &name.value {
            Node::Text(text) => take(base, text, name.span),
            other => {
                let message = format!("`drop` lists names, got {}", other.kind());
                Err(Diagnostic::error(name.span, message).help(EXAMPLE))
            }
        };
        problems.extend(result.err());
    }
}

/// A recipe that extends nothing has nothing to drop from.
pub(super) fn without_base(drop: &Entry) -> Diagnostic {
    let message = "`drop` takes things of an extended recipe away, and this recipe extends none";
    Diagnostic::error(drop.key, message).help("write extends = \"lab-standard.toml\", or leave `drop` out")
}

fn take(base: &mut Table, name: &str, span: Span) -> Result<(), Diagnostic> {
    let Some(path) = segments(name) else {
        return Err(Diagnostic::error(span, format!("`{name}` is not the name of an entry")).help(EXAMPLE));
    };
    let (last, above) = path.split_last().map_or(("", &[][..]), |(last, above)| (last.as_str(), above));
    let mut table = base;
    for (depth, segment) in above.iter().enumerate() {
        if table.get(segment).is_none() {
            return Err(unknown(&path[..=depth], table, span));
        }
        let Some(Node::Table(inner)) = table.entries.get_mut(segment).map(|entry| &mut entry.value.value) else {
            let whole = path[..=depth].join(".");
            let message = format!("`{whole}` of the extended recipe has no parts");
            return Err(Diagnostic::error(span, message).help(format!("drop `{whole}` whole")));
        };
        table = inner;
    }
    match table.take(last) {
        Some(_) => Ok(()),
        None => Err(unknown(&path, table, span)),
    }
}

/// The parts of a dotted key, read as TOML reads it, so that a part with a point can stand in quotes.
fn segments(name: &str) -> Option<Vec<String>> {
    let text = format!("{name} = 0");
    let mut table = DeTable::parse(&text).ok()?.into_inner();
    let mut path = Vec::new();
    loop {
        if table.len() != 1 {
            return None;
        }
        let (key, value) = table.into_iter().next()?;
        path.push(key.into_inner().into_owned());
        match value.into_inner() {
            DeValue::Table(inner) => table = inner,
            DeValue::Integer(_) => return Some(path),
            _ => return None,
        }
    }
}

fn unknown(path: &[String], table: &Table, span: Span) -> Diagnostic {
    let (last, above) = path.split_last().map_or(("", &[][..]), |(last, above)| (last.as_str(), above));
    let prefix = if above.is_empty() { String::new() } else { format!("{}.", above.join(".")) };
    let message = format!("the extended recipe has no `{prefix}{last}`");
    let help = did_you_mean(last, "it has", table.entries.keys().map(String::as_str));
    Diagnostic::error(span, message).help_opt(help)
}
