//! VTK's XML formats: unstructured grids (`.vtu`) and polygonal data (`.vtp`), read and written.
//!
//! Layout after Kitware, VTK File Formats (Schroeder, Martin, Lorensen: The Visualization Toolkit, 4th edition, 2006,
//! chapter 12). What the arrays mean is told in the model that the legacy format shares: groups, regions and fields
//! come back as they were.
//!
//! Reading takes text, base64 inline and appended data in base64 or raw, zlib and LZ4 blocks, both byte orders and both
//! widths of heads, several pieces, and all cell types: first and second order triangles and quads, polygons, strips
//! and pixels are faces, lines are members of edge groups, volumes are left out.
//!
//! A `.vtp` file has its lines before its faces, as the format orders them, and no quadratic cells, which it lacks.
//!
//! Writing gives one piece of 64-bit integers and floats, little-endian: as inline base64 in zlib blocks, which every
//! XML reader takes, or where binary is asked for, as raw appended data, which is written and read fastest. The same
//! mesh gives the same bytes. With second-order elements, cells are quadratic.
//!
//! Appended raw data is no XML: the reader parses the text before it, closed artificially, and takes the rest as
//! bytes. Entities are not expanded and the tree is limited to 65 536 nodes, so that the tree of any file is small.
//! Linear in the size of the file.

mod data;
mod write;

use std::borrow::Cow;

use glam::DVec3;
use roxmltree::{Document, Node, ParsingOptions};

use super::binary::{ByteOrder, finite};
use super::error::{FormatError, Place, Reason};
use super::vtk::model::{Array, DataSet, cell};
use super::{FormatDef, ReadCounts};
use crate::mesh::Soup;
use crate::watch::Watch;
use data::{Appended, Encoding, Packing};

pub(super) const DEF: FormatDef =
    FormatDef { name: "vtu", title: "VTK XML", endings: &["vtu"], sniff: is_grid, read, write: write::grid };

pub(super) const DEF_POLYGONAL: FormatDef = FormatDef {
    name: "vtp",
    title: "VTK XML polygonal data",
    endings: &["vtp"],
    sniff: is_polygonal,
    read,
    write: write::polygonal,
};

const MOST_NODES: u32 = 1 << 16;
/// Attributes of one element. The parser compares each with all others of its element, and VTK writes a dozen.
const MOST_ATTRIBUTES: usize = 256;
/// Declarations of name spaces in a file, which the parser copies into every element below; VTK writes none.
const MOST_NAME_SPACES: usize = 64;

fn is_grid(bytes: &[u8]) -> bool {
    begins_with(bytes, b"<VTKFile") && !is_polygonal(bytes)
}

fn is_polygonal(bytes: &[u8]) -> bool {
    begins_with(bytes, b"<VTKFile") && begins_with(bytes, b"PolyData")
}

/// Whether the head of the file has this word.
fn begins_with(bytes: &[u8], word: &[u8]) -> bool {
    bytes[..bytes.len().min(512)].windows(word.len()).any(|w| w == word)
}

fn read(bytes: &[u8], watch: &Watch) -> Result<(Soup, ReadCounts), FormatError> {
    let (text, appended) = split_appended(bytes)?;
    bounded(&text)?;
    let options = ParsingOptions { nodes_limit: MOST_NODES, ..ParsingOptions::default() };
    let document = Document::parse_with_options(&text, options).map_err(|e| not_xml(&e))?;
    let root = document.root_element();
    if root.tag_name().name() != "VTKFile" {
        return Err(FormatError::unexpected(place(root), "<VTKFile>", root.tag_name().name().as_bytes()));
    }
    let mut encoding = encoding(root, bytes, appended)?;
    let (grid, polygonal) = match root.attribute("type").unwrap_or("") {
        "UnstructuredGrid" => (child(root, "UnstructuredGrid")?, false),
        "PolyData" => (child(root, "PolyData")?, true),
        other => {
            return Err(FormatError::new(place(root), Reason::Unsupported(format!("a data set of type {other:?}"))));
        }
    };
    let mut set = DataSet::default();
    for node in grid.children().filter(Node::is_element) {
        match node.tag_name().name() {
            "Piece" => {
                watch.check()?;
                let piece = read_piece(node, polygonal, &mut encoding)?;
                set.append(piece, place(node))?;
            }
            "FieldData" => set.field_arrays.extend(arrays(node, &mut encoding)?),
            _ => {}
        }
    }
    set.into_soup()
}

