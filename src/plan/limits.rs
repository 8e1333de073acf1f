//! The `[limits]` section: how long steps may take.
//!
//! A limit decides whether a result comes, never which, and is no part of a key. Steps that measure have none: what
//! they find out is kept for others of the same run, and what was cut off would be wrong for them.

use std::collections::BTreeMap;
use std::time::Duration;

use super::bind::BoundDecl;
use super::case::CaseContext;
use crate::recipe::suggest::did_you_mean;
use crate::recipe::{Diagnostic, Entry, Node, Table, Tree, is_full};
use crate::step::{OutPort, Port};

/// The keys of the section.
pub const LIMITS_KEYS: [&str; 2] = ["timeout", "steps"];
/// The keys of a step's own limits.
pub const LIMIT_KEYS: [&str; 1] = ["timeout"];

/// Nobody waits longer, and clocks can count so far.
const LONGEST: f64 = 365.0 * 86_400.0;

/// Limits of the steps of a case.
pub(super) struct Limits {
    usual: Option<Duration>,
    own: BTreeMap<String, Option<Duration>>,
}

impl Limits {
    pub(super) fn read(steps: &[BoundDecl<'_>], context: &mut CaseContext<'_>) -> Self {
        let mut limits = Self { usual: None, own: BTreeMap::new() };
        let recipe = context.recipe;
        for (key, entry) in recipe.limits.in_order() {
            match (key, &entry.value.value) {
                ("timeout", _) => limits.usual = timeout(&entry.value, context).unwrap_or_default(),
                ("steps", Node::Table(table)) => limits.steps(table, steps, context),
                ("steps", other) => {
                    let message = format!("`steps` of the limits is a table, got {}", other.kind());
                    let help = "write [limits.steps] and below it NAME = { timeout = \"10 min\" }";
                    context.problems.push(Diagnostic::error(entry.value.span, message).help(help));
                }
                _ => unknown(key, entry, &LIMITS_KEYS, context),
            }
        }
        limits
    }

    fn steps(&mut self, table: &Table, steps: &[BoundDecl<'_>], context: &mut CaseContext<'_>) {
        for (name, entry) in table.in_order() {
            if is_full(&context.problems) {
                break;
            }
            let Some(step) = context.recipe.steps.iter().find(|step| step.name == name) else {
                let names = context.recipe.steps.iter().map(|step| step.name.as_str());
                let help = did_you_mean(name, "the recipe has the steps", names);
                let message = format!("the recipe has no step `{name}`");
                context.problems.push(Diagnostic::error(entry.key, message).help_opt(help));
                continue;
            };
            if steps.iter().any(|bound| bound.decl.name == step.name && measures(bound, "main")) {
                let message = format!("`{name}` measures, and measuring has no limit");
                context.problems.push(Diagnostic::error(entry.key, message).help("leave it out"));
            }
            let Node::Table(own) = &entry.value.value else {
                let message = format!("the limits of a step are a table, got {}", entry.value.value.kind());
                let help = format!("write {name} = {{ timeout = \"10 min\" }}");
                context.problems.push(Diagnostic::error(entry.value.span, message).help(help));
                continue;
            };
            for (key, value) in own.in_order() {
                if key == "timeout" {
                    self.own.extend(timeout(&value.value, context).ok().map(|timeout| (name.to_owned(), timeout)));
                } else {
                    unknown(key, value, &LIMIT_KEYS, context);
                }
            }
        }
    }

    /// How long an output of a step may take.
    pub(super) fn of(&self, step: &BoundDecl<'_>, output: &str) -> Option<Duration> {
        if measures(step, output) {
            return None;
        }
        self.own.get(&step.decl.name).copied().unwrap_or(self.usual)
    }
}

fn measures(step: &BoundDecl<'_>, output: &str) -> bool {
    step.def.output(output).is_some_and(|output| output.port == OutPort::Is(Port::Metrics))
}

fn unknown(key: &str, entry: &Entry, keys: &[&str], context: &mut CaseContext<'_>) {
    let help = did_you_mean(key, "keys", keys.iter().copied());
    let message = format!("limits have no key `{key}`");
    context.problems.push(Diagnostic::error(entry.key, message).help_opt(help));
}

/// What was written is wrong, which was told.
struct Told;

/// A time; `None` for `false`, which is no limit.
fn timeout(value: &Tree, context: &mut CaseContext<'_>) -> Result<Option<Duration>, Told> {
    let recipe = context.recipe;
    let value = context.scope.substitute(value, &recipe.sources, &mut context.problems).ok_or(Told)?;
    let seconds = match &value.value {
        Node::Bool(false) => return Ok(None),
        Node::Number(_) => value.as_number(),
        Node::Text(text) => seconds(text),
        Node::Bool(_) | Node::Date(_) | Node::List(_) | Node::Table(_) | Node::File(_) => None,
    };
    if let Some(seconds) = seconds.filter(|seconds| *seconds > 0.0 && *seconds <= LONGEST) {
        return Ok(Some(Duration::from_secs_f64(seconds)));
    }
    let message = "`timeout` is a number of seconds, or a time such as \"90 s\", \"10 min\" or \"2 h\"";
    context.problems.push(Diagnostic::error(value.span, message).help("at most a year; false for no limit"));
    Err(Told)
}

/// A number with its unit of time.
fn seconds(text: &str) -> Option<f64> {
    let text = text.trim();
    let split = text.find(|letter: char| letter.is_alphabetic())?;
    let (number, unit) = text.split_at(split);
    let number: f64 = number.trim().parse().ok()?;
    let unit = match unit {
        "s" => 1.0,
        "min" => 60.0,
        "h" => 3600.0,
        _ => return None,
    };
    Some(number * unit)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_have_units() {
        for (text, expected) in [
            ("90 s", Some(90.0)),
            ("1.5min", Some(90.0)),
            (" 2 h ", Some(7200.0)),
            ("90", None),
            ("h", None),
            ("2 days", None),
            ("1e2 s", None),
        ] {
            assert_eq!(seconds(text), expected, "{text}");
        }
    }
}
