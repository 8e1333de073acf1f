//! Nastran bulk data (`.bdf`, `.nas`, `.dat`): grid points and shell elements, grouped by property.
//!
//! Cards after MSC Software, "MSC Nastran Quick Reference Guide", in short, long and free fields, with continuation
//! lines and exponents without an `E`.
//!
//! Reading: CTRIA3, CTRIAR, CTRIA6, CQUAD4, CQUADR, CQUAD8, CSHEAR and their plane and axisymmetric kin become faces
//! (of second-order elements only the corners are used), bars, beams, rods and plot elements edges of their property's
//! group, solids are left out and counted, except where there is nothing else: then their skin is the mesh. Cards that
//! make or mirror geometry are refused by name, other elements and cards that are not known to be harmless are passed
//! over and named. Each property number is a face group, called as a comment `$HMNAME PROP 7"name"` says (the habit of
//! several preprocessors), else `pid_7`. Grid points in a coordinate system of their own, or in the default one of
//! `GRDSET`, are placed in the basic system. `INCLUDE` is followed where files are opened (see `format::include`), and
//! refused here.
//!
//! Writing: long-field GRID cards of at most 16 characters a coordinate, which rounds some beyond their 13th digit; one
//! property for each face group in name order, a face in several groups in the first of them, faces in none in a
//! property without a name. No PSHELL is written: thickness and material are the analyst's. Lost: edge and vertex
//! groups, fields, further memberships. Linear in the size of the file.

mod cards;
mod harmless;
mod read;
mod systems;
mod write;

use super::FormatDef;
use super::text::Scanner;

pub(super) const DEF: FormatDef = FormatDef {
    name: "bdf",
    title: "Nastran bulk data",
    endings: &["bdf", "nas", "dat"],
    sniff,
    read: read::read,
    write: write::write,
};

/// Comments before the first card are `$`; the first words are those of a deck or of a card we read.
fn sniff(bytes: &[u8]) -> bool {
    const FIRST: [&[u8]; 7] = [b"SOL", b"CEND", b"BEGIN", b"GRID", b"GRID*", b"CTRIA3", b"CQUAD4"];
    let mut scanner = Scanner::new(&bytes[..bytes.len().min(1 << 12)]).with_comments(b'$');
    let word = scanner.word().unwrap_or_default();
    let word = word.split(|&b| b == b',').next().unwrap_or_default();
    FIRST.iter().any(|first| word.eq_ignore_ascii_case(first))
}
