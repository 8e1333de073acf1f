//! Stereolithography (STL), text and binary: loose triangles, which are welded where coordinates are identical.
//!
//! Layout after 3D Systems, "Stereolithography Interface Specification", 1988. A file is binary when its size is
//! exactly what the facet count says, whatever its header begins with; else text when it begins with `solid` and the
//! start has no byte that text cannot have. Keywords may be written in two words and in any case (`end loop`), numbers
//! with decimal commas, and the last `endsolid` may be missing, which is told. Each named solid becomes a face group;
//! with several solids, a repeated or missing name becomes `NAME_2` or `solid_2` (the number of the solid). Normals and
//! attribute bytes are ignored: corners tell the orientation.
//!
//! The text writer makes one solid of each set of faces that are in the same groups, the first group's name in name
//! order, then the rest without a name. Lost on writing: in binary all groups and the precision beyond 32-bit floats,
//! in text the header and all memberships but the first; in both, quads (cut along the shorter diagonal), edge and
//! vertex groups and fields. O(corners) time.

use std::collections::{BTreeMap, BTreeSet};

use glam::DVec3;

use super::binary::{ByteOrder, ByteReader, check_single, finite};
use super::error::{FormatError, Place, Reason};
use super::sets::partition;
use super::text::{Scanner, parse_number, push_number};
use super::weld::Welder;
use super::{FormatDef, ReadCounts, ReadResult, WriteOptions};
use crate::mesh::{FaceId, Facet, Soup, VertexId};
use crate::watch::Watch;

pub(super) const DEF: FormatDef =
    FormatDef { name: "stl", title: "STL", endings: &["stl", "stla", "stlb"], sniff, read, write };

const HEADER: usize = 80;
const FACET: usize = 50;
/// Facets between two looks at the watch.
const STRIDE: usize = 1 << 16;

fn sniff(bytes: &[u8]) -> bool {
    binary_size_fits(bytes) || (looks_like_text(bytes) && begins_with_solid(bytes))
}

fn read(bytes: &[u8], watch: &Watch) -> ReadResult {
    if !binary_size_fits(bytes) && looks_like_text(bytes) { read_text(bytes, watch) } else { read_binary(bytes, watch) }
}

fn announced_facets(bytes: &[u8]) -> Option<u32> {
    let raw = bytes.get(HEADER..HEADER + 4)?;
    Some(u32::from_le_bytes([raw[0], raw[1], raw[2], raw[3]]))
}

/// Whether the size is that of a binary file.
pub(super) fn binary_size_fits(bytes: &[u8]) -> bool {
    announced_facets(bytes).is_some_and(|n| n > 0 && bytes.len() as u64 == 84 + FACET as u64 * u64::from(n))
}

fn begins_with_solid(bytes: &[u8]) -> bool {
    let start = bytes.trim_ascii_start();
    start.get(..5).is_some_and(|word| word.eq_ignore_ascii_case(b"solid"))
}

fn looks_like_text(bytes: &[u8]) -> bool {
    let start = bytes.trim_ascii_start();
    // A comment may stand before it, in a line of its own; then the error tells of that.
    let solid = start[..start.len().min(4096)].split(|&b| b == b'\n').any(begins_with_solid);
    // The name may be in any encoding, but no text has control bytes.
    solid && start.iter().take(512).all(|&b| b >= b' ' || b.is_ascii_whitespace() || b == 0x0b)
}

fn weld(welder: &mut Welder, position: DVec3, place: Place) -> Result<VertexId, FormatError> {
    let limit = u64::from(u32::MAX);
    welder.vertex(position).ok_or_else(|| FormatError::new(place, Reason::TooMany { what: "vertices", limit }))
}

fn finish(welder: Welder, faces: Vec<Facet>) -> (Soup, ReadCounts) {
    let corners = 3 * faces.len();
    let points = welder.into_points();
    let mut counts = ReadCounts::default();
    counts.corners_welded = corners - points.len();
    (Soup { points: points.into(), faces: faces.into(), ..Soup::default() }, counts)
}

