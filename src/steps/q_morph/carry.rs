//! What the quads carry: groups, regions, marks and pins of the surface.

use std::collections::BTreeSet;

use glam::DVec3;
use smallvec::SmallVec;

use crate::mesh::bvh::SegmentBvh;
use crate::mesh::{Carried, FaceId, Freedom, Regions, Soup, VertexId, edge_key};
use crate::technique::ground::{Curve, Ground};
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
    carry_vertices(&soup, &places, ground, &mut carried);
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
            let [a, b] = edge_at(curve, at);
            members.binary_search(&edge_key(a, b)).is_ok()
        };
        let list = arcs.iter().filter(|(edge, arc)| on(*edge, *arc)).map(|(edge, _)| *edge).collect();
        carried.groups.edges.insert(name.clone(), list);
    }
}

/// The surface's edge at a length along a curve.
fn edge_at(curve: &Curve, at: f64) -> [VertexId; 2] {
    let i = curve.along.partition_point(|&s| s < at).clamp(1, curve.along.len() - 1);
    [curve.vertices[i - 1], curve.vertices[i]]
}

/// A vertex belongs to the groups of the whole face that it lies on, or of the whole edge where it lies on a curve: to
/// those of all its corners. The vertices nearest to those of a group belong to it too, so that none is lost.
fn carry_vertices(soup: &Soup, places: &[Place], ground: &Ground<'_>, carried: &mut Carried) {
    let groups = &ground.surface.carried.groups.vertices;
    if groups.is_empty() {
        return;
    }
    let tree = SegmentBvh::new(soup.points.iter().map(|&p| [p, p]).collect());
    let under: Vec<SmallVec<[VertexId; 3]>> =
        soup.points.iter().zip(places).map(|(&point, &place)| corners_under(ground, point, place)).collect();
    for (name, members) in groups {
        let nearest = |v: &VertexId| tree.closest(ground.surface.points[*v]).map(|c| VertexId::from_raw(c.index));
        let mut list: BTreeSet<VertexId> = members.iter().filter_map(nearest).collect();
        let within = |corners: &[VertexId]| corners.iter().all(|v| members.binary_search(v).is_ok());
        let inside = under.iter().enumerate().filter(|(_, corners)| !corners.is_empty() && within(corners));
        list.extend(inside.map(|(v, _)| VertexId::new(v)));
        carried.groups.vertices.insert(name.clone(), list.into_iter().collect());
    }
}

/// The corners of what a vertex lies on: an edge of its curve, or a face. None for a node, which is nearest to itself.
fn corners_under(ground: &Ground<'_>, point: DVec3, place: Place) -> SmallVec<[VertexId; 3]> {
    match place {
        Place::Node => SmallVec::new(),
        Place::Arc { arc, at } => SmallVec::from_slice(&edge_at(&ground.curves[arc as usize], at)),
        Place::Region(region) => SmallVec::from_slice(&ground.surface.faces[ground.project(region, point).face]),
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{N, id, quads, square};
    use super::*;

    #[test]
    fn a_vertex_belongs_to_the_groups_of_the_face_that_it_lies_on() {
        let mut surface = square();
        // The left half, and one corner alone.
        let half = (0..=N).flat_map(|y| (0..=N / 2).map(move |x| id(x, y))).collect();
        surface.carried.groups.vertices.insert("half".into(), half);
        surface.carried.groups.vertices.insert("corner".into(), vec![id(N, N)]);
        let ground = Ground::new(&surface);
        // All but those of the rim lie a third of a face to the right.
        let inner = (1..N).flat_map(|y| (1..N).map(move |x| id(x, y)));
        let moved: Vec<_> = inner.map(|v| (v, surface.points[v] + DVec3::new(0.3, 0.2, 0.0))).collect();
        let left = leave(&quads(&ground, &moved), &ground);
        let groups = &left.carried.groups.vertices;
        let is_left = |v: &VertexId| left.points[*v].x <= f64::from(N / 2);
        assert!(left.points.ids().filter(is_left).all(|v| groups["half"].contains(&v)));
        // The nearest ones to those at the half's border lie just beyond it.
        assert!(groups["half"].iter().all(|v| left.points[*v].x < f64::from(N / 2) + 0.5));
        assert_eq!(groups["corner"].len(), 1);
    }
}
