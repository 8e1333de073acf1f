//! `meshmill man`: manual pages, made of the same definitions as `--help`.

use std::path::PathBuf;

use clap::{Command, CommandFactory};

use super::exit::{Exit, Fault, data, say};
use crate::run::write_file;

/// Print the manual page, or write one for every command into a folder.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    /// Write `meshmill.1`, `meshmill-run.1` and so on here.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

pub(super) fn run(arguments: &Arguments) -> Result<Exit, Fault> {
    let mut command = super::Arguments::command();
    command.build();
    let Some(out) = &arguments.out else {
        data(page(&command)?.trim_end());
        return Ok(Exit::Done);
    };
    let name = command.get_name().to_owned();
    write_file(&out.join(format!("{name}.1")), page(&command)?.as_bytes())?;
    let mut pages = 1;
    for part in command.get_subcommands().filter(|part| part.get_name() != "help") {
        let full = part.get_display_name().unwrap_or_else(|| part.get_name());
        write_file(&out.join(format!("{full}.1")), page(part)?.as_bytes())?;
        pages += 1;
    }
    say(&format!("{}: {pages} pages", out.display()));
    Ok(Exit::Done)
}

fn page(command: &Command) -> Result<String, Fault> {
    let mut text = Vec::new();
    clap_mangen::Man::new(command.clone())
        .render(&mut text)
        .map_err(|error| Fault::new(Exit::Fault, format!("cannot write the page: {error}")))?;
    Ok(String::from_utf8_lossy(&text).into_owned())
}
