//! Makes arcs geodesic by flipping edges of an intrinsic triangulation.
//!
//! The arcs are paths of edges. Where a path makes an angle of less than 180 degrees at a vertex on one side, the edges
//! in that wedge are flipped until the outer border of the wedge is locally straight, and the path moves over to it;
//! smallest angle first. Paths are edges of one triangulation, so they never cross. Ends, marked edges and vertices
//! that arcs may not touch stay; a path that would have to touch another arc stays where it is.
//!
//! A geodesic may lie far from its arc. Where it does, or cannot be drawn, the arc is held at a vertex of its middle,
//! and all is done again.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use super::intrinsic::{Intrinsic, is_straight};
use super::network::{Network, Place, per_edge};
use super::trace::trace;
use super::unfold::Leash;
use crate::mesh::halfedge::{edge_of, twin};
use crate::mesh::id::{Edge, Vertex};
use crate::mesh::{HalfedgeId, HalfedgeMesh, IdVec, VertexId};
use crate::technique::arcs::Arc;
use crate::watch::{Cancelled, Watch};

/// After so many rounds of holding arcs in their middles, what still fails is left as it was.
const MOST_ROUNDS: usize = 12;
/// A closed arc is held at this many vertices, or it would shrink away.
const ANCHORS: usize = 4;

/// What flipping did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Flips {
    /// Edges flipped, in the last round.
    pub flips: usize,
    /// Vertices that arcs were pulled off, in the last round.
    pub moves: usize,
    /// Rounds of holding arcs back.
    pub rounds: usize,
}

/// A network of the arcs made geodesic between the places where they are held.
///
/// # Errors
/// The run was interrupted.
pub fn flip<'a>(
    mesh: &'a HalfedgeMesh,
    is_fixed: &'a IdVec<Vertex, bool>,
    arcs: &[Arc],
    leash: &Leash,
    watch: &Watch,
) -> Result<(Network<'a>, Flips), Cancelled> {
    let mut held = is_fixed.clone();
    for arc in arcs.iter().filter(|arc| arc.is_closed) {
        let n = arc.vertices.len();
        for k in 0..ANCHORS.min(n) {
            held[arc.vertices[k * n / ANCHORS.min(n)]] = true;
        }
    }
    let mut rounds = 0;
    loop {
        watch.check()?;
        let mut paths = Paths::new(mesh, &held, arcs);
        paths.straighten(watch)?;
        let mut faults: Vec<Vec<VertexId>> = Vec::new();
        let mut network = Network::new(mesh, is_fixed);
        for (number, arc) in arcs.iter().enumerate() {
            let places = paths.draw(mesh, number, arc, |places| {
                let off = |&place: &Place| leash.distance(number, network.point(place)) > leash.reach;
                places.is_some_and(|places| !places.iter().any(off))
            });
            match places {
                Ok(places) => network.add(&places, arc.is_closed, arc.sides),
                Err(spans) => faults.extend(spans),
            }
        }
        let report = paths.report;
        if faults.is_empty() {
            return Ok((network, Flips { rounds, ..report }));
        }
        for span in faults {
            let middle = span.len() / 2;
            let holds = if rounds < MOST_ROUNDS { &span[middle..=middle] } else { &span[..] };
            for &v in holds {
                held[v] = true;
            }
        }
        rounds += 1;
    }
}

/// Paths of edges through an intrinsic triangulation.
struct Paths<'a> {
    flat: Intrinsic,
    held: &'a IdVec<Vertex, bool>,
    /// The half-edge of the path into and out of each vertex inside a path.
    through: IdVec<Vertex, Option<[HalfedgeId; 2]>>,
    /// The first half-edge of each span between held vertices, with the span of each vertex inside one.
    first: Vec<HalfedgeId>,
    span: IdVec<Vertex, u32>,
    /// The number of each arc's first span.
    arc_spans: Vec<usize>,
    /// Edges of paths, and marked ones.
    is_locked: IdVec<Edge, bool>,
    heap: BinaryHeap<Reverse<(u64, VertexId)>>,
    report: Flips,
}

