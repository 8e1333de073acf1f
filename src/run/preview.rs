//! What a run would do, and why, without doing it. Uses the keys of the run, so that it cannot tell otherwise.

use super::shared::{Shared, recipe_task, unreadable};
use super::{RunOptions, tasks_of};
use crate::plan::{Change, Key, Plan, Record, Task, TaskId};
use crate::step::StepFailure;
use crate::store::Store;

/// What a run would do with a task.
#[derive(Clone, Debug)]
pub enum Forecast {
    /// A file, which is there.
    Source,
    /// A file, which cannot be read.
    Unreadable(StepFailure),
    /// The result is there.
    Cached(Key),
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

/// What a run with these options would do, by task. `known` gives the record of the last run of a task in this output
/// folder; without one the newest of its name in the store counts.
pub fn preview(
    plan: &Plan,
    store: &Store,
    options: &RunOptions,
    known: &dyn Fn(&str) -> Option<Record>,
) -> Vec<Forecast> {
    let shared = Shared::new(plan, store, options);
    let forced = tasks_of(plan, &options.force);
    let mut forecasts: Vec<Forecast> = Vec::with_capacity(plan.len());
    for id in plan.order() {
        let node = plan.node(id);
        if let Task::Source(source) = &node.task {
            forecasts.push(match shared.index.hash(&source.path) {
                Ok(hash) => {
                    shared.learn(id, hash);
                    Forecast::Source
                }
                Err(error) => Forecast::Unreadable(unreadable(&source.path, &error)),
            });
            continue;
        }
        let Some((key, record)) = shared.key(id) else {
            let mut unknown: Vec<TaskId> = plan.inputs(id).into_iter().map(|(_, input)| input).collect();
            unknown.retain(|input| shared.content(*input).is_none());
            unknown.sort_unstable();
            unknown.dedup();
            forecasts.push(Forecast::DependsOn(unknown));
            continue;
        };
        if let Some(entry) = store.entry(&key) {
            if let Some(content) = entry.content() {
                shared.learn(id, content);
            }
            forecasts.push(if forced.contains(&id) { Forecast::Forced(key) } else { Forecast::Cached(key) });
            continue;
        }
        let name = recipe_task(&options.name, &node.label);
        let newest = || store.newest(&name).map(|(_, entry)| Record { fields: entry.record });
        forecasts.push(match known(&node.label).or_else(newest) {
            None => Forecast::New(key),
            Some(earlier) => match record.changes_since(&earlier) {
                changes if changes.is_empty() => Forecast::Gone(key),
                changes => Forecast::Changed(key, changes),
            },
        });
    }
    shared.index.flush(store);
    forecasts
}
