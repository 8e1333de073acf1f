//! What happens during a run, for whoever wants to show it. Observers never affect a result.

use super::state::TaskState;
use crate::store::Entry;
use crate::watch::Progress;

/// Something happened.
#[derive(Clone, Copy, Debug)]
pub enum Event<'a> {
    /// A node changed its state.
    State {
        /// Number of the node within the run.
        node: usize,
        /// What it is called.
        label: &'a str,
        /// Its new state.
        state: TaskState,
        /// What is known of its result, once it is done or cached.
        entry: Option<&'a Entry>,
    },
    /// A running node began a phase of its work.
    Phase {
        /// Number of the node.
        node: usize,
        /// What the phase is called.
        name: &'a str,
        /// Amount of work, where it is known.
        total: Option<u64>,
    },
    /// A running node got on.
    Advance {
        /// Number of the node.
        node: usize,
        /// Work of this phase done so far.
        done: u64,
        /// The current figure, such as `12 480 faces left`.
        figure: &'a str,
    },
}

/// Receives events, from several threads.
pub trait Observer: Send + Sync {
    /// Something happened. Return soon: the run waits.
    fn event(&self, event: &Event<'_>);
}

/// Looks at nothing.
#[derive(Clone, Copy, Debug, Default)]
pub struct Silent;

impl Observer for Silent {
    fn event(&self, _event: &Event<'_>) {}
}

impl Progress for Silent {
    fn phase(&self, _name: &str, _total: Option<u64>) {}
    fn advance(&self, _done: u64, _figure: &str) {}
}
