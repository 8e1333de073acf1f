//! Exit codes, and faults that end a command: what, where, why, what to try.

use std::io::{ErrorKind, Write};
use std::process::ExitCode;
use std::sync::OnceLock;

use crate::recipe::Diagnostics;
use crate::report::Status;
use crate::report::json::{self, Kind};
use crate::run::RunError;
use crate::step::StepFailure;
use crate::step::failure::without_code;
use crate::store::StoreError;
use crate::terminal::printable_lines;

/// The exit codes of the command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Exit {
    /// Everything asked for was done.
    Done = 0,
    /// A fault of the program, such as a step that gives another result than before.
    Fault = 1,
    /// The recipe, an argument or an input file is wrong.
    Usage = 2,
    /// A gate failed.
    Gate = 3,
    /// A step failed.
    Step = 4,
    /// What is not as it was locked.
    Locked = 5,
    /// The cache or a disk failed.
    Store = 6,
    /// Interrupted by Ctrl-C.
    Interrupted = 130,
    /// Terminated by SIGTERM.
    Terminated = 143,
}

impl From<Exit> for ExitCode {
    fn from(exit: Exit) -> Self {
        Self::from(exit as u8)
    }
}

impl From<Status> for Exit {
    fn from(status: Status) -> Self {
        match status {
            Status::Done => Self::Done,
            Status::Differs => Self::Fault,
            Status::BadInput => Self::Usage,
            Status::GateFailed => Self::Gate,
            Status::StepFailed => Self::Step,
            Status::Cancelled => Self::Interrupted,
        }
    }
}

impl Exit {
    /// The exit of a run that is repeated.
    pub(super) fn of_code(code: u8) -> Option<Self> {
        [Self::Done, Self::Gate, Self::Step].into_iter().find(|exit| *exit as u8 == code)
    }
}

/// Why a command ends without its result.
#[derive(Debug)]
pub(super) struct Fault {
    pub(super) exit: Exit,
    message: String,
    help: Option<String>,
    /// The message is a finished report with its own head.
    rendered: bool,
}

impl Fault {
    pub(super) fn new(exit: Exit, message: impl Into<String>) -> Self {
        Self { exit, message: without_code(&message.into()), help: None, rendered: false }
    }

    /// The arguments are wrong.
    pub(super) fn usage(message: impl Into<String>) -> Self {
        Self::new(Exit::Usage, message)
    }

    pub(super) fn help(mut self, help: impl Into<String>) -> Self {
        self.help = Some(help.into());
        self
    }

    pub(super) fn help_opt(mut self, help: Option<String>) -> Self {
        self.help = help.or(self.help);
        self
    }

    /// Writes the fault to stderr.
    pub(super) fn print(&self) {
        if self.rendered {
            say_styled(&self.message);
        } else {
            say_error(&self.message, self.help.as_deref());
        }
    }
}

/// A document for programs as text.
pub(super) fn document_text(kind: Kind, content: &impl serde::Serialize) -> Result<String, Fault> {
    let text = json::document(kind, content).and_then(|document| serde_json::to_string_pretty(&document));
    text.map_err(|error| Fault::new(Exit::Fault, format!("cannot write JSON: {error}")))
}

impl From<Diagnostics> for Fault {
    fn from(diagnostics: Diagnostics) -> Self {
        // The stream strips colours where the terminal takes none.
        Self { exit: Exit::Usage, message: diagnostics.render(true), help: None, rendered: true }
    }
}

impl From<StoreError> for Fault {
    fn from(error: StoreError) -> Self {
        Self::new(Exit::Store, error.to_string())
            .help("check the folder and its free space, or use another one with --cache DIR")
    }
}

impl From<RunError> for Fault {
    fn from(error: RunError) -> Self {
        match error {
            RunError::Store(error) => error.into(),
            RunError::Output { .. } => {
                Self::new(Exit::Store, error.to_string()).help("check the folder and its free space, or use --out DIR")
            }
            RunError::WouldReplace { .. } => Self::usage(error.to_string())
                .help("name another folder with --out, or another output in the recipe; nothing was written"),
            RunError::Link(_) => {
                Self::usage(error.to_string()).help("remove the link, or name the folder itself with --out")
            }
            RunError::Claimed(_) => {
                Self::new(Exit::Store, error.to_string()).help("wait until it has ended, or use --out DIR")
            }
            RunError::Threads(..) => Self::new(Exit::Fault, error.to_string()).help("use fewer with --jobs N"),
        }
    }
}

/// A line to stderr. Nobody may be listening, which is no error.
pub(super) fn say(text: &str) {
    say_styled(&printable_lines(text));
}

/// The same for text with colours of ours.
pub(super) fn say_styled(text: &str) {
    let _ = writeln!(anstream::stderr(), "{text}");
}

/// The first failure to write to stdout.
static UNWRITTEN: OnceLock<String> = OnceLock::new();

/// Data to stdout. A reader that has seen enough, as `head` has, is no error; a full disk is, see [`unwritten`].
pub(super) fn data(text: &str) {
    let mut out = anstream::stdout();
    if let Err(error) = writeln!(out, "{text}").and_then(|()| out.flush())
        && error.kind() != ErrorKind::BrokenPipe
    {
        let _ = UNWRITTEN.set(without_code(&error.to_string()));
    }
}

/// The fault of a command whose data did not reach stdout.
pub(super) fn unwritten() -> Option<Fault> {
    let error = UNWRITTEN.get()?;
    Some(Fault::new(Exit::Store, format!("cannot write to the standard output: {error}")).help("check its free space"))
}

/// A text with its failures in red; the stream strips colours where the terminal takes none.
pub(super) fn coloured(text: &str) -> String {
    let red = anstyle::AnsiColor::Red.on_default().bold();
    printable_lines(text).replace("FAILED", &format!("{red}FAILED{red:#}"))
}

fn say_error(message: &str, help: Option<&str>) {
    let red = anstyle::AnsiColor::Red.on_default().bold();
    say_styled(&format!("{red}error{red:#}: {}", printable_lines(message)));
    if let Some(help) = help {
        say(&format!("  try: {help}"));
    }
}

/// Tells a failure of a step or output: what, where, why, what to try.
pub(super) fn say_failure(name: &str, failure: &StepFailure) {
    say_error(&format!("{name}: {}", failure.message), failure.help.as_deref());
    for element in failure.elements.iter().take(12) {
        let at = element.at.map(|at| format!(" at ({}, {}, {})", at.x, at.y, at.z)).unwrap_or_default();
        say(&format!("  {} {}{at}", element.kind, element.id));
    }
    if failure.elements.len() > 12 {
        say(&format!("  and {} more", failure.elements.len() - 12));
    }
}
