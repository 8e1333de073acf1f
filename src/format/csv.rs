//! Comma-separated values: points with values, such as the results of an analysis by node or by element centre.
//!
//! Layout after RFC 4180; the first line names the columns. Three columns are called `x`, `y` and `z`, in any case and
//! with a unit in brackets or parentheses allowed (`X [mm]`, `z (m)`); every other column that holds nothing but
//! numbers becomes a vertex field of that name, an empty cell of it is NaN; columns with text are left out and counted.
//! Fields may be separated by commas, semicolons or tabs. Reading gives points without faces. Writing gives the points
//! and the vertex fields, numbered columns (`flow.0`, `flow.1`) for those with several numbers. Lost on writing: faces,
//! groups, regions and face fields. O(file) time.

use csv::{ByteRecord, ReaderBuilder, WriterBuilder};
use glam::DVec3;

use super::error::{FormatError, Place, Reason};
use super::text::{parse_number, push_number};
use super::{FormatDef, ReadCounts, ReadResult, WriteOptions};
use crate::mesh::{Carried, Field, IdVec, Soup, Support};
use crate::watch::Watch;

pub(super) const DEF: FormatDef =
    FormatDef { name: "csv", title: "CSV", endings: &["csv"], sniff: |_| false, read, write };

/// Records between two looks at the watch.
const STRIDE: usize = 1 << 16;

/// More columns than any export has.
const MOST_COLUMNS: usize = 4096;

fn read(bytes: &[u8], watch: &Watch) -> ReadResult {
    let mut reader = ReaderBuilder::new().delimiter(delimiter(bytes)).from_reader(bytes);
    let names: Vec<String> = reader
        .byte_headers()
        .map_err(|e| fault(&e))?
        .iter()
        .map(|n| String::from_utf8_lossy(n).trim().to_owned())
        .collect();
    if names.len() > MOST_COLUMNS {
        let reason = Reason::TooMany { what: "columns", limit: MOST_COLUMNS as u64 };
        return Err(FormatError::new(Place::Line(1), reason));
    }
    let axes = axes(&names)?;
    let mut points: Vec<DVec3> = Vec::new();
    // `None` once a cell of the column is no number.
    let mut columns: Vec<Option<Vec<f64>>> = vec![Some(Vec::new()); names.len()];
    let mut record = ByteRecord::new();
    while reader.read_byte_record(&mut record).map_err(|e| fault(&e))? {
        if points.len().is_multiple_of(STRIDE) {
            watch.check().map_err(|_| FormatError::new(Place::File, Reason::Cancelled))?;
        }
        let place = Place::Line(record.position().map_or(1, csv::Position::line));
        let coordinate = |axis: usize| finite(record.get(axes[axis]).unwrap_or_default().trim_ascii(), place);
        points.push(DVec3::new(coordinate(0)?, coordinate(1)?, coordinate(2)?));
        for (k, column) in columns.iter_mut().enumerate().filter(|(k, _)| !axes.contains(k)) {
            let value = number(record.get(k).unwrap_or_default().trim_ascii());
            match (column.as_mut(), value) {
                (Some(values), Some(value)) => values.push(value),
                _ => *column = None,
            }
        }
    }
    if points.is_empty() {
        return Err(FormatError::new(Place::File, Reason::Nothing("points")));
    }
    let mut counts = ReadCounts::default();
    let mut carried = Carried::default();
    for (k, (name, column)) in names.into_iter().zip(columns).enumerate().filter(|(k, _)| !axes.contains(k)) {
        let is_empty = column.as_ref().is_none_or(|values| values.iter().all(|v| v.is_nan()));
        match column {
            Some(values) if !is_empty && carried.field(Support::Vertex, &name).is_none() => {
                let name = if name.is_empty() { format!("column {}", k + 1) } else { name };
                carried.set_field(Field { name, support: Support::Vertex, components: 1, values });
            }
            _ => counts.fields_dropped += 1,
        }
    }
    Ok((Soup { points: points.into(), faces: IdVec::default(), carried }, counts))
}

/// The most frequent of the usual separators on the first line.
fn delimiter(bytes: &[u8]) -> u8 {
    let line = bytes.split(|&b| b == b'\n').next().unwrap_or_default();
    let count = |mark: u8| line.split(|&b| b == mark).count();
    [b',', b';', b'\t'].into_iter().rev().max_by_key(|&mark| count(mark)).unwrap_or(b',')
}

