//! One step of a recipe: its table taken apart into inputs, locks and typed parameters.
//!
//! The typed reader stops at its first error. So that all are reported at once, names are checked against the step's
//! schema beforehand, and after an error in a value the reader tries again without that value.

use std::path::PathBuf;
use std::sync::Arc;

use serde::Deserialize;
use serde_json::Value;
use toml::Spanned;
use toml::de::{DeValue, ValueDeserializer};

use super::case::CaseContext;
use crate::recipe::suggest::{closest, did_you_mean};
use crate::recipe::{Diagnostic, Entry, Node, Span, StepDecl, Table, is_full, normalize};
use crate::step::parameters::ParameterSchema;
use crate::step::{BoundStep, Locks, Port, StepDef};

/// The common keys of steps that edit.
pub const LOCK_KEYS: [&str; 4] = ["keep", "on-curve", "only", "boundary"];

/// A step whose table has been read.
pub(super) struct BoundDecl<'r> {
    pub(super) decl: &'r StepDecl,
    pub(super) def: &'static StepDef,
    /// `None` when the parameters are wrong.
    pub(super) bound: Option<Arc<dyn BoundStep>>,
    pub(super) locks: Locks,
    pub(super) files: Vec<(&'static str, PathBuf)>,
    pub(super) links: Vec<Link>,
}

/// An input that names another step.
#[derive(Clone, Debug)]
pub(super) struct Link {
    pub(super) input: &'static str,
    pub(super) accepts: &'static [Port],
    /// `STEP` or `STEP.OUTPUT`.
    pub(super) target: String,
    pub(super) span: Span,
}

/// Reads the table of a step; `None` when its kind is unknown, or there are enough problems already.
pub(super) fn bind<'r>(decl: &'r StepDecl, context: &mut CaseContext<'r>) -> Option<BoundDecl<'r>> {
    if is_full(&context.problems) {
        return None;
    }
    let Some(def) = context.catalog.iter().find(|def| def.name == decl.kind) else {
        let help = did_you_mean(&decl.kind, "kinds of step", context.catalog.iter().map(|def| def.name));
        let message = format!("there is no kind of step `{}`", decl.kind);
        context.problems.push(Diagnostic::error(decl.kind_place, message).help_opt(help));
        return None;
    };
    let recipe = context.recipe;
    let (mut table, lost) = context.scope.substitute_table(&decl.table, &recipe.sources, &mut context.problems);
    let mut bound = BoundDecl { decl, def, bound: None, locks: Locks::default(), files: Vec::new(), links: Vec::new() };
    take_inputs(&mut bound, &mut table, &lost, context);
    let schema = context.schema(def).clone();
    if def.edits {
        bound.locks = take_locks(&mut table, &schema, context);
    }
    let whole = check_keys(def, &mut table, &lost, &schema, decl, context);
    let step = read_parameters(def, decl, table, lost, &schema, context);
    bound.bound = step.filter(|_| whole);
    Some(bound)
}

fn take_inputs(bound: &mut BoundDecl<'_>, table: &mut Table, lost: &[String], context: &mut CaseContext<'_>) {
    for input in bound.def.inputs {
        let is_file = input.accepts.contains(&Port::File);
        let Some(entry) = table.take(input.name) else {
            if input.required && !lost.iter().any(|key| key == input.name) {
                let decl = bound.decl;
                let message = format!("the step `{}` needs `{}`", decl.name, input.name);
                let example = if is_file { "=inputs.part" } else { "STEP" };
                let help = format!("{}: write {} = \"{example}\"", input.doc, input.name);
                context.problems.push(Diagnostic::error(decl.place, message).help(help));
            }
            continue;
        };
        if is_file {
            take_file(bound, input.name, &entry, context);
            continue;
        }
        match entry.value.value {
            Node::Text(target) => {
                bound.links.push(Link { input: input.name, accepts: input.accepts, target, span: entry.value.span });
            }
            other => {
                let message = format!("`{}` names a step, got {}", input.name, other.kind());
                let mut problem = Diagnostic::error(entry.value.span, message);
                if matches!(other, Node::File(_)) {
                    problem = problem.help("a step with use = \"read\" and file = \"=inputs.NAME\" reads the file");
                }
                context.problems.push(problem);
            }
        }
    }
}

