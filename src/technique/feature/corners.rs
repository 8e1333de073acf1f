//! Corners and islands of curves that zigzag along the edges of a scan.

use std::collections::BTreeSet;

use glam::DVec3;

use super::Curves;
use super::chains::Incidence;
use crate::mesh::geometry::angle;
use crate::mesh::{EdgeId, MarkCause, VertexId};

impl Curves<'_> {
    /// Drops connected sets of sharp edges that are shorter than `least` in all; returns how many.
    pub(super) fn drop_islands(&mut self, least: f64) -> usize {
        let curves = self.incidence(|e| self.causes[e].is_some());
        let mut seen = vec![false; self.edges.len()];
        let mut dropped = 0;
        for first in self.edges.keys().ids() {
            if self.causes[first].is_none() || seen[first.index()] {
                continue;
            }
            let mut island: Vec<EdgeId> = Vec::new();
            let mut waiting = vec![first];
            while let Some(e) = waiting.pop() {
                if !std::mem::replace(&mut seen[e.index()], true) {
                    island.push(e);
                    waiting.extend(self.edges.key(e).into_iter().flat_map(|v| curves.at(v)).copied());
                }
            }
            let length: f64 = island.iter().map(|&e| self.length(e)).sum();
            if length < least && island.iter().all(|&e| self.causes[e] == Some(MarkCause::Feature)) {
                dropped += 1;
                for e in island {
                    self.causes[e] = None;
                }
            }
        }
        dropped
    }

    /// The vertices where the number of curve edges is not 2, or where the curve turns by more than `corner_angle`
    /// between its arms of length `arm`; of such turns within an arm the strongest counts.
    pub(super) fn corners_by_arm(&self, corner_angle: f64, arm: f64) -> Vec<VertexId> {
        let curves = self.incidence(|e| self.causes[e].is_some());
        let mut corners: BTreeSet<VertexId> = BTreeSet::new();
        let mut turns: Vec<(f64, VertexId)> = Vec::new();
        for v in self.surface.points.ids() {
            match *curves.at(v) {
                [] => {}
                [a, b] => {
                    let [p, q] = [a, b].map(|e| self.arm(v, e, arm, &curves).1);
                    let here = self.surface.points[v];
                    let turn = angle(here - p, q - here).to_degrees();
                    if turn > corner_angle {
                        turns.push((turn, v));
                    }
                }
                _ => {
                    corners.insert(v);
                }
            }
        }
        turns.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        for (_, v) in turns {
            let near = curves.at(v).iter().any(|&e| {
                let (passed, _) = self.arm(v, e, arm, &curves);
                passed.iter().any(|w| corners.contains(w))
            });
            if !near {
                corners.insert(v);
            }
        }
        corners.into_iter().collect()
    }

    /// The vertices along a curve from `v` over `first`, up to where the length is spent or the curve ends or branches,
    /// and the last place reached.
    fn arm(&self, v: VertexId, first: EdgeId, length: f64, curves: &Incidence) -> (Vec<VertexId>, DVec3) {
        let (mut at, mut edge, mut left) = (v, first, length);
        let mut passed = Vec::new();
        loop {
            at = self.other_end(edge, at);
            passed.push(at);
            left -= self.length(edge);
            let next = match *curves.at(at) {
                [a, b] if left > 0.0 && at != v => {
                    if a == edge {
                        b
                    } else {
                        a
                    }
                }
                _ => return (passed, self.surface.points[at]),
            };
            edge = next;
        }
    }
}