fn read_binary(bytes: &[u8], watch: &Watch) -> ReadResult {
    let count = announced_facets(bytes).ok_or_else(|| {
        FormatError::new(Place::Byte(bytes.len() as u64), Reason::Truncated { within: "the header" })
            .with_remedy("a binary STL has at least 84 bytes, a text one begins with `solid`")
    })?;
    let mut reader = ByteReader::new(bytes, HEADER + 4, ByteOrder::Little);
    let count = reader.claim(u64::from(count), FACET, "facets")?;
    let rest = reader.left() - FACET * count;
    if count == 0 || rest >= FACET {
        return Err(untrue_binary_count(count, rest));
    }
    watch.phase("reading facets", Some(count as u64));
    let mut welder = Welder::new(count / 2 + 2);
    let mut faces = Vec::with_capacity(count);
    for facet in 0..count {
        if usize::is_multiple_of(facet, STRIDE) {
            watch.check()?;
            watch.advance(facet as u64, || format!("{facet} facets"));
        }
        let raw = reader.take(FACET, "a facet")?;
        let place = Place::Byte((HEADER + 4 + FACET * facet) as u64);
        let mut corners = [VertexId::from_raw(0); 3];
        for (corner, slot) in corners.iter_mut().enumerate() {
            let position = binary_position(&raw[12 + 12 * corner..]);
            if !position.is_finite() {
                return Err(binary_not_finite(bytes, facet, corner));
            }
            *slot = weld(&mut welder, position, place)?;
        }
        faces.push(Facet::Tri(corners));
    }
    Ok(finish(welder, faces))
}

#[inline]
fn binary_position(raw: &[u8]) -> DVec3 {
    let number = |at: usize| f64::from(f32::from_le_bytes([raw[at], raw[at + 1], raw[at + 2], raw[at + 3]]));
    DVec3::new(number(0), number(4), number(8))
}

fn untrue_binary_count(count: usize, rest: usize) -> FormatError {
    let room = (count + rest / FACET) as u64;
    let place = Place::Byte(HEADER as u64);
    if room == 0 {
        return FormatError::new(place, Reason::Nothing("facets"));
    }
    FormatError::new(place, Reason::Untrue { what: "facets", count: count as u64, room })
        .with_remedy("the count in bytes 80 to 83 was not filled in, or the file is not a binary STL: export it again")
}

/// The error for the first number of this corner that is not finite.
fn binary_not_finite(bytes: &[u8], facet: usize, corner: usize) -> FormatError {
    let at = HEADER + 4 + FACET * facet + 12 + 12 * corner;
    let mut reader = ByteReader::new(bytes, at, ByteOrder::Little);
    for _ in 0..3 {
        let place = reader.place();
        let checked = reader.f32("a facet").and_then(|value| finite(f64::from(value), "a coordinate", place));
        if let Err(error) = checked {
            return error;
        }
    }
    FormatError::new(Place::Byte(at as u64), Reason::Truncated { within: "a facet" })
}

/// The solids of a text file: name and number of the first face.
type Solids = Vec<(String, usize)>;

fn read_text(bytes: &[u8], watch: &Watch) -> ReadResult {
    let mut scanner = Scanner::new(bytes);
    let mut welder = Welder::new(bytes.len() / 500);
    let mut faces = Vec::new();
    let mut solids = Solids::new();
    let mut open = false;
    let mut commas = 0;
    watch.phase("reading facets", Some(bytes.len() as u64));
    while let Some(word) = scanner.word() {
        if word.eq_ignore_ascii_case(b"facet") && open {
            faces.push(Facet::Tri(text_facet(&mut scanner, &mut welder, &mut commas)?));
            if usize::is_multiple_of(faces.len(), STRIDE) {
                watch.check()?;
                watch.advance(scanner.offset() as u64, || format!("{} facets", faces.len()));
            }
        } else if word.eq_ignore_ascii_case(b"solid") && !open {
            solids.push((String::from_utf8_lossy(scanner.rest_of_line()).into_owned(), faces.len()));
            open = true;
        } else if open && is_end(&mut scanner, word, b"solid", true) {
            scanner.rest_of_line();
            open = false;
        } else {
            let expected = if open { "`facet` or `endsolid`" } else { "`solid`" };
            let error = FormatError::unexpected(scanner.place(), expected, word);
            return Err(if open { error } else { error.with_remedy("there is text before `solid`: remove it") });
        }
    }
    if faces.is_empty() {
        return Err(FormatError::new(Place::File, Reason::Nothing("facets")));
    }
    let (mut soup, mut counts) = finish(welder, faces);
    if open {
        counts.note("nothing, but the file ends before `endsolid`: it may be cut off");
    }
    if commas > 0 {
        counts.note("nothing, but decimal commas were taken for points");
    }
    soup.carried.groups.faces = solid_groups(&solids, soup.faces.len());
    Ok((soup, counts))
}

