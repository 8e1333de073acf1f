//! Collects points and faces with all checks: what readers of formats with vertex numbers build a soup with.

use std::collections::BTreeMap;
use std::ops::Range;

use glam::DVec3;

use super::error::{FormatError, Place, Reason};
use super::polygon::triangulate;
use super::{ReadCounts, ReadResult};
use crate::mesh::{Carried, FaceId, Facet, Soup, VertexId, edge_key};

/// Ear clipping is quadratic at worst; no exporter writes rounder faces.
const MOST_CORNERS: usize = 1 << 16;
/// Memberships a face may have on average; a hostile file could name every face in every of its groups.
pub(super) const MOST_GROUPS: usize = 64;

/// A soup in the making.
#[derive(Debug, Default)]
pub(super) struct Builder {
    points: Vec<DVec3>,
    faces: Vec<Facet>,
    /// What the mesh carries so far.
    pub(super) carried: Carried,
    /// What was done besides reading.
    pub(super) counts: ReadCounts,
}

impl Builder {
    /// A builder with room for that many elements; the counts must have been claimed from the file's size.
    pub(super) fn new(points: usize, faces: usize) -> Self {
        Self { points: Vec::with_capacity(points), faces: Vec::with_capacity(faces), ..Self::default() }
    }

    /// How many points there are.
    pub(super) fn points(&self) -> usize {
        self.points.len()
    }

    /// How many faces there are.
    pub(super) fn faces(&self) -> usize {
        self.faces.len()
    }

    /// Adds a point with finite coordinates.
    #[inline]
    pub(super) fn point(&mut self, position: DVec3, place: Place) -> Result<(), FormatError> {
        if self.points.len() >= u32::MAX as usize {
            let limit = u64::from(u32::MAX);
            return Err(FormatError::new(place, Reason::TooMany { what: "vertices", limit }));
        }
        self.points.push(position);
        Ok(())
    }

    /// The vertex with this number, counted from `first`.
    #[inline]
    pub(super) fn vertex(&self, number: i64, first: i64, place: Place) -> Result<VertexId, FormatError> {
        match usize::try_from(number.saturating_sub(first)) {
            Ok(index) if index < self.points.len() => Ok(VertexId::new(index)),
            _ => Err(out_of_range(number, self.points.len(), place)),
        }
    }

    /// Adds a face with corners in range, and says which faces of the soup came of it: none when it has fewer than
    /// three corners, several when it has more than four.
    pub(super) fn face(&mut self, corners: &[VertexId], place: Place) -> Result<Range<usize>, FormatError> {
        let first = self.faces.len();
        match *corners {
            [] | [_] | [_, _] => self.counts.faces_dropped += 1,
            [a, b, c] => self.faces.push(Facet::Tri([a, b, c])),
            [a, b, c, d] => self.faces.push(Facet::Quad([a, b, c, d])),
            _ if corners.len() > MOST_CORNERS => {
                let reason = Reason::TooMany { what: "corners in one face", limit: MOST_CORNERS as u64 };
                return Err(FormatError::new(place, reason));
            }
            _ => {
                self.faces.extend(triangulate(&self.points, corners).into_iter().map(Facet::Tri));
                self.counts.polygons_triangulated += 1;
            }
        }
        if self.faces.len() > u32::MAX as usize {
            let limit = u64::from(u32::MAX);
            return Err(FormatError::new(place, Reason::TooMany { what: "faces", limit }));
        }
        Ok(first..self.faces.len())
    }

    /// The soup, groups sorted and without empty ones; refused when it has no face.
    pub(super) fn finish(mut self) -> ReadResult {
        if self.faces.is_empty() {
            return Err(FormatError::new(Place::File, Reason::Nothing("faces"))
                .with_remedy("point clouds and curves are not surfaces: export a mesh with faces"));
        }
        let groups = &mut self.carried.groups;
        tidy(&mut groups.faces);
        tidy(&mut groups.edges);
        tidy(&mut groups.vertices);
        Ok((Soup { points: self.points.into(), faces: self.faces.into(), carried: self.carried }, self.counts))
    }

    /// Adds faces to a group.
    pub(super) fn group_faces(&mut self, name: &str, faces: Range<usize>) {
        self.carried.groups.faces.entry(name.to_owned()).or_default().extend(faces.map(FaceId::new));
    }

    /// Adds an edge to a group, unless its ends are the same vertex.
    pub(super) fn group_edge(&mut self, name: &str, a: VertexId, b: VertexId) {
        if a != b {
            self.carried.groups.edges.entry(name.to_owned()).or_default().push(edge_key(a, b));
        }
    }

    /// Adds a vertex to a group.
    pub(super) fn group_vertex(&mut self, name: &str, vertex: VertexId) {
        self.carried.groups.vertices.entry(name.to_owned()).or_default().push(vertex);
    }
}

fn tidy<T: Ord>(groups: &mut BTreeMap<String, Vec<T>>) {
    groups.retain(|_, members| !members.is_empty());
    for members in groups.values_mut() {
        members.sort_unstable();
        members.dedup();
    }
}

/// The error for a vertex number that points at no vertex.
#[cold]
pub(super) fn out_of_range(number: i64, count: usize, place: Place) -> FormatError {
    FormatError::new(place, Reason::OutOfRange { what: "vertex", index: number, count: count as u64 })
        .with_remedy("the face points at a vertex that the file does not have: export it again")
}
