//! `meshmill convert`: a mesh from any format to any other, with all that it carries.

use std::fs;
use std::path::{Path, PathBuf};

use super::exit::{Exit, Fault, say};
use crate::format::{self, Format, WriteOptions};
use crate::mesh::Soup;
use crate::run::{VERSION, write_file};
use crate::watch::Watch;

/// Convert a mesh; the formats are told by the file endings.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    /// The mesh to read.
    from: PathBuf,
    /// The file to write.
    to: PathBuf,
    /// Write text where the format has both text and binary.
    #[arg(long)]
    text: bool,
}

pub(super) fn run(arguments: &Arguments) -> Result<Exit, Fault> {
    let to_name = arguments.to.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let Some(format) = Format::from_file_name(&to_name) else {
        let known: Vec<&str> = Format::ALL.iter().flat_map(|format| format.endings()).copied().collect();
        return Err(Fault::usage(format!("`{to_name}` names no format that can be written"))
            .help(format!("use one of the endings {}", known.join(", "))));
    };
    let soup = read_mesh(&arguments.from)?;
    let options =
        WriteOptions { binary: !arguments.text, header: format!("meshmill {VERSION}"), ..WriteOptions::default() };
    let bytes = format::write(format, &soup, &options).map_err(|error| {
        let help = error.remedy.clone();
        Fault::new(Exit::Step, format!("cannot write {}: {error}", arguments.to.display())).help_opt(help)
    })?;
    write_file(&arguments.to, &bytes)?;
    say(&format!("{}: {} vertices, {} faces", arguments.to.display(), soup.points.len(), soup.faces.len()));
    Ok(Exit::Done)
}

/// Reads a mesh file of any format.
pub(super) fn read_mesh(path: &Path) -> Result<Soup, Fault> {
    let bytes = fs::read(path).map_err(|error| Fault::usage(format!("cannot read {}: {error}", path.display())))?;
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let fault = |error: format::FormatError| {
        let help = error.remedy.clone();
        Fault::usage(format!("cannot read {}: {error}", path.display())).help_opt(help)
    };
    let format = Format::detect(&name, &bytes).map_err(fault)?;
    let (soup, _) = format::read(format, &bytes, &Watch::silent()).map_err(fault)?;
    Ok(soup)
}
