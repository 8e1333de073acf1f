//! The distance between two meshes: mean and root mean square of samples, and a certified bound of the maximum.
//!
//! # Algorithm
//! The largest distance from mesh A to mesh B is bounded from above without trusting samples. A convex piece x of a
//! face of A has two bounds. The distance to one triangle F of B is a convex function, so that over the piece it is
//! largest at a corner: `max d(corner, F)` bounds the piece, and is exact where F is the nearest everywhere. The
//! distance to B changes no faster than one moves: `d(centre, B) + radius` bounds it too (as in Guthe, Borodin, Klein.
//! Fast and accurate Hausdorff distance calculation between meshes, WSCG 2005; Tang, Lee, Kim. Interactive Hausdorff
//! distance computation for general polygonal models, SIGGRAPH 2009). A piece whose bound exceeds what is already
//! reached somewhere, by more than the slack, is cut: along the sides of the prism over the face nearest to its centre,
//! which resolves flat regions in one cut, else in halves.
//!
//! # Invariants
//! - `lower <= true maximum <= upper`, but for rounding, which is added to `upper`.
//! - The same meshes give the same bits on any number of threads: faces are judged one by one.
//!
//! # Cost
//! About one closest-point query a vertex, sample and face, more only where the bound is not yet tight. The work a face
//! is bounded; where the bound is reached, `upper` stays certified and the slack says what is missing.
//!
//! # Departures
//! Best-first order over all faces is replaced by one threshold, taken from samples and corners before any face is cut:
//! it costs a few pieces more and makes faces independent.

use std::sync::OnceLock;

use glam::DVec3;
use rayon::prelude::*;
use rustc_hash::FxHashSet;
use serde::{Deserialize, Serialize};

use super::intersection::{Triangulated, triangulated};
use super::summary;
use crate::mesh::bvh::TriangleBvh;
use crate::mesh::geometry::triangle_area;
use crate::mesh::{FaceId, IdVec, Soup, VertexId};
use crate::watch::{Cancelled, Watch};

mod inside;
mod memo;
mod piece;

pub use inside::Inside;
pub use memo::Memo;
use memo::{Key, key_of};
use piece::{Limits, refine};

/// A mesh prepared for distances.
#[derive(Clone, Debug)]
pub struct Target {
    points: IdVec<crate::mesh::id::Vertex, DVec3>,
    cut: Triangulated,
    triangles: Vec<[DVec3; 3]>,
    bvh: TriangleBvh,
    keys: OnceLock<(Vec<Key>, FxHashSet<Key>)>,
}

impl Target {
    /// Prepares a mesh.
    pub fn of(mesh: &Soup) -> Self {
        let cut = triangulated(mesh);
        let triangles = cut.coordinates(mesh);
        Self {
            points: mesh.points.clone(),
            bvh: TriangleBvh::new(triangles.clone()),
            cut,
            triangles,
            keys: OnceLock::new(),
        }
    }

    /// The hierarchy over its triangles.
    pub fn bvh(&self) -> &TriangleBvh {
        &self.bvh
    }

    /// The triangles, quads cut in two.
    pub fn triangles(&self) -> &[[DVec3; 3]] {
        &self.triangles
    }

    /// The face that triangle `index` comes from.
    pub fn face(&self, index: u32) -> FaceId {
        self.cut.origin[index as usize]
    }

    /// The same about another origin.
    fn moved(&self, origin: DVec3) -> Self {
        let mut points = self.points.clone();
        points.iter_mut().for_each(|p| *p -= origin);
        let triangles: Vec<[DVec3; 3]> = self.triangles.iter().map(|t| t.map(|p| p - origin)).collect();
        let (cut, bvh) = (self.cut.clone(), TriangleBvh::new(triangles.clone()));
        Self { points, cut, bvh, triangles, keys: OnceLock::new() }
    }

    /// The hashes of its triangles, one by one and as a set.
    fn hashes(&self) -> &(Vec<Key>, FxHashSet<Key>) {
        self.keys.get_or_init(|| {
            let keys: Vec<Key> = self.triangles.par_iter().map(key_of).collect();
            let set = keys.iter().copied().collect();
            (keys, set)
        })
    }

    fn keys(&self) -> &[Key] {
        &self.hashes().0
    }

    fn key_set(&self) -> &FxHashSet<Key> {
        &self.hashes().1
    }

    /// Largest coordinate, for the size of rounding errors.
    fn magnitude(&self) -> f64 {
        let bounds = self.bvh.bounds();
        if bounds.is_empty() { 0.0 } else { bounds.min.abs().max(bounds.max.abs()).max_element() }
    }
}

