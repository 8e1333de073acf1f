//! Writes a PLY file.

use std::collections::BTreeMap;
use std::io::Write;

use super::super::WriteOptions;
use super::super::text::{push_integer, push_name, push_number};
use super::{EDGE_GROUP, FACE_GROUP, REGION, VERTEX_GROUP};
use crate::mesh::{Field, Soup, Support, id::Id};

pub(super) fn write(soup: &Soup, options: &WriteOptions<'_>) -> Vec<u8> {
    let bytes = 64 * soup.points.len() + 32 * soup.faces.len() + 1024;
    let mut writer = Writer { out: Vec::with_capacity(bytes), options };
    let groups = &soup.carried.groups;
    writer.head(soup);
    let of_vertex = memberships(&groups.vertices, soup.points.len());
    for (vertex, point) in soup.points.iter().enumerate() {
        for number in point.to_array() {
            writer.double(number);
        }
        writer.values(soup, Support::Vertex, vertex);
        writer.groups(of_vertex.get(vertex));
        writer.end_item();
    }
    let of_face = memberships(&groups.faces, soup.faces.len());
    for (face, facet) in soup.faces.enumerate() {
        writer.byte(facet.corners().len() as u8);
        for corner in facet.corners() {
            writer.index(corner.raw());
        }
        if let Some(regions) = &soup.carried.regions {
            writer.index(regions.labels.get(face).copied().unwrap_or(0));
        }
        writer.values(soup, Support::Face, face.index());
        writer.groups(of_face.get(face.index()));
        writer.end_item();
    }
    for (group, edges) in groups.edges.values().enumerate() {
        for [a, b] in edges {
            writer.index(a.raw());
            writer.index(b.raw());
            writer.index(group as u32);
            writer.end_item();
        }
    }
    writer.out
}

/// The group numbers of each element; empty when there are no groups.
fn memberships<K>(groups: &BTreeMap<String, Vec<Id<K>>>, count: usize) -> Vec<Vec<u32>> {
    let mut of_element = vec![Vec::new(); if groups.is_empty() { 0 } else { count }];
    for (group, members) in groups.values().enumerate() {
        for member in members {
            if let Some(numbers) = of_element.get_mut(member.index()) {
                numbers.push(group as u32);
            }
        }
    }
    of_element
}

struct Writer<'a> {
    out: Vec<u8>,
    options: &'a WriteOptions<'a>,
}

impl Writer<'_> {
    fn head(&mut self, soup: &Soup) {
        let groups = &soup.carried.groups;
        let encoding = if self.options.binary { "binary_little_endian" } else { "ascii" };
        self.line(&format!("ply\nformat {encoding} 1.0"));
        if !self.options.header.is_empty() {
            self.named("comment", &self.options.header);
        }
        self.names(VERTEX_GROUP, groups.vertices.keys());
        self.names(FACE_GROUP, groups.faces.keys());
        self.names(EDGE_GROUP, groups.edges.keys());
        self.names(REGION, soup.carried.regions.iter().flat_map(|r| &r.names));
        self.line(&format!("element vertex {}", soup.points.len()));
        self.line("property double x\nproperty double y\nproperty double z");
        self.field_names(soup, Support::Vertex);
        if !groups.vertices.is_empty() {
            self.line("property list ushort uint groups");
        }
        self.line(&format!("element face {}", soup.faces.len()));
        self.line("property list uchar uint vertex_indices");
        if soup.carried.regions.is_some() {
            self.line("property uint region");
        }
        self.field_names(soup, Support::Face);
        if !groups.faces.is_empty() {
            self.line("property list ushort uint groups");
        }
        if !groups.edges.is_empty() {
            let count: usize = groups.edges.values().map(Vec::len).sum();
            self.line(&format!("element edge {count}"));
            self.line("property uint vertex1\nproperty uint vertex2\nproperty uint group");
        }
        self.line("end_header");
    }

    fn line(&mut self, text: &str) {
        self.out.extend_from_slice(text.as_bytes());
        self.out.push(b'\n');
    }

    fn named(&mut self, keyword: &str, name: &str) {
        self.out.extend_from_slice(keyword.as_bytes());
        self.out.push(b' ');
        push_name(&mut self.out, name, false);
        self.out.push(b'\n');
    }

    fn names<'n>(&mut self, kind: &str, names: impl Iterator<Item = &'n String>) {
        for (number, name) in names.enumerate() {
            self.named(&format!("comment {kind} {number}"), name);
        }
    }

    fn field_names(&mut self, soup: &Soup, support: Support) {
        for field in fields(soup, support) {
            for component in 0..field.components {
                self.out.extend_from_slice(b"property double ");
                // A field must not pass for a coordinate or for group numbers.
                if ["x", "y", "z", "region", "groups"].contains(&field.name.as_str()) {
                    self.out.extend_from_slice(b"field_");
                }
                push_name(&mut self.out, &field.name, true);
                if field.components > 1 {
                    let written = write!(self.out, "_{component}");
                    debug_assert!(written.is_ok(), "writing to memory does not fail");
                }
                self.out.push(b'\n');
            }
        }
    }

    fn values(&mut self, soup: &Soup, support: Support, element: usize) {
        for field in fields(soup, support) {
            for &value in &field.values[field.components * element..field.components * (element + 1)] {
                self.double(value);
            }
        }
    }

    fn groups(&mut self, numbers: Option<&Vec<u32>>) {
        let Some(numbers) = numbers else { return };
        if self.options.binary {
            self.out.extend((numbers.len() as u16).to_le_bytes());
        } else {
            self.integer(numbers.len() as u64);
        }
        for &number in numbers {
            self.index(number);
        }
    }

    fn double(&mut self, value: f64) {
        if self.options.binary {
            self.out.extend(value.to_le_bytes());
        } else {
            push_number(&mut self.out, value, self.options.precision);
            self.out.push(b' ');
        }
    }

    fn index(&mut self, value: u32) {
        if self.options.binary {
            self.out.extend(value.to_le_bytes());
        } else {
            self.integer(u64::from(value));
        }
    }

    fn byte(&mut self, value: u8) {
        if self.options.binary {
            self.out.push(value);
        } else {
            self.integer(u64::from(value));
        }
    }

    fn integer(&mut self, value: u64) {
        push_integer(&mut self.out, value);
        self.out.push(b' ');
    }

    /// Ends a line of text.
    fn end_item(&mut self) {
        if !self.options.binary
            && let Some(blank) = self.out.last_mut()
        {
            *blank = b'\n';
        }
    }
}

/// The fields of this support that have a value for each element.
fn fields(soup: &Soup, support: Support) -> impl Iterator<Item = &Field> {
    let count = if support == Support::Vertex { soup.points.len() } else { soup.faces.len() };
    soup.carried.fields.iter().filter(move |f| f.support == support && f.values.len() == f.components * count)
}
