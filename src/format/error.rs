//! Why a file cannot be read or a mesh cannot be written: format, place, reason and remedy.

use std::fmt;

use super::Format;
use crate::watch::Cancelled;

/// Where in the file the fault lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// A line of a text file, the first is 1.
    Line(u64),
    /// A byte of a binary file, the first is 0.
    Byte(u64),
    /// The file as a whole.
    File,
}

/// What is wrong with the file, or with the mesh to be written.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Reason {
    /// The file ends inside something.
    #[error("the file ends inside {within}")]
    Truncated {
        /// What the file ends in, such as `a facet`.
        within: &'static str,
    },
    /// A line of a table has too few values.
    #[error("the line ends inside {within}")]
    TooFew {
        /// What the line ends in, such as `a vertex`.
        within: &'static str,
    },
    /// A count promises more than the file can hold.
    #[error("{count} {what} are announced, but the rest of the file can hold at most {room}")]
    Untrue {
        /// What is counted.
        what: &'static str,
        /// The count in the file.
        count: u64,
        /// How many would fit.
        room: u64,
    },
    /// Something else was expected here.
    #[error("expected {expected}, found {found:?}")]
    Unexpected {
        /// What belongs here.
        expected: &'static str,
        /// What the file says, shortened.
        found: String,
    },
    /// A coordinate or value is NaN or infinite.
    #[error("{what} is not a finite number: {found}")]
    NotFinite {
        /// Which number.
        what: &'static str,
        /// What the file says.
        found: String,
    },
    /// Corners that differ would be the same in the format's 32 bits.
    #[error("the corners of the face at {at} are the same point in 32 bits")]
    Collapses {
        /// A corner.
        at: String,
    },
    /// A number that points at an element points at none.
    #[error("{what} {index} does not exist; {count} are known here")]
    OutOfRange {
        /// Which kind of reference, such as `vertex`.
        what: &'static str,
        /// The number in the file.
        index: i64,
        /// How many there are.
        count: u64,
    },
    /// The same number was given to two elements.
    #[error("{what} {id} is defined twice")]
    Duplicate {
        /// Which kind of element.
        what: &'static str,
        /// Its number.
        id: i64,
    },
    /// More elements than a mesh can hold.
    #[error("more than {limit} {what}")]
    TooMany {
        /// What is counted.
        what: &'static str,
        /// The limit.
        limit: u64,
    },
    /// The file is right, but uses something that is not read or cannot be written.
    #[error("{0} is not supported")]
    Unsupported(String),
    /// The file holds no mesh.
    #[error("the file holds no {0}")]
    Nothing(&'static str),
    /// Neither the name nor the content tells the format.
    #[error("neither the file's ending nor its content tells the format")]
    Unknown,
    /// A file that the deck includes cannot be read.
    #[error("`{name}` is not included: {why}")]
    Include {
        /// The file as the deck names it.
        name: String,
        /// Why.
        why: String,
    },
    /// The run was interrupted.
    #[error("cancelled")]
    Cancelled,
}

/// A fault of a file or of writing one.
#[derive(Clone, Debug, PartialEq)]
pub struct FormatError {
    /// The format, where it is known.
    pub format: Option<Format>,
    /// The included file that the place lies in; none for the file itself.
    pub included: Option<String>,
    /// Where.
    pub place: Place,
    /// What and why.
    pub reason: Reason,
    /// What the user may try.
    pub remedy: Option<String>,
}

impl FormatError {
    /// A fault at a place.
    pub fn new(place: Place, reason: Reason) -> Self {
        Self { format: None, included: None, place, reason, remedy: None }
    }

    /// Something else was expected at `place`.
    pub fn unexpected(place: Place, expected: &'static str, found: &[u8]) -> Self {
        Self::new(place, Reason::Unexpected { expected, found: excerpt(found) })
    }

    /// Adds what the user may try.
    #[must_use]
    pub fn with_remedy(mut self, remedy: impl Into<String>) -> Self {
        self.remedy = Some(remedy.into());
        self
    }

    /// Says which format was being read or written.
    #[must_use]
    pub fn in_format(mut self, format: Format) -> Self {
        self.format.get_or_insert(format);
        self
    }
}

/// At most 40 characters of `bytes`, fit for a message.
pub(super) fn excerpt(bytes: &[u8]) -> String {
    const LONGEST: usize = 40;
    let text = String::from_utf8_lossy(&bytes[..bytes.len().min(4 * LONGEST)]);
    let mut short: String = text.chars().take(LONGEST).collect();
    if short.len() < text.len() || bytes.len() > 4 * LONGEST {
        short.push('…');
    }
    short
}

impl fmt::Display for FormatError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(format) = self.format {
            write!(f, "{}, ", format.title())?;
        }
        if let Some(included) = &self.included {
            write!(f, "{}, ", included.escape_debug())?;
        }
        match self.place {
            Place::Line(line) => write!(f, "line {line}: ")?,
            Place::Byte(byte) => write!(f, "byte {byte}: ")?,
            Place::File if self.format.is_some() => f.write_str("whole file: ")?,
            Place::File => {}
        }
        self.reason.fmt(f)
    }
}

impl std::error::Error for FormatError {}

impl From<Cancelled> for FormatError {
    fn from(_: Cancelled) -> Self {
        Self::new(Place::File, Reason::Cancelled)
    }
}
