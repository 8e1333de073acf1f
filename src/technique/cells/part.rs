//! A cell as a surface of its own: its faces, and those that stay but reach into its box.
//!
//! Where the faces that stay meet in a corner only, each fan of them gets a vertex of its own, so that the part is a
//! surface. A vertex that may change has all its faces here, and is there once.

use glam::DVec3;
use petgraph::unionfind::UnionFind;
use rustc_hash::FxHashMap;

use super::cut::Cutting;
use crate::mesh::geometry::Aabb;
use crate::mesh::{Carried, EdgeKey, EdgeMark, FaceId, Freedom, Groups, Regions, Surface, VertexId, edge_key};
use crate::technique::guarded::Pen;

/// What the surface carries, by cell.
#[derive(Debug, Default)]
pub(super) struct Shares {
    cells: Vec<Share>,
    names: Groups,
}

/// What a cell carries, in the whole surface's numbers; groups by their place in the order of names.
#[derive(Clone, Debug, Default)]
struct Share {
    faces: Vec<(usize, FaceId)>,
    edges: Vec<(usize, EdgeKey)>,
    vertices: Vec<(usize, VertexId)>,
    marks: Vec<(EdgeKey, EdgeMark)>,
    pins: Vec<(VertexId, Freedom)>,
    /// Faces in the cell, and faces that stay but reach into it.
    inside: Vec<FaceId>,
    beside: Vec<FaceId>,
}

impl Shares {
    pub(super) fn new(surface: &Surface, cutting: &Cutting) -> Self {
        let mut this = Self { cells: vec![Share::default(); cutting.len()], names: names_of(&surface.carried.groups) };
        for f in surface.faces.ids() {
            if let Some(cell) = cutting.inside(f) {
                this.cells[cell].inside.push(f);
            }
        }
        for &f in &cutting.still {
            let own = Aabb::of(surface.corners(f));
            for (share, bounds) in this.cells.iter_mut().zip(&cutting.boxes) {
                if bounds.overlaps(&own) {
                    share.beside.push(f);
                }
            }
        }
        this.hand_out(&surface.carried, cutting);
        this
    }

    /// What lies in one cell wholly; all else stays.
    fn hand_out(&mut self, Carried { groups, marks, pins, .. }: &Carried, cutting: &Cutting) {
        let common = |[a, b]: EdgeKey| Some(cutting.cell(a)).filter(|&cell| cell == cutting.cell(b));
        for (label, members) in groups.faces.values().enumerate() {
            for &f in members {
                if let Some(cell) = cutting.inside(f) {
                    self.cells[cell].faces.push((label, f));
                }
            }
        }
        for (label, members) in groups.edges.values().enumerate() {
            for &edge in members {
                if let Some(cell) = common(edge) {
                    self.cells[cell].edges.push((label, edge));
                }
            }
        }
        for (label, members) in groups.vertices.values().enumerate() {
            for &v in members {
                self.cells[cutting.cell(v)].vertices.push((label, v));
            }
        }
        for (&edge, &mark) in marks {
            if let Some(cell) = common(edge) {
                self.cells[cell].marks.push((edge, mark));
            }
        }
        for (&v, &pin) in pins {
            self.cells[cutting.cell(v)].pins.push((v, pin));
        }
    }
}

/// The same groups without members.
pub(super) fn names_of(groups: &Groups) -> Groups {
    Groups {
        faces: groups.faces.keys().map(|name| (name.clone(), Vec::new())).collect(),
        edges: groups.edges.keys().map(|name| (name.clone(), Vec::new())).collect(),
        vertices: groups.vertices.keys().map(|name| (name.clone(), Vec::new())).collect(),
    }
}

/// A cell as a surface.
#[derive(Debug)]
pub(super) struct Part {
    /// Its own faces first.
    pub(super) surface: Surface,
    /// The number of its own faces.
    pub(super) inside: usize,
    /// The whole surface's number of each vertex, in rising order.
    pub(super) vertices: Vec<VertexId>,
    bounds: Aabb,
}

impl Part {
    pub(super) fn new(surface: &Surface, cutting: &Cutting, shares: &Shares, cell: usize) -> Self {
        let share = &shares.cells[cell];
        let faces: Vec<FaceId> = share.inside.iter().chain(&share.beside).copied().collect();
        let (corners, vertices) = glue(surface, &faces);
        let mut this = Self {
            surface: Surface {
                points: vertices.iter().map(|&v| surface.points[v]).collect(),
                faces: corners.into_iter().collect(),
                carried: Carried::default(),
            },
            inside: share.inside.len(),
            vertices,
            bounds: cutting.boxes[cell],
        };
        this.carry(surface, share, &shares.names, &faces);
        this
    }

