//! Triangles without height: a needle loses its short edge, a cap hands its long edge to the neighbour.
//!
//! After Botsch, Kobbelt: A robust procedure to eliminate degenerate faces from triangle meshes. VMV 2001, who slice
//! caps; a flip does the same without new vertices. Each operation keeps the topology (link condition), lets no face
//! with an area turn over, and moves the surface within the budget that is left.

use rustc_hash::{FxHashMap, FxHashSet};

use super::adjacency::{NONE, Twins, apex, corner_of, face_of, fan, halfedge, head, next, previous, tail};
use super::cut::join;
use super::draft::{Draft, flatness, normal};
use crate::mesh::id::{Face, Vertex};
use crate::mesh::{Carried, EdgeKey, FaceId, HalfedgeId, IdVec, VertexId, edge_key};

/// A face is degenerate when its height is below this share of its longest edge.
const DEGENERATE: f64 = 1e-6;

/// What must stay as it is.
pub(super) struct Kept {
    /// Edges that may not be flipped away.
    pub(super) edges: FxHashSet<EdgeKey>,
    /// Vertices that may not be collapsed: pinned ones, ends of such edges, and those with copies.
    pub(super) vertices: IdVec<Vertex, bool>,
}

impl Kept {
    /// What the input marks or names, and the vertices on cuts: their copies must stay alike.
    pub(super) fn new(draft: &Draft, carried: &Carried) -> Self {
        let place = |v: VertexId| draft.root[draft.of_input[v]];
        let named = carried.groups.edges.values().flatten().chain(carried.marks.keys());
        let edges: FxHashSet<EdgeKey> = named.flat_map(|&[a, b]| draft.parts_of_edge(place(a), place(b))).collect();
        let mut places = IdVec::filled(false, draft.points.len());
        for &v in carried.pins.keys() {
            places[place(v)] = true;
        }
        for v in draft.points.ids().filter(|&v| draft.root[v] != v) {
            places[draft.root[v]] = true;
        }
        for [a, b] in carried.groups.edges.values().flatten().chain(carried.marks.keys()) {
            places[place(*a)] = true;
            places[place(*b)] = true;
        }
        let vertices = draft.points.ids().map(|v| places[draft.root[v]]).collect();
        Self { edges, vertices }
    }
}

/// What was found and done.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Cleaned {
    /// Degenerate faces at first.
    pub(super) found: u64,
    /// Edges collapsed.
    pub(super) collapsed: u64,
    /// Edges flipped.
    pub(super) flipped: u64,
    /// Faces taken away at the border.
    pub(super) dropped: u64,
    /// Degenerate faces that are left.
    pub(super) left: u64,
    /// How far the surface moved at most.
    pub(super) moved: f64,
}

/// Removes degenerate faces while the surface moves no further than `budget`.
pub(super) fn remove_degenerate(draft: &mut Draft, twins: &mut Twins, kept: &Kept, budget: f64) -> Cleaned {
    let is_degenerate = |draft: &Draft, f: FaceId| flatness(draft.corners(f)) < DEGENERATE;
    let mut open: Vec<FaceId> = draft.faces.ids().filter(|&f| is_degenerate(draft, f)).collect();
    let mut cleaned = Cleaned { found: open.len() as u64, ..Cleaned::default() };
    if open.is_empty() {
        return cleaned;
    }
    let dead = IdVec::filled(false, draft.faces.len());
    let mut bench = Bench { draft, twins, kept, budget, dead, drift: FxHashMap::default(), merged: Vec::new() };
    loop {
        let mut progress = false;
        for &face in &open {
            // An earlier operation may have mended or removed it.
            if !bench.dead[face] && is_degenerate(bench.draft, face) {
                progress |= bench.mend(face, &mut cleaned);
            }
        }
        open.retain(|&f| !bench.dead[f] && is_degenerate(bench.draft, f));
        if !progress || open.is_empty() {
            break;
        }
    }
    cleaned.left = open.len() as u64;
    cleaned.moved = bench.drift.values().fold(0.0, |most, &moved| most.max(moved));
    bench.leave();
    cleaned
}

struct Bench<'a> {
    draft: &'a mut Draft,
    twins: &'a mut Twins,
    kept: &'a Kept,
    budget: f64,
    dead: IdVec<Face, bool>,
    /// How far the surface at a vertex has moved by all operations so far.
    drift: FxHashMap<VertexId, f64>,
    /// Removed vertices with the ones that took their place, in order.
    merged: Vec<(VertexId, VertexId)>,
}

