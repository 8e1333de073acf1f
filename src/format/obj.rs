//! Wavefront OBJ: text with numbered vertices, named groups, objects and materials.
//!
//! Layout after Wavefront Technologies, "Advanced Visualizer Manual", appendix B1, 1993. Read are `v` (weights and
//! colours after the coordinates are ignored), `f` (texture and normal numbers are ignored), `l`, `p`, `g`, `o` and
//! `usemtl`; textures, normals and the like are skipped, `call` is refused, since it takes data from elsewhere, and all
//! other statements, such as those of free-form surfaces, are skipped and named. The file is walked twice, first for
//! the vertices, so that faces may point at later vertices; relative numbers count back from the vertices above them.
//!
//! Each name of `g`, `o` and `usemtl` becomes a face group, lines an edge group and points a vertex group of the
//! current names, `lines` and `points` without one. Lost on writing: fields, regions as labels (they become groups),
//! blanks in group names (written as `_`), and the difference between groups, objects and materials. O(file) time.

use std::collections::{BTreeMap, BTreeSet};

use glam::DVec3;

use super::builder::{Builder, MOST_GROUPS};
use super::error::{FormatError, Place, Reason, excerpt};
use super::sets::face_sets;
use super::text::{Scanner, parse_integer, parse_number, push_integer, push_name, push_number};
use super::{FormatDef, ReadResult, WriteOptions};
use crate::mesh::{Soup, VertexId};
use crate::watch::Watch;

pub(super) const DEF: FormatDef = FormatDef {
    name: "obj",
    title: "OBJ",
    endings: &["obj"],
    sniff,
    read,
    write: |soup, options| Ok(write(soup, options)),
};

/// Lines between two looks at the watch.
const STRIDE: u64 = 1 << 16;

/// Statements about textures, normals, materials and how it is shown.
const HARMLESS: [&[u8]; 17] = [
    b"vt",
    b"vn",
    b"vp",
    b"s",
    b"mg",
    b"mtllib",
    b"maplib",
    b"usemap",
    b"bevel",
    b"c_interp",
    b"d_interp",
    b"lod",
    b"shadow_obj",
    b"trace_obj",
    b"ctech",
    b"stech",
    b"end",
];

/// Names of other statements that are kept.
const MOST_UNREAD: usize = 1000;

/// OBJ has no signature: the first statement must be one of the usual ones.
fn sniff(bytes: &[u8]) -> bool {
    let mut scanner = scanner(&bytes[..bytes.len().min(1 << 16)]);
    let Some(keyword) = scanner.word() else { return false };
    match keyword {
        b"mtllib" | b"usemtl" | b"o" | b"g" => scanner.word_on_line().is_some(),
        b"v" => (0..3).all(|_| {
            scanner.word_on_line().is_some_and(|word| parse_number(word, "a coordinate", Place::File).is_ok())
        }),
        _ => false,
    }
}

fn scanner(bytes: &[u8]) -> Scanner<'_> {
    Scanner::new(bytes).with_comments(b'#').with_continuation()
}

fn read(bytes: &[u8], watch: &Watch) -> ReadResult {
    let mut builder = Builder::new(bytes.len() / 60, bytes.len() / 40);
    read_vertices(bytes, &mut builder, watch)?;
    let mut statements =
        Statements { builder, above: 0, names: Names::default(), corners: Vec::new(), unread: BTreeMap::new() };
    statements.read(scanner(bytes), watch, bytes.len())?;
    statements.builder.finish()
}

fn read_vertices(bytes: &[u8], builder: &mut Builder, watch: &Watch) -> Result<(), FormatError> {
    let mut scanner = scanner(bytes);
    watch.phase("reading vertices", Some(bytes.len() as u64));
    while let Some(keyword) = scanner.word() {
        if keyword == b"v" {
            let place = scanner.place();
            let mut position = [0.0; 3];
            for number in &mut position {
                *number = coordinate(&mut scanner, place)?;
            }
            builder.point(DVec3::from_array(position), place)?;
            // A weight, a colour, or both may follow.
            let more = std::iter::from_fn(|| scanner.word_on_line()).count();
            if !matches!(more, 0 | 1 | 3 | 4 | 5) {
                let found = format!("{} values", more + 3);
                return Err(FormatError::unexpected(place, "a vertex of 3, 4, 6, 7 or 8 values", found.as_bytes())
                    .with_remedy("the line has too many or too few values: export the file again"));
            }
            if (builder.points() as u64).is_multiple_of(STRIDE) {
                watch.check()?;
                watch.advance(scanner.offset() as u64, || format!("{} vertices", builder.points()));
            }
        }
        scanner.next_line();
    }
    Ok(())
}

