//! Makes a mesh of quads better: fewer irregular vertices, then better shapes.
//!
//! # Algorithm
//! Every edit of the topology must lower the sum of squared differences between the valences and their ideals, or keep
//! it and raise the worst shape: quads drawn together along a diagonal, edges turned, vertices opened, doublets taken
//! out. The ideal is four quads at an inner vertex, and one for each 90 degrees between two curves at a vertex on them.
//! An edit is done, its neighbourhood smoothed, looked at, and undone unless it gained. The shapes are then improved by
//! moving one vertex at a time: free ones in the surface, curve vertices along their curve.
//!
//! Based on: P. Kinney. CleanUp: improving quadrilateral finite element meshes. 6th International Meshing Roundtable,
//! 1997; S. A. Canann, S. N. Muthukrishnan, R. K. Phillips. Topological improvement procedures for quadrilateral finite
//! element meshes. Engineering with Computers 14, 1998.
//!
//! # Invariants
//! - Curves and nodes stay; only curve vertices slide along their curve.
//! - No commit makes the least scaled Jacobian of its neighbourhood worse unless it stays above a bound.
//!
//! # Cost
//! O(vertices) a pass; passes stop when nothing gains.

mod edits;
mod relax;
mod valence;

use rustc_hash::FxHashSet;

use super::ground::Ground;
use super::mixed::{Mixed, Place};
use crate::watch::{Cancelled, Watch};

pub use valence::{Census, census, sharpest_sector};

/// A cleaned neighbourhood must be at least this good, or better than before.
const GOOD: f64 = 0.35;

/// Faces below this are worth edits that make valences worse.
const POOR: f64 = 0.5;
/// Faces below this are tried again and again.
const USELESS: f64 = 0.15;
/// Rounds of such edits.
const RESCUES: usize = 5;

/// What was done.
#[derive(Clone, Copy, Debug, Default)]
pub struct CleanReport {
    /// Edits of the topology.
    pub edits: usize,
    /// Rounds of moves.
    pub rounds: usize,
}

/// The cleaner at work.
struct Cleaner<'a, 'g> {
    mesh: &'a mut Mixed,
    ground: &'a Ground<'g>,
    /// How far edges may leave their curve when vertices slide along it.
    curve_tolerance: f64,
    /// Whether shape counts more than valences.
    is_rescue: bool,
}

/// Cleans the topology and smooths; [`finish`] goes on. Vertices slide along curves within
/// `curve_tolerance` of them.
pub fn clean(
    mesh: &mut Mixed,
    ground: &Ground<'_>,
    curve_tolerance: f64,
    watch: &Watch,
) -> Result<CleanReport, Cancelled> {
    let mut cleaner = Cleaner { mesh, ground, curve_tolerance, is_rescue: false };
    let mut report = CleanReport::default();
    cleaner.relax_all(2);
    for pass in 0..8 {
        watch.check()?;
        let edits = cleaner.pass(pass >= 2);
        report.edits += edits;
        cleaner.relax_all(2);
        if edits == 0 {
            break;
        }
    }
    cleaner.mesh.compact();
    let mut cleaner = Cleaner { mesh, ground, curve_tolerance, is_rescue: false };
    cleaner.relax_all(6);
    Ok(report)
}

/// Optimises the shapes of clean quads to the end, and mends poor ones at the price of regular vertices.
pub fn finish(
    mesh: &mut Mixed,
    ground: &Ground<'_>,
    curve_tolerance: f64,
    watch: &Watch,
) -> Result<CleanReport, Cancelled> {
    let mut cleaner = Cleaner { mesh, ground, curve_tolerance, is_rescue: false };
    let mut report = CleanReport { edits: 0, rounds: cleaner.optimise(12, watch)? };
    cleaner.is_rescue = true;
    let mut tried = FxHashSet::default();
    for _ in 0..RESCUES {
        let rescued = cleaner.rescue(&mut tried);
        if rescued == 0 {
            break;
        }
        report.edits += rescued;
        report.rounds += cleaner.optimise(4, watch)?;
    }
    Ok(report)
}

impl Cleaner<'_, '_> {
    /// One look at every vertex and quad. Returns the number of edits.
    fn pass(&mut self, thorough: bool) -> usize {
        let mut edits = 0;
        for v in 0..self.mesh.vertex_slots() {
            if !self.mesh.is_vertex(v) {
                continue;
            }
            if self.mesh.place(v).is_free() && self.mesh.valence(v) == 2 {
                edits += usize::from(self.take_out_doublet(v));
            } else if self.misfit(v) > 0.0 || (thorough && self.mesh.star_quality(v) < GOOD) {
                edits += self.improve(v);
            }
        }
        edits
    }

    /// Applies the best edits at an irregular vertex until none gains.
    fn improve(&mut self, v: u32) -> usize {
        let mut edits = 0;
        while self.mesh.is_vertex(v) && edits < 4 && self.best_edit(v) {
            edits += 1;
        }
        edits
    }

    /// Edits at the corners of poor faces, the worst first; faces that were tried in vain are left alone. Returns the
    /// number of edits.
    fn rescue(&mut self, tried: &mut FxHashSet<u32>) -> usize {
        let quality = |f: u32| (self.mesh.quality(f), f);
        let mut poor: Vec<(f64, u32)> = self.mesh.faces().map(quality).filter(|&(q, _)| q < POOR).collect();
        poor.sort_by(|x, y| x.0.total_cmp(&y.0).then(x.1.cmp(&y.1)));
        let mut edits = 0;
        for (_, f) in poor {
            if !self.mesh.is_face(f) || self.mesh.is_triangle(f) || self.mesh.quality(f) >= POOR {
                continue;
            }
            // What is of no use is always worth another look: its neighbours may be others by now.
            if !tried.insert(f) && self.mesh.quality(f) > USELESS {
                continue;
            }
            for v in self.mesh.corners(f) {
                if self.mesh.is_vertex(v) && self.best_edit(v) {
                    edits += 1;
                    break;
                }
            }
        }
        edits
    }

    /// Whether a vertex may be moved or removed freely.
    fn is_free(&self, v: u32) -> bool {
        matches!(self.mesh.place(v), Place::Region(_))
    }
}
