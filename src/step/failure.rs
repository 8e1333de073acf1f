//! Why a step gave no result: what, where and what to try.

use std::fmt;

use glam::DVec3;
use serde::{Deserialize, Serialize};

use crate::watch::Cancelled;

/// What sort of failure, which decides the exit code.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
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
    /// The step took longer than its limit: exit code 4.
    TimedOut,
    /// The step took more memory than its limit: exit code 4.
    OverMemory,
}

impl FailureKind {
    /// Whether a limit of the recipe ended the step.
    pub fn is_of_limits(self) -> bool {
        match self {
            Self::TimedOut | Self::OverMemory => true,
            Self::BadInput | Self::Failed | Self::Cancelled | Self::Panicked => false,
        }
    }
}

/// An element of a mesh that a message is about.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct ElementRef {
    /// `vertex`, `edge`, `face`, `line` or `byte`.
    pub kind: String,
    /// Its number in the mesh or file.
    pub id: u64,
    /// Where it is, in model coordinates.
    #[schemars(with = "Option<[f64; 3]>")]
    pub at: Option<DVec3>,
}

/// A step's failure as the rest of the program sees it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
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
        Self { kind, message: without_code(&message.into()), help: None, elements: Vec::new() }
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

    /// Puts what was perhaps meant before what the user may try.
    #[must_use]
    pub fn with_guess(mut self, guess: Option<String>) -> Self {
        self.help = match (guess, self.help) {
            (Some(guess), Some(help)) => Some(format!("{guess} Else {help}")),
            (guess, help) => guess.or(help),
        };
        self
    }

    /// Adds the elements at fault.
    #[must_use]
    pub fn with_elements(mut self, elements: Vec<ElementRef>) -> Self {
        self.elements = elements;
        self
    }
}

/// A message without the number that the system adds to its errors: `No such file or directory (os error 2)` says it
/// all before the parenthesis.
pub fn without_code(message: &str) -> String {
    let mut text = String::with_capacity(message.len());
    let mut parts = message.split(" (os error ");
    text.push_str(parts.next().unwrap_or_default());
    for part in parts {
        match part.split_once(')') {
            Some((code, rest)) if code.parse::<i32>().is_ok() => text.push_str(rest),
            _ => {
                text.push_str(" (os error ");
                text.push_str(part);
            }
        }
    }
    text
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_systems_numbers_are_left_out() {
        let told =
            without_code("cannot read a: No such file (os error 2); b: denied (os error 13), or (os error x) not");
        assert_eq!(told, "cannot read a: No such file; b: denied, or (os error x) not");
        let error = std::io::Error::from_raw_os_error(2);
        assert!(!StepFailure::failed(error.to_string()).message.contains("os error"));
    }
}