    /// What edits must leave alone.
    pub(super) fn pen(&self, origin: DVec3) -> Pen {
        let fixed = (0..self.surface.faces.len()).map(|f| f >= self.inside).collect();
        Pen { bounds: self.bounds, fixed, origin }
    }

    fn carry(&mut self, whole: &Surface, share: &Share, names: &Groups, faces: &[FaceId]) {
        let has_edges = !(share.edges.is_empty() && share.marks.is_empty());
        let sides = if has_edges { self.sides() } else { FxHashMap::default() };
        let vertices = &self.vertices;
        let copies = |v: VertexId| {
            let first = vertices.partition_point(|&w| w < v);
            (first..vertices.len()).take_while(move |&at| vertices[at] == v).map(VertexId::new)
        };
        let edges = |key: EdgeKey| sides.get(&key).map_or(&[][..], Vec::as_slice).iter().copied();
        let place = |f: FaceId| share.inside.binary_search(&f).ok().map(FaceId::new);
        let mut carried = Carried { groups: names.clone(), ..Carried::default() };
        let Groups { faces: in_faces, edges: in_edges, vertices: in_vertices } = &mut carried.groups;
        fill(in_faces.values_mut(), share.faces.iter().filter_map(|&(label, f)| place(f).map(|f| (label, f))));
        fill(in_edges.values_mut(), share.edges.iter().flat_map(|&(label, e)| edges(e).map(move |e| (label, e))));
        fill(
            in_vertices.values_mut(),
            share.vertices.iter().flat_map(|&(label, v)| copies(v).map(move |v| (label, v))),
        );
        carried.marks = share.marks.iter().flat_map(|&(e, mark)| edges(e).map(move |e| (e, mark))).collect();
        carried.pins = share.pins.iter().flat_map(|&(v, pin)| copies(v).map(move |v| (v, pin))).collect();
        carried.regions = whole.carried.regions.as_ref().map(|regions| Regions {
            labels: faces.iter().map(|&f| regions.labels[f]).collect(),
            names: regions.names.clone(),
        });
        self.surface.carried = carried;
    }

    /// The edges of the part by those of the whole: more than one where a vertex is there more than once.
    fn sides(&self) -> FxHashMap<EdgeKey, Vec<EdgeKey>> {
        let mut sides: FxHashMap<EdgeKey, Vec<EdgeKey>> = FxHashMap::default();
        for &[a, b, c] in &self.surface.faces {
            for [a, b] in [[a, b], [b, c], [c, a]] {
                let whole = edge_key(self.vertices[a.index()], self.vertices[b.index()]);
                let known = sides.entry(whole).or_default();
                if !known.contains(&edge_key(a, b)) {
                    known.push(edge_key(a, b));
                }
            }
        }
        sides
    }
}

/// Adds members to the groups of their labels; each group sorted, with every member once.
pub(super) fn fill<'g, T: Ord + 'g>(
    groups: impl Iterator<Item = &'g mut Vec<T>>,
    members: impl Iterator<Item = (usize, T)>,
) {
    let mut groups: Vec<&mut Vec<T>> = groups.collect();
    for (label, member) in members {
        groups[label].push(member);
    }
    for group in groups {
        group.sort_unstable();
        group.dedup();
    }
}

/// The corners of the faces, where those are one vertex that lie on a common side, and the whole surface's number of
/// each vertex.
fn glue(surface: &Surface, faces: &[FaceId]) -> (Vec<[VertexId; 3]>, Vec<VertexId>) {
    let of = |corner: usize| surface.faces[faces[corner / 3]][corner % 3];
    let mut sides: Vec<(EdgeKey, usize)> = Vec::with_capacity(3 * faces.len());
    sides.extend((0..3 * faces.len()).map(|corner| (edge_key(of(corner), of(next(corner))), corner)));
    sides.sort_unstable();
    let mut same: UnionFind<u32> = UnionFind::new(3 * faces.len());
    for pair in sides.windows(2).filter(|pair| pair[0].0 == pair[1].0) {
        let [(_, a), (_, b)] = [pair[0], pair[1]];
        // The faces run along their common side in opposite ways.
        same.union(a as u32, next(b) as u32);
        same.union(next(a) as u32, b as u32);
    }
    let mut kinds: Vec<(VertexId, u32)> = (0..3 * faces.len()).map(|c| (of(c), same.find(c as u32))).collect();
    let roots: Vec<(VertexId, u32)> = kinds.clone();
    kinds.sort_unstable();
    kinds.dedup();
    let number = |corner: usize| VertexId::new(kinds.partition_point(|kind| *kind < roots[corner]));
    let corners = (0..faces.len()).map(|f| [3 * f, 3 * f + 1, 3 * f + 2].map(number)).collect();
    (corners, kinds.into_iter().map(|(v, _)| v).collect())
}

/// The next corner of the same face.
fn next(corner: usize) -> usize {
    corner - corner % 3 + (corner + 1) % 3
}
