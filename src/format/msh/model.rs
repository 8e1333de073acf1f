//! What the sections of a Gmsh file say, and the mesh that is made of it.

use std::collections::BTreeMap;

use glam::DVec3;
use rustc_hash::FxHashMap;

use super::super::ReadCounts;
use super::super::element::{Elements, Placed, Shape};
use super::super::error::{FormatError, Place, Reason};
use super::super::mixed::Input;
use super::{NO_GROUP, element_type, is_quad, volume_corners};
use crate::mesh::{EdgeKey, FaceId, Field, Soup, Support, VertexId};
use crate::watch::Watch;

/// Elements between two looks at the watch.
const STRIDE: usize = 1 << 16;

/// Groups of an element on average; a hostile file could put every element in many.
const MOST_GROUPS: usize = 64;

/// The members of a physical group or an entity.
#[derive(Debug, Default)]
struct Members {
    faces: Vec<FaceId>,
    edges: Vec<EdgeKey>,
    vertices: Vec<VertexId>,
    volumes: Vec<u32>,
}

impl Members {
    fn add(&mut self, placed: &Placed) {
        match placed {
            Placed::Faces(range) | Placed::Skin(range, _) => self.faces.extend(range.clone().map(FaceId::new)),
            Placed::Edge(edge) => self.edges.push(*edge),
            Placed::Vertex(vertex) => self.vertices.push(*vertex),
            Placed::Volume(volume) => self.volumes.push(*volume),
            Placed::Nothing => {}
        }
    }
}

/// A data section.
#[derive(Debug)]
struct Data {
    name: String,
    support: Support,
    components: usize,
    rows: Vec<(i64, Vec<f64>)>,
}

/// The entity that an entity is a piece of, itself where it is whole and none where it lies between pieces, and its
/// physical groups.
type Entity = (Option<i64>, Vec<i64>);

/// What the sections say.
#[derive(Debug, Default)]
pub(super) struct Model<'w> {
    names: BTreeMap<(i64, i64), String>,
    /// The entities by dimension and tag (version 4).
    known: BTreeMap<(i64, i64), Entity>,
    points: Vec<DVec3>,
    nodes: FxHashMap<i64, u32>,
    pub(super) elements: Elements,
    groups: BTreeMap<(i64, i64), Members>,
    entities: BTreeMap<(i64, i64), Members>,
    /// Faces with their element numbers.
    face_tags: Vec<(i64, u32)>,
    /// The numbers of volumes.
    volume_tags: Vec<i64>,
    data: Vec<Data>,
    count: usize,
    memberships: usize,
    watch: Option<&'w Watch>,
    /// Version 4.0.
    pub(super) old: bool,
}

impl<'w> Model<'w> {
    pub(super) fn new(watch: &'w Watch) -> Self {
        Self { watch: Some(watch), ..Self::default() }
    }
}

