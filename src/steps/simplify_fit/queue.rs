//! The queue of faces by amended shortest length, and its rounds.

use super::cases::{Bench, Outcome};
use crate::mesh::{EdgeId, FaceId, VertexId};
use crate::technique::guarded::StarRules;
use crate::technique::heap::IndexedHeap;
use crate::watch::{Cancelled, Watch};

/// How many faces pass between two looks at the watch.
const WATCH_EVERY: usize = 1024;

/// The first estimate of the shortest edge wanted, as a share of the side of equilateral faces of the mean area.
const FIRST: f64 = 0.7;

/// Growth of the length when no face is left below it, and how often it may grow.
const GROWTH: f64 = 1.15;
const MOST_GROWTHS: i32 = 10;

/// The least stretch that new faces must have, by round: poor collapses only when good ones do not suffice.
const COMFORT: [f64; 8] = [0.5, 0.4, 0.32, 0.25, 0.2, 0.15, 0.1, 0.0];

/// Rounds until `target` faces are left or no face may go. Returns whether the target is reached.
pub(super) fn simplify(bench: &mut Bench<'_, '_>, target: usize, watch: &Watch) -> Result<bool, Cancelled> {
    let start = bench.guarded.mesh().face_count();
    if start <= target {
        return Ok(true);
    }
    watch.phase("simplify", Some((start - target) as u64));
    let l0 = first_length(bench, target);
    let slots = bench.guarded.mesh().face_slots();
    let mut queue = Queue { heap: IndexedHeap::with_items(slots), refused: vec![u64::MAX; slots], popped: 0, start };
    let mut growth = 0;
    for round in 0.. {
        let comfort = COMFORT[round.min(COMFORT.len() - 1)].max(bench.guarded.limits().min_stretch);
        let l0 = l0 * libm::pow(GROWTH, f64::from(growth));
        let before = bench.guarded.mesh().face_count();
        if queue.pass(bench, l0, comfort, target, watch)? {
            return Ok(true);
        }
        let gone = before - bench.guarded.mesh().face_count();
        let is_last = growth == MOST_GROWTHS && round >= COMFORT.len();
        if is_last && gone == 0 {
            return Ok(false);
        }
        growth = (growth + 1).min(MOST_GROWTHS);
    }
    Ok(false)
}

/// Sweeps over all edges before [`exhaust`] ends.
const MOST_SWEEPS: usize = 8;

/// Positions that [`exhaust`] tests in full.
const ALL_PLACES: usize = 6;

/// Collapses what no test refuses, shortest first, whatever its case and length: for a target that the paper's rounds
/// have not reached. Returns whether it is.
pub(super) fn exhaust(bench: &mut Bench<'_, '_>, target: usize, watch: &Watch) -> Result<bool, Cancelled> {
    watch.phase("exhaust", None);
    let rules = rules(bench.guarded.limits().min_stretch);
    let usual = std::mem::replace(&mut bench.most_tried, ALL_PLACES);
    let mut refused = vec![u64::MAX; bench.guarded.mesh().edge_slots()];
    for _ in 0..MOST_SWEEPS {
        let before = bench.guarded.mesh().face_count();
        let mut edges: Vec<(f64, EdgeId)> = bench.guarded.mesh().edges().map(|e| (bench.edge_length(e), e)).collect();
        edges.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        for (place, (_, e)) in edges.into_iter().enumerate() {
            if place.is_multiple_of(WATCH_EVERY) {
                watch.check()?;
            }
            if bench.guarded.mesh().face_count() <= target {
                break;
            }
            let mesh = bench.guarded.mesh();
            if !mesh.edge_is_live(e) {
                continue;
            }
            let age = mesh.ends(e).into_iter().map(|v| u64::from(mesh.version(v))).sum();
            if refused[e.index()] != age && !bench.merge_any(e, &rules) {
                refused[e.index()] = age;
            }
        }
        let left = bench.guarded.mesh().face_count();
        if left <= target || left == before {
            break;
        }
    }
    bench.most_tried = usual;
    Ok(bench.guarded.mesh().face_count() <= target)
}

fn rules(min_stretch: f64) -> StarRules {
    StarRules { min_stretch, ..StarRules::default() }
}

/// The length of the paper's first step, which it does not say how to estimate: equilateral faces of the mean area.
fn first_length(bench: &Bench<'_, '_>, target: usize) -> f64 {
    let mesh = bench.guarded.mesh();
    let area: f64 = mesh.faces().map(|f| crate::mesh::geometry::triangle_area(mesh.corner_points(f))).sum();
    FIRST * (4.0 * area / (3.0_f64.sqrt() * target.max(1) as f64)).sqrt()
}

struct Queue {
    heap: IndexedHeap,
    /// What a face looked like when a guard refused it: refused again unless something has changed.
    refused: Vec<u64>,
    popped: usize,
    start: usize,
}

impl Queue {
    /// One pass over all faces, shortest first. Returns whether the target is reached.
    fn pass(
        &mut self,
        bench: &mut Bench<'_, '_>,
        l0: f64,
        comfort: f64,
        target: usize,
        watch: &Watch,
    ) -> Result<bool, Cancelled> {
        let rules = rules(comfort);
        let faces: Vec<FaceId> = bench.guarded.mesh().faces().collect();
        for f in faces {
            self.push(bench, f);
        }
        while bench.guarded.mesh().face_count() > target {
            let Some((item, _)) = self.heap.pop() else { return Ok(false) };
            self.popped += 1;
            if self.popped.is_multiple_of(WATCH_EVERY) {
                watch.check()?;
                let left = bench.guarded.mesh().face_count();
                watch.advance(self.start.saturating_sub(left) as u64, || format!("{left} faces left"));
            }
            let f = FaceId::from_raw(item);
            let state = state(bench, f, comfort);
            if !bench.guarded.mesh().face_is_live(f) || self.refused.get(f.index()) == Some(&state) {
                continue;
            }
            match bench.act(f, l0, &rules) {
                Outcome::Merged(v) => self.refresh(bench, v),
                Outcome::Refused => self.remember(f, state),
                Outcome::TooLong => {}
            }
        }
        Ok(true)
    }

    fn remember(&mut self, f: FaceId, state: u64) {
        if f.index() >= self.refused.len() {
            self.refused.resize(f.index() + 1, u64::MAX);
        }
        self.refused[f.index()] = state;
    }

    fn push(&mut self, bench: &Bench<'_, '_>, f: FaceId) {
        self.heap.set(f.raw(), -bench.amended(f) as f32);
    }

    /// After a merge: dispersions round the new vertex, then the lengths of all faces that look at one of them.
    fn refresh(&mut self, bench: &mut Bench<'_, '_>, merged: VertexId) {
        let ring: smallvec::SmallVec<[VertexId; 16]> = bench.guarded.mesh().neighbours(merged).collect();
        bench.update(merged);
        for &v in &ring {
            bench.update(v);
        }
        let mut faces: smallvec::SmallVec<[FaceId; 64]> =
            ring.iter().flat_map(|&v| bench.guarded.mesh().faces_around(v)).collect();
        faces.sort_unstable();
        faces.dedup();
        for f in faces {
            self.push(bench, f);
        }
    }
}

/// Changes whenever the stars of the corners or the comfort asked for change.
fn state(bench: &Bench<'_, '_>, f: FaceId, comfort: f64) -> u64 {
    let mesh = bench.guarded.mesh();
    if !mesh.face_is_live(f) {
        return 0;
    }
    let versions: u64 = mesh.corners(f).into_iter().map(|v| u64::from(mesh.version(v))).sum();
    (versions << 16) | (comfort * 1000.0) as u64
}
