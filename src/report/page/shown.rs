//! A mesh as the page shows it: few enough faces, numbers packed, colours and lines with it.

use glam::DVec3;
use serde::Serialize;

use super::column::{Column, Merge, Ramp, Reference, columns, cut};
use super::line::{Lines, lines};
use super::pack::{self, Blobs, Grid};
use crate::mesh::{Soup, Support, Surface, VertexId};
use crate::technique::decimate::{Decimated, NONE, decimate};

/// A mesh that is ready to be packed.
#[derive(Clone, Debug)]
pub(super) struct Shown {
    points: Vec<DVec3>,
    /// Corners of each face, three or four.
    faces: Vec<Vec<u32>>,
    columns: Vec<Column>,
    lines: Vec<Lines>,
    totals: [usize; 2],
}

/// A mesh as the viewer reads it.
#[derive(Clone, Debug, Serialize)]
pub(super) struct MeshData {
    /// Vertices and faces of the mesh itself.
    totals: [usize; 2],
    /// Vertices and faces that are shown.
    shown: [usize; 2],
    grid: Grid,
    positions: String,
    corners: String,
    /// Where there are quads: for each face its number of corners less 3.
    quads: Option<String>,
    columns: Vec<ColumnData>,
    lines: Vec<LineData>,
}

#[derive(Clone, Debug, Serialize)]
struct ColumnData {
    key: String,
    title: String,
    unit: &'static str,
    on: &'static str,
    ramp: Ramp,
    range: [f64; 2],
    levels: Vec<f32>,
    names: Vec<String>,
    codes: String,
}

#[derive(Clone, Debug, Serialize)]
struct LineData {
    key: String,
    title: String,
    edges: usize,
    ends: String,
}

/// Computes what is shown of a mesh, with at most `limit` faces; it can be coloured by `more` too.
pub(super) fn shown(
    mesh: &Soup,
    surface: Option<&Surface>,
    reference: Option<&Reference>,
    more: Vec<Column>,
    limit: usize,
) -> Shown {
    let whole = Shown {
        points: mesh.points.as_slice().to_vec(),
        faces: mesh.faces.iter().map(|facet| facet.corners().iter().map(|v| v.raw()).collect()).collect(),
        columns: columns(mesh, surface, reference).into_iter().chain(more).collect(),
        lines: lines(mesh),
        totals: [mesh.points.len(), mesh.faces.len()],
    };
    // A tenth more is not worth another mesh than the one that was computed.
    if mesh.faces.len() > limit + limit / 10 { reduce(mesh, &whole, limit) } else { whole }
}

/// Collapses edges until few enough triangles are left. Each shows the worst of those that it stands for.
fn reduce(mesh: &Soup, whole: &Shown, limit: usize) -> Shown {
    let cuts: Vec<(u32, [u32; 3])> = mesh
        .faces
        .enumerate()
        .flat_map(|(face, facet)| cut(facet).map(move |corners| (face.raw(), corners.map(VertexId::raw))))
        .collect();
    let triangles: Vec<[u32; 3]> = cuts.iter().map(|(_, corners)| *corners).collect();
    let kept: Vec<[u32; 2]> = whole.lines.iter().flat_map(|lines| &lines.edges).copied().collect();
    let small = decimate(mesh.points.as_slice(), &triangles, &kept, limit);
    let owners = owners(mesh, &triangles, &small);
    let columns = whole.columns.iter().map(|column| {
        let values = match column.support {
            Support::Vertex => merged(column, small.points.len(), (0..).zip(&small.vertex).map(|(v, new)| (v, *new))),
            Support::Face if column.ramp == Ramp::Names => {
                small.origin.iter().map(|t| column.values[cuts[*t as usize].0 as usize]).collect()
            }
            Support::Face => merged(
                column,
                small.faces.len(),
                owners.iter().zip(&cuts).map(|(new, (face, _))| (*face as usize, *new)),
            ),
        };
        Column { values, ..column.clone() }
    });
    Shown {
        columns: columns.collect(),
        lines: whole.lines.iter().map(|lines| follow(lines, &small.vertex)).collect(),
        totals: whole.totals,
        faces: small.faces.iter().map(|corners| corners.to_vec()).collect(),
        points: small.points,
    }
}