fn coordinate(scanner: &mut Scanner<'_>, place: Place) -> Result<f64, FormatError> {
    match scanner.word_on_line() {
        Some(word) => parse_number(word, "a coordinate", scanner.place()),
        None => Err(FormatError::new(place, Reason::Truncated { within: "a vertex" })),
    }
}

/// The names in force, each with the first face since it came into force.
#[derive(Debug, Default)]
struct Names {
    groups: Vec<String>,
    object: Option<String>,
    material: Option<String>,
    since: usize,
}

impl Names {
    /// Face groups: all names, each once.
    fn of_faces(&self) -> Vec<&str> {
        let mut names: Vec<&str> = self.of_curves();
        names.extend(self.material.as_deref());
        names.sort_unstable();
        names.dedup();
        names
    }

    /// Lines and points have no material.
    fn of_curves(&self) -> Vec<&str> {
        self.groups.iter().chain(&self.object).map(String::as_str).collect()
    }
}

/// The second walk: faces, curves, points and names.
struct Statements {
    builder: Builder,
    /// Vertices above the current line.
    above: usize,
    names: Names,
    corners: Vec<VertexId>,
    /// Statements that are neither read nor harmless, and how many of each.
    unread: BTreeMap<Vec<u8>, usize>,
}

impl Statements {
    fn read(&mut self, mut scanner: Scanner<'_>, watch: &Watch, size: usize) -> Result<(), FormatError> {
        watch.phase("reading faces", Some(size as u64));
        let mut lines = 0;
        while let Some(keyword) = scanner.word() {
            self.statement(keyword, &mut scanner)?;
            scanner.next_line();
            lines += 1;
            if u64::is_multiple_of(lines, STRIDE) {
                watch.check()?;
                watch.advance(scanner.offset() as u64, || format!("{} faces", self.builder.faces()));
            }
        }
        self.close_names();
        for (keyword, count) in &self.unread {
            let keyword = excerpt(keyword);
            self.builder.counts.note_with(|| format!("{count} statements `{keyword}`"));
        }
        Ok(())
    }

    fn statement(&mut self, keyword: &[u8], scanner: &mut Scanner<'_>) -> Result<(), FormatError> {
        match keyword {
            b"v" => self.above += 1,
            b"f" | b"fo" => {
                let place = scanner.place();
                self.corners(scanner)?;
                self.builder.face(&self.corners, place)?;
            }
            b"l" => {
                self.corners(scanner)?;
                self.curve();
            }
            b"p" => {
                self.corners(scanner)?;
                self.lone_points();
            }
            b"g" => {
                self.close_names();
                self.names.groups = group_names(scanner)?;
            }
            b"o" => {
                self.close_names();
                self.names.object = rest_name(scanner);
            }
            b"usemtl" => {
                self.close_names();
                self.names.material = rest_name(scanner);
            }
            b"call" | b"csh" => {
                let what = format!("`{}`, which takes data from elsewhere,", String::from_utf8_lossy(keyword));
                return Err(FormatError::new(scanner.place(), Reason::Unsupported(what))
                    .with_remedy("put the lines of that file in its place"));
            }
            _ => self.left_out(keyword),
        }
        Ok(())
    }

    /// Counts a statement that is not read, unless it says nothing about the mesh.
    fn left_out(&mut self, keyword: &[u8]) {
        if HARMLESS.contains(&keyword) {
            return;
        }
        if let Some(count) = self.unread.get_mut(keyword) {
            *count += 1;
        } else if self.unread.len() < MOST_UNREAD {
            self.unread.insert(keyword.to_vec(), 1);
        }
    }

    /// Reads the vertex numbers up to the end of the line.
    fn corners(&mut self, scanner: &mut Scanner<'_>) -> Result<(), FormatError> {
        self.corners.clear();
        while let Some(word) = scanner.word_on_line() {
            let place = scanner.place();
            let end = word.iter().position(|&b| b == b'/').unwrap_or(word.len());
            let number = parse_integer(&word[..end], "a vertex number", place)?;
            // Relative numbers are made absolute; zero and numbers before the first vertex stay out of range.
            let absolute = if number < 0 { self.above as i64 + 1 + number } else { number };
            if absolute < 1 {
                return Err(super::builder::out_of_range(number, self.builder.points(), place));
            }
            self.corners.push(self.builder.vertex(absolute, 1, place)?);
        }
        Ok(())
    }

