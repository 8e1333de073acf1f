//! Makes a mesh of quads better: fewer irregular vertices, then better shapes.
//!
//! # Algorithm
//! Every edit of the topology must lower the sum of squared differences between the valences and their ideals, or keep
//! it and raise the worst shape: quads drawn together along a diagonal, edges turned, vertices opened, doublets taken
//! out. The ideal is four quads at an inner vertex, and one for each 90 degrees between two curves at a vertex on them.
//! An edit is done, its neighbourhood smoothed, looked at, and undone unless it gained. The shapes are then improved by
//! moving one vertex at a time: free ones in the surface, curve vertices along their curve.
//!
//! Two irregular vertices that lie apart come together by no such edit. Cavities that hold several of them are filled
//! anew ([`regularise`]): on parts that halves the share of irregular vertices and more. The other way round, a ring of
//! quads makes faces smaller at one place ([`pillow`]).
//!
//! Based on: P. Kinney. CleanUp: improving quadrilateral finite element meshes. 6th International Meshing Roundtable,
//! 1997; S. A. Canann, S. N. Muthukrishnan, R. K. Phillips. Topological improvement procedures for quadrilateral finite
//! element meshes. Engineering with Computers 14, 1998; G. Bunin. Non-local topological clean-up. 15th International
//! Meshing Roundtable, 2006.
//!
//! # Invariants
//! - Curves and nodes stay; only curve vertices slide along their curve.
//! - No commit makes the least scaled Jacobian of its neighbourhood worse unless it stays above a bound; rings are put
//!   within a transaction of the caller, who judges them.
//!
//! # Cost
//! O(vertices) a pass; passes stop when nothing gains. A cavity costs O(faces) to grow, times the rows looked for
//! across it; its size is bounded.

mod cavity;
mod edits;
mod filling;
mod memory;
mod pillow;
mod relax;
#[cfg(test)]
mod tests;
mod valence;

use super::ground::Ground;
use super::mixed::{Mixed, Place};
use crate::watch::{Cancelled, Watch};
use memory::Memory;

pub use valence::{Census, census, sharpest_sector, sharpest_sector_of};

/// A cleaned neighbourhood must be at least this good, or better than before.
const GOOD: f64 = 0.35;

/// Faces below this are worth edits that make valences worse.
const POOR: f64 = 0.5;
/// How often cavities are grown round all irregular vertices.
const CAVITIES: usize = 4;
/// Rounds of edits for poor faces.
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
    /// How far fillings of cavities may leave the surface.
    tolerance: f64,
    /// Whether shape counts more than valences.
    is_rescue: bool,
    /// Whether each region takes part.
    awake: &'a [bool],
    memory: Memory,
}

impl<'a, 'g> Cleaner<'a, 'g> {
    fn new(mesh: &'a mut Mixed, ground: &'a Ground<'g>, curve_tolerance: f64, awake: &'a [bool]) -> Self {
        Self {
            mesh,
            ground,
            curve_tolerance,
            tolerance: f64::INFINITY,
            is_rescue: false,
            awake,
            memory: Memory::default(),
        }
    }
}

/// Cleans the topology and smooths; [`finish`] goes on. Vertices slide along curves within
/// `curve_tolerance` of them. Only regions that are `awake` take part.
pub fn clean(
    mesh: &mut Mixed,
    ground: &Ground<'_>,
    curve_tolerance: f64,
    awake: &[bool],
    watch: &Watch,
) -> Result<CleanReport, Cancelled> {
    let mut cleaner = Cleaner::new(mesh, ground, curve_tolerance, awake);
    let mut report = CleanReport::default();
    cleaner.relax_all(2);
    for pass in 0..8 {
        watch.check()?;
        if pass == 2 {
            // From here on shapes count too.
            cleaner.memory = Memory::default();
        }
        let edits = cleaner.pass(pass >= 2);
        report.edits += edits;
        if pass == 0 {
            cleaner.relax_all(2);
        }
        if edits == 0 {
            break;
        }
    }
    cleaner.mesh.compact();
    let mut cleaner = Cleaner::new(mesh, ground, curve_tolerance, awake);
    cleaner.relax_all(6);
    Ok(report)
}