/// Distances from one mesh to another.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct OneSided {
    /// The largest distance is not more than this.
    pub upper: f64,
    /// A distance that is reached.
    pub lower: f64,
    /// Where it is reached.
    pub at: DVec3,
    /// The face of the first mesh where it is reached.
    pub face: FaceId,
    /// Mean distance of the samples.
    pub mean: f64,
    /// Root mean square distance of the samples.
    pub rms: f64,
    /// Number of samples.
    pub samples: usize,
}

/// How samples are spread: this many a face, but not fewer and not more than these.
const SAMPLES_A_FACE: usize = 10;
const SAMPLES: std::ops::RangeInclusive<usize> = 20_000..=200_000;

/// Points spread evenly over the area: one in the middle of each of `count` equal parts of the running area, placed in
/// its triangle by the plastic-number sequence (Roberts. The unreasonable effectiveness of quasirandom sequences,
/// 2018).
pub fn sample(triangles: &[[DVec3; 3]], count: usize) -> Vec<(u32, DVec3)> {
    let mut running = Vec::with_capacity(triangles.len());
    let mut total = 0.0;
    for &t in triangles {
        total += triangle_area(t);
        running.push(total);
    }
    if !(total > 0.0 && total.is_finite()) {
        return Vec::new();
    }
    let place = |k: usize| {
        let area = (k as f64 + 0.5) / count as f64 * total;
        let t = running.partition_point(|&a| a <= area).min(triangles.len() - 1);
        let [a, b, c] = triangles[t];
        // Reciprocals of the plastic number and of its square.
        let (mut u, mut v) =
            ((0.5 + 0.754_877_666_246_692_8 * k as f64).fract(), (0.5 + 0.569_840_290_998_053_2 * k as f64).fract());
        if u + v > 1.0 {
            (u, v) = (1.0 - u, 1.0 - v);
        }
        (t as u32, a + u * (b - a) + v * (c - a))
    };
    (0..count).into_par_iter().map(place).collect()
}

/// Which triangles of the first mesh are looked at.
type Open<'a> = &'a (dyn Fn(usize) -> bool + Sync);

/// Distance and nearest triangle of every vertex of `from` that a triangle that is `open` uses; infinite for the
/// others.
fn corner_distances(from: &Target, to: &Target, open: Open<'_>) -> Vec<(f64, u32)> {
    let mut used = vec![false; from.points.len()];
    for (t, triangle) in from.cut.corners.iter().enumerate() {
        if open(t) {
            for v in triangle {
                used[v.index()] = true;
            }
        }
    }
    let query = |v: usize| match to.bvh.closest(from.points[VertexId::new(v)]) {
        Some(found) => (found.nearest.distance_squared, found.index),
        None => (f64::INFINITY, 0),
    };
    let query = |v: usize| if used[v] { query(v) } else { (f64::INFINITY, 0) };
    (0..from.points.len()).into_par_iter().map(query).collect()
}

/// The slack at which refinement stops: this part of the diagonal of `to`, or of the distance where that is more.
const SLACK_OF_DIAGONAL: f64 = 1e-5;
const SLACK_OF_DISTANCE: f64 = 0.01;

/// The largest, mean and root mean square distance from one mesh to another; `None` where one has no triangle.
pub fn one_sided(from: &Target, to: &Target, watch: &Watch) -> Result<Option<OneSided>, Cancelled> {
    let count = (SAMPLES_A_FACE * from.triangles.len()).clamp(*SAMPLES.start(), *SAMPLES.end());
    sampled(from, to, count, watch)
}

/// A certified bound of the largest distance from one mesh to another; `None` where one has no triangle. Several times
/// faster than [`one_sided`] where the mean is not wanted, because samples serve only as a start.
pub fn upper_bound(from: &Target, to: &Target, watch: &Watch) -> Result<Option<f64>, Cancelled> {
    Ok(sampled(from, to, from.triangles.len(), watch)?.map(|found| found.upper))
}

