//! The data set that both VTK formats hold: points, cells of many types, named arrays; and what a mesh makes of it.
//!
//! # What an array means
//! | array | becomes |
//! |---|---|
//! | integer cell array `group:NAME` | the face group NAME: cells whose value is not 0 |
//! | integer cell array `edge-group:NAME` | the edge group NAME, from line cells |
//! | integer point array `group:NAME` | the vertex group NAME |
//! | integer cell array `region` with the field array `region:names` | the regions, with their names |
//! | any other integer cell array of few values | a group `ARRAY_VALUE` for each value, and a field |
//! | any other array of numbers | a field |
//!
//! Few values means at most 256 and no more than half of the cells have one of their own: numberings are no groups.
//! Writing uses the same table, so a mesh comes back as it was; what is not in the table (marks, pins) is not written.
//! Line cells carry 0 in group arrays and NaN in fields.

use std::collections::{BTreeMap, BTreeSet};

use glam::DVec3;

use super::super::ReadCounts;
use super::super::element::{Elements, Placed, Shape};
use super::super::error::{FormatError, Place, Reason};
use crate::mesh::{EdgeKey, FaceId, Field, Regions, Soup, Support, VertexId};

/// The numbers of an array.
#[derive(Clone, Debug, PartialEq)]
pub(in super::super) enum Values {
    /// Integers of any width.
    Int(Vec<i64>),
    /// Floats of any width.
    Float(Vec<f64>),
    /// Bytes; kept apart because there are as many as cells.
    Bytes(Vec<u8>),
}

impl Values {
    /// How many numbers there are.
    pub(in super::super) fn len(&self) -> usize {
        match self {
            Self::Int(v) => v.len(),
            Self::Float(v) => v.len(),
            Self::Bytes(v) => v.len(),
        }
    }

    /// Moves the first `count` numbers to the end.
    pub(in super::super) fn rotate_left(&mut self, count: usize) {
        match self {
            Self::Bytes(v) => v.rotate_left(count),
            Self::Int(v) => v.rotate_left(count),
            Self::Float(v) => v.rotate_left(count),
        }
    }

    /// Appends the numbers of `other`; integers and floats together are floats.
    pub(in super::super) fn append(&mut self, other: Self) {
        match (&mut *self, other) {
            (Self::Int(a), Self::Int(b)) => a.extend(b),
            (Self::Bytes(a), Self::Bytes(b)) => a.extend(b),
            (_, other) => {
                let mut all = std::mem::replace(self, Self::Bytes(Vec::new())).into_floats();
                all.extend(other.into_floats());
                *self = Self::Float(all);
            }
        }
    }

    /// All numbers as floats.
    pub(in super::super) fn into_floats(self) -> Vec<f64> {
        match self {
            Self::Int(v) => v.into_iter().map(|i| i as f64).collect(),
            Self::Float(v) => v,
            Self::Bytes(v) => v.into_iter().map(f64::from).collect(),
        }
    }

    /// All numbers as integers, or `None` when they are floats.
    pub(in super::super) fn into_integers(self) -> Option<Vec<i64>> {
        match self {
            Self::Int(v) => Some(v),
            Self::Float(_) => None,
            Self::Bytes(v) => Some(v.into_iter().map(i64::from).collect()),
        }
    }
}

/// A named array.
#[derive(Clone, Debug, PartialEq)]
pub(in super::super) struct Array {
    /// Its name.
    pub(in super::super) name: String,
    /// Numbers a row, at least 1.
    pub(in super::super) components: usize,
    /// The rows one after another.
    pub(in super::super) values: Values,
}

