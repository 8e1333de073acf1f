//! What a surface carries, on the pieces of its faces.

use std::collections::{BTreeMap, BTreeSet};

use glam::DVec3;

use super::cells::Complex;
use super::exact::NONE;
use super::extract::Chosen;
use crate::mesh::geometry::{closest_on_segment, closest_on_triangle};
use crate::mesh::{Carried, EdgeKey, FaceId, Facet, Field, Regions, Soup, Support, Surface, VertexId, edge_key};

/// Pieces of a surface's faces: no manifold in general.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Part {
    /// Where the pieces have corners.
    pub points: Vec<DVec3>,
    /// The vertex of the surface that each point is.
    pub vertices: Vec<Option<VertexId>>,
    /// The pieces, by their corners among the points.
    pub faces: Vec<[u32; 3]>,
    /// The face that each is a part of.
    pub origin: Vec<FaceId>,
    /// Points this near to an edge of their face lie on it.
    pub reach: f64,
}

/// Where a vertex comes from: a face, and weights of its corners; of a vertex all weight is its own.
struct Source {
    face: FaceId,
    weights: [f64; 3],
    vertex: Option<VertexId>,
}

impl Part {
    pub(super) fn new(complex: &Complex<'_>, origin: &[u32], chosen: &[Chosen], reach: f64) -> Self {
        let mut number = vec![NONE; complex.places.len()];
        let mut part = Self { reach, ..Self::default() };
        for &(corners, f) in chosen {
            let corners = corners.map(|node| {
                let known = &mut number[node as usize];
                if *known == NONE {
                    *known = part.points.len() as u32;
                    part.points.push(complex.places[node as usize]);
                    let vertex = (node as usize) < complex.vertices;
                    part.vertices.push(vertex.then_some(VertexId::from_raw(node)));
                }
                *known
            });
            part.faces.push(corners);
            part.origin.push(FaceId::from_raw(origin[f as usize]));
        }
        part
    }

    /// The pieces with all that the surface carries.
    pub fn to_soup(&self, surface: &Surface) -> Soup {
        let faces = self.faces.iter().map(|face| Facet::Tri(face.map(VertexId::from_raw))).collect();
        let mut soup = Soup { points: self.points.clone().into(), faces, carried: Carried::default() };
        soup.carried = carried(surface, &soup, &self.sources(surface), &self.origin, self.reach);
        soup
    }

    fn sources(&self, surface: &Surface) -> Vec<Source> {
        let mut face_at = vec![FaceId::from_raw(0); self.points.len()];
        for (corners, &face) in self.faces.iter().zip(&self.origin).rev() {
            for &v in corners {
                face_at[v as usize] = face;
            }
        }
        let all = face_at.into_iter().zip(&self.points).zip(&self.vertices);
        all.map(|((face, &point), &vertex)| {
            let weights = closest_on_triangle(point, surface.corners(face)).weights;
            Source { face, weights, vertex }
        })
        .collect()
    }
}

fn carried(surface: &Surface, soup: &Soup, sources: &[Source], faces: &[FaceId], reach: f64) -> Carried {
    let from = &surface.carried;
    let mut carried = Carried::default();
    if let Some(regions) = &from.regions {
        let labels = faces.iter().map(|&f| regions.labels[f]).collect();
        carried.regions = Some(Regions { labels, names: regions.names.clone() });
    }
    carried.fields = from.fields.iter().map(|field| mapped_field(surface, field, sources, faces)).collect();
    for (name, members) in &from.groups.faces {
        let is_member = |face: &FaceId| members.binary_search(face).is_ok();
        let mapped = faces.iter().enumerate().filter(|(_, face)| is_member(face)).map(|(f, _)| FaceId::new(f));
        carried.groups.faces.insert(name.clone(), mapped.collect());
    }
    let mut number: BTreeMap<VertexId, VertexId> = BTreeMap::new();
    if !(from.groups.vertices.is_empty() && from.pins.is_empty()) {
        let known = sources.iter().enumerate().filter_map(|(v, source)| Some((source.vertex?, VertexId::new(v))));
        number.extend(known);
    }
    for (name, members) in &from.groups.vertices {
        let all: BTreeSet<VertexId> = members.iter().filter_map(|v| number.get(v).copied()).collect();
        carried.groups.vertices.insert(name.clone(), all.into_iter().collect());
    }
    for (v, &freedom) in &from.pins {
        if let Some(&v) = number.get(v) {
            carried.pin(v, freedom);
        }
    }
    map_edges(surface, soup, faces, reach, &mut carried);
    carried
}

fn mapped_field(surface: &Surface, field: &Field, sources: &[Source], faces: &[FaceId]) -> Field {
    let width = field.components;
    let of = |index: usize| &field.values[index * width..(index + 1) * width];
    let values = match field.support {
        Support::Face => faces.iter().flat_map(|f| of(f.index())).copied().collect(),
        Support::Vertex => sources
            .iter()
            .flat_map(|source| {
                let corners = surface.faces[source.face];
                let at = |k: usize| {
                    if let Some(vertex) = source.vertex {
                        return of(vertex.index())[k];
                    }
                    // A weight of zero must not carry over a value that is no number.
                    let weighted = (0..3).filter(|&c| source.weights[c] != 0.0);
                    weighted.map(|c| source.weights[c] * of(corners[c].index())[k]).sum()
                };
                (0..width).map(at).collect::<Vec<f64>>()
            })
            .collect(),
    };
    Field { values, ..field.clone() }
}

/// Groups and marks of edges go to the edges of pieces that lie on them.
fn map_edges(surface: &Surface, soup: &Soup, faces: &[FaceId], reach: f64, carried: &mut Carried) {
    let from = &surface.carried;
    if from.groups.edges.is_empty() && from.marks.is_empty() {
        return;
    }
    let groups = from.groups.edges.values().flatten();
    let wanted: BTreeSet<EdgeKey> = groups.chain(from.marks.keys()).copied().collect();
    let mut parts: BTreeMap<EdgeKey, BTreeSet<EdgeKey>> = BTreeMap::new();
    for (facet, &face) in soup.faces.iter().zip(faces) {
        let [x, y, z] = surface.faces[face];
        for [a, b] in [edge_key(x, y), edge_key(y, z), edge_key(z, x)].into_iter().filter(|key| wanted.contains(key)) {
            let ends = [surface.points[a], surface.points[b]];
            let lies = |p: DVec3| closest_on_segment(p, ends).distance_squared <= reach * reach;
            let corners = facet.corners();
            for (i, &p) in corners.iter().enumerate() {
                let q = corners[(i + 1) % corners.len()];
                if lies(soup.points[p]) && lies(soup.points[q]) {
                    parts.entry([a, b]).or_default().insert(edge_key(p, q));
                }
            }
        }
    }
    let of = |key: &EdgeKey| parts.get(key).into_iter().flatten().copied();
    for (name, members) in &from.groups.edges {
        let all: BTreeSet<EdgeKey> = members.iter().flat_map(of).collect();
        carried.groups.edges.insert(name.clone(), all.into_iter().collect());
    }
    for (key, &mark) in &from.marks {
        of(key).for_each(|edge| carried.mark(edge, mark));
    }
}
