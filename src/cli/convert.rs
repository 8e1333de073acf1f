//! `meshmill convert`: a mesh from any format to any other, with all that it carries; what the other cannot hold is told.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use super::exit::{Exit, Fault, say};
use crate::format::{self, Format, ReadCounts, WriteOptions};
use crate::mesh::{Soup, Support};
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
    for what in left_out(counts) {
        say(&format!("  left out on reading: {what}"));
    }
    let lost = lost(format, &soup, &bytes);
    for what in &lost {
        say(&format!("  not kept in {}: {what}", format.title()));
    }
    if options.binary
        && !lost.is_empty()
        && let Ok(text) = format::write(format, &soup, &WriteOptions { binary: false, ..options })
        && self::lost(format, &soup, &text).len() < lost.len()
    {
        say("  try: --text, which keeps more");
    }
    Ok(Exit::Done)
}

/// What a reader left out, with numbers.
fn left_out(counts: ReadCounts) -> impl Iterator<Item = String> {
    let all = [
        (counts.faces_dropped, "faces with fewer than three corners"),
        (counts.fields_dropped, "fields without finite numbers"),
        (counts.elements_dropped, "elements that are no faces"),
        (counts.nodes_dropped, "nodes of these, and between corners"),
    ];
    all.into_iter().filter(|&(count, _)| count > 0).map(|(count, what)| format!("{count} {what}"))
}

/// What a mesh has, and has no more when the file is read again: the file decides, not what is known of its format.
fn lost(format: Format, before: &Soup, file: &[u8]) -> Vec<String> {
    let Ok((after, _)) = format::read(format, file, &Watch::silent()) else { return Vec::new() };
    let mut lost = Vec::new();
    if after.faces.len() < before.faces.len() {
        lost.push(format!("{} faces", before.faces.len() - after.faces.len()));
    }
    for ((what, before), (_, after)) in holdings(before).into_iter().zip(holdings(&after)) {
        let count = |all: &[(String, usize)]| all.iter().map(|&(_, members)| members).sum::<usize>();
        if after.len() < before.len() {
            let known: BTreeSet<&String> = after.iter().map(|(name, _)| name).collect();
            let gone = before.iter().filter(|(name, _)| !known.contains(name));
            let names: Vec<&str> = gone.map(|(name, _)| name.as_str()).collect();
            lost.push(format!("{what} {}", shortened(&names)));
        } else if count(&after) < count(&before) {
            lost.push(format!("{what}: {} of {} memberships", count(&before) - count(&after), count(&before)));
        }
    }
    lost
}

/// Names and sizes of all that a mesh carries and a file may hold, by kind.
fn holdings(soup: &Soup) -> [(&'static str, Vec<(String, usize)>); 5] {
    let carried = &soup.carried;
    let regions = carried.regions.iter().flat_map(|regions| {
        let mut sizes = vec![0; regions.names.len()];
        for &label in regions.labels.as_slice() {
            if let Some(size) = sizes.get_mut(label as usize) {
                *size += 1;
            }
        }
        regions.names.iter().cloned().zip(sizes)
    });
    let groups = |kind: &str| {
        let own = carried.groups.list().filter(move |&(k, ..)| k == kind);
        own.map(|(_, name, size)| (name.to_owned(), size)).collect::<Vec<_>>()
    };
    let fields = |support: Support| {
        let own = carried.fields.iter().filter(move |field| field.support == support);
        own.map(|field| (field.name.clone(), field.components)).collect()
    };
    [
        ("groups of faces", groups("faces").into_iter().chain(regions).collect()),
        ("groups of edges", groups("edges")),
        ("groups of vertices", groups("vertices")),
        ("fields on vertices", fields(Support::Vertex)),
        ("fields on faces", fields(Support::Face)),
    ]
}

/// Some names in a line.
fn shortened(names: &[&str]) -> String {
    const MOST: usize = 5;
    let shown: Vec<String> = names.iter().take(MOST).map(|name| format!("`{}`", printable(name))).collect();
    let more = if names.len() > MOST { format!(" and {} more", names.len() - MOST) } else { String::new() };
    shown.join(", ") + &more
}

/// A name from a file, fit for a terminal: control characters, which could steer it, as escapes.
fn printable(name: &str) -> String {
    name.chars().flat_map(|c| if c.is_control() { c.escape_default().collect() } else { vec![c] }).collect()
}

/// Reads a mesh file of any format.
pub(super) fn read_mesh(path: &Path) -> Result<Soup, Fault> {
    read_with_counts(path).map(|(soup, _)| soup)
}

fn read_with_counts(path: &Path) -> Result<(Soup, ReadCounts), Fault> {
    let bytes = fs::read(path).map_err(|error| Fault::usage(format!("cannot read {}: {error}", path.display())))?;
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let fault = |error: format::FormatError| {
        let help = error.remedy.clone();
        Fault::usage(format!("cannot read {}: {error}", path.display())).help_opt(help)
    };
    let format = Format::detect(&name, &bytes).map_err(fault)?;
    format::read(format, &bytes, &Watch::silent()).map_err(fault)
}
