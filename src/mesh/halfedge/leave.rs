//! Out of the workshop: survivors in their old order, and everything they carry.

use std::collections::BTreeMap;

use super::{HalfedgeMesh, NONE};
use crate::mesh::carried::{Carried, Groups, Regions, edge_key};
use crate::mesh::id::{Face, FaceId, Id, IdVec, Vertex, VertexId};
use crate::mesh::surface::Surface;

/// From a number in the workshop to the number in the surface; `None` for elements that are gone.
pub struct Renumbering<K> {
    new_of: IdVec<K, u32>,
}

impl<K> std::fmt::Debug for Renumbering<K> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Renumbering").field("slots", &self.new_of.len()).finish()
    }
}

impl<K> Renumbering<K> {
    /// Numbers the live elements in order.
    fn new(live: impl Iterator<Item = bool>) -> Self {
        let mut count = 0;
        let new_of = live
            .map(|is_live| {
                let new = if is_live { count } else { NONE };
                count += u32::from(is_live);
                new
            })
            .collect();
        Self { new_of }
    }

    /// The new number of an old element.
    #[inline]
    pub fn get(&self, old: Id<K>) -> Option<Id<K>> {
        self.new_of.get(old).copied().filter(|&new| new != NONE).map(Id::from_raw)
    }
}

/// What comes out of the workshop.
#[derive(Debug)]
pub struct Left {
    /// The surface, without fields.
    pub surface: Surface,
    /// From the workshop's vertices to the surface's.
    pub vertices: Renumbering<Vertex>,
    /// From the workshop's faces to the surface's.
    pub faces: Renumbering<Face>,
}

impl HalfedgeMesh {
    /// Leaves the workshop: compacts the mesh and gives its groups, regions, marks, pins and seams back.
    pub fn leave(self) -> Left {
        let vertices = Renumbering::new(self.vertex_halfedge.iter().map(|&h| h != NONE));
        let faces = Renumbering::new(self.face_halfedge.iter().map(|&h| h != NONE));
        let mut surface = Surface {
            points: self.vertices().map(|v| self.points[v]).collect(),
            faces: self.faces().map(|f| self.corners(f).map(|v| map(&vertices, v))).collect(),
            carried: Carried::default(),
        };
        surface.carried = self.carried(&vertices, &faces);
        Left { surface, vertices, faces }
    }

    fn carried(&self, vertices: &Renumbering<Vertex>, faces: &Renumbering<Face>) -> Carried {
        let mut carried = Carried { groups: self.groups(vertices, faces), ..Carried::default() };
        carried.regions = self.regions();
        for e in self.edges() {
            if let Some(mark) = self.edge_mark(e) {
                let [a, b] = self.ends(e).map(|v| map(vertices, v));
                carried.marks.insert(edge_key(a, b), mark);
            }
        }
        let survivors = |v: &VertexId| vertices.get(*v);
        carried.pins = self.pins.iter().filter_map(|(v, &pin)| Some((survivors(v)?, pin))).collect();
        carried.seams = self.seams.iter().filter_map(|(v, seam)| Some((survivors(&v)?, seam))).collect();
        carried
    }

    fn groups(&self, vertices: &Renumbering<Vertex>, faces: &Renumbering<Face>) -> Groups {
        let names = &self.names;
        let mut face_sets = vec![Vec::new(); names.face_groups.len()];
        for f in self.faces() {
            for &label in self.face_classes.labels(self.face_class[f]) {
                if let (Some(set), Some(new)) = (face_sets.get_mut(label as usize), faces.get(f)) {
                    set.push(new);
                }
            }
        }
        let mut edge_sets = vec![Vec::new(); names.edge_groups.len()];
        for e in self.edges() {
            for &label in self.edge_classes.labels(self.edge_class[e]) {
                let [a, b] = self.ends(e).map(|v| map(vertices, v));
                edge_sets[label as usize].push(edge_key(a, b));
            }
        }
        for set in &mut edge_sets {
            set.sort_unstable();
        }
        let mut vertex_sets = vec![Vec::new(); names.vertex_groups.len()];
        for v in self.vertices() {
            for &label in self.vertex_classes.labels(self.vertex_class[v]) {
                vertex_sets[label as usize].push(map(vertices, v));
            }
        }
        Groups {
            faces: named(&names.face_groups, face_sets),
            edges: named(&names.edge_groups, edge_sets),
            vertices: named(&names.vertex_groups, vertex_sets),
        }
    }

    fn regions(&self) -> Option<Regions> {
        let names = self.names.regions.clone()?;
        let first = self.names.face_groups.len() as u32;
        let label = |f: FaceId| {
            let labels = self.face_classes.labels(self.face_class[f]);
            labels.last().map_or(0, |&last| last.saturating_sub(first))
        };
        Some(Regions { labels: self.faces().map(label).collect(), names })
    }
}

/// The new number of a vertex that a live element uses; such a vertex is live.
fn map(vertices: &Renumbering<Vertex>, v: VertexId) -> VertexId {
    vertices.get(v).unwrap_or(VertexId::from_raw(NONE))
}

fn named<T>(names: &[String], sets: Vec<Vec<T>>) -> BTreeMap<String, Vec<T>> {
    names.iter().cloned().zip(sets).collect()
}
