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

use super::ground::Ground;
use super::mixed::{Mixed, Place};
use crate::watch::{Cancelled, Watch};

pub use valence::{Census, census};

/// A cleaned neighbourhood must be at least this good, or better than before.
const GOOD: f64 = 0.35;

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
}

/// Cleans the topology, then optimises the shapes.
pub fn clean(mesh: &mut Mixed, ground: &Ground<'_>, watch: &Watch) -> Result<CleanReport, Cancelled> {
    let mut cleaner = Cleaner { mesh, ground };
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
    let mut cleaner = Cleaner { mesh, ground };
    cleaner.relax_all(6);
    report.rounds = cleaner.optimise(12, watch)?;
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

    /// Whether a vertex may be moved or removed freely.
    fn is_free(&self, v: u32) -> bool {
        matches!(self.mesh.place(v), Place::Region(_))
    }
}
