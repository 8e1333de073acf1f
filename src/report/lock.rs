//! Lock files: what a recipe was made of and what it gave, so that another run can be held against it.
//!
//! What goes in (parameters, inputs, revisions, every field of every key) must be the same in every class. What comes
//! out is compared as the class says: by bytes, by metrics, or by metrics within a tolerance.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use ron::ser::PrettyConfig;
use serde::{Deserialize, Serialize};

use super::{CaseReport, Report};
use crate::metric::Value;
use crate::run::{Figures, Plan, Record, Task};

/// How results are compared.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Class {
    /// Every result has the same bytes.
    #[default]
    Bytes,
    /// Every metric has the same value.
    Metrics,
    /// Every metric is the same within a relative tolerance.
    Tolerance,
}

/// A locked run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Lock {
    /// Version of the program that locked it.
    pub meshmill: String,
    /// Name of the recipe.
    pub recipe: String,
    /// How results are compared.
    pub class: Class,
    /// Relative tolerance of metrics, for the class of that name.
    pub tolerance: f64,
    /// Parameters with their values.
    pub params: BTreeMap<String, String>,
    /// By task, the fields of its key: parameters, revision, checks, contents of the files it reads.
    pub tasks: BTreeMap<String, BTreeMap<String, String>>,
    /// By step, what it gave.
    pub results: BTreeMap<String, Locked>,
    /// By gate and metric, what was measured.
    pub gates: BTreeMap<String, Option<Value>>,
    /// By output file, the hash of its bytes.
    pub files: BTreeMap<String, Option<String>>,
}

/// A locked result.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Locked {
    /// Hash of its bytes.
    pub content: Option<String>,
    /// Its metrics.
    pub metrics: BTreeMap<String, Value>,
}

/// What a plan would be locked to before anything has run: parameters and fields of keys.
pub fn ingredients(recipe: &str, plan: &Plan, records: &[Record]) -> Lock {
    let mut tasks = BTreeMap::new();
    for (id, record) in plan.order().zip(records) {
        let node = plan.node(id);
        if !matches!(node.task, Task::Source(_)) {
            tasks.insert(node.label.clone(), record.fields.iter().cloned().collect());
        }
    }
    Lock {
        meshmill: crate::run::VERSION.to_owned(),
        recipe: recipe.to_owned(),
        class: Class::default(),
        tolerance: 0.0,
        params: plan.cases().first().map(|case| case.params.clone()).unwrap_or_default(),
        tasks,
        results: BTreeMap::new(),
        gates: BTreeMap::new(),
        files: BTreeMap::new(),
    }
}

impl Lock {
    /// The lock with what a run gave. `out` is the folder that file names are relative to.
    #[must_use]
    pub fn with_results(mut self, report: &Report, out: &Path) -> Self {
        let Some(case) = report.cases.first() else { return self };
        for step in &case.steps {
            let metrics = step.figures.as_ref().map(metrics).unwrap_or_default();
            self.results.insert(step.name.clone(), Locked { content: step.content.clone(), metrics });
        }
        for gate in &case.gates {
            self.gates.extend(gate.rows.iter().map(|row| (format!("{}.{}", gate.step, row.metric), row.measured)));
        }
        self.files = files(case, out);
        self
    }

    /// The text of a lock file.
    pub fn to_ron(&self) -> Result<String, ron::Error> {
        let config = PrettyConfig::default().struct_names(false).indentor("  ");
        Ok(ron::ser::to_string_pretty(self, config)? + "\n")
    }

    /// The lock in a text.
    pub fn from_ron(text: &str) -> Result<Self, String> {
        ron::from_str(text).map_err(|error| error.to_string())
    }