/// The XML text of the file, and where its appended data begins. Without appended data the text is the whole file.
fn split_appended(bytes: &[u8]) -> Result<(Cow<'_, str>, Option<Appended>), FormatError> {
    let utf8 = |part| {
        std::str::from_utf8(part)
            .map_err(|e| FormatError::unexpected(Place::Byte(e.valid_up_to() as u64), "UTF-8 text", b"other bytes"))
    };
    let tag = b"<AppendedData";
    let Some(open) = bytes.windows(tag.len()).position(|w| w == tag) else { return Ok((utf8(bytes)?.into(), None)) };
    let within = |within| move || FormatError::new(Place::Byte(open as u64), Reason::Truncated { within });
    let close = bytes[open..].iter().position(|&b| b == b'>').ok_or_else(within("a tag"))? + open;
    let head = utf8(&bytes[..close])?;
    let base64 = head[open..].contains("base64");
    let mark = bytes[close..].iter().position(|&b| b == b'_').ok_or_else(within("appended data"))? + close;
    let closed = format!("{}/></VTKFile>", head.trim_end_matches('/'));
    Ok((closed.into(), Some(Appended { start: mark + 1, base64 })))
}

/// Refuses what the parser takes more than linear time for.
fn bounded(text: &str) -> Result<(), FormatError> {
    let too_many = |at: usize, what, limit: usize| {
        Err(FormatError::new(Place::Byte(at as u64), Reason::TooMany { what, limit: limit as u64 }))
    };
    let (mut quote, mut is_tag, mut attributes) = (None, false, 0);
    for (at, byte) in text.bytes().enumerate() {
        match (byte, quote) {
            (b'"' | b'\'', None) if is_tag => quote = Some(byte),
            (_, Some(open)) if byte == open => quote = None,
            (b'<', None) => (is_tag, attributes) = (true, 0),
            (b'>', None) => is_tag = false,
            (b'=', None) if is_tag => attributes += 1,
            _ => {}
        }
        if attributes > MOST_ATTRIBUTES {
            return too_many(at, "attributes of one XML element", MOST_ATTRIBUTES);
        }
    }
    if text.matches("xmlns").nth(MOST_NAME_SPACES).is_some() {
        return too_many(0, "XML name spaces", MOST_NAME_SPACES);
    }
    Ok(())
}

fn not_xml(error: &roxmltree::Error) -> FormatError {
    let place = Place::Line(u64::from(error.pos().row));
    match error {
        roxmltree::Error::NodesLimitReached => {
            FormatError::new(Place::File, Reason::TooMany { what: "XML nodes", limit: u64::from(MOST_NODES) })
        }
        other => FormatError::unexpected(place, "XML", other.to_string().as_bytes()),
    }
}

fn place(node: Node<'_, '_>) -> Place {
    Place::Byte(node.range().start as u64)
}

fn child<'a, 'i>(node: Node<'a, 'i>, name: &'static str) -> Result<Node<'a, 'i>, FormatError>
where
    'i: 'a,
{
    let found = node.children().find(|c| c.is_element() && c.tag_name().name() == name);
    found.ok_or_else(|| FormatError::new(place(node), Reason::Nothing(name)))
}

fn encoding<'a>(root: Node<'_, '_>, bytes: &'a [u8], appended: Option<Appended>) -> Result<Encoding<'a>, FormatError> {
    let order = match root.attribute("byte_order") {
        None | Some("LittleEndian") => ByteOrder::Little,
        Some("BigEndian") => ByteOrder::Big,
        Some(other) => return Err(FormatError::unexpected(place(root), "a byte order", other.as_bytes())),
    };
    let wide_heads = match root.attribute("header_type") {
        None | Some("UInt32") => false,
        Some("UInt64") => true,
        Some(other) => return Err(FormatError::unexpected(place(root), "UInt32 or UInt64", other.as_bytes())),
    };
    let packing = match root.attribute("compressor") {
        None | Some("") => None,
        Some("vtkZLibDataCompressor") => Some(Packing::Zlib),
        Some("vtkLZ4DataCompressor") => Some(Packing::Lz4),
        Some(other) => {
            return Err(FormatError::new(place(root), Reason::Unsupported(format!("the compressor {other}")))
                .with_remedy("write the file uncompressed or with vtkZLibDataCompressor"));
        }
    };
    // No mesh is packed more tightly than this; the least is for small files of constant arrays.
    let budget = (bytes.len() as u64).saturating_mul(256).max(1 << 26);
    Ok(Encoding { order, wide_heads, packing, bytes, appended, budget })
}