/// The vertex chains of an arc between held vertices; the last of a closed arc ends where the first begins.
fn spans(arc: &Arc, held: &IdVec<Vertex, bool>) -> Vec<Vec<VertexId>> {
    let mut vertices = arc.vertices.clone();
    if arc.is_closed {
        let start = vertices.iter().position(|&v| held[v]).unwrap_or(0);
        vertices.rotate_left(start);
        vertices.push(vertices[0]);
    }
    let mut spans: Vec<Vec<VertexId>> = Vec::new();
    let mut current = vec![vertices[0]];
    for &v in &vertices[1..] {
        current.push(v);
        if held[v] {
            spans.push(std::mem::replace(&mut current, vec![v]));
        }
    }
    if current.len() > 1 {
        spans.push(current);
    }
    spans
}

impl<'a> Paths<'a> {
    fn new(mesh: &HalfedgeMesh, held: &'a IdVec<Vertex, bool>, arcs: &[Arc]) -> Self {
        let mut paths = Self {
            flat: Intrinsic::new(mesh),
            held,
            through: IdVec::filled(None, mesh.vertex_slots()),
            first: Vec::new(),
            span: IdVec::filled(0, mesh.vertex_slots()),
            arc_spans: Vec::new(),
            is_locked: per_edge(mesh, false),
            heap: BinaryHeap::new(),
            report: Flips::default(),
        };
        for e in mesh.edges().filter(|&e| mesh.edge_mark(e).is_some()) {
            paths.is_locked[e] = true;
        }
        for arc in arcs {
            paths.arc_spans.push(paths.first.len());
            for span in spans(arc, held) {
                paths.add(mesh, &span);
            }
        }
        paths
    }

    fn add(&mut self, mesh: &HalfedgeMesh, span: &[VertexId]) {
        let edges: Vec<HalfedgeId> = span.windows(2).filter_map(|pair| mesh.find_halfedge(pair[0], pair[1])).collect();
        let number = self.first.len() as u32;
        self.first.extend(edges.first());
        for &h in &edges {
            self.is_locked[edge_of(h)] = true;
        }
        for pair in edges.windows(2) {
            let v = mesh.target(pair[0]);
            self.through[v] = Some([pair[0], pair[1]]);
            self.span[v] = number;
            self.wait(v);
        }
    }

    /// The smaller angle at a vertex inside a path, and whether it is on the left.
    fn turn(&self, v: VertexId) -> Option<(f64, bool)> {
        let [into, out] = self.through[v]?;
        let (left, right) = (self.flat.wedge(out, twin(into)), self.flat.wedge(twin(into), out));
        Some(if left <= right { (left, true) } else { (right, false) })
    }

    fn wait(&mut self, v: VertexId) {
        if let Some((angle, _)) = self.turn(v)
            && !is_straight(angle)
        {
            // Angles are not negative, so their bits are in order.
            self.heap.push(Reverse((angle.to_bits(), v)));
        }
    }

    fn straighten(&mut self, watch: &Watch) -> Result<(), Cancelled> {
        while let Some(Reverse((bits, v))) = self.heap.pop() {
            watch.check()?;
            match self.turn(v) {
                Some((angle, is_left)) if angle.to_bits() == bits => self.shorten(v, is_left),
                Some((angle, _)) if angle > f64::from_bits(bits) => self.wait(v),
                _ => {}
            }
        }
        Ok(())
    }

