//! Reads legacy files keyword by keyword into the data set.

use glam::DVec3;

use super::super::ReadCounts;
use super::super::binary::{ByteOrder, finite};
use super::super::error::{FormatError, Place, Reason};
use super::super::mixed::Input;
use super::decoded;
use super::model::{Array, DataSet, Values, cell};
use crate::mesh::Soup;
use crate::watch::Watch;

/// Reads a legacy file.
pub(super) fn read(bytes: &[u8], watch: &Watch) -> Result<(Soup, ReadCounts), FormatError> {
    let mut input = Input::new(bytes);
    let head = input.rest_of_line();
    if !head.starts_with(b"# vtk DataFile Version") {
        return Err(FormatError::unexpected(input.place(), "# vtk DataFile Version", head));
    }
    let version = head.rsplit(|&b| b == b' ').next().unwrap_or(b"");
    let offsets = version.first().is_some_and(|&b| b >= b'5');
    input.end_line();
    input.rest_of_line();
    let kind = input.need_word("the head")?.to_ascii_uppercase();
    let binary = match kind.as_slice() {
        b"ASCII" => false,
        b"BINARY" => true,
        other => return Err(FormatError::unexpected(input.place(), "ASCII or BINARY", other)),
    };
    input.order = binary.then_some(ByteOrder::Big);
    let mut reader =
        Reader { input, set: DataSet::default(), offsets, connectivity: Vec::new(), ends: Vec::new(), on: None };
    while let Some(word) = reader.input.word() {
        watch.check()?;
        let keyword = word.to_ascii_uppercase();
        reader.keyword(&keyword)?;
    }
    reader.set.into_soup()
}

/// What attribute arrays belong to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum On {
    Points(usize),
    Cells(usize),
}

#[derive(Debug)]
struct Reader<'a> {
    input: Input<'a>,
    set: DataSet,
    /// Whether cells are offsets and connectivity (version 5).
    offsets: bool,
    /// The cells of an unstructured grid, until their types come.
    connectivity: Vec<i64>,
    ends: Vec<i64>,
    on: Option<On>,
}

