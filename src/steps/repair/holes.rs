//! Boundary loops: listed always, filled where wanted and where a fill does no harm.
//!
//! A loop that passes one place several times is taken apart there first, and the copies of that vertex are joined. A
//! fill is refused when it would repeat an edge of the surface, fold back onto it or run through it: so islands inside
//! a hole are never bridged or buried.

use std::ops::ControlFlow;

use glam::DVec3;
use rustc_hash::FxHashSet;

use super::adjacency::{EdgeTable, NONE, Twins, face_of, fan, head, next, tail};
use super::cut;
use super::draft::{Draft, Origin, normal};
use super::params::FillHoles;
use super::patch::{Patch, Surroundings, fair, refine};
use super::report::{LISTED, LoopFate, LoopStats, RepairStats};
use crate::mesh::bvh::{Primitive, TriangleBvh};
use crate::mesh::id::Vertex;
use crate::mesh::predicate::triangle_triangle;
use crate::mesh::{EdgeKey, HalfedgeId, IdVec, VertexId, edge_key};
use crate::technique::triangulate_loop::Loop;
use crate::watch::{Cancelled, Watch};

/// A fill with a bend beyond this (1 - cosine, so 170 degrees) folds back.
const FOLDED: f64 = 1.985;
/// A fill with a bend beyond this has a triangle without area.
const FLAT: f64 = 2.5;

/// Lists the loops and fills those that are wanted; returns whether the faces have changed.
pub(super) fn fill_holes(
    draft: &mut Draft,
    twins: &mut Twins,
    wanted: FillHoles,
    diagonal: f64,
    stats: &mut RepairStats,
    watch: &Watch,
) -> Result<bool, Cancelled> {
    let loops = boundary_loops(draft, twins);
    let mut fates = vec![LoopFate::Open; loops.len()];
    let lengths: Vec<f64> = loops.iter().map(|border| length(draft, border)).collect();
    let longest = match wanted {
        FillHoles::None => -1.0,
        FillHoles::All => f64::INFINITY,
        FillHoles::UpTo(limit) => limit.resolve(diagonal),
    };
    stats.boundary_loops = loops.len() as u64;
    let listed: Vec<LoopStats> =
        loops.iter().zip(&lengths).map(|(border, &length)| describe(draft, border, length)).collect();
    if lengths.iter().any(|&length| length <= longest) {
        let mut filler = Filler::new(draft, twins);
        watch.phase("fill holes", Some(loops.len() as u64));
        for (i, border) in loops.iter().enumerate().filter(|&(i, _)| lengths[i] <= longest) {
            watch.check()?;
            fates[i] = filler.fill(border);
            watch.advance(i as u64 + 1, || format!("{} edges", border.len()));
        }
        stats.faces_filled = filler.added;
        filler.leave();
    }
    stats.holes_filled = fates.iter().filter(|&&fate| fate == LoopFate::Filled).count() as u64;
    stats.loops = listed.into_iter().zip(fates).map(|(entry, fate)| LoopStats { fate, ..entry }).collect();
    stats.loops.sort_by(|a, b| b.length.total_cmp(&a.length));
    stats.loops.truncate(LISTED);
    Ok(stats.holes_filled > 0)
}

/// The half-edges along each border, in the direction of the faces, loops in the order of their lowest half-edge.
fn boundary_loops(draft: &Draft, twins: &Twins) -> Vec<Vec<HalfedgeId>> {
    let mut seen = vec![false; twins.len()];
    let mut loops = Vec::new();
    for start in twins.ids().filter(|&h| twins[h] == NONE) {
        let mut border = Vec::new();
        let mut here = start;
        while !seen[here.index()] {
            seen[here.index()] = true;
            border.push(here);
            here = next(here);
            while twins[here] != NONE {
                here = next(twins[here]);
            }
        }
        if !border.is_empty() {
            debug_assert_eq!(tail(&draft.faces, start), head(&draft.faces, border[border.len() - 1]));
            loops.push(border);
        }
    }
    loops
}

fn length(draft: &Draft, border: &[HalfedgeId]) -> f64 {
    let edge = |&h: &HalfedgeId| draft.points[tail(&draft.faces, h)].distance(draft.points[head(&draft.faces, h)]);
    border.iter().map(edge).sum()
}

fn describe(draft: &Draft, border: &[HalfedgeId], length: f64) -> LoopStats {
    let sum: DVec3 = border.iter().map(|&h| draft.points[tail(&draft.faces, h)]).sum();
    let centre = (sum / border.len() as f64).to_array();
    LoopStats { edges: border.len() as u64, length, centre, fate: LoopFate::Open }
}