    /// Pulls a path off a vertex.
    fn shorten(&mut self, v: VertexId, is_left: bool) {
        let Some([into, out]) = self.through[v] else { return };
        let (start, end) = if is_left { (out, twin(into)) } else { (twin(into), out) };
        if self.flat.target(start) == self.flat.target(end) {
            return;
        }
        self.flip_wedge(start, end);
        let mut outer = Vec::new();
        let mut h = start;
        while h != end {
            outer.push(self.flat.next(h));
            h = self.flat.turned(h);
        }
        let meets = |h: &HalfedgeId| self.held[self.flat.origin(*h)] || self.through[self.flat.origin(*h)].is_some();
        let length: f64 = outer.iter().map(|&h| self.flat.length(h)).sum();
        let is_taken = outer.iter().any(|&h| self.is_locked[edge_of(h)]) || outer[1..].iter().any(meets);
        if is_taken || length >= self.flat.length(into) + self.flat.length(out) {
            return;
        }
        if is_left {
            outer.reverse();
            for h in &mut outer {
                *h = twin(*h);
            }
        }
        self.reroute(v, [into, out], &outer);
    }

    /// Flips edges between two half-edges out of a vertex while one can straighten the outer border.
    fn flip_wedge(&mut self, start: HalfedgeId, end: HalfedgeId) {
        let mut h = self.flat.turned(start);
        while h != end {
            let e = edge_of(h);
            let next = self.flat.turned(h);
            if !self.is_locked[e] && !is_straight(self.flat.far_angle(h)) && self.flat.flip(e) {
                self.report.flips += 1;
                // The spokes beside it have lost a face at their far ends.
                h = self.flat.turned(start);
            } else {
                h = next;
            }
        }
    }

    /// Leads a path along `new` instead of over `v`.
    fn reroute(&mut self, v: VertexId, [into, out]: [HalfedgeId; 2], new: &[HalfedgeId]) {
        let span = self.span[v];
        let (before, after) = (self.flat.origin(into), self.flat.target(out));
        self.through[v] = None;
        for h in [into, out] {
            self.is_locked[edge_of(h)] = false;
        }
        for &h in new {
            self.is_locked[edge_of(h)] = true;
        }
        // A span may begin and end at the same vertex; inside it, vertices are its own.
        match &mut self.through[before] {
            Some([_, leave]) => *leave = new[0],
            None => self.first[span as usize] = new[0],
        }
        if let Some([arrive, _]) = &mut self.through[after] {
            *arrive = new[new.len() - 1];
        }
        for pair in new.windows(2) {
            let w = self.flat.target(pair[0]);
            self.through[w] = Some([pair[0], pair[1]]);
            self.span[w] = span;
            self.wait(w);
        }
        self.wait(before);
        self.wait(after);
        self.report.moves += 1;
    }

    /// The places of an arc on the surface, or the spans that cannot be drawn or do not fit.
    fn draw(
        &self,
        mesh: &HalfedgeMesh,
        number: usize,
        arc: &Arc,
        fits: impl Fn(Option<&[Place]>) -> bool,
    ) -> Result<Vec<Place>, Vec<Vec<VertexId>>> {
        let (mut places, mut faults) = (Vec::new(), Vec::new());
        for (k, span) in spans(arc, self.held).into_iter().enumerate() {
            let drawn = self.draw_span(mesh, self.arc_spans[number] + k);
            if span.len() > 2 && !fits(drawn.as_deref()) {
                faults.push(span);
            } else {
                places.extend(drawn.unwrap_or_default());
            }
        }
        if !arc.is_closed {
            places.extend(arc.vertices.last().map(|&v| Place::Vertex(v)));
        }
        if faults.is_empty() { Ok(places) } else { Err(faults) }
    }

    /// The places of a span without its last.
    fn draw_span(&self, mesh: &HalfedgeMesh, number: usize) -> Option<Vec<Place>> {
        let mut places = Vec::new();
        let mut h = *self.first.get(number)?;
        loop {
            let (from, to) = (self.flat.origin(h), self.flat.target(h));
            places.push(Place::Vertex(from));
            places.extend(trace(mesh, from, self.flat.direction(h), self.flat.length(h), to)?);
            let Some([_, out]) = self.through[to] else { return Some(places) };
            h = out;
        }
    }
}
