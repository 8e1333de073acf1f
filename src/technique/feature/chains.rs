//! Curves as chains of edges: growing, dropping, corners, counting.

use std::collections::BTreeSet;

use super::{Curves, FeatureRules, Report};
use crate::mesh::geometry::{Aabb, angle};
use crate::mesh::{EdgeId, MarkCause, VertexId};

/// Loose ends grow on where the direction differs by less than this, in degrees.
const GROWTH_TURN: f64 = 30.0;

/// A chain with a loose end that is shorter than this share of the diagonal is dropped.
const LEAST_CHAIN: f64 = 0.005;

/// The edges at each vertex, for some of the edges.
pub(super) struct Incidence {
    offsets: Vec<u32>,
    items: Vec<EdgeId>,
}

impl Incidence {
    pub(super) fn at(&self, v: VertexId) -> &[EdgeId] {
        &self.items[self.offsets[v.index()] as usize..self.offsets[v.index() + 1] as usize]
    }
}

impl Curves<'_> {
    pub(super) fn incidence(&self, chosen: impl Fn(EdgeId) -> bool) -> Incidence {
        let edges = || self.edges.keys().ids().filter(|&e| chosen(e));
        let mut offsets = vec![0_u32; self.surface.points.len() + 1];
        for v in edges().flat_map(|e| self.edges.key(e)) {
            offsets[v.index() + 1] += 1;
        }
        for i in 1..offsets.len() {
            offsets[i] += offsets[i - 1];
        }
        let mut items = vec![EdgeId::from_raw(0); offsets.last().map_or(0, |&n| n as usize)];
        let mut fill = offsets.clone();
        for e in edges() {
            for v in self.edges.key(e) {
                items[fill[v.index()] as usize] = e;
                fill[v.index()] += 1;
            }
        }
        Incidence { offsets, items }
    }

    pub(super) fn other_end(&self, e: EdgeId, v: VertexId) -> VertexId {
        let [a, b] = self.edges.key(e);
        if a == v { b } else { a }
    }

    pub(super) fn length(&self, e: EdgeId) -> f64 {
        let [a, b] = self.edges.key(e);
        self.surface.points[a].distance(self.surface.points[b])
    }

    /// How much the path along `from` and on along `to` turns at `v`, in degrees.
    fn turn(&self, from: EdgeId, v: VertexId, to: EdgeId) -> f64 {
        let [p, q, r] = [self.other_end(from, v), v, self.other_end(to, v)].map(|w| self.surface.points[w]);
        angle(q - p, r - q).to_degrees()
    }

    /// Marks sharp edges by hysteresis and lets loose ends grow on; returns how many edges were grown.
    pub(super) fn mark_sharp(&mut self, rules: &FeatureRules) -> usize {
        let strong = self.incidence(|e| self.angles[e] >= rules.angle);
        let seeds = self.edges.keys().ids().filter(|&e| self.angles[e] >= rules.seed_angle.max(rules.angle));
        let mut waiting: Vec<EdgeId> = seeds.collect();
        let mut is_sharp = vec![false; self.edges.len()];
        while let Some(e) = waiting.pop() {
            if std::mem::replace(&mut is_sharp[e.index()], true) {
                continue;
            }
            waiting.extend(self.edges.key(e).into_iter().flat_map(|v| strong.at(v)).filter(|n| !is_sharp[n.index()]));
        }
        for e in self.edges.keys().ids().filter(|e| is_sharp[e.index()]) {
            self.causes[e].get_or_insert(MarkCause::Feature);
        }
        self.grow(2.0 / 3.0 * rules.angle)
    }

    /// Lets loose ends grow along edges of at least `least` degrees.
    fn grow(&mut self, least: f64) -> usize {
        let weak = self.incidence(|e| self.angles[e] >= least);
        let mut degree = vec![0_u32; self.surface.points.len()];
        for e in self.edges.keys().ids().filter(|&e| self.causes[e].is_some()) {
            for v in self.edges.key(e) {
                degree[v.index()] += 1;
            }
        }
        let curves = self.incidence(|e| self.causes[e].is_some());
        let mut tips: BTreeSet<(VertexId, EdgeId)> = self
            .surface
            .points
            .ids()
            .filter(|v| degree[v.index()] == 1)
            .flat_map(|v| curves.at(v).iter().map(move |&e| (v, e)))
            .filter(|&(_, e)| self.causes[e] == Some(MarkCause::Feature))
            .collect();
        let mut grown = 0;
        while let Some((v, last)) = tips.pop_first() {
            if degree[v.index()] != 1 {
                continue;
            }
            let goes_on = |e: &&EdgeId| self.causes[**e].is_none() && self.turn(last, v, **e) < GROWTH_TURN;
            let sharpest = weak
                .at(v)
                .iter()
                .filter(goes_on)
                .max_by(|a, b| self.angles[**a].total_cmp(&self.angles[**b]).then(b.cmp(a)));
            let Some(&next) = sharpest else { continue };
            self.causes[next] = Some(MarkCause::Feature);
            grown += 1;
            let end = self.other_end(next, v);
            degree[v.index()] += 1;
            degree[end.index()] += 1;
            tips.insert((end, next));
        }
        grown
    }

    /// Drops short sharp chains with a loose end until there is none; returns how many.
    pub(super) fn drop_short_chains(&mut self, rules: &FeatureRules) -> usize {
        let diagonal = Aabb::of(self.surface.points.iter().copied()).diagonal();
        let mut dropped = 0;
        loop {
            let curves = self.incidence(|e| self.causes[e].is_some());
            let mut short = Vec::new();
            for v in self.surface.points.ids().filter(|&v| curves.at(v).len() == 1) {
                let chain = self.chain_from(v, &curves);
                let length: f64 = chain.iter().map(|&e| self.length(e)).sum();
                let has_seed = chain.iter().any(|&e| self.angles[e] >= rules.seed_angle);
                if !chain.is_empty() && (length < LEAST_CHAIN * diagonal || (chain.len() < 3 && !has_seed)) {
                    short.push(chain);
                }
            }
            if short.is_empty() {
                return dropped;
            }
            for chain in short {
                // A chain with two loose ends comes twice.
                dropped += usize::from(self.causes[chain[0]].is_some());
                for e in chain {
                    self.causes[e] = None;
                }
            }
        }
    }

    /// The sharp edges from a loose end to the next vertex where the curve ends, branches or changes its cause.
    fn chain_from(&self, tip: VertexId, curves: &Incidence) -> Vec<EdgeId> {
        let mut chain: Vec<EdgeId> = Vec::new();
        let mut v = tip;
        let is_sharp = |e: &EdgeId| self.causes[*e] == Some(MarkCause::Feature);
        while let Some(&next) = curves.at(v).iter().find(|e| is_sharp(e) && chain.last() != Some(*e)) {
            chain.push(next);
            v = self.other_end(next, v);
            if curves.at(v).len() != 2 {
                break;
            }
        }
        chain
    }

    /// The vertices where the number of curve edges is not 2 or the curve turns by more than `corner_angle`.
    pub(super) fn corners(&self, corner_angle: f64) -> Vec<VertexId> {
        let curves = self.incidence(|e| self.causes[e].is_some());
        let is_corner = |v: &VertexId| match *curves.at(*v) {
            [] => false,
            [a, b] => self.turn(a, *v, b) > corner_angle,
            _ => true,
        };
        self.surface.points.ids().filter(is_corner).collect()
    }

    /// Counts sharp edges, curves, corners and their length.
    pub(super) fn count(&self, corners: &[VertexId], report: &mut Report) {
        let curves = self.incidence(|e| self.causes[e].is_some());
        let mut seen = vec![false; self.edges.len()];
        for e in self.edges.keys().ids().filter(|&e| self.causes[e].is_some()) {
            report.sharp_edges += usize::from(self.causes[e] == Some(MarkCause::Feature));
            report.length += self.length(e);
            if seen[e.index()] {
                continue;
            }
            report.curves += 1;
            let mut waiting = vec![e];
            while let Some(at) = waiting.pop() {
                if std::mem::replace(&mut seen[at.index()], true) {
                    continue;
                }
                let inner = self.edges.key(at).into_iter().filter(|v| corners.binary_search(v).is_err());
                waiting.extend(inner.flat_map(|v| curves.at(v)).filter(|n| !seen[n.index()]));
            }
        }
        report.corners = corners.len();
    }
}
