//! A search over cases: each is planned, run and judged before the next one is chosen, and what is in the store counts
//! as run.

use std::sync::Arc;

use super::{Observer, Plan, RunError, RunOptions, RunOutcome, run};
use crate::metric::Value;
use crate::metric::gate::GateRow;
use crate::plan::CaseSpec;
use crate::plan::goal::Goal;
use crate::plan::goal::search::{Merit, search};
use crate::plan::goal::vary::{Variable, case_at};
use crate::store::Store;

/// A search: what for, over what, and how a case becomes a plan.
pub struct Study<'a, E> {
    /// What is looked for.
    pub goal: &'a Goal,
    /// What may be changed.
    pub variables: &'a [Variable],
    /// Most cases to run.
    pub evaluations: usize,
    /// Plans one case, with the goal's columns.
    pub plan: &'a dyn Fn(&CaseSpec) -> Result<Plan, E>,
    /// Where results are kept.
    pub store: &'a Store,
    /// How cases are run.
    pub options: &'a RunOptions,
    /// Who is told how they get on.
    pub observer: Arc<dyn Observer>,
}

/// A case that was run.
pub struct Evaluation {
    /// The case.
    pub spec: CaseSpec,
    /// Its plan.
    pub plan: Plan,
    /// What came of it.
    pub outcome: RunOutcome,
    /// How good it is.
    pub merit: Merit,
    /// Conditions of the goal that do not hold.
    pub unmet: Vec<GateRow>,
}

impl<E: From<RunError>> Study<'_, E> {
    /// Searches from the recipe's own values and gives every case to `see`, in order. Ends early when the run is
    /// cancelled.
    ///
    /// # Errors
    /// A case cannot be planned, or the disk fails.
    pub fn search(&self, see: &mut dyn FnMut(Evaluation)) -> Result<(), E> {
        let start: Vec<f64> = self.variables.iter().map(Variable::start).collect();
        let mut fault = None;
        search(&start, self.evaluations, &mut |point| match self.evaluate(case_at(self.variables, point)) {
            Ok(found) => {
                let found = found?;
                let merit = found.merit;
                see(found);
                Some(merit)
            }
            Err(error) => {
                fault = Some(error);
                None
            }
        });
        fault.map_or(Ok(()), Err)
    }

    /// Runs one case; none when the run was cancelled.
    fn evaluate(&self, spec: CaseSpec) -> Result<Option<Evaluation>, E> {
        let plan = (self.plan)(&spec)?;
        let outcome = run(&plan, self.store, self.options, &self.observer)?;
        if outcome.cancelled {
            return Ok(None);
        }
        let (merit, unmet) = self.merit(&plan, &outcome);
        Ok(Some(Evaluation { spec, plan, outcome, merit, unmet }))
    }

    /// How good the case is, and which conditions of the goal do not hold.
    fn merit(&self, plan: &Plan, outcome: &RunOutcome) -> (Merit, Vec<GateRow>) {
        let nothing = Merit { violation: f64::INFINITY, objective: f64::INFINITY };
        let Some(case) = plan.cases().first() else { return (nothing, Vec::new()) };
        if outcome.tasks.iter().any(|task| task.failure.is_some()) {
            return (nothing, Vec::new());
        }
        let rows = |task| outcome.task(task).gate_report().map(|report| report.rows).unwrap_or_default();
        let gates = case.gates.iter().flat_map(|gate| &gate.tasks).flat_map(|&task| rows(task));
        let failed: Vec<GateRow> = gates.filter(|row| !row.passed).collect();
        let conditions = case.columns.iter().skip(1).flat_map(|column| rows(column.task));
        let unmet: Vec<GateRow> = conditions.filter(|row| !row.passed).collect();
        let violation = failed.iter().chain(&unmet).map(shortfall).sum();
        let measured = case.columns.first().and_then(|column| rows(column.task).first()?.measured);
        let objective = measured.map_or(f64::INFINITY, Value::as_f64);
        (Merit { violation, objective: if self.goal.maximize { -objective } else { objective } }, unmet)
    }
}

/// One for a check that does not hold, and up to one more for how far it is missed.
fn shortfall(row: &GateRow) -> f64 {
    let short = row.slack.map_or(1.0, f64::abs);
    let scale = row.measured.map_or(0.0, |value| value.as_f64().abs()) + short;
    1.0 + if scale > 0.0 { short / scale } else { 1.0 }
}
