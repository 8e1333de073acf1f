//! The mesh of a front, with everything the finest mesh carries.

use std::collections::BTreeMap;

use super::front::Front;
use crate::mesh::carried::{Carried, Groups, Regions, edge_key};
use crate::mesh::hierarchy::{Node, NodeId};
use crate::mesh::id::{Face, FaceId, Id, IdVec, Vertex, VertexId};
use crate::mesh::surface::Surface;

/// Old elements to new ones; `None` for those that are gone.
type Renumber<K> = IdVec<K, Option<Id<K>>>;

/// The mesh of a front: vertices in node order, faces in the order of the finest mesh. O(nodes + faces).
///
/// Groups, regions and marks are mapped as the collapses did it: a merged vertex carries on what its kept end had, a
/// merged edge the stricter mark. Fields are dropped; transfer them from the finest mesh.
pub fn extract(front: &Front<'_>) -> Surface {
    let hierarchy = front.hierarchy();
    let finest = &hierarchy.finest;
    let stands = front.representatives();
    let nodes: Vec<NodeId> = front.nodes().collect();
    let mut number: IdVec<Node, Option<VertexId>> = IdVec::filled(None, hierarchy.node_count());
    for (new, &node) in nodes.iter().enumerate() {
        number[node] = Some(VertexId::new(new));
    }
    let moved: Renumber<Vertex> =
        finest.points.ids().map(|v| stands[NodeId::from_raw(v.raw())].and_then(|n| number[n])).collect();

    let mut faces: IdVec<Face, [VertexId; 3]> = IdVec::with_capacity(front.face_count());
    let mut kept: Renumber<Face> = IdVec::filled(None, finest.faces.len());
    for (old, corners) in front.faces_by(&stands) {
        if let [Some(a), Some(b), Some(c)] = corners.map(|node| number[node]) {
            kept[old] = Some(faces.push([a, b, c]));
        }
    }
    debug_assert_eq!(faces.len(), front.face_count());
    let points = nodes.iter().map(|&node| hierarchy.point(node)).collect();
    let heirs = heirs(front, &nodes);
    Surface { points, faces, carried: carry(&finest.carried, &moved, &heirs, &kept) }
}

/// The leaf whose own properties each vertex carries on: the kept end of each merge. `None` for leaves that lost
/// theirs.
fn heirs(front: &Front<'_>, nodes: &[NodeId]) -> Renumber<Vertex> {
    let hierarchy = front.hierarchy();
    let mut heirs: Renumber<Vertex> = IdVec::filled(None, hierarchy.leaf_count());
    for (new, &node) in nodes.iter().enumerate() {
        let mut leaf = node;
        while let Some(merge) = hierarchy.merge(leaf) {
            leaf = merge.kept;
        }
        heirs[VertexId::from_raw(leaf.raw())] = Some(VertexId::new(new));
    }
    heirs
}

fn carry(from: &Carried, moved: &Renumber<Vertex>, heirs: &Renumber<Vertex>, faces: &Renumber<Face>) -> Carried {
    let edge = |[a, b]: [VertexId; 2]| match (moved[a], moved[b]) {
        (Some(a), Some(b)) if a != b => Some(edge_key(a, b)),
        _ => None,
    };
    let mut carried = Carried {
        groups: Groups {
            faces: map_groups(&from.groups.faces, |f| faces[f]),
            edges: map_groups(&from.groups.edges, edge),
            vertices: map_groups(&from.groups.vertices, |v| heirs[v]),
        },
        regions: from.regions.as_ref().map(|regions| map_regions(regions, faces)),
        ..Carried::default()
    };
    for (&key, &mark) in &from.marks {
        if let Some(key) = edge(key) {
            carried.mark(key, mark);
        }
    }
    carried.pins = from.pins.iter().filter_map(|(&v, &pin)| Some((heirs[v]?, pin))).collect();
    carried.seams = from.seams.iter().filter_map(|(&v, &seam)| Some((heirs[v]?, seam))).collect();
    carried
}

fn map_groups<T: Copy + Ord>(
    groups: &BTreeMap<String, Vec<T>>,
    map: impl Fn(T) -> Option<T>,
) -> BTreeMap<String, Vec<T>> {
    let mapped = |members: &Vec<T>| {
        let mut members: Vec<T> = members.iter().filter_map(|&m| map(m)).collect();
        members.sort_unstable();
        members.dedup();
        members
    };
    groups.iter().map(|(name, members)| (name.clone(), mapped(members))).collect()
}

fn map_regions(regions: &Regions, faces: &Renumber<Face>) -> Regions {
    let is_kept = |(f, _): &(FaceId, &u32)| faces[*f].is_some();
    let labels = regions.labels.enumerate().filter(is_kept).map(|(_, &label)| label).collect();
    Regions { labels, names: regions.names.clone() }
}
