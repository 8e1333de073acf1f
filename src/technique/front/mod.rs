//! The advancing front that turns triangles into quads, row by row from the curves inwards.
//!
//! # Algorithm
//! Q-Morph: a front edge has a triangle on its left and something finished, or a curve, on its right. The edge of
//! lowest level that its neighbours fit best is taken; its side edges are the neighbouring front edges or, where these
//! open too wide, an edge near the wanted direction, a swapped one, or one made by a split; the top edge is made by
//! flips; what lies between the four edges becomes a quad. Narrow wedges between front edges are seamed. Every step is
//! a transaction: done, looked at, and undone where a face would be turned.
//!
//! Based on: S. J. Owen, M. L. Staten, S. A. Canann, S. Saigal. Advancing front quadrilateral meshing using triangle
//! transformations. 7th International Meshing Roundtable, 1998.
//!
//! # Departures
//! - The front is not stored: whether an edge belongs to it, and which one comes next, is read off the faces.
//! - A side edge takes an equal share of the angle at its node: 270 degrees become three corners, not two.
//! - A new side node is put where the ideal corner would have it, if that turns no face; smoothing is local.
//! - An edge that fails is tried again after others succeeded; what is left are triangles, which `join` deals with.

mod form;
mod seam;
mod side;
mod smooth;
mod top;
mod wedge;

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use super::ground::Ground;
use super::mixed::{Mixed, NONE};
use crate::watch::{Cancelled, Watch};

/// Front angles below this, in radians, make the neighbouring front edge the side of the quad.
const SIDE: f64 = 0.75 * std::f64::consts::PI;
/// Wedges of the front below this angle are seamed.
const SEAM: f64 = 0.2 * std::f64::consts::PI;
/// How often an edge is tried.
const TRIES: u8 = 6;

/// What the front did.
#[derive(Clone, Copy, Debug, Default)]
pub struct FrontReport {
    /// Quads made.
    pub quads: usize,
    /// Wedges closed.
    pub seams: usize,
    /// Steps undone.
    pub undone: usize,
}

/// A waiting edge: how many of its sides are given (most first), level, length, id.
type Waiting = Reverse<(u8, u16, u64, u32)>;

/// The front at work.
struct Front<'a, 'g> {
    mesh: &'a mut Mixed,
    ground: &'a Ground<'g>,
    waiting: BinaryHeap<Waiting>,
    deferred: Vec<u32>,
    /// By half-edge.
    levels: Vec<u16>,
    tries: Vec<u8>,
    report: FrontReport,
}

/// Turns the triangles of `mesh` into quads as far as the front gets.
pub fn advance(mesh: &mut Mixed, ground: &Ground<'_>, watch: &Watch) -> Result<FrontReport, Cancelled> {
    let mut front = Front {
        mesh,
        ground,
        waiting: BinaryHeap::new(),
        deferred: Vec::new(),
        levels: Vec::new(),
        tries: Vec::new(),
        report: FrontReport::default(),
    };
    front.seed();
    front.fill_wedges();
    for h in 0..front.mesh.halfedge_slots() {
        front.wait(h, 0);
    }
    front.run(watch)?;
    Ok(front.report)
}

impl Front<'_, '_> {
    /// Whether the half-edge belongs to the front.
    fn is_front(&self, h: u32) -> bool {
        let (here, across) = (self.mesh.face(h), self.mesh.face(h ^ 1));
        here != NONE
            && self.mesh.is_triangle(here)
            && (self.mesh.arc(h) != NONE || across == NONE || !self.mesh.is_triangle(across))
    }

    /// The front edge after `h`, and the angle between them on the front's side.
    fn after(&self, h: u32) -> (u32, f64) {
        let mut k = self.mesh.next(h);
        let mut angle = self.mesh.corner_angle(k);
        let mut steps = 0;
        while !self.is_front(k) && steps < 200 {
            k = self.mesh.next(k ^ 1);
            angle += self.mesh.corner_angle(k);
            steps += 1;
        }
        (k, angle)
    }

    /// The front edge before `h`, and the angle between them on the front's side.
    fn before(&self, h: u32) -> (u32, f64) {
        let mut k = self.mesh.prev(h);
        let mut angle = self.mesh.corner_angle(h);
        let mut steps = 0;
        while !self.is_front(k) && steps < 200 {
            angle += self.mesh.corner_angle(k ^ 1);
            k = self.mesh.prev(k ^ 1);
            steps += 1;
        }
        (k, angle)
    }

    fn level(&self, h: u32) -> u16 {
        self.levels.get(h as usize).copied().unwrap_or(0)
    }