/// The face that stands for each triangle: of those round the places where its corners went, the nearest to it.
fn owners(mesh: &Soup, triangles: &[[u32; 3]], small: &Decimated) -> Vec<u32> {
    let mut around: Vec<Vec<u32>> = vec![Vec::new(); small.points.len()];
    for (face, corners) in small.faces.iter().enumerate() {
        for &v in corners {
            around[v as usize].push(face as u32);
        }
    }
    let centre = |corners: &[u32; 3]| corners.iter().map(|&v| small.points[v as usize]).sum::<DVec3>() / 3.0;
    let owner = |corners: &[u32; 3]| {
        let at = corners.iter().map(|&v| mesh.points.as_slice()[v as usize]).sum::<DVec3>() / 3.0;
        let near = corners.iter().map(|&v| small.vertex[v as usize]).filter(|v| *v != NONE);
        let faces = near.flat_map(|v| around[v as usize].iter().copied());
        let rated = faces.map(|face| (centre(&small.faces[face as usize]).distance_squared(at), face));
        rated.min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1))).map_or(NONE, |(_, face)| face)
    };
    triangles.iter().map(owner).collect()
}

/// One value for each new element out of those of the old elements that it stands for.
fn merged(column: &Column, count: usize, from: impl Iterator<Item = (usize, u32)>) -> Vec<f64> {
    let mut values = vec![f64::NAN; count];
    let mut parts = vec![0_u32; count];
    for (old, new) in from.filter(|(_, new)| *new != NONE) {
        let (value, slot) = (column.values[old], &mut values[new as usize]);
        if !value.is_finite() {
            continue;
        }
        parts[new as usize] += 1;
        *slot = match column.merge {
            _ if slot.is_nan() => value,
            Merge::Least => slot.min(value),
            Merge::Largest => slot.max(value),
            Merge::Mean => *slot + (value - *slot) / f64::from(parts[new as usize]),
        };
    }
    values
}

/// The lines between the places where their ends went.
fn follow(lines: &Lines, vertex: &[u32]) -> Lines {
    let moved = lines.edges.iter().map(|edge| edge.map(|v| vertex[v as usize]));
    let moved = moved.filter(|[a, b]| a != b && *a != NONE && *b != NONE).map(|[a, b]| [a.min(b), a.max(b)]);
    let mut edges: Vec<[u32; 2]> = moved.collect();
    edges.sort_unstable();
    edges.dedup();
    Lines { edges, ..lines.clone() }
}

impl Shown {
    /// Packs everything into `blobs`. Vertices are numbered by their first use.
    pub(super) fn pack(&self, blobs: &mut Blobs) -> MeshData {
        let mut new = vec![NONE; self.points.len()];
        let mut order = Vec::with_capacity(self.points.len());
        for &v in self.faces.iter().flatten() {
            if new[v as usize] == NONE {
                new[v as usize] = order.len() as u32;
                order.push(v);
            }
        }
        let points: Vec<DVec3> = order.iter().map(|v| self.points[*v as usize]).collect();
        let (grid, positions) = pack::positions(&points);
        let corners = pack::corners(self.faces.iter().flatten().map(|v| new[*v as usize]));
        let has_quads = self.faces.iter().any(|corners| corners.len() == 4);
        let kinds: Vec<u8> = self.faces.iter().map(|corners| corners.len() as u8 - 3).collect();
        MeshData {
            totals: self.totals,
            shown: [points.len(), self.faces.len()],
            grid,
            positions: blobs.add(&positions),
            corners: blobs.add(&corners),
            quads: has_quads.then(|| blobs.add(&kinds)),
            columns: self.columns.iter().map(|column| pack_column(column, &order, blobs)).collect(),
            lines: self.lines.iter().map(|lines| pack_lines(lines, &new, blobs)).collect(),
        }
    }
}

fn pack_column(column: &Column, order: &[u32], blobs: &mut Blobs) -> ColumnData {
    let values: Vec<f64> = match column.support {
        Support::Face => column.values.clone(),
        Support::Vertex => order.iter().map(|v| column.values[*v as usize]).collect(),
    };
    let (levels, codes) = match column.ramp {
        Ramp::Names => (Vec::new(), pack::varints(values.iter().map(|label| *label as u32))),
        Ramp::Quality | Ramp::Sequential | Ramp::Diverging => pack::levels(&values),
    };
    ColumnData {
        key: column.key.clone(),
        title: column.title.clone(),
        unit: column.unit,
        on: match column.support {
            Support::Face => "face",
            Support::Vertex => "vertex",
        },
        ramp: column.ramp,
        range: column.range,
        levels,
        names: column.names.clone(),
        codes: blobs.add(&codes),
    }
}

fn pack_lines(lines: &Lines, new: &[u32], blobs: &mut Blobs) -> LineData {
    let ends = lines.edges.iter().map(|edge| edge.map(|v| new[v as usize])).filter(|edge| !edge.contains(&NONE));
    let mut ends: Vec<[u32; 2]> = ends.map(|[a, b]| [a.min(b), a.max(b)]).collect();
    ends.sort_unstable();
    LineData {
        key: lines.key.clone(),
        title: lines.title.clone(),
        edges: ends.len(),
        ends: blobs.add(&pack::pairs(&ends)),
    }
}
