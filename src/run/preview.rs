//! What a run would do, and why, without doing it. Uses the keys of the run, so that it cannot tell otherwise.

use super::shared::{Shared, recipe_task};
use super::{RunOptions, failed, source, tasks_of};
use crate::plan::{Change, Key, Plan, Record, SourceTask, Task, TaskId, task_record};
use crate::step::StepFailure;
use crate::store::{CODEC_VERSION, Outcome, Store};

/// What a run would do with a task.
#[derive(Clone, Debug)]
pub enum Forecast {
    /// A file, which is there.
    Source,
    /// A file, which cannot be read.
    Unreadable(StepFailure),
    /// The result is there.
    Cached(Key),
    /// It failed, and would not run again.
    Failed(Key, StepFailure),
    /// Cached, but it was asked to run again.
    Forced(Key),
    /// Whether it has to run is known after these tasks.
    DependsOn(Vec<TaskId>),
    /// It has to run: nothing like it is known.
    New(Key),
    /// It has to run: this changed since the newest result of a task of this name.
    Changed(Key, Vec<Change>),
    /// It has to run: an equal result was known once, and was removed from the cache.
    Gone(Key),
}

/// A forecast with the fields that it rests on.
#[derive(Clone, Debug)]
pub struct Explained {
    /// What a run would do.
    pub forecast: Forecast,
    /// The fields of the key; contents of inputs that are not known yet are missing.
    pub now: Record,
    /// The fields of the result that is there, or of the newest one of this name.
    pub earlier: Option<Record>,
}

/// What a run with these options would do, by task. `known` gives the record of the last run of a task in this output
/// folder; without one the newest of its name in the store counts.
pub fn preview(
    plan: &Plan,
    store: &Store,
    options: &RunOptions,
    known: &dyn Fn(&str) -> Option<Record>,
) -> Vec<Forecast> {
    explain(plan, store, options, known).into_iter().map(|explained| explained.forecast).collect()
}

/// The fields of every task's key that are known before anything runs: all but the contents of what steps give.
pub fn records(plan: &Plan, store: &Store, options: &RunOptions) -> Vec<Record> {
    let shared = Shared::new(plan, store, options);
    let record = |id: TaskId| {
        let node = plan.node(id);
        let mut files = Vec::new();
        for (name, input) in plan.inputs(id) {
            if let Task::Source(file) = &plan.node(input).task
                && let Ok(hash) = source::hash(&shared.index, &file.path)
            {
                files.push((name, hash));
            }
        }
        task_record(&node.task, u32::from(CODEC_VERSION), &files)
    };
    let records = plan.order().map(record).collect();
    shared.index.flush(store);
    records
}

/// As [`preview`], with the fields of every key, now and before.
pub fn explain(
    plan: &Plan,
    store: &Store,
    options: &RunOptions,
    known: &dyn Fn(&str) -> Option<Record>,
) -> Vec<Explained> {
    let shared = Shared::new(plan, store, options);
    let forced = tasks_of(plan, &options.force);
    let mut found: Vec<Explained> = Vec::with_capacity(plan.len());
    for id in plan.order() {
        let (node, now) = (plan.node(id), fields(&shared, id));
        let (forecast, earlier) = match &node.task {
            Task::Source(source) => (source_forecast(&shared, id, source), None),
            Task::Step(_) | Task::Gate(_) => {
                let newest = || {
                    let name = recipe_task(&options.name, &node.label);
                    store.newest(&name).map(|(_, entry)| Record { fields: entry.record })
                };
                task_forecast(&shared, id, forced.contains(&id), &|| known(&node.label).or_else(newest))
            }
        };
        found.push(Explained { forecast, now, earlier });
    }
    shared.index.flush(store);
    found
}

/// The fields of a task's key, as far as its inputs are known.
fn fields(shared: &Shared<'_>, id: TaskId) -> Record {
    let inputs = shared.plan.inputs(id).into_iter();
    let contents: Vec<_> = inputs.filter_map(|(name, input)| Some((name, shared.content(input)?))).collect();
    task_record(&shared.plan.node(id).task, u32::from(CODEC_VERSION), &contents)
}

fn source_forecast(shared: &Shared<'_>, id: TaskId, file: &SourceTask) -> Forecast {
    match source::hash(&shared.index, &file.path) {
        Ok(hash) => {
            shared.learn(id, hash);
            Forecast::Source
        }
        Err(failure) => Forecast::Unreadable(failure),
    }
}

fn task_forecast(
    shared: &Shared<'_>,
    id: TaskId,
    forced: bool,
    earlier: &dyn Fn() -> Option<Record>,
) -> (Forecast, Option<Record>) {
    let Some((key, record)) = shared.key(id) else {
        let mut unknown: Vec<TaskId> = shared.plan.inputs(id).into_iter().map(|(_, input)| input).collect();
        unknown.retain(|input| shared.content(*input).is_none());
        unknown.sort_unstable();
        unknown.dedup();
        return (Forecast::DependsOn(unknown), earlier());
    };
    let known = shared.store.entry(&key);
    let failure = known.as_ref().filter(|_| !forced).and_then(|entry| failed::recall(entry, shared.options));
    if let (Some(entry), Some(failure)) = (&known, failure) {
        return (Forecast::Failed(key, failure), Some(Record { fields: entry.record.clone() }));
    }
    // A failure that does not count is no result.
    if let Some(entry) = known.filter(|entry| !matches!(entry.outcome, Outcome::Failure(_))) {
        if let Some(content) = entry.content() {
            shared.learn(id, content);
        }
        let forecast = if forced { Forecast::Forced(key) } else { Forecast::Cached(key) };
        return (forecast, Some(Record { fields: entry.record }));
    }
    let earlier = earlier();
    let forecast = match earlier.as_ref().map(|earlier| record.changes_since(earlier)) {
        None => Forecast::New(key),
        Some(changes) if changes.is_empty() => Forecast::Gone(key),
        Some(changes) => Forecast::Changed(key, changes),
    };
    (forecast, earlier)
}
