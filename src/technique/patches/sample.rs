//! A conforming mesh sampled from patches: places on a common curve are one vertex.

use glam::DVec3;
use rustc_hash::FxHashMap;

use super::frame::Frame;
use crate::mesh::patches::Patch;
use crate::mesh::{Facet, Field, Soup, Support, Surface, VertexId};

/// The patches cut into `density` by `density` quads each; where a side is a point they are triangles.
pub(super) fn tessellate(frame: &Frame<'_>, patches: &[Patch], density: usize) -> Soup {
    let n = density.max(1);
    let mut soup = Soup::default();
    let mut nodes: FxHashMap<VertexId, VertexId> = FxHashMap::default();
    let mut on_arcs: Vec<Vec<VertexId>> = Vec::with_capacity(frame.arcs.len());
    for arc in &frame.arcs {
        let (element, side) = arc.beside[0];
        let mut row = Vec::with_capacity(n + 1);
        for k in 0..=n {
            let end = if k == 0 { Some(arc.path[0]) } else { (k == n).then(|| arc.path[arc.path.len() - 1]) };
            let id = if let Some(v) = end {
                *nodes.entry(v).or_insert_with(|| soup.points.push(frame.layout.ground.point(v)))
            } else {
                let t = k as f64 / n as f64;
                let uv = super::on_side(side, frame.sides[element].len(), t);
                soup.points.push(patches[element].point(uv[0], uv[1]))
            };
            row.push(id);
        }
        on_arcs.push(row);
    }
    let mut of_patch = Vec::new();
    for (e, patch) in patches.iter().enumerate() {
        let grid = grid(frame, e, patch, n, &on_arcs, &mut soup);
        for (i, j) in (0..n * n).map(|k| (k % n, k / n)) {
            let at = |i: usize, j: usize| grid[j * (n + 1) + i];
            let (a, b, c, d) = (at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1));
            soup.faces.push(if c == d { Facet::Tri([a, b, c]) } else { Facet::Quad([a, b, c, d]) });
            of_patch.push(e as f64);
        }
    }
    let field = Field { name: "patch".to_owned(), support: Support::Face, components: 1, values: of_patch };
    soup.carried.set_field(field);
    soup
}

/// The vertices of a patch, row by row.
fn grid(
    frame: &Frame<'_>,
    element: usize,
    patch: &Patch,
    n: usize,
    on_arcs: &[Vec<VertexId>],
    soup: &mut Soup,
) -> Vec<VertexId> {
    let sides = &frame.sides[element];
    let along = |side: usize, k: usize| {
        let (arc, is_along) = sides[side];
        on_arcs[arc][if is_along { k } else { n - k }]
    };
    let mut grid = Vec::with_capacity((n + 1) * (n + 1));
    for j in 0..=n {
        for i in 0..=n {
            let id = if j == 0 {
                along(0, i)
            } else if j == n {
                if sides.len() == 3 { along(1, n) } else { along(2, n - i) }
            } else if i == n {
                along(1, j)
            } else if i == 0 {
                along(sides.len() - 1, n - j)
            } else {
                soup.points.push(patch.point(i as f64 / n as f64, j as f64 / n as f64))
            };
            grid.push(id);
        }
    }
    grid
}

/// The same mesh with each quad cut in two.
pub(super) fn triangles(soup: &Soup) -> Surface {
    let mut faces = Vec::with_capacity(2 * soup.faces.len());
    for face in &soup.faces {
        match *face {
            Facet::Tri(corners) => faces.push(corners),
            Facet::Quad([a, b, c, d]) => {
                let p = |v: VertexId| -> DVec3 { soup.points[v] };
                // The shorter diagonal bends less.
                let is_first = p(a).distance_squared(p(c)) <= p(b).distance_squared(p(d));
                faces.extend(if is_first { [[a, b, c], [a, c, d]] } else { [[a, b, d], [b, c, d]] });
            }
        }
    }
    Surface { points: soup.points.clone(), faces: faces.into(), ..Surface::default() }
}
