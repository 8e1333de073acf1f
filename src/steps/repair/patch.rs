//! A fill made like its surroundings: as fine as the mesh round the hole, and as smooth.
//!
//! Liepa: Filling holes in meshes. SGP 2003, sections 4 and 5: triangles are split at their centroids until their
//! edges fit the scale at their corners, edges are flipped to be Delaunay, and the new vertices settle where the
//! umbrella operator vanishes (Kobbelt, Campagna, Vorsatz, Seidel. SIGGRAPH 1998), or the Laplacian of their mean
//! curvature normals.
//!
//! Where the coarse fill meets the rim at a sharp angle, the rim is taken for an edge of the part: then the fill is a
//! membrane, flat in a flat rim. Else it goes on smoothly, as Liepa's always does.

use std::collections::BTreeMap;

use glam::DVec3;
use rustc_hash::FxHashMap;

/// A fill; the first `rim` vertices are the corners of the loop.
#[derive(Clone, Debug)]
pub(super) struct Patch {
    /// Vertices: first the loop's, then new ones.
    pub(super) points: Vec<DVec3>,
    /// Corners of each triangle.
    pub(super) triangles: Vec<[usize; 3]>,
    /// Number of loop corners.
    pub(super) rim: usize,
}

/// What a patch must fit: per corner of the loop.
pub(super) struct Surroundings {
    /// The mean length of the edges at each corner.
    pub(super) scale: Vec<f64>,
    /// The neighbours of each corner outside the hole.
    pub(super) neighbours: Vec<Vec<DVec3>>,
}

/// A bend (1 - cosine) beyond which the rim counts as an edge of the part: 40 degrees.
const SHARP: f64 = 0.234;
/// Refinement stops at this many triangles; finer fills help nobody.
const MOST_TRIANGLES: usize = 200_000;
/// Each round splits all triangles that are too coarse; a round at least halves the edges.
const ROUNDS: usize = 24;

/// Splits and flips until the triangles are as fine as the surroundings.
pub(super) fn refine(patch: &mut Patch, around: &Surroundings, is_free: &dyn Fn(usize, usize) -> bool) {
    let mut scale = around.scale.clone();
    relax(patch, is_free);
    for _ in 0..ROUNDS {
        let before = patch.triangles.len();
        for i in 0..before {
            let t = patch.triangles[i];
            let centre = t.iter().map(|&v| patch.points[v]).sum::<DVec3>() / 3.0;
            let fit = t.iter().map(|&v| scale[v]).sum::<f64>() / 3.0;
            let is_coarse = t.iter().all(|&v| {
                let reach = std::f64::consts::SQRT_2 * centre.distance(patch.points[v]);
                reach > fit && reach > scale[v]
            });
            if is_coarse && patch.triangles.len() < MOST_TRIANGLES {
                let v = patch.points.len();
                patch.points.push(centre);
                scale.push(fit);
                patch.triangles[i] = [t[0], t[1], v];
                patch.triangles.extend([[t[1], t[2], v], [t[2], t[0], v]]);
            }
        }
        if patch.triangles.len() == before {
            return;
        }
        relax(patch, is_free);
    }
}

