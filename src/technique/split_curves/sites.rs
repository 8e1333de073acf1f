//! The points of curves: where they are, which snap, and the numbers of the new vertices.

use std::collections::{BTreeMap, BTreeSet};

use super::{Flank, Flanks, SplitError};
use crate::mesh::id::Vertex;
use crate::mesh::topology::{EdgeTable, VertexFaces};
use crate::mesh::{Curve, EdgeId, EdgeKey, FaceId, IdVec, MarkCause, Surface, SurfacePoint, VertexId};

/// Where a point of a curve is.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Site {
    Vertex(VertexId),
    Edge(EdgeId, f64),
}

/// A point of a curve: curve and number.
type Place = (usize, usize);

/// The points of all curves.
pub(super) struct Sites<'a> {
    edges: &'a EdgeTable,
    curves: &'a [Curve],
    places: Vec<Vec<Site>>,
    /// The points inside each edge, from its first end to its second.
    on_edge: BTreeMap<EdgeId, Vec<Place>>,
    /// Vertices that points must not snap to: on marked edges and rims, pinned, or on a curve.
    is_taken: IdVec<Vertex, bool>,
}

impl<'a> Sites<'a> {
    pub(super) fn collect(surface: &Surface, edges: &'a EdgeTable, curves: &'a [Curve]) -> Result<Self, SplitError> {
        let mut is_taken = IdVec::filled(false, surface.points.len());
        let rims = edges.iter().filter(|(_, _, sides)| sides.len() == 1).flat_map(|(_, key, _)| key);
        let marked = surface.carried.marks.keys().flatten().copied();
        for v in rims.chain(marked).chain(surface.carried.pins.keys().copied()) {
            is_taken[v] = true;
        }
        let mut made = Self { edges, curves, places: Vec::new(), on_edge: BTreeMap::new(), is_taken };
        for (number, curve) in curves.iter().enumerate() {
            let mut sites = Vec::with_capacity(curve.points.len());
            for (point, &place) in curve.points.iter().enumerate() {
                sites.push(made.site(surface, (number, point), place)?);
            }
            made.places.push(sites);
        }
        for places in made.on_edge.values_mut() {
            let at = |&(curve, point): &Place| match made.places[curve][point] {
                Site::Edge(_, t) => t,
                Site::Vertex(_) => 0.0,
            };
            places.sort_by(|a, b| at(a).total_cmp(&at(b)).then(a.cmp(b)));
        }
        Ok(made)
    }

    fn site(&mut self, surface: &Surface, place: Place, point: SurfacePoint) -> Result<Site, SplitError> {
        let off = SplitError::OffTheSurface { curve: place.0, point: place.1 };
        match point {
            SurfacePoint::Vertex(v) => {
                self.is_taken.get(v).ok_or(off)?;
                self.is_taken[v] = true;
                Ok(Site::Vertex(v))
            }
            SurfacePoint::Edge { edge, t } => {
                let e = self.edges.find(edge).filter(|_| t > 0.0 && t < 1.0).ok_or(off)?;
                if surface.carried.marks.get(&edge).is_some_and(|mark| mark.cause == MarkCause::Seam) {
                    return Err(SplitError::CrossesSeam { curve: place.0, at: surface.points[edge[0]] });
                }
                self.on_edge.entry(e).or_default().push(place);
                Ok(Site::Edge(e, t))
            }
        }
    }

    /// The numbers of the points before and after one of a curve, past those at the same vertex.
    fn beside(&self, (curve, point): Place) -> [Option<usize>; 2] {
        let sites = &self.places[curve];
        let (n, is_closed) = (sites.len(), self.curves[curve].is_closed);
        let other = |k: &usize| sites[*k] != sites[point];
        let before = (0..point).rev().chain((point + 1..n).rev().take_while(|_| is_closed)).find(other);
        let after = (point + 1..n).chain((0..point).take_while(|_| is_closed)).find(other);
        [before, after]
    }

