//! Curves that run alongside each other: of two that are nearer than a gap, only the sharper stays marked.
//!
//! Two marked curves that meet at a small angle, or bound a strip thinner than the tolerance, force slivers between
//! them. Within such a gap they are one curve for any purpose of the mesh, so the less sharp one is set free there. The
//! decision is made per chain, so that one curve of a pair is kept as a whole and the other is not left in pieces.

use std::ops::ControlFlow;

use glam::DVec3;

use super::Curves;
use crate::mesh::bvh::SegmentBvh;
use crate::mesh::geometry::{Aabb, closest_on_segment};
use crate::mesh::id::{Edge, IdVec};
use crate::mesh::{EdgeId, MarkCause};

/// Where a curve is looked at, as shares of each of its edges.
const SAMPLES: [f64; 5] = [0.1, 0.3, 0.5, 0.7, 0.9];

/// Curves run alongside where their directions differ by less than 30 degrees.
const ALONGSIDE: f64 = 0.866;

/// The way to the other curve leads across: a curve that goes straight on is not alongside itself.
const ACROSS: f64 = 0.5;

impl Curves<'_> {
    /// Unmarks sharp edges that run within `gap` of a sharper chain; returns how many.
    pub(super) fn drop_alongside(&mut self, gap: f64, corner_angle: f64) -> usize {
        if gap <= 0.0 {
            return 0;
        }
        let marked: Vec<EdgeId> = self.edges.keys().ids().filter(|&e| self.causes[e].is_some()).collect();
        let rank = self.ranks(&marked, corner_angle);
        let segments: Vec<[DVec3; 2]> = marked.iter().map(|&e| self.ends(e)).collect();
        let tree = SegmentBvh::new(segments);
        let mut order: Vec<usize> = (0..marked.len()).collect();
        order.sort_by_key(|&i| std::cmp::Reverse(rank[i]));
        let mut is_kept = vec![false; marked.len()];
        let mut dropped = 0;
        for i in order {
            let is_sharp = self.causes[marked[i]] == Some(MarkCause::Feature);
            let beats = |other: usize| is_kept[other] && rank[other] > rank[i];
            if is_sharp && self.runs_alongside(marked[i], gap, &tree, &marked, beats) {
                self.causes[marked[i]] = None;
                dropped += 1;
            } else {
                is_kept[i] = true;
            }
        }
        dropped
    }

    fn ends(&self, e: EdgeId) -> [DVec3; 2] {
        self.edges.key(e).map(|v| self.surface.points[v])
    }

    /// The rank of each marked edge's chain: rims, borders and seams first, then by sharpness, then the lower number.
    fn ranks(&self, marked: &[EdgeId], corner_angle: f64) -> Vec<(u64, std::cmp::Reverse<u32>)> {
        let chain = self.chains(marked, corner_angle);
        let mut sums: IdVec<Edge, (f64, f64)> = IdVec::filled((0.0, 0.0), self.edges.len());
        for &e in marked {
            let length = self.length(e);
            let sharpness = if self.causes[e] == Some(MarkCause::Feature) { self.angles[e] } else { 1e6 };
            let sum = &mut sums[chain[e]];
            *sum = (sum.0 + length * sharpness, sum.1 + length);
        }
        let rank = |e: &EdgeId| {
            let (weighted, length) = sums[chain[*e]];
            // Thousandths of a degree: chains that differ by rounding only are told apart by their number.
            let mean = if length > 0.0 { (1000.0 * weighted / length).round() as u64 } else { 0 };
            (mean, std::cmp::Reverse(chain[*e].raw()))
        };
        marked.iter().map(rank).collect()
    }

    /// The lowest edge of the chain that each marked edge belongs to; chains end at corners and branches.
    fn chains(&self, marked: &[EdgeId], corner_angle: f64) -> IdVec<Edge, EdgeId> {
        let curves = self.incidence(|e| self.causes[e].is_some());
        let corners = self.corners(corner_angle);
        let mut chain: IdVec<Edge, EdgeId> = self.edges.keys().ids().collect();
        let mut seen = vec![false; self.edges.len()];
        for &first in marked {
            let mut waiting = vec![first];
            while let Some(e) = waiting.pop() {
                if std::mem::replace(&mut seen[e.index()], true) {
                    continue;
                }
                chain[e] = first;
                let inner = self.edges.key(e).into_iter().filter(|v| corners.binary_search(v).is_err());
                waiting.extend(inner.flat_map(|v| curves.at(v)).filter(|n| !seen[n.index()]));
            }
        }
        chain
    }

    /// Whether all of the edge has one of the `beating` edges beside it.
    fn runs_alongside(
        &self,
        e: EdgeId,
        gap: f64,
        tree: &SegmentBvh,
        marked: &[EdgeId],
        beating: impl Fn(usize) -> bool,
    ) -> bool {
        let [a, b] = self.ends(e);
        let Some(direction) = (b - a).try_normalize() else { return false };
        SAMPLES.iter().all(|&t| {
            let p = a + t * (b - a);
            let area = Aabb::of([p]).grown(gap);
            let found = tree.for_each_in(&area, |index, &[c, d]| {
                let other = index as usize;
                let away = closest_on_segment(p, [c, d]).point - p;
                let is_beside = marked[other] != e
                    && beating(other)
                    && away.length_squared() <= gap * gap
                    && away.dot(direction).abs() <= ACROSS * away.length()
                    && (d - c).normalize_or_zero().dot(direction).abs() >= ALONGSIDE;
                if is_beside { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
            });
            found.is_break()
        })
    }
}
