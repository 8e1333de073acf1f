//! The data of a PLY file.

use std::collections::BTreeMap;

use glam::DVec3;

use super::super::ReadResult;
use super::super::binary::{ByteReader, Scalar, finite};
use super::super::builder::{Builder, MOST_GROUPS};
use super::super::error::{FormatError, Place, Reason};
use super::super::text::{Scanner, claim, parse_number};
use super::head::{Element, Encoding, Head, Names, Property, read_head};
use crate::mesh::{Field, Regions, Support, VertexId};
use crate::watch::Watch;

/// Items between two looks at the watch.
const STRIDE: u64 = 1 << 16;

/// Elements that are read, and those that say nothing about the mesh.
const READ: [&str; 5] = ["vertex", "face", "tristrips", "edge", "material"];

pub(super) fn read(bytes: &[u8], watch: &Watch) -> ReadResult {
    let mut scanner = Scanner::new(bytes);
    let head = read_head(&mut scanner)?;
    let source = match head.encoding {
        Encoding::Text => Source::Text(scanner),
        Encoding::Binary(order) => Source::Binary(ByteReader::new(bytes, scanner.offset(), order)),
    };
    check_positions(&head)?;
    let mut body = Body::new(source);
    for element in &head.elements {
        body.read_element(element, &head, watch)?;
    }
    body.source.end()?;
    body.finish(&head)
}

fn check_positions(head: &Head) -> Result<(), FormatError> {
    let Some(vertex) = head.elements.iter().find(|e| e.name == "vertex") else {
        return Err(FormatError::new(Place::File, Reason::Nothing("element `vertex`")));
    };
    let has = |axis: &&str| vertex.properties.iter().any(|p| p.list.is_none() && p.name == *axis);
    match ["x", "y", "z"].iter().find(|axis| !has(axis)) {
        Some(axis) => Err(FormatError::unexpected(vertex.place, "the properties x, y and z", axis.as_bytes())),
        None => Ok(()),
    }
}

/// Numbers from text or bytes.
enum Source<'a> {
    Text(Scanner<'a>),
    Binary(ByteReader<'a>),
}

impl Source<'_> {
    fn place(&self) -> Place {
        match self {
            Self::Text(scanner) => scanner.place(),
            Self::Binary(reader) => reader.place(),
        }
    }

    fn left(&self) -> usize {
        match self {
            Self::Text(scanner) => scanner.left() + 1,
            Self::Binary(reader) => reader.left(),
        }
    }

    /// The next number, perhaps NaN or infinite. All but 64-bit integers are exact.
    #[inline]
    fn number(&mut self, scalar: Scalar) -> Result<f64, FormatError> {
        const WITHIN: &str = "an element";
        let reader = match self {
            Self::Text(scanner) => {
                let word = scanner.word_on_line();
                let place = scanner.place();
                let short = || {
                    FormatError::new(place, Reason::TooFew { within: WITHIN })
                        .with_remedy("the line has fewer values than the head announces: export it again")
                };
                let word = word.ok_or_else(short)?;
                return match parse_number(word, "a number", place) {
                    Err(FormatError { reason: Reason::NotFinite { .. }, .. }) => Ok(f64::NAN),
                    other => other,
                };
            }
            Self::Binary(reader) => reader,
        };
        Ok(match scalar {
            Scalar::I8 => f64::from(reader.i8(WITHIN)?),
            Scalar::U8 => f64::from(reader.u8(WITHIN)?),
            Scalar::I16 => f64::from(reader.i16(WITHIN)?),
            Scalar::U16 => f64::from(reader.u16(WITHIN)?),
            Scalar::I32 => f64::from(reader.i32(WITHIN)?),
            Scalar::U32 => f64::from(reader.u32(WITHIN)?),
            Scalar::I64 => reader.i64(WITHIN)? as f64,
            Scalar::U64 => reader.u64(WITHIN)? as f64,
            Scalar::F32 => f64::from(reader.f32(WITHIN)?),
            Scalar::F64 => reader.f64(WITHIN)?,
        })
    }

    /// Goes to the line of the next item of a table; blank lines are none.
    fn begin_item(&mut self, table: &'static str) -> Result<(), FormatError> {
        let Self::Text(scanner) = self else { return Ok(()) };
        if scanner.go_to_word() {
            Ok(())
        } else {
            Err(FormatError::new(scanner.place(), Reason::Truncated { within: table }))
        }
    }

    /// An item of a text table ends with its line: a value too many must not become part of the next item.
    fn end_item(&mut self) -> Result<(), FormatError> {
        let Self::Text(scanner) = self else { return Ok(()) };
        match scanner.word_on_line() {
            None => Ok(()),
            Some(word) => Err(FormatError::unexpected(scanner.place(), "the end of the line", word).with_remedy(
                "the line has more values than the head announces: add them as properties, or export it again",
            )),
        }
    }

    /// After all tables a text file is at its end.
    fn end(&mut self) -> Result<(), FormatError> {
        let Self::Text(scanner) = self else { return Ok(()) };
        match scanner.word() {
            None => Ok(()),
            Some(word) => Err(FormatError::unexpected(scanner.place(), "the end of the file", word)
                .with_remedy("the file has more lines than the head announces: export it again")),
        }
    }

    fn integer(&mut self, scalar: Scalar) -> Result<i64, FormatError> {
        let value = self.number(scalar)?;
        if value.fract() == 0.0 && value.abs() < 9e15 {
            return Ok(value as i64);
        }
        Err(FormatError::unexpected(self.place(), "an integer", value.to_string().as_bytes()))
    }

    fn list_length(&mut self, count: Scalar, scalar: Scalar) -> Result<usize, FormatError> {
        let length = self.integer(count)?;
        let each = if matches!(self, Self::Text(_)) { 2 } else { scalar.size() };
        claim(length, self.left() / each, "list items", self.place())
    }

    fn skip(&mut self, property: &Property) -> Result<(), FormatError> {
        let length = match property.list {
            Some(count) => self.list_length(count, property.scalar)?,
            None => 1,
        };
        for _ in 0..length {
            self.number(property.scalar)?;
        }
        Ok(())
    }
}