impl Reader<'_> {
    fn keyword(&mut self, keyword: &[u8]) -> Result<(), FormatError> {
        match keyword {
            b"DATASET" => {
                let kind = self.input.need_word("the type of the data set")?;
                if !matches!(kind.to_ascii_uppercase().as_slice(), b"UNSTRUCTURED_GRID" | b"POLYDATA") {
                    let what = format!("a data set of type {}", String::from_utf8_lossy(kind));
                    return Err(FormatError::new(self.input.place(), Reason::Unsupported(what)));
                }
            }
            b"POINTS" => self.points()?,
            b"CELLS" => (self.ends, self.connectivity) = self.cells()?,
            b"CELL_TYPES" => {
                let count = self.input.text_integer("a number of cells")?;
                let place = self.input.place();
                let types = self.integers("int", count, 1)?;
                let (ends, connectivity) = (std::mem::take(&mut self.ends), std::mem::take(&mut self.connectivity));
                self.set.add_cells(&types, &ends, &connectivity, place)?;
            }
            b"VERTICES" => self.list(cell::POLY_VERTEX)?,
            b"LINES" => self.list(cell::POLY_LINE)?,
            b"POLYGONS" => self.list(cell::POLYGON)?,
            b"TRIANGLE_STRIPS" => self.list(cell::STRIP)?,
            b"POINT_DATA" => self.on = Some(On::Points(self.count("a number of points")?)),
            b"CELL_DATA" => self.on = Some(On::Cells(self.count("a number of cells")?)),
            b"FIELD" => self.field()?,
            b"METADATA" => self.metadata(),
            b"LOOKUP_TABLE" => {
                self.input.need_word("a name")?;
                let count = self.input.text_integer("a number of colours")?;
                self.numbers(if self.input.order.is_some() { "unsigned_char" } else { "float" }, count, 4)?;
            }
            _ => self.attribute(keyword)?,
        }
        Ok(())
    }

    fn count(&mut self, what: &'static str) -> Result<usize, FormatError> {
        let count = self.input.text_integer(what)?;
        usize::try_from(count)
            .map_err(|_| FormatError::unexpected(self.input.place(), what, count.to_string().as_bytes()))
    }

    fn points(&mut self) -> Result<(), FormatError> {
        let count = self.input.text_integer("a number of points")?;
        let kind = self.kind()?;
        let place = self.input.place();
        let values = self.numbers(&kind, count, 3)?.into_floats();
        for &value in &values {
            finite(value, "a coordinate", place)?;
        }
        if values.len() / 3 >= u32::MAX as usize {
            return Err(FormatError::new(place, Reason::TooMany { what: "points", limit: u64::from(u32::MAX) - 1 }));
        }
        self.set.points = values.chunks_exact(3).map(DVec3::from_slice).collect();
        Ok(())
    }

    /// The ends of cells and their points.
    fn cells(&mut self) -> Result<(Vec<i64>, Vec<i64>), FormatError> {
        let count = self.input.text_integer("a number of cells")?;
        let size = self.input.text_integer("a size of cells")?;
        let place = self.input.place();
        if self.offsets {
            let mut ends = self.part(b"OFFSETS", count)?;
            let connectivity = self.part(b"CONNECTIVITY", size)?;
            if !ends.is_empty() && ends.remove(0) != 0 {
                return Err(FormatError::unexpected(place, "offsets that begin with 0", b"another number"));
            }
            return Ok((ends, connectivity));
        }
        let all = self.integers("int", size, 1)?;
        let (mut ends, mut connectivity) = (Vec::new(), Vec::with_capacity(all.len()));
        let mut at = 0;
        while at < all.len() {
            let end = usize::try_from(all[at]).ok().and_then(|n| (at + 1).checked_add(n)).filter(|&e| e <= all.len());
            let Some(end) = end else {
                return Err(FormatError::new(place, Reason::Truncated { within: "a cell" }));
            };
            connectivity.extend_from_slice(&all[at + 1..end]);
            ends.push(connectivity.len() as i64);
            at = end;
        }
        if ends.len() as i64 != count {
            let reason = Reason::Untrue { what: "cells", count: count.unsigned_abs(), room: ends.len() as u64 };
            return Err(FormatError::new(place, reason));
        }
        Ok((ends, connectivity))
    }

    fn part(&mut self, name: &'static [u8], count: i64) -> Result<Vec<i64>, FormatError> {
        let word = self.input.need_word("cells")?;
        if word.to_ascii_uppercase() != name {
            return Err(FormatError::unexpected(self.input.place(), "OFFSETS or CONNECTIVITY", word));
        }
        let kind = self.kind()?;
        self.integers(&kind, count, 1)
    }

    fn list(&mut self, kind: u8) -> Result<(), FormatError> {
        let place = self.input.place();
        let (ends, connectivity) = self.cells()?;
        self.set.add_cells(&vec![i64::from(kind); ends.len()], &ends, &connectivity, place)
    }

    fn attribute(&mut self, keyword: &[u8]) -> Result<(), FormatError> {
        let place = self.input.place();
        let known: [&[u8]; 9] = [
            b"SCALARS",
            b"COLOR_SCALARS",
            b"VECTORS",
            b"NORMALS",
            b"TENSORS",
            b"TENSORS6",
            b"TEXTURE_COORDINATES",
            b"GLOBAL_IDS",
            b"PEDIGREE_IDS",
        ];
        let Some(on) = self.on.filter(|_| known.contains(&keyword)) else {
            return Err(FormatError::unexpected(place, "a keyword of legacy VTK", keyword));
        };
        let name = decoded(self.input.need_word("a name")?);
        let mut components = match keyword {
            b"VECTORS" | b"NORMALS" => 3,
            b"TENSORS" => 9,
            b"TENSORS6" => 6,
            b"COLOR_SCALARS" | b"TEXTURE_COORDINATES" => self.count("a number of components")?,
            _ => 1,
        };
        let kind = match (keyword, self.input.order) {
            (b"COLOR_SCALARS", None) => "float".to_owned(),
            (b"COLOR_SCALARS", Some(_)) => "unsigned_char".to_owned(),
            _ => self.kind()?,
        };
        if keyword == b"SCALARS" {
            let number = std::str::from_utf8(self.input.rest_of_line()).ok().and_then(|t| t.parse().ok());
            components = number.unwrap_or(1);
            let mut ahead = self.input.clone();
            if ahead.word().is_some_and(|w| w.eq_ignore_ascii_case(b"LOOKUP_TABLE")) {
                ahead.need_word("a name")?;
                self.input = ahead;
            }
        }
        let rows = match on {
            On::Points(rows) | On::Cells(rows) => rows,
        };
        self.array(on, name, &kind, rows, components)
    }

    fn array(&mut self, on: On, name: String, kind: &str, rows: usize, components: usize) -> Result<(), FormatError> {
        let values = self.numbers(kind, rows as i64, components)?;
        let array = Array { name, components: components.max(1), values };
        match on {
            On::Points(_) => self.set.point_arrays.push(array),
            On::Cells(_) => self.set.cell_arrays.push(array),
        }
        Ok(())
    }

    fn field(&mut self) -> Result<(), FormatError> {
        self.input.need_word("a name")?;
        let mut left = self.count("a number of arrays")?;
        while left > 0 {
            let word = self.input.need_word("a field")?;
            if word == b"METADATA" {
                self.metadata();
                continue;
            }
            left -= 1;
            let name = decoded(word);
            let components = self.count("a number of components")?;
            let rows = self.count("a number of rows")?;
            let kind = self.kind()?;
            if kind == "string" || kind == "variant" {
                return Err(FormatError::new(
                    self.input.place(),
                    Reason::Unsupported(format!("an array of type {kind}")),
                ));
            }
            if let Some(on) = self.on {
                self.array(on, name, &kind, rows, components)?;
            } else {
                let values = self.numbers(&kind, rows as i64, components)?;
                self.set.field_arrays.push(Array { name, components: components.max(1), values });
            }
        }
        Ok(())
    }

    /// Metadata ends with an empty line.
    fn metadata(&mut self) {
        self.input.end_line();
        while !self.input.rest_of_line().is_empty() {
            self.input.end_line();
        }
    }

    fn kind(&mut self) -> Result<String, FormatError> {
        Ok(String::from_utf8_lossy(self.input.need_word("a type of numbers")?).to_ascii_lowercase())
    }

    fn integers(&mut self, kind: &str, rows: i64, components: usize) -> Result<Vec<i64>, FormatError> {
        let place = self.input.place();
        let integers = self.numbers(kind, rows, components)?.into_integers();
        integers.ok_or_else(|| FormatError::unexpected(place, "integers", kind.as_bytes()))
    }

    fn numbers(&mut self, kind: &str, rows: i64, components: usize) -> Result<Values, FormatError> {
        let place = self.input.place();
        let width = match kind {
            "char" | "unsigned_char" | "signed_char" | "vtktypeint8" | "vtktypeuint8" => 1,
            "short" | "unsigned_short" | "vtktypeint16" | "vtktypeuint16" => 2,
            "int" | "unsigned_int" | "vtkidtype" | "float" | "vtktypeint32" | "vtktypeuint32" => 4,
            "long" | "unsigned_long" | "long_long" | "unsigned_long_long" | "double" | "vtktypeint64"
            | "vtktypeuint64" => 8,
            other => return Err(FormatError::new(place, Reason::Unsupported(format!("numbers of type {other}")))),
        };
        let count = rows.saturating_mul(components.min(1 << 31) as i64);
        let is_float = matches!(kind, "float" | "double");
        if self.input.order.is_none() {
            let count = self.input.claim(count, 2, width, "numbers")?;
            return self.text_numbers(is_float, count);
        }
        self.input.end_line();
        let count = self.input.claim(count, 2, width, "numbers")?.min(usize::MAX / 8);
        let bytes = self.input.take(count * width, "numbers")?;
        binary_numbers(kind, width, bytes, place)
    }

    fn text_numbers(&mut self, is_float: bool, count: usize) -> Result<Values, FormatError> {
        if !is_float {
            let integers: Result<Vec<i64>, _> = (0..count).map(|_| self.input.text_integer("an integer")).collect();
            return Ok(Values::Int(integers?));
        }
        let mut floats = Vec::with_capacity(count);
        for _ in 0..count {
            let word = self.input.need_word("numbers")?;
            // Fields may hold NaN; coordinates are checked by their own.
            let value = std::str::from_utf8(word).ok().and_then(|w| w.parse().ok());
            floats.push(value.ok_or_else(|| FormatError::unexpected(self.input.place(), "a number", word))?);
        }
        Ok(Values::Float(floats))
    }
}

fn binary_numbers(kind: &str, width: usize, bytes: &[u8], place: Place) -> Result<Values, FormatError> {
    let raw = bytes.chunks_exact(width).map(|c| c.iter().fold(0_u64, |all, &b| all << 8 | u64::from(b)));
    Ok(match kind {
        "unsigned_char" | "vtktypeuint8" => Values::Bytes(bytes.to_vec()),
        "float" => Values::Float(raw.map(|r| f64::from(f32::from_bits(r as u32))).collect()),
        "double" => Values::Float(raw.map(f64::from_bits).collect()),
        unsigned if unsigned.contains("unsigned") || unsigned.contains("uint") => {
            let fit: Result<Vec<i64>, _> = raw.map(i64::try_from).collect();
            Values::Int(fit.map_err(|_| FormatError::unexpected(place, "an integer below 2^63", b"a larger one"))?)
        }
        _ => {
            let unused = 64 - 8 * width as u32;
            Values::Int(raw.map(|r| ((r << unused) as i64) >> unused).collect())
        }
    })
}
