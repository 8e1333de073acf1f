//! Cracks between borders that run beside each other, wider than what welding may close: they are zipped.
//!
//! # Algorithm
//! Two borders are the sides of a crack where they are nearly parallel, and each lies where the face at the other one
//! would go on. Corners of both that are each other's nearest become one in the middle between them. Each further
//! corner is put on the edge across, both half the way, so that the sides match.
//!
//! # Invariants
//! - Nothing moves further than the width of the widest gap, and nothing that is no border is joined. Sides of a strip
//!   that is narrower than that stay apart, and so do the rims of a plate that has no wall between them.
//!
//! # Cost
//! O(B log B) in border edges; where very many lie within the width, looking stops and the rest stays open.

use std::ops::ControlFlow;

use glam::DVec3;

use super::adjacency::{EdgeTable, apex, head, tail};
use super::draft::Draft;
use super::tjunction::{Hit, split_edges};
use crate::mesh::bvh::SegmentBvh;
use crate::mesh::geometry::Aabb;
use crate::mesh::id::Vertex;
use crate::mesh::{HalfedgeId, IdVec, VertexId};

/// The cosine of the angle up to which borders count as parallel: 30 degrees.
const PARALLEL: f64 = 0.866;
/// The cosine of the angle between the way across and the way in which a face would go on: 60 degrees.
const ONWARD: f64 = 0.5;
/// Candidates that any mesh may have, and further ones for each border edge.
const CANDIDATES: (usize, usize) = (1 << 22, 64);

/// What was zipped.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Zipped {
    /// Vertices that became one with another one, or were put on an edge.
    pub(super) vertices: u64,
    /// How far the surface moved at most.
    pub(super) distance: f64,
}

/// An open edge.
#[derive(Clone, Copy)]
struct Border {
    halfedge: HalfedgeId,
    ends: [VertexId; 2],
    along: DVec3,
    length: f64,
    /// Away from its face, in the face's plane.
    onward: DVec3,
}

impl Border {
    fn new(draft: &Draft, halfedge: HalfedgeId) -> Self {
        let ends = [tail(&draft.faces, halfedge), head(&draft.faces, halfedge)];
        let [a, b] = ends.map(|v| draft.points[v]);
        let along = (b - a).normalize_or_zero();
        let inward = (draft.points[apex(&draft.faces, halfedge)] - a).reject_from_normalized(along);
        Self { halfedge, ends, along, length: a.distance(b), onward: -inward.normalize_or_zero() }
    }

    /// Whether the way across leads from this side of a crack to the other one.
    fn faces(&self, other: &Self, across: DVec3) -> bool {
        let width = across.length();
        self.along.dot(other.along).abs() >= PARALLEL
            && across.dot(self.onward) >= ONWARD * width
            && -across.dot(other.onward) >= ONWARD * width
    }
}

/// Zips what is no wider than `width`.
pub(super) fn zip(draft: &mut Draft, table: &EdgeTable, width: f64) -> Zipped {
    let mut zipped = Zipped::default();
    if width <= 0.0 {
        return zipped;
    }
    let (joined, shift) = join_corners(draft, table, width);
    let table = if joined > 0 { &EdgeTable::new(&draft.faces, draft.points.len()) } else { table };
    // Half of the way is moved on either side.
    let (put, further) = put_on_edges(draft, table, width.min(2.0 * (width - shift)));
    zipped.vertices = joined + put;
    zipped.distance = shift + further;
    zipped
}

/// All open edges, which of them meet at each vertex, and a search for them.
struct Borders {
    all: Vec<Border>,
    at: IdVec<Vertex, Vec<u32>>,
    tree: SegmentBvh,
    left: usize,
}

impl Borders {
    fn new(draft: &Draft, table: &EdgeTable) -> Self {
        let open = table.edges().filter(|(_, _, group)| group.len() == 1).map(|(_, _, group)| group[0].1);
        let all: Vec<Border> = open.map(|h| Border::new(draft, h)).collect();
        let mut at = IdVec::filled(Vec::new(), draft.points.len());
        for (number, border) in all.iter().enumerate() {
            border.ends.iter().for_each(|&v| at[v].push(number as u32));
        }
        let tree = SegmentBvh::new(all.iter().map(|border| border.ends.map(|v| draft.points[v])).collect());
        let left = CANDIDATES.0 + CANDIDATES.1 * all.len();
        Self { all, at, tree, left }
    }

