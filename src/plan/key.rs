//! The key of a task, and the record that explains it.
//!
//! [`walk`] visits the fields on which a task's result depends. The key hashes that walk and the [`Record`] prints it,
//! so what `plan` says about a missing result cannot drift from what the cache looks up.
//!
//! # Invariants
//! - Equal fields give equal keys on every machine; floats count by their bits, with −0 as 0.
//! - Fields are delimited, so no two different walks hash the same bytes.
//! - A changed revision, codec, parameter, lock or input content changes the key, and nothing else does.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::task::{GateTask, StepTask, Task};

/// BLAKE3 of what a task's result depends on; the name of the result in the cache.
pub type Key = blake3::Hash;

/// BLAKE3 of the canonical bytes of an artifact, or of the bytes of a file.
pub type ContentHash = blake3::Hash;

/// Raised whenever an equal mesh may give another verdict of a gate.
pub const GATE_REVISION: u32 = 4;

/// Raised whenever an equal mesh may be judged otherwise by equal criteria.
pub const CRITERIA_REVISION: u32 = 1;

/// One value of a walk.
#[derive(Clone, Copy, Debug)]
pub enum Field<'a> {
    /// A text.
    Text(&'a str),
    /// A whole number.
    Integer(i128),
    /// A float; −0 counts as 0.
    Float(f64),
    /// Yes or no.
    Flag(bool),
    /// Nothing was given.
    Absent,
    /// A list or table of so many entries, which follow.
    Entries(usize),
    /// The content of an input.
    Content(ContentHash),
}

/// Receives the fields of a task, in an order that depends on the task only.
pub trait Manifest {
    /// One field, named for a reader.
    fn field(&mut self, name: &str, value: Field<'_>);
}

/// Visits everything that the result of `task` depends on. `inputs` are contents by input name; their order is free.
/// A source has no fields: its content is hashed by whoever reads it.
pub fn walk(task: &Task, codec_version: u32, inputs: &[(&str, ContentHash)], manifest: &mut dyn Manifest) {
    match task {
        Task::Source(_) => {}
        Task::Step(step) => walk_step(step, codec_version, manifest),
        Task::Gate(gate) => walk_gate(gate, manifest),
    }
    let mut inputs = inputs.to_vec();
    inputs.sort_unstable_by_key(|(name, _)| *name);
    for (name, content) in inputs {
        manifest.field(&format!("input {name}"), Field::Content(content));
    }
}

fn walk_step(step: &StepTask, codec_version: u32, manifest: &mut dyn Manifest) {
    manifest.field("step", Field::Text(step.def.name));
    manifest.field("output", Field::Text(step.output));
    manifest.field("revision", Field::Integer(step.def.revision.into()));
    manifest.field("codec", Field::Integer(codec_version.into()));
    walk_json("parameter", &step.bound.canonical(), manifest);
    if step.def.edits {
        walk_json("lock", &serde_json::to_value(&step.locks).unwrap_or(Value::Null), manifest);
    }
    for (input, ending) in &step.endings {
        manifest.field(&format!("ending of {input}"), Field::Text(ending));
    }
}

fn walk_gate(gate: &GateTask, manifest: &mut dyn Manifest) {
    if let Some(criteria) = &gate.criteria {
        manifest.field("criteria", Field::Text(&criteria.name));
        manifest.field("revision", Field::Integer(CRITERIA_REVISION.into()));
        let json = |value: serde_json::Result<Value>| value.unwrap_or(Value::Null);
        walk_json("penalties", &json(serde_json::to_value(criteria.penalties)), manifest);
        walk_json("except", &json(serde_json::to_value(&criteria.except)), manifest);
        for criterion in &criteria.criteria {
            let name = format!("criterion {}", criterion.metric);
            walk_json(&name, &json(serde_json::to_value(criterion)), manifest);
        }
        return;
    }
    manifest.field("gate", Field::Entries(gate.checks.len()));
    manifest.field("revision", Field::Integer(GATE_REVISION.into()));
    for check in &gate.checks {
        walk_json(&format!("check {}", check.metric), &serde_json::to_value(check).unwrap_or(Value::Null), manifest);
    }
}

/// The leaves of a JSON value, tables by key order, named `prefix a.b[0]`.
fn walk_json(prefix: &str, value: &Value, manifest: &mut dyn Manifest) {
    match value {
        Value::Null => manifest.field(prefix, Field::Absent),
        Value::Bool(flag) => manifest.field(prefix, Field::Flag(*flag)),
        Value::Number(number) => {
            let field = if let Some(value) = number.as_u64() {
                Field::Integer(value.into())
            } else if let Some(value) = number.as_i64() {
                Field::Integer(value.into())
            } else {
                Field::Float(number.as_f64().unwrap_or(f64::NAN))
            };
            manifest.field(prefix, field);
        }
        Value::String(text) => manifest.field(prefix, Field::Text(text)),
        Value::Array(items) => {
            manifest.field(prefix, Field::Entries(items.len()));
            for (index, item) in items.iter().enumerate() {
                walk_json(&format!("{prefix}[{index}]"), item, manifest);
            }
        }
        Value::Object(table) => {
            manifest.field(prefix, Field::Entries(table.len()));
            let sorted: BTreeMap<&str, &Value> = table.iter().map(|(key, value)| (key.as_str(), value)).collect();
            let separator = if prefix.contains(' ') { '.' } else { ' ' };
            for (key, value) in sorted {
                walk_json(&format!("{prefix}{separator}{key}"), value, manifest);
            }
        }
    }
}

/// Hashes a walk.
#[derive(Default)]
struct KeyHasher(blake3::Hasher);

impl KeyHasher {
    fn part(&mut self, tag: u8, bytes: &[u8]) {
        self.0.update(&[tag]);
        self.0.update(&(bytes.len() as u64).to_le_bytes());
        self.0.update(bytes);
    }
}

impl Manifest for KeyHasher {
    fn field(&mut self, name: &str, value: Field<'_>) {
        self.part(0, name.as_bytes());
        match value {
            Field::Text(text) => self.part(1, text.as_bytes()),
            Field::Integer(value) => self.part(2, &value.to_le_bytes()),
            Field::Float(value) => self.part(3, &(value + 0.0).to_bits().to_le_bytes()),
            Field::Flag(value) => self.part(4, &[u8::from(value)]),
            Field::Absent => self.part(5, &[]),
            Field::Entries(count) => self.part(6, &(count as u64).to_le_bytes()),
            Field::Content(hash) => self.part(7, hash.as_bytes()),
        }
    }
}

/// The fields behind a key, stored beside a result so that a later run can say what changed.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Record {
    /// Name and short value, in the order of the walk.
    pub fields: Vec<(String, String)>,
}

