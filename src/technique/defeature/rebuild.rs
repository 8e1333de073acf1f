//! A surface without some faces and with fills in their place, and all it carries.

use std::collections::{BTreeMap, BTreeSet};

use glam::DVec3;

use super::fill::Fill;
use crate::mesh::bvh::TriangleBvh;
use crate::mesh::geometry::{angle, area_vector};
use crate::mesh::id::{Face, Vertex};
use crate::mesh::transfer::transfer_fields;
use crate::mesh::{Carried, EdgeKey, FaceId, Groups, IdVec, MarkCause, Regions, Surface, VertexId, edge_key};

/// A rim at which a fill turns by less than this, in degrees, is no sharp edge any more.
const SMOOTH: f64 = 20.0;

/// Stands for an element that is gone.
const GONE: u32 = u32::MAX;

/// Takes out the faces and puts the fills in; a fill inherits groups and region of the faces at most of its rim.
pub(super) fn rebuild(surface: &Surface, goes: &IdVec<Face, bool>, fills: &[Fill], tree: &TriangleBvh) -> Surface {
    let mut new_face = IdVec::<Face, u32>::filled(GONE, surface.faces.len());
    let mut faces: Vec<[u32; 3]> = Vec::new();
    for f in surface.faces.ids().filter(|&f| !goes[f]) {
        new_face[f] = faces.len() as u32;
        faces.push(surface.faces[f].map(VertexId::raw));
    }
    let kept = faces.len();
    let mut points: Vec<DVec3> = surface.points.iter().copied().collect();
    let mut parents: Vec<FaceId> = Vec::new();
    for fill in fills {
        let first = points.len();
        points.extend(&fill.points);
        let parent = model_face(surface, fill);
        for t in &fill.triangles {
            let number = |k: usize| fill.rim.get(k).map_or((first + k - fill.rim.len()) as u32, |v| v.raw());
            faces.push(t.map(number));
            parents.push(parent);
        }
    }
    let mut new_vertex = vec![GONE; points.len()];
    for v in faces.iter().flatten() {
        new_vertex[*v as usize] = 0;
    }
    for (number, new) in new_vertex.iter_mut().filter(|new| **new != GONE).enumerate() {
        *new = number as u32;
    }
    let is_used = |i: usize| new_vertex[i] != GONE;
    let points: IdVec<Vertex, DVec3> =
        points.iter().enumerate().filter(|(i, _)| is_used(*i)).map(|(_, &p)| p).collect();
    let faces = faces.iter().map(|t| t.map(|v| VertexId::from_raw(new_vertex[v as usize]))).collect();
    let names = Renamed { surface, new_face, new_vertex, parents, kept };
    let mut result = Surface { points, faces, carried: names.carried(fills) };
    if !surface.carried.fields.is_empty() {
        transfer_fields(surface, tree, &mut result);
    }
    result
}

/// The face whose groups and region most of a rim has; the lowest such face.
fn model_face(surface: &Surface, fill: &Fill) -> FaceId {
    let mut shares: BTreeMap<Vec<u32>, (f64, FaceId)> = BTreeMap::new();
    for (i, &f) in fill.beside.iter().enumerate() {
        let ends = [fill.rim[i], fill.rim[(i + 1) % fill.rim.len()]].map(|v| surface.points[v]);
        let entry = shares.entry(labels(surface, f)).or_insert((0.0, f));
        entry.0 += ends[0].distance(ends[1]);
        entry.1 = entry.1.min(f);
    }
    let best = shares.into_values().max_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1)));
    best.map_or(FaceId::from_raw(0), |(_, face)| face)
}

/// The groups and the region of a face.
fn labels(surface: &Surface, f: FaceId) -> Vec<u32> {
    let sets = surface.carried.groups.faces.values().enumerate();
    let mut found: Vec<u32> = sets.filter(|(_, m)| m.binary_search(&f).is_ok()).map(|(i, _)| i as u32).collect();
    found.extend(surface.carried.regions.iter().map(|regions| GONE - regions.labels[f]));
    found
}

struct Renamed<'a> {
    surface: &'a Surface,
    new_face: IdVec<Face, u32>,
    new_vertex: Vec<u32>,
    parents: Vec<FaceId>,
    kept: usize,
}

