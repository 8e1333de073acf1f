//! Curves that run alongside each other: of two that are nearer than a gap, only the sharper stays marked.
//!
//! Two marked curves that meet at a small angle, or bound a strip thinner than the tolerance, force slivers between
//! them. Within such a gap they are one curve for any purpose of the mesh, so the less sharp one is set free there. The
//! decision is made per chain, so that one curve of a pair is kept as a whole and the other is not left in pieces.
//!
//! The two edges along a thin wall's rim, or along a slot's mouth, both stay unless the wall is a mere sheet: with one
//! curve for both, the surface would fold back on itself there, and faces on a fold have no side that is out.

use std::ops::ControlFlow;

use glam::DVec3;

use super::Curves;
use crate::mesh::bvh::SegmentBvh;
use crate::mesh::geometry::{Aabb, closest_on_segment};
use crate::mesh::id::{Edge, IdVec};
use crate::mesh::topology::components;
use crate::mesh::{EdgeId, MarkCause};

/// Where a curve is looked at, as shares of each of its edges.
const SAMPLES: [f64; 5] = [0.1, 0.3, 0.5, 0.7, 0.9];

/// Curves run alongside where their directions differ by less than 30 degrees.
const ALONGSIDE: f64 = 0.866;

/// Across two curves the surface folds where its normals turn by more than 150 degrees: this is the cosine.
const FOLDED: f64 = -0.866;

/// Strips thinner than this part of the gap would need thousands of faces: one curve stands for both even on a fold.
const THIN: f64 = 0.1;

/// A fold shorter than so many gaps is a spot on a rough surface, and no wall's rim.
const RIM: f64 = 10.0;

/// The way to the other curve leads across: a curve that goes straight on is not alongside itself.
const ACROSS: f64 = 0.5;

/// What an edge has beside it.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Meeting {
    /// No curve, or not all along.
    Apart,
    /// A curve within the gap.
    Alongside,
    /// One to which the surface turns back on itself.
    Folded,
}

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
        // A body that touches another one keeps its edges, wherever those of the other lie.
        let parts = components(self.surface);
        let part = |i: usize| self.edges.sides(marked[i]).first().map(|side| parts.of_face[side.face]);
        let mut order: Vec<usize> = (0..marked.len()).collect();
        order.sort_by_key(|&i| std::cmp::Reverse(rank[i]));
        let mut is_kept = vec![false; marked.len()];
        let mut dropped = 0;
        for chain in order.chunk_by(|&i, &j| rank[i] == rank[j]) {
            let own = part(chain[0]);
            let beats = |other: usize| is_kept[other] && rank[other] > rank[chain[0]] && part(other) == own;
            let meeting = |&i: &usize| {
                let is_sharp = self.causes[marked[i]] == Some(MarkCause::Feature);
                if is_sharp { self.meeting(marked[i], gap, &tree, &marked, beats) } else { Meeting::Apart }
            };
            let meetings: Vec<Meeting> = chain.iter().map(meeting).collect();
            let length = |which: Meeting| -> f64 {
                let all = chain.iter().zip(&meetings).filter(|(_, meeting)| **meeting == which);
                all.map(|(&i, _)| self.length(marked[i])).sum()
            };
            let folded = length(Meeting::Folded);
            let stays = folded > length(Meeting::Alongside) && folded > RIM * gap;
            for (&i, meeting) in chain.iter().zip(&meetings) {
                is_kept[i] = stays || *meeting == Meeting::Apart;
                if !is_kept[i] {
                    self.causes[marked[i]] = None;
                    dropped += 1;
                }
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

    /// What the edge has beside it, all along, of the `beating` ones.
    fn meeting(
        &self,
        e: EdgeId,
        gap: f64,
        tree: &SegmentBvh,
        marked: &[EdgeId],
        beating: impl Fn(usize) -> bool,
    ) -> Meeting {
        let [a, b] = self.ends(e);
        let Some(direction) = (b - a).try_normalize() else { return Meeting::Apart };
        let mut folded = 0;
        for t in SAMPLES {
            let p = a + t * (b - a);
            let area = Aabb::of([p]).grown(gap);
            let (mut is_beside, mut folds) = (false, false);
            let _ = tree.for_each_in(&area, |index, &[c, d]| {
                let other = index as usize;
                let away = closest_on_segment(p, [c, d]).point - p;
                if marked[other] != e
                    && beating(other)
                    && away.length_squared() <= gap * gap
                    && away.dot(direction).abs() <= ACROSS * away.length()
                    && (d - c).normalize_or_zero().dot(direction).abs() >= ALONGSIDE
                {
                    is_beside = true;
                    folds |= away.length() >= THIN * gap && self.fold(e, marked[other]);
                }
                ControlFlow::Continue::<()>(())
            });
            if !is_beside {
                return Meeting::Apart;
            }
            folded += usize::from(folds);
        }
        if 2 * folded > SAMPLES.len() { Meeting::Folded } else { Meeting::Alongside }
    }

    /// Whether the surface turns back on itself between two edges.
    fn fold(&self, e: EdgeId, other: EdgeId) -> bool {
        let normals = |e: EdgeId| self.edges.sides(e).iter().map(|side| self.normals[side.face]);
        normals(e).any(|n| normals(other).any(|m| n.dot(m) < FOLDED))
    }
}