impl Manifest for Record {
    fn field(&mut self, name: &str, value: Field<'_>) {
        let text = match value {
            Field::Text(text) => format!("{text:?}"),
            Field::Integer(value) => value.to_string(),
            Field::Float(value) => format!("{:?}", value + 0.0),
            Field::Flag(value) => value.to_string(),
            Field::Absent => "not given".to_owned(),
            Field::Entries(count) => format!("{count} entries"),
            Field::Content(hash) => hash.to_hex().to_string(),
        };
        self.fields.push((name.to_owned(), text));
    }
}

/// The key of a task whose inputs have these contents.
pub fn task_key(task: &Task, codec_version: u32, inputs: &[(&str, ContentHash)]) -> Key {
    let mut hasher = KeyHasher::default();
    walk(task, codec_version, inputs, &mut hasher);
    hasher.0.finalize()
}

/// The record of a task whose inputs have these contents; equal exactly when the keys are.
pub fn task_record(task: &Task, codec_version: u32, inputs: &[(&str, ContentHash)]) -> Record {
    let mut record = Record::default();
    walk(task, codec_version, inputs, &mut record);
    record
}

/// Why a task has to run although an earlier result of the same step is known.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Change {
    /// A parameter or lock, with both values (`not given` where it was absent).
    Value {
        /// Name of the field, such as `parameter tolerance`.
        name: String,
        /// Before.
        from: String,
        /// Now.
        to: String,
    },
    /// An input's content.
    Input {
        /// Name of the input.
        name: String,
    },
    /// The step's own revision.
    Revision {
        /// Before.
        from: String,
        /// Now.
        to: String,
    },
}

impl std::fmt::Display for Change {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Value { name, from, to } => write!(f, "{name} from {from} to {to}"),
            Self::Input { name } => write!(f, "input `{name}` changed"),
            Self::Revision { from, to } => write!(f, "revision from {from} to {to}"),
        }
    }
}

impl Record {
    /// What differs from an earlier record, in the order of this walk; fields that are gone come last.
    pub fn changes_since(&self, earlier: &Self) -> Vec<Change> {
        let before: BTreeMap<&str, &str> = earlier.fields.iter().map(|(n, v)| (n.as_str(), v.as_str())).collect();
        let now: BTreeMap<&str, &str> = self.fields.iter().map(|(n, v)| (n.as_str(), v.as_str())).collect();
        let absent = "not given";
        let mut changes = Vec::new();
        for (name, to) in &self.fields {
            let from = before.get(name.as_str()).copied().unwrap_or(absent);
            if from != to {
                changes.push(Change::of(name, from, to));
            }
        }
        for (name, from) in &earlier.fields {
            if !now.contains_key(name.as_str()) {
                changes.push(Change::of(name, from, absent));
            }
        }
        changes
    }

    /// The value of a field.
    pub fn get(&self, name: &str) -> Option<&str> {
        self.fields.iter().find(|(field, _)| field == name).map(|(_, value)| value.as_str())
    }
}

impl Change {
    fn of(name: &str, from: &str, to: &str) -> Self {
        if let Some(input) = name.strip_prefix("input ") {
            Self::Input { name: input.to_owned() }
        } else if name == "revision" {
            Self::Revision { from: from.to_owned(), to: to.to_owned() }
        } else {
            Self::Value { name: name.to_owned(), from: from.to_owned(), to: to.to_owned() }
        }
    }
}