    /// Snaps points to vertices, nearest first; returns how many. A point snaps only if it is the last one before the
    /// vertex, and the vertex is free or the curve comes from there or goes there.
    pub(super) fn snap(&mut self, share: f64) -> usize {
        let mut candidates: Vec<(f64, Place, VertexId)> = Vec::new();
        for (&e, places) in &self.on_edge {
            for &(curve, point) in places {
                if let Site::Edge(_, t) = self.places[curve][point] {
                    let [a, b] = self.edges.key(e);
                    let (away, v) = if t <= 0.5 { (t, a) } else { (1.0 - t, b) };
                    if away < share {
                        candidates.push((away, (curve, point), v));
                    }
                }
            }
        }
        candidates.sort_by(|x, y| x.0.total_cmp(&y.0).then((x.1, x.2).cmp(&(y.1, y.2))));
        let before = candidates.len();
        // One that is kept off by another gets a second chance when that has gone.
        for _ in 0..2 {
            candidates.retain(|&(_, place, v)| !self.try_snap(place, v));
        }
        before - candidates.len()
    }

    fn try_snap(&mut self, place: Place, v: VertexId) -> bool {
        let Site::Edge(e, _) = self.places[place.0][place.1] else { return false };
        let adjoins = self.beside(place).iter().flatten().any(|&k| self.places[place.0][k] == Site::Vertex(v));
        if !self.is_last(place, e, v) || (self.is_taken[v] && !adjoins) {
            return false;
        }
        self.places[place.0][place.1] = Site::Vertex(v);
        self.is_taken[v] = true;
        if let Some(places) = self.on_edge.get_mut(&e) {
            places.retain(|other| *other != place);
        }
        true
    }

    /// Leaves out points from which a curve goes along their edge to a vertex: from the point before it gets there
    /// through the same face, shorter and without a kink. Sides of faces for which `is_free` does not hold are not used
    /// for it. Returns how many.
    pub(super) fn cut_corners(&mut self, is_free: &impl Fn(EdgeId) -> bool) -> usize {
        let mut waiting: Vec<Place> = self.on_edge.values().flatten().copied().collect();
        waiting.sort_unstable();
        let mut followed = self.followed();
        let mut left_out = 0;
        loop {
            let before = waiting.len();
            waiting.retain(|&place| !self.try_cut_corner(place, &mut followed, is_free));
            left_out += before - waiting.len();
            if waiting.len() == before {
                return left_out;
            }
        }
    }

    /// The edges that curves follow from end to end.
    fn followed(&self) -> BTreeSet<EdgeId> {
        let mut followed = BTreeSet::new();
        for (curve, sites) in self.places.iter().enumerate() {
            for point in 0..sites.len() {
                if let [_, Some(next)] = self.beside((curve, point))
                    && let (Site::Vertex(v), Site::Vertex(w)) = (sites[point], sites[next])
                {
                    followed.extend(self.edges.find(crate::mesh::edge_key(v, w)));
                }
            }
        }
        followed
    }

    fn try_cut_corner(
        &mut self,
        place: Place,
        followed: &mut BTreeSet<EdgeId>,
        is_free: &impl Fn(EdgeId) -> bool,
    ) -> bool {
        let (curve, point) = place;
        let sites = &self.places[curve];
        let (Site::Edge(e, _), [Some(before), Some(after)]) = (sites[point], self.beside(place)) else { return false };
        let ends = self.edges.key(e);
        let (v, far) = match (sites[before], sites[after]) {
            (Site::Vertex(v), _) if ends.contains(&v) => (v, after),
            (_, Site::Vertex(v)) if ends.contains(&v) => (v, before),
            _ => return false,
        };
        // Nothing else may lie on the way.
        let side = match sites[far] {
            Site::Vertex(w) => {
                let side = self.edges.find(crate::mesh::edge_key(v, w));
                let empty = |e: &EdgeId| self.on_edge.get(e).is_none_or(Vec::is_empty);
                let Some(side) = side.filter(|e| empty(e) && is_free(*e) && !followed.contains(e)) else {
                    return false;
                };
                Some(side)
            }
            Site::Edge(other, _) if self.edges.key(other).contains(&v) && !self.is_last((curve, far), other, v) => {
                return false;
            }
            Site::Edge(..) => None,
        };
        if !self.is_last(place, e, v) || !self.has_spare_points(curve) {
            return false;
        }
        followed.extend(side);
        self.places[curve][point] = Site::Vertex(v);
        if let Some(places) = self.on_edge.get_mut(&e) {
            places.retain(|other| *other != place);
        }
        true
    }