/// The same from so many samples.
fn sampled(from: &Target, to: &Target, count: usize, watch: &Watch) -> Result<Option<OneSided>, Cancelled> {
    if from.triangles.is_empty() || to.triangles.is_empty() {
        return Ok(None);
    }
    if let Some((origin, [from, to])) = nearer(from, to) {
        let found = sampled(&from, &to, count, watch)?;
        let lost = rounding_at(origin);
        return Ok(found.map(|found| OneSided { upper: found.upper + lost, at: found.at + origin, ..found }));
    }
    let corners = corner_distances(from, to, &|_| true);
    watch.check()?;
    let samples = sample(&from.triangles, count);
    let distances: Vec<f64> =
        samples.par_iter().map(|&(_, p)| to.bvh.closest(p).map_or(0.0, |c| c.distance())).collect();
    watch.check()?;
    let mut farthest = (0.0, from.triangles[0][0], from.cut.origin[0]);
    let mut reach = |distance: f64, at: DVec3, face: FaceId| {
        if distance > farthest.0 {
            farthest = (distance, at, face);
        }
    };
    for (t, triangle) in from.cut.corners.iter().enumerate() {
        for &v in triangle {
            reach(corners[v.index()].0.sqrt(), from.points[v], from.cut.origin[t]);
        }
    }
    for (&(t, p), &d) in samples.iter().zip(&distances) {
        reach(d, p, from.cut.origin[t as usize]);
    }
    let slack = (SLACK_OF_DIAGONAL * to.bvh.bounds().diagonal()).max(SLACK_OF_DISTANCE * farthest.0);
    let limits = Limits::new(farthest.0 + slack, slack, f64::INFINITY, to);
    let refined = refine_all(from, to, &corners, &limits, &|_| true, watch)?;
    let mut upper = farthest.0;
    for (t, bound) in refined.iter().enumerate() {
        upper = upper.max(bound.upper);
        if bound.lower > farthest.0 {
            farthest = (bound.lower, bound.at, from.cut.origin[t]);
        }
    }
    Ok(Some(OneSided {
        upper: upper.max(farthest.0) + rounding(from, to),
        lower: farthest.0,
        at: farthest.1,
        face: farthest.2,
        mean: summary::mean(&distances).unwrap_or(0.0),
        rms: summary::rms(&distances).unwrap_or(0.0),
        samples: distances.len(),
    }))
}

/// What rounding may do to a distance: a few units in the last place of the largest coordinate.
fn rounding(from: &Target, to: &Target) -> f64 {
    16.0 * f64::EPSILON * from.magnitude().max(to.magnitude())
}

/// What moving to an origin so far away may do to a distance.
fn rounding_at(origin: DVec3) -> f64 {
    16.0 * f64::EPSILON * origin.abs().max_element()
}

/// Meshes this many times their size away from the origin are moved there, where fewer digits are lost.
const FAR: f64 = 100.0;

/// Both meshes moved to the origin by the same vector, where they are far from it.
fn nearer(from: &Target, to: &Target) -> Option<(DVec3, [Target; 2])> {
    let bounds = to.bvh.bounds();
    let origin = 0.5 * (bounds.min + bounds.max);
    let is_far = origin.is_finite() && origin.abs().max_element() > FAR * bounds.diagonal();
    is_far.then(|| (origin, [from.moved(origin), to.moved(origin)]))
}

fn refine_all(
    from: &Target,
    to: &Target,
    corners: &[(f64, u32)],
    limits: &Limits<'_>,
    open: Open<'_>,
    watch: &Watch,
) -> Result<Vec<piece::Bound>, Cancelled> {
    let total: f64 = summary::sum(from.triangles.iter().map(|&t| triangle_area(t)));
    let judge = |t: usize| {
        if watch.is_cancelled() || !open(t) {
            return piece::Bound::default();
        }
        let share = if total > 0.0 { triangle_area(from.triangles[t]) / total } else { 0.0 };
        refine(from.cut.corners[t].map(|v| (from.points[v], corners[v.index()])), to, limits, share)
    };
    let bounds = (0..from.triangles.len()).into_par_iter().map(judge).collect();
    watch.check()?;
    Ok(bounds)
}

/// Whether one mesh stays within a distance of another.
#[derive(Clone, Debug, PartialEq)]
pub struct Decision {
    /// No point is known to be farther, and no face is undecided.
    pub holds: bool,
    /// Faces of the first mesh with a point farther than the threshold, with the point and its distance, in order.
    pub beyond: Vec<(FaceId, DVec3, f64)>,
    /// Faces that could not be decided within the work allowed, with the bound reached.
    pub undecided: Vec<(FaceId, f64)>,
    /// The largest bound of any face; certified where `holds`.
    pub upper: f64,
}

/// Decides whether the distance from one mesh to another is at most `threshold`, refining only until each face is
/// decided. A distance within rounding of the threshold counts as within.
pub fn decide(from: &Target, to: &Target, threshold: f64, watch: &Watch) -> Result<Option<Decision>, Cancelled> {
    decide_where(from, to, threshold, &|_| true, None, watch)
}

/// Which faces matter.
pub type Wanted<'a> = &'a (dyn Fn(FaceId) -> bool + Sync);