/// The columns of the coordinates.
fn axes(names: &[String]) -> Result<[usize; 3], FormatError> {
    let plain = |name: &str| name.split(['[', '(']).next().unwrap_or_default().trim().to_ascii_lowercase();
    let find = |axis: &str| names.iter().position(|name| plain(name) == axis);
    match (find("x"), find("y"), find("z")) {
        (Some(x), Some(y), Some(z)) => Ok([x, y, z]),
        _ => Err(FormatError::unexpected(Place::Line(1), "columns named x, y and z", names.join(",").as_bytes())
            .with_remedy("the first line names the columns; coordinates tell where each value belongs")),
    }
}

fn finite(cell: &[u8], place: Place) -> Result<f64, FormatError> {
    parse_number(cell, "coordinate", place)
}

/// A value; NaN for an empty cell or a word for it, `None` for other text.
fn number(cell: &[u8]) -> Option<f64> {
    if cell.is_empty() || [&b"nan"[..], b"na", b"null"].iter().any(|word| cell.eq_ignore_ascii_case(word)) {
        return Some(f64::NAN);
    }
    parse_number(cell, "value", Place::File).ok()
}

fn fault(error: &csv::Error) -> FormatError {
    let place = error.position().map_or(Place::File, |p| Place::Line(p.line()));
    match error.kind() {
        csv::ErrorKind::UnequalLengths { expected_len, len, .. } => {
            let found = format!("{len} cells where line 1 has {expected_len}");
            FormatError::unexpected(place, "as many cells as columns", found.as_bytes())
        }
        _ => FormatError::unexpected(place, "comma-separated values", error.to_string().as_bytes()),
    }
}

fn write(soup: &Soup, options: &WriteOptions<'_>) -> Result<Vec<u8>, FormatError> {
    let fields: Vec<&Field> = soup.carried.fields.iter().filter(|f| f.support == Support::Vertex).collect();
    let mut writer = WriterBuilder::new().from_writer(Vec::new());
    let mut row: Vec<Vec<u8>> = ["x", "y", "z"].map(|axis| axis.as_bytes().to_vec()).to_vec();
    for field in &fields {
        match field.components {
            1 => row.push(field.name.as_bytes().to_vec()),
            n => row.extend((0..n).map(|k| format!("{}.{k}", field.name).into_bytes())),
        }
    }
    writer.write_record(&row).map_err(|e| fault(&e))?;
    for (v, point) in soup.points.enumerate() {
        let values = fields.iter().flat_map(|f| (0..f.components).map(|k| f.values[f.components * v.index() + k]));
        row.clear();
        row.extend(point.to_array().into_iter().chain(values).map(|value| {
            let mut cell = Vec::new();
            if value.is_finite() {
                push_number(&mut cell, value, options.precision);
            }
            cell.trim_ascii().to_vec()
        }));
        writer.write_record(&row).map_err(|e| fault(&e))?;
    }
    writer.into_inner().map_err(|_| FormatError::new(Place::File, Reason::Unsupported("this mesh".into())))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::format::{Format, read, write};

    fn parse(text: &str) -> ReadResult {
        read(Format::Csv, text.as_bytes(), &Watch::silent())
    }

    #[test]
    fn columns_become_points_and_fields() {
        let (soup, counts) = parse("node;X [mm];y;Z (m);stress;part\n7;1;2;3;1e3;lid\n8;-1;0.5;0;;lid\n").unwrap();
        assert_eq!(soup.points.as_slice(), [DVec3::new(1.0, 2.0, 3.0), DVec3::new(-1.0, 0.5, 0.0)]);
        let stress = &soup.carried.field(Support::Vertex, "stress").expect("a field").values;
        assert!(stress[0] == 1000.0 && stress[1].is_nan());
        assert_eq!(soup.carried.field(Support::Vertex, "node").expect("a field").values, [7.0, 8.0]);
        assert_eq!((soup.carried.fields.len(), counts.fields_dropped), (2, 1), "a column with text is no field");
    }

    #[test]
    fn what_is_written_reads_back() {
        let (soup, _) = parse("x,y,z,a,\"b, c\"\n0.1,2,3,4,5\n-0,1e-300,7,8,9\n").unwrap();
        let text = write(Format::Csv, &soup, &WriteOptions::default()).unwrap();
        assert_eq!(read(Format::Csv, &text, &Watch::silent()).unwrap().0, soup);
    }

    #[test]
    fn faults_have_a_place() {
        let place = |text: &str| parse(text).map(|_| ()).unwrap_err().place;
        assert_eq!(place("a,b,c\n1,2,3\n"), Place::Line(1));
        assert_eq!(place("x,y,z\n1,2,3\n1,2\n"), Place::Line(3));
        assert_eq!(place("x,y,z\n1,2,three\n"), Place::Line(2));
        assert_eq!(place("x,y,z\n1,2,inf\n"), Place::Line(2));
        assert_eq!(place("x,y,z\n"), Place::File);
        assert_eq!(place(""), Place::Line(1));
    }
}