    fn vertices(&self) -> Vec<VertexId> {
        self.at.ids().filter(|&v| !self.at[v].is_empty()).collect()
    }

    /// Open edges within the width of a point, as far as looking goes.
    fn near(&mut self, point: DVec3, width: f64) -> Vec<u32> {
        let mut found = Vec::new();
        let left = &mut self.left;
        let _ = self.tree.for_each_in(&Aabb::of([point]).grown(width), |number, _| {
            if *left == 0 {
                return ControlFlow::Break(());
            }
            *left -= 1;
            found.push(number);
            ControlFlow::Continue(())
        });
        found.sort_unstable();
        found
    }
}

/// Lets corners across a crack that are each other's nearest be one, in the middle; says how many, and the furthest.
fn join_corners(draft: &mut Draft, table: &EdgeTable, width: f64) -> (u64, f64) {
    let mut borders = Borders::new(draft, table);
    let mut nearest: IdVec<Vertex, Option<VertexId>> = IdVec::filled(None, draft.points.len());
    for v in borders.vertices() {
        let point = draft.points[v];
        let mut best: Option<(f64, VertexId)> = None;
        for number in borders.near(point, width) {
            let other = borders.all[number as usize];
            for u in other.ends.into_iter().filter(|&u| u != v) {
                let across = draft.points[u] - point;
                let fits = |own: &u32| {
                    let own = &borders.all[*own as usize];
                    let beside = across.dot(own.along).abs() <= 0.5 * own.length.min(other.length);
                    beside && !own.ends.contains(&u) && own.faces(&other, across)
                };
                let candidate = (across.length(), u);
                let is_nearer = best.is_none_or(|known| candidate < known);
                if candidate.0 <= width && is_nearer && borders.at[v].iter().any(fits) {
                    best = Some(candidate);
                }
            }
        }
        nearest[v] = best.map(|(_, u)| u);
    }
    let mut target: IdVec<Vertex, VertexId> = draft.points.ids().collect();
    let (mut joined, mut shift) = (0, 0.0_f64);
    for v in draft.points.ids() {
        let Some(u) = nearest[v].filter(|&u| v < u && nearest[u] == Some(v)) else { continue };
        shift = shift.max(0.5 * draft.points[u].distance(draft.points[v]));
        draft.points[v] = draft.points[u].midpoint(draft.points[v]);
        target[u] = v;
        joined += 1;
    }
    if joined > 0 {
        draft.redirect(&target);
    }
    (joined, shift)
}

/// Puts corners on the edge across the crack, both half the way; says how many, and how far.
fn put_on_edges(draft: &mut Draft, table: &EdgeTable, width: f64) -> (u64, f64) {
    let mut borders = Borders::new(draft, table);
    let mut hits: Vec<Hit> = Vec::new();
    let mut moves = Vec::new();
    for v in borders.vertices() {
        let point = draft.points[v];
        let mut best: Option<(f64, u32, f64)> = None;
        for number in borders.near(point, width) {
            let other = borders.all[number as usize];
            let [a, b] = other.ends.map(|u| draft.points[u]);
            let at = (point - a).dot(b - a) / (b - a).length_squared();
            let across = a.lerp(b, at) - point;
            let fits = |own: &u32| borders.all[*own as usize].faces(&other, across);
            let is_nearer = best.is_none_or(|known| (across.length(), number) < (known.0, known.1));
            let is_own = other.ends.contains(&v) || apex(&draft.faces, other.halfedge) == v;
            if at > 0.0
                && at < 1.0
                && across.length() <= width
                && is_nearer
                && !is_own
                && borders.at[v].iter().any(fits)
            {
                best = Some((across.length(), number, at));
            }
        }
        let Some((distance, number, at)) = best else { continue };
        let other = borders.all[number as usize];
        let [a, b] = other.ends.map(|u| draft.points[u]);
        moves.push((v, point.midpoint(a.lerp(b, at))));
        hits.push(Hit { edge: other.halfedge, at, vertex: v, distance: 0.5 * distance });
    }
    let distance = hits.iter().map(|hit| hit.distance).fold(0.0, f64::max);
    for (v, point) in moves {
        draft.points[v] = point;
    }
    (split_edges(draft, hits), distance)
}