/// What a property means.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Role {
    /// A coordinate.
    Axis(usize),
    /// Corners of a face.
    Corners,
    /// Numbers of named groups.
    Groups,
    /// The first or second end of an edge.
    End(usize),
    /// The number of an edge's group.
    EdgeGroup,
    /// A field, by its column.
    Column(usize),
    Skipped,
}

/// A property that becomes a field.
struct Column {
    support: Support,
    name: String,
    values: Vec<f64>,
}

/// The data as it comes. Faces wait until all vertices are known, because elements stand in any order.
struct Body<'a> {
    source: Source<'a>,
    builder: Builder,
    columns: Vec<Column>,
    /// Corners of all faces, one after another.
    corners: Vec<i64>,
    /// The end in `corners` and the place of each face.
    faces: Vec<(usize, Place)>,
    face_groups: BTreeMap<i64, Vec<usize>>,
    vertex_groups: BTreeMap<i64, Vec<usize>>,
    edges: Vec<([i64; 2], i64, Place)>,
    /// A list in the making.
    items: Vec<i64>,
}

impl<'a> Body<'a> {
    fn new(source: Source<'a>) -> Self {
        Self {
            source,
            builder: Builder::default(),
            columns: Vec::new(),
            corners: Vec::new(),
            faces: Vec::new(),
            face_groups: BTreeMap::new(),
            vertex_groups: BTreeMap::new(),
            edges: Vec::new(),
            items: Vec::new(),
        }
    }

    fn read_element(&mut self, element: &Element, head: &Head, watch: &Watch) -> Result<(), FormatError> {
        if element.properties.is_empty() {
            return Ok(());
        }
        let room = (self.source.left() / element.least_bytes(head.encoding)) as u64;
        if element.count > room {
            let reason = Reason::Untrue { what: "elements", count: element.count, room };
            return Err(
                FormatError::new(element.place, reason).with_remedy("the file is cut off or damaged: export it again")
            );
        }
        if !READ.contains(&element.name.as_str()) && element.count > 0 {
            self.builder.counts.note(&format!("{} items of element `{}`", element.count, element.name));
        }
        let roles = self.roles(element, head);
        watch.phase(&format!("reading element {}", element.name), Some(element.count));
        for item in 0..element.count {
            if item.is_multiple_of(STRIDE) {
                watch.check()?;
                watch.advance(item, || format!("{item} {}", element.name));
            }
            self.read_item(element, &roles)?;
        }
        Ok(())
    }