    /// Whether no other point lies between this one and an end of its edge.
    fn is_last(&self, place: Place, e: EdgeId, v: VertexId) -> bool {
        let Some(places) = self.on_edge.get(&e) else { return false };
        let outermost = if self.edges.key(e)[0] == v { places.first() } else { places.last() };
        outermost == Some(&place)
    }

    /// Whether a curve stays one without a point.
    fn has_spare_points(&self, curve: usize) -> bool {
        let least = if self.curves[curve].is_closed { 5 } else { 4 };
        let steps = self.places[curve].windows(2).filter(|pair| pair[0] != pair[1]);
        steps.take(least).count() == least
    }

    /// Moves points along their edges, in order, until they are `share` of the edge from its ends and each other, or as
    /// far as there is room; returns how many moved.
    pub(super) fn spread(&mut self, share: f64) -> usize {
        let mut moved = 0;
        for places in self.on_edge.values() {
            let n = places.len() as f64;
            let gap = share.min(0.9 / (n + 1.0));
            let mut at: Vec<f64> = places
                .iter()
                .map(|&(curve, point)| match self.places[curve][point] {
                    Site::Edge(_, t) => t,
                    Site::Vertex(_) => 0.0,
                })
                .collect();
            let mut floor = gap;
            for t in &mut at {
                *t = t.max(floor);
                floor = *t + gap;
            }
            let mut ceiling = 1.0 - gap;
            for t in at.iter_mut().rev() {
                *t = t.min(ceiling);
                ceiling = *t - gap;
            }
            for (&(curve, point), t) in places.iter().zip(at) {
                if let Site::Edge(_, old) = &mut self.places[curve][point]
                    && *old != t
                {
                    *old = t;
                    moved += 1;
                }
            }
        }
        moved
    }

    /// Numbers the new vertices edge by edge, and reads the curves as chains of vertices.
    pub(super) fn number(self) -> Layout {
        let first = self.is_taken.len();
        let mut layout =
            Layout { first, crossings: Vec::new(), on_edge: BTreeMap::new(), chains: Vec::new(), of: Vec::new() };
        let mut number: Vec<Vec<VertexId>> =
            self.places.iter().map(|sites| vec![VertexId::from_raw(0); sites.len()]).collect();
        for (&e, places) in self.on_edge.iter().filter(|(_, places)| !places.is_empty()) {
            for &(curve, point) in places {
                let v = VertexId::new(first + layout.crossings.len());
                if let Site::Edge(_, t) = self.places[curve][point] {
                    layout.crossings.push((self.edges.key(e), t));
                    layout.of.push(e);
                    layout.on_edge.entry(e).or_default().push(v);
                    number[curve][point] = v;
                }
            }
        }
        for (sites, number) in self.places.iter().zip(&number) {
            let vertex = |(site, &new): (&Site, &VertexId)| match site {
                Site::Vertex(v) => *v,
                Site::Edge(..) => new,
            };
            let mut chain: Vec<VertexId> = sites.iter().zip(number).map(vertex).collect();
            chain.dedup();
            layout.chains.push(chain);
        }
        for (chain, curve) in layout.chains.iter_mut().zip(self.curves) {
            while curve.is_closed && chain.len() > 1 && chain.first() == chain.last() {
                chain.pop();
            }
        }
        layout
    }
}

/// The new vertices and the curves through them.
pub(super) struct Layout {
    /// The number of old vertices.
    pub(super) first: usize,
    /// The edge and place of each new vertex.
    pub(super) crossings: Vec<(EdgeKey, f64)>,
    /// The new vertices inside each edge, from its first end to its second.
    pub(super) on_edge: BTreeMap<EdgeId, Vec<VertexId>>,
    /// The vertices of each curve, none twice in a row.
    pub(super) chains: Vec<Vec<VertexId>>,
    of: Vec<EdgeId>,
}