/// The same for those faces of the first mesh that are `wanted`. What a `memo` of earlier decisions knows to be within
/// is not looked at, and counts with the threshold towards `upper`: the outcome is the same.
pub fn decide_where(
    from: &Target,
    to: &Target,
    threshold: f64,
    wanted: Wanted<'_>,
    memo: Option<&mut Memo>,
    watch: &Watch,
) -> Result<Option<Decision>, Cancelled> {
    decide_parts(from, to, threshold, (wanted, None), memo, watch)
}

/// The same for those parts of the first mesh that are not inside of the second one's bodies.
pub fn decide_outside(
    from: &Target,
    to: &Target,
    threshold: f64,
    hidden: &Inside,
    watch: &Watch,
) -> Result<Option<Decision>, Cancelled> {
    decide_parts(from, to, threshold, (&|_| true, Some(hidden)), None, watch)
}

fn decide_parts(
    from: &Target,
    to: &Target,
    threshold: f64,
    (wanted, hidden): (Wanted<'_>, Option<&Inside>),
    mut memo: Option<&mut Memo>,
    watch: &Watch,
) -> Result<Option<Decision>, Cancelled> {
    if from.triangles.is_empty() || to.triangles.is_empty() {
        return Ok(None);
    }
    if let Some((origin, [from, to])) = nearer(from, to) {
        let hidden = hidden.map(|hidden| hidden.moved(origin));
        let parts = (wanted, hidden.as_ref());
        let mut found = decide_parts(&from, &to, threshold + rounding_at(origin), parts, memo, watch)?;
        found.iter_mut().flat_map(|found| &mut found.beyond).for_each(|(_, at, _)| *at += origin);
        return Ok(found);
    }
    let known = memo.as_deref_mut().map_or_else(Vec::new, |memo| memo.known(from, to, threshold));
    let is_known = |t: usize| known.get(t).is_some_and(|&known| known);
    let is_wanted = |t: usize| wanted(from.cut.origin[t]);
    let open = |t: usize| is_wanted(t) && !is_known(t);
    let corners = corner_distances(from, to, &open);
    watch.check()?;
    let limit = threshold * (1.0 + 1e-9) + rounding(from, to);
    let limits = Limits::new(limit, 0.0, limit, to).without(hidden);
    let refined = refine_all(from, to, &corners, &limits, &open, watch)?;
    let upper = if known.contains(&true) { limit } else { 0.0 };
    let mut out = Decision { holds: true, beyond: Vec::new(), undecided: Vec::new(), upper };
    for (t, bound) in refined.iter().enumerate() {
        let face = from.cut.origin[t];
        out.upper = out.upper.max(bound.upper.max(bound.lower));
        if bound.lower > limit {
            out.beyond.push((face, bound.at, bound.lower));
        } else if bound.upper > limit {
            out.undecided.push((face, bound.upper));
        } else if let Some(memo) = memo.as_deref_mut().filter(|_| open(t)) {
            memo.learn(from, t, bound, to);
        }
    }
    out.holds = out.beyond.is_empty() && out.undecided.is_empty();
    Ok(Some(out))
}

/// The part of the diagonal below which distances from outside parts are not told apart.
const FINEST: f64 = 1e-3;

/// A certified bound of the largest distance from those parts of one mesh that are not inside of another one's bodies;
/// `None` where one has no triangle.
pub fn outside_bound(from: &Target, to: &Target, hidden: &Inside, watch: &Watch) -> Result<Option<f64>, Cancelled> {
    let mut threshold = FINEST * to.bvh.bounds().diagonal();
    loop {
        let found = decide_outside(from, to, threshold, hidden, watch)?;
        match found {
            // Once all is within, the bound of that is it; what is far is looked at more coarsely.
            Some(found) if !found.holds && threshold.is_finite() && threshold > 0.0 => threshold *= 4.0,
            found => return Ok(found.map(|found| found.upper)),
        }
    }
}

/// Both ways between a mesh and its reference.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TwoSided {
    /// From the mesh to the reference.
    pub to_reference: OneSided,
    /// From the reference to the mesh.
    pub from_reference: OneSided,
}

impl TwoSided {
    /// A certified upper bound of the Hausdorff distance.
    pub fn upper(&self) -> f64 {
        self.to_reference.upper.max(self.from_reference.upper)
    }

    /// A distance that is reached on one side.
    pub fn lower(&self) -> f64 {
        self.to_reference.lower.max(self.from_reference.lower)
    }
}

/// Distances both ways; `None` where one mesh has no triangle.
pub fn two_sided(mesh: &Target, reference: &Target, watch: &Watch) -> Result<Option<TwoSided>, Cancelled> {
    let (to, from) = (one_sided(mesh, reference, watch)?, one_sided(reference, mesh, watch)?);
    Ok(to.zip(from).map(|(to_reference, from_reference)| TwoSided { to_reference, from_reference }))
}

#[cfg(test)]
mod tests;
