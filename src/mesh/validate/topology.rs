//! Defects of points, faces, edges and vertices.

use glam::DVec3;

use super::Defect;
use crate::mesh::id::{FaceId, IdVec, Vertex, VertexId};
use crate::mesh::topology::{EdgeTable, Faces, VertexFaces};

pub(super) fn points(points: &IdVec<Vertex, DVec3>, defects: &mut Vec<Defect>) {
    let bad = points.enumerate().filter(|(_, p)| !p.is_finite());
    defects.extend(bad.map(|(vertex, _)| Defect::NonFinitePoint { vertex }));
}

/// Finds what is wrong with faces, edges and vertices. The edges come back if all corners are in range.
pub(super) fn validate(mesh: &impl Faces, defects: &mut Vec<Defect>) -> Option<EdgeTable> {
    if !corners(mesh, defects) {
        return None;
    }
    duplicates(mesh, defects);
    let edges = EdgeTable::new(mesh);
    edge_defects(&edges, defects);
    fans(mesh, defects);
    Some(edges)
}

fn faces_of<M: Faces>(mesh: &M) -> impl Iterator<Item = FaceId> + use<M> {
    (0..mesh.face_count()).map(FaceId::new)
}

/// Whether all corners are in range.
fn corners(mesh: &impl Faces, defects: &mut Vec<Defect>) -> bool {
    let mut in_range = true;
    for face in faces_of(mesh) {
        let corners = mesh.corners(face);
        for &corner in corners.iter().filter(|v| v.index() >= mesh.vertex_count()) {
            in_range = false;
            defects.push(Defect::CornerOutOfRange { face, corner });
        }
        let repeated = corners.iter().enumerate().filter(|(k, v)| corners[..*k].contains(v)).map(|(_, &v)| v);
        if let Some(corner) = repeated.min() {
            defects.push(Defect::RepeatedCorner { face, corner });
        }
    }
    in_range
}

fn duplicates(mesh: &impl Faces, defects: &mut Vec<Defect>) {
    let key = |face| {
        let mut key = [VertexId::from_raw(u32::MAX); 4];
        for (slot, &corner) in key.iter_mut().zip(mesh.corners(face)) {
            *slot = corner;
        }
        key.sort_unstable();
        key
    };
    let mut keyed: Vec<_> = faces_of(mesh).map(|face| (key(face), face)).collect();
    keyed.sort_unstable();
    let mut groups: Vec<Vec<FaceId>> = keyed
        .chunk_by(|a, b| a.0 == b.0)
        .filter(|same| same.len() > 1)
        .map(|same| same.iter().map(|(_, face)| *face).collect())
        .collect();
    groups.sort_unstable();
    defects.extend(groups.into_iter().map(|faces| Defect::DuplicateFaces { faces }));
}

fn edge_defects(edges: &EdgeTable, defects: &mut Vec<Defect>) {
    for (_, ends, sides) in edges.iter() {
        if ends[0] == ends[1] {
            continue;
        }
        match sides {
            [a, b] if a.is_forward == b.is_forward => {
                defects.push(Defect::InconsistentOrientation { ends, faces: [a.face, b.face] });
            }
            [] | [_] | [_, _] => {}
            more => {
                defects.push(Defect::NonManifoldEdge { ends, faces: more.iter().map(|s| s.face).collect() });
            }
        }
    }
}

fn fans(mesh: &impl Faces, defects: &mut Vec<Defect>) {
    let at = VertexFaces::new(mesh);
    let mut spokes: Vec<(VertexId, usize)> = Vec::new();
    for vertex in (0..mesh.vertex_count()).map(VertexId::new) {
        let faces = at.of(vertex);
        if faces.is_empty() {
            defects.push(Defect::UnusedVertex { vertex });
            continue;
        }
        spokes.clear();
        for (k, &face) in faces.iter().enumerate() {
            let corners = mesh.corners(face);
            let n = corners.len();
            for place in (0..n).filter(|&p| corners[p] == vertex) {
                spokes.push((corners[(place + 1) % n], k));
                spokes.push((corners[(place + n - 1) % n], k));
            }
        }
        let fans = count_fans(faces.len(), &mut spokes);
        if fans > 1 {
            defects.push(Defect::NonFanVertex { vertex, fans });
        }
    }
}

/// The number of sets of faces that spokes connect.
fn count_fans(faces: usize, spokes: &mut [(VertexId, usize)]) -> usize {
    let mut parent: Vec<usize> = (0..faces).collect();
    let root = |parent: &mut [usize], mut at: usize| {
        while parent[at] != at {
            parent[at] = parent[parent[at]];
            at = parent[at];
        }
        at
    };
    spokes.sort_unstable();
    let mut fans = faces;
    for pair in spokes.windows(2).filter(|pair| pair[0].0 == pair[1].0) {
        let (a, b) = (root(&mut parent, pair[0].1), root(&mut parent, pair[1].1));
        if a != b {
            parent[a.max(b)] = a.min(b);
            fans -= 1;
        }
    }
    fans
}
