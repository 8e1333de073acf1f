//! Angles between faces, and the angle that is usual between facets.

use glam::DVec3;

use crate::mesh::geometry::{Aabb, angle, side_lengths, triangle_area, triangle_normal};
use crate::mesh::id::{Edge, Face};
use crate::mesh::topology::EdgeTable;
use crate::mesh::{EdgeId, FaceId, IdVec, Surface};

/// A face lower than this share of the diagonal has no reliable normal: coordinates of binary STL files have 24 bits,
/// so a tenth of such a height is rounding.
const LEAST_HEIGHT: f64 = 1e-6;

/// The angle between the normals at each edge in degrees; 0 on rims.
pub(super) fn angles(edges: &EdgeTable, normals: &IdVec<Face, DVec3>) -> IdVec<Edge, f64> {
    let at = |e: EdgeId| match edges.sides(e) {
        [a, b] => angle(normals[a.face], normals[b.face]).to_degrees(),
        _ => 0.0,
    };
    edges.keys().ids().map(at).collect()
}

/// The normals of the faces; a face without a reliable one takes that of its neighbour over its longest side.
pub fn normals(surface: &Surface, edges: &EdgeTable) -> IdVec<Face, DVec3> {
    let least = LEAST_HEIGHT * Aabb::of(surface.points.iter().copied()).diagonal();
    let own = |f: FaceId| {
        let corners = surface.corners(f);
        let longest = side_lengths(corners).into_iter().fold(0.0, f64::max);
        let height = if longest > 0.0 { 2.0 * triangle_area(corners) / longest } else { 0.0 };
        if height > least { triangle_normal(corners) } else { None }
    };
    let mut normals: IdVec<Face, Option<DVec3>> = surface.faces.ids().map(own).collect();
    let mut waiting: Vec<FaceId> = normals.ids().filter(|&f| normals[f].is_none()).collect();
    if waiting.is_empty() {
        return normals.into_iter().map(|n| n.unwrap_or(DVec3::ZERO)).collect();
    }
    let sides = edges.edges_of_triangles(surface.faces.len());
    loop {
        let before = waiting.len();
        let found: Vec<(FaceId, DVec3)> =
            waiting.iter().filter_map(|&f| Some((f, inherited(surface, edges, sides[f], f, &normals)?))).collect();
        for (f, normal) in found {
            normals[f] = Some(normal);
        }
        waiting.retain(|&f| normals[f].is_none());
        if waiting.is_empty() || waiting.len() == before {
            return normals.into_iter().map(|n| n.unwrap_or(DVec3::ZERO)).collect();
        }
    }
}

/// The normal beyond the longest side behind which there is one.
fn inherited(
    surface: &Surface,
    edges: &EdgeTable,
    mut sides: [EdgeId; 3],
    face: FaceId,
    normals: &IdVec<Face, Option<DVec3>>,
) -> Option<DVec3> {
    let length = |e: EdgeId| {
        let [a, b] = edges.key(e);
        surface.points[a].distance_squared(surface.points[b])
    };
    sides.sort_by(|&a, &b| length(b).total_cmp(&length(a)).then(a.cmp(&b)));
    let beyond = sides.into_iter().flat_map(|e| edges.sides(e)).map(|side| side.face).filter(|&f| f != face);
    beyond.map(|f| normals[f]).find(Option::is_some).flatten()
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
