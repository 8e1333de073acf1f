//! Large surfaces simplified in cells: cut, collapse inside, join; what comes after collapses across.
//!
//! # Algorithm
//! Space is cut into boxes of some thousand vertices (`cut`). Faces with all corners in one box may change, within
//! that box; the others stay. Each box with the faces that reach into it is a surface of its own (`part`), which is
//! collapsed in a guarded mesh of its own, on all threads, down to several times the faces that are wanted of it in the
//! end. Then the parts are joined (`join`), and the next round cuts elsewhere. Whoever calls goes on with the whole,
//! which is small by then.
//!
//! # Invariants
//! - The cutting depends on the surface alone, and a part on nothing beyond it: equal bytes for any number of threads.
//! - Parts do not meet: boxes are convex and have no common point, and what lies across is seen by both sides.
//! - Topology, groups, regions, marks and pins go along. Fields do not; see [`crate::mesh::transfer`].
//! - Quadrics go on from part to part and to the whole. Certified distances are held to half of the tolerance, against
//!   the part itself, so that the whole is within the tolerance of the reference, where it is held to that again.
//!
//! # Cost
//! O(F log F); a part fits the cache, which makes up for the cutting on a single thread.
//!
//! # Departures
//! Date et al. take collapses in one order over the whole mesh. Here the order holds within a cell, and for the last
//! collapses, which are those that shape the result.

mod cut;
mod join;
mod part;
#[cfg(test)]
mod tests;

use std::sync::atomic::{AtomicUsize, Ordering};

use glam::DVec3;
use rayon::prelude::*;

use self::cut::Cutting;
use self::join::{Done, join};
use self::part::Part;
use crate::mesh::geometry::{Aabb, triangle_area};
use crate::mesh::halfedge::EnterError;
use crate::mesh::{FaceId, FreedomError, LockRules, Surface, VertexId, resolve_freedom};
use crate::metric::ToleranceMode;
use crate::technique::collapse::{CollapseRules, Goal, simplify};
use crate::technique::guarded::{Counts, Gathered, GuardedMesh, Setup, open_part, reference_tree};
use crate::watch::{Cancelled, Watch};

/// When surfaces are cut, and how small.
#[derive(Clone, Copy, Debug)]
struct Size {
    /// Surfaces of fewer faces are not.
    large: usize,
    /// The most vertices of a cell.
    cell: usize,
}

/// Below, threads gain little; cells of this size fit the cache.
const SIZE: Size = Size { large: 200_000, cell: 16_384 };
/// Where cells are cut in two, in turn: the part of the vertices on the lower side.
const SHARES: [f64; 2] = [0.5, 0.38];
/// Cells are left with so many times the faces that are wanted in the end.
const SPARE: usize = 4;
/// A round is worth its while where that leaves fewer faces by this factor.
const MUCH: usize = 3;
/// The part of a certified tolerance that cells may use up.
const TOLERANCE: f64 = 0.5;

/// What is simplified.
#[derive(Clone, Copy, Debug)]
pub struct Task<'a> {
    /// The surface.
    pub surface: &'a Surface,
    /// What the tolerance is measured against.
    pub reference: &'a Surface,
    /// What must stay.
    pub locks: LockRules<'a>,
    /// Tolerance and thresholds.
    pub setup: &'a Setup,
    /// Which collapses, and what each must keep.
    pub rules: &'a CollapseRules,
    /// The faces that are wanted in the end; 0 for as few as the rules allow.
    pub faces: usize,
}

/// A surface that was simplified in cells.
#[derive(Debug)]
pub struct Thinned {
    /// The surface, without fields.
    pub surface: Surface,
    /// Edits in all cells.
    pub counts: Counts,
    origin: DVec3,
    gathered: Vec<Option<Gathered>>,
}

impl Thinned {
    /// Gives a guarded mesh that was opened on the surface what its vertices have gathered.
    pub fn hand_over(&self, guarded: &mut GuardedMesh<'_>) {
        guarded.take_over(self.origin, known(&self.gathered));
    }
}

fn known(gathered: &[Option<Gathered>]) -> impl Iterator<Item = (VertexId, Gathered)> + '_ {
    gathered.iter().enumerate().filter_map(|(v, known)| Some((VertexId::new(v), (*known)?)))
}

impl Task<'_> {
    /// Whether a part of the surface may stand for that part of the reference.
    fn is_certified_elsewhere(&self) -> bool {
        let Self { surface, reference, .. } = self;
        let is_same = surface.faces == reference.faces && surface.points == reference.points;
        self.setup.mode == ToleranceMode::Distance && !is_same
    }
}

