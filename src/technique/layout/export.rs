//! A finished layout as a mesh of quads and triangles with the faces that each covers.

use super::Layout;
use crate::mesh::carried::edge_key;
use crate::mesh::id::Vertex;
use crate::mesh::{Carried, Cover, EdgeMark, FaceId, Facet, Freedom, IdVec, MarkCause, Quads, Regions, Soup, VertexId};

/// The complex as a mesh: nodes in the order of their vertices, elements in that of their lowest faces.
///
/// Corners and junctions are pinned, rims and borders of domains are marked; regions and those face groups that hold
/// all faces of an element are kept. Cells that are neither triangles nor quads are left out.
pub fn to_quads(layout: &Layout<'_>) -> Quads {
    let ground = layout.ground;
    let mut elements: Vec<(FaceId, u32)> = layout
        .cells()
        .filter(|&c| (3..=4).contains(&layout.ring(c).len()))
        .filter_map(|c| Some((*layout.faces(c).iter().min()?, c)))
        .collect();
    elements.sort_unstable();
    let mut used: IdVec<Vertex, bool> = IdVec::filled(false, ground.surface.points.len());
    elements.iter().flat_map(|&(_, c)| layout.ring(c)).for_each(|corner| used[corner.node] = true);
    let mut number: IdVec<Vertex, VertexId> = IdVec::filled(VertexId::from_raw(u32::MAX), used.len());
    let mut mesh = Soup::default();
    for v in used.ids().filter(|&v| used[v]) {
        number[v] = mesh.points.push(ground.point(v));
        if layout.fixed[v] {
            mesh.carried.pin(number[v], Freedom::Keep);
        }
    }
    let mut cover = Cover { surface: ground.surface.shape_hash(), ..Cover::default() };
    for &(_, cell) in &elements {
        let mut nodes: Vec<VertexId> = layout.nodes(cell).into_iter().map(|v| number[v]).collect();
        mark_borders(layout, cell, &nodes, &mut mesh.carried);
        let lowest = (0..nodes.len()).min_by_key(|&k| nodes[k]).unwrap_or(0);
        nodes.rotate_left(lowest);
        mesh.faces.push(match nodes[..] {
            [a, b, c] => Facet::Tri([a, b, c]),
            [a, b, c, d] => Facet::Quad([a, b, c, d]),
            _ => continue,
        });
        let mut faces = layout.faces(cell).to_vec();
        faces.sort_unstable();
        cover.faces.push(faces);
    }
    inherit(&ground.surface.carried, &cover, &mut mesh.carried);
    Quads { mesh, cover: Some(cover) }
}

fn mark_borders(layout: &Layout<'_>, cell: u32, nodes: &[VertexId], carried: &mut Carried) {
    for k in 0..nodes.len() {
        let cause = match (layout.beyond(cell, k), layout.neighbour(cell, k)) {
            (None, _) => MarkCause::Boundary,
            (Some(_), None) => MarkCause::RegionBorder,
            (Some(_), Some(_)) => continue,
        };
        carried.mark(edge_key(nodes[k], nodes[(k + 1) % nodes.len()]), EdgeMark { freedom: Freedom::OnCurve, cause });
    }
}

/// Regions, and the face groups that an element lies in with all its faces.
fn inherit(from: &Carried, cover: &Cover, to: &mut Carried) {
    if let Some(regions) = &from.regions {
        let labels = cover.faces.iter().map(|faces| faces.first().map_or(0, |&f| regions.labels[f])).collect();
        to.regions = Some(Regions { labels, names: regions.names.clone() });
    }
    for (name, members) in &from.groups.faces {
        let holds = |faces: &Vec<FaceId>| faces.iter().all(|f| members.binary_search(f).is_ok());
        let elements: Vec<FaceId> = cover.faces.enumerate().filter(|(_, faces)| holds(faces)).map(|(e, _)| e).collect();
        if !elements.is_empty() {
            to.groups.faces.insert(name.clone(), elements);
        }
    }
}
