//! `criteria` of a gate, and the `[criteria]` section that it names.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::super::bind::BoundDecl;
use super::super::case::CaseContext;
use super::super::task::GateTask;
use super::super::wire::Wiring;
use super::{Group, compared, groups};
use crate::criteria::read;
use crate::metric::gate::criteria::Criteria;
use crate::recipe::suggest::did_you_mean;
use crate::recipe::{Diagnostic, Entry, Node, Span, Tree, is_full};

/// The key of a gate that names criteria.
pub const CRITERIA: &str = "criteria";
/// The keys of such a name, where it is a table.
pub const CRITERIA_KEYS: [&str; 3] = ["use", "to", "except"];

const EXAMPLE: &str = "write criteria = \"lab\", or criteria = { use = \"lab\", to = \"STEP\" }";

/// Criteria by name; `None` where they are wrong, which was told.
pub(super) type Standards = BTreeMap<String, Option<Criteria>>;

/// Reads the `[criteria]` section.
pub(super) fn standards(context: &mut CaseContext<'_>) -> Standards {
    let recipe = context.recipe;
    let mut standards = Standards::new();
    for (name, entry) in recipe.criteria.in_order() {
        if is_full(&context.problems) {
            break;
        }
        let criteria = match &entry.value.value {
            Node::Table(table) => {
                read((name, entry.key), table, &context.scope, &recipe.sources, &mut context.problems)
            }
            other => {
                let message = format!("the criteria `{name}` are a table, got {}", other.kind());
                let help = format!("write [criteria.{name}] and below it file = \"lab.criteria.toml\"");
                context.problems.push(Diagnostic::error(entry.value.span, message).help(help));
                None
            }
        };
        standards.insert(name.to_owned(), criteria);
    }
    standards
}

/// The groups of the criteria that a gate names: one name, a table with one, or a list of those.
pub(super) fn named(
    entry: &Entry,
    standards: &Standards,
    (steps, wiring): (&[BoundDecl<'_>], &Wiring),
    context: &mut CaseContext<'_>,
) -> Vec<Group> {
    let recipe = context.recipe;
    let Some(value) = context.scope.substitute(&entry.value, &recipe.sources, &mut context.problems) else {
        return Vec::new();
    };
    let items = match &value.value {
        Node::List(items) => items.as_slice(),
        _ => std::slice::from_ref(&value),
    };
    items.iter().filter_map(|item| one(item, standards, (steps, wiring), context)).collect()
}

fn one(
    item: &Tree,
    standards: &Standards,
    (steps, wiring): (&[BoundDecl<'_>], &Wiring),
    context: &mut CaseContext<'_>,
) -> Option<Group> {
    if is_full(&context.problems) {
        return None;
    }
    let (mut name, mut reference, mut except) = (None, None, Vec::new());
    let mut is_compared = false;
    match &item.value {
        Node::Text(text) => name = Some((text.as_str(), item.span)),
        Node::Table(table) => {
            for (key, entry) in table.in_order() {
                match (key, &entry.value.value) {
                    ("use", Node::Text(text)) => name = Some((text.as_str(), entry.value.span)),
                    ("to", _) => {
                        is_compared = true;
                        reference = compared(&entry.value, steps, wiring, context);
                    }
                    ("except", _) => except = groups(&entry.value, context),
                    ("use", other) => {
                        let message = format!("`use` names criteria, got {}", other.kind());
                        context.problems.push(Diagnostic::error(entry.value.span, message));
                        return None;
                    }
                    _ => {
                        let help = did_you_mean(key, "keys", CRITERIA_KEYS);
                        let message = format!("the criteria of a gate have no key `{key}`");
                        context.problems.push(Diagnostic::error(entry.key, message).help_opt(help));
                    }
                }
            }
        }
        other => {
            let message = format!("a gate names its criteria, got {}", other.kind());
            context.problems.push(Diagnostic::error(item.span, message).help(EXAMPLE));
            return None;
        }
    }
    let Some((name, span)) = name else {
        let message = "this does not say which criteria are meant";
        context.problems.push(Diagnostic::error(item.span, message).help(EXAMPLE));
        return None;
    };
    let criteria = Criteria { except, ..found((name, span), standards, context)? };
    // What is compared with, and could not be found, was told.
    if let Some(metric) = criteria.compares().filter(|_| !is_compared) {
        let message = format!("the criteria `{name}` compare (`{}`), and nothing says with what", metric.name);
        let help = format!("write criteria = {{ use = \"{name}\", to = \"STEP\" }}, or turn `{}` off", metric.name);
        context.problems.push(Diagnostic::error(span, message).help(help));
        return None;
    }
    // A reference that nothing compares with would only make the task wait for it.
    let reference = reference.filter(|_| criteria.compares().is_some());
    Some(Group { reference, task: GateTask { checks: Vec::new(), criteria: Some(Arc::new(criteria)) } })
}

/// The criteria of a name.
fn found((name, span): (&str, Span), standards: &Standards, context: &mut CaseContext<'_>) -> Option<Criteria> {
    let Some(found) = standards.get(name) else {
        let help = did_you_mean(name, "criteria", standards.keys().map(String::as_str))
            .unwrap_or_else(|| format!("write [criteria.{name}] and below it file = \"lab.criteria.toml\""));
        let message = format!("the recipe has no criteria `{name}`");
        context.problems.push(Diagnostic::error(span, message).help(help));
        return None;
    };
    found.clone()
}