/// Fills one loop after the other, each checked against the surface and the fills before it.
struct Filler<'a> {
    draft: &'a mut Draft,
    twins: &'a mut Twins,
    /// The surface before filling.
    surface: TriangleBvh,
    /// Triangles added so far.
    fills: Vec<[DVec3; 3]>,
    /// Edges between border vertices, by place: a fill may not repeat them.
    taken: FxHashSet<EdgeKey>,
    /// The vertex that each one is joined with.
    joined: IdVec<Vertex, VertexId>,
    added: u64,
}

impl<'a> Filler<'a> {
    fn new(draft: &'a mut Draft, twins: &'a mut Twins) -> Self {
        let surface = TriangleBvh::new(draft.faces.ids().map(|f| draft.corners(f)).collect());
        let mut on_border = IdVec::<Vertex, bool>::filled(false, draft.points.len());
        for h in twins.ids().filter(|&h| twins[h] == NONE) {
            on_border[draft.root[tail(&draft.faces, h)]] = true;
        }
        let ends = |h: HalfedgeId| [tail(&draft.faces, h), head(&draft.faces, h)].map(|v| draft.root[v]);
        let taken = twins.ids().map(ends).filter(|e| e.iter().all(|&v| on_border[v])).map(|[a, b]| edge_key(a, b));
        let taken = taken.collect();
        let joined = draft.points.ids().collect();
        Self { draft, twins, surface, fills: Vec::new(), taken, joined, added: 0 }
    }

    fn fill(&mut self, border: &[HalfedgeId]) -> LoopFate {
        let rings = self.rings(border);
        let mut patches: Vec<Patch> = Vec::new();
        for ring in &rings {
            match self.patch(ring, &patches) {
                Ok(patch) => patches.push(patch),
                Err(fate) => return fate,
            }
        }
        for (ring, patch) in rings.iter().zip(patches) {
            self.add(ring, &patch);
        }
        LoopFate::Filled
    }

    /// The parts of a loop that pass every place once. Two edges that lie on each other are not taken apart.
    fn rings(&self, border: &[HalfedgeId]) -> Vec<Vec<HalfedgeId>> {
        let place = |h: HalfedgeId| self.draft.root[tail(&self.draft.faces, h)];
        let mut rings = Vec::new();
        let mut open: Vec<HalfedgeId> = Vec::new();
        for &h in border {
            let earlier = open.iter().rposition(|&g| place(g) == place(h));
            if let Some(start) = earlier.filter(|&start| open.len() - start >= 3) {
                rings.push(open.split_off(start));
            }
            open.push(h);
        }
        rings.push(open);
        if rings.iter().any(|ring| ring.len() < 3) { vec![border.to_vec()] } else { rings }
    }

    /// The fill of a ring: smooth and fine if that does no harm, else coarse.
    fn patch(&self, ring: &[HalfedgeId], others: &[Patch]) -> Result<Patch, LoopFate> {
        let points: Vec<DVec3> = ring.iter().map(|&h| self.draft.points[tail(&self.draft.faces, h)]).collect();
        let normals: Vec<DVec3> =
            ring.iter().map(|&h| normal(self.draft.corners(face_of(h))).normalize_or_zero()).collect();
        let places: Vec<VertexId> = ring.iter().map(|&h| self.draft.root[tail(&self.draft.faces, h)]).collect();
        let is_free = |i: usize, k: usize| !self.taken.contains(&edge_key(places[i], places[k]));
        if ring.len() < 3 {
            return Err(LoopFate::Blocked);
        }
        let coarse = Loop { points: &points, normals: &normals, is_free: &is_free };
        let coarse = coarse.triangulate().ok_or(LoopFate::Blocked)?;
        match coarse.bend {
            bend if bend > FLAT => return Err(LoopFate::Slit),
            bend if bend > FOLDED => return Err(LoopFate::FoldsBack),
            _ => {}
        }
        let coarse_patch = Patch { points, triangles: coarse.triangles, rim: ring.len() };
        let around = self.surroundings(ring);
        let mut fine = coarse_patch.clone();
        refine(&mut fine, &around, &is_free);
        let mut smooth = fine.clone();
        fair(&mut smooth, &around, coarse.rim_bend);
        let harmless = |patch: &Patch| !self.runs_into(patch, others);
        [smooth, fine, coarse_patch].into_iter().find(harmless).ok_or(LoopFate::Obstructed)
    }

