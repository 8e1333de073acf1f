//! Geomview's object file format (OFF), text and binary.
//!
//! Layout after the Geomview manual, chapter "OFF: numbered polygons" (Geometry Center, 1996). The prefixes `ST`, `C`
//! and `N` are understood and their values skipped; `4` and `n` (more than three dimensions) are refused. The keyword
//! may be missing, the counts may stand on its line, and comments may stand anywhere. A vertex and a face are a line
//! each; values after the ones needed are skipped, as many as a normal, a colour and a texture position have. Binary
//! files come in both byte orders and with or without the colours that the manual asks for after each face, because
//! programs differ; the variant is chosen that uses up the file exactly.
//!
//! OFF has no groups. The text writer adds them as comments after the last face, one line a group,
//! `#group faces 0-17,20 NAME`, which other programs skip and this reader understands. Lost on writing: fields; in
//! binary also the groups, the header and precision beyond 32-bit floats. O(file) time.

use glam::DVec3;

use super::binary::{ByteOrder, ByteReader, check_single, finite};
use super::builder::Builder;
use super::error::{FormatError, Place, Reason};
use super::group_text::{push_groups, read_groups};
use super::text::{Scanner, claim, parse_integer, push_integer, push_name, push_number};
use super::{FormatDef, ReadResult, WriteOptions};
use crate::mesh::Soup;
use crate::watch::Watch;

pub(super) const DEF: FormatDef =
    FormatDef { name: "off", title: "OFF", endings: &["off", "coff", "noff"], sniff, read, write };

/// Elements between two looks at the watch.
const STRIDE: usize = 1 << 16;

/// What the keyword says of a vertex.
#[derive(Clone, Copy, Debug, Default)]
struct Variant {
    texture: bool,
    colour: bool,
    normal: bool,
    binary: bool,
}

impl Variant {
    /// Bytes of a vertex in a binary file.
    fn vertex_bytes(self) -> usize {
        4 * (3 + if self.normal { 3 } else { 0 } + if self.colour { 4 } else { 0 } + if self.texture { 2 } else { 0 })
    }

    /// Whether a vertex of a text file may have `more` values after its coordinates: a normal, a colour of three or
    /// four, and with texture two more. Programs leave them out, and write them where the keyword has no letter for
    /// them.
    fn may_follow(self, more: usize) -> bool {
        let usual = |more| matches!(more, 0 | 3 | 4 | 6 | 7);
        usual(more) || (self.texture && more.checked_sub(2).is_some_and(usual))
    }
}

fn sniff(bytes: &[u8]) -> bool {
    let start = &bytes[..bytes.len().min(1 << 12)];
    Scanner::new(start).with_comments(b'#').word().is_some_and(|word| word.ends_with(b"OFF") && word.len() <= 8)
}

fn read(bytes: &[u8], watch: &Watch) -> ReadResult {
    let mut scanner = Scanner::new(bytes).with_comments(b'#');
    let variant = read_keyword(&mut scanner)?;
    if variant.binary {
        scanner.next_line();
        let start = bytes.len() - scanner.left();
        return read_binary(bytes, start, variant, watch);
    }
    read_text(scanner, variant, watch)
}

/// Reads the keyword, if there is one, and `BINARY` after it.
fn read_keyword(scanner: &mut Scanner<'_>) -> Result<Variant, FormatError> {
    let start = scanner.clone();
    let Some(word) = scanner.word() else {
        return Err(FormatError::new(Place::File, Reason::Nothing("faces")));
    };
    let Some(mut prefix) = word.strip_suffix(b"OFF") else {
        if parse_integer(word, "`OFF`", scanner.place()).is_ok() {
            *scanner = start;
            return Ok(Variant::default());
        }
        return Err(FormatError::unexpected(scanner.place(), "`OFF`", word));
    };
    let mut variant = Variant::default();
    for (mark, flag) in [(&b"ST"[..], &mut variant.texture), (b"C", &mut variant.colour), (b"N", &mut variant.normal)] {
        if let Some(rest) = prefix.strip_prefix(mark) {
            *flag = true;
            prefix = rest;
        }
    }
    if !prefix.is_empty() {
        let reason = Reason::Unsupported(format!("the variant `{}`", String::from_utf8_lossy(word)));
        return Err(FormatError::new(scanner.place(), reason).with_remedy("export plain OFF with three coordinates"));
    }
    let mut after = scanner.clone();
    if after.word_on_line() == Some(b"BINARY") {
        variant.binary = true;
        *scanner = after;
    }
    Ok(variant)
}

