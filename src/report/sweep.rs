//! A sweep as a table: one row a case, with its parameters, its metrics and gates, and the reason where it failed.
//!
//! [`SweepTable`] is the one model: `sweep.ron` and `sweep.csv` are written of it, the terminal shows it, and the page
//! draws it. It says nothing about time and cache, so the files of two equal sweeps are equal.

use ron::ser::PrettyConfig;
use serde::{Deserialize, Serialize};

use super::measure::value_text;
use super::table;
use crate::metric::Value;
use crate::metric::gate::criteria::row_name;
use crate::metric::gate::{GateReport, GateRow};
use crate::metric::registry::{self, Direction, MetricDef};
use crate::run::{Case, Plan, RunOutcome, Task, TaskState};

/// A sweep.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct SweepTable {
    /// Name of the recipe.
    pub recipe: String,
    /// What varies: parameters, and inputs as `inputs.NAME`.
    pub parameters: Vec<String>,
    /// What was measured: the metrics asked for, then those that gates look at.
    pub columns: Vec<SweepColumn>,
    /// One row a case.
    pub rows: Vec<SweepRow>,
}

/// Something that was measured of every case.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct SweepColumn {
    /// `STEP.METRIC`; in a file with `gate ` before it where it belongs to a gate.
    pub name: String,
    /// The step that was measured.
    pub step: String,
    /// The metric's name in the registry.
    pub metric: String,
    /// Which values are good.
    pub better: Better,
    /// Whether a gate looks at it, so that rows know whether it passed.
    pub gate: bool,
}

/// Which values of a column are good.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Better {
    /// Large ones.
    Higher,
    /// Small ones.
    Lower,
    /// Neither.
    Neutral,
}

/// What became of a case.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum RowState {
    /// It has a result, and every gate holds.
    Passed,
    /// It has a result, and a gate does not hold.
    GateFailed,
    /// A step failed, so that there is no result.
    Failed,
    /// The sweep was interrupted before.
    NotReached,
}

/// A case of a sweep.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct SweepRow {
    /// Its name, and the folder of its files.
    pub case: String,
    /// The values of what varies, as they would be written, in the order of [`SweepTable::parameters`].
    pub parameters: Vec<String>,
    /// What was measured, in the order of [`SweepTable::columns`]; absent where undefined or not reached.
    pub values: Vec<Option<Value>>,
    /// Whether the gates hold, in the same order; absent for other columns and where undecided.
    pub passed: Vec<Option<bool>>,
    /// The step whose mesh is the result.
    pub result: Option<String>,
    /// Its key in the cache.
    pub key: Option<String>,
    /// The hash of the result.
    pub content: Option<String>,
    /// What became of it.
    pub state: RowState,
    /// Why it failed.
    pub reason: Option<String>,
}

impl SweepTable {
    /// The table of a sweep in which `parameters` vary.
    pub fn new(recipe: &str, parameters: &[String], plan: &Plan, outcome: &RunOutcome) -> Self {
        let columns = plan.cases().first().map(|case| columns(case, plan)).unwrap_or_default();
        let rows = plan.cases().iter().map(|case| row(case, parameters, &columns, plan, outcome)).collect();
        Self { recipe: recipe.to_owned(), parameters: parameters.to_vec(), columns, rows }
    }

    /// Rows in this state.
    pub fn count(&self, state: RowState) -> usize {
        self.rows.iter().filter(|row| row.state == state).count()
    }

    /// The table as RON.
    pub fn to_ron(&self) -> Result<String, ron::Error> {
        let config = PrettyConfig::default().struct_names(false).indentor("  ").depth_limit(3);
        Ok(ron::ser::to_string_pretty(self, config)? + "\n")
    }