/// Points, cells and arrays.
#[derive(Clone, Debug, Default, PartialEq)]
pub(in super::super) struct DataSet {
    /// Coordinates.
    pub(in super::super) points: Vec<DVec3>,
    /// The VTK number of each cell's type.
    pub(in super::super) types: Vec<u8>,
    /// Where each cell's points end in `connectivity`.
    pub(in super::super) ends: Vec<usize>,
    /// The points of all cells.
    pub(in super::super) connectivity: Vec<u32>,
    /// Arrays with a row for each point.
    pub(in super::super) point_arrays: Vec<Array>,
    /// Arrays with a row for each cell.
    pub(in super::super) cell_arrays: Vec<Array>,
    /// Arrays of the data set as a whole.
    pub(in super::super) field_arrays: Vec<Array>,
}

/// VTK's numbers of cell types.
pub(in super::super) mod cell {
    pub(in super::super::super) const VERTEX: u8 = 1;
    pub(in super::super::super) const POLY_VERTEX: u8 = 2;
    pub(in super::super::super) const LINE: u8 = 3;
    pub(in super::super::super) const POLY_LINE: u8 = 4;
    pub(in super::super::super) const TRIANGLE: u8 = 5;
    pub(in super::super::super) const STRIP: u8 = 6;
    pub(in super::super::super) const POLYGON: u8 = 7;
    pub(in super::super::super) const PIXEL: u8 = 8;
    pub(in super::super::super) const QUAD: u8 = 9;
    pub(in super::super::super) const VOXEL: u8 = 11;
    pub(in super::super::super) const QUADRATIC_TRIANGLE: u8 = 22;
    pub(in super::super::super) const QUADRATIC_QUAD: u8 = 23;
}

/// Before the name of a face group in a cell array, and of a vertex group in a point array.
pub(super) const GROUP: &str = "group:";
/// Before the name of an edge group.
pub(super) const EDGE_GROUP: &str = "edge-group:";
/// The cell array of region labels.
pub(super) const REGION: &str = "region";
/// The field array of region names.
pub(super) const REGION_NAMES: &str = "region:names";

/// Which cell each face and edge of the soup comes from.
#[derive(Default)]
struct Origins {
    /// For each face its cell.
    faces: Vec<u32>,
    /// The edges with their cells.
    edges: Vec<(EdgeKey, u32)>,
    /// The cells that are volumes.
    volumes: Vec<u32>,
}

impl DataSet {
    /// Appends cells: their types, where each ends in `connectivity`, and their points.
    pub(in super::super) fn add_cells(
        &mut self,
        types: &[i64],
        ends: &[i64],
        connectivity: &[i64],
        place: Place,
    ) -> Result<(), FormatError> {
        if types.len() != ends.len() {
            let found = format!("{} types for {} cells", types.len(), ends.len());
            return Err(FormatError::new(place, Reason::Unexpected { expected: "a type for each cell", found }));
        }
        let before = self.connectivity.len();
        let mut last = 0;
        for &end in ends {
            if end < last || end > connectivity.len() as i64 {
                let count = connectivity.len() as u64;
                return Err(FormatError::new(place, Reason::OutOfRange { what: "cell offset", index: end, count }));
            }
            last = end;
            self.ends.push(before + end as usize);
        }
        // A tail that no cell uses would shift what is appended later.
        for &point in &connectivity[..last as usize] {
            let count = self.points.len() as u64;
            let id = u32::try_from(point).ok().filter(|&id| u64::from(id) < count);
            let missing = || FormatError::new(place, Reason::OutOfRange { what: "point", index: point, count });
            self.connectivity.push(id.ok_or_else(missing)?);
        }
        // Types beyond a byte are none; 0 is the empty cell, which no shape has.
        self.types.extend(types.iter().map(|&t| u8::try_from(t).unwrap_or(0)));
        Ok(())
    }