/// Flips edges inside the patch until the angles across from each sum up to half a turn at most.
fn relax(patch: &mut Patch, is_free: &dyn Fn(usize, usize) -> bool) {
    let mut sides: FxHashMap<[usize; 2], [usize; 2]> = FxHashMap::default();
    let mut edges = Vec::new();
    for (i, &t) in patch.triangles.iter().enumerate() {
        for k in 0..3 {
            let edge = key(t[k], t[(k + 1) % 3]);
            sides.entry(edge).and_modify(|s| s[1] = i).or_insert_with(|| {
                edges.push(edge);
                [i, usize::MAX]
            });
        }
    }
    // Flips towards Delaunay end; in space they nearly always do, and the bound sees to the rest.
    let mut flips = 20 * edges.len();
    while let Some(edge) = edges.pop() {
        let Some(&[i, j]) = sides.get(&edge) else { continue };
        if j == usize::MAX || flips == 0 {
            continue;
        }
        let (Some(c), Some(d)) = (across(patch.triangles[i], edge), across(patch.triangles[j], edge)) else { continue };
        let new = key(c, d);
        let is_taken = c == d || sides.contains_key(&new) || (c < patch.rim && d < patch.rim && !is_free(c, d));
        if is_taken || !is_illegal(&patch.points, edge, c, d) {
            continue;
        }
        flips -= 1;
        // Keep the direction of the first triangle: it runs from `a` to `b`.
        let t = patch.triangles[i];
        let runs = (0..3).any(|k| [t[k], t[(k + 1) % 3]] == edge);
        let [a, b] = if runs { edge } else { [edge[1], edge[0]] };
        patch.triangles[i] = [c, a, d];
        patch.triangles[j] = [d, b, c];
        sides.remove(&edge);
        sides.insert(new, [i, j]);
        // Two of the outer edges have changed hands.
        for (outer, old, now) in [(key(a, d), j, i), (key(b, c), i, j)] {
            if let Some(pair) = sides.get_mut(&outer) {
                let which = usize::from(pair[0] != old);
                pair[which] = now;
            }
        }
        edges.extend([key(a, c), key(c, b), key(b, d), key(d, a)]);
    }
}

fn key(a: usize, b: usize) -> [usize; 2] {
    if a < b { [a, b] } else { [b, a] }
}

fn across(t: [usize; 3], edge: [usize; 2]) -> Option<usize> {
    t.into_iter().find(|v| !edge.contains(v))
}

/// Whether flipping makes the larger of the angles across smaller, and keeps both triangles on one side.
fn is_illegal(points: &[DVec3], [a, b]: [usize; 2], c: usize, d: usize) -> bool {
    let [a, b, c, d] = [a, b, c, d].map(|v| points[v]);
    let cotangent = |tip: DVec3, p: DVec3, q: DVec3| (p - tip).dot(q - tip) / (p - tip).cross(q - tip).length();
    // The angles sum up to more than half a turn exactly when the cotangents sum up to less than zero.
    let sum = cotangent(c, a, b) + cotangent(d, a, b);
    let (first, second) = ((a - c).cross(d - c), (b - d).cross(c - d));
    sum < -1e-9 && first.dot(second) > 0.0
}

/// Settles the new vertices.
pub(super) fn fair(patch: &mut Patch, around: &Surroundings, rim_bend: f64) {
    let mut neighbours: Vec<Vec<usize>> = vec![Vec::new(); patch.points.len()];
    for t in &patch.triangles {
        for k in 0..3 {
            let (a, b) = (t[k], t[(k + 1) % 3]);
            neighbours[a].push(b);
            neighbours[b].push(a);
        }
    }
    for list in &mut neighbours {
        list.sort_unstable();
        list.dedup();
    }
    settle(patch, |patch, v| umbrella(patch, around, &neighbours, v));
    if rim_bend < SHARP {
        // Measured on the flat fill first, then on the bent one.
        for _ in 0..2 {
            let links = Links::new(patch, around);
            settle(patch, |patch, v| links.step(patch, around, v));
        }
    }
}

/// The mean curvature normal at each vertex, as the cotangents of the angles across its edges give it (U. Pinkall, K.
/// Polthier. Computing discrete minimal surfaces and their conjugates. Experimental Mathematics 2(1), 1993): it does
/// not depend on how fine the triangles are on either side of the rim.
struct Links {
    /// Neighbours in the patch, with weights.
    inside: Vec<Vec<(usize, f64)>>,
    /// Weights of those outside of it, of corners of the loop.
    outside: Vec<Vec<f64>>,
    /// A third of the triangles' area.
    area: Vec<f64>,
}

