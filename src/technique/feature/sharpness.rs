//! Angles between faces, and the angle that is usual between facets.

use glam::DVec3;
use petgraph::unionfind::UnionFind;

use crate::mesh::geometry::{Aabb, angle, side_lengths, triangle_area, triangle_normal};
use crate::mesh::id::{Edge, Face};
use crate::mesh::topology::EdgeTable;
use crate::mesh::{EdgeId, FaceId, IdVec, Surface};

/// A face lower than this share of the diagonal has no reliable normal: coordinates of binary STL files have 24 bits,
/// so of a face ten times lower still all is rounding, and nothing that low is a part's shape.
const LEAST_HEIGHT: f64 = 1e-5;

/// The angle between the normals at each edge in degrees; 0 on rims.
pub(super) fn angles(edges: &EdgeTable, normals: &IdVec<Face, DVec3>) -> IdVec<Edge, f64> {
    let at = |e: EdgeId| match edges.sides(e) {
        [a, b] => angle(normals[a.face], normals[b.face]).to_degrees(),
        _ => 0.0,
    };
    edges.keys().ids().map(at).collect()
}

/// The normals of the faces. Faces without a reliable one that lie at each other's longest sides are one sliver, and
/// take the normal of the neighbour over the longest side of that.
pub fn normals(surface: &Surface, edges: &EdgeTable) -> IdVec<Face, DVec3> {
    let least = LEAST_HEIGHT * Aabb::of(surface.points.iter().copied()).diagonal();
    let own = |f: FaceId| {
        let corners = surface.corners(f);
        let longest = side_lengths(corners).into_iter().fold(0.0, f64::max);
        let height = if longest > 0.0 { 2.0 * triangle_area(corners) / longest } else { 0.0 };
        if height > least { triangle_normal(corners) } else { None }
    };
    let mut normals: IdVec<Face, Option<DVec3>> = surface.faces.ids().map(own).collect();
    let mut waiting = slivers(surface, edges, &normals);
    loop {
        let before = waiting.len();
        let found: Vec<Option<DVec3>> = waiting.iter().map(|sliver| sliver.beside(edges, &normals)).collect();
        for (sliver, normal) in waiting.iter().zip(&found) {
            for &f in &sliver.faces {
                normals[f] = *normal;
            }
        }
        let mut left = found.iter().map(Option::is_none);
        waiting.retain(|_| left.next().unwrap_or(false));
        if waiting.is_empty() || waiting.len() == before {
            return normals.into_iter().map(|n| n.unwrap_or(DVec3::ZERO)).collect();
        }
    }
}

/// Faces without a normal of their own that are one sliver.
#[derive(Debug, Default)]
struct Sliver {
    faces: Vec<FaceId>,
    /// The sides of all of them, the longest first.
    sides: Vec<EdgeId>,
}

impl Sliver {
    /// The normal beyond the longest side behind which there is one.
    fn beside(&self, edges: &EdgeTable, normals: &IdVec<Face, Option<DVec3>>) -> Option<DVec3> {
        self.sides.iter().flat_map(|&e| edges.sides(e)).find_map(|side| normals[side.face])
    }
}

/// The slivers among the faces without a normal, each in the order of its first face.
fn slivers(surface: &Surface, edges: &EdgeTable, normals: &IdVec<Face, Option<DVec3>>) -> Vec<Sliver> {
    let low: Vec<FaceId> = normals.ids().filter(|&f| normals[f].is_none()).collect();
    if low.is_empty() {
        return Vec::new();
    }
    let of_face = edges.edges_of_triangles(surface.faces.len());
    let length = |e: EdgeId| {
        let [a, b] = edges.key(e);
        surface.points[a].distance_squared(surface.points[b])
    };
    let longest_first = |sides: &mut [EdgeId]| sides.sort_by(|&a, &b| length(b).total_cmp(&length(a)).then(a.cmp(&b)));
    let mut same: UnionFind<usize> = UnionFind::new(low.len());
    for (place, &f) in low.iter().enumerate() {
        let mut sides = of_face[f];
        longest_first(&mut sides);
        for beyond in edges.sides(sides[0]).iter().filter_map(|side| low.binary_search(&side.face).ok()) {
            same.union(place, beyond);
        }
    }
    let mut place_of = vec![usize::MAX; low.len()];
    let mut slivers: Vec<Sliver> = Vec::new();
    for (place, &f) in low.iter().enumerate() {
        let known = &mut place_of[same.find(place)];
        if *known == usize::MAX {
            *known = slivers.len();
            slivers.push(Sliver::default());
        }
        slivers[*known].faces.push(f);
        slivers[*known].sides.extend(of_face[f]);
    }
    for sliver in &mut slivers {
        longest_first(&mut sliver.sides);
    }
    slivers
}

/// The most frequent angle between 3 degrees and `below`, to half a degree, where at least 12 edges agree on it and
/// they are at least a tenth of the edges in that range.
pub(super) fn facet_angle(angles: &[f64], below: f64) -> Option<f64> {
    let mut bins = [0_usize; 361];
    for angle in angles.iter().filter(|a| **a >= 3.0 && **a < below) {
        bins[((angle * 2.0).round() as usize).min(360)] += 1;
    }
    let total: usize = bins.iter().sum();
    let mut best = 0;
    for (bin, count) in bins.iter().enumerate() {
        if *count > bins[best] {
            best = bin;
        }
    }
    (bins[best] >= 12 && bins[best] * 10 >= total).then_some(best as f64 / 2.0)
}
