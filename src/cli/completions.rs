//! `meshmill completions`: completion scripts for shells.

use clap::CommandFactory;

use super::exit::{Exit, Fault};

/// Print a completion script for a shell.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    /// The shell.
    shell: clap_complete::Shell,
}

#[expect(clippy::unnecessary_wraps, reason = "every subcommand has this form")]
pub(super) fn run(arguments: &Arguments) -> Result<Exit, Fault> {
    let mut command = super::Arguments::command();
    clap_complete::generate(arguments.shell, &mut command, "meshmill", &mut std::io::stdout());
    Ok(Exit::Done)
}