fn take_file(bound: &mut BoundDecl<'_>, input: &'static str, entry: &Entry, context: &mut CaseContext<'_>) {
    let Some(path) = context.recipe.file(&entry.value) else {
        let message = format!("`{input}` names a file, got {}", entry.value.value.kind());
        context.problems.push(Diagnostic::error(entry.value.span, message));
        return;
    };
    if let Err(reason) = context.check_file(&path) {
        let mut problem =
            Diagnostic::error(entry.value.span, format!("cannot read `{}`: {reason}", normalize(&path).display()));
        let used = context.recipe.inputs.in_order().into_iter().find(|(_, input)| {
            matches!(entry.value.value, Node::File(_)) && context.recipe.file(&input.value).as_ref() == Some(&path)
        });
        if let Some((_, input)) = used {
            problem = Diagnostic { labels: Vec::new(), ..problem }
                .label(input.value.span, "named here")
                .label(entry.value.span, "read here");
        }
        let help = "a path is relative to the recipe that writes it, and `--input NAME=FILE` to the working folder";
        context.problems.push(problem.help(help));
        return;
    }
    bound.files.push((input, path));
}

fn take_locks(table: &mut Table, schema: &ParameterSchema, context: &mut CaseContext<'_>) -> Locks {
    let mut locks = Table::default();
    for key in LOCK_KEYS {
        if !schema.properties.contains_key(key)
            && let Some(entry) = table.take(key)
        {
            locks.entries.insert(key.to_owned(), entry);
        }
    }
    let mut read = None;
    while read.is_none() {
        let tree = Spanned::new(0..0, DeValue::Table(locks.to_toml()));
        match Locks::deserialize(ValueDeserializer::from(tree)) {
            Ok(locks) => read = Some(locks),
            Err(error) => {
                if report(&error, &mut locks, context).is_none() {
                    return Locks::default();
                }
            }
        }
    }
    read.unwrap_or_default()
}

/// Checks names and required parameters; takes unknown keys out. Whether all is well.
fn check_keys(
    def: &StepDef,
    table: &mut Table,
    lost: &[String],
    schema: &ParameterSchema,
    decl: &StepDecl,
    context: &mut CaseContext<'_>,
) -> bool {
    let before = context.problems.len();
    let locks: &[&str] = if def.edits { &LOCK_KEYS } else { &[] };
    let parameters = || schema.properties.keys().map(String::as_str);
    let unknown: Vec<String> =
        table.entries.keys().filter(|key| !schema.properties.contains_key(*key)).cloned().collect();
    for key in unknown {
        let Some(entry) = table.take(&key) else { continue };
        if is_full(&context.problems) {
            continue;
        }
        let help = if LOCK_KEYS.contains(&key.as_str()) {
            Some(format!("`{}` changes nothing that could be kept", def.name))
        } else {
            let choices = parameters().chain(def.inputs.iter().map(|input| input.name)).chain(locks.iter().copied());
            did_you_mean(&key, &format!("`{}` takes", def.name), choices)
        };
        let message = format!("the step kind `{}` has no parameter `{key}`", def.name);
        context.problems.push(Diagnostic::error(entry.key, message).help_opt(help));
    }
    for name in &schema.required {
        if table.get(name).is_none() && !lost.contains(name) {
            let message = format!("the step `{}` needs the parameter `{name}`", decl.name);
            let help = describe(schema.properties.get(name));
            context.problems.push(Diagnostic::error(decl.place, message).help_opt(help));
        }
    }
    check_ranges(table, schema, context);
    context.problems.len() == before
}

fn describe(property: Option<&Value>) -> Option<String> {
    let text = property?.get("description")?.as_str()?;
    Some(text.replace('\n', " "))
}

