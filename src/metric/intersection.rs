//! Self-intersections: which faces meet where they should not, decided exactly.
//!
//! Quads are cut on the shorter diagonal. Two faces count when they meet outside the corners and the edge that they
//! share, where corners with equal coordinates are shared. Faces without area and duplicates are left to their own
//! metrics. Candidates come from a hierarchy of boxes; every face asks for those with higher numbers, in parallel, so
//! that the order of the answer is the order of faces.

use std::ops::ControlFlow;

use glam::DVec3;
use rayon::prelude::*;

use crate::mesh::bvh::{Primitive, TriangleBvh};
use crate::mesh::predicate::{Meeting, triangle_triangle};
use crate::mesh::{FaceId, Facet, Soup, VertexId};
use crate::watch::{Cancelled, Watch};

/// All faces as triangles, each with the face that it comes from.
#[derive(Clone, Debug, Default)]
pub struct Triangulated {
    /// The corners of each triangle.
    pub corners: Vec<[VertexId; 3]>,
    /// The face of each triangle.
    pub origin: Vec<FaceId>,
}

impl Triangulated {
    /// The triangles' coordinates.
    pub fn coordinates(&self, mesh: &Soup) -> Vec<[DVec3; 3]> {
        self.corners.iter().map(|t| t.map(|v| mesh.points[v])).collect()
    }
}

/// Cuts quads on the shorter diagonal and leaves out triangles with a corner twice.
pub fn triangulated(mesh: &Soup) -> Triangulated {
    let mut out = Triangulated::default();
    for (id, face) in mesh.faces.enumerate() {
        let mut push = |[a, b, c]: [VertexId; 3]| {
            if a != b && b != c && c != a {
                out.corners.push([a, b, c]);
                out.origin.push(id);
            }
        };
        match *face {
            Facet::Tri(corners) => push(corners),
            Facet::Quad([a, b, c, d]) => {
                let length = |v, w| (mesh.points[v] - mesh.points[w]).length();
                if length(a, c) <= length(b, d) {
                    push([a, b, c]);
                    push([a, c, d]);
                } else {
                    push([a, b, d]);
                    push([b, c, d]);
                }
            }
        }
    }
    out
}

/// Pairs of faces that intersect, the smaller id first, in order.
pub fn self_intersections(mesh: &Soup, watch: &Watch) -> Result<Vec<(FaceId, FaceId, Meeting)>, Cancelled> {
    let cut = triangulated(mesh);
    let (triangles, origin) = (cut.coordinates(mesh), cut.origin);
    let bvh = TriangleBvh::new(triangles.clone());
    let pairs: Vec<Vec<(FaceId, FaceId, Meeting)>> = (0..triangles.len())
        .into_par_iter()
        .map(|i| {
            let mut found = Vec::new();
            if i % 256 == 0 && watch.is_cancelled() {
                return found;
            }
            let _ = bvh.for_each_in(&triangles[i].bounds(), |j, other| {
                if j as usize > i && origin[i] != origin[j as usize] {
                    let meeting = triangle_triangle(triangles[i], *other);
                    if meeting.is_intersection() {
                        found.push((origin[i], origin[j as usize], meeting));
                    }
                }
                ControlFlow::Continue(())
            });
            found
        })
        .collect();
    watch.check()?;
    let mut pairs: Vec<_> = pairs.into_iter().flatten().collect();
    pairs.sort_unstable();
    // The two halves of a quad may meet the same face.
    pairs.dedup_by_key(|p| (p.0, p.1));
    Ok(pairs)
}

/// The faces of these pairs, in order.
pub fn faces_of(pairs: &[(FaceId, FaceId, Meeting)]) -> Vec<FaceId> {
    let mut faces: Vec<FaceId> = pairs.iter().flat_map(|&(a, b, _)| [a, b]).collect();
    faces.sort_unstable();
    faces.dedup();
    faces
}
