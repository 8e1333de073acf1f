//! What the tests of several files work on: a square of N by N cells, as triangles and as quads.

use glam::{DVec3, dvec3};

use crate::mesh::{Facet, Soup, Surface, VertexId};
use crate::technique::ground::Ground;
use crate::technique::isotropic::Rules;
use crate::technique::mixed::{Mixed, NONE};

/// Cells along a side.
pub(super) const N: u32 = 10;

/// The vertex of a row and a column.
pub(super) fn id(x: u32, y: u32) -> VertexId {
    VertexId::from_raw(y * (N + 1) + x)
}

fn points() -> Vec<DVec3> {
    let row = |y: u32| (0..=N).map(move |x| dvec3(f64::from(x), f64::from(y), 0.0));
    (0..=N).flat_map(row).collect()
}

fn cells() -> impl Iterator<Item = [VertexId; 4]> {
    (0..N * N).map(|i| (i % N, i / N)).map(|(x, y)| [id(x, y), id(x + 1, y), id(x + 1, y + 1), id(x, y + 1)])
}

/// A square of triangles.
pub(super) fn square() -> Surface {
    let faces: Vec<_> = cells().flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    Surface { points: points().into(), faces: faces.into(), ..Surface::default() }
}

/// The same square of quads, with some vertices elsewhere.
pub(super) fn quads(ground: &Ground<'_>, moved: &[(VertexId, DVec3)]) -> Mixed {
    let mut points = ground.surface.points.as_slice().to_vec();
    for &(v, to) in moved {
        points[v.index()] = to;
    }
    let faces: Vec<_> = cells().map(Facet::Quad).collect();
    let soup = Soup { points: points.into(), faces: faces.into(), ..Soup::default() };
    // Of the two triangles of a square the first tells the region.
    let regions = (0..(N * N) as usize).map(|i| ground.regions[2 * i]).collect();
    let workshop = ground.workshop().unwrap();
    let arc = |a: VertexId, b: VertexId| workshop.find(a.raw(), b.raw()).map_or(NONE, |h| workshop.arc(h));
    let mut mesh = Mixed::new(&soup, ground.places.clone(), regions, arc).unwrap();
    for v in 0..mesh.vertex_slots() {
        mesh.set_point(v, mesh.point(v), DVec3::Z);
        mesh.set_size(v, 1.0);
    }
    mesh
}

/// Rules that fit cells of side 1.
pub(super) fn rules() -> Rules {
    Rules {
        tolerance: 0.1,
        curve_tolerance: 0.05,
        shortest: 0.0,
        least_size: 0.25,
        floor: 0.1,
        gradation: 0.3,
        most_faces: usize::MAX,
    }
}