    /// What differs in what goes in, one line each.
    pub fn changed_ingredients(&self, now: &Self) -> Vec<String> {
        let mut lines = Vec::new();
        if self.recipe != now.recipe {
            lines.push(format!("recipe: locked {}, now {}", self.recipe, now.recipe));
        }
        compare(&self.params, &now.params, |name, before, now| {
            lines.push(format!("parameter {name}: locked {}, now {}", said(before), said(now)));
        });
        compare(&self.tasks, &now.tasks, |task, before, now| match (before, now) {
            (Some(before), Some(now)) => compare(before, now, |field, before, now| {
                lines.push(field_line(task, field, before, now));
            }),
            (None, _) => lines.push(format!("{task}: is not locked")),
            (_, None) => lines.push(format!("{task}: locked, and now gone")),
        });
        lines
    }

    /// What differs in what came out, as this lock's class says, one line each.
    pub fn changed_results(&self, now: &Self) -> Vec<String> {
        let mut lines = Vec::new();
        let none = Locked::default();
        let names: BTreeSet<&String> = self.results.keys().chain(now.results.keys()).collect();
        for name in names {
            let (before, now) = (self.results.get(name).unwrap_or(&none), now.results.get(name).unwrap_or(&none));
            let mut found = Vec::new();
            self.compare_metrics(name, &before.metrics, &now.metrics, &mut found);
            if self.class == Class::Bytes && before.content != now.content {
                let (before, now) = (short(before.content.as_ref()), short(now.content.as_ref()));
                lines.push(format!("{name}: result locked as {before}, now {now}"));
            }
            lines.append(&mut found);
        }
        let values = |gates: &BTreeMap<String, Option<Value>>| -> BTreeMap<String, Value> {
            gates.iter().filter_map(|(name, value)| Some((name.clone(), (*value)?))).collect()
        };
        self.compare_metrics("gate", &values(&self.gates), &values(&now.gates), &mut lines);
        let (kept, written): (BTreeSet<_>, BTreeSet<_>) = (self.files.keys().collect(), now.files.keys().collect());
        lines.extend(kept.difference(&written).map(|file| format!("file {file}: locked, and now gone")));
        lines.extend(written.difference(&kept).map(|file| format!("file {file}: is not locked")));
        // Files carry the version of the program, so another version writes other bytes of an equal mesh.
        if self.class == Class::Bytes && self.meshmill == now.meshmill {
            for (file, before) in &self.files {
                if let Some(now) = now.files.get(file).filter(|now| *now != before) {
                    let (before, now) = (short(before.as_ref()), short(now.as_ref()));
                    lines.push(format!("file {file}: locked as {before}, now {now}"));
                }
            }
        }
        lines
    }

    fn compare_metrics(
        &self,
        of: &str,
        before: &BTreeMap<String, Value>,
        now: &BTreeMap<String, Value>,
        lines: &mut Vec<String>,
    ) {
        let tolerance = if self.class == Class::Tolerance { self.tolerance } else { 0.0 };
        compare(before, now, |metric, before, now| {
            if let (Some(before), Some(now)) = (before, now) {
                let (a, b) = (before.as_f64(), now.as_f64());
                if (a - b).abs() <= tolerance * a.abs().max(b.abs()) {
                    return;
                }
            }
            let text = |value: Option<&Value>| value.map_or_else(|| "undefined".to_owned(), super::measure::value_text);
            lines.push(format!("{of}.{metric}: locked {}, now {}", text(before), text(now)));
        });
    }
}

/// Calls `differ` for every key whose values are not the same.
fn compare<T: PartialEq, F: FnMut(&str, Option<&T>, Option<&T>)>(
    before: &BTreeMap<String, T>,
    now: &BTreeMap<String, T>,
    mut differ: F,
) {
    let names: BTreeSet<&String> = before.keys().chain(now.keys()).collect();
    for name in names {
        let (before, now) = (before.get(name), now.get(name));
        if before != now {
            differ(name, before, now);
        }
    }
}

fn field_line(task: &str, field: &str, before: Option<&String>, now: Option<&String>) -> String {
    match field.strip_prefix("input ") {
        Some(input) => format!("{task}: the file `{input}` changed from {} to {}", short(before), short(now)),
        None => format!("{task}: {field} locked {}, now {}", said(before), said(now)),
    }
}

