//! Writes Gmsh files.

use std::borrow::Cow;
use std::collections::BTreeMap;

use glam::DVec3;

use super::super::WriteOptions;
use super::super::element::{Elevated, elevate_for};
use super::super::error::{FormatError, Place, Reason};
use super::super::sets::face_sets;
use super::super::text::{push_integer, push_number};
use super::NO_GROUP;
use crate::mesh::{Facet, Soup, Support, VertexId};

/// Writes version 4.1.
pub(super) fn write_v4(soup: &Soup, options: &WriteOptions<'_>) -> Result<Vec<u8>, FormatError> {
    let mut layout = Layout::of(soup, options);
    layout.name_the_rest();
    layout.write(soup, options, true)
}

/// Writes version 2.2.
pub(super) fn write_v2(soup: &Soup, options: &WriteOptions<'_>) -> Result<Vec<u8>, FormatError> {
    Layout::of(soup, options).write(soup, options, false)
}

/// Elements that are in the same physical groups.
#[derive(Debug)]
struct Entity {
    dimension: i32,
    tag: i32,
    physicals: Vec<i32>,
}

/// One element: its type, entity (index) and node positions.
#[derive(Debug)]
struct Cell {
    kind: i32,
    entity: usize,
    nodes: Vec<u32>,
}

/// The mesh as entities and elements.
#[derive(Debug, Default)]
struct Layout {
    names: Vec<(i32, i32, String)>,
    entities: Vec<Entity>,
    cells: Vec<Cell>,
    elevated: Option<Elevated>,
    /// How many entities of each dimension there are.
    tags: [i32; 3],
}

impl Layout {
    fn of(soup: &Soup, options: &WriteOptions<'_>) -> Self {
        let mut layout = Self { elevated: elevate_for(soup, options), ..Self::default() };
        let mut of_face: Vec<Vec<i32>> = vec![Vec::new(); soup.faces.len()];
        for ((name, members), tag) in face_sets(soup).into_iter().zip(1..) {
            for face in &members {
                of_face[face.index()].push(tag);
            }
            layout.names.push((2, tag, name));
        }
        let mut known = BTreeMap::new();
        for (i, (face, groups)) in soup.faces.iter().zip(of_face).enumerate() {
            let entity = layout.entity(&mut known, 2, groups);
            let midside = layout.elevated.as_ref().map_or(&[][..], |e| e.of(i, face.corners().len()));
            let kind = match (face, midside.is_empty()) {
                (Facet::Tri(_), true) => 2,
                (Facet::Tri(_), false) => 9,
                (Facet::Quad(_), true) => 3,
                (Facet::Quad(_), false) => 16,
            };
            let nodes = face.corners().iter().map(|v| v.raw()).chain(midside.iter().copied()).collect();
            layout.cells.push(Cell { kind, entity, nodes });
        }
        let groups = &soup.carried.groups;
        let edges = groups.edges.iter().map(|(n, m)| (n, m.iter().map(|e| e.map(VertexId::raw).to_vec()).collect()));
        layout.lower(1, 1, edges);
        let vertices = groups.vertices.iter().map(|(n, m)| (n, m.iter().map(|v| vec![v.raw()]).collect()));
        layout.lower(0, 15, vertices);
        layout
    }

    /// Gives the faces of no group one, where there are groups.
    fn name_the_rest(&mut self) {
        let tag = self.names.iter().filter(|(dimension, ..)| *dimension == 2).count() as i32 + 1;
        let rest = self.entities.iter_mut().find(|entity| entity.dimension == 2 && entity.physicals.is_empty());
        if let Some(rest) = rest.filter(|_| !self.names.is_empty()) {
            rest.physicals.push(tag);
            self.names.push((2, tag, NO_GROUP.to_owned()));
        }
    }

