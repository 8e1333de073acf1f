//! Which elements are to blame for a metric of the whole mesh, and which faces are excused.

use std::collections::BTreeSet;

use super::super::Subject;
use super::super::intersection::faces_of;
use super::super::registry::{LOW_SCALED_JACOBIAN, LOW_STRETCH};
use super::super::shape::angle_of_stretch;
use super::column::fault_at;
use super::{Cause, Fault, FaultKind};
use crate::mesh::predicate::Meeting;
use crate::mesh::{EdgeKey, FaceId, Facet, Soup, VertexId, edge_key, geometry};

/// The elements at fault for a count, a share or a property of the whole mesh; empty where there are none to name.
pub(super) fn of_whole(subject: &Subject<'_>, name: &str) -> Vec<Fault> {
    let mesh = subject.mesh();
    let topology = subject.topology();
    let faces = |ids: Vec<FaceId>| -> Vec<Fault> {
        ids.into_iter().map(|f| fault_at(mesh, FaultKind::Face, f.raw(), 1.0)).collect()
    };
    let at_edges = |edges: &[(EdgeKey, FaceId)]| -> Vec<Fault> {
        let mut ids: Vec<FaceId> = edges.iter().map(|(_, face)| *face).collect();
        ids.sort_unstable();
        ids.dedup();
        faces(ids)
    };
    let vertices = |ids: &mut dyn Iterator<Item = u32>| -> Vec<Fault> {
        ids.map(|v| fault_at(mesh, FaultKind::Vertex, v, f64::from(topology.valence[v as usize]))).collect()
    };
    let bad_vertices = || vertices(&mut topology.non_manifold_vertices.iter().map(|v| v.raw()));
    match name {
        "boundary-edges" | "boundary-loops" => at_edges(&topology.boundary),
        "closed" => [at_edges(&topology.boundary), at_edges(&topology.non_manifold_edges)].concat(),
        "edge-manifold" | "non-manifold-edges" => at_edges(&topology.non_manifold_edges),
        "manifold" => [at_edges(&topology.non_manifold_edges), bad_vertices()].concat(),
        "vertex-manifold" | "non-manifold-vertices" => bad_vertices(),
        "oriented" | "inconsistent-edges" => {
            [at_edges(&topology.inconsistent), at_edges(&topology.non_manifold_edges)].concat()
        }
        "duplicate-faces" => faces(topology.duplicates.clone()),
        "repeated-vertex-faces" => faces(topology.repeated.clone()),
        "degenerate-faces" => faces(subject.degenerate()),
        "self-intersections" | "self-intersecting-faces" => faces(faces_of(subject.intersections().crossing())),
        "contacts" => {
            let pairs = subject.intersections().pairs.iter();
            faces(faces_of(pairs.filter(|pair| pair.2 == Meeting::Touching)))
        }
        "irregular-vertices" | "irregular-share" => {
            vertices(&mut subject.inner_and_irregular().1.into_iter().map(|v| v as u32))
        }
        "low-stretch-faces" | "low-stretch-share" => {
            let shapes = subject.triangles();
            let low = shapes.faces.iter().zip(&shapes.stretch).filter(|(_, s)| **s < LOW_STRETCH);
            low.map(|(f, s)| fault_at(mesh, FaultKind::Face, f.raw(), *s)).collect()
        }
        "inverted-quads" | "low-scaled-jacobian-share" => {
            let limit = if name == "inverted-quads" { 0.0_f64.next_up() } else { LOW_SCALED_JACOBIAN };
            let quads = subject.quads();
            let low = quads.faces.iter().zip(&quads.shapes).filter(|(_, q)| q.scaled_jacobian < limit);
            low.map(|(f, q)| fault_at(mesh, FaultKind::Face, f.raw(), q.scaled_jacobian)).collect()
        }
        _ => Vec::new(),
    }
}

/// The faces of these groups.
pub(super) fn members(mesh: &Soup, groups: &[String]) -> BTreeSet<u32> {
    let mut faces = BTreeSet::new();
    for name in groups {
        faces.extend(mesh.carried.groups.faces.get(name).into_iter().flatten().map(|f| f.raw()));
        if let Some(regions) = &mesh.carried.regions {
            let in_region = |label: u32| regions.names.get(label as usize).is_some_and(|region| region == name);
            faces.extend(regions.labels.enumerate().filter(|(_, label)| in_region(**label)).map(|(f, _)| f.raw()));
        }
    }
    faces
}

/// Whether no triangle at this place can reach the stretch: two marked edges meet at a corner of the face, at an angle
/// below that which the stretch needs. Only the marks can change that, and marks are kept.
pub(super) fn is_excused(mesh: &Soup, face: FaceId, angle_needed: f64) -> bool {
    let Some(Facet::Tri(corners)) = mesh.faces.get(face) else { return false };
    let is_marked = |i: usize, j: usize| mesh.carried.marks.contains_key(&edge_key(corners[i], corners[j]));
    let angles = geometry::triangle_angles(corners.map(|v| mesh.points[v]));
    (0..3).any(|i| {
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        is_marked(i, j) && is_marked(i, k) && angles[i] < angle_needed
    })
}

/// Where more than half of some faces lie in relation to the marked edges.
pub(super) fn cause(mesh: &Soup, faces: impl Iterator<Item = FaceId>) -> Option<Cause> {
    let marks = &mesh.carried.marks;
    let on_curve: BTreeSet<VertexId> = marks.keys().flatten().copied().collect();
    let (mut all, mut between, mut at) = (0_u64, 0_u64, 0_u64);
    for face in faces {
        all += 1;
        let Some(facet) = mesh.faces.get(face) else { continue };
        let corners = facet.corners();
        let sides = (0..corners.len()).map(|i| edge_key(corners[i], corners[(i + 1) % corners.len()]));
        match sides.filter(|side| marks.contains_key(side)).count() {
            0 | 1 => between += u64::from(corners.iter().all(|v| on_curve.contains(v))),
            _ => at += 1,
        }
    }
    match (2 * between > all, 2 * at > all) {
        (true, _) => Some(Cause::BetweenCurves(between)),
        (false, true) => Some(Cause::AtCurves(at)),
        (false, false) => None,
    }
}

/// The angle that [`is_excused`] needs for a stretch.
pub(super) fn angle_needed(stretch: f64) -> f64 {
    angle_of_stretch(stretch)
}