impl Bench<'_> {
    fn length(&self, h: HalfedgeId) -> f64 {
        self.draft.points[tail(&self.draft.faces, h)].distance(self.draft.points[head(&self.draft.faces, h)])
    }

    fn drift_at(&self, vertices: &[VertexId]) -> f64 {
        vertices.iter().filter_map(|v| self.drift.get(v)).fold(0.0, |most, &moved| most.max(moved))
    }

    /// Tries what fits the face; says whether anything was done.
    fn mend(&mut self, face: FaceId, cleaned: &mut Cleaned) -> bool {
        let edges = [0, 1, 2].map(|i| halfedge(face, i));
        let lengths = edges.map(|h| self.length(h));
        let order = |i: &usize, j: &usize| lengths[*i].total_cmp(&lengths[*j]).then(i.cmp(j));
        let (Some(shortest), Some(longest)) = ((0..3).min_by(order), (0..3).max_by(order)) else {
            return false;
        };
        let height = normal(self.draft.corners(face)).length() / lengths[longest];
        if self.collapse(edges[shortest], lengths[shortest]) {
            cleaned.collapsed += 1;
        } else if self.twins[edges[longest]] == NONE {
            if !self.drop_at_border(edges[longest], height) {
                return false;
            }
            cleaned.dropped += 1;
        } else if self.flip(edges[longest], height) {
            cleaned.flipped += 1;
        } else {
            return false;
        }
        true
    }

    /// Collapses an edge onto that one of its ends which the surface can spare less.
    fn collapse(&mut self, h: HalfedgeId, length: f64) -> bool {
        let (a, b) = (tail(&self.draft.faces, h), head(&self.draft.faces, h));
        let moved = length + self.drift_at(&[a, b]);
        if moved > self.budget || !self.may_join(h) {
            return false;
        }
        let (ring_a, closed_a) = fan(self.twins, h);
        let (ring_b, closed_b) = fan(self.twins, next(h));
        let removes_b = !self.kept.vertices[b] && (closed_b || !closed_a) && self.stays_upright(&ring_b, b, a);
        let removes_a =
            !removes_b && !self.kept.vertices[a] && (closed_a || !closed_b) && self.stays_upright(&ring_a, a, b);
        if !removes_a && !removes_b {
            return false;
        }
        let (removed, onto, ring) = if removes_b { (b, a, ring_b) } else { (a, b, ring_a) };
        for spoke in ring {
            self.draft.faces[face_of(spoke)][corner_of(spoke)] = onto;
        }
        let twin = self.twins[h];
        self.close_gap(h);
        if twin != NONE {
            self.close_gap(twin);
        }
        self.merged.push((removed, onto));
        self.drift.insert(onto, moved);
        true
    }

    /// The link condition: the ends have no common neighbours but the corners across the edge, which have faces left.
    fn may_join(&self, h: HalfedgeId) -> bool {
        let sides: Vec<HalfedgeId> = [h, self.twins[h]].into_iter().filter(|&h| h != NONE).collect();
        let (ring_a, closed_a) = self.neighbours(h);
        let (ring_b, closed_b) = self.neighbours(next(h));
        let across: Vec<VertexId> = sides.iter().map(|&h| apex(&self.draft.faces, h)).collect();
        let joins_borders = !closed_a && !closed_b && sides.len() == 2;
        let common = ring_a.iter().filter(|v| ring_b.contains(v)).count();
        let spares_face = |&h: &HalfedgeId| {
            let (around, closed) = self.neighbours(previous(h));
            around.len() > if closed { 3 } else { 2 }
        };
        !joins_borders && common == across.len() && sides.iter().all(spares_face)
    }

    /// The vertices joined to the tail of `h` by an edge, and whether its faces close to a ring.
    fn neighbours(&self, h: HalfedgeId) -> (Vec<VertexId>, bool) {
        let (ring, closed) = fan(self.twins, h);
        let mut around: Vec<VertexId> = ring.iter().map(|&h| head(&self.draft.faces, h)).collect();
        if let (false, Some(&last)) = (closed, ring.last()) {
            around.push(apex(&self.draft.faces, last));
        }
        (around, closed)
    }

    /// Whether the faces that stay keep their side and an area when `vertex` moves onto `onto`.
    fn stays_upright(&self, ring: &[HalfedgeId], vertex: VertexId, onto: VertexId) -> bool {
        ring.iter().all(|&spoke| {
            let corners = self.draft.faces[face_of(spoke)];
            if corners.contains(&onto) {
                return true;
            }
            let before = self.draft.corners(face_of(spoke));
            let after = corners.map(|v| self.draft.points[if v == vertex { onto } else { v }]);
            let was_flat = flatness(before) < DEGENERATE;
            was_flat || (flatness(after) >= DEGENERATE && normal(before).dot(normal(after)) > 0.0)
        })
    }

    /// Removes a face whose edge `h` has collapsed: its two other sides become one edge.
    fn close_gap(&mut self, h: HalfedgeId) {
        let (left, right) = (self.twins[next(h)], self.twins[previous(h)]);
        if left != NONE {
            self.twins[left] = right;
        }
        if right != NONE {
            self.twins[right] = left;
        }
        self.kill(face_of(h));
    }

    fn kill(&mut self, face: FaceId) {
        self.dead[face] = true;
        for i in 0..3 {
            self.twins[halfedge(face, i)] = NONE;
        }
    }

    /// Flips the long edge of a cap, which puts the cap's tip on the neighbour's side of it.
    fn flip(&mut self, h: HalfedgeId, height: f64) -> bool {
        let t = self.twins[h];
        let faces = &self.draft.faces;
        let (a, b) = (tail(faces, h), head(faces, h));
        let (c, d) = (apex(faces, h), apex(faces, t));
        let moved = height + self.drift_at(&[a, b, c, d]);
        let keeps = self.kept.edges.contains(&edge_key(self.draft.root[a], self.draft.root[b]))
            || (self.kept.vertices[c] && self.kept.vertices[d]);
        if moved > self.budget || keeps || c == d || self.neighbours(previous(h)).0.contains(&d) {
            return false;
        }
        let at = |corners: [VertexId; 3]| corners.map(|v| self.draft.points[v]);
        let (cap, side) = (at([a, b, c]), at([b, a, d]));
        let (first, second) = (at([d, c, a]), at([c, d, b]));
        let worse = flatness(first).min(flatness(second));
        let fits = if flatness(side) < DEGENERATE {
            // Two flat faces on one line: shorter edges bring the cap nearer to a face that has a height.
            self.draft.points[c].distance(self.draft.points[d]) < self.length(h)
        } else {
            let up = normal(side);
            worse > flatness(cap) && up.dot(normal(first)) > 0.0 && up.dot(normal(second)) > 0.0
        };
        if fits {
            self.turn_edge(h);
            for v in [a, b, c, d] {
                self.drift.insert(v, moved);
            }
        }
        fits
    }

    fn turn_edge(&mut self, h: HalfedgeId) {
        let t = self.twins[h];
        let (f, g) = (face_of(h), face_of(t));
        let (i, j) = (corner_of(h), corner_of(t));
        let (a, b) = (tail(&self.draft.faces, h), head(&self.draft.faces, h));
        let (c, d) = (apex(&self.draft.faces, h), apex(&self.draft.faces, t));
        let [bc, ca] = [self.twins[next(h)], self.twins[previous(h)]];
        let [ad, db] = [self.twins[next(t)], self.twins[previous(t)]];
        for (face, start, corners) in [(f, i, [d, c, a]), (g, j, [c, d, b])] {
            for (k, corner) in corners.into_iter().enumerate() {
                self.draft.faces[face][(start + k) % 3] = corner;
            }
        }
        for (side, other) in [(next(h), ca), (previous(h), ad), (next(t), db), (previous(t), bc)] {
            self.twins[side] = NONE;
            if other != NONE {
                join(self.twins, side, other);
            }
        }
        // A cap has no area to speak of: what both faces cover now was the neighbour's.
        if flatness(self.draft.corners(f)) >= DEGENERATE && flatness(self.draft.corners(g)) >= DEGENERATE {
            self.draft.origin[f] = self.draft.origin[g];
        }
    }

    /// Takes away a cap whose long edge is open, unless its tip is all that holds two parts of the surface together.
    fn drop_at_border(&mut self, h: HalfedgeId, height: f64) -> bool {
        let (a, b) = (tail(&self.draft.faces, h), head(&self.draft.faces, h));
        let c = apex(&self.draft.faces, h);
        let moved = height + self.drift_at(&[a, b, c]);
        let (_, is_inside) = fan(self.twins, previous(h));
        let at_end = self.twins[next(h)] == NONE || self.twins[previous(h)] == NONE;
        let keeps = self.kept.edges.contains(&edge_key(self.draft.root[a], self.draft.root[b]));
        if moved > self.budget || keeps || !(is_inside || at_end) {
            return false;
        }
        for side in [next(h), previous(h)] {
            let across = self.twins[side];
            if across != NONE {
                self.twins[across] = NONE;
            }
        }
        self.kill(face_of(h));
        self.drift.insert(c, moved);
        true
    }

    /// Drops the removed faces, and lets the input's vertices follow the collapsed ones.
    fn leave(self) {
        let Self { draft, twins, dead, merged, .. } = self;
        if !merged.is_empty() {
            let mut target: IdVec<Vertex, VertexId> = draft.points.ids().collect();
            // A later collapse may have removed the vertex that an earlier one kept.
            for &(removed, onto) in merged.iter().rev() {
                target[removed] = target[onto];
            }
            draft.redirect(&target);
        }
        if dead.iter().any(|&d| d) {
            let keep: Vec<bool> = dead.iter().map(|&d| !d).collect();
            draft.retain_faces(&keep);
            *twins = super::adjacency::EdgeTable::new(&draft.faces, draft.points.len()).twins();
        }
    }
}
