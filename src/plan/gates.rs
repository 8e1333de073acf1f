//! The `[gates]` section: which checks a step's mesh must pass.

mod criteria;

use std::collections::BTreeMap;

pub use criteria::{CRITERIA, CRITERIA_KEYS};
use criteria::{named, standards};

use super::bind::BoundDecl;
use super::case::CaseContext;
use super::task::GateTask;
use super::wire::{Producer, Wiring, producer};
use crate::metric::gate::{Check, Limit, judges_faces};
use crate::metric::registry::{Direction, METRICS, MetricDef, Needs, Unit, find};
use crate::recipe::suggest::did_you_mean;
use crate::recipe::{Diagnostic, Entry, Node, Table, Tree, is_full};
use crate::step::Port;

/// The keys of a check.
pub const CHECK_KEYS: [&str; 9] =
    ["at-least", "at-most", "equals", "to", "of", "same-as", "no-more-than", "except", "files"];

/// A gate whose step and checks are known.
pub(super) struct GateDecl {
    /// As the recipe names it.
    pub(super) step: String,
    pub(super) target: Producer,
    /// Its tasks.
    pub(super) groups: Vec<Group>,
}

/// What one task judges: checks that compare with the same output or with none, or the criteria of one standard.
pub(super) struct Group {
    pub(super) reference: Option<Producer>,
    pub(super) task: GateTask,
}