    /// The table as comma-separated values: one line a case, a column a parameter or metric; gates have a second one
    /// that says whether they hold.
    pub fn to_csv(&self) -> Result<String, csv::Error> {
        let mut writer = csv::Writer::from_writer(Vec::new());
        let mut head = vec!["case".to_owned()];
        head.extend(self.parameters.iter().cloned());
        for column in &self.columns {
            if column.gate {
                head.extend([format!("gate {}", column.name), format!("gate {} passed", column.name)]);
            } else {
                head.push(column.name.clone());
            }
        }
        head.extend(["state", "reason", "result", "key", "content"].map(str::to_owned));
        writer.write_record(&head)?;
        for row in &self.rows {
            writer.write_record(self.record(row))?;
        }
        let bytes = writer.into_inner().map_err(csv::IntoInnerError::into_error)?;
        Ok(String::from_utf8_lossy(&bytes).into_owned())
    }

    fn record(&self, row: &SweepRow) -> Vec<String> {
        let mut fields = vec![row.case.clone()];
        fields.extend(row.parameters.iter().cloned());
        for ((column, value), passed) in self.columns.iter().zip(&row.values).zip(&row.passed) {
            fields.push(value.map(exact).unwrap_or_default());
            if column.gate {
                fields.push(passed.map(|passed| passed.to_string()).unwrap_or_default());
            }
        }
        let text = |text: &Option<String>| text.clone().unwrap_or_default();
        fields.push(row.state.text().to_owned());
        fields.extend([text(&row.reason), text(&row.result), text(&row.key), text(&row.content)]);
        fields
    }

    /// The table for a terminal: parameters, the metrics asked for, and what the gates say.
    pub fn to_text(&self) -> String {
        let shown: Vec<usize> = (0..self.columns.len()).filter(|index| !self.columns[*index].gate).collect();
        let mut head: Vec<&str> = self.parameters.iter().map(String::as_str).collect();
        head.extend(shown.iter().map(|index| self.columns[*index].name.as_str()));
        head.extend(["state", "case"]);
        let mut rows = table::plain(&head);
        for row in &self.rows {
            let mut cells = row.parameters.clone();
            cells.extend(shown.iter().map(|index| row.values[*index].as_ref().map(value_text).unwrap_or_default()));
            cells.extend([row.state.text().to_owned(), row.case.clone()]);
            table::add(&mut rows, cells);
        }
        let numbers: Vec<usize> = (0..self.parameters.len() + shown.len()).collect();
        table::align(&mut rows, &numbers);
        table::text(&rows)
    }
}

impl SweepRow {
    /// Notes the conditions of a goal that do not hold: the case counts as one whose gate does not.
    pub fn misses(&mut self, unmet: &[GateRow]) {
        for judged in unmet {
            let reason = wanted("goal", judged);
            self.reason = Some(self.reason.take().map_or(reason.clone(), |other| format!("{other}; {reason}")));
            self.state = RowState::GateFailed;
        }
    }
}

impl RowState {
    /// What it is called in tables.
    pub fn text(self) -> &'static str {
        match self {
            Self::Passed => "passed",
            Self::GateFailed => "gate failed",
            Self::Failed => "FAILED",
            Self::NotReached => "not reached",
        }
    }
}

/// A value with all its digits.
fn exact(value: Value) -> String {
    match value {
        Value::Count(count) => count.to_string(),
        Value::AtLeast(count) => format!("≥ {count}"),
        Value::Integer(number) => number.to_string(),
        Value::Number(number) => number.to_string(),
        Value::Flag(flag) => flag.to_string(),
    }
}

fn column(name: &str, step: &str, metric: &MetricDef, gate: bool) -> SweepColumn {
    let better = match metric.direction {
        Direction::Higher => Better::Higher,
        Direction::Lower => Better::Lower,
        Direction::Neutral => Better::Neutral,
    };
    SweepColumn { name: name.to_owned(), step: step.to_owned(), metric: metric.name.to_owned(), better, gate }
}

/// All cases have the same columns, because they differ in values only.
fn columns(case: &Case, plan: &Plan) -> Vec<SweepColumn> {
    let mut columns: Vec<SweepColumn> =
        case.columns.iter().map(|asked| column(&asked.name, &asked.step, asked.metric, false)).collect();
    for gate in &case.gates {
        for task in &gate.tasks {
            let Task::Gate(checks) = &plan.node(*task).task else { continue };
            for metric in checks.checks.iter().filter_map(|check| registry::find(&check.metric)) {
                columns.push(column(&format!("{}.{}", gate.step, metric.name), &gate.step, metric, true));
            }
            if let Some(criteria) = &checks.criteria {
                let metric = row_name(&criteria.name);
                columns.push(SweepColumn {
                    name: format!("{}.{metric}", gate.step),
                    step: gate.step.clone(),
                    metric,
                    better: Better::Lower,
                    gate: true,
                });
            }
        }
    }
    columns
}

