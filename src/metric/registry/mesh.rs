//! Metrics of any mesh.

use glam::DVec3;

use super::super::Value;
use super::super::intersection::faces_of;
use super::super::subject::Subject;
use super::super::summary::{count, number};
use super::Direction::{Higher, Lower, Neutral};
use super::Needs::Mesh;
use super::Unit::{Area, Count, Flag, Length, Ratio, Share, Volume};
use super::{MetricDef, flag, metric};

fn side(s: &Subject<'_>) -> DVec3 {
    let bounds = s.extent().bounds;
    if bounds.is_empty() { DVec3::ZERO } else { bounds.max - bounds.min }
}

/// The volume, where there is an inside.
pub(super) fn enclosed(s: &Subject<'_>) -> Option<f64> {
    s.topology().is_closed().then(|| s.extent().volume)
}

fn share(part: usize, whole: usize) -> Option<f64> {
    (whole > 0).then(|| part as f64 / whole as f64)
}

/// A count of what meets, which is a lower bound where counting stopped.
fn crossings(s: &Subject<'_>, found: usize) -> Option<Value> {
    if s.intersections().complete { count(found) } else { Some(Value::AtLeast(found as u64)) }
}

pub(super) static METRICS: &[MetricDef] = &[
    metric("vertices", Count, Neutral, Mesh, "Vertices that a face uses.", |s| count(s.topology().vertices)),
    metric("faces", Count, Neutral, Mesh, "Triangles and quads.", |s| count(s.mesh().faces.len())),
    metric("triangles", Count, Neutral, Mesh, "Triangles.", |s| count(s.triangles().faces.len())),
    metric("quads", Count, Neutral, Mesh, "Quads.", |s| count(s.quads().faces.len())),
    metric("edges", Count, Neutral, Mesh, "Distinct edges of faces without repeated corners.", |s| {
        count(s.topology().edges)
    }),
    metric("boundary-edges", Count, Lower, Mesh, "Edges with one face.", |s| count(s.topology().boundary.len())),
    metric("boundary-loops", Count, Lower, Mesh, "Connected components of the boundary edges.", |s| {
        count(s.topology().boundary_loops)
    }),
    metric("components", Count, Neutral, Mesh, "Parts connected over vertices.", |s| count(s.topology().components)),
    metric("shells", Count, Neutral, Mesh, "Parts connected over edges.", |s| count(s.topology().shells)),
    metric(
        "euler-characteristic",
        Count,
        Neutral,
        Mesh,
        "Vertices − edges + faces, without faces of repeated corners.",
        |s| Some(Value::Integer(s.topology().euler())),
    ),
    metric(
        "genus",
        Ratio,
        Neutral,
        Mesh,
        "Handles: (2·shells − loops − χ) / 2; of a manifold, oriented mesh only.",
        |s| number(s.topology().genus()),
    ),
    metric("closed", Flag, Higher, Mesh, "Every edge has two faces, and there is one.", |s| {
        flag(s.topology().is_closed())
    }),
    metric("manifold", Flag, Higher, Mesh, "Edge-manifold and vertex-manifold.", |s| {
        flag(s.topology().is_edge_manifold() && s.topology().is_vertex_manifold())
    }),
    metric("edge-manifold", Flag, Higher, Mesh, "No edge has more than two faces.", |s| {
        flag(s.topology().is_edge_manifold())
    }),
    metric("vertex-manifold", Flag, Higher, Mesh, "The faces at every vertex form one fan.", |s| {
        flag(s.topology().is_vertex_manifold())
    }),
    metric("non-manifold-edges", Count, Lower, Mesh, "Edges with more than two faces.", |s| {
        count(s.topology().non_manifold_edges.len())
    }),
    metric("non-manifold-vertices", Count, Lower, Mesh, "Vertices of several fans or on a non-manifold edge.", |s| {
        count(s.topology().non_manifold_vertices.len())
    }),
    metric(
        "oriented",
        Flag,
        Higher,
        Mesh,
        "Edge-manifold, and the two faces at every inner edge run it in opposite ways.",
        |s| flag(s.topology().is_oriented()),
    ),
    metric("inconsistent-edges", Count, Lower, Mesh, "Edges whose two faces run them in the same way.", |s| {
        count(s.topology().inconsistent.len())
    }),
    metric(
        "duplicate-faces",
        Count,
        Lower,
        Mesh,
        "Faces whose corners another face of the same kind has, less one of each.",
        |s| count(s.topology().duplicates.len()),
    ),
    metric("repeated-vertex-faces", Count, Lower, Mesh, "Faces that have a corner twice.", |s| {
        count(s.topology().repeated.len())
    }),
    metric(
        "degenerate-faces",
        Count,
        Lower,
        Mesh,
        "Repeated corner; triangle with height / longest side < 1e-6; quad with area < 1e-6 · longest side².",
        |s| count(s.degenerate().len()),
    ),
    metric(
        "self-intersecting-faces",
        Count,
        Lower,
        Mesh,
        "Faces that run through another one or lie on it, decided exactly; quads cut on the shorter diagonal.",
        |s| crossings(s, faces_of(s.intersections().crossing()).len()),
    ),
    metric(
        "self-intersections",
        Count,
        Lower,
        Mesh,
        "Pairs of such faces; counting stops at a million, or where too many boxes overlap, and says so with ≥.",
        |s| crossings(s, s.intersections().crossing().count()),
    ),
    metric(
        "contacts",
        Count,
        Lower,
        Mesh,
        "Pairs of faces that only touch outside what they share, or lie against each other as touching bodies do.",
        |s| crossings(s, s.intersections().contacts() as usize),
    ),
    metric("area", Area, Neutral, Mesh, "Sum of face areas; a quad is the mean of its two cuts.", |s| {
        number(Some(s.extent().area))
    }),
    metric(
        "volume",
        Volume,
        Neutral,
        Mesh,
        "Signed volume of a closed mesh; a quad is the mean of its two cuts.",
        |s| number(enclosed(s)),
    ),
    metric("diagonal", Length, Neutral, Mesh, "Diagonal of the bounding box.", |s| {
        number(Some(s.extent().bounds.diagonal()))
    }),
    metric("extent-x", Length, Neutral, Mesh, "Bounding box along x.", |s| number(Some(side(s).x))),
    metric("extent-y", Length, Neutral, Mesh, "Bounding box along y.", |s| number(Some(side(s).y))),
    metric("extent-z", Length, Neutral, Mesh, "Bounding box along z.", |s| number(Some(side(s).z))),
    metric("min-valence", Count, Neutral, Mesh, "Least number of edges at a vertex.", |s| {
        count(s.topology().valence.iter().copied().filter(|&n| n > 0).min()? as usize)
    }),
    metric("max-valence", Count, Lower, Mesh, "Largest number of edges at a vertex.", |s| {
        count(s.topology().valence.iter().copied().filter(|&n| n > 0).max()? as usize)
    }),
    metric("triangle-share", Share, Lower, Mesh, "Triangles / faces.", |s| {
        number(share(s.triangles().faces.len(), s.mesh().faces.len()))
    }),
];