    /// Appends another piece of the same data set; only arrays that all pieces have are kept.
    pub(in super::super) fn append(&mut self, piece: Self, place: Place) -> Result<(), FormatError> {
        if self.points.is_empty() && self.types.is_empty() {
            *self = Self { field_arrays: std::mem::take(&mut self.field_arrays), ..piece };
            return Ok(());
        }
        let shift = self.points.len();
        if shift + piece.points.len() >= u32::MAX as usize {
            return Err(FormatError::new(place, Reason::TooMany { what: "points", limit: u64::from(u32::MAX) - 1 }));
        }
        let before = self.connectivity.len();
        self.points.extend(piece.points);
        self.types.extend(piece.types);
        self.ends.extend(piece.ends.iter().map(|end| before + end));
        self.connectivity.extend(piece.connectivity.iter().map(|&p| p + shift as u32));
        join(&mut self.point_arrays, piece.point_arrays);
        join(&mut self.cell_arrays, piece.cell_arrays);
        Ok(())
    }

    /// The mesh.
    pub(in super::super) fn into_soup(mut self) -> Result<(Soup, ReadCounts), FormatError> {
        self.check()?;
        let points = std::mem::take(&mut self.points);
        let mut elements = Elements::new(points.len());
        let origins = self.place_cells(&mut elements, &points)?;
        let mut soup = Soup { points: points.into(), ..Soup::default() };
        self.carry_points(&mut soup);
        self.carry_cells(&mut soup, &origins);
        let counts = elements.finish(&mut soup)?;
        let fields = &mut soup.carried.fields;
        fields.sort_by(|a, b| (a.support, &a.name).cmp(&(b.support, &b.name)));
        fields.dedup_by(|a, b| (a.support, &a.name) == (b.support, &b.name));
        Ok((soup, counts))
    }

    /// Refuses arrays of a wrong length and points that do not exist.
    fn check(&self) -> Result<(), FormatError> {
        let whole = |reason| FormatError::new(Place::File, reason);
        let rows = |array: &Array| array.values.len() / array.components.max(1);
        let of_points = self.point_arrays.iter().map(|a| (a, self.points.len()));
        for (array, expected) in of_points.chain(self.cell_arrays.iter().map(|a| (a, self.types.len()))) {
            if rows(array) != expected || array.values.len() % array.components.max(1) != 0 {
                let found = format!("{}: {} rows", array.name, rows(array));
                let expected = "as many rows in an array as there are points or cells";
                return Err(whole(Reason::Unexpected { expected, found }));
            }
        }
        let count = self.points.len() as u64;
        match self.connectivity.iter().find(|&&p| u64::from(p) >= count) {
            Some(&p) => Err(whole(Reason::OutOfRange { what: "point", index: i64::from(p), count })),
            None => Ok(()),
        }
    }

    fn place_cells(&self, elements: &mut Elements, points: &[DVec3]) -> Result<Origins, FormatError> {
        let mut origins = Origins::default();
        let mut begin = 0;
        for (i, (&kind, &end)) in self.types.iter().zip(&self.ends).enumerate() {
            let nodes = &self.connectivity[begin..end];
            begin = end;
            if let Some(corners) = volume_corners(kind).filter(|&corners| corners <= nodes.len()) {
                let voxel: Vec<u32> = VOXEL.iter().filter(|_| kind == cell::VOXEL).map(|&c| nodes[c]).collect();
                elements.volume(if voxel.is_empty() { nodes } else { &voxel }, corners);
                origins.volumes.push(i as u32);
                continue;
            }
            let mut put = |shape: Shape, nodes: &[u32]| match elements.add(shape, nodes, points) {
                Placed::Faces(range) => origins.faces.extend(range.map(|_| i as u32)),
                Placed::Edge(edge) => origins.edges.push((edge, i as u32)),
                Placed::Vertex(_) | Placed::Skin(..) | Placed::Volume(_) | Placed::Nothing => {}
            };
            match kind {
                cell::VERTEX | cell::POLY_VERTEX => nodes.iter().for_each(|&n| put(Shape::Point, &[n])),
                cell::LINE | cell::POLY_LINE => nodes.windows(2).for_each(|ends| put(Shape::Line, ends)),
                cell::STRIP => strip(nodes).for_each(|corners| put(Shape::Triangle, &corners)),
                cell::PIXEL if nodes.len() == 4 => put(Shape::Quad, &[nodes[0], nodes[1], nodes[3], nodes[2]]),
                _ => {
                    let shape = shape_of(kind).filter(|s| s.corners(nodes.len()) <= nodes.len()).ok_or_else(|| {
                        let found = format!("cell {i} of type {kind} with {} points", nodes.len());
                        FormatError::new(Place::File, Reason::Unexpected { expected: "a VTK cell", found })
                    })?;
                    put(shape, nodes);
                }
            }
        }
        if let Some(ranges) = elements.skin(points) {
            origins.faces =
                origins.volumes.iter().zip(ranges).flat_map(|(&cell, (faces, _))| faces.map(move |_| cell)).collect();
        }
        Ok(origins)
    }

