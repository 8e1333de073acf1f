//! What the quads carry: groups, regions, marks and pins of the surface.

use std::collections::BTreeSet;

use crate::mesh::bvh::SegmentBvh;
use crate::mesh::{Carried, FaceId, Freedom, Regions, Soup, VertexId, edge_key};
use crate::technique::ground::Ground;
use crate::technique::mixed::{Mixed, Place};

/// The finished mesh with what it carries.
pub(super) fn leave(mesh: &Mixed, ground: &Ground<'_>) -> Soup {
    let (mut soup, places, _) = mesh.leave();
    let arcs = mesh.arcs_left();
    let mut carried = Carried::default();
    for &(edge, arc) in &arcs {
        carried.mark(edge, ground.curves[arc as usize].mark);
    }
    for (v, place) in places.iter().enumerate() {
        if *place == Place::Node {
            carried.pin(VertexId::new(v), Freedom::Keep);
        }
    }
    carry_faces(mesh, ground, &mut carried);
    carry_edges(&soup, ground, &arcs, &mut carried);
    carry_vertices(&soup, ground, &mut carried);
    soup.carried = carried;
    soup
}

/// Each face belongs where the surface under its middle belongs.
fn carry_faces(mesh: &Mixed, ground: &Ground<'_>, carried: &mut Carried) {
    let from = &ground.surface.carried;
    if from.groups.faces.is_empty() && from.regions.is_none() {
        return;
    }
    let under: Vec<FaceId> = mesh.faces().map(|f| ground.project(mesh.region(f), mesh.centre(f)).face).collect();
    for (name, members) in &from.groups.faces {
        let on = |f: &FaceId| members.binary_search(f).is_ok();
        let list = under.iter().enumerate().filter(|(_, f)| on(f)).map(|(i, _)| FaceId::new(i)).collect();
        carried.groups.faces.insert(name.clone(), list);
    }
    if let Some(regions) = &from.regions {
        let labels = under.iter().map(|&f| regions.labels[f]).collect();
        carried.regions = Some(Regions { labels, names: regions.names.clone() });
    }
}

/// An edge on a curve belongs to the groups of the curve's edge under its middle.
fn carry_edges(soup: &Soup, ground: &Ground<'_>, arcs: &[([VertexId; 2], u32)], carried: &mut Carried) {
    for (name, members) in &ground.surface.carried.groups.edges {
        let on = |edge: [VertexId; 2], arc: u32| {
            let curve = &ground.curves[arc as usize];
            let at = curve.nearest(0.5 * (soup.points[edge[0]] + soup.points[edge[1]]));
            let i = curve.along.partition_point(|&s| s < at).clamp(1, curve.along.len() - 1);
            members.binary_search(&edge_key(curve.vertices[i - 1], curve.vertices[i])).is_ok()
        };
        let list = arcs.iter().filter(|(edge, arc)| on(*edge, *arc)).map(|(edge, _)| *edge).collect();
        carried.groups.edges.insert(name.clone(), list);
    }
}

/// A vertex group goes to the nearest vertices.
fn carry_vertices(soup: &Soup, ground: &Ground<'_>, carried: &mut Carried) {
    let groups = &ground.surface.carried.groups.vertices;
    if groups.is_empty() {
        return;
    }
    let tree = SegmentBvh::new(soup.points.iter().map(|&p| [p, p]).collect());
    for (name, members) in groups {
        let nearest = |v: &VertexId| tree.closest(ground.surface.points[*v]).map(|c| VertexId::from_raw(c.index));
        let list: BTreeSet<VertexId> = members.iter().filter_map(nearest).collect();
        carried.groups.vertices.insert(name.clone(), list.into_iter().collect());
    }
}
