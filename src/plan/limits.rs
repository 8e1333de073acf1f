//! The `[limits]` section: how long steps may take, how much memory, and how often they are tried again.
//!
//! A limit decides whether a result comes, never which, and is no part of a key. Steps that measure have none: what
//! they find out is kept for others of the same run, and what was cut off would be wrong for them.

use std::collections::BTreeMap;
use std::time::Duration;

use super::bind::BoundDecl;
use super::case::CaseContext;
use crate::recipe::suggest::did_you_mean;
use crate::recipe::{Diagnostic, Entry, Node, Table, Tree, is_full};
use crate::step::{OutPort, Port, amount};

/// The keys of the section.
pub const LIMITS_KEYS: [&str; 4] = ["timeout", "memory", "retries", "steps"];
/// The keys of a step's own limits.
pub const LIMIT_KEYS: [&str; 3] = ["timeout", "memory", "retries"];

/// Nobody waits longer, and clocks can count so far.
const LONGEST: f64 = 365.0 * 86_400.0;
/// What has failed so often fails again.
const MOST_RETRIES: f64 = 100.0;

/// What a task may take.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TaskLimits {
    /// How long, as long as it likes where there is none.
    pub timeout: Option<Duration>,
    /// How many bytes at once, beyond what was there when it began; any number where there is none.
    pub memory: Option<u64>,
    /// How often it is tried again after a limit or the disk ended it.
    pub retries: u32,
}

impl TaskLimits {
    /// The more patient of both in everything.
    #[must_use]
    pub fn or_more(self, other: Self) -> Self {
        Self {
            timeout: self.timeout.zip(other.timeout).map(|(a, b)| a.max(b)),
            memory: self.memory.zip(other.memory).map(|(a, b)| a.max(b)),
            retries: self.retries.max(other.retries),
        }
    }
}

/// A limit as it was written.
#[derive(Clone, Copy)]
enum Limit<T> {
    AtMost(T),
    No,
}

impl<T> Limit<T> {
    fn at_most(self) -> Option<T> {
        match self {
            Self::AtMost(limit) => Some(limit),
            Self::No => None,
        }
    }
}

/// What a step's own table says, or the section for all of them.
#[derive(Clone, Copy, Default)]
struct Own {
    timeout: Option<Limit<Duration>>,
    memory: Option<Limit<u64>>,
    retries: Option<u32>,
}

impl Own {
    /// Takes over a key; false where there is no such key.
    fn read(&mut self, key: &str, value: &Tree, context: &mut CaseContext<'_>) -> bool {
        match key {
            "timeout" => self.timeout = timeout(value, context).ok(),
            "memory" => self.memory = memory_limit(value, context).ok(),
            "retries" => self.retries = retries(value, context).ok(),
            _ => return false,
        }
        true
    }
}

/// Limits of the steps of a case.
pub(super) struct Limits {
    usual: Own,
    own: BTreeMap<String, Own>,
}

impl Limits {
    pub(super) fn read(steps: &[BoundDecl<'_>], context: &mut CaseContext<'_>) -> Self {
        let mut limits = Self { usual: Own::default(), own: BTreeMap::new() };
        let recipe = context.recipe;
        for (key, entry) in recipe.limits.in_order() {
            match (key, &entry.value.value) {
                ("steps", Node::Table(table)) => limits.steps(table, steps, context),
                ("steps", other) => {
                    let message = format!("`steps` of the limits is a table, got {}", other.kind());
                    let help = "write [limits.steps] and below it NAME = { timeout = \"10 min\" }";
                    context.problems.push(Diagnostic::error(entry.value.span, message).help(help));
                }
                _ if limits.usual.read(key, &entry.value, context) => {}
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
            let Node::Table(table) = &entry.value.value else {
                let message = format!("the limits of a step are a table, got {}", entry.value.value.kind());
                let help = format!("write {name} = {{ timeout = \"10 min\" }}");
                context.problems.push(Diagnostic::error(entry.value.span, message).help(help));
                continue;
            };
            let mut own = Own::default();
            for (key, value) in table.in_order() {
                if !own.read(key, &value.value, context) {
                    unknown(key, value, &LIMIT_KEYS, context);
                }
            }
            self.own.insert(name.to_owned(), own);
        }
    }

    /// What an output of a step may take.
    pub(super) fn of(&self, step: &BoundDecl<'_>, output: &str) -> TaskLimits {
        let own = self.own.get(&step.decl.name).copied().unwrap_or_default();
        let retries = own.retries.or(self.usual.retries).unwrap_or_default();
        if measures(step, output) {
            return TaskLimits { retries, ..TaskLimits::default() };
        }
        TaskLimits {
            timeout: own.timeout.or(self.usual.timeout).and_then(Limit::at_most),
            memory: own.memory.or(self.usual.memory).and_then(Limit::at_most),
            retries,
        }
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

/// A time; `false` is no limit.
fn timeout(value: &Tree, context: &mut CaseContext<'_>) -> Result<Limit<Duration>, Told> {
    let recipe = context.recipe;
    let value = context.scope.substitute(value, &recipe.sources, &mut context.problems).ok_or(Told)?;
    let seconds = match &value.value {
        Node::Bool(false) => return Ok(Limit::No),
        Node::Number(_) => value.as_number(),
        Node::Text(text) => seconds(text),
        Node::Bool(_) | Node::Date(_) | Node::List(_) | Node::Table(_) | Node::File(_) => None,
    };
    if let Some(seconds) = seconds.filter(|seconds| *seconds > 0.0 && *seconds <= LONGEST) {
        return Ok(Limit::AtMost(Duration::from_secs_f64(seconds)));
    }
    let message = "`timeout` is a number of seconds, or a time such as \"90 s\", \"10 min\" or \"2 h\"";
    context.problems.push(Diagnostic::error(value.span, message).help("at most a year; false for no limit"));
    Err(Told)
}

/// An amount of memory; `false` is no limit.
fn memory_limit(value: &Tree, context: &mut CaseContext<'_>) -> Result<Limit<u64>, Told> {
    let recipe = context.recipe;
    let value = context.scope.substitute(value, &recipe.sources, &mut context.problems).ok_or(Told)?;
    let bytes = match &value.value {
        Node::Bool(false) => return Ok(Limit::No),
        Node::Number(_) => value.as_number().filter(|bytes| *bytes > 0.0).map(|bytes| bytes as u64),
        Node::Text(text) => amount::bytes(text).filter(|bytes| *bytes > 0),
        Node::Bool(_) | Node::Date(_) | Node::List(_) | Node::Table(_) | Node::File(_) => None,
    };
    if let Some(bytes) = bytes {
        return Ok(Limit::AtMost(bytes));
    }
    let message = "`memory` is a number of bytes, or an amount such as \"500 MB\", \"2 GB\" or \"1.5 GiB\"";
    context.problems.push(Diagnostic::error(value.span, message).help("false for no limit"));
    Err(Told)
}

/// How often to try again.
fn retries(value: &Tree, context: &mut CaseContext<'_>) -> Result<u32, Told> {
    let recipe = context.recipe;
    let value = context.scope.substitute(value, &recipe.sources, &mut context.problems).ok_or(Told)?;
    match value.as_number() {
        Some(number) if (0.0..=MOST_RETRIES).contains(&number) && number.fract() == 0.0 => Ok(number as u32),
        _ => {
            let message = "`retries` is a whole number from 0 to 100";
            context.problems.push(Diagnostic::error(value.span, message).help("0 to try once only"));
            Err(Told)
        }
    }
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
