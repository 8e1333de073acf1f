//! Groups as comment lines, for a text format that has none of its own.
//!
//! One line a group: `#group faces 0-17,20 NAME`, `#group edges 3-7,7-9 NAME` (an edge is its two vertices),
//! `#group vertices 4,8-11 NAME`; numbers count from 0 in the order of the file. The name is the rest of the line.

use std::ops::Range;

use super::builder::{Builder, MOST_GROUPS};
use super::error::{FormatError, Place, Reason};
use super::sets::face_sets;
use super::text::{Scanner, parse_integer, push_integer, push_name};
use crate::mesh::{Soup, VertexId};

const MARK: &[u8] = b"#group";

/// Appends all groups; regions become groups.
pub(super) fn push_groups(out: &mut Vec<u8>, soup: &Soup) {
    for (name, faces) in face_sets(soup) {
        push_group(out, "faces", &name, |out| push_ranges(out, faces.iter().map(|f| f.raw())));
    }
    for (name, edges) in &soup.carried.groups.edges {
        push_group(out, "edges", name, |out| {
            for (position, [a, b]) in edges.iter().enumerate() {
                push_range(out, position, a.raw(), b.raw());
            }
        });
    }
    for (name, vertices) in &soup.carried.groups.vertices {
        push_group(out, "vertices", name, |out| push_ranges(out, vertices.iter().map(|v| v.raw())));
    }
}

fn push_group(out: &mut Vec<u8>, kind: &str, name: &str, members: impl FnOnce(&mut Vec<u8>)) {
    out.extend_from_slice(MARK);
    out.push(b' ');
    out.extend_from_slice(kind.as_bytes());
    out.push(b' ');
    members(out);
    out.push(b' ');
    push_name(out, name, false);
    out.push(b'\n');
}

fn push_ranges(out: &mut Vec<u8>, numbers: impl Iterator<Item = u32>) {
    let mut numbers = numbers.peekable();
    let mut position = 0;
    while let Some(first) = numbers.next() {
        let mut last = first;
        while let Some(next) = numbers.next_if(|&n| Some(n) == last.checked_add(1)) {
            last = next;
        }
        push_range(out, position, first, last);
        position += 1;
    }
}

fn push_range(out: &mut Vec<u8>, position: usize, first: u32, last: u32) {
    if position > 0 {
        out.push(b',');
    }
    push_integer(out, u64::from(first));
    if last != first {
        out.push(b'-');
        push_integer(out, u64::from(last));
    }
}

/// Reads the group lines from here to the end and skips other comments. Face `i` of the file is faces
/// `first_of[i]..first_of[i + 1]` of the soup.
pub(super) fn read_groups(
    builder: &mut Builder,
    mut scanner: Scanner<'_>,
    first_of: &[usize],
) -> Result<(), FormatError> {
    let room = MOST_GROUPS * (builder.points() + builder.faces());
    let mut reader = GroupReader { builder, first_of, room };
    while let Some(word) = scanner.word() {
        if word == MARK {
            reader.read(&mut scanner)?;
        } else if !word.starts_with(b"#") {
            return Err(FormatError::unexpected(scanner.place(), "the end of the file", word)
                .with_remedy("the file has more lines than the head announces: export it again"));
        }
        scanner.next_line();
    }
    Ok(())
}

struct GroupReader<'a> {
    builder: &'a mut Builder,
    first_of: &'a [usize],
    /// How many more memberships are taken.
    room: usize,
}

impl GroupReader<'_> {
    fn read(&mut self, scanner: &mut Scanner<'_>) -> Result<(), FormatError> {
        let place = scanner.place();
        let (Some(kind), Some(members)) = (scanner.word_on_line(), scanner.word_on_line()) else {
            return Err(FormatError::new(place, Reason::Truncated { within: "a group" }));
        };
        let name = String::from_utf8_lossy(scanner.rest_of_line()).into_owned();
        for range in members.split(|&b| b == b',') {
            self.add_range(kind, &name, parse_range(range, place)?, place)?;
        }
        Ok(())
    }

    fn add_range(&mut self, kind: &[u8], name: &str, range: [i64; 2], place: Place) -> Result<(), FormatError> {
        match kind {
            b"faces" => {
                let faces = self.faces(range, place)?;
                self.spend(faces.len(), place)?;
                self.builder.group_faces(name, faces);
            }
            b"edges" => {
                let [a, b] = [self.builder.vertex(range[0], 0, place)?, self.builder.vertex(range[1], 0, place)?];
                self.builder.group_edge(name, a, b);
            }
            b"vertices" => {
                let [a, b] = [self.builder.vertex(range[0], 0, place)?, self.builder.vertex(range[1], 0, place)?];
                let vertices = a.raw()..=b.raw();
                self.spend(vertices.clone().count(), place)?;
                for vertex in vertices {
                    self.builder.group_vertex(name, VertexId::from_raw(vertex));
                }
            }
            other => return Err(FormatError::unexpected(place, "`faces`, `edges` or `vertices`", other)),
        }
        Ok(())
    }

    /// The soup's faces of a range of the file's.
    fn faces(&self, range: [i64; 2], place: Place) -> Result<Range<usize>, FormatError> {
        let count = self.first_of.len().saturating_sub(1);
        let bound = |index: i64| {
            let known = usize::try_from(index).ok().filter(|&i| i < count);
            let reason = Reason::OutOfRange { what: "face", index, count: count as u64 };
            known.ok_or_else(|| FormatError::new(place, reason))
        };
        Ok(self.first_of[bound(range[0])?]..self.first_of[bound(range[1])? + 1])
    }

    fn spend(&mut self, members: usize, place: Place) -> Result<(), FormatError> {
        let reason = Reason::TooMany { what: "group members an element", limit: MOST_GROUPS as u64 };
        self.room = self.room.checked_sub(members).ok_or_else(|| FormatError::new(place, reason))?;
        Ok(())
    }
}

fn parse_range(text: &[u8], place: Place) -> Result<[i64; 2], FormatError> {
    const WHAT: &str = "a range of elements";
    let middle = text.iter().position(|&b| b == b'-').unwrap_or(text.len());
    let first = parse_integer(&text[..middle], WHAT, place)?;
    let last = if middle == text.len() { first } else { parse_integer(&text[middle + 1..], WHAT, place)? };
    if first < 0 || last < 0 {
        return Err(FormatError::unexpected(place, WHAT, text));
    }
    Ok([first, last])
}