impl Model<'_> {
    pub(super) fn physical_names(&mut self, input: &mut Input<'_>) -> Result<(), FormatError> {
        for _ in 0..input.text_integer("a number of names")? {
            let dimension = input.text_integer("a dimension")?;
            let tag = input.text_integer("a physical tag")?;
            let name = input.quoted();
            self.names.insert((dimension, tag), name);
        }
        Ok(())
    }

    /// Makes room for the elements' nodes; nodes come before elements.
    pub(super) fn end_of_nodes(&mut self) {
        self.elements.make_room(self.points.len());
    }

    /// Adds a node.
    pub(super) fn node(&mut self, tag: i64, point: DVec3, place: Place) -> Result<(), FormatError> {
        let next = self.points.len();
        if next >= u32::MAX as usize {
            return Err(FormatError::new(place, Reason::TooMany { what: "nodes", limit: u64::from(u32::MAX) - 1 }));
        }
        if self.nodes.insert(tag, next as u32).is_some() {
            return Err(FormatError::new(place, Reason::Duplicate { what: "node", id: tag }));
        }
        self.points.push(point);
        Ok(())
    }

    /// The position of a node.
    pub(super) fn position(&self, tag: i64, place: Place) -> Result<u32, FormatError> {
        let missing =
            || FormatError::new(place, Reason::OutOfRange { what: "node", index: tag, count: self.nodes.len() as u64 });
        self.nodes.get(&tag).copied().ok_or_else(missing)
    }

    /// Adds a whole entity with its physical groups.
    pub(super) fn entity(&mut self, (dimension, tag): (i64, i64), groups: Vec<i64>) {
        self.known.insert((dimension, tag), (Some(tag), groups));
    }

    /// Adds a piece of `parent`, or what lies between pieces where that has another dimension.
    pub(super) fn piece(&mut self, piece: (i64, i64), parent: (i64, i64), mut groups: Vec<i64>) {
        let whole = self.known.get(&parent).filter(|_| parent.0 == piece.0);
        if let Some((_, inherited)) = whole.filter(|_| groups.is_empty()) {
            groups.clone_from(inherited);
        }
        self.known.insert(piece, (whole.map(|_| parent.1), groups));
    }

    /// What is known of the entity of some elements. Files without entities at all have no groups.
    pub(super) fn groups_of(&self, entity: (i64, i64), place: Place) -> Result<Entity, FormatError> {
        if self.known.is_empty() {
            return Ok((Some(entity.1), Vec::new()));
        }
        let (dimension, index) = entity;
        let what = ["point", "curve", "surface", "volume"].get(dimension.unsigned_abs() as usize).unwrap_or(&"entity");
        let count = self.known.keys().filter(|(d, _)| *d == dimension).count() as u64;
        let missing = || FormatError::new(place, Reason::OutOfRange { what, index, count });
        self.known.get(&entity).cloned().ok_or_else(missing)
    }

    /// Adds an element of the entity with this tag; `nodes` are positions, as many as the type has.
    pub(super) fn element(
        &mut self,
        tag: i64,
        kind: i64,
        entity: Option<i64>,
        nodes: &[u32],
    ) -> Result<Placed, FormatError> {
        self.count += 1;
        if self.count.is_multiple_of(STRIDE) {
            self.watch.map_or(Ok(()), Watch::check)?;
        }
        let dimension = element_type(kind).map_or(3, |(d, _)| d);
        let shape = match dimension {
            0 => Shape::Point,
            1 => Shape::Line,
            2 if is_quad(kind) => Shape::Quad,
            2 => Shape::Triangle,
            _ => Shape::Volume,
        };
        let placed = match shape {
            Shape::Volume => self.elements.volume(nodes, volume_corners(kind)),
            _ => self.elements.add(shape, nodes, &self.points),
        };
        match &placed {
            Placed::Faces(range) => self.face_tags.push((tag, range.start as u32)),
            Placed::Volume(_) => self.volume_tags.push(tag),
            Placed::Edge(_) | Placed::Vertex(_) | Placed::Skin(..) | Placed::Nothing => {}
        }
        if let Some(entity) = entity {
            self.entities.entry((i64::from(dimension), entity)).or_default().add(&placed);
        }
        Ok(placed)
    }

    /// Puts an element into a physical group; the tag's sign tells an orientation, which groups do not have.
    pub(super) fn group(&mut self, kind: i64, tag: i64, placed: &Placed) -> Result<(), FormatError> {
        self.memberships += 1;
        let limit = MOST_GROUPS * (self.count + 1024);
        if self.memberships > limit {
            return Err(FormatError::new(
                Place::File,
                Reason::TooMany { what: "members of groups", limit: limit as u64 },
            ));
        }
        let dimension = element_type(kind).map_or(3, |(d, _)| d);
        self.groups.entry((i64::from(dimension), tag.abs())).or_default().add(placed);
        Ok(())
    }

    pub(super) fn data(&mut self, input: &mut Input<'_>, support: Support) -> Result<(), FormatError> {
        let mut name = String::new();
        let strings = input.text_integer("a number of strings")?;
        for i in 0..input.claim(strings, 1, 1, "strings")? {
            input.end_line();
            let text = input.quoted();
            if i == 0 {
                name = text;
            }
        }
        for _ in 0..input.text_integer("a number of reals")? {
            input.text_number("a real tag")?;
        }
        let count = input.text_integer("a number of integers")?;
        let (mut components, mut rows) = (1, 0);
        for i in 0..count {
            let value = input.text_integer("an integer tag")?;
            match i {
                1 => components = value,
                2 => rows = value,
                _ => {}
            }
        }
        input.end_line();
        if !(1..=9).contains(&components) {
            return Err(FormatError::unexpected(input.place(), "1 to 9 components", components.to_string().as_bytes()));
        }
        let components = components as usize;
        let count = input.claim(rows, 2 + 2 * components, 4 + 8 * components, "rows of data")?;
        let mut data = Data { name, support, components, rows: Vec::with_capacity(count) };
        for _ in 0..count {
            let tag = input.int("a node or element number")?;
            let row: Result<Vec<f64>, _> = (0..components).map(|_| input.float("a value")).collect();
            data.rows.push((tag, row?));
        }
        self.data.push(data);
        Ok(())
    }

    pub(super) fn finish(mut self) -> Result<(Soup, ReadCounts), FormatError> {
        if let Some(ranges) = self.elements.skin(&self.points) {
            for (tag, (range, _)) in self.volume_tags.iter().zip(&ranges) {
                self.face_tags.extend(range.clone().map(|face| (*tag, face as u32)));
            }
            for members in self.groups.values_mut().chain(self.entities.values_mut()) {
                let faces = members.volumes.iter().filter_map(|&volume| ranges.get(volume as usize));
                members.faces.extend(faces.flat_map(|(range, _)| range.clone().map(FaceId::new)));
            }
        }
        let mut soup = Soup { points: std::mem::take(&mut self.points).into(), ..Soup::default() };
        let faces = self.elements.faces.len();
        for data in std::mem::take(&mut self.data) {
            let field = self.field(data, soup.points.len(), faces);
            soup.carried.set_field(field);
        }
        self.name_groups(&mut soup);
        let counts = self.elements.finish(&mut soup)?;
        Ok((soup, counts))
    }

    /// Elements without a row have NaN, which no file can hold: the value is not known.
    fn field(&self, data: Data, points: usize, faces: usize) -> Field {
        let Data { name, support, components, rows } = data;
        let len = if support == Support::Vertex { points } else { faces };
        let mut values = vec![f64::NAN; len * components];
        let mut put = |at: u32, row: &[f64]| values[at as usize * components..][..components].copy_from_slice(row);
        match support {
            Support::Vertex => {
                for (tag, row) in &rows {
                    if let Some(&at) = self.nodes.get(tag) {
                        put(at, row);
                    }
                }
            }
            // A volume may have several faces.
            Support::Face => {
                let rows: FxHashMap<i64, &[f64]> = rows.iter().map(|(tag, row)| (*tag, row.as_slice())).collect();
                for (tag, at) in &self.face_tags {
                    if let Some(row) = rows.get(tag) {
                        put(*at, row);
                    }
                }
            }
        }
        Field { name, support, components, values }
    }

    fn name_groups(&mut self, soup: &mut Soup) {
        let names = std::mem::take(&mut self.names);
        let mut named = Vec::new();
        if self.groups.is_empty() {
            let with_faces = self.entities.values().filter(|m| !m.faces.is_empty()).count();
            for ((dimension, tag), members) in std::mem::take(&mut self.entities) {
                match dimension {
                    1 => named.push((format!("curve_{tag}"), members)),
                    2 if with_faces > 1 => named.push((format!("surface_{tag}"), members)),
                    3 if with_faces > 1 => named.push((format!("volume_{tag}"), members)),
                    _ => {}
                }
            }
        }
        for (key, members) in std::mem::take(&mut self.groups) {
            let name = names.get(&key).cloned().unwrap_or_else(|| format!("physical_{}", key.1));
            if name != NO_GROUP {
                named.push((name, members));
            }
        }
        let groups = &mut soup.carried.groups;
        for (name, members) in named {
            extend(&mut groups.faces, &name, members.faces);
            extend(&mut groups.edges, &name, members.edges);
            extend(&mut groups.vertices, &name, members.vertices);
        }
    }
}

fn extend<T: Ord>(groups: &mut BTreeMap<String, Vec<T>>, name: &str, members: Vec<T>) {
    if members.is_empty() {
        return;
    }
    let all = groups.entry(name.to_owned()).or_default();
    all.extend(members);
    all.sort_unstable();
    all.dedup();
}