    fn surroundings(&self, ring: &[HalfedgeId]) -> Surroundings {
        let neighbours: Vec<Vec<DVec3>> = ring.iter().map(|&h| self.inner_neighbours(h)).collect();
        let scale = ring.iter().enumerate().map(|(i, &h)| {
            let point = self.draft.points[tail(&self.draft.faces, h)];
            let [after, before] = [1, ring.len() - 1].map(|step| {
                let other = ring[(i + step) % ring.len()];
                self.draft.points[tail(&self.draft.faces, other)]
            });
            let all = neighbours[i].iter().chain([&after, &before]);
            all.map(|p| p.distance(point)).sum::<f64>() / (neighbours[i].len() + 2) as f64
        });
        Surroundings { scale: scale.collect(), neighbours }
    }

    /// The neighbours of a border vertex that are not its neighbours on the border.
    fn inner_neighbours(&self, h: HalfedgeId) -> Vec<DVec3> {
        let (ring, _) = fan(self.twins, h);
        ring.iter().skip(1).map(|&g| self.draft.points[head(&self.draft.faces, g)]).collect()
    }

    /// Whether a patch meets the surface or another fill elsewhere than along its rim.
    fn runs_into(&self, patch: &Patch, others: &[Patch]) -> bool {
        let corners =
            |patch: &Patch| -> Vec<[DVec3; 3]> { patch.triangles.iter().map(|t| t.map(|v| patch.points[v])).collect() };
        let own = TriangleBvh::new(corners(patch));
        let before: Vec<[DVec3; 3]> = others.iter().flat_map(corners).chain(self.fills.iter().copied()).collect();
        let stop_at = |meets: bool| if meets { ControlFlow::Break(()) } else { ControlFlow::Continue(()) };
        let meets = |mine: [DVec3; 3], other: &[DVec3; 3]| triangle_triangle(mine, *other).is_intersection();
        let own_corners = corners(patch);
        let into_itself =
            own.for_each_self_pair(|i, j| stop_at(meets(own_corners[i as usize], &own_corners[j as usize])));
        into_itself.is_break()
            || own_corners.iter().any(|&mine| {
                self.surface.for_each_in(&mine.bounds(), |_, other| stop_at(meets(mine, other))).is_break()
            })
            || before
                .iter()
                .any(|other| own.for_each_in(&other.bounds(), |_, mine| stop_at(meets(*mine, other))).is_break())
    }

    /// Adds the faces of a patch; copies of its corners become one vertex each.
    fn add(&mut self, ring: &[HalfedgeId], patch: &Patch) {
        let beside = Origin::Filled(self.draft.origin[face_of(ring[0])].face());
        let mut vertices: Vec<VertexId> = Vec::with_capacity(patch.points.len());
        for (i, &h) in ring.iter().enumerate() {
            let corner = tail(&self.draft.faces, h);
            vertices.push(corner);
            // The end of the edge before may be another copy of this place.
            let end = head(&self.draft.faces, ring[(i + ring.len() - 1) % ring.len()]);
            let (a, b) = (self.join_root(corner), self.join_root(end));
            self.joined[a.max(b)] = a.min(b);
        }
        for &point in &patch.points[patch.rim..] {
            let near = |&&a: &&VertexId, &&b: &&VertexId| {
                let [a, b] = [a, b].map(|v| self.draft.points[v].distance_squared(point));
                a.total_cmp(&b)
            };
            let nearest = vertices[..patch.rim].iter().min_by(near).copied().unwrap_or(vertices[0]);
            let vertex = self.draft.new_vertex(point, &[nearest]);
            self.joined.push(vertex);
            vertices.push(vertex);
        }
        for t in &patch.triangles {
            let corners = t.map(|v| vertices[v]);
            self.fills.push(t.map(|v| patch.points[v]));
            self.draft.push_face(corners, beside);
            self.added += 1;
            for k in 0..3 {
                let [a, b] = [corners[k], corners[(k + 1) % 3]].map(|v| self.draft.root[v]);
                self.taken.insert(edge_key(a, b));
            }
        }
    }

    fn join_root(&self, mut v: VertexId) -> VertexId {
        while self.joined[v] != v {
            v = self.joined[v];
        }
        v
    }

    /// Joins the copies, and finds the twins of the new faces.
    fn leave(self) {
        let target: IdVec<Vertex, VertexId> = self.joined.ids().map(|v| self.join_root(v)).collect();
        let Self { draft, twins, .. } = self;
        draft.redirect(&target);
        *twins = EdgeTable::new(&draft.faces, draft.points.len()).twins();
        // Where only one of two loops at a place was filled, two fans may meet again.
        cut::cut(draft, twins, false);
    }
}