impl Links {
    fn new(patch: &Patch, around: &Surroundings) -> Self {
        let mut area = vec![0.0; patch.points.len()];
        let mut edges: BTreeMap<[usize; 2], f64> = BTreeMap::new();
        for t in &patch.triangles {
            for k in 0..3 {
                let [a, b, c] = [0, 1, 2].map(|j| t[(k + j) % 3]);
                let [p, q, r] = [a, b, c].map(|v| patch.points[v]);
                *edges.entry(key(a, b)).or_default() += cotangent(r, p, q);
                area[a] += (q - p).cross(r - p).length() / 6.0;
            }
        }
        let mut outside = Vec::with_capacity(patch.rim);
        for (v, beyond) in around.neighbours.iter().enumerate() {
            let point = patch.points[v];
            let [after, before] = [1, patch.rim - 1].map(|step| (v + step) % patch.rim);
            let ring: Vec<DVec3> =
                [patch.points[after]].into_iter().chain(beyond.iter().copied()).chain([patch.points[before]]).collect();
            let mut weights = vec![0.0; ring.len()];
            for (i, pair) in ring.windows(2).enumerate() {
                weights[i] += cotangent(pair[1], point, pair[0]);
                weights[i + 1] += cotangent(pair[0], point, pair[1]);
                area[v] += (pair[0] - point).cross(pair[1] - point).length() / 6.0;
            }
            *edges.entry(key(v, after)).or_default() += weights[0];
            outside.push(weights[1..=beyond.len()].iter().map(|&weight| clamped(weight)).collect());
        }
        let mut inside = vec![Vec::new(); patch.points.len()];
        for ([a, b], weight) in edges {
            inside[a].push((b, clamped(weight)));
            inside[b].push((a, clamped(weight)));
        }
        Self { inside, outside, area }
    }

    /// The mean curvature normal.
    fn normal(&self, patch: &Patch, around: &Surroundings, v: usize) -> DVec3 {
        let point = patch.points[v];
        let inside: DVec3 = self.inside[v].iter().map(|&(u, weight)| weight * (patch.points[u] - point)).sum();
        let beyond = around.neighbours.get(v).into_iter().flatten().zip(self.outside.get(v).into_iter().flatten());
        (inside + beyond.map(|(&p, &weight)| weight * (p - point)).sum::<DVec3>()) / self.area[v]
    }

    /// Where a vertex has to go for its normal to be the mean of its neighbours'.
    fn step(&self, patch: &Patch, around: &Surroundings, v: usize) -> DVec3 {
        let own = self.normal(patch, around, v);
        let (mut change, mut all, mut stiffness) = (DVec3::ZERO, 0.0, 0.0);
        for &(u, weight) in &self.inside[v] {
            change += weight * (own - self.normal(patch, around, u));
            all += weight;
            stiffness += weight * weight / self.area[u];
        }
        change / (stiffness + all * all / self.area[v])
    }
}

/// Half the cotangent of the angle at a tip.
fn cotangent(tip: DVec3, p: DVec3, q: DVec3) -> f64 {
    let (p, q) = (p - tip, q - tip);
    let across = p.cross(q).length();
    if across > 0.0 { 0.5 * p.dot(q) / across } else { 0.0 }
}

/// Weights of needles would make all others count for nothing, and negative ones let the fill fold.
fn clamped(weight: f64) -> f64 {
    weight.clamp(0.05, 20.0)
}

/// The mean of the neighbours, seen from the vertex.
fn umbrella(patch: &Patch, around: &Surroundings, neighbours: &[Vec<usize>], v: usize) -> DVec3 {
    let outside = around.neighbours.get(v).map_or(&[][..], Vec::as_slice);
    let count = (neighbours[v].len() + outside.len()) as f64;
    let sum: DVec3 = neighbours[v].iter().map(|&u| patch.points[u]).chain(outside.iter().copied()).sum();
    sum / count - patch.points[v]
}

/// Sweeps after which settling stops; each costs time proportional to the patch.
const SWEEPS: usize = 2000;
/// Vertices moved in all sweeps together, so that no hole takes longer than a few seconds. Large fills are less smooth.
const MOST_MOVES: usize = 10_000_000;

/// Gauss-Seidel sweeps with the given step until steps are a small share of the patch's extent.
fn settle(patch: &mut Patch, step: impl Fn(&Patch, usize) -> DVec3) {
    let extent = patch.points.iter().map(|p| p.distance(patch.points[0])).fold(0.0, f64::max);
    let inner = patch.points.len() - patch.rim;
    for _ in 0..SWEEPS.min(MOST_MOVES / inner.max(1)) {
        let mut largest = 0.0_f64;
        for v in patch.rim..patch.points.len() {
            let shift = step(patch, v);
            patch.points[v] += shift;
            largest = largest.max(shift.length());
        }
        if largest <= 1e-7 * extent {
            return;
        }
    }
}