    fn curve(&mut self) {
        let names = self.names.of_curves();
        let names = if names.is_empty() { vec!["lines"] } else { names };
        for pair in self.corners.windows(2) {
            for name in &names {
                self.builder.group_edge(name, pair[0], pair[1]);
            }
        }
    }

    fn lone_points(&mut self) {
        let names = self.names.of_curves();
        let names = if names.is_empty() { vec!["points"] } else { names };
        for &vertex in &self.corners {
            for name in &names {
                self.builder.group_vertex(name, vertex);
            }
        }
    }

    /// Gives the faces read since the last change of names their groups.
    fn close_names(&mut self) {
        let faces = self.names.since..self.builder.faces();
        if !faces.is_empty() {
            for name in self.names.of_faces() {
                self.builder.group_faces(name, faces.clone());
            }
        }
        self.names.since = faces.end;
    }
}

fn group_names(scanner: &mut Scanner<'_>) -> Result<Vec<String>, FormatError> {
    let mut names = Vec::new();
    while let Some(word) = scanner.word_on_line() {
        if names.len() == MOST_GROUPS {
            let reason = Reason::TooMany { what: "group names in one statement", limit: MOST_GROUPS as u64 };
            return Err(FormatError::new(scanner.place(), reason));
        }
        names.push(String::from_utf8_lossy(word).into_owned());
    }
    names.sort_unstable();
    names.dedup();
    Ok(names)
}

fn rest_name(scanner: &mut Scanner<'_>) -> Option<String> {
    let name = String::from_utf8_lossy(scanner.rest_of_line()).into_owned();
    (!name.is_empty()).then_some(name)
}

fn write(soup: &Soup, options: &WriteOptions<'_>) -> Vec<u8> {
    let mut out = Vec::with_capacity(60 * soup.points.len() + 24 * soup.faces.len() + 256);
    if !options.header.is_empty() {
        push_name_line(&mut out, "#", &[&options.header]);
    }
    for point in &soup.points {
        out.push(b'v');
        for number in point.to_array() {
            out.push(b' ');
            push_number(&mut out, number, options.precision);
        }
        out.push(b'\n');
    }
    push_faces(&mut out, soup);
    for (name, edges) in &soup.carried.groups.edges {
        push_group_line(&mut out, &[name]);
        for edge in edges {
            push_statement(&mut out, b'l', edge);
        }
    }
    for (name, vertices) in &soup.carried.groups.vertices {
        push_group_line(&mut out, &[name]);
        push_statement(&mut out, b'p', vertices);
    }
    out
}

/// Faces in order, with a `g` line wherever the set of groups changes.
fn push_faces(out: &mut Vec<u8>, soup: &Soup) {
    let sets = face_sets(soup);
    let mut of_face: Vec<Vec<&str>> = vec![Vec::new(); if sets.is_empty() { 0 } else { soup.faces.len() }];
    for (name, members) in &sets {
        for face in members {
            if let Some(names) = of_face.get_mut(face.index()) {
                names.push(name);
            }
        }
    }
    let mut current: &[&str] = &[];
    for (face, facet) in soup.faces.enumerate() {
        let names = of_face.get(face.index()).map_or(&[][..], Vec::as_slice);
        if names != current {
            push_group_line(out, names);
            current = names;
        }
        push_statement(out, b'f', facet.corners());
    }
}

fn push_group_line(out: &mut Vec<u8>, names: &[&str]) {
    out.push(b'g');
    let mut known = BTreeSet::new();
    for name in names {
        let start = out.len() + 1;
        out.push(b' ');
        push_name(out, name, true);
        // Two names that differ only in their blanks are one on paper.
        if !known.insert(out[start..].to_vec()) {
            out.truncate(start - 1);
        }
    }
    out.push(b'\n');
}

fn push_name_line(out: &mut Vec<u8>, keyword: &str, names: &[&str]) {
    out.extend_from_slice(keyword.as_bytes());
    for name in names {
        out.push(b' ');
        push_name(out, name, false);
    }
    out.push(b'\n');
}

fn push_statement(out: &mut Vec<u8>, keyword: u8, vertices: &[VertexId]) {
    out.push(keyword);
    for vertex in vertices {
        out.push(b' ');
        push_integer(out, u64::from(vertex.raw()) + 1);
    }
    out.push(b'\n');
}
