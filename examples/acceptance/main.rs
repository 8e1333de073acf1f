//! Runs the shipped pipelines on many parts through the program itself and prints the tables that the notes quote.
//!
//! ```sh
//! cargo run --release --example acceptance              # fe-surface on every part
//! cargo run --release --example acceptance -- papers    # Table 1 of Date et al., property control, on stand-ins
//! cargo run --release --example acceptance -- levels    # Table 1 of Date et al., adaptive levels of detail, likewise
//! cargo run --release --example acceptance -- fe-surface crankshaft fandisk
//! cargo run --release --example acceptance -- rate FOLDER...    # every pipeline on every mesh: what passes, and when
//! cargo run --release --example acceptance -- kinds FOLDER...   # what each mesh is, the list that `rate` groups by
//! ```
//!
//! Parts: `examples/meshes`, and those of the folder named by `MESHMILL_CORPUS`, where it is set. Every figure is
//! measured on the file that was written, read again. The exit code is 1 when a row misses a target.

#![expect(clippy::print_stdout, clippy::print_stderr, reason = "this program is a table")]

mod fe_surface;
mod kinds;
mod papers;
mod program;
mod rate;
mod timed;

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Parser, Subcommand};

#[derive(Parser)]
struct Arguments {
    #[command(subcommand)]
    table: Option<Table>,
}

#[derive(Subcommand)]
enum Table {
    /// `fe-surface` on every part, or on those whose path contains one of these words.
    FeSurface { parts: Vec<String> },
    /// Table 1 of Date et al. (JCISE 2005).
    Papers { parts: Vec<String> },
    /// Table 1 of Date et al. (CAD/CG 2005).
    Levels { parts: Vec<String> },
    /// Every shipped pipeline on every mesh of some folders: share passed, processor time, failures with their reason.
    Rate(rate::Rate),
    /// Whether each mesh of some folders is closed, closed with crossing faces, or open, as `rate --kinds` reads it.
    Kinds { folders: Vec<PathBuf> },
}

fn main() -> ExitCode {
    let table = Arguments::parse().table.unwrap_or(Table::FeSurface { parts: Vec::new() });
    let needs_program = !matches!(&table, Table::Rate(rate) if rate.program.is_some());
    let built = if needs_program && !matches!(table, Table::Kinds { .. }) { program::build() } else { None };
    let holds = match (table, built) {
        (Table::Kinds { folders }, _) => kinds::list(&folders),
        (Table::Rate(rate), built) if rate.program.is_some() || built.is_some() => rate.run(built),
        (Table::FeSurface { parts }, Some(_)) => fe_surface::fe_surface(&parts),
        (Table::Papers { parts }, Some(_)) => papers::papers(&parts),
        (Table::Levels { parts }, Some(_)) => papers::levels(&parts),
        _ => {
            eprintln!("the program could not be built");
            false
        }
    };
    if holds { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}
