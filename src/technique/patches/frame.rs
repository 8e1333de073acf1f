//! The elements of a quad mesh on their surface: common paths as arcs, and the vertices that each element covers.

use glam::DVec3;
use rayon::prelude::*;
use rustc_hash::FxHashMap;

use crate::mesh::bvh::TriangleBvh;
use crate::mesh::carried::{EdgeKey, edge_key};
use crate::mesh::geometry::angle;
use crate::mesh::{Cover, FaceId, IdVec, MarkCause, Quads, Surface, VertexId};
use crate::technique::layout::{Ground, Layout, cut_again};

/// Why quads and a surface do not belong together.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum FrameError {
    /// The quads do not say what they cover.
    #[error("the quads do not say which faces they cover")]
    NoCover,
    /// They were made of another surface.
    #[error("the quads were made of another surface than the one given")]
    OtherSurface,
    /// What an element covers is no disk with its corners on the rim.
    #[error("what element {element} covers is no disk with its corners on the rim")]
    NotADisk {
        /// The element.
        element: usize,
    },
}

/// A path between two nodes.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Arc {
    pub(super) path: Vec<VertexId>,
    /// What the curve follows: the vertices, and where the curve may lie anywhere on the mesh, without the zigzag of a
    /// path that runs along the edges of triangles.
    pub(super) points: Vec<DVec3>,
    /// The elements beside it with the number of their side, the first one running along.
    pub(super) beside: Vec<(usize, usize)>,
    /// Whether the mesh is smooth across.
    pub(super) is_smooth: bool,
}

/// Elements with their arcs.
pub(super) struct Frame<'g> {
    pub(super) layout: Layout<'g>,
    pub(super) arcs: Vec<Arc>,
    /// For each element and side: the arc, and whether it runs along.
    pub(super) sides: Vec<Vec<(usize, bool)>>,
}

/// The surface that the elements cover: the one given, cut finer where they had no room.
///
/// # Errors
/// See [`FrameError`].
pub(super) fn covered(surface: &Surface, quads: &Quads) -> Result<Surface, FrameError> {
    let cover = quads.cover.as_ref().ok_or(FrameError::NoCover)?;
    if cover.surface != surface.shape_hash() {
        return Err(FrameError::OtherSurface);
    }
    cut_again(surface, &cover.cuts).ok_or(FrameError::OtherSurface)
}

/// Finds the paths between the elements on what they cover.
///
/// # Errors
/// See [`FrameError`].
pub(super) fn frame<'g>(ground: &'g Ground<'g>, quads: &Quads) -> Result<Frame<'g>, FrameError> {
    let cover = quads.cover.as_ref().ok_or(FrameError::NoCover)?;
    let layout = embed(ground, quads, cover)?;
    let mut arcs: Vec<Arc> = Vec::new();
    let mut known: FxHashMap<EdgeKey, usize> = FxHashMap::default();
    let mut sides = Vec::new();
    for element in 0..quads.mesh.faces.len() {
        let corners = quads.mesh.faces[FaceId::new(element)].corners();
        let ring = layout.ring(element as u32);
        // Sides are numbered from the element's first corner.
        let first = quads.mesh.points[corners[0]];
        let start = ring.iter().position(|c| ground.point(c.node) == first).unwrap_or(0);
        let mut own = Vec::new();
        for k in 0..ring.len() {
            let path = layout.path(element as u32, (start + k) % ring.len());
            let key = path.windows(2).map(|w| edge_key(w[0], w[1])).min().unwrap_or([path[0]; 2]);
            let next = arcs.len();
            let arc = *known.entry(key).or_insert(next);
            if arc == next {
                let is_smooth = is_smooth(ground, &path);
                arcs.push(Arc { path: path.clone(), points: Vec::new(), beside: Vec::new(), is_smooth });
            }
            arcs[arc].beside.push((element, k));
            own.push((arc, arcs[arc].path[0] == path[0]));
        }
        sides.push(own);
    }
    let tree = TriangleBvh::of_surface(ground.surface);
    arcs.par_iter_mut().for_each(|arc| arc.points = points(ground, arc, &tree));
    Ok(Frame { layout, arcs, sides })
}

