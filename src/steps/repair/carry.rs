//! From the draft to the surface: final numbers, and everything the input carries on the new elements.

use std::collections::{BTreeMap, BTreeSet};

use super::draft::{Draft, Origin};
use crate::mesh::id::{Face, Vertex};
use crate::mesh::{
    Carried, EdgeKey, EdgeMark, FaceId, Field, Freedom, IdVec, MarkCause, Regions, SeamId, Soup, Support, Surface,
    VertexId, edge_key,
};

/// The face group of the faces that fill holes.
pub(super) const FILLED: &str = "filled";

const UNUSED: VertexId = VertexId::from_raw(u32::MAX);

/// The surface of a finished draft. With `seams`, the copies of a vertex share a seam id.
pub(super) fn finish(draft: &Draft, soup: &Soup, seams: bool) -> Surface {
    let numbering = Numbering::new(draft);
    let faces = draft.faces.iter().map(|corners| corners.map(|v| numbering.new_of[v])).collect();
    let points = numbering.old_of.iter().map(|&v| draft.points[v]).collect();
    let mut surface = Surface { points, faces, carried: Carried::default() };
    surface.carried = carried(draft, soup, &surface, &numbering, seams);
    surface
}

/// The vertices of the result: first one at each place in the order of the input, then further copies in the order
/// of the faces. The order depends on the result only, so that repairing it again keeps it.
struct Numbering {
    new_of: IdVec<Vertex, VertexId>,
    old_of: IdVec<Vertex, VertexId>,
    /// How many places there are; vertices from here on are further copies.
    places: usize,
}

impl Numbering {
    fn new(draft: &Draft) -> Self {
        let count = draft.points.len();
        let mut used = IdVec::<Vertex, bool>::filled(false, count);
        for corners in &draft.faces {
            for &v in corners {
                used[v] = true;
            }
        }
        let mut leader = IdVec::<Vertex, VertexId>::filled(UNUSED, count);
        let mut new_of = IdVec::filled(UNUSED, count);
        let mut old_of = IdVec::new();
        for v in used.ids().filter(|&v| used[v]) {
            if leader[draft.root[v]] == UNUSED {
                leader[draft.root[v]] = v;
                new_of[v] = old_of.push(v);
            }
        }
        let places = old_of.len();
        for &v in draft.faces.iter().flatten() {
            if new_of[v] == UNUSED {
                new_of[v] = old_of.push(v);
            }
        }
        Self { new_of, old_of, places }
    }
}

fn carried(draft: &Draft, soup: &Soup, surface: &Surface, numbering: &Numbering, seams: bool) -> Carried {
    let from = &soup.carried;
    let mut carried = Carried { regions: regions(draft, from), ..Carried::default() };
    carried.fields = from.fields.iter().map(|field| map_field(draft, field, numbering)).collect();
    carried.groups.faces = face_groups(draft, soup);
    let needs_edges = !from.groups.edges.is_empty() || !from.marks.is_empty();
    let copies = numbering.old_of.len() > numbering.places;
    if needs_edges || (seams && copies) {
        let edges = EdgesByPlace::new(draft, surface, numbering);
        map_edges(draft, from, &edges, &mut carried);
        if seams && copies {
            mark_seams(draft, numbering, &edges, &mut carried);
        }
    }
    map_vertices(draft, from, numbering, &mut carried);
    carried
}

fn regions(draft: &Draft, from: &Carried) -> Option<Regions> {
    let regions = from.regions.as_ref()?;
    let labels = draft.origin.iter().map(|origin| regions.labels[origin.face()]).collect();
    Some(Regions { labels, names: regions.names.clone() })
}

/// A vertex has the mean of its sources, a face the values of the face it comes from or fills beside.
fn map_field(draft: &Draft, field: &Field, numbering: &Numbering) -> Field {
    let width = field.components;
    let of = |index: usize| &field.values[index * width..(index + 1) * width];
    let mut values = Vec::new();
    match field.support {
        Support::Face => draft.origin.iter().for_each(|origin| values.extend_from_slice(of(origin.face().index()))),
        Support::Vertex => {
            for &v in &numbering.old_of {
                let sources = draft.sources[v].as_slice();
                for component in 0..width {
                    let sum: f64 = sources.iter().map(|s| of(s.index())[component]).sum();
                    values.push(if sources.len() == 1 { sum } else { sum / sources.len() as f64 });
                }
            }
        }
    }
    Field { values, ..field.clone() }
}

fn face_groups(draft: &Draft, soup: &Soup) -> BTreeMap<String, Vec<FaceId>> {
    let parts = parts_of_input(draft, soup.faces.len());
    let mut groups = BTreeMap::new();
    for (name, members) in &soup.carried.groups.faces {
        let mut mapped: Vec<FaceId> = members.iter().flat_map(|&f| parts.of(f)).copied().collect();
        mapped.sort_unstable();
        mapped.dedup();
        groups.insert(name.clone(), mapped);
    }
    let is_filled = |(_, origin): &(FaceId, &Origin)| matches!(origin, Origin::Filled(_));
    let filled: Vec<FaceId> = draft.origin.enumerate().filter(is_filled).map(|(f, _)| f).collect();
    if !filled.is_empty() {
        let group: &mut Vec<FaceId> = groups.entry(FILLED.to_owned()).or_default();
        group.extend(filled);
        group.sort_unstable();
    }
    groups
}

/// The faces of the draft by the input face they are part of.
struct PartsOfInput {
    offsets: IdVec<Face, u32>,
    parts: Vec<FaceId>,
}