    /// The lines or points of groups, each once.
    fn lower<'a>(&mut self, dimension: i32, kind: i32, groups: impl Iterator<Item = (&'a String, Vec<Vec<u32>>)>) {
        let mut cells: BTreeMap<Vec<u32>, Vec<i32>> = BTreeMap::new();
        for ((name, members), tag) in groups.zip(1..) {
            self.names.push((dimension, tag, name.clone()));
            for nodes in members {
                cells.entry(nodes).or_default().push(tag);
            }
        }
        let mut known = BTreeMap::new();
        for (nodes, groups) in cells {
            let entity = self.entity(&mut known, dimension, groups);
            if dimension == 0 {
                // A point is an entity of its own.
                known.clear();
            }
            self.cells.push(Cell { kind, entity, nodes });
        }
    }

    fn entity(&mut self, known: &mut BTreeMap<Vec<i32>, usize>, dimension: i32, physicals: Vec<i32>) -> usize {
        if let Some(&entity) = known.get(&physicals) {
            return entity;
        }
        self.tags[dimension as usize] += 1;
        let tag = self.tags[dimension as usize];
        known.insert(physicals.clone(), self.entities.len());
        self.entities.push(Entity { dimension, tag, physicals });
        self.entities.len() - 1
    }

    fn write(&self, soup: &Soup, options: &WriteOptions<'_>, version_4: bool) -> Result<Vec<u8>, FormatError> {
        let mut out = Out { bytes: Vec::new(), binary: options.binary, precision: options.precision };
        out.head(version_4, &options.header);
        self.physical_names(&mut out);
        let midside = self.elevated.iter().flat_map(|e| &e.points);
        let points: Vec<DVec3> = soup.points.iter().chain(midside).copied().collect();
        let copies = |c: &Cell| self.entities[c.entity].physicals.len().max(1);
        let elements = self.cells.iter().map(copies).sum::<usize>();
        let limit = i32::MAX as u64;
        if points.len().max(elements) as u64 > limit {
            let reason = Reason::TooMany { what: "nodes or elements, which Gmsh numbers with 32 bits", limit };
            return Err(FormatError::new(Place::File, reason));
        }
        if version_4 {
            self.entities_v4(&mut out, &points);
            nodes_v4(&mut out, &points);
            self.elements_v4(&mut out);
        } else {
            nodes_v2(&mut out, &points);
            self.elements_v2(&mut out);
        }
        let mut numbers = Vec::with_capacity(soup.faces.len());
        let mut next = 1;
        for cell in &self.cells[..soup.faces.len()] {
            numbers.push(next);
            next += if version_4 { 1 } else { self.entities[cell.entity].physicals.len().max(1) as i32 };
        }
        fields(&mut out, soup, &numbers, self.elevated.as_ref());
        Ok(out.bytes)
    }

    fn physical_names(&self, out: &mut Out) {
        if self.names.is_empty() {
            return;
        }
        out.text(&format!("$PhysicalNames\n{}\n", self.names.len()));
        for (dimension, tag, name) in &self.names {
            // A name is in quotes and ends with its line.
            let name = name.replace('"', "'").replace(['\n', '\r'], " ");
            out.text(&format!("{dimension} {tag} \"{name}\"\n"));
        }
        out.text("$EndPhysicalNames\n");
    }

    fn entities_v4(&self, out: &mut Out, points: &[DVec3]) {
        let low = points.iter().copied().reduce(DVec3::min).unwrap_or_default();
        let high = points.iter().copied().reduce(DVec3::max).unwrap_or_default();
        let at: BTreeMap<usize, u32> =
            self.cells.iter().filter(|c| c.kind == 15).map(|c| (c.entity, c.nodes[0])).collect();
        out.text("$Entities\n");
        for dimension in 0..4 {
            out.size(self.entities.iter().filter(|e| e.dimension == dimension).count());
        }
        out.line();
        for dimension in 0..3 {
            for (i, entity) in self.entities.iter().enumerate().filter(|(_, e)| e.dimension == dimension) {
                out.int(entity.tag);
                if let Some(&node) = at.get(&i) {
                    out.point(points[node as usize]);
                } else {
                    out.point(low);
                    out.point(high);
                }
                out.size(entity.physicals.len());
                out.ints(&entity.physicals);
                if dimension > 0 {
                    out.size(0);
                }
                out.line();
            }
        }
        out.end("$EndEntities\n");
    }

    fn elements_v4(&self, out: &mut Out) {
        let same = |a: &Cell, b: &Cell| a.kind == b.kind && a.entity == b.entity;
        let blocks: Vec<&[Cell]> = self.cells.chunk_by(same).collect();
        out.text("$Elements\n");
        out.sizes(&[blocks.len(), self.cells.len(), 1, self.cells.len()]);
        out.line();
        let mut number = 1;
        for block in blocks {
            let entity = &self.entities[block[0].entity];
            out.ints(&[entity.dimension, entity.tag, block[0].kind]);
            out.size(block.len());
            out.line();
            for cell in block {
                out.size(number);
                cell.nodes.iter().for_each(|&n| out.size(n as usize + 1));
                out.line();
                number += 1;
            }
        }
        out.end("$EndElements\n");
    }

    /// An element of several groups is written once for each.
    fn elements_v2(&self, out: &mut Out) {
        let of = |cell: &Cell| &self.entities[cell.entity];
        let count: usize = self.cells.iter().map(|c| of(c).physicals.len().max(1)).sum();
        out.text(&format!("$Elements\n{count}\n"));
        let mut number = 1;
        for cell in &self.cells {
            let entity = of(cell);
            let none = [0];
            for &physical in if entity.physicals.is_empty() { &none[..] } else { &entity.physicals } {
                let head = if out.binary { [cell.kind, 1, 2, number] } else { [number, cell.kind, 2, physical] };
                out.ints(&head);
                if out.binary {
                    out.int(physical);
                }
                out.int(entity.tag);
                cell.nodes.iter().for_each(|&n| out.int(n as i32 + 1));
                out.line();
                number += 1;
            }
        }
        out.end("$EndElements\n");
    }
}

