//! Writes `.vtu` and `.vtp`: one piece of an unstructured grid, or of polygonal data.

use std::io::Write;
use std::ops::Range;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use flate2::Compression;
use flate2::write::ZlibEncoder;
use rayon::prelude::*;

use super::super::element::elevate_for;
use super::super::error::FormatError;
use super::super::vtk::model::{Array, DataSet, Values};
use super::super::{Element, WriteOptions, error};
use crate::mesh::Soup;

/// The bytes of a block that is packed on its own.
const BLOCK: usize = 1 << 20;
/// Packing harder costs several times the time for a tenth of the size.
const LEVEL: u32 = 1;

/// Writes `soup` as an unstructured grid.
pub(super) fn grid(soup: &Soup, options: &WriteOptions<'_>) -> Result<Vec<u8>, FormatError> {
    let elevated = elevate_for(soup, options);
    let set = DataSet::of(soup, elevated.as_ref());
    let cells = [CellList { element: CELLS, range: 0..set.types.len() }];
    File::new(options).data_set("UnstructuredGrid", &set, &cells, &options.header)
}

/// Writes `soup` as polygonal data: lines, then faces.
pub(super) fn polygonal(soup: &Soup, options: &WriteOptions<'_>) -> Result<Vec<u8>, FormatError> {
    if options.element.is_some_and(Element::is_quadratic) {
        let reason = error::Reason::Unsupported("polygonal data with second-order elements".into());
        return Err(
            FormatError::new(error::Place::File, reason).with_remedy("write a .vtu file, or first-order elements")
        );
    }
    let mut set = DataSet::of(soup, None);
    let lines = set.types.len() - soup.faces.len();
    set.rotate_cells(soup.faces.len());
    let cells =
        [CellList { element: "Lines", range: 0..lines }, CellList { element: "Polys", range: lines..set.types.len() }];
    File::new(options).data_set("PolyData", &set, &cells, &options.header)
}

/// The element of cells of any type, which has an array of these too.
const CELLS: &str = "Cells";

/// Cells that stand in the file under one element.
struct CellList {
    element: &'static str,
    range: Range<usize>,
}

/// The file as far as it is written.
struct File {
    out: Vec<u8>,
    /// Whether data is appended raw; else it is inline base64 in zlib blocks.
    raw: bool,
    appended: Vec<u8>,
}

impl File {
    fn new(options: &WriteOptions<'_>) -> Self {
        Self { out: Vec::new(), raw: options.binary, appended: Vec::new() }
    }

    fn data_set(mut self, kind: &str, set: &DataSet, cells: &[CellList], header: &str) -> Result<Vec<u8>, FormatError> {
        self.open(kind, header);
        self.arrays("FieldData", &set.field_arrays, true)?;
        self.text(&format!("<Piece NumberOfPoints=\"{}\"", set.points.len()));
        for CellList { element, range } in cells {
            self.text(&format!(" NumberOf{element}=\"{}\"", range.len()));
        }
        self.text(">\n<Points>\n");
        let coordinates: &[f64] = bytemuck::cast_slice(&set.points);
        self.data("Points", "Float64", 3, None, bytemuck::cast_slice(coordinates))?;
        self.text("</Points>\n");
        for list in cells {
            self.cells(set, list)?;
        }
        self.arrays("PointData", &set.point_arrays, false)?;
        self.arrays("CellData", &set.cell_arrays, false)?;
        self.text(&format!("</Piece>\n</{kind}>\n"));
        if self.raw {
            self.text("<AppendedData encoding=\"raw\">\n_");
            let appended = std::mem::take(&mut self.appended);
            self.out.extend(appended);
            self.text("\n</AppendedData>\n");
        }
        self.text("</VTKFile>\n");
        Ok(self.out)
    }

    fn open(&mut self, kind: &str, header: &str) {
        let compressor = if self.raw { "" } else { " compressor=\"vtkZLibDataCompressor\"" };
        self.text("<?xml version=\"1.0\"?>\n");
        if !header.is_empty() {
            // Two hyphens would end the comment.
            self.text(&format!("<!-- {} -->\n", header.replace("--", "- -")));
        }
        self.text(&format!(
            "<VTKFile type=\"{kind}\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\""
        ));
        self.text(&format!("{compressor}>\n<{kind}>\n"));
    }