/// Holds numbers against the ranges that the schema states.
fn check_ranges(table: &Table, schema: &ParameterSchema, context: &mut CaseContext<'_>) {
    for (key, entry) in &table.entries {
        let (Some(number), Some(property)) = (entry.value.as_number(), schema.properties.get(key)) else { continue };
        let bound = |name: &str| property.get(name).and_then(Value::as_f64);
        // What is no number lies in no range.
        let broken = |name: &str, is_out: fn(f64, f64) -> bool, words: &str| {
            let limit = bound(name).filter(|&limit| number.is_nan() || is_out(number, limit))?;
            Some(format!("{words} {limit}"))
        };
        let low = broken("minimum", |number, limit| number < limit, "at least");
        let high = broken("maximum", |number, limit| number > limit, "at most");
        let above = broken("exclusiveMinimum", |number, limit| number <= limit, "greater than");
        let below = broken("exclusiveMaximum", |number, limit| number >= limit, "less than");
        if let Some(range) = low.or(high).or(above).or(below) {
            let message = format!("`{key}` must be {range}, got {number}");
            let problem = Diagnostic::error(entry.value.span, message).help_opt(describe(Some(property)));
            context.problems.push(problem);
        }
    }
}

fn read_parameters(
    def: &StepDef,
    decl: &StepDecl,
    mut table: Table,
    lost: Vec<String>,
    schema: &ParameterSchema,
    context: &mut CaseContext<'_>,
) -> Option<Arc<dyn BoundStep>> {
    let mut complete = lost.is_empty() && schema.required.iter().all(|name| table.get(name).is_some());
    loop {
        let tree = Spanned::new(decl.place.range(), DeValue::Table(table.to_toml()));
        match (def.bind)(ValueDeserializer::from(tree)) {
            Ok(step) => return complete.then_some(step),
            // A value that is missing or was taken out has been reported.
            Err(error) if error.message().starts_with("missing field") && !complete => return None,
            Err(error) => report(&error, &mut table, context)?,
        }
        complete = false;
    }
}

/// Reports an error of the typed reader and takes the value at fault out; `None` when no value is.
fn report(error: &toml::de::Error, table: &mut Table, context: &mut CaseContext<'_>) -> Option<()> {
    let span = error.span().map(Span::of).unwrap_or_default();
    let holds =
        |entry: &Entry| (entry.value.span.start <= span.start && span.end <= entry.value.span.end) || entry.key == span;
    let culprit = table.entries.iter().find(|(_, entry)| holds(entry)).map(|(key, _)| key.clone());
    let (message, help) = friendly(error.message());
    let Some(culprit) = culprit else {
        context.problems.push(Diagnostic::error(span, message).help_opt(help));
        return None;
    };
    let message = format!("`{culprit}`: {message}");
    let mut problem = Diagnostic::error(span, message).help_opt(help);
    if let Some(entry) = table.take(&culprit)
        && is_formula(context.recipe.sources.text(entry.value.span))
        && let Some(value) = shown(&entry.value.value)
    {
        problem = problem.note(format!("its value is {value}"));
    }
    context.problems.push(problem);
    Some(())
}

fn is_formula(written: &str) -> bool {
    written.trim_start_matches(['"', '\'']).starts_with('=')
}

fn shown(value: &Node) -> Option<String> {
    match value {
        Node::Number(spelling) => Some(spelling.clone()),
        Node::Text(text) => Some(format!("\"{text}\"")),
        Node::Bool(value) => Some(value.to_string()),
        Node::File(path) => Some(format!("the file {}", path.display())),
        Node::Date(_) | Node::List(_) | Node::Table(_) => None,
    }
}

/// The typed reader's message in a recipe writer's words, and what was probably meant.
fn friendly(message: &str) -> (String, Option<String>) {
    let mut text = message.trim_end().to_owned();
    for (rust, plain) in [
        ("floating point", "number"),
        ("expected f64", "expected a number"),
        ("expected f32", "expected a number"),
        ("expected a sequence", "expected an array"),
    ] {
        text = text.replace(rust, plain);
    }
    for integer in ["u8", "u16", "u32", "u64", "usize"] {
        text = text.replace(&format!("expected {integer}"), "expected a whole number, 0 or more");
    }
    for integer in ["i8", "i16", "i32", "i64", "isize"] {
        text = text.replace(&format!("expected {integer}"), "expected a whole number");
    }
    let help = text.strip_prefix("unknown variant `").and_then(|rest| {
        let (wrong, rest) = rest.split_once('`')?;
        let choices: Vec<&str> = rest.split('`').skip(1).step_by(2).collect();
        closest(wrong, choices.iter().copied()).map(|meant| format!("did you mean `{meant}`?"))
    });
    (text, help)
}