impl Renamed<'_> {
    fn vertex(&self, v: VertexId) -> Option<VertexId> {
        Some(self.new_vertex[v.index()]).filter(|&n| n != GONE).map(VertexId::from_raw)
    }

    fn edge(&self, [a, b]: EdgeKey) -> Option<EdgeKey> {
        Some(edge_key(self.vertex(a)?, self.vertex(b)?))
    }

    fn carried(&self, fills: &[Fill]) -> Carried {
        let old = &self.surface.carried;
        let gone = self.edges_gone();
        let mut carried = Carried { groups: self.groups(&gone), regions: self.regions(), ..Carried::default() };
        let smooth = smooth_rims(self.surface, fills);
        let mut is_marked = vec![false; self.new_vertex.len()];
        let mut was_marked = is_marked.clone();
        for (edge, mark) in &old.marks {
            let is_ours = matches!(mark.cause, MarkCause::Feature | MarkCause::RegionBorder);
            let vanishes = gone.contains(edge) || (is_ours && smooth.contains(edge));
            for v in edge {
                was_marked[v.index()] = true;
                is_marked[v.index()] |= !vanishes;
            }
            if let Some(edge) = self.edge(*edge).filter(|_| !vanishes) {
                carried.mark(edge, *mark);
            }
        }
        for (&v, &pin) in &old.pins {
            let lost = was_marked[v.index()] && !is_marked[v.index()];
            if let Some(new) = self.vertex(v).filter(|_| !lost) {
                carried.pin(new, pin);
            }
        }
        carried.seams = old.seams.iter().filter_map(|(&v, &seam)| Some((self.vertex(v)?, seam))).collect();
        carried
    }

    /// The edges that only faces that go have, sorted.
    fn edges_gone(&self) -> BTreeSet<EdgeKey> {
        let sides = |f: FaceId| {
            let [a, b, c] = self.surface.faces[f];
            [edge_key(a, b), edge_key(b, c), edge_key(c, a)]
        };
        let goes = |f: &FaceId| self.new_face[*f] == GONE;
        let mut gone: BTreeSet<EdgeKey> = self.surface.faces.ids().filter(goes).flat_map(sides).collect();
        if !gone.is_empty() {
            for edge in self.surface.faces.ids().filter(|f| !goes(f)).flat_map(sides) {
                gone.remove(&edge);
            }
        }
        gone
    }

    fn groups(&self, gone: &BTreeSet<EdgeKey>) -> Groups {
        let old = &self.surface.carried.groups;
        let faces = |members: &Vec<FaceId>| {
            let kept = members.iter().map(|&f| self.new_face[f]).filter(|&f| f != GONE).map(FaceId::from_raw);
            let added = self.parents.iter().enumerate().filter(|(_, parent)| members.binary_search(parent).is_ok());
            kept.chain(added.map(|(i, _)| FaceId::new(self.kept + i))).collect()
        };
        let edges = |members: &Vec<EdgeKey>| {
            let mut kept: Vec<EdgeKey> =
                members.iter().filter(|e| !gone.contains(*e)).filter_map(|&e| self.edge(e)).collect();
            kept.sort_unstable();
            kept
        };
        let vertices = |members: &Vec<VertexId>| members.iter().filter_map(|&v| self.vertex(v)).collect();
        Groups {
            faces: old.faces.iter().map(|(name, m)| (name.clone(), faces(m))).collect(),
            edges: old.edges.iter().map(|(name, m)| (name.clone(), edges(m))).collect(),
            vertices: old.vertices.iter().map(|(name, m)| (name.clone(), vertices(m))).collect(),
        }
    }

    fn regions(&self) -> Option<Regions> {
        let old = self.surface.carried.regions.as_ref()?;
        let kept = self.surface.faces.ids().filter(|&f| self.new_face[f] != GONE);
        let labels = kept.chain(self.parents.iter().copied()).map(|f| old.labels[f]).collect();
        Some(Regions { labels, names: old.names.clone() })
    }
}

/// The rim edges at which fill and surface go on into each other.
fn smooth_rims(surface: &Surface, fills: &[Fill]) -> BTreeSet<EdgeKey> {
    let mut smooth = BTreeSet::new();
    for fill in fills {
        let count = fill.rim.len();
        let model = labels(surface, model_face(surface, fill));
        for (t, corners) in fill.triangles.iter().zip(fill.corners(surface)) {
            for k in 0..3 {
                // The fill runs against the rim.
                let (to, from) = (t[k], t[(k + 1) % 3]);
                if from < count && to == (from + 1) % count {
                    let beside = fill.beside[from];
                    let turn = angle(area_vector(corners), area_vector(surface.corners(beside))).to_degrees();
                    if turn < SMOOTH && labels(surface, beside) == model {
                        smooth.insert(edge_key(fill.rim[from], fill.rim[to]));
                    }
                }
            }
        }
    }
    smooth
}
