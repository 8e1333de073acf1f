//! The polygon file format (PLY), text and binary in both byte orders.
//!
//! Layout after G. Turk, "The PLY polygon file format", Stanford University, 1994. Elements and properties stand in any
//! order; unknown elements are skipped. Read are `x y z` of `vertex`, `vertex_indices` or `vertex_index` of `face`,
//! strips of `tristrips`, and `vertex1 vertex2` of `edge` (an edge group). Every other number a vertex or face becomes
//! a field; `NAME_0`, `NAME_1`, … become one field of several components; one that is NaN or infinite somewhere is left
//! out and counted. Other lists are skipped.
//!
//! PLY has no groups. The writer gives faces and vertices a list property `groups`, and edges an element, all with
//! numbers that comments of the head name (`comment face-group 0 NAME`); regions are a face property `region`, named
//! the same way. Other programs see numbers, this reader sees names. Nothing is lost but marks and pins. O(file) time.

mod head;
mod reader;
mod writer;

use super::FormatDef;
use super::text::Scanner;

pub(super) const DEF: FormatDef = FormatDef {
    name: "ply",
    title: "PLY",
    endings: &["ply"],
    sniff: |bytes| Scanner::new(&bytes[..bytes.len().min(16)]).word_on_line() == Some(b"ply"),
    read: reader::read,
    write: |soup, options| Ok(writer::write(soup, options)),
};

/// The comments of the head that name the numbers of `groups` and `region`.
const FACE_GROUP: &str = "face-group";
const EDGE_GROUP: &str = "edge-group";
const VERTEX_GROUP: &str = "vertex-group";
const REGION: &str = "region";