fn row(case: &Case, parameters: &[String], columns: &[SweepColumn], plan: &Plan, outcome: &RunOutcome) -> SweepRow {
    let value = |name: &String| match name.strip_prefix("inputs.") {
        Some(input) => case.inputs.get(input).cloned().unwrap_or_default(),
        None => case.params.get(name).cloned().unwrap_or_default(),
    };
    let reports = |tasks: &[_]| -> Vec<GateReport> {
        tasks.iter().filter_map(|task| outcome.task(*task).gate_report()).collect()
    };
    let mut values: Vec<Option<Value>> =
        case.columns.iter().map(|asked| reports(&[asked.task]).first()?.rows.first()?.measured).collect();
    let mut passed: Vec<Option<bool>> = vec![None; values.len()];
    let gates: Vec<(&str, GateRow)> = case
        .gates
        .iter()
        .flat_map(|gate| reports(&gate.tasks).into_iter().flat_map(|r| r.rows).map(|row| (gate.step.as_str(), row)))
        .collect();
    for column in columns.iter().filter(|column| column.gate) {
        let judged = gates.iter().find(|(step, row)| *step == column.step && row.metric == column.metric);
        values.push(judged.and_then(|(_, row)| row.measured));
        passed.push(judged.map(|(_, row)| row.passed));
    }
    let result = case.result.as_ref();
    let (state, reason) = verdict(case, &gates, plan, outcome);
    SweepRow {
        case: case.name.clone(),
        parameters: parameters.iter().map(value).collect(),
        values,
        passed,
        result: result.map(|(step, _)| step.clone()),
        key: result.and_then(|(_, task)| Some(outcome.task(*task).key?.to_hex().to_string())),
        content: result.and_then(|(_, task)| Some(outcome.task(*task).content?.to_hex().to_string())),
        state,
        reason,
    }
}

fn verdict(case: &Case, gates: &[(&str, GateRow)], plan: &Plan, outcome: &RunOutcome) -> (RowState, Option<String>) {
    let mut tasks: Vec<_> = case.steps.iter().map(|(name, task)| (*task, name.clone())).collect();
    for gate in &case.gates {
        tasks.extend(gate.tasks.iter().map(|task| (*task, format!("gate {}", gate.step))));
    }
    tasks.extend(case.columns.iter().map(|column| (column.task, column.name.clone())));
    // The first that failed is the reason for what comes after it.
    tasks.sort();
    // A file that cannot be read is a failed source; the step that reads it is skipped.
    let sources = tasks.iter().flat_map(|(task, name)| plan.inputs(*task).into_iter().map(move |(_, id)| (id, name)));
    let sources = sources.filter(|(id, _)| matches!(plan.node(*id).task, Task::Source(_)));
    let mut all = sources.chain(tasks.iter().map(|(task, name)| (*task, name)));
    let failure = all.find_map(|(task, name)| Some((name, outcome.task(task).failure.as_ref()?)));
    if let Some((name, failure)) = failure {
        return (RowState::Failed, Some(format!("{name}: {}", failure.message)));
    }
    if tasks.iter().any(|(task, _)| !matches!(outcome.task(*task).state, TaskState::Cached | TaskState::Done)) {
        return (RowState::NotReached, Some("interrupted".to_owned()));
    }
    let failed: Vec<String> =
        gates.iter().filter(|(_, row)| !row.passed).map(|(step, row)| wanted(step, row)).collect();
    if failed.is_empty() { (RowState::Passed, None) } else { (RowState::GateFailed, Some(failed.join("; "))) }
}

/// What a check wanted and what was measured.
fn wanted(step: &str, row: &GateRow) -> String {
    let measured = row.measured.as_ref().map_or_else(|| "undefined".to_owned(), value_text);
    format!("{step}.{} is {measured}, wanted {}", row.metric, row.limit)
}