    /// Puts an edge into the queue if it is of the front.
    fn wait(&mut self, h: u32, level: u16) {
        let slots = self.mesh.halfedge_slots() as usize;
        self.levels.resize(slots.max(self.levels.len()), 0);
        self.tries.resize(slots.max(self.tries.len()), 0);
        if !self.mesh.is_halfedge(h) || !self.is_front(h) {
            return;
        }
        self.levels[h as usize] = level;
        self.waiting.push(Reverse(self.key(h)));
    }

    fn key(&self, h: u32) -> (u8, u16, u64, u32) {
        let given = u8::from(self.after(h).1 < SIDE) + u8::from(self.before(h).1 < SIDE);
        let late = u16::from(self.tries[h as usize]);
        // Positive lengths keep their order as bits.
        (2 - given, self.level(h) + late, self.mesh.length(h).to_bits(), h)
    }

    fn run(&mut self, watch: &Watch) -> Result<(), Cancelled> {
        let mut steps = 0_usize;
        let most = 4 * self.mesh.faces().count() + 1000;
        loop {
            let mut progress = false;
            while let Some(Reverse(key)) = self.waiting.pop() {
                steps += 1;
                if steps.is_multiple_of(256) {
                    watch.check()?;
                }
                if self.report.quads > most {
                    return Ok(());
                }
                let h = key.3;
                if !self.mesh.is_halfedge(h) || !self.is_front(h) {
                    continue;
                }
                let now = self.key(h);
                if now > key {
                    self.waiting.push(Reverse(now));
                    continue;
                }
                if self.step(h) {
                    progress = true;
                } else {
                    self.tries[h as usize] += 1;
                    self.deferred.push(h);
                }
            }
            let again: Vec<u32> = std::mem::take(&mut self.deferred);
            if !progress || again.is_empty() {
                return Ok(());
            }
            for h in again {
                if self.tries[h as usize] < TRIES {
                    let level = self.level(h);
                    self.wait(h, level);
                }
            }
        }
    }

    /// Seams a wedge at the edge, or makes a quad on it. Whether anything was done.
    fn step(&mut self, h: u32) -> bool {
        let level = self.level(h);
        for (first, second, angle) in [(h, self.after(h).0, self.after(h).1), {
            let (p, angle) = self.before(h);
            (p, h, angle)
        }] {
            if angle < SEAM && self.seam(first, second) {
                self.report.seams += 1;
                return true;
            }
        }
        for shy in [false, true] {
            self.mesh.begin();
            if let Some(quad) = self.form(h, shy) {
                self.mesh.commit();
                self.report.quads += 1;
                self.settle(quad, level);
                return true;
            }
            self.mesh.rollback();
            self.report.undone += 1;
        }
        false
    }

    /// Smooths round a new quad and puts the new front edges into the queue.
    fn settle(&mut self, quad: u32, level: u16) {
        let corners = self.mesh.corners(quad);
        self.smooth_around(&corners);
        let sides: Vec<u32> = self.mesh.sides(quad).map(|k| k ^ 1).collect();
        for k in sides {
            self.wait(k, level + 1);
        }
        // The neighbours' states changed.
        for v in corners {
            let star: Vec<u32> = self.mesh.star(v).flat_map(|k| [k, k ^ 1]).collect();
            for k in star {
                if self.mesh.face(k) != NONE && self.is_front(k) {
                    let level = self.level(k);
                    self.wait(k, level);
                }
            }
        }
    }

    /// Gives regions without any front a first quad: the best pair of triangles.
    fn seed(&mut self) {
        let regions = self.ground.region_count();
        let mut best: Vec<(f64, u32)> = vec![(f64::NEG_INFINITY, NONE); regions];
        let mut has_front = vec![false; regions];
        for h in 0..self.mesh.halfedge_slots() {
            if !self.mesh.is_halfedge(h) || self.mesh.face(h) == NONE {
                continue;
            }
            let region = self.mesh.region(self.mesh.face(h)) as usize;
            if self.is_front(h) {
                has_front[region] = true;
            } else if let Some(quality) = self.pair_quality(h)
                && quality > best[region].0
            {
                best[region] = (quality, h);
            }
        }
        for (region, (_, h)) in best.into_iter().enumerate() {
            if !has_front[region] && h != NONE {
                super::join::merge_pair(self.mesh, h);
            }
        }
    }

    fn pair_quality(&self, h: u32) -> Option<f64> {
        super::join::pair_quality(self.mesh, h)
    }
}
