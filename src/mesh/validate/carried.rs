//! Defects of groups, regions, fields, marks, pins, seams and curves.

use std::collections::BTreeMap;

use super::{Defect, GroupKind};
use crate::mesh::carried::{Carried, Groups, Support, SurfacePoint};
use crate::mesh::id::FaceId;
use crate::mesh::topology::{EdgeTable, Faces, VertexFaces};

/// Without `edges`, because corners are out of range, marks and edge groups are not looked up.
pub(super) fn validate(carried: &Carried, mesh: &impl Faces, edges: Option<&EdgeTable>, defects: &mut Vec<Defect>) {
    groups(&carried.groups, mesh, edges, defects);
    regions(carried, mesh.face_count(), defects);
    fields(carried, mesh, defects);
    if let Some(edges) = edges {
        let lost = carried.marks.keys().filter(|key| edges.find(**key).is_none());
        defects.extend(lost.map(|&ends| Defect::MarkWithoutEdge { ends }));
    }
    if let Some(edges) = edges {
        curves(carried, mesh, edges, defects);
    }
    let missing = carried.pins.keys().filter(|v| v.index() >= mesh.vertex_count());
    defects.extend(missing.map(|&vertex| Defect::PinWithoutVertex { vertex }));
    let mut partners = BTreeMap::new();
    for (v, seam) in carried.seams.iter().filter(|(v, _)| v.index() < mesh.vertex_count()) {
        partners.entry(*seam).or_insert_with(Vec::new).push(*v);
    }
    let alone = |(v, seam): &(&_, &_)| partners.get(*seam).is_none_or(|p: &Vec<_>| p.len() < 2 || !p.contains(*v));
    let lonely = carried.seams.iter().filter(alone);
    defects.extend(lonely.map(|(&vertex, &seam)| Defect::SeamWithoutPartner { vertex, seam }));
}

fn curves(carried: &Carried, mesh: &impl Faces, edges: &EdgeTable, defects: &mut Vec<Defect>) {
    if carried.curves.is_empty() {
        return;
    }
    let at = VertexFaces::new(mesh);
    let faces = |point: &SurfacePoint| match *point {
        SurfacePoint::Vertex(v) if v.index() < mesh.vertex_count() => Some(at.of(v).to_vec()),
        SurfacePoint::Edge { edge, t } if t > 0.0 && t < 1.0 => {
            edges.find(edge).map(|e| edges.sides(e).iter().map(|side| side.face).collect())
        }
        SurfacePoint::Vertex(_) | SurfacePoint::Edge { .. } => None,
    };
    for (curve, polyline) in carried.curves.iter().enumerate() {
        let of: Vec<Option<Vec<FaceId>>> = polyline.points.iter().map(faces).collect();
        for (point, here) in of.iter().enumerate() {
            let next = if point + 1 < of.len() { of.get(point + 1) } else { of.first().filter(|_| polyline.is_closed) };
            match (here, next) {
                (None, _) => defects.push(Defect::CurveOffTheSurface { curve, point }),
                (Some(here), Some(Some(next))) if !here.iter().any(|f| next.contains(f)) => {
                    defects.push(Defect::CurveLeavesTheSurface { curve, point });
                }
                _ => {}
            }
        }
    }
}

fn groups(groups: &Groups, mesh: &impl Faces, edges: Option<&EdgeTable>, defects: &mut Vec<Defect>) {
    for (name, members) in &groups.faces {
        group(GroupKind::Faces, name, members, |f| f.index() < mesh.face_count(), defects);
    }
    for (name, members) in &groups.edges {
        group(GroupKind::Edges, name, members, |e| edges.is_none_or(|edges| edges.find(*e).is_some()), defects);
    }
    for (name, members) in &groups.vertices {
        group(GroupKind::Vertices, name, members, |v| v.index() < mesh.vertex_count(), defects);
    }
}

fn group<T: Ord>(kind: GroupKind, name: &str, members: &[T], exists: impl Fn(&T) -> bool, defects: &mut Vec<Defect>) {
    if !members.is_sorted_by(|a, b| a < b) {
        defects.push(Defect::UnsortedGroup { kind, name: name.to_owned() });
    }
    let count = members.iter().filter(|m| !exists(m)).count();
    if count > 0 {
        defects.push(Defect::GroupMembersMissing { kind, name: name.to_owned(), count });
    }
}

fn regions(carried: &Carried, faces: usize, defects: &mut Vec<Defect>) {
    let Some(regions) = &carried.regions else { return };
    if regions.labels.len() != faces {
        defects.push(Defect::RegionLabelCount { labels: regions.labels.len(), faces });
    }
    let unknown = regions.labels.iter().enumerate().filter(|(_, label)| **label as usize >= regions.names.len());
    defects.extend(unknown.map(|(face, &label)| Defect::UnknownRegion { face: FaceId::new(face), label }));
}

fn fields(carried: &Carried, mesh: &impl Faces, defects: &mut Vec<Defect>) {
    for field in &carried.fields {
        let elements = match field.support {
            Support::Vertex => mesh.vertex_count(),
            Support::Face => mesh.face_count(),
        };
        let expected = elements.saturating_mul(field.components.max(1));
        if field.values.len() != expected || field.components == 0 {
            let (name, found) = (field.name.clone(), field.values.len());
            defects.push(Defect::FieldLength { name, support: field.support, expected, found });
        }
    }
    if !carried.fields.is_sorted_by(|a, b| (a.support, &a.name) < (b.support, &b.name)) {
        defects.push(Defect::UnsortedFields);
    }
}