impl PartsOfInput {
    fn of(&self, face: FaceId) -> &[FaceId] {
        let end = FaceId::new(face.index() + 1);
        &self.parts[self.offsets[face] as usize..self.offsets[end] as usize]
    }
}

fn parts_of_input(draft: &Draft, count: usize) -> PartsOfInput {
    let inputs = || {
        draft.origin.enumerate().filter_map(|(f, origin)| match origin {
            Origin::Input(face) => Some((*face, f)),
            Origin::Filled(_) => None,
        })
    };
    let mut offsets = IdVec::<Face, u32>::filled(0, count + 1);
    inputs().for_each(|(face, _)| offsets[FaceId::new(face.index() + 1)] += 1);
    for i in 0..count {
        let before = offsets[FaceId::new(i)];
        offsets[FaceId::new(i + 1)] += before;
    }
    let mut cursor = offsets.clone();
    let mut parts = vec![FaceId::from_raw(0); inputs().count()];
    for (face, f) in inputs() {
        parts[cursor[face] as usize] = f;
        cursor[face] += 1;
    }
    PartsOfInput { offsets, parts }
}

/// The edges of the result by the places of their ends, in the draft's roots.
struct EdgesByPlace {
    edges: Vec<(EdgeKey, EdgeKey)>,
}

impl EdgesByPlace {
    fn new(draft: &Draft, surface: &Surface, numbering: &Numbering) -> Self {
        let place = |v: VertexId| draft.root[numbering.old_of[v]];
        let mut edges: Vec<(EdgeKey, EdgeKey)> = Vec::with_capacity(3 * surface.faces.len());
        for &[a, b, c] in &surface.faces {
            for (a, b) in [(a, b), (b, c), (c, a)] {
                edges.push((edge_key(place(a), place(b)), edge_key(a, b)));
            }
        }
        edges.sort_unstable();
        edges.dedup();
        Self { edges }
    }

    /// The edges between two places; for one that was split, its parts.
    fn between(&self, draft: &Draft, a: VertexId, b: VertexId) -> Vec<EdgeKey> {
        let mut found = Vec::new();
        for key in draft.parts_of_edge(a, b) {
            let start = self.edges.partition_point(|(place, _)| *place < key);
            found.extend(self.edges[start..].iter().take_while(|(place, _)| *place == key).map(|(_, edge)| *edge));
        }
        found.sort_unstable();
        found.dedup();
        found
    }
}

fn map_edges(draft: &Draft, from: &Carried, edges: &EdgesByPlace, carried: &mut Carried) {
    let place = |v: VertexId| draft.root[draft.of_input[v]];
    let mapped = |&[a, b]: &EdgeKey| edges.between(draft, place(a), place(b));
    for (name, members) in &from.groups.edges {
        let all: BTreeSet<EdgeKey> = members.iter().flat_map(mapped).collect();
        carried.groups.edges.insert(name.clone(), all.into_iter().collect());
    }
    for (edge, mark) in &from.marks {
        // Seams are found anew: the input's may be welded by now.
        if mark.cause != MarkCause::Seam {
            for edge in mapped(edge) {
                carried.mark(edge, *mark);
            }
        }
    }
}

/// Copies of one place share a seam id, and edges that lie on each other are kept as they are.
fn mark_seams(draft: &Draft, numbering: &Numbering, edges: &EdgesByPlace, carried: &mut Carried) {
    let mut copies: BTreeMap<VertexId, Vec<VertexId>> = BTreeMap::new();
    for v in numbering.old_of.ids().skip(numbering.places) {
        copies.entry(draft.root[numbering.old_of[v]]).or_default().push(v);
    }
    let mut number = 0;
    for v in numbering.old_of.ids().take(numbering.places) {
        if let Some(others) = copies.get(&draft.root[numbering.old_of[v]]) {
            for &copy in std::iter::once(&v).chain(others) {
                carried.seams.insert(copy, SeamId(number));
                carried.pin(copy, Freedom::Keep);
            }
            number += 1;
        }
    }
    let mark = EdgeMark { freedom: Freedom::Keep, cause: MarkCause::Seam };
    for same_place in edges.edges.chunk_by(|a, b| a.0 == b.0).filter(|chunk| chunk.len() > 1) {
        for (_, edge) in same_place {
            carried.mark(*edge, mark);
        }
    }
}

fn map_vertices(draft: &Draft, from: &Carried, numbering: &Numbering, carried: &mut Carried) {
    if from.groups.vertices.is_empty() && from.pins.is_empty() {
        return;
    }
    let mut by_place: Vec<(VertexId, VertexId)> =
        numbering.old_of.enumerate().map(|(new, &old)| (draft.root[old], new)).collect();
    by_place.sort_unstable();
    let at = |v: VertexId| {
        let place = draft.root[draft.of_input[v]];
        let start = by_place.partition_point(|(p, _)| *p < place);
        by_place[start..].iter().take_while(move |(p, _)| *p == place).map(|(_, new)| *new)
    };
    for (name, members) in &from.groups.vertices {
        let all: BTreeSet<VertexId> = members.iter().flat_map(|&v| at(v)).collect();
        carried.groups.vertices.insert(name.clone(), all.into_iter().collect());
    }
    for (&v, &freedom) in &from.pins {
        // Copies at a seam of the input were pinned by it; a seam of the result pins them again.
        if !from.seams.contains_key(&v) {
            at(v).for_each(|v| carried.pin(v, freedom));
        }
    }
}
