//! Writes legacy files.

use super::super::WriteOptions;
use super::super::element::elevate_for;
use super::super::error::{FormatError, Place, Reason};
use super::super::text::{push_integer, push_number};
use super::encoded;
use super::model::{Array, DataSet, Values};
use crate::mesh::Soup;

/// The title's longest line, with its end.
const LONGEST_TITLE: usize = 255;

/// Writes `soup`.
pub(super) fn write(soup: &Soup, options: &WriteOptions<'_>) -> Result<Vec<u8>, FormatError> {
    let elevated = elevate_for(soup, options);
    let set = DataSet::of(soup, elevated.as_ref());
    let size = set.types.len() + set.connectivity.len();
    if size as u64 > i32::MAX as u64 {
        let reason =
            Reason::TooMany { what: "cell corners, which the format counts with 32 bits", limit: i32::MAX as u64 };
        return Err(FormatError::new(Place::File, reason).with_remedy("write a .vtu file"));
    }
    let mut out = Out { bytes: Vec::new(), binary: options.binary, precision: options.precision };
    let mut title: String = options.header.chars().map(|c| if c.is_control() { ' ' } else { c }).collect();
    while title.len() > LONGEST_TITLE {
        title.pop();
    }
    out.text(&format!("# vtk DataFile Version 3.0\n{title}\n{}\n", if options.binary { "BINARY" } else { "ASCII" }));
    out.text("DATASET UNSTRUCTURED_GRID\n");
    out.arrays(&set.field_arrays);
    out.text(&format!("POINTS {} double\n", set.points.len()));
    for point in &set.points {
        point.to_array().into_iter().for_each(|v| out.float(v));
        out.line();
    }
    out.end();
    out.text(&format!("CELLS {} {size}\n", set.types.len()));
    let mut begin = 0;
    for &end in &set.ends {
        out.int((end - begin) as i64);
        set.connectivity[begin..end].iter().for_each(|&p| out.int(i64::from(p)));
        out.line();
        begin = end;
    }
    out.end();
    out.text(&format!("CELL_TYPES {}\n", set.types.len()));
    for &kind in &set.types {
        out.int(i64::from(kind));
        out.line();
    }
    out.end();
    for (keyword, rows, arrays) in
        [("CELL_DATA", set.types.len(), &set.cell_arrays), ("POINT_DATA", set.points.len(), &set.point_arrays)]
    {
        if !arrays.is_empty() {
            out.text(&format!("{keyword} {rows}\n"));
            out.arrays(arrays);
        }
    }
    Ok(out.bytes)
}

/// The file as far as it is written.
struct Out {
    bytes: Vec<u8>,
    binary: bool,
    precision: Option<usize>,
}

impl Out {
    fn text(&mut self, text: &str) {
        self.bytes.extend_from_slice(text.as_bytes());
    }

    fn arrays(&mut self, arrays: &[Array]) {
        if arrays.is_empty() {
            return;
        }
        self.text(&format!("FIELD FieldData {}\n", arrays.len()));
        for Array { name, components, values } in arrays {
            let kind = match values {
                Values::Int(_) => "int",
                Values::Float(_) => "double",
                Values::Bytes(_) => "unsigned_char",
            };
            self.text(&format!("{} {components} {} {kind}\n", encoded(name), values.len() / components));
            match values {
                Values::Int(v) => v.iter().for_each(|&i| self.int(i)),
                Values::Float(v) => v.iter().for_each(|&f| self.float(f)),
                Values::Bytes(v) if self.binary => self.bytes.extend_from_slice(v),
                Values::Bytes(v) => v.iter().for_each(|&b| self.int(i64::from(b))),
            }
            self.line();
            self.end();
        }
    }

    fn int(&mut self, value: i64) {
        if self.binary {
            self.bytes.extend_from_slice(&(value as i32).to_be_bytes());
        } else {
            push_integer(&mut self.bytes, value as u64);
            self.bytes.push(b' ');
        }
    }

    fn float(&mut self, value: f64) {
        if self.binary {
            self.bytes.extend_from_slice(&value.to_be_bytes());
        } else if value.is_nan() {
            self.text("nan ");
        } else {
            push_number(&mut self.bytes, value, self.precision);
            self.bytes.push(b' ');
        }
    }

    /// Ends a line of text.
    fn line(&mut self) {
        if !self.binary {
            if self.bytes.last() == Some(&b' ') {
                self.bytes.pop();
            }
            self.bytes.push(b'\n');
        }
    }

    /// Ends binary data.
    fn end(&mut self) {
        if self.binary {
            self.bytes.push(b'\n');
        }
    }
}
