//! A mesh as the data set that the VTK formats write: the way back of the table in `model`.

use std::collections::BTreeMap;

use super::super::element::Elevated;
use super::model::{Array, DataSet, EDGE_GROUP, GROUP, REGION, REGION_NAMES, Values, cell};
use crate::mesh::{EdgeKey, FaceId, Facet, Field, Soup, Support, VertexId};

impl DataSet {
    /// The data set of `soup`: its faces, then a line for each edge in an edge group. With `elevated`, faces are
    /// quadratic; point arrays then carry the mean of an edge's ends on its mid-side node.
    pub(in super::super) fn of(soup: &Soup, elevated: Option<&Elevated>) -> Self {
        let mut set = Self { points: soup.points.as_slice().to_vec(), ..Self::default() };
        set.points.extend(elevated.iter().flat_map(|e| e.points.iter().copied()));
        for (i, face) in soup.faces.iter().enumerate() {
            let (first_order, second_order) = match face {
                Facet::Tri(_) => (cell::TRIANGLE, cell::QUADRATIC_TRIANGLE),
                Facet::Quad(_) => (cell::QUAD, cell::QUADRATIC_QUAD),
            };
            let mids = elevated.map_or(&[][..], |e| e.of(i, face.corners().len()));
            let corners = face.corners().iter().map(|v| v.raw());
            set.add(if mids.is_empty() { first_order } else { second_order }, corners.chain(mids.iter().copied()));
        }
        let lines = lines(soup);
        for &[a, b] in lines.keys() {
            set.add(cell::LINE, [a.raw(), b.raw()].into_iter());
        }
        set.add_regions(soup, lines.len());
        set.add_groups(soup, &lines);
        set.add_fields(soup, lines.len(), elevated);
        set
    }

    /// Moves the first `count` cells, with what they carry, behind all others.
    pub(in super::super) fn rotate_cells(&mut self, count: usize) {
        let cells = self.types.len();
        let corners = count.checked_sub(1).map_or(0, |last| self.ends[last]);
        let mut sizes: Vec<usize> =
            std::iter::once(0).chain(self.ends.iter().copied()).zip(&self.ends).map(|(from, to)| to - from).collect();
        sizes.rotate_left(count);
        self.types.rotate_left(count);
        self.connectivity.rotate_left(corners);
        self.ends = sizes
            .iter()
            .scan(0, |end, size| {
                *end += size;
                Some(*end)
            })
            .collect();
        for array in &mut self.cell_arrays {
            array.values.rotate_left(count * (array.values.len() / cells.max(1)));
        }
    }

    fn add(&mut self, kind: u8, points: impl Iterator<Item = u32>) {
        self.types.push(kind);
        self.connectivity.extend(points);
        self.ends.push(self.connectivity.len());
    }

    fn add_regions(&mut self, soup: &Soup, lines: usize) {
        let Some(regions) = &soup.carried.regions else { return };
        let labels = regions.labels.iter().map(|&l| i64::from(l)).chain(std::iter::repeat_n(0, lines)).collect();
        self.cell_arrays.push(Array { name: REGION.to_owned(), components: 1, values: Values::Int(labels) });
        let names = regions.names.iter().flat_map(|n| n.bytes().filter(|&b| b != 0).chain([0])).collect();
        self.field_arrays.push(Array { name: REGION_NAMES.to_owned(), components: 1, values: Values::Bytes(names) });
    }

    fn add_groups(&mut self, soup: &Soup, lines: &BTreeMap<EdgeKey, usize>) {
        let groups = &soup.carried.groups;
        let flags = |name: String, members: &mut dyn Iterator<Item = usize>, len: usize| {
            let mut flags = vec![0; len];
            members.for_each(|i| flags[i] = 1);
            Array { name, components: 1, values: Values::Bytes(flags) }
        };
        let cells = self.types.len();
        let faces = groups.faces.iter().map(|(name, members)| {
            flags(format!("{GROUP}{name}"), &mut members.iter().map(|f: &FaceId| f.index()), cells)
        });
        let edges = groups.edges.iter().map(|(name, members)| {
            let members = &mut members.iter().map(|e| soup.faces.len() + lines[e]);
            flags(format!("{EDGE_GROUP}{name}"), members, cells)
        });
        self.cell_arrays.extend(faces.chain(edges));
        let points = self.points.len();
        self.point_arrays.extend(groups.vertices.iter().map(|(name, members)| {
            flags(format!("{GROUP}{name}"), &mut members.iter().map(|v: &VertexId| v.index()), points)
        }));
    }

    fn add_fields(&mut self, soup: &Soup, lines: usize, elevated: Option<&Elevated>) {
        for field in &soup.carried.fields {
            let Field { name, support, components, values } = field;
            let mut values = values.clone();
            match support {
                Support::Face => values.extend(std::iter::repeat_n(f64::NAN, lines * components)),
                Support::Vertex => values.extend(elevated.iter().flat_map(|e| e.means(soup, field))),
            }
            let array = Array { name: name.clone(), components: *components, values: Values::Float(values) };
            match support {
                Support::Face => self.cell_arrays.push(array),
                Support::Vertex => self.point_arrays.push(array),
            }
        }
    }
}

/// The edges of all edge groups, each with its place among the line cells.
fn lines(soup: &Soup) -> BTreeMap<EdgeKey, usize> {
    let mut lines: BTreeMap<EdgeKey, usize> = soup.carried.groups.edges.values().flatten().map(|&e| (e, 0)).collect();
    lines.values_mut().enumerate().for_each(|(i, place)| *place = i);
    lines
}