    /// What each property means; makes the columns of those that become fields.
    fn roles(&mut self, element: &Element, head: &Head) -> Vec<Role> {
        let mut role = |property: &Property| match (element.name.as_str(), property.name.as_str(), property.list) {
            ("vertex", "x", None) => Role::Axis(0),
            ("vertex", "y", None) => Role::Axis(1),
            ("vertex", "z", None) => Role::Axis(2),
            ("vertex", "groups", Some(_)) if !head.vertex_groups.is_empty() => Role::Groups,
            ("face", "groups", Some(_)) if !head.face_groups.is_empty() => Role::Groups,
            ("face" | "tristrips", "vertex_indices" | "vertex_index", Some(_)) => Role::Corners,
            ("edge", "vertex1", None) => Role::End(0),
            ("edge", "vertex2", None) => Role::End(1),
            ("edge", "group", None) => Role::EdgeGroup,
            ("vertex" | "face", name, None) => {
                let support = if element.name == "vertex" { Support::Vertex } else { Support::Face };
                self.columns.push(Column { support, name: name.to_owned(), values: Vec::new() });
                Role::Column(self.columns.len() - 1)
            }
            _ => Role::Skipped,
        };
        element.properties.iter().map(&mut role).collect()
    }

    fn read_item(&mut self, element: &Element, roles: &[Role]) -> Result<(), FormatError> {
        self.source.begin_item("a table")?;
        let place = self.source.place();
        let mut position = None;
        let mut ends = ([None; 2], -1);
        let mut face = None;
        for (property, &role) in element.properties.iter().zip(roles) {
            match role {
                Role::Axis(axis) => {
                    let at = self.source.place();
                    position.get_or_insert(DVec3::ZERO)[axis] =
                        finite(self.source.number(property.scalar)?, "a coordinate", at)?;
                }
                Role::Corners => {
                    self.read_list(property)?;
                    let start = self.corners.len();
                    self.corners.append(&mut self.items);
                    face = Some(start);
                }
                Role::Groups => self.read_groups(property, element.name == "vertex")?,
                Role::End(end) => ends.0[end] = Some(self.source.integer(property.scalar)?),
                Role::EdgeGroup => ends.1 = self.source.integer(property.scalar)?,
                Role::Column(column) => {
                    let value = self.source.number(property.scalar)?;
                    self.columns[column].values.push(value);
                }
                Role::Skipped => self.source.skip(property)?,
            }
        }
        self.source.end_item()?;
        if let Some(position) = position {
            self.builder.point(position, place)?;
        }
        if let ([Some(a), Some(b)], group) = ends {
            self.edges.push(([a, b], group, place));
        }
        match face {
            Some(start) if element.name == "tristrips" => self.cut_strip(start, place),
            Some(_) => self.faces.push((self.corners.len(), place)),
            None if element.name == "face" => self.faces.push((self.corners.len(), place)),
            None => {}
        }
        Ok(())
    }

    /// Reads a list into `items`.
    fn read_list(&mut self, property: &Property) -> Result<(), FormatError> {
        self.items.clear();
        let count = property.list.unwrap_or(property.scalar);
        for _ in 0..self.source.list_length(count, property.scalar)? {
            let item = self.source.integer(property.scalar)?;
            self.items.push(item);
        }
        Ok(())
    }

    /// Notes the groups of the item being read, which is the next vertex or face.
    fn read_groups(&mut self, property: &Property, of_vertex: bool) -> Result<(), FormatError> {
        self.read_list(property)?;
        if self.items.len() > MOST_GROUPS {
            let reason = Reason::TooMany { what: "groups of one element", limit: MOST_GROUPS as u64 };
            return Err(FormatError::new(self.source.place(), reason));
        }
        let (groups, item) = if of_vertex {
            (&mut self.vertex_groups, self.builder.points())
        } else {
            (&mut self.face_groups, self.faces.len())
        };
        for &group in &self.items {
            groups.entry(group).or_default().push(item);
        }
        Ok(())
    }

    /// Replaces the strip that begins at `start` by its triangles; a negative number begins a new strip.
    fn cut_strip(&mut self, start: usize, place: Place) {
        let strip = self.corners.split_off(start);
        for run in strip.split(|&corner| corner < 0) {
            for (position, window) in run.windows(3).enumerate() {
                let (a, b) = if position % 2 == 0 { (window[0], window[1]) } else { (window[1], window[0]) };
                // A repeated corner only turns the strip.
                if a != b && b != window[2] && a != window[2] {
                    self.corners.extend([a, b, window[2]]);
                    self.faces.push((self.corners.len(), place));
                }
            }
        }
    }