    fn cells(&mut self, set: &DataSet, list: &CellList) -> Result<(), FormatError> {
        let CellList { element, range } = list;
        let start = range.start.checked_sub(1).map_or(0, |before| set.ends[before]);
        let ends = &set.ends[range.clone()];
        let corners = &set.connectivity[start..ends.last().copied().unwrap_or(start)];
        self.text(&format!("<{element}>\n"));
        let connectivity: Vec<u8> = corners.iter().flat_map(|&p| i64::from(p).to_le_bytes()).collect();
        self.data("connectivity", "Int64", 1, None, &connectivity)?;
        let ends: Vec<u8> = ends.iter().flat_map(|&e| ((e - start) as i64).to_le_bytes()).collect();
        self.data("offsets", "Int64", 1, None, &ends)?;
        if *element == CELLS {
            self.data("types", "UInt8", 1, None, &set.types[range.clone()])?;
        }
        self.text(&format!("</{element}>\n"));
        Ok(())
    }

    fn text(&mut self, text: &str) {
        self.out.extend_from_slice(text.as_bytes());
    }

    fn arrays(&mut self, element: &str, arrays: &[Array], field: bool) -> Result<(), FormatError> {
        if arrays.is_empty() && field {
            return Ok(());
        }
        self.text(&format!("<{element}>\n"));
        for Array { name, components, values } in arrays {
            let tuples = field.then_some(values.len());
            match values {
                Values::Bytes(v) => self.data(name, "UInt8", *components, tuples, v)?,
                Values::Int(v) => {
                    let bytes: Vec<u8> = v.iter().flat_map(|i| i.to_le_bytes()).collect();
                    self.data(name, "Int64", *components, tuples, &bytes)?;
                }
                Values::Float(v) => {
                    let bytes: Vec<u8> = v.iter().flat_map(|f| f.to_le_bytes()).collect();
                    self.data(name, "Float64", *components, tuples, &bytes)?;
                }
            }
        }
        self.text(&format!("</{element}>\n"));
        Ok(())
    }

    fn data(
        &mut self,
        name: &str,
        kind: &str,
        components: usize,
        tuples: Option<usize>,
        bytes: &[u8],
    ) -> Result<(), FormatError> {
        self.text(&format!("<DataArray type=\"{kind}\" Name=\"{}\"", escaped(name)));
        if components != 1 {
            self.text(&format!(" NumberOfComponents=\"{components}\""));
        }
        if let Some(tuples) = tuples {
            self.text(&format!(" NumberOfTuples=\"{tuples}\""));
        }
        if self.raw {
            let offset = self.appended.len();
            self.text(&format!(" format=\"appended\" offset=\"{offset}\"/>\n"));
            self.appended.extend_from_slice(&(bytes.len() as u64).to_le_bytes());
            self.appended.extend_from_slice(bytes);
            return Ok(());
        }
        self.text(" format=\"binary\">\n");
        let blocks = packed_blocks(bytes)?;
        let last = bytes.len() % BLOCK;
        let mut head: Vec<u8> = Vec::new();
        for number in [blocks.len(), BLOCK, last].into_iter().chain(blocks.iter().map(Vec::len)) {
            head.extend_from_slice(&(number as u64).to_le_bytes());
        }
        self.out.extend_from_slice(STANDARD.encode(head).as_bytes());
        self.out.extend_from_slice(STANDARD.encode(blocks.concat()).as_bytes());
        self.text("\n</DataArray>\n");
        Ok(())
    }
}

fn packed_blocks(bytes: &[u8]) -> Result<Vec<Vec<u8>>, FormatError> {
    let pack = |block: &[u8]| {
        let mut encoder = ZlibEncoder::new(Vec::with_capacity(block.len() / 2), Compression::new(LEVEL));
        encoder.write_all(block)?;
        encoder.finish()
    };
    let packed: std::io::Result<Vec<Vec<u8>>> = bytes.par_chunks(BLOCK).map(pack).collect();
    packed.map_err(|e| FormatError::new(error::Place::File, error::Reason::Unsupported(format!("packing: {e}"))))
}

/// A name as an attribute's value. Control characters are not allowed in XML; tabs and line ends would not come back.
fn escaped(name: &str) -> String {
    let mut out = String::with_capacity(name.len());
    for c in name.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\t' => out.push_str("&#9;"),
            '\n' => out.push_str("&#10;"),
            '\r' => out.push_str("&#13;"),
            c if c.is_control() || matches!(c, '\u{fffe}' | '\u{ffff}') => out.push('_'),
            c => out.push(c),
        }
    }
    out
}