fn read_text(mut scanner: Scanner<'_>, variant: Variant, watch: &Watch) -> ReadResult {
    // A vertex takes 6 bytes at least (`0 0 0` and a line end), a face 2.
    let points = scanner.count("vertices", 6)?;
    let faces = scanner.count("faces", 2)?;
    scanner.next_line();
    watch.phase("reading mesh", Some((points + faces) as u64));
    let mut builder = Builder::new(points, faces);
    for vertex in 0..points {
        if vertex.is_multiple_of(STRIDE) {
            watch.check()?;
        }
        go_to_item(&mut scanner, "the vertices")?;
        let mut position = [0.0; 3];
        for number in &mut position {
            *number = scanner.number_on_line("a coordinate", "a vertex")?;
        }
        builder.point(DVec3::from_array(position), scanner.place())?;
        let more = std::iter::from_fn(|| scanner.word_on_line()).count();
        if !variant.may_follow(more) {
            let found = format!("{} values", more + 3);
            return Err(FormatError::unexpected(
                scanner.place(),
                "three coordinates, perhaps a normal and a colour",
                found.as_bytes(),
            )
            .with_remedy("the line has too many or too few values: export the file again"));
        }
    }
    let mut corners = Vec::new();
    // The soup's faces differ in number from the file's where polygons were cut or dropped.
    let mut first_of = Vec::with_capacity(faces);
    for face in 0..faces {
        if face.is_multiple_of(STRIDE) {
            watch.check()?;
            watch.advance((points + face) as u64, || format!("{face} faces"));
        }
        corners.clear();
        go_to_item(&mut scanner, "the faces")?;
        let count = scanner.count("corners", 2)?;
        let place = scanner.place();
        for _ in 0..count {
            let word =
                scanner.word_on_line().ok_or_else(|| FormatError::new(place, Reason::TooFew { within: "a face" }))?;
            let number = parse_integer(word, "a vertex number", place)?;
            corners.push(builder.vertex(number, 0, place)?);
        }
        first_of.push(builder.face(&corners, place)?.start);
        // A colour may follow: a number of a table, or three or four values.
        let more = std::iter::from_fn(|| scanner.word_on_line()).count();
        if !matches!(more, 0 | 1 | 3 | 4) {
            return Err(FormatError::unexpected(
                place,
                "the end of the line or a colour",
                format!("{more} values").as_bytes(),
            )
            .with_remedy("the number of corners does not fit the line: export the file again"));
        }
    }
    first_of.push(builder.faces());
    read_groups(&mut builder, scanner.without_comments(), &first_of)?;
    builder.finish()
}

/// Goes to the line of the next item of a table.
fn go_to_item(scanner: &mut Scanner<'_>, within: &'static str) -> Result<(), FormatError> {
    if scanner.go_to_word() { Ok(()) } else { Err(FormatError::new(scanner.place(), Reason::Truncated { within })) }
}

fn read_binary(bytes: &[u8], start: usize, variant: Variant, watch: &Watch) -> ReadResult {
    let mut error = None;
    for order in [ByteOrder::Big, ByteOrder::Little] {
        match binary_counts(ByteReader::new(bytes, start, order), variant) {
            Ok((reader, points, faces)) => {
                let block = points * variant.vertex_bytes();
                let colours = {
                    let mut ahead = reader.clone();
                    ahead.take(block, "a vertex")?;
                    faces_end_with_file(ahead, faces)
                };
                return read_binary_body(reader, points, faces, (variant, colours), watch);
            }
            Err(wrong) => error = error.or(Some(wrong)),
        }
    }
    Err(error.unwrap_or_else(|| FormatError::new(Place::File, Reason::Nothing("faces"))))
}

/// The counts, when the rest of the file can hold them in this byte order.
fn binary_counts(mut reader: ByteReader<'_>, variant: Variant) -> Result<(ByteReader<'_>, usize, usize), FormatError> {
    let mut counts = [0; 3];
    for count in &mut counts {
        *count = reader.u32("the counts")?;
    }
    let points = reader.claim(u64::from(counts[0]), variant.vertex_bytes(), "vertices")?;
    let room = (reader.left() - points * variant.vertex_bytes()) / 4;
    let faces = claim(i64::from(counts[1]), room, "faces", reader.place())?;
    Ok((reader, points, faces))
}

/// Whether the faces use up the file exactly when each is followed by its colours.
fn faces_end_with_file(mut reader: ByteReader<'_>, faces: usize) -> bool {
    for _ in 0..faces {
        for _ in ["corners", "colours"] {
            let Ok(count) = reader.u32("a face") else { return false };
            if reader.take((count as usize).saturating_mul(4), "a face").is_err() {
                return false;
            }
        }
    }
    reader.left() == 0
}

