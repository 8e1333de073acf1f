//! What runs on a thread of its own: one node, from its inputs' artifacts to a stored result.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::time::Instant;

use super::bounded::{Ended, bounded};
use super::figures::figures;
use super::ledger::Account;
use super::node::{Finished, Node};
use super::observe::{Event, Observer};
use super::shared::{Shared, VERSION, recipe_task};
use super::{failed, gate, output};
use crate::plan::{ContentHash, GateTask, StepTask, Task, TaskId, TaskLimits};
use crate::step::{FailureKind, Inputs, OutPort, Port, StepFailure};
use crate::store::{Entry, Outcome, Peak, host};
use crate::watch::{Progress, Watch};

/// Passes a step's progress on under its node's number.
struct NodeProgress {
    node: usize,
    observer: Arc<dyn Observer>,
}

impl Progress for NodeProgress {
    fn phase(&self, name: &str, total: Option<u64>) {
        self.observer.event(&Event::Phase { node: self.node, name, total });
    }

    fn advance(&self, done: u64, figure: &str) {
        self.observer.event(&Event::Advance { node: self.node, done, figure });
    }
}

/// Runs one node. A panic within becomes a failure of that node.
pub(super) fn run(shared: &Shared<'_>, index: usize, node: Node, observer: Arc<dyn Observer>) -> Finished {
    let progress = Arc::new(NodeProgress { node: index, observer });
    let watch = Watch::new(progress, Arc::clone(&shared.options.cancelled));
    let account = Arc::new(shared.ledger.open(index));
    let work = || match node {
        Node::Task(id) => task(shared, id, &account, &watch),
        Node::File(case, position) => output::file(shared, case, position, &watch),
        Node::Faults(case, position) => output::faults(shared, case, position),
    };
    catch_unwind(AssertUnwindSafe(work))
        .unwrap_or_else(|payload| Ok(Finished::Failed(panicked(payload.as_ref()))))
        .unwrap_or_else(|finished| finished)
}

fn task(shared: &Shared<'_>, id: TaskId, account: &Arc<Account>, watch: &Watch) -> Result<Finished, Finished> {
    let start = Instant::now();
    let Some((key, record)) = shared.key(id) else {
        return Err(Finished::Failed(StepFailure::failed("started before its inputs were known")));
    };
    let node = shared.plan.node(id);
    let made = match &node.task {
        Task::Source(_) => return Err(Finished::Failed(StepFailure::failed("a file is not a task to run"))),
        Task::Step(step) => step_task(shared, id, step, (account, watch, start))?,
        Task::Gate(gate) => gate_task(shared, id, gate, (account, watch))?,
    };
    let entry = Entry {
        version: VERSION.to_owned(),
        host: host(),
        task: recipe_task(&shared.options.name, &node.label),
        record: record.fields,
        outcome: made.outcome,
        stats: made.stats,
        seconds: start.elapsed().as_secs_f64(),
        memory: made.memory,
    };
    shared.publish(&key, &entry);
    Ok(Finished::Task(Box::new(entry)))
}

/// What a task made.
struct Made {
    outcome: Outcome,
    stats: serde_json::Value,
    memory: Option<Peak>,
}

fn step_task(
    shared: &Shared<'_>,
    id: TaskId,
    step: &StepTask,
    (account, watch, start): (&Arc<Account>, &Watch, Instant),
) -> Result<Made, Finished> {
    let mut artifacts = Vec::new();
    for (name, input) in shared.plan.inputs(id) {
        artifacts.push((name, shared.artifact(input)?));
    }
    let inputs = Inputs::new(artifacts);
    // Who gives a table of metrics measures its inputs, as gates do.
    let measures = step.def.output(step.output).is_some_and(|output| output.port == OutPort::Is(Port::Metrics));
    let mut measured = Vec::new();
    for (name, input) in shared.plan.inputs(id).into_iter().filter(|_| measures) {
        measured.extend(shared.measured(input)?.map(|mesh| (name, mesh)));
    }
    let first = measured.first().map(|(_, mesh)| Arc::clone(mesh));
    let _turn = first.as_ref().map(|mesh| mesh.turn());
    let inputs = inputs.with_measured(measured);
    shared.needs().check(shared.plan, id, &inputs).map_err(Finished::Failed)?;
    let limits = shared.plan.node(id).limits;
    let work = || {
        catch_unwind(AssertUnwindSafe(|| {
            bounded(limits, (account, &shared.clock), watch, &|watch| step.run(&inputs, watch))
        }))
    };
    let produced =
        shared.pool()?.install(work).unwrap_or_else(|payload| Err(Ended::Failed(panicked(payload.as_ref()))));
    let (produced, memory) = produced.map_err(|ended| match ended {
        Ended::Crowded => Finished::Crowded,
        Ended::Failed(failure) => {
            failed::remember(shared, id, &failure, start);
            Finished::Failed(failure)
        }
    })?;
    let figures = figures(&produced.artifact);
    let saved = shared.save(&produced.artifact);
    if let Some(before) = shared.learn(id, saved.content) {
        return Err(Finished::Failed(changed(before, saved.content)));
    }
    shared.keep(id, produced.artifact);
    let outcome = Outcome::Artifact { content: saved.content, bytes: saved.bytes, figures };
    Ok(Made { outcome, stats: produced.stats, memory })
}

fn gate_task(
    shared: &Shared<'_>,
    id: TaskId,
    task: &GateTask,
    (account, watch): (&Arc<Account>, &Watch),
) -> Result<Made, Finished> {
    let (mut target, mut reference) = (None, None);
    for (name, input) in shared.plan.inputs(id) {
        let mesh = gate::mesh(shared, input)?;
        if name == "target" {
            target = Some(mesh);
        } else {
            reference = Some(mesh);
        }
    }
    let target = target.ok_or_else(|| Finished::Failed(StepFailure::failed("the gate has no mesh to check")))?;
    let _turn = target.turn();
    let work = |watch: &Watch| gate::evaluate(task, &target, reference.as_ref(), watch);
    let work =
        || catch_unwind(AssertUnwindSafe(|| bounded(TaskLimits::default(), (account, &shared.clock), watch, &work)));
    let report = shared.pool()?.install(work).unwrap_or_else(|payload| Err(Ended::Failed(panicked(payload.as_ref()))));
    let (report, memory) = report.map_err(|ended| match ended {
        Ended::Crowded => Finished::Crowded,
        Ended::Failed(failure) => Finished::Failed(failure),
    })?;
    let json = serde_json::to_value(&report).unwrap_or_default();
    shared.judge(id, report);
    Ok(Made { outcome: Outcome::Gate(json), stats: serde_json::Value::Null, memory })
}

fn changed(before: ContentHash, now: ContentHash) -> StepFailure {
    let (before, now) = (before.to_hex(), now.to_hex());
    StepFailure::failed(format!("gave {} although equal inputs gave {} before", &now[..12], &before[..12]))
        .with_help("the step is not deterministic, which is a fault of the program; please report it")
}

fn panicked(payload: &(dyn Any + Send)) -> StepFailure {
    let message = payload.downcast_ref::<&str>().map(|text| (*text).to_owned());
    let message = message.or_else(|| payload.downcast_ref::<String>().cloned()).unwrap_or_default();
    StepFailure::new(FailureKind::Panicked, format!("panicked: {message}"))
        .with_help("this is a fault of the program; please report it with the recipe and the input")
}