impl Layout {
    /// The edge that a new vertex is in.
    fn edge_of(&self, v: VertexId) -> Option<EdgeId> {
        v.index().checked_sub(self.first).map(|k| self.of[k])
    }

    /// The old edge that holds both vertices.
    fn common_edge(&self, edges: &EdgeTable, a: VertexId, b: VertexId) -> Option<EdgeId> {
        match (self.edge_of(a), self.edge_of(b)) {
            (Some(e), Some(f)) => (e == f).then_some(e),
            (Some(e), None) => edges.key(e).contains(&b).then_some(e),
            (None, Some(f)) => edges.key(f).contains(&a).then_some(f),
            (None, None) => edges.find(crate::mesh::edge_key(a, b)),
        }
    }

    /// The vertices on an edge, ends and all, from the first end to the second.
    pub(super) fn along(&self, edges: &EdgeTable, e: EdgeId) -> Vec<VertexId> {
        let [a, b] = edges.key(e);
        let inner = self.on_edge.get(&e).map_or(&[][..], Vec::as_slice);
        [a].into_iter().chain(inner.iter().copied()).chain([b]).collect()
    }
}

/// A segment through the inside of a face.
pub(super) struct Chord {
    pub(super) ends: [VertexId; 2],
    pub(super) curve: usize,
}

/// The segments of the curves.
pub(super) struct Segments {
    pub(super) chords: BTreeMap<FaceId, Vec<Chord>>,
    pub(super) flanks: Flanks,
}

impl Segments {
    /// Says what lies beside a part of a curve; no other may be the same.
    fn flank(
        &mut self,
        [from, to]: [VertexId; 2],
        sides: [u32; 2],
        curve: usize,
        (face, at): (FaceId, glam::DVec3),
    ) -> Result<(), SplitError> {
        for (ends, label) in [([from, to], sides[0]), ([to, from], sides[1])] {
            if let Some(other) = self.flanks.insert(ends, Flank { label, curve }) {
                return Err(SplitError::Crossing { curves: [other.curve, curve], face, at });
            }
        }
        Ok(())
    }
}

/// Sorts the segments into chords of faces and parts of edges.
pub(super) fn segments(
    surface: &Surface,
    edges: &EdgeTable,
    curves: &[Curve],
    layout: &Layout,
) -> Result<Segments, SplitError> {
    let at = VertexFaces::new(surface);
    let faces = |v: VertexId| match layout.edge_of(v) {
        Some(e) => edges.sides(e).iter().map(|side| side.face).collect(),
        None => at.of(v).to_vec(),
    };
    let mut made = Segments { chords: BTreeMap::new(), flanks: Flanks::default() };
    for (number, (chain, curve)) in layout.chains.iter().zip(curves).enumerate() {
        let closing = (curve.is_closed && chain.len() > 2).then(|| [chain[chain.len() - 1], chain[0]]);
        for (point, [a, b]) in chain.windows(2).map(|pair| [pair[0], pair[1]]).chain(closing).enumerate() {
            let face = faces(a).into_iter().find(|f| faces(b).contains(f));
            let face = face.ok_or(SplitError::LeavesTheSurface { curve: number, point })?;
            let at = surface.points[surface.faces[face][0]];
            let mut flank = |from, to| made.flank([from, to], curve.sides, number, (face, at));
            if let Some(e) = layout.common_edge(edges, a, b) {
                let all = layout.along(edges, e);
                let place = |v| all.iter().position(|&w| w == v).unwrap_or(0);
                let (i, j) = (place(a), place(b));
                for k in i.min(j)..i.max(j) {
                    let (from, to) = if i < j { (all[k], all[k + 1]) } else { (all[k + 1], all[k]) };
                    flank(from, to)?;
                }
            } else {
                flank(a, b)?;
                made.chords.entry(face).or_default().push(Chord { ends: [a, b], curve: number });
            }
        }
    }
    Ok(made)
}