fn read_binary_body(
    mut reader: ByteReader<'_>,
    points: usize,
    faces: usize,
    (variant, colours): (Variant, bool),
    watch: &Watch,
) -> ReadResult {
    watch.phase("reading mesh", Some((points + faces) as u64));
    let mut builder = Builder::new(points, faces);
    for vertex in 0..points {
        if vertex.is_multiple_of(STRIDE) {
            watch.check()?;
        }
        let mut position = [0.0; 3];
        for number in &mut position {
            let place = reader.place();
            *number = finite(f64::from(reader.f32("a vertex")?), "a coordinate", place)?;
        }
        builder.point(DVec3::from_array(position), reader.place())?;
        reader.take(variant.vertex_bytes() - 12, "a vertex")?;
    }
    let mut corners = Vec::new();
    for face in 0..faces {
        if face.is_multiple_of(STRIDE) {
            watch.check()?;
            watch.advance((points + face) as u64, || format!("{face} faces"));
        }
        corners.clear();
        let place = reader.place();
        let count = reader.u32("a face")?;
        for _ in 0..reader.claim(u64::from(count), 4, "corners")? {
            let place = reader.place();
            let number = reader.i32("a face")?;
            corners.push(builder.vertex(i64::from(number), 0, place)?);
        }
        builder.face(&corners, place)?;
        if colours {
            let count = reader.u32("a face")?;
            reader.take((count as usize).saturating_mul(4), "a face's colours")?;
        }
    }
    builder.finish()
}

fn write(soup: &Soup, options: &WriteOptions<'_>) -> Result<Vec<u8>, FormatError> {
    if options.binary { write_binary(soup) } else { Ok(write_text(soup, options)) }
}

fn write_text(soup: &Soup, options: &WriteOptions<'_>) -> Vec<u8> {
    let mut out = Vec::with_capacity(60 * soup.points.len() + 24 * soup.faces.len() + 256);
    out.extend_from_slice(b"OFF\n");
    if !options.header.is_empty() {
        out.extend_from_slice(b"# ");
        push_name(&mut out, &options.header, false);
        out.push(b'\n');
    }
    push_integers(&mut out, &[soup.points.len() as u64, soup.faces.len() as u64, 0]);
    for point in &soup.points {
        for (axis, number) in point.to_array().into_iter().enumerate() {
            if axis > 0 {
                out.push(b' ');
            }
            push_number(&mut out, number, options.precision);
        }
        out.push(b'\n');
    }
    let mut numbers = Vec::new();
    for facet in &soup.faces {
        numbers.clear();
        numbers.push(facet.corners().len() as u64);
        numbers.extend(facet.corners().iter().map(|v| u64::from(v.raw())));
        push_integers(&mut out, &numbers);
    }
    push_groups(&mut out, soup);
    out
}

fn push_integers(out: &mut Vec<u8>, numbers: &[u64]) {
    for (position, &number) in numbers.iter().enumerate() {
        if position > 0 {
            out.push(b' ');
        }
        push_integer(out, number);
    }
    out.push(b'\n');
}

/// As the manual says: big endian, 32 bits, no colours a face.
fn write_binary(soup: &Soup) -> Result<Vec<u8>, FormatError> {
    let mut out = Vec::with_capacity(12 * soup.points.len() + 24 * soup.faces.len() + 32);
    out.extend_from_slice(b"OFF BINARY\n");
    for count in [soup.points.len(), soup.faces.len(), 0] {
        let limit = i32::MAX as u64;
        let count = i32::try_from(count)
            .map_err(|_| FormatError::new(Place::File, Reason::TooMany { what: "vertices or faces", limit }))?;
        out.extend(count.to_be_bytes());
    }
    for number in soup.points.iter().flat_map(DVec3::to_array) {
        let narrow = number as f32;
        finite(f64::from(narrow), "a coordinate in 32 bits", Place::File)?;
        out.extend(narrow.to_be_bytes());
    }
    for facet in &soup.faces {
        if let [a, b, c, ..] = *facet.corners() {
            check_single([a, b, c].map(|v| soup.points[v]))?;
        }
        out.extend((facet.corners().len() as u32).to_be_bytes());
        for vertex in facet.corners() {
            out.extend(vertex.raw().to_be_bytes());
        }
        out.extend(0_u32.to_be_bytes());
    }
    Ok(out)
}
