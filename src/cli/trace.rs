//! `--trace FILE`: a timeline of the run that trace viewers show (the Chrome trace event format).

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

use serde_json::{Value, json};

use super::exit::{Exit, Fault};
use crate::run::{Event, Observer, TaskState};

/// Notes when tasks and their phases begin and end, and passes every event on.
pub(super) struct Trace {
    next: Arc<dyn Observer>,
    start: Instant,
    state: Mutex<State>,
}

#[derive(Default)]
struct State {
    events: Vec<Value>,
    /// The lane of each running node, its name, and the phase it is in.
    running: BTreeMap<usize, Running>,
    lanes: BTreeSet<usize>,
}

struct Running {
    lane: usize,
    label: String,
    since: u64,
    phase: Option<(String, u64)>,
}

impl Trace {
    pub(super) fn new(next: Arc<dyn Observer>) -> Self {
        Self { next, start: Instant::now(), state: Mutex::default() }
    }

    /// Writes the timeline.
    pub(super) fn write(&self, path: &Path) -> Result<(), Fault> {
        let state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        let text = json!({ "traceEvents": state.events, "displayTimeUnit": "ms" }).to_string();
        fs::write(path, text)
            .map_err(|error| Fault::new(Exit::Store, format!("cannot write {}: {error}", path.display())))
    }

    fn now(&self) -> u64 {
        u64::try_from(self.start.elapsed().as_micros()).unwrap_or(u64::MAX)
    }
}

impl State {
    fn span(&mut self, name: &str, category: &str, lane: usize, since: u64, until: u64) {
        self.events.push(json!({
            "name": name, "cat": category, "ph": "X", "pid": 1, "tid": lane,
            "ts": since, "dur": until.saturating_sub(since),
        }));
    }

    fn end_phase(&mut self, node: usize, now: u64) {
        let Some(running) = self.running.get_mut(&node) else { return };
        let lane = running.lane;
        if let Some((name, since)) = running.phase.take() {
            self.span(&name, "phase", lane, since, now);
        }
    }
}

impl Observer for Trace {
    fn event(&self, event: &Event<'_>) {
        let now = self.now();
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        match *event {
            Event::State { node, label, state: TaskState::Running, .. } => {
                let lane = (1..=state.lanes.len() + 1).find(|lane| !state.lanes.contains(lane)).unwrap_or(0);
                state.lanes.insert(lane);
                state.running.insert(node, Running { lane, label: label.to_owned(), since: now, phase: None });
            }
            Event::State { node, .. } => {
                state.end_phase(node, now);
                if let Some(Running { lane, label, since, .. }) = state.running.remove(&node) {
                    state.lanes.remove(&lane);
                    state.span(&label, "task", lane, since, now);
                }
            }
            Event::Phase { node, name, .. } => {
                state.end_phase(node, now);
                if let Some(running) = state.running.get_mut(&node) {
                    running.phase = Some((name.to_owned(), now));
                }
            }
            Event::Advance { .. } => {}
        }
        drop(state);
        self.next.event(event);
    }
}