    fn carry_points(&mut self, soup: &mut Soup) {
        for array in std::mem::take(&mut self.point_arrays) {
            match (array.name.strip_prefix(GROUP), &array.values) {
                (Some(name), Values::Int(_) | Values::Bytes(_)) if array.components == 1 => {
                    let name = name.to_owned();
                    let values = array.values.into_integers().unwrap_or_default();
                    let members = (0..values.len()).filter(|&i| values[i] != 0).map(VertexId::new).collect();
                    soup.carried.groups.vertices.insert(name, members);
                }
                _ => add_field(soup, Support::Vertex, array),
            }
        }
    }

    fn carry_cells(&mut self, soup: &mut Soup, origins: &Origins) {
        let names = self.region_names();
        for array in std::mem::take(&mut self.cell_arrays) {
            let single = array.components == 1 && !matches!(array.values, Values::Float(_));
            if !single {
                add_field(soup, Support::Face, on_faces(array, origins));
                continue;
            }
            let Array { name, values, .. } = array;
            let values = values.into_integers().unwrap_or_default();
            if let Some(group) = name.strip_prefix(GROUP) {
                let members = (0..origins.faces.len()).filter(|&f| values[origins.faces[f] as usize] != 0);
                soup.carried.groups.faces.insert(group.to_owned(), members.map(FaceId::new).collect());
            } else if let Some(group) = name.strip_prefix(EDGE_GROUP) {
                let members = origins.edges.iter().filter(|(_, c)| values[*c as usize] != 0).map(|&(e, _)| e);
                let members: BTreeSet<EdgeKey> = members.collect();
                soup.carried.groups.edges.insert(group.to_owned(), members.into_iter().collect());
            } else if let Some(regions) = (name == REGION).then(|| regions(&values, origins, &names)).flatten() {
                soup.carried.regions = Some(regions);
            } else {
                add_label_groups(soup, &name, &values, origins);
                let rows = Values::Float(values.into_iter().map(|v| v as f64).collect());
                add_field(soup, Support::Face, on_faces(Array { name, components: 1, values: rows }, origins));
            }
        }
    }

    /// The names that `region:names` holds, one after another, each ended by a zero byte.
    fn region_names(&self) -> Vec<String> {
        let array = self.field_arrays.iter().find(|a| a.name == REGION_NAMES);
        let bytes = match array.map(|a| a.values.clone()) {
            Some(values) => values.into_integers().unwrap_or_default(),
            None => return Vec::new(),
        };
        let bytes: Vec<u8> = bytes.into_iter().map(|b| b as u8).collect();
        let mut names: Vec<String> =
            bytes.split(|&b| b == 0).map(|n| String::from_utf8_lossy(n).into_owned()).collect();
        names.pop();
        names
    }
}

/// Appends the rows of the next piece to arrays of the same name and width, and forgets the others.
fn join(arrays: &mut Vec<Array>, mut next: Vec<Array>) {
    arrays.retain_mut(|array| {
        let same = |a: &Array| a.name == array.name && a.components == array.components;
        let found = next.iter().position(same).map(|i| next.swap_remove(i));
        found.map(|more| array.values.append(more.values)).is_some()
    });
}

