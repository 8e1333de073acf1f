//! T-junctions: an open vertex that lies beside an open edge becomes part of it, so that both sides of a crack match.

use glam::DVec3;

use super::adjacency::{EdgeTable, apex, corner_of, face_of, head, tail};
use super::draft::Draft;
use super::weld::open_vertices;
use crate::mesh::bvh::SegmentBvh;
use crate::mesh::geometry::Aabb;
use crate::mesh::{HalfedgeId, VertexId, edge_key};

/// What was closed.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Closed {
    /// Vertices put on an edge.
    pub(super) vertices: u64,
    /// The largest distance of one from its edge: how far the surface moved.
    pub(super) distance: f64,
}

/// Puts every open vertex within `tolerance` of the inside of an open edge on that edge; the face there becomes a fan.
pub(super) fn close_t_junctions(draft: &mut Draft, table: &EdgeTable, tolerance: f64) -> Closed {
    let open: Vec<HalfedgeId> =
        table.edges().filter(|(_, _, group)| group.len() == 1).map(|(_, _, group)| group[0].1).collect();
    let hits = junctions(draft, table, &open, tolerance);
    let distance = hits.iter().map(|hit| hit.distance).fold(0.0, f64::max);
    Closed { vertices: split_edges(draft, hits), distance }
}

/// Puts vertices on open edges; the face at each becomes a fan. Returns how many there are.
pub(super) fn split_edges(draft: &mut Draft, mut hits: Vec<Hit>) -> u64 {
    hits.sort_by(|a, b| face_of(a.edge).cmp(&face_of(b.edge)).then(a.edge.cmp(&b.edge)).then(a.at.total_cmp(&b.at)));
    let mut keep = vec![true; draft.faces.len()];
    for at_face in hits.chunk_by(|a, b| face_of(a.edge) == face_of(b.edge)) {
        let face = face_of(at_face[0].edge);
        let mut sides: [Vec<VertexId>; 3] = Default::default();
        for hit in at_face {
            let side = &mut sides[corner_of(hit.edge)];
            let from = side.last().copied().unwrap_or(tail(&draft.faces, hit.edge));
            let rest = edge_key(from, head(&draft.faces, hit.edge));
            draft.splits.entry(rest).or_default().push(hit.vertex);
            side.push(hit.vertex);
        }
        keep[face.index()] = false;
        let (corners, origin) = (draft.faces[face], draft.origin[face]);
        for triangle in fans(corners, sides) {
            draft.push_face(triangle, origin);
            keep.push(true);
        }
    }
    if !hits.is_empty() {
        draft.retain_faces(&keep);
    }
    hits.len() as u64
}

/// A vertex beside an edge.
pub(super) struct Hit {
    /// The edge.
    pub(super) edge: HalfedgeId,
    /// Where along the edge, from 0 to 1.
    pub(super) at: f64,
    /// The vertex.
    pub(super) vertex: VertexId,
    /// How far the surface moves.
    pub(super) distance: f64,
}

fn junctions(draft: &Draft, table: &EdgeTable, open: &[HalfedgeId], tolerance: f64) -> Vec<Hit> {
    let mut hits = Vec::new();
    if open.is_empty() || tolerance <= 0.0 {
        return hits;
    }
    let segment = |h: &HalfedgeId| [tail(&draft.faces, *h), head(&draft.faces, *h)].map(|v| draft.points[v]);
    let bvh = SegmentBvh::new(open.iter().map(segment).collect());
    let is_open = open_vertices(draft, table);
    for v in is_open.ids().filter(|&v| is_open[v]) {
        let point = draft.points[v];
        for index in bvh.in_box(&Aabb::of([point]).grown(tolerance)) {
            let edge = open[index as usize];
            if draft.faces[face_of(edge)].contains(&v) {
                continue;
            }
            let hit = beside(segment(&edge), point, tolerance);
            let near_apex = point.distance(draft.points[apex(&draft.faces, edge)]) <= tolerance;
            if let (Some((at, distance)), false) = (hit, near_apex) {
                hits.push(Hit { edge, at, vertex: v, distance });
            }
        }
    }
    hits
}

/// Where along the segment the point lies, and how far from it; `None` near the ends, where welding is to decide.
fn beside([a, b]: [DVec3; 2], point: DVec3, tolerance: f64) -> Option<(f64, f64)> {
    let along = b - a;
    let at = (point - a).dot(along) / along.length_squared();
    let distance = point.distance(a + at * along);
    let is_inside = at > 0.0 && at < 1.0 && point.distance(a) > tolerance && point.distance(b) > tolerance;
    (is_inside && distance <= tolerance).then_some((at, distance))
}

/// Triangles of a face whose sides have further vertices: a fan from the corner across the first such side, and so on.
fn fans(corners: [VertexId; 3], sides: [Vec<VertexId>; 3]) -> Vec<[VertexId; 3]> {
    let Some(first) = sides.iter().position(|side| !side.is_empty()) else {
        return vec![corners];
    };
    let [a, b, c] = [0, 1, 2].map(|i| corners[(first + i) % 3]);
    let [mut on_ab, mut on_bc, mut on_ca] = [0, 1, 2].map(|i| sides[(first + i) % 3].clone());
    on_ab.insert(0, a);
    on_ab.push(b);
    let last = on_ab.len() - 2;
    let mut triangles = Vec::new();
    for (i, pair) in on_ab.windows(2).enumerate() {
        // Only the outer triangles of the fan have the other two sides of the face.
        let on_next = if i == last { std::mem::take(&mut on_bc) } else { Vec::new() };
        let on_previous = if i == 0 { std::mem::take(&mut on_ca) } else { Vec::new() };
        triangles.extend(fans([pair[0], pair[1], c], [Vec::new(), on_next, on_previous]));
    }
    triangles
}