/// Fills cavities round irregular vertices of clean quads anew, in the regions that are `awake`, and cleans again. A
/// filling within `tolerance` of the surface, or no farther than what was there, is kept, as far as middles of faces
/// and edges tell. Returns the number of edits.
pub fn regularise(
    mesh: &mut Mixed,
    ground: &Ground<'_>,
    [tolerance, curve_tolerance]: [f64; 2],
    awake: &[bool],
    watch: &Watch,
) -> Result<usize, Cancelled> {
    let mut cleaner = Cleaner::new(mesh, ground, curve_tolerance, awake);
    cleaner.tolerance = tolerance;
    let edits = cleaner.cavities(watch)?;
    mesh.compact();
    Ok(edits)
}

/// Optimises the shapes of clean quads to the end, and mends poor ones at the price of regular vertices, in the regions
/// that are `awake`.
pub fn finish(
    mesh: &mut Mixed,
    ground: &Ground<'_>,
    curve_tolerance: f64,
    awake: &[bool],
    watch: &Watch,
) -> Result<CleanReport, Cancelled> {
    let mut cleaner = Cleaner::new(mesh, ground, curve_tolerance, awake);
    let mut report = CleanReport { edits: 0, rounds: cleaner.optimise(12, watch)? };
    cleaner.is_rescue = true;
    for _ in 0..RESCUES {
        let rescued = cleaner.rescue();
        if rescued == 0 {
            break;
        }
        report.edits += rescued;
        report.rounds += cleaner.optimise(4, watch)?;
    }
    Ok(report)
}

/// Puts a ring of quads about some quads that form a disk, across curves too, and smooths there, within an open
/// transaction. Returns the vertices that may have moved; `None` where it cannot be done, and the transaction must be
/// rolled back.
pub fn pillow(mesh: &mut Mixed, ground: &Ground<'_>, curve_tolerance: f64, faces: &[u32]) -> Option<Vec<u32>> {
    let awake = vec![true; ground.region_count()];
    Cleaner::new(mesh, ground, curve_tolerance, &awake).pillow_about(faces)
}

impl Cleaner<'_, '_> {
    /// Fills cavities anew, and cleans what that left, until nothing gains. Returns the number of edits.
    fn cavities(&mut self, watch: &Watch) -> Result<usize, Cancelled> {
        let mut edits = 0;
        let mut refused = cavity::Refused::default();
        for _ in 0..CAVITIES {
            let filled = self.fill_cavities(&mut refused, watch)?;
            if filled == 0 {
                break;
            }
            edits += filled + self.pass(true);
        }
        Ok(edits)
    }

    /// One look at every vertex and quad. Returns the number of edits.
    fn pass(&mut self, thorough: bool) -> usize {
        let mut edits = 0;
        for v in 0..self.mesh.vertex_slots() {
            if !self.mesh.is_vertex(v) || self.memory.is_hopeless(v) || !self.is_awake(v) {
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
        while self.mesh.is_vertex(v) && edits < 4 {
            if !self.best_edit(v) {
                self.memory.note_refusal(v);
                break;
            }
            edits += 1;
        }
        edits
    }

    /// Edits at the corners of poor faces, the worst first. Returns the number of edits.
    fn rescue(&mut self) -> usize {
        let quality = |f: u32| (self.mesh.quality(f), f);
        let mut poor: Vec<(f64, u32)> = self.mesh.faces().map(quality).filter(|&(q, _)| q < POOR).collect();
        poor.sort_by(|x, y| x.0.total_cmp(&y.0).then(x.1.cmp(&y.1)));
        let mut edits = 0;
        for (_, f) in poor {
            if !self.mesh.is_face(f) || self.mesh.is_triangle(f) || self.mesh.quality(f) >= POOR {
                continue;
            }
            for v in self.mesh.corners(f) {
                if !self.mesh.is_vertex(v) || self.memory.is_hopeless(v) || !self.is_awake(v) {
                    continue;
                }
                if self.best_edit(v) {
                    edits += 1;
                    break;
                }
                self.memory.note_refusal(v);
            }
        }
        edits
    }

    /// Whether a vertex takes part: it is in a region that does, or on its border.
    fn is_awake(&self, v: u32) -> bool {
        match self.mesh.place(v) {
            Place::Region(region) => self.awake[region as usize],
            _ => self.mesh.faces_at(v).any(|f| self.awake[self.mesh.region(f) as usize]),
        }
    }

    /// Whether a vertex may be moved or removed freely.
    fn is_free(&self, v: u32) -> bool {
        matches!(self.mesh.place(v), Place::Region(_))
    }
}
