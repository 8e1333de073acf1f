//! The `[gates]` section: which checks a step's mesh must pass.

use std::collections::BTreeMap;

use super::bind::BoundDecl;
use super::case::CaseContext;
use super::gate::{Check, Limit};
use super::wire::{Producer, Wiring, producer};
use crate::recipe::suggest::did_you_mean;
use crate::recipe::{Diagnostic, Entry, Node, Table, Tree};
use crate::step::Port;

/// The keys of a check.
pub const CHECK_KEYS: [&str; 8] = ["at-least", "at-most", "equals", "to", "of", "same-as", "no-more-than", "except"];

/// A gate whose step and checks are known.
pub(super) struct GateDecl {
    /// As the recipe names it.
    pub(super) step: String,
    pub(super) target: Producer,
    /// Checks by what they compare with: the producer, or none.
    pub(super) groups: Vec<Group>,
}

/// Checks that compare with the same output, or with none.
pub(super) type Group = (Option<Producer>, Vec<Check>);

/// Reads all gates.
pub(super) fn gates(steps: &[BoundDecl<'_>], wiring: &Wiring, context: &mut CaseContext<'_>) -> Vec<GateDecl> {
    let recipe = context.recipe;
    let mut gates = Vec::new();
    for (name, entry) in recipe.gates.in_order() {
        let target = producer(name, entry.key, steps, recipe, &mut context.problems);
        let Node::Table(table) = &entry.value.value else {
            let message = format!("a gate is a table of metrics, got {}", entry.value.value.kind());
            let help = format!("write [gates.{name}] and below it min-stretch = {{ at-least = 0.2 }}");
            context.problems.push(Diagnostic::error(entry.value.span, message).help(help));
            continue;
        };
        if let Some(port) = target.and_then(|target| wiring.port(target))
            && !is_mesh(port)
        {
            let message = format!("`{name}` gives {port}, and a gate looks at a mesh");
            context.problems.push(Diagnostic::error(entry.key, message));
        }
        let groups = checks(table, steps, wiring, context);
        if let Some(target) = target {
            gates.push(GateDecl { step: name.to_owned(), target, groups });
        }
    }
    gates
}

pub(super) fn is_mesh(port: Port) -> bool {
    match port {
        Port::Soup | Port::Surface => true,
        Port::File | Port::Metrics => false,
    }
}

fn checks(table: &Table, steps: &[BoundDecl<'_>], wiring: &Wiring, context: &mut CaseContext<'_>) -> Vec<Group> {
    let mut groups: BTreeMap<Option<(usize, &str)>, Group> = BTreeMap::new();
    for (metric, entry) in &table.entries {
        if !known_metric(metric, entry, context) {
            continue;
        }
        let recipe = context.recipe;
        let Some(value) = context.scope.substitute(&entry.value, &recipe.sources, &mut context.problems) else {
            continue;
        };
        let Some((check, reference)) = check(metric, entry, &value, steps, wiring, context) else { continue };
        let key = reference.map(|reference| (reference.step, reference.output.name));
        groups.entry(key).or_insert((reference, Vec::new())).1.push(check);
    }
    groups.into_values().collect()
}

fn known_metric(metric: &str, entry: &Entry, context: &mut CaseContext<'_>) -> bool {
    let known = context.metrics.contains(&metric);
    if !known {
        let message = format!("there is no metric `{metric}`");
        let help = did_you_mean(metric, "metrics", context.metrics.iter().copied());
        context.problems.push(Diagnostic::error(entry.key, message).help_opt(help));
    }
    known
}

fn check(
    metric: &str,
    entry: &Entry,
    value: &Tree,
    steps: &[BoundDecl<'_>],
    wiring: &Wiring,
    context: &mut CaseContext<'_>,
) -> Option<(Check, Option<Producer>)> {
    let mut check = Check { metric: metric.to_owned(), ..Check::default() };
    let before = context.problems.len();
    let mut reference = None;
    if let Node::Table(table) = &value.value {
        for (key, entry) in table.in_order() {
            match key {
                "at-least" => check.at_least = limit(&entry.value, context),
                "at-most" => check.at_most = limit(&entry.value, context),
                "equals" => check.equals = limit(&entry.value, context),
                "except" => check.except = groups(&entry.value, context),
                "to" | "of" | "same-as" | "no-more-than" => {
                    check.same_as_reference |= key == "same-as";
                    check.no_more_than_reference |= key == "no-more-than";
                    if reference.is_some() {
                        let message = "a check compares with one step only";
                        context.problems.push(Diagnostic::error(entry.key, message));
                    }
                    reference = compared(&entry.value, steps, wiring, context);
                }
                _ => {
                    let message = format!("a check has no key `{key}`");
                    let help = did_you_mean(key, "keys", CHECK_KEYS);
                    context.problems.push(Diagnostic::error(entry.key, message).help_opt(help));
                }
            }
        }
    } else {
        check.equals = limit(value, context);
    }
    let bounded = check.at_least.is_some() || check.at_most.is_some() || check.equals.is_some();
    let compares = check.same_as_reference || check.no_more_than_reference;
    let holds_by_itself = !bounded && !compares && reference.is_some() && is_flag(metric);
    if holds_by_itself {
        check.equals = Some(Limit::Flag(true));
    }
    if context.problems.len() == before && !bounded && !compares && !holds_by_itself {
        let message = format!("the check of `{metric}` has no limit");
        let help = "give `at-least`, `at-most`, `equals`, `same-as` or `no-more-than`";
        context.problems.push(Diagnostic::error(entry.key, message).help(help));
    }
    // The name of the step is the recipe's affair; the task has an input of this name.
    check.reference = reference.map(|_| "reference".to_owned());
    (context.problems.len() == before).then_some((check, reference))
}

fn is_flag(metric: &str) -> bool {
    metric == "groups-kept"
}

fn limit(value: &Tree, context: &mut CaseContext<'_>) -> Option<Limit> {
    let limit = match &value.value {
        Node::Bool(flag) => Some(Limit::Flag(*flag)),
        Node::Number(_) => value.as_number().filter(|number| number.is_finite()).map(Limit::Number),
        Node::Text(text) => percent(text).map(Limit::Percent),
        Node::Date(_) | Node::List(_) | Node::Table(_) | Node::File(_) => None,
    };
    if limit.is_none() {
        let written = match &value.value {
            Node::Text(text) => format!("\"{text}\""),
            other => other.kind().to_owned(),
        };
        let message = format!("a limit is a number, a percent such as \"2%\", true or false, got {written}");
        context.problems.push(Diagnostic::error(value.span, message));
    }
    limit
}

fn percent(text: &str) -> Option<f64> {
    text.strip_suffix('%')?.trim().parse().ok().filter(|value: &f64| value.is_finite())
}

fn groups(value: &Tree, context: &mut CaseContext<'_>) -> Vec<String> {
    let items = match &value.value {
        Node::List(items) => items.as_slice(),
        _ => std::slice::from_ref(value),
    };
    let mut names = Vec::new();
    for item in items {
        match &item.value {
            Node::Text(name) => names.push(name.clone()),
            other => {
                let message = format!("`except` names face groups, got {}", other.kind());
                context.problems.push(Diagnostic::error(item.span, message));
            }
        }
    }
    names
}

fn compared(value: &Tree, steps: &[BoundDecl<'_>], wiring: &Wiring, context: &mut CaseContext<'_>) -> Option<Producer> {
    let Node::Text(name) = &value.value else {
        let message = format!("this names a step to compare with, got {}", value.value.kind());
        context.problems.push(Diagnostic::error(value.span, message));
        return None;
    };
    let found = producer(name, value.span, steps, context.recipe, &mut context.problems)?;
    if let Some(port) = wiring.port(found)
        && !is_mesh(port)
    {
        let message = format!("`{name}` gives {port}, which a mesh cannot be compared with");
        context.problems.push(Diagnostic::error(value.span, message));
    }
    Some(found)
}
