//! Self-intersections: which faces meet where they should not, decided exactly.
//!
//! Quads are cut on the shorter diagonal. Two faces count when they meet outside the corners and the edge that they
//! share, where corners with equal coordinates are shared; those that only touch are told from those that run through
//! each other by what lies round them ([`contact`](crate::mesh::contact)). Faces without area are left to their own
//! metric. Counting stops at [`MOST`] pairs, or where too many boxes overlap to look at each two; the answer says so.

use glam::DVec3;

use crate::mesh::contact::tell_contacts;
pub use crate::mesh::meetings::MOST;
use crate::mesh::meetings::meetings;
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

/// Pairs of faces that intersect.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Intersections {
    /// The pairs, the smaller id first, in order, and how they meet: `Touching` where the surfaces only touch there,
    /// else they run through each other or overlap.
    pub pairs: Vec<(FaceId, FaceId, Meeting)>,
    /// Whether these are all; else there are at least as many.
    pub complete: bool,
    /// Pairs of faces with the same corners; they are not among the others.
    pub coincident: u64,
}

impl Intersections {
    /// The pairs that run through each other or overlap, as if a surface had two sides on one.
    pub fn crossing(&self) -> impl Iterator<Item = &(FaceId, FaceId, Meeting)> {
        self.pairs.iter().filter(|pair| pair.2 != Meeting::Touching)
    }

    /// How many pairs only touch, or have the same corners.
    pub fn contacts(&self) -> u64 {
        self.coincident + (self.pairs.len() - self.crossing().count()) as u64
    }
}

/// Pairs of faces that intersect.
pub fn self_intersections(mesh: &Soup, watch: &Watch) -> Result<Intersections, Cancelled> {
    let cut = triangulated(mesh);
    let mut found = meetings(&cut.coordinates(mesh), triangle_triangle, watch)?;
    tell_contacts(&cut.corners, |v| mesh.points[v], &mut found.pairs);
    let of = |(i, j, meeting): (u32, u32, Meeting)| (cut.origin[i as usize], cut.origin[j as usize], meeting);
    let mut pairs: Vec<_> = found.pairs.into_iter().map(of).filter(|(a, b, _)| a != b).collect();
    // The two halves of a quad may meet the same face: what is more than a touch comes first.
    pairs.sort_unstable_by_key(|&(a, b, meeting)| (a, b, std::cmp::Reverse(meeting)));
    pairs.dedup_by_key(|p| (p.0, p.1));
    let coincident = coincident(mesh, &cut, &found.copies);
    Ok(Intersections { pairs, complete: found.complete, coincident })
}

/// Pairs of faces with the same corners; of quads each half stands for half a pair.
fn coincident(mesh: &Soup, cut: &Triangulated, copies: &[Vec<u32>]) -> u64 {
    let halves = |same: &Vec<u32>| {
        let is_whole = |&&t: &&u32| matches!(mesh.faces[cut.origin[t as usize]], Facet::Tri(_));
        let whole = same.iter().filter(is_whole).count() as u64;
        let half = same.len() as u64 - whole;
        whole * whole.saturating_sub(1) + half * half.saturating_sub(1) / 2 + 2 * whole * half
    };
    copies.iter().map(halves).sum::<u64>() / 2
}

/// The faces of these pairs, in order.
pub fn faces_of<'a>(pairs: impl IntoIterator<Item = &'a (FaceId, FaceId, Meeting)>) -> Vec<FaceId> {
    let mut faces: Vec<FaceId> = pairs.into_iter().flat_map(|&(a, b, _)| [a, b]).collect();
    faces.sort_unstable();
    faces.dedup();
    faces
}
