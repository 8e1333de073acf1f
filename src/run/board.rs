//! The state of every node, changed in one place.

use std::sync::Arc;

use super::observe::{Event, Observer};
use crate::store::Entry;

/// Where a node is on its way.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum TaskState {
    /// Its inputs are not known yet.
    #[default]
    Unknown,
    /// Nobody asked for it.
    Unwanted,
    /// It has to run, and waits for inputs.
    Want,
    /// It can run, and waits for a thread.
    Ready,
    /// It runs.
    Running,
    /// The result was there already.
    Cached,
    /// It ran.
    Done,
    /// It ran and failed.
    Failed,
    /// An input failed, so it cannot run.
    Skipped,
    /// The run was interrupted while it ran.
    Cancelled,
}

impl TaskState {
    /// Whether its result can be had.
    pub fn is_available(self) -> bool {
        matches!(self, Self::Cached | Self::Done)
    }

    /// Whether nothing more happens to it, as a rule: a lost artifact takes a cached node back to `Want`.
    pub fn is_final(self) -> bool {
        match self {
            Self::Unknown | Self::Want | Self::Ready | Self::Running => false,
            Self::Unwanted | Self::Cached | Self::Done | Self::Failed | Self::Skipped | Self::Cancelled => true,
        }
    }

    /// Whether a node may go from this state to `next`.
    fn may_become(self, next: Self) -> bool {
        match self {
            Self::Unknown => !matches!(next, Self::Unknown | Self::Running | Self::Done | Self::Cancelled),
            Self::Want => matches!(next, Self::Ready | Self::Skipped),
            Self::Ready => next == Self::Running,
            Self::Running => {
                matches!(next, Self::Done | Self::Cached | Self::Failed | Self::Cancelled | Self::Want)
            }
            // The artifact was lost.
            Self::Cached | Self::Done => next == Self::Want,
            Self::Unwanted | Self::Failed | Self::Skipped | Self::Cancelled => false,
        }
    }
}

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