/// Simplifies a large surface in cells; `None` where it is small, is wanted with nearly as many faces, has seams, whose
/// copies must change alike, or is held to a certified distance from another surface.
///
/// # Errors
/// A lock that names no group, a surface that is no oriented 2-manifold, an interrupted run.
pub fn thin<E>(task: &Task<'_>, watch: &Watch) -> Result<Option<Thinned>, E>
where
    E: From<FreedomError> + From<EnterError> + From<Cancelled> + Send,
{
    thin_by(SIZE, task, watch)
}

fn thin_by<E>(size: Size, task: &Task<'_>, watch: &Watch) -> Result<Option<Thinned>, E>
where
    E: From<FreedomError> + From<EnterError> + From<Cancelled> + Send,
{
    let is_worthwhile = |surface: &Surface| {
        let faces = surface.faces.len();
        faces >= size.large && faces / (MUCH * SPARE) >= task.faces && surface.carried.seams.is_empty()
    };
    let origin = Aabb::of(task.surface.points.iter().copied()).centre();
    let mut thinned: Option<Thinned> = None;
    if task.is_certified_elsewhere() {
        return Ok(None);
    }
    for share in SHARES {
        let surface = thinned.as_ref().map_or(task.surface, |before| &before.surface);
        let is_again = thinned.is_some();
        // Only the first round has the reference before it.
        if !is_worthwhile(surface) || is_again && task.setup.mode == ToleranceMode::Distance {
            break;
        }
        let gathered = thinned.as_ref().map_or(&[][..], |before| &before.gathered);
        let round = Round { task, surface, gathered, origin, cutting: Cutting::new(surface, size.cell, share) };
        let mut next = round.run::<E>(watch)?;
        next.counts = next.counts + thinned.as_ref().map_or_else(Counts::default, |before| before.counts);
        let is_over = next.surface.faces.len() * MUCH > surface.faces.len() * (MUCH - 1);
        thinned = Some(next);
        if is_over {
            break;
        }
    }
    Ok(thinned)
}

/// One cutting and what is done in its cells.
struct Round<'a> {
    task: &'a Task<'a>,
    surface: &'a Surface,
    gathered: &'a [Option<Gathered>],
    origin: DVec3,
    cutting: Cutting,
}

impl Round<'_> {
    fn run<E>(&self, watch: &Watch) -> Result<Thinned, E>
    where
        E: From<FreedomError> + From<EnterError> + From<Cancelled> + Send,
    {
        let cells = self.cutting.len();
        watch.phase("collapse in cells", Some(cells as u64));
        let area = self.surface.faces.ids().map(|f| triangle_area(self.surface.corners(f))).sum::<f64>();
        let carried = part::Shares::new(self.surface, &self.cutting);
        let ended = AtomicUsize::new(0);
        let collapsed = |cell: usize| {
            let part = Part::new(self.surface, &self.cutting, &carried, cell);
            let done = self.collapse::<E>(cell, &part, area, &watch.quiet())?;
            let count = ended.fetch_add(1, Ordering::Relaxed) + 1;
            watch.advance(count as u64, || format!("{count} of {cells} cells"));
            Ok(done)
        };
        let done = (0..cells).into_par_iter().map(collapsed).collect::<Result<Vec<Done>, E>>()?;
        let (surface, gathered) = join(self.surface, &self.cutting, self.gathered, &done);
        let counts = done.iter().fold(Counts::default(), |sum, done| sum + done.counts);
        Ok(Thinned { surface, counts, origin: self.origin, gathered })
    }

    /// Collapses inside a part until few faces for its share of the area are left.
    fn collapse<E>(&self, cell: usize, part: &Part, area: f64, watch: &Watch) -> Result<Done, E>
    where
        E: From<FreedomError> + From<EnterError> + From<Cancelled>,
    {
        let mut setup = self.task.setup.clone();
        if setup.mode == ToleranceMode::Distance {
            setup.tolerance *= TOLERANCE;
            setup.feature_tolerance *= TOLERANCE;
        }
        let inside: f64 = (0..part.inside).map(|f| triangle_area(part.surface.corners(FaceId::new(f)))).sum();
        let still = part.surface.faces.len() - part.inside;
        let wanted = if area > 0.0 { (SPARE * self.task.faces) as f64 * inside / area } else { 0.0 };
        let goal = Goal { faces: still + wanted.ceil() as usize, ..Goal::default() };
        let freedom = resolve_freedom(&part.surface, &self.task.locks)?;
        let tree = reference_tree(setup.mode, &part.surface);
        let mut guarded = open_part(&part.surface, &freedom, &tree, setup, part.pen(self.origin))?;
        let known = part.vertices.iter().enumerate().filter_map(|(local, v)| {
            let gathered = self.gathered.get(v.index()).copied().flatten()?;
            Some((VertexId::new(local), gathered))
        });
        guarded.take_over(self.origin, known);
        simplify(&mut guarded, self.task.rules, goal, watch)?;
        Ok(Done::new(guarded, part, &self.cutting, cell))
    }
}
