//! `meshmill convert`: a mesh from any format to any other, with all that it carries; what the other cannot hold is
//! told.

use std::path::{Path, PathBuf};

use super::exit::{Exit, Fault, say};
use crate::format::{self, Format, ReadCounts, WriteOptions};
use crate::mesh::Soup;
use crate::run::source::{self, SourceError};
use crate::run::{VERSION, write_named};
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
    let (soup, counts) = read_with_counts(&arguments.from)?;
    let binary = !arguments.text && format.is_binary_by_default();
    let options = WriteOptions { binary, header: format!("meshmill {VERSION}"), ..WriteOptions::default() };
    let bytes = format::write(format, &soup, &options).map_err(|error| {
        let help = error.remedy.clone();
        Fault::new(Exit::Step, format!("cannot write {}: {error}", arguments.to.display())).help_opt(help)
    })?;
    write_named(&arguments.to, &bytes)?;
    say(&format!("{}: {} vertices, {} faces", arguments.to.display(), soup.points.len(), soup.faces.len()));
    for what in counts.left_out() {
        say(&format!("  left out on reading: {what}"));
    }
    let lost = not_kept(format, &soup, &bytes);
    for what in &lost {
        say(&format!("  not kept in {}: {what}", format.title()));
    }
    if options.binary
        && !lost.is_empty()
        && let Ok(text) = format::write(format, &soup, &WriteOptions { binary: false, ..options })
        && not_kept(format, &soup, &text).len() < lost.len()
    {
        say("  try: --text, which keeps more");
    }
    Ok(Exit::Done)
}

/// What the file does not hold of the mesh.
fn not_kept(format: Format, before: &Soup, file: &[u8]) -> Vec<String> {
    match format::read(format, file, &Watch::silent()) {
        Ok((after, _)) => format::not_kept(before, &after),
        Err(error) => vec![format!("all of it; it cannot be read back: {error}")],
    }
}

/// Reads a mesh file of any format; says what was left out of it.
pub(super) fn read_mesh(path: &Path) -> Result<Soup, Fault> {
    let (soup, counts) = read_with_counts(path)?;
    for what in counts.left_out() {
        say(&format!("{}: left out on reading: {what}", path.display()));
    }
    Ok(soup)
}

fn read_with_counts(path: &Path) -> Result<(Soup, ReadCounts), Fault> {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let fault = |error: format::FormatError| {
        let help = error.remedy.clone();
        Fault::usage(format!("cannot read {}: {error}", path.display())).help_opt(help)
    };
    let bytes = match source::read(path) {
        Ok(source) => source.bytes,
        Err(SourceError::Include(error)) => return Err(fault(error)),
        Err(SourceError::Io(error)) => return Err(Fault::usage(format!("cannot read {}: {error}", path.display()))),
    };
    let format = Format::detect(&name, &bytes).map_err(fault)?;
    format::read(format, &bytes, &Watch::silent()).map_err(fault)
}
