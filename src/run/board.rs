//! The state of every node, changed in one place.

use std::sync::Arc;

use super::observe::{Event, Observer};
use super::state::TaskState;
use crate::store::Entry;

/// All states, and for each node how many others still need its artifact.
pub(super) struct Board {
    states: Vec<TaskState>,
    inputs: Vec<Vec<usize>>,
    users: Vec<Vec<usize>>,
    readers: Vec<usize>,
    labels: Vec<String>,
    observer: Arc<dyn Observer>,
}

impl Board {
    /// A board of nodes with these labels and inputs; inputs come before their users.
    pub(super) fn new(labels: Vec<String>, inputs: Vec<Vec<usize>>, observer: Arc<dyn Observer>) -> Self {
        let mut users = vec![Vec::new(); inputs.len()];
        for (node, inputs) in inputs.iter().enumerate() {
            for input in inputs {
                users[*input].push(node);
            }
        }
        let readers = users.iter().map(Vec::len).collect();
        Self { states: vec![TaskState::Unknown; inputs.len()], inputs, users, readers, labels, observer }
    }

    pub(super) fn len(&self) -> usize {
        self.states.len()
    }

    pub(super) fn state(&self, node: usize) -> TaskState {
        self.states[node]
    }

    pub(super) fn inputs(&self, node: usize) -> &[usize] {
        &self.inputs[node]
    }

    pub(super) fn users(&self, node: usize) -> &[usize] {
        &self.users[node]
    }

    /// Whether somebody still needs the artifact of this node.
    pub(super) fn is_read(&self, node: usize) -> bool {
        self.readers[node] > 0
    }

    /// The one place where a state changes. Returns the inputs that nobody needs any more.
    pub(super) fn set(&mut self, node: usize, state: TaskState, entry: Option<&Entry>) -> Vec<usize> {
        let before = self.states[node];
        debug_assert!(before.may_become(state), "{}: {before:?} -> {state:?}", self.labels[node]);
        self.states[node] = state;
        self.observer.event(&Event::State { node, label: &self.labels[node], state, entry });
        let mut released = Vec::new();
        for &input in &self.inputs[node] {
            match (before.is_final(), state.is_final()) {
                (false, true) => {
                    self.readers[input] = self.readers[input].saturating_sub(1);
                    if self.readers[input] == 0 {
                        released.push(input);
                    }
                }
                (true, false) => self.readers[input] += 1,
                (false, false) | (true, true) => {}
            }
        }
        released
    }
}