/// The triangles of a strip: every second one is turned so that all face the same way.
fn strip(nodes: &[u32]) -> impl Iterator<Item = [u32; 3]> {
    nodes.windows(3).enumerate().map(|(i, w)| if i % 2 == 0 { [w[0], w[1], w[2]] } else { [w[1], w[0], w[2]] })
}

/// The shape of a VTK cell type, for those whose corners come first and make one element.
fn shape_of(kind: u8) -> Option<Shape> {
    match kind {
        cell::TRIANGLE | cell::QUADRATIC_TRIANGLE | 34 | 69 | 76 => Some(Shape::Triangle),
        cell::POLYGON => Some(Shape::Polygon),
        cell::QUAD | cell::QUADRATIC_QUAD | 28 | 30 | 70 | 77 => Some(Shape::Quad),
        21 | 35 | 68 | 75 => Some(Shape::Line),
        _ => None,
    }
}

/// The corners of a voxel in the order of a brick's.
const VOXEL: [usize; 8] = [0, 1, 3, 2, 4, 5, 7, 6];

/// How many of the first points of a volume cell are its corners, 0 where its sides are not known; `None` of other
/// cells.
fn volume_corners(kind: u8) -> Option<usize> {
    match kind {
        10 | 24 | 71 | 78 => Some(4),
        14 | 27 | 37 | 74 | 81 => Some(5),
        13 | 26 | 31 | 32 | 73 | 80 => Some(6),
        cell::VOXEL | 12 | 25 | 29 | 33 | 72 | 79 => Some(8),
        15 | 16 | 42 => Some(0),
        _ => None,
    }
}

fn regions(values: &[i64], origins: &Origins, names: &[String]) -> Option<Regions> {
    let label = |&cell: &u32| u32::try_from(values[cell as usize]).ok().filter(|&l| (l as usize) < names.len());
    let labels: Option<Vec<u32>> = origins.faces.iter().map(label).collect();
    let labels = labels.filter(|_| !names.is_empty())?;
    Some(Regions { labels: labels.into(), names: names.to_vec() })
}

/// A group for each value, where the values are labels and not a numbering.
fn add_label_groups(soup: &mut Soup, name: &str, values: &[i64], origins: &Origins) {
    const MOST_LABELS: usize = 256;
    let mut distinct = BTreeSet::new();
    for &value in values {
        distinct.insert(value);
        if distinct.len() > MOST_LABELS {
            return;
        }
    }
    if distinct.len() > 1 && distinct.len() * 2 > values.len() {
        return;
    }
    let mut faces: BTreeMap<i64, Vec<FaceId>> = BTreeMap::new();
    for (f, &cell) in origins.faces.iter().enumerate() {
        faces.entry(values[cell as usize]).or_default().push(FaceId::new(f));
    }
    let mut edges: BTreeMap<i64, BTreeSet<EdgeKey>> = BTreeMap::new();
    for &(edge, cell) in &origins.edges {
        edges.entry(values[cell as usize]).or_default().insert(edge);
    }
    let groups = &mut soup.carried.groups;
    groups.faces.extend(faces.into_iter().map(|(v, m)| (format!("{name}_{v}"), m)));
    groups.edges.extend(edges.into_iter().map(|(v, m)| (format!("{name}_{v}"), m.into_iter().collect())));
}

/// The rows of a cell array in face order.
fn on_faces(array: Array, origins: &Origins) -> Array {
    let components = array.components;
    let values = array.values.into_floats();
    let row = |&cell: &u32| values[cell as usize * components..][..components].iter().copied();
    let rows = origins.faces.iter().flat_map(row).collect();
    Array { name: array.name, components, values: Values::Float(rows) }
}

fn add_field(soup: &mut Soup, support: Support, array: Array) {
    let Array { name, components, values } = array;
    soup.carried.fields.push(Field { name, support, components, values: values.into_floats() });
}
