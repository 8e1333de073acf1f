//! The head of a PLY file: encoding, elements with their properties, and the names in its comments.

use std::collections::BTreeMap;

use super::super::binary::{ByteOrder, Scalar};
use super::super::error::{FormatError, Place, Reason};
use super::super::text::{Scanner, parse_integer};
use super::{EDGE_GROUP, FACE_GROUP, REGION, VERTEX_GROUP};

/// More properties than any exporter writes; bounds what one element can cost.
const MOST_PROPERTIES: usize = 4096;

/// How numbers are stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Encoding {
    Text,
    Binary(ByteOrder),
}

/// A number, or a list with a count before it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Property {
    pub(super) name: String,
    pub(super) scalar: Scalar,
    /// The type of a list's count.
    pub(super) list: Option<Scalar>,
}

/// A table of the file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Element {
    pub(super) name: String,
    pub(super) count: u64,
    pub(super) properties: Vec<Property>,
    /// The line that announces it.
    pub(super) place: Place,
}

impl Element {
    /// Bytes of one item at the least: empty lists in binary, one digit and a blank a number in text.
    pub(super) fn least_bytes(&self, encoding: Encoding) -> usize {
        match encoding {
            Encoding::Text => 2 * self.properties.len(),
            Encoding::Binary(_) => self.properties.iter().map(|p| p.list.unwrap_or(p.scalar).size()).sum(),
        }
    }
}

/// Names by the number that stands in the data.
pub(super) type Names = BTreeMap<i64, String>;

/// Everything before the data.
#[derive(Debug)]
pub(super) struct Head {
    pub(super) encoding: Encoding,
    pub(super) elements: Vec<Element>,
    pub(super) face_groups: Names,
    pub(super) edge_groups: Names,
    pub(super) vertex_groups: Names,
    pub(super) regions: Names,
}

/// Reads the head; the scanner stays at the first byte of the data.
pub(super) fn read_head(scanner: &mut Scanner<'_>) -> Result<Head, FormatError> {
    if scanner.word_on_line() != Some(b"ply") {
        return Err(FormatError::unexpected(scanner.place(), "`ply`", b"").with_remedy("this is no PLY file"));
    }
    let mut encoding = None;
    let mut head = Head {
        encoding: Encoding::Text,
        elements: Vec::new(),
        face_groups: Names::new(),
        edge_groups: Names::new(),
        vertex_groups: Names::new(),
        regions: Names::new(),
    };
    while scanner.next_line() {
        let place = scanner.place();
        match scanner.word_on_line() {
            Some(b"format") => encoding = Some(read_encoding(scanner)?),
            Some(b"element") => head.elements.push(read_element(scanner)?),
            Some(b"property") => read_property(scanner, head.elements.last_mut())?,
            Some(b"comment") => read_name(scanner, &mut head),
            Some(b"obj_info") | None => {}
            Some(b"end_header") => {
                scanner.next_line();
                head.encoding = encoding.ok_or_else(|| {
                    FormatError::new(place, Reason::Unexpected { expected: "`format`", found: "end_header".into() })
                })?;
                return Ok(head);
            }
            Some(word) => return Err(FormatError::unexpected(place, "a line of the head", word)),
        }
    }
    Err(FormatError::new(scanner.place(), Reason::Truncated { within: "the head" }))
}

fn read_encoding(scanner: &mut Scanner<'_>) -> Result<Encoding, FormatError> {
    match scanner.word_on_line().unwrap_or_default() {
        b"ascii" => Ok(Encoding::Text),
        b"binary_little_endian" => Ok(Encoding::Binary(ByteOrder::Little)),
        b"binary_big_endian" => Ok(Encoding::Binary(ByteOrder::Big)),
        other => Err(FormatError::unexpected(
            scanner.place(),
            "`ascii`, `binary_little_endian` or `binary_big_endian`",
            other,
        )),
    }
}

fn read_element(scanner: &mut Scanner<'_>) -> Result<Element, FormatError> {
    let place = scanner.place();
    let name = String::from_utf8_lossy(scanner.word_on_line().unwrap_or_default()).into_owned();
    let word = scanner.word_on_line().unwrap_or_default();
    let count = parse_integer(word, "a count of elements", place)?;
    let count = u64::try_from(count).map_err(|_| FormatError::unexpected(place, "a count of at least 0", word))?;
    Ok(Element { name, count, properties: Vec::new(), place })
}

fn read_property(scanner: &mut Scanner<'_>, element: Option<&mut Element>) -> Result<(), FormatError> {
    let place = scanner.place();
    let Some(element) = element else {
        return Err(FormatError::unexpected(place, "`element` before the first property", b"property"));
    };
    if element.properties.len() == MOST_PROPERTIES {
        let reason = Reason::TooMany { what: "properties of one element", limit: MOST_PROPERTIES as u64 };
        return Err(FormatError::new(place, reason));
    }
    let mut scalar = || {
        let word = scanner.word_on_line().unwrap_or_default();
        (word, scalar_named(word))
    };
    let unknown = |word: &[u8]| FormatError::unexpected(place, "a type of numbers", word);
    let (list, scalar) = match scalar() {
        (b"list", _) => {
            let (count, item) = (scalar(), scalar());
            (Some(count.1.ok_or_else(|| unknown(count.0))?), item.1.ok_or_else(|| unknown(item.0))?)
        }
        (word, known) => (None, known.ok_or_else(|| unknown(word))?),
    };
    let name = String::from_utf8_lossy(scanner.word_on_line().unwrap_or_default()).into_owned();
    element.properties.push(Property { name, scalar, list });
    Ok(())
}

/// Takes `KIND NUMBER NAME` from a comment and leaves all other comments alone.
fn read_name(scanner: &mut Scanner<'_>, head: &mut Head) {
    let kind = scanner.word_on_line().unwrap_or_default();
    let names = match std::str::from_utf8(kind) {
        Ok(FACE_GROUP) => &mut head.face_groups,
        Ok(EDGE_GROUP) => &mut head.edge_groups,
        Ok(VERTEX_GROUP) => &mut head.vertex_groups,
        Ok(REGION) => &mut head.regions,
        _ => return,
    };
    let number = scanner.word_on_line().unwrap_or_default();
    if let Ok(number) = parse_integer(number, "a number", Place::File) {
        names.insert(number, String::from_utf8_lossy(scanner.rest_of_line()).into_owned());
    }
}

/// The type that a header calls `name`.
fn scalar_named(name: &[u8]) -> Option<Scalar> {
    Some(match name {
        b"char" | b"int8" => Scalar::I8,
        b"uchar" | b"uint8" => Scalar::U8,
        b"short" | b"int16" => Scalar::I16,
        b"ushort" | b"uint16" => Scalar::U16,
        b"int" | b"int32" => Scalar::I32,
        b"uint" | b"uint32" => Scalar::U32,
        b"int64" => Scalar::I64,
        b"uint64" => Scalar::U64,
        b"float" | b"float32" => Scalar::F32,
        b"double" | b"float64" => Scalar::F64,
        _ => return None,
    })
}
