//! What writers say of a mesh besides points and faces: its face sets, and seams welded again.

use std::borrow::Cow;
use std::collections::BTreeMap;

use crate::mesh::{Carried, FaceId, Facet, IdVec, SeamId, Soup, Support, VertexId, edge_key};

/// All named face sets in name order: the groups, and each region under its name. A region that shares its name with
/// a group is part of that set.
pub(super) fn face_sets(soup: &Soup) -> BTreeMap<String, Vec<FaceId>> {
    let mut sets = soup.carried.groups.faces.clone();
    let Some(regions) = &soup.carried.regions else { return sets };
    for (face, &label) in regions.labels.enumerate() {
        let name = regions.names.get(label as usize).cloned().unwrap_or_else(|| format!("region_{label}"));
        sets.entry(name).or_default().push(face);
    }
    for members in sets.values_mut() {
        members.sort_unstable();
        members.dedup();
    }
    sets
}

/// Faces by the first group that holds them, in name order, then the faces in no group; regions count as groups.
pub(super) fn partition(soup: &Soup) -> Vec<(String, Vec<FaceId>)> {
    let mut taken = vec![false; soup.faces.len()];
    let mut parts = Vec::new();
    for (name, members) in face_sets(soup) {
        let own: Vec<FaceId> = members
            .into_iter()
            .filter(|f| taken.get_mut(f.index()).is_some_and(|t| !std::mem::replace(t, true)))
            .collect();
        if !own.is_empty() {
            parts.push((name, own));
        }
    }
    let rest: Vec<FaceId> = soup.faces.ids().filter(|f| !taken[f.index()]).collect();
    if !rest.is_empty() || parts.is_empty() {
        parts.push((String::new(), rest));
    }
    parts
}

/// The mesh with all vertices of one seam id merged into the first of them: what writers write, so that shells which
/// meet in a T-joint are connected again. Borrowed when there is no seam.
pub fn welded_seams(soup: &Soup) -> Cow<'_, Soup> {
    if soup.carried.seams.is_empty() {
        return Cow::Borrowed(soup);
    }
    let mut first: BTreeMap<SeamId, VertexId> = BTreeMap::new();
    for (&vertex, &seam) in &soup.carried.seams {
        first.entry(seam).or_insert(vertex);
    }
    let mut target = IdVec::filled(VertexId::from_raw(0), soup.points.len());
    let mut kept = Vec::with_capacity(soup.points.len());
    for vertex in soup.points.ids() {
        let leader = soup.carried.seams.get(&vertex).and_then(|seam| first.get(seam)).copied();
        target[vertex] = match leader {
            // The leader is the lowest id of its seam, so that its new number is known already.
            Some(leader) if leader != vertex => target[leader],
            _ => {
                kept.push(vertex);
                VertexId::new(kept.len() - 1)
            }
        };
    }
    let mut faces = soup.faces.clone();
    for corner in faces.iter_mut().flat_map(Facet::corners_mut) {
        *corner = target[*corner];
    }
    let points = kept.iter().map(|&v| soup.points[v]).collect();
    Cow::Owned(Soup { points, faces, carried: welded_carried(&soup.carried, &target, &kept) })
}

fn welded_carried(carried: &Carried, target: &IdVec<crate::mesh::id::Vertex, VertexId>, kept: &[VertexId]) -> Carried {
    let mut welded = Carried { regions: carried.regions.clone(), ..Carried::default() };
    welded.groups.faces.clone_from(&carried.groups.faces);
    for (name, edges) in &carried.groups.edges {
        let mut edges: Vec<_> = edges.iter().map(|&[a, b]| edge_key(target[a], target[b])).collect();
        edges.sort_unstable();
        edges.dedup();
        welded.groups.edges.insert(name.clone(), edges);
    }
    for (name, vertices) in &carried.groups.vertices {
        let mut vertices: Vec<_> = vertices.iter().map(|&v| target[v]).collect();
        vertices.sort_unstable();
        vertices.dedup();
        welded.groups.vertices.insert(name.clone(), vertices);
    }
    for (&[a, b], &mark) in &carried.marks {
        welded.mark(edge_key(target[a], target[b]), mark);
    }
    for (&vertex, &freedom) in &carried.pins {
        welded.pin(target[vertex], freedom);
    }
    welded.fields.clone_from(&carried.fields);
    for field in welded.fields.iter_mut().filter(|f| f.support == Support::Vertex) {
        let n = field.components;
        field.values = kept.iter().flat_map(|v| field.values[n * v.index()..n * (v.index() + 1)].to_vec()).collect();
    }
    welded
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::mesh::Field;

    fn corners(ids: [u32; 3]) -> Facet {
        Facet::Tri(ids.map(VertexId::from_raw))
    }

    #[test]
    fn seam_copies_become_one_vertex_and_everything_carried_follows() {
        let points = vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::ZERO, DVec3::X, DVec3::Z];
        let mut soup = Soup { points: points.into(), ..Soup::default() };
        soup.faces.push(corners([0, 1, 2]));
        soup.faces.push(corners([4, 3, 5]));
        for (vertex, seam) in [(0, 7), (3, 7), (1, 8), (4, 8)] {
            soup.carried.seams.insert(VertexId::from_raw(vertex), SeamId(seam));
        }
        let edge = |a, b| [VertexId::from_raw(a), VertexId::from_raw(b)];
        soup.carried.groups.edges.insert("joint".into(), vec![edge(0, 1), edge(3, 4)]);
        soup.carried.groups.vertices.insert("tip".into(), vec![VertexId::from_raw(5)]);
        let values = (0..6).map(f64::from).collect();
        soup.carried.set_field(Field { name: "n".into(), support: Support::Vertex, components: 1, values });

        let welded = welded_seams(&soup);
        assert_eq!(welded.points.as_slice(), [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z]);
        assert_eq!(welded.faces.as_slice(), [corners([0, 1, 2]), corners([1, 0, 3])]);
        assert_eq!(welded.carried.groups.edges["joint"], [edge(0, 1)]);
        assert_eq!(welded.carried.groups.vertices["tip"], [VertexId::from_raw(3)]);
        assert_eq!(welded.carried.fields[0].values, [0.0, 1.0, 2.0, 5.0]);
        assert!(welded.carried.seams.is_empty());
    }

    #[test]
    fn a_mesh_without_seams_is_borrowed() {
        assert!(matches!(welded_seams(&Soup::default()), Cow::Borrowed(_)));
    }
}