fn arrays(node: Node<'_, '_>, encoding: &mut Encoding<'_>) -> Result<Vec<Array>, FormatError> {
    let mut arrays = Vec::new();
    for array in node.children().filter(|c| c.has_tag_name("DataArray")) {
        arrays.extend(encoding.array(array)?);
    }
    Ok(arrays)
}

fn read_piece(piece: Node<'_, '_>, polygonal: bool, encoding: &mut Encoding<'_>) -> Result<DataSet, FormatError> {
    let mut set = DataSet::default();
    let points = child(piece, "Points")?;
    if let Some(array) = arrays(points, encoding)?.pop() {
        set.points = coordinates(array, place(points))?;
    }
    announced(piece, "NumberOfPoints", set.points.len())?;
    if polygonal {
        let lists = [
            ("Verts", cell::POLY_VERTEX),
            ("Lines", cell::POLY_LINE),
            ("Polys", cell::POLYGON),
            ("Strips", cell::STRIP),
        ];
        for (list, kind) in lists {
            if let Some(node) = piece.children().find(|c| c.has_tag_name(list)) {
                let before = set.types.len();
                read_cells(node, Some(kind), encoding, &mut set)?;
                announced(piece, &format!("NumberOf{list}"), set.types.len() - before)?;
            }
        }
    } else {
        read_cells(child(piece, "Cells")?, None, encoding, &mut set)?;
        announced(piece, "NumberOfCells", set.types.len())?;
    }
    for node in piece.children().filter(Node::is_element) {
        match node.tag_name().name() {
            "PointData" => set.point_arrays = arrays(node, encoding)?,
            "CellData" => set.cell_arrays = arrays(node, encoding)?,
            _ => {}
        }
    }
    Ok(set)
}

fn coordinates(array: Array, place: Place) -> Result<Vec<DVec3>, FormatError> {
    let values = array.values.into_floats();
    if array.components != 3 || !values.len().is_multiple_of(3) {
        return Err(FormatError::unexpected(
            place,
            "three coordinates a point",
            format!("{}", array.components).as_bytes(),
        ));
    }
    for &value in &values {
        finite(value, "a coordinate", place)?;
    }
    Ok(values.chunks_exact(3).map(DVec3::from_slice).collect())
}

/// Checks the attribute that says how many there are, where it is given.
fn announced(piece: Node<'_, '_>, attribute: &str, found: usize) -> Result<(), FormatError> {
    match piece.attribute(attribute) {
        Some(text) if text.trim().parse() != Ok(found) => {
            let found = format!("{found} where {attribute} is {text}");
            let expected = "as many points or cells as announced";
            Err(FormatError::new(place(piece), Reason::Unexpected { expected, found }))
        }
        _ => Ok(()),
    }
}

/// Appends the cells of one list; `kind` is their type where the list has no array of types.
fn read_cells(
    node: Node<'_, '_>,
    kind: Option<u8>,
    encoding: &mut Encoding<'_>,
    set: &mut DataSet,
) -> Result<(), FormatError> {
    let mut arrays = arrays(node, encoding)?;
    let mut integers = |name: &'static str| {
        let at = arrays.iter().position(|a| a.name == name);
        let array = at.map(|i| arrays.swap_remove(i)).and_then(|a| a.values.into_integers());
        array.ok_or_else(|| FormatError::new(place(node), Reason::Nothing(name)))
    };
    let (connectivity, ends) = match (integers("connectivity"), integers("offsets")) {
        (Ok(connectivity), Ok(ends)) => (connectivity, ends),
        // An empty list of polygonal data may have no arrays.
        (Err(_), Err(_)) if kind.is_some() => return Ok(()),
        (Err(error), _) | (_, Err(error)) => return Err(error),
    };
    let types = match kind {
        Some(kind) => vec![i64::from(kind); ends.len()],
        None => integers("types")?,
    };
    set.add_cells(&types, &ends, &connectivity, place(node))
}