    fn finish(mut self, head: &Head) -> ReadResult {
        let first_of = self.build_faces()?;
        for (ends, group, place) in &self.edges {
            let a = self.builder.vertex(ends[0], 0, *place)?;
            let b = self.builder.vertex(ends[1], 0, *place)?;
            let name = if *group < 0 { "edges".to_owned() } else { group_name(&head.edge_groups, *group) };
            self.builder.group_edge(&name, a, b);
        }
        for (&group, faces) in &self.face_groups {
            let name = group_name(&head.face_groups, group);
            // Face groups are only noted while a face is read, so that each has a place in `first_of`.
            for &face in faces {
                self.builder.group_faces(&name, first_of[face]..first_of[face + 1]);
            }
        }
        for (&group, vertices) in &self.vertex_groups {
            let name = group_name(&head.vertex_groups, group);
            for &vertex in vertices {
                let vertex = self.builder.vertex(vertex as i64, 0, Place::File)?;
                self.builder.group_vertex(&name, vertex);
            }
        }
        let columns = std::mem::take(&mut self.columns);
        attach_columns(&mut self.builder, columns, &first_of, &head.regions);
        self.builder.finish()
    }

    /// Builds all faces; says where each begins in the soup, and where the last one ends.
    fn build_faces(&mut self) -> Result<Vec<usize>, FormatError> {
        let mut first_of = Vec::with_capacity(self.faces.len() + 1);
        let mut ids: Vec<VertexId> = Vec::new();
        let mut start = 0;
        for &(end, place) in &self.faces {
            ids.clear();
            for &corner in &self.corners[start..end] {
                ids.push(self.builder.vertex(corner, 0, place)?);
            }
            start = end;
            first_of.push(self.builder.face(&ids, place)?.start);
        }
        first_of.push(self.builder.faces());
        Ok(first_of)
    }
}

fn group_name(names: &Names, number: i64) -> String {
    names.get(&number).cloned().unwrap_or_else(|| format!("group_{number}"))
}

/// Makes fields, and regions where the head names their labels, of the columns. A column with a number that is not
/// finite, or with too few or too many numbers, is counted and left out.
fn attach_columns(builder: &mut Builder, columns: Vec<Column>, first_of: &[usize], regions: &Names) {
    let mut fields: Vec<Field> = Vec::new();
    for column in columns {
        let expected = if column.support == Support::Vertex { builder.points() } else { first_of.len() - 1 };
        if column.values.len() != expected || column.values.iter().any(|value| !value.is_finite()) {
            builder.counts.fields_dropped += 1;
            continue;
        }
        let values = match column.support {
            Support::Vertex => column.values,
            Support::Face => spread(&column.values, first_of),
        };
        let labels = match column.support {
            Support::Face if column.name == "region" => region_labels(&values, regions),
            Support::Face | Support::Vertex => None,
        };
        if let Some(labels) = labels {
            let names = regions.values().cloned().collect();
            builder.carried.regions = Some(Regions { labels: labels.into(), names });
            continue;
        }
        fields.push(Field { name: column.name, support: column.support, components: 1, values });
    }
    for field in join_components(fields) {
        builder.carried.set_field(field);
    }
}

/// Repeats each face's value for all triangles that came of it.
fn spread(values: &[f64], first_of: &[usize]) -> Vec<f64> {
    let runs = first_of.windows(2).map(|run| run[1] - run[0]);
    values.iter().zip(runs).flat_map(|(&value, run)| std::iter::repeat_n(value, run)).collect()
}

/// Positions among the named labels; `None` when a face has another label.
fn region_labels(values: &[f64], regions: &Names) -> Option<Vec<u32>> {
    let rank: BTreeMap<i64, u32> = regions.keys().zip(0..).map(|(&label, rank)| (label, rank)).collect();
    values.iter().map(|&value| rank.get(&(value as i64)).copied().filter(|_| value.fract() == 0.0)).collect()
}

/// Joins runs of fields `NAME_0`, `NAME_1`, … of the same support.
fn join_components(fields: Vec<Field>) -> Vec<Field> {
    let mut joined = Vec::new();
    let mut rest = fields.as_slice();
    while let Some(field) = rest.first() {
        let stem = field.name.strip_suffix("_0").filter(|stem| !stem.is_empty());
        let run = stem.map_or(1, |stem| {
            let belongs = |(i, f): &(usize, &Field)| f.support == field.support && f.name == format!("{stem}_{i}");
            rest.iter().enumerate().take_while(belongs).count()
        });
        let (parts, after) = rest.split_at(run);
        match stem {
            Some(stem) if run > 1 => {
                let values =
                    (0..field.values.len()).flat_map(|i| parts.iter().map(move |part| part.values[i])).collect();
                joined.push(Field { name: stem.to_owned(), support: field.support, components: run, values });
            }
            _ => joined.push(field.clone()),
        }
        rest = after;
    }
    joined
}
