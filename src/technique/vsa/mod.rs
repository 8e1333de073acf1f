//! Variational shape approximation: a surface cut into regions that are each as flat as can be.
//!
//! D. Cohen-Steiner, P. Alliez, M. Desbrun, *Variational shape approximation*, ACM SIGGRAPH 2004: each region has a
//! proxy (a plane); all regions grow from seeds at once, always by the face that fits best (one heap for all); then
//! each proxy is fitted anew and each seed put where its region fits best, and so on. Insertion of seeds where the
//! error is worst, and teleports (merge the two neighbours that lose least, seed the worst region), lead out of bad
//! starts. R. Miyazaki and K. Harada, *Transformation of a closed 3D triangular mesh to a quadrilateral mesh based on
//! feature edges*, insert until no face turns from its proxy by more than an angle.
//!
//! Marked edges are barriers that no region grows across: angles alone never see a cube's edges, because two of its
//! sides average to 45 degrees each and three to 55. Regions may be cut on until each is a disk; see `admissible`.
//!
//! Invariants: every face has a region; every region is connected over edges, has a border (but for the limits told in
//! [`Report`]) and does not cross a barrier; labels are numbered by their lowest face; the same seed gives the same
//! regions on every machine. Cost: O(iterations · F log F).

mod admissible;
mod dual;
mod flood;
mod grow;
mod halve;
mod merge;
mod proxy;
#[cfg(test)]
mod tests;

use crate::mesh::Surface;
use crate::mesh::id::{Face, IdVec};
use crate::mesh::topology::EdgeTable;
use crate::technique::feature::reliable_normals;
use crate::watch::{Cancelled, Watch};

use dual::Dual;
use grow::State;
use proxy::Shape;

pub use proxy::Proxy;

/// Small regions merge where their normals differ by no more than this many of the angles asked for: less than those of
/// strips round a cylinder, or the wall of a small hole would become a ring.
const SMALL_TURN: f64 = 1.5;

/// What makes a face fit a proxy.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Metric {
    /// The squared difference of the normals, times the area.
    L21,
    /// The squared distance from the plane, over the face.
    L2,
}

/// How many regions there shall be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Wanted {
    /// This many, if barriers do not force more.
    Regions(usize),
    /// As many as needed so that normals turn from their region's by no more than this angle in radians, but for a
    /// hundredth of each region's area.
    Angle(f64),
}

/// What is asked of a partition.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rules {
    /// What fits.
    pub metric: Metric,
    /// How many regions.
    pub wanted: Wanted,
    /// Whether marked edges are barriers.
    pub barriers: bool,
    /// Most rounds of flooding and fitting after the last insertion.
    pub iterations: usize,
    /// Whether regions are cut until each is a disk.
    pub disk: bool,
    /// Where the first seeds are.
    pub seed: u64,
}

/// What became of it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Report {
    /// Parts of the surface that barriers separate.
    pub cells: usize,
    /// Rounds of flooding and fitting in all.
    pub iterations: usize,
    /// Whether the last of them changed the error by less than a thousandth.
    pub has_settled: bool,
    /// Seeds inserted.
    pub inserted: usize,
    /// Merges with an insertion elsewhere that lowered the error.
    pub teleports: usize,
    /// Merges of regions that are one plane, or small.
    pub merged: usize,
    /// Faces moved across a border to straighten it or to open a pinch.
    pub moved_faces: usize,
    /// Cuts that made regions disks, or gave them a border.
    pub cuts: usize,
    /// Error of the partition in the metric's own units.
    pub error: f64,
    /// The largest angle between a face's normal and its region's, in degrees.
    pub worst_angle: f64,
    /// Regions that are no disks.
    pub non_disks: usize,
}

/// The regions of a surface.
#[derive(Clone, Debug)]
pub struct Partition {
    /// The region of each face, numbered by their lowest face.
    pub labels: IdVec<Face, u32>,
    /// The proxy of each region.
    pub proxies: Vec<Proxy>,
    /// How it went.
    pub report: Report,
}

/// Cuts a surface into regions.
///
/// # Errors
/// The run was interrupted.
pub fn partition(surface: &Surface, rules: &Rules, watch: &Watch) -> Result<Partition, Cancelled> {
    let edges = EdgeTable::new(surface);
    let dual = Dual::new(surface, &edges, rules.barriers);
    let shape = Shape::new(surface, rules.metric, reliable_normals(surface, &edges));
    drop(edges);
    let mut state = State::new(&dual, &shape, rules.seed);
    watch.phase("partitioning", None);
    match rules.wanted {
        Wanted::Regions(count) => {
            state.grow_to(count, watch)?;
            state.settle(rules.iterations, watch)?;
            state.teleport(watch)?;
        }
        Wanted::Angle(angle) => {
            state.grow_until(angle, watch)?;
            state.settle(rules.iterations, watch)?;
            state.merge_planes(0.5 * angle, watch)?;
            state.merge_small(SMALL_TURN * angle);
        }
    }
    state.smooth_borders();
    watch.phase("cutting regions", None);
    state.make_admissible(rules.disk, watch)?;
    Ok(state.finish())
}