/// Reads a facet after its first word.
fn text_facet(
    scanner: &mut Scanner<'_>,
    welder: &mut Welder,
    commas: &mut usize,
) -> Result<[VertexId; 3], FormatError> {
    expect(scanner, b"normal", "`normal`")?;
    for _ in 0..3 {
        // A normal is never used, and degenerate facets often have one that is no number.
        skip_word(scanner)?;
    }
    expect(scanner, b"outer", "`outer`")?;
    expect(scanner, b"loop", "`loop`")?;
    let mut corners = [VertexId::from_raw(0); 3];
    for corner in &mut corners {
        expect(scanner, b"vertex", "`vertex`")?;
        let mut position = [0.0; 3];
        for number in &mut position {
            *number = coordinate(scanner, commas)?;
        }
        *corner = weld(welder, DVec3::from_array(position), scanner.place())?;
    }
    expect_end(scanner, b"loop", "`endloop`")?;
    expect_end(scanner, b"facet", "`endfacet`")?;
    Ok(corners)
}

/// A coordinate, with a decimal point or, from programs that follow the habits of a country, a decimal comma.
fn coordinate(scanner: &mut Scanner<'_>, commas: &mut usize) -> Result<f64, FormatError> {
    let word = skip_word(scanner)?;
    let mut parts = word.split(|&b| b == b',');
    let (Some(whole), Some(fraction), None) = (parts.next(), parts.next(), parts.next()) else {
        return parse_number(word, "a coordinate", scanner.place());
    };
    let is_one = whole.last().is_some_and(u8::is_ascii_digit)
        && fraction.first().is_some_and(u8::is_ascii_digit)
        && !word.contains(&b'.');
    if !is_one {
        return parse_number(word, "a coordinate", scanner.place());
    }
    *commas += 1;
    parse_number(&[whole, b".", fraction].concat(), "a coordinate", scanner.place())
}

/// Whether `word` ends a `what`: `endloop`, `end loop`, `end_loop`. Where `alone`, `end` does too, with all that
/// follows.
fn is_end(scanner: &mut Scanner<'_>, word: &[u8], what: &[u8], alone: bool) -> bool {
    let is = |word: &[u8], end: &[u8]| word.eq_ignore_ascii_case(end);
    let whole = word.get(..3).filter(|end| is(end, b"end")).map(|_| &word[3..]);
    match whole {
        Some(b"") if alone => true,
        Some(b"") => scanner.word().is_some_and(|next| is(next, what)),
        Some(rest) => is(rest.strip_prefix(b"_").unwrap_or(rest), what),
        None => false,
    }
}

fn expect_end(scanner: &mut Scanner<'_>, what: &[u8], expected: &'static str) -> Result<(), FormatError> {
    let word = skip_word(scanner)?;
    if is_end(scanner, word, what, false) {
        Ok(())
    } else {
        Err(FormatError::unexpected(scanner.place(), expected, word))
    }
}

fn skip_word<'a>(scanner: &mut Scanner<'a>) -> Result<&'a [u8], FormatError> {
    scanner.word().ok_or_else(|| {
        FormatError::new(scanner.place(), Reason::Truncated { within: "a facet" })
            .with_remedy("the file is cut off: export it again")
    })
}

fn expect(scanner: &mut Scanner<'_>, keyword: &[u8], expected: &'static str) -> Result<(), FormatError> {
    let word = skip_word(scanner)?;
    if word.eq_ignore_ascii_case(keyword) {
        return Ok(());
    }
    Err(FormatError::unexpected(scanner.place(), expected, word))
}

/// A face group for each solid that has faces; a lone solid without a name makes none.
fn solid_groups(solids: &Solids, faces: usize) -> BTreeMap<String, Vec<FaceId>> {
    let mut groups = BTreeMap::new();
    let names: BTreeSet<&str> = solids.iter().map(|(name, _)| name.as_str()).collect();
    let lone = solids.len() == 1;
    for (number, (name, first)) in solids.iter().enumerate() {
        let end = solids.get(number + 1).map_or(faces, |(_, next)| *next);
        if *first == end || (lone && name.is_empty()) {
            continue;
        }
        let stem = if name.is_empty() { "solid" } else { name.as_str() };
        let mut unique = if name.is_empty() { format!("solid_{}", number + 1) } else { name.clone() };
        let mut next = number + 1;
        while groups.contains_key(&unique) || (unique != *name && names.contains(unique.as_str())) {
            unique = format!("{stem}_{next}");
            next += 1;
        }
        groups.insert(unique, (*first..end).map(FaceId::new).collect());
    }
    groups
}

