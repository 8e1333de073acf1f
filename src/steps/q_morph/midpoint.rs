//! The last resort: every quad becomes four, every triangle three, by the middles of all edges and faces.

use rustc_hash::FxHashMap;

use crate::mesh::{Facet, VertexId};
use crate::technique::ground::Ground;
use crate::technique::mixed::{Mixed, NONE, Place};

/// The mesh with every face cut from its centre to the middles of its sides.
pub(super) fn split_all(mesh: &Mixed, ground: &Ground<'_>) -> Option<Mixed> {
    let (mut soup, mut places, regions) = mesh.leave();
    let arcs: FxHashMap<[VertexId; 2], u32> = mesh.arcs_left().into_iter().collect();
    let mut middles: FxHashMap<[VertexId; 2], VertexId> = FxHashMap::default();
    let mut halves: FxHashMap<[VertexId; 2], u32> = FxHashMap::default();
    let faces = std::mem::take(&mut soup.faces);
    let mut new_regions = Vec::new();
    for (facet, &region) in faces.iter().zip(&regions) {
        let corners = facet.corners();
        let n = corners.len();
        let sum: glam::DVec3 = corners.iter().map(|&v| soup.points[v]).sum();
        let centre = soup.points.push(ground.project(region, sum / n as f64).point);
        places.push(Place::Region(region));
        let mut around = Vec::new();
        for i in 0..n {
            let (a, b) = (corners[i], corners[(i + 1) % n]);
            let key = crate::mesh::edge_key(a, b);
            let arc = arcs.get(&key).copied().unwrap_or(NONE);
            let middle = *middles.entry(key).or_insert_with(|| {
                let wish = 0.5 * (soup.points[a] + soup.points[b]);
                let (point, place) = match ground.curves.get(arc as usize) {
                    Some(curve) => {
                        let at = curve.nearest(wish);
                        (curve.at(at), Place::Arc { arc, at })
                    }
                    None => (ground.project(region, wish).point, Place::Region(region)),
                };
                places.push(place);
                soup.points.push(point)
            });
            if arc != NONE {
                halves.insert(crate::mesh::edge_key(a, middle), arc);
                halves.insert(crate::mesh::edge_key(b, middle), arc);
            }
            around.push(middle);
        }
        for i in 0..n {
            soup.faces.push(Facet::Quad([corners[i], around[i], centre, around[(i + n - 1) % n]]));
            new_regions.push(region);
        }
    }
    let arc_of = |a, b| halves.get(&crate::mesh::edge_key(a, b)).copied().unwrap_or(NONE);
    Mixed::new(&soup, places, new_regions, arc_of)
}