/// The points that the curve of an arc follows; three at least.
fn points(ground: &Ground<'_>, arc: &Arc, tree: &TriangleBvh) -> Vec<DVec3> {
    /// Means of neighbours that are taken: enough for steps of some edges' length.
    const ROUNDS: usize = 8;
    let mut points: Vec<DVec3> = arc.path.iter().map(|&v| ground.point(v)).collect();
    if points.len() == 2 {
        points.insert(1, points[0].midpoint(points[1]));
    }
    if !(arc.is_smooth && arc.beside.len() == 2) {
        return points;
    }
    for _ in 0..ROUNDS {
        let before = points.clone();
        for (point, around) in points[1..].iter_mut().zip(before.windows(3)) {
            *point = 0.5 * around[1] + 0.25 * (around[0] + around[2]);
        }
    }
    let last = points.len() - 1;
    points[1..last].iter_mut().for_each(|p| *p = tree.closest(*p).map_or(*p, |near| near.nearest.point));
    points
}

/// Whether no marked edge but the border of a region runs along a path, and the mesh does not bend there.
fn is_smooth(ground: &Ground<'_>, path: &[VertexId]) -> bool {
    /// Mean angle between the faces on both sides of a path from which on it counts as an edge of the shape; degrees.
    const SHARP: f64 = 20.0;
    let marks = &ground.surface.carried.marks;
    let is_crease = |cause| !matches!(cause, MarkCause::Boundary | MarkCause::RegionBorder);
    let (mut bend, mut length) = (0.0, 0.0);
    for w in path.windows(2) {
        let is_marked = marks.get(&edge_key(w[0], w[1])).is_some_and(|m| is_crease(m.cause));
        let side = ground.side_between(w[0], w[1]).or_else(|| ground.side_between(w[1], w[0]));
        let Some((a, b)) = side.and_then(|s| ground.beyond(s).map(|f| (s.face, f))) else { return false };
        if is_marked {
            return false;
        }
        let edge = ground.point(w[0]).distance(ground.point(w[1]));
        bend += edge * angle(ground.normal(a), ground.normal(b)).to_degrees();
        length += edge;
    }
    bend <= SHARP * length
}

fn embed<'g>(ground: &'g Ground<'g>, quads: &Quads, cover: &Cover) -> Result<Layout<'g>, FrameError> {
    let surface: &Surface = ground.surface;
    let count = quads.mesh.faces.len();
    if cover.faces.len() != count {
        return Err(FrameError::OtherSurface);
    }
    let mut cell = IdVec::filled(u32::MAX, surface.faces.len());
    let mut node = IdVec::filled(false, surface.points.len());
    for (element, faces) in cover.faces.enumerate() {
        for &f in faces {
            if cell.get(f) != Some(&u32::MAX) {
                return Err(FrameError::OtherSurface);
            }
            cell[f] = element.raw();
        }
        for corner in quads.mesh.faces[element].corners() {
            let at = quads.mesh.points[*corner];
            let own = faces.iter().flat_map(|&f| surface.faces[f]).filter(|&v| surface.points[v] == at);
            own.for_each(|v| node[v] = true);
        }
    }
    if cell.iter().any(|&c| c == u32::MAX) {
        return Err(FrameError::OtherSurface);
    }
    let fixed = IdVec::filled(false, surface.points.len());
    let (layout, bad) = Layout::new(ground, cell, count, node, fixed);
    let wrong = (0..count).find(|&e| {
        let corners = quads.mesh.faces[FaceId::new(e)].corners().len();
        layout.ring(e as u32).len() != corners
    });
    let wrong = bad.first().map(|b| b.cell as usize).or(wrong);
    wrong.map_or(Ok(layout), |element| Err(FrameError::NotADisk { element }))
}