/// Reads all gates.
pub(super) fn gates(steps: &[BoundDecl<'_>], wiring: &Wiring, context: &mut CaseContext<'_>) -> Vec<GateDecl> {
    let recipe = context.recipe;
    let standards = standards(context);
    let mut gates = Vec::new();
    for (name, entry) in recipe.gates.in_order() {
        let target = producer(name, entry.key, steps, context);
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
        let mut groups = checks(table, steps, wiring, context);
        if let Some(entry) = table.get(CRITERIA) {
            groups.extend(named(entry, &standards, (steps, wiring), context));
        }
        if let Some(target) = target {
            gates.push(GateDecl { step: name.to_owned(), target, groups });
        }
    }
    gates
}

pub(super) fn is_mesh(port: Port) -> bool {
    match port {
        Port::Soup | Port::Surface | Port::Quads | Port::Patches => true,
        Port::File | Port::Hierarchy | Port::Metrics => false,
    }
}

fn checks(table: &Table, steps: &[BoundDecl<'_>], wiring: &Wiring, context: &mut CaseContext<'_>) -> Vec<Group> {
    let mut groups: BTreeMap<Option<(usize, &str)>, Group> = BTreeMap::new();
    for (metric, entry) in table.entries.iter().filter(|(metric, _)| *metric != CRITERIA) {
        if is_full(&context.problems) {
            break;
        }
        let Some(metric) = known_metric(metric, entry, context) else { continue };
        let recipe = context.recipe;
        let Some(value) = context.scope.substitute(&entry.value, &recipe.sources, &mut context.problems) else {
            continue;
        };
        let Some((check, reference)) = check(metric, entry, &value, steps, wiring, context) else { continue };
        let key = reference.map(|reference| (reference.step, reference.output.name));
        let group = groups.entry(key).or_insert_with(|| Group { reference, task: GateTask::default() });
        group.task.checks.push(check);
    }
    groups.into_values().collect()
}

fn known_metric(name: &str, entry: &Entry, context: &mut CaseContext<'_>) -> Option<&'static MetricDef> {
    let known = find(name);
    if known.is_none() {
        let message = format!("there is no metric `{name}`");
        let names = METRICS.iter().map(|metric| metric.name).chain([CRITERIA]);
        let help = did_you_mean(name, "metrics", names);
        context.problems.push(Diagnostic::error(entry.key, message).help_opt(help));
    }
    known
}

fn check(
    metric: &'static MetricDef,
    entry: &Entry,
    value: &Tree,
    steps: &[BoundDecl<'_>],
    wiring: &Wiring,
    context: &mut CaseContext<'_>,
) -> Option<(Check, Option<Producer>)> {
    let before = context.problems.len();
    let (mut check, reference) = limits(metric, value, steps, wiring, context);
    let bounded = check.at_least.is_some() || check.at_most.is_some() || check.equals.is_some();
    if !bounded && metric.unit == Unit::Flag && !check.same_as_reference {
        // Naming what a property is compared with says that it must hold.
        check.equals = Some(Limit::Flag(true));
    }
    if context.problems.len() == before {
        context.problems.extend(incomplete(metric, entry, &check, reference.is_some()));
    }
    // The name of the step is the recipe's affair; the task has an input of this name.
    check.reference = reference.map(|_| "reference".to_owned());
    (context.problems.len() == before).then_some((check, reference))
}

/// The limits that a check names, and what it compares with.
fn limits(
    metric: &'static MetricDef,
    value: &Tree,
    steps: &[BoundDecl<'_>],
    wiring: &Wiring,
    context: &mut CaseContext<'_>,
) -> (Check, Option<Producer>) {
    let mut check = Check { metric: metric.name.to_owned(), ..Check::default() };
    let mut reference = None;
    if let Node::Table(table) = &value.value {
        for (key, entry) in table.in_order() {
            match key {
                "at-least" => check.at_least = limit(metric, key, &entry.value, context),
                "at-most" => check.at_most = limit(metric, key, &entry.value, context),
                "equals" => check.equals = limit(metric, key, &entry.value, context),
                "except" => check.except = groups(&entry.value, context),
                "files" => check.files = files(metric, &entry.value, context),
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
        check.equals = limit(metric, "equals", value, context);
        if !matches!(metric.unit, Unit::Flag | Unit::Count)
            && let Some(number) = check.equals.take()
        {
            context.problems.push(bare_number(metric, &number, value));
        }
    }
    (check, reference)
}

/// Whether the files written of the mesh must hold it as well.
fn files(metric: &MetricDef, value: &Tree, context: &mut CaseContext<'_>) -> bool {
    match &value.value {
        Node::Bool(wanted) if metric.name == "groups-kept" => return *wanted,
        Node::Bool(_) => {
            let message = format!("`files` is for `groups-kept`; `{}` is judged on files as on the mesh", metric.name);
            context.problems.push(Diagnostic::error(value.span, message).help("leave it out"));
        }
        other => {
            let message = format!("`files` is true or false, got {}", other.kind());
            context.problems.push(Diagnostic::error(value.span, message));
        }
    }
    false
}

/// A number without a word means equality, which no measured length or ratio ever has, and is never what was meant.
fn bare_number(metric: &MetricDef, limit: &Limit, value: &Tree) -> Diagnostic {
    let name = metric.name;
    let written = match limit {
        Limit::Percent(percent) => format!("\"{percent}%\""),
        Limit::Number(number) => number.to_string(),
        Limit::Flag(flag) => flag.to_string(),
    };
    let side = match metric.direction {
        Direction::Higher => format!("{{ at-least = {written} }}"),
        Direction::Lower => format!("{{ at-most = {written} }}"),
        Direction::Neutral => format!("{{ at-least = {written} }} or {{ at-most = {written} }}"),
    };
    let message = format!("`{name} = {written}` does not say on which side of the limit a mesh must be");
    let help = format!("write {name} = {side}, or {{ equals = {written} }} if it must be just that");
    Diagnostic::error(value.span, message).help(help)
}

/// What a check lacks.
fn incomplete(metric: &MetricDef, entry: &Entry, check: &Check, compared: bool) -> Option<Diagnostic> {
    let name = metric.name;
    if metric.needs == Needs::Reference && !compared {
        let message = format!("the check of `{name}` does not say what to compare with");
        let help = format!("write {name} = {{ to = \"STEP\", … }}");
        return Some(Diagnostic::error(entry.key, message).help(help));
    }
    let bounded = check.at_least.is_some() || check.at_most.is_some() || check.equals.is_some();
    if !bounded && !check.same_as_reference && !check.no_more_than_reference {
        let message = format!("the check of `{name}` has no limit");
        let help = "give `at-least`, `at-most`, `equals`, `same-as` or `no-more-than`";
        return Some(Diagnostic::error(entry.key, message).help(help));
    }
    if !check.except.is_empty() && !judges_faces(check) {
        let message = format!("`except` leaves out faces, but this check of `{name}` does not judge faces one by one");
        let help = "drop `except`, or check the least or largest value of a face, or an upper bound of `distance`";
        return Some(Diagnostic::error(entry.key, message).help(help));
    }
    None
}

fn limit(metric: &MetricDef, key: &str, value: &Tree, context: &mut CaseContext<'_>) -> Option<Limit> {
    let limit = match &value.value {
        Node::Bool(flag) => Some(Limit::Flag(*flag)),
        Node::Number(_) => value.as_number().filter(|number| number.is_finite()).map(Limit::Number),
        Node::Text(text) => percent(text).map(Limit::Percent),
        Node::Date(_) | Node::List(_) | Node::Table(_) | Node::File(_) => None,
    };
    let wanted = match metric.unit {
        Unit::Flag => "true or false",
        Unit::Length => "a number in mesh units or a percent of the diagonal such as \"2%\"",
        Unit::Share => "a number from 0 to 1 or a percent such as \"75%\"",
        Unit::Count => "a whole number",
        Unit::Degrees => "a number of degrees",
        Unit::Area | Unit::Volume | Unit::Ratio => "a number",
    };
    let fits = match limit {
        Some(Limit::Flag(_)) => metric.unit == Unit::Flag && key == "equals",
        Some(Limit::Percent(_)) => matches!(metric.unit, Unit::Length | Unit::Share),
        Some(Limit::Number(_)) => metric.unit != Unit::Flag,
        None => false,
    };
    if fits {
        return limit;
    }
    let written = match (&value.value, limit) {
        (_, Some(Limit::Percent(percent))) => format!("{percent}%"),
        (_, Some(Limit::Number(number))) => number.to_string(),
        (_, Some(Limit::Flag(flag))) => flag.to_string(),
        (Node::Text(text), None) => format!("\"{text}\""),
        (other, None) => other.kind().to_owned(),
    };
    let wanted = if metric.unit == Unit::Flag && key != "equals" { "only for numbers" } else { wanted };
    let message = format!("`{key}` of `{}` is {wanted}, got {written}", metric.name);
    context.problems.push(Diagnostic::error(value.span, message));
    None
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
    let found = producer(name, value.span, steps, context)?;
    if let Some(port) = wiring.port(found)
        && !is_mesh(port)
    {
        let message = format!("`{name}` gives {port}, which a mesh cannot be compared with");
        context.problems.push(Diagnostic::error(value.span, message));
    }
    Some(found)
}