fn said(value: Option<&String>) -> &str {
    value.map_or("not given", String::as_str)
}

fn short(hash: Option<&String>) -> &str {
    hash.map_or("nothing", |hash| hash.get(..12).unwrap_or(hash))
}

/// The figures of a result as metrics, with those that a `measure` step made.
pub(super) fn metrics(figures: &Figures) -> BTreeMap<String, Value> {
    let mut metrics = figures.metrics.as_ref().map(|table| table.values.clone()).unwrap_or_default();
    let mut note = |name: &str, value: Option<Value>| metrics.extend(value.map(|value| (name.to_owned(), value)));
    note("vertices", figures.vertices.map(Value::Count));
    note("faces", figures.faces.map(Value::Count));
    note("min-stretch", figures.min_stretch.map(Value::Number));
    note("mean-stretch", figures.mean_stretch.map(Value::Number));
    metrics
}

fn files(case: &CaseReport, out: &Path) -> BTreeMap<String, Option<String>> {
    let name = |path: &str| {
        let path = Path::new(path);
        path.strip_prefix(out).unwrap_or(path).to_string_lossy().replace('\\', "/")
    };
    case.files.iter().map(|file| (name(&file.path), file.content.clone())).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lock(class: Class, faces: u64, stretch: f64, content: &str) -> Lock {
        let metrics = [("faces", Value::Count(faces)), ("min-stretch", Value::Number(stretch))];
        let metrics = metrics.map(|(name, value)| (name.to_owned(), value)).into();
        let locked = Locked { content: Some(content.to_owned()), metrics };
        let fields = [("revision".to_owned(), "1".to_owned()), ("input file".to_owned(), "aa".to_owned())];
        Lock {
            meshmill: "1".to_owned(),
            recipe: "toy".to_owned(),
            class,
            tolerance: 0.01,
            params: [("size".to_owned(), "2%".to_owned())].into(),
            tasks: [("fe".to_owned(), fields.into())].into(),
            results: [("fe".to_owned(), locked)].into(),
            gates: BTreeMap::new(),
            files: BTreeMap::new(),
        }
    }

    #[test]
    fn each_class_asks_for_what_it_says() {
        let changed = |class, now: &Lock| lock(class, 100, 0.5, "a").changed_results(now).len();
        let same = lock(Class::Bytes, 100, 0.5, "a");
        let other_bytes = lock(Class::Bytes, 100, 0.5, "b");
        let nearby = lock(Class::Bytes, 101, 0.501, "b");
        let far = lock(Class::Bytes, 120, 0.5, "b");
        let counts = |now: &Lock| [Class::Bytes, Class::Metrics, Class::Tolerance].map(|class| changed(class, now));
        assert_eq!(counts(&same), [0, 0, 0]);
        assert_eq!(counts(&other_bytes), [1, 0, 0]);
        assert_eq!(counts(&nearby), [3, 2, 0]);
        assert_eq!(counts(&far), [2, 1, 1]);
    }

    #[test]
    fn what_goes_in_is_the_same_in_every_class() {
        let before = lock(Class::Tolerance, 1, 0.5, "a");
        let mut now = before.clone();
        assert_eq!(before.changed_ingredients(&now), [""; 0]);
        now.params.insert("size".to_owned(), "3%".to_owned());
        now.tasks.get_mut("fe").unwrap().insert("revision".to_owned(), "2".to_owned());
        now.tasks.get_mut("fe").unwrap().insert("input file".to_owned(), "bb".to_owned());
        assert_eq!(
            before.changed_ingredients(&now),
            [
                "parameter size: locked 2%, now 3%",
                "fe: the file `file` changed from aa to bb",
                "fe: revision locked 1, now 2"
            ]
        );
        assert_eq!(Lock::from_ron(&before.to_ron().unwrap()).unwrap(), before);
    }
}