/// Each face as triangles: a quad is cut along its shorter diagonal, on a tie the one from its first corner.
fn triangles(soup: &Soup, facet: Facet) -> impl Iterator<Item = [DVec3; 3]> {
    let at = |v: VertexId| soup.points[v];
    let (first, second) = match facet {
        Facet::Tri([a, b, c]) => ([a, b, c], None),
        Facet::Quad([a, b, c, d]) if at(a).distance_squared(at(c)) <= at(b).distance_squared(at(d)) => {
            ([a, b, c], Some([a, c, d]))
        }
        Facet::Quad([a, b, c, d]) => ([a, b, d], Some([b, c, d])),
    };
    std::iter::once(first).chain(second).map(move |corners| corners.map(at))
}

fn unit_normal([a, b, c]: [DVec3; 3]) -> DVec3 {
    (b - a).cross(c - a).normalize_or_zero()
}

fn write(soup: &Soup, options: &WriteOptions<'_>) -> Result<Vec<u8>, FormatError> {
    if options.binary { write_binary(soup, options) } else { Ok(write_text(soup, options)) }
}

fn write_binary(soup: &Soup, options: &WriteOptions<'_>) -> Result<Vec<u8>, FormatError> {
    let count: usize = soup.faces.iter().map(|facet| facet.corners().len() - 2).sum();
    let announced = u32::try_from(count)
        .map_err(|_| FormatError::new(Place::File, Reason::TooMany { what: "facets", limit: u64::from(u32::MAX) }))?;
    let mut out = Vec::with_capacity(HEADER + 4 + FACET * count);
    // A header that begins with `solid` would make other readers take the file for text.
    out.extend(b"binary ".iter().chain(options.header.as_bytes()).copied().filter(u8::is_ascii).take(HEADER));
    out.resize(HEADER, b' ');
    out.extend(announced.to_le_bytes());
    for &facet in &soup.faces {
        for triangle in triangles(soup, facet) {
            check_single(triangle)?;
            for vector in std::iter::once(unit_normal(triangle)).chain(triangle) {
                for number in vector.to_array() {
                    out.extend(single(number)?.to_le_bytes());
                }
            }
            out.extend([0, 0]);
        }
    }
    Ok(out)
}

fn single(number: f64) -> Result<f32, FormatError> {
    let narrow = number as f32;
    if narrow.is_finite() {
        return Ok(narrow);
    }
    let reason = Reason::NotFinite { what: "a coordinate in 32 bits", found: number.to_string() };
    Err(FormatError::new(Place::File, reason).with_remedy("write text STL or another format"))
}

fn write_text(soup: &Soup, options: &WriteOptions<'_>) -> Vec<u8> {
    let mut out = Vec::with_capacity(250 * soup.faces.len() + 64);
    for (name, faces) in partition(soup) {
        push_solid_line(&mut out, "solid", &name);
        for face in faces {
            for triangle in triangles(soup, soup.faces[face]) {
                push_facet(&mut out, triangle, options.precision);
            }
        }
        push_solid_line(&mut out, "endsolid", &name);
    }
    out
}

fn push_solid_line(out: &mut Vec<u8>, keyword: &str, name: &str) {
    out.extend_from_slice(keyword.as_bytes());
    if !name.is_empty() {
        out.push(b' ');
        out.extend(name.bytes().map(|b| if b < b' ' { b'_' } else { b }));
    }
    out.push(b'\n');
}

fn push_facet(out: &mut Vec<u8>, triangle: [DVec3; 3], precision: Option<usize>) {
    // Nobody needs the normal's last digits, and few make the file a third smaller.
    push_vector(out, "  facet normal", unit_normal(triangle), Some(precision.unwrap_or(6)));
    out.extend_from_slice(b"    outer loop\n");
    for corner in triangle {
        push_vector(out, "      vertex", corner, precision);
    }
    out.extend_from_slice(b"    endloop\n  endfacet\n");
}

fn push_vector(out: &mut Vec<u8>, label: &str, vector: DVec3, precision: Option<usize>) {
    out.extend_from_slice(label.as_bytes());
    for number in vector.to_array() {
        out.push(b' ');
        push_number(out, number, precision);
    }
    out.push(b'\n');
}
