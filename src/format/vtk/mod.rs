//! Legacy VTK (`.vtk`), text and binary: unstructured grids and polygonal data, versions 1 to 5.1.
//!
//! Layout after Schroeder, Martin, Lorensen: The Visualization Toolkit, 4th edition, 2006, chapter 12, and for version
//! 5 Kitware's release notes (cells as offsets and connectivity). What cells and arrays mean is told in [`model`],
//! which the XML formats share. Binary numbers are big-endian, those of type `long` and `vtktypeint64` have 64 bits,
//! `vtkIdType` has 32.
//!
//! Writing gives version 3.0, which all programs read, as an unstructured grid with its arrays in `FIELD`s. Lost: what
//! the model does not tell (marks, pins), and the end of a header longer than 255 bytes. Linear in the size of the
//! file.

mod describe;
pub(super) mod model;
mod read;
mod write;

use super::FormatDef;

pub(super) const DEF: FormatDef =
    FormatDef { name: "vtk", title: "legacy VTK", endings: &["vtk"], sniff, read: read::read, write: write::write };

fn sniff(bytes: &[u8]) -> bool {
    bytes.starts_with(b"# vtk DataFile")
}

/// A name as one word: what is not a plain character is `%` and two hexadecimal digits.
fn encoded(name: &str) -> String {
    let plain = |b: u8| b.is_ascii_graphic() && !matches!(b, b'%' | b'"');
    let one = |b: u8| if plain(b) { char::from(b).to_string() } else { format!("%{b:02X}") };
    name.bytes().map(one).collect()
}

/// The name that was [`encoded`].
fn decoded(word: &[u8]) -> String {
    let mut bytes = Vec::with_capacity(word.len());
    let mut at = 0;
    while at < word.len() {
        let digits = word.get(at + 1..at + 3).and_then(|d| std::str::from_utf8(d).ok());
        let escaped = digits.and_then(|d| u8::from_str_radix(d, 16).ok()).filter(|_| word[at] == b'%');
        bytes.push(escaped.unwrap_or(word[at]));
        at += if escaped.is_some() { 3 } else { 1 };
    }
    String::from_utf8_lossy(&bytes).into_owned()
}
