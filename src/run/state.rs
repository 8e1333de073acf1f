//! The states of a node, and which may follow which.

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
    pub(super) fn may_become(self, next: Self) -> bool {
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