fn nodes_v4(out: &mut Out, points: &[DVec3]) {
    out.text("$Nodes\n");
    out.sizes(&[1, points.len(), 1, points.len()]);
    out.line();
    out.ints(&[2, 1, 0]);
    out.size(points.len());
    out.line();
    for number in 1..=points.len() {
        out.size(number);
        out.line();
    }
    for &point in points {
        out.point(point);
        out.line();
    }
    out.end("$EndNodes\n");
}

fn nodes_v2(out: &mut Out, points: &[DVec3]) {
    out.text(&format!("$Nodes\n{}\n", points.len()));
    for (&point, number) in points.iter().zip(1..) {
        out.int(number);
        out.point(point);
        out.line();
    }
    out.end("$EndNodes\n");
}

/// Fields with the widths that Gmsh knows; values that are not known (NaN) are left out, as it is meant.
/// A mid-side node has the mean of its ends: some readers want a value at each node or at none.
fn fields(out: &mut Out, soup: &Soup, faces: &[i32], elevated: Option<&Elevated>) {
    for field in soup.carried.fields.iter().filter(|f| f.components <= 9) {
        let section = if field.support == Support::Vertex { "NodeData" } else { "ElementData" };
        let width = [1, 3, 9].into_iter().find(|&w| w >= field.components).unwrap_or(9);
        let values = match elevated.filter(|_| field.support == Support::Vertex) {
            Some(elevated) => Cow::Owned([&field.values[..], &elevated.means(soup, field)].concat()),
            None => Cow::Borrowed(&field.values),
        };
        let rows = values.chunks_exact(field.components).enumerate();
        let rows: Vec<(usize, &[f64])> = rows.filter(|(_, row)| row.iter().all(|v| v.is_finite())).collect();
        let name = field.name.replace('"', "'").replace(['\n', '\r'], " ");
        out.text(&format!("${section}\n1\n\"{name}\"\n1\n0\n3\n0\n{width}\n{}\n", rows.len()));
        for (i, row) in rows {
            out.int(if field.support == Support::Vertex { i as i32 + 1 } else { faces[i] });
            (0..width).for_each(|k| out.float(row.get(k).copied().unwrap_or(0.0)));
            out.line();
        }
        out.end(&format!("$End{section}\n"));
    }
}

/// The file as far as it is written.
struct Out {
    bytes: Vec<u8>,
    binary: bool,
    precision: Option<usize>,
}

impl Out {
    fn head(&mut self, version_4: bool, header: &str) {
        let (version, kind) = (if version_4 { "4.1" } else { "2.2" }, i32::from(self.binary));
        self.text(&format!("$MeshFormat\n{version} {kind} 8\n"));
        if self.binary {
            self.int(1);
            self.text("\n");
        }
        self.text("$EndMeshFormat\n");
        if !header.is_empty() {
            self.text(&format!("$Comments\n{}\n$EndComments\n", header.replace('$', "_")));
        }
    }

    fn text(&mut self, text: &str) {
        self.bytes.extend_from_slice(text.as_bytes());
    }

    /// Ends a section, which in binary needs a line end first.
    fn end(&mut self, text: &str) {
        if self.binary {
            self.text("\n");
        }
        self.text(text);
    }

    fn int(&mut self, value: i32) {
        if self.binary {
            self.bytes.extend_from_slice(&value.to_le_bytes());
        } else {
            push_integer(&mut self.bytes, value as u64);
            self.bytes.push(b' ');
        }
    }

    fn size(&mut self, value: usize) {
        if self.binary {
            self.bytes.extend_from_slice(&(value as u64).to_le_bytes());
        } else {
            push_integer(&mut self.bytes, value as u64);
            self.bytes.push(b' ');
        }
    }

    fn ints(&mut self, values: &[i32]) {
        for &value in values {
            self.int(value);
        }
    }

    fn sizes(&mut self, values: &[usize]) {
        for &value in values {
            self.size(value);
        }
    }

    fn float(&mut self, value: f64) {
        if self.binary {
            self.bytes.extend_from_slice(&value.to_le_bytes());
        } else {
            push_number(&mut self.bytes, value, self.precision);
            self.bytes.push(b' ');
        }
    }

    fn point(&mut self, point: DVec3) {
        point.to_array().into_iter().for_each(|v| self.float(v));
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
}
