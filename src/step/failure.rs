//! Why a step gave no result: what, where and what to try.

use std::fmt;

use glam::DVec3;
use serde::{Deserialize, Serialize};

use crate::watch::Cancelled;

/// What sort of failure, which decides the exit code.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum FailureKind {
    /// The input file is wrong: exit code 2.
    BadInput,
    /// The step could not do its work: exit code 4.
    Failed,
    /// The run was interrupted: exit code 130 or 143.
    Cancelled,
    /// The step panicked; a fault of ours, reported as the step's failure.
    Panicked,
}

/// An element of a mesh that a message is about.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ElementRef {
    /// `vertex`, `edge`, `face`, `line` or `byte`.
    pub kind: String,
    /// Its number in the mesh or file.
    pub id: u64,
    /// Where it is, in model coordinates.
    pub at: Option<DVec3>,
}

/// A step's failure as the rest of the program sees it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StepFailure {
    /// What sort.
    pub kind: FailureKind,
    /// What went wrong and why, lower case, no full stop.
    pub message: String,
    /// What the user may try.
    pub help: Option<String>,
    /// The elements at fault, worst first, at most a few dozen.
    pub elements: Vec<ElementRef>,
}

impl StepFailure {
    /// A failure of this kind.
    pub fn new(kind: FailureKind, message: impl Into<String>) -> Self {
        Self { kind, message: message.into(), help: None, elements: Vec::new() }
    }

    /// The input is wrong.
    pub fn bad_input(message: impl Into<String>) -> Self {
        Self::new(FailureKind::BadInput, message)
    }

    /// The step could not do its work.
    pub fn failed(message: impl Into<String>) -> Self {
        Self::new(FailureKind::Failed, message)
    }

    /// Adds what the user may try.
    #[must_use]
    pub fn with_help(mut self, help: impl Into<String>) -> Self {
        self.help = Some(help.into());
        self
    }

    /// Adds the elements at fault.
    #[must_use]
    pub fn with_elements(mut self, elements: Vec<ElementRef>) -> Self {
        self.elements = elements;
        self
    }
}

impl fmt::Display for StepFailure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

impl std::error::Error for StepFailure {}

impl From<Cancelled> for StepFailure {
    fn from(_: Cancelled) -> Self {
        Self::new(FailureKind::Cancelled, "cancelled")
    }
}
