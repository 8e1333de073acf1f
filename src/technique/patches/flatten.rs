//! Lays the vertices that an element covers flat in the unit square: the rim by length, the inside by the barycentric
//! map with mean value weights, which keeps angles about as they are whatever the triangles are like. That is where the
//! search for their true parameters begins. Where there is no vertex for a stretch, places on the faces stand in.
//!
//! Based on: M. S. Floater. Mean Value Coordinates. CAGD 20, 2003; S. Yoshizawa, A. Belyaev, H.-P. Seidel. A Fast and
//! Simple Stretch-Minimizing Mesh Parameterization. SMI 2004.

use glam::DVec3;
use rustc_hash::FxHashMap;

use super::frame::Frame;
use super::solve::Samples;
use crate::mesh::geometry::triangle_area;
use crate::mesh::{FaceId, VertexId};
use crate::technique::layout::Ground;

/// The vertices inside an element, where they lie in the unit square, each with a third of the area around it.
pub(super) fn flatten(frame: &Frame<'_>, element: usize) -> Samples {
    let ground = frame.layout.ground;
    let mut place: FxHashMap<VertexId, usize> = FxHashMap::default();
    let mut at: Vec<[f64; 2]> = Vec::new();
    for (v, uv) in rim(frame, element) {
        place.insert(v, at.len());
        at.push(uv);
    }
    let on_rim = at.len();
    let mut inside: Vec<VertexId> = Vec::new();
    for &v in frame.layout.faces(element as u32).iter().flat_map(|&f| &ground.surface.faces[f]) {
        place.entry(v).or_insert_with(|| {
            inside.push(v);
            at.push([0.5; 2]);
            at.len() - 1
        });
    }
    let rows: Vec<Vec<(usize, f64)>> = inside.iter().map(|&v| mean_values(ground, v, &place)).collect();
    relax(&rows, &mut at, on_rim);
    let corners = |&f: &FaceId| (ground.surface.faces[f].map(|v| place[&v]), ground.surface.corners(f));
    let shapes: Vec<([usize; 3], [DVec3; 3])> = frame.layout.faces(element as u32).iter().map(corners).collect();
    spread(rows, &mut at, on_rim, &shapes);
    let area = |f: FaceId| triangle_area(ground.surface.corners(f));
    let around = |&v: &VertexId| ground.faces_at.of(v).iter().map(|&f| area(f)).sum::<f64>() / 3.0;
    let flat = |f: FaceId| ground.surface.faces[f].map(|v| at[place[&v]]);
    let faces: Vec<(FaceId, [[f64; 2]; 3])> =
        frame.layout.faces(element as u32).iter().map(|&f| (f, flat(f))).collect();
    let points = inside.iter().map(|&v| ground.point(v)).collect();
    let weights = inside.iter().map(around).collect();
    let mut samples = Samples { points, places: at.split_off(on_rim), weights };
    fill_gaps(ground, &faces, &mut samples);
    samples
}

/// Where a square of a grid holds no vertex, the point of the mesh in its middle is a sample: a slender element may
/// have hardly a vertex inside, and its faces still tell where its patch must lie.
fn fill_gaps(ground: &Ground<'_>, faces: &[(FaceId, [[f64; 2]; 3])], samples: &mut Samples) {
    /// Squares along each side.
    const SQUARES: usize = 8;
    /// Of the area of a square: chords of a curved surface lie a little inside of it, vertices do not.
    const TRUST: f64 = 0.1;
    let square = |x: f64| ((x * SQUARES as f64) as usize).min(SQUARES - 1);
    let middle = |k: usize| (k as f64 + 0.5) / SQUARES as f64;
    let mut holds = [false; SQUARES * SQUARES];
    for &[u, v] in &samples.places {
        holds[square(v) * SQUARES + square(u)] = true;
    }
    let total: f64 = faces.iter().map(|&(f, _)| triangle_area(ground.surface.corners(f))).sum();
    for &(f, flat) in faces {
        let [low, high] = [f64::min, f64::max].map(|pick| [0, 1].map(|c| flat.iter().map(|p| p[c]).reduce(pick)));
        let range = |c: usize| square(low[c].unwrap_or(0.0))..=square(high[c].unwrap_or(1.0));
        for (j, i) in range(1).flat_map(|j| range(0).map(move |i| (j, i))) {
            let place = [middle(i), middle(j)];
            if holds[j * SQUARES + i] {
                continue;
            }
            let Some(shares) = barycentric(flat, place) else { continue };
            holds[j * SQUARES + i] = true;
            samples.points.push(ground.surface.corners(f).iter().zip(shares).map(|(&p, share)| p * share).sum());
            samples.places.push(place);
            samples.weights.push(TRUST * total / (SQUARES * SQUARES) as f64);
        }
    }
}

/// The shares of the corners at a place inside a triangle of the plane; `None` outside.
fn barycentric(corners: [[f64; 2]; 3], place: [f64; 2]) -> Option<[f64; 3]> {
    let cross =
        |a: [f64; 2], b: [f64; 2]| (a[0] - place[0]) * (b[1] - place[1]) - (a[1] - place[1]) * (b[0] - place[0]);
    let parts = [1, 2, 0].map(|k| cross(corners[k], corners[(k + 1) % 3]));
    let sum: f64 = parts.iter().sum();
    (sum != 0.0 && parts.iter().all(|part| part * sum >= 0.0)).then(|| parts.map(|part| part / sum))
}

/// The neighbours of a vertex with their mean value weights, which sum to one.
fn mean_values(ground: &Ground<'_>, v: VertexId, place: &FxHashMap<VertexId, usize>) -> Vec<(usize, f64)> {
    /// Of what a face without area would make endless.
    const MOST: f64 = 1e6;
    let half_tangent = |f: FaceId| {
        let corners = ground.surface.faces[f];
        let k = corners.iter().position(|&w| w == v).unwrap_or(0);
        let [a, b] = [1, 2].map(|s| ground.point(corners[(k + s) % 3]) - ground.point(v));
        // tan(x / 2) = (1 - cos x) / sin x, of lengths times the cosine and the sine.
        ((a.length() * b.length() - a.dot(b)) / a.cross(b).length().max(f64::MIN_POSITIVE)).clamp(0.0, MOST)
    };
    let weight = |(w, left, right): (VertexId, FaceId, FaceId)| {
        let length = ground.point(w).distance(ground.point(v)).max(f64::MIN_POSITIVE);
        Some((*place.get(&w)?, (half_tangent(left) + half_tangent(right)) / length))
    };
    let mut row: Vec<(usize, f64)> = ground.leaving(v).filter_map(weight).collect();
    let sum: f64 = row.iter().map(|&(_, w)| w).sum();
    let is_sound = sum > 0.0 && sum.is_finite();
    let count = row.len().max(1) as f64;
    for (_, w) in &mut row {
        *w = if is_sound { *w / sum } else { 1.0 / count };
    }
    row
}

/// Puts every place from `first` on into the mean of its row, by overrelaxation.
fn relax(rows: &[Vec<(usize, f64)>], at: &mut [[f64; 2]], first: usize) {
    const SWEEPS: usize = 1_000;
    /// A sweep that moves nothing farther ends it; parameters are corrected later anyway.
    const STILL: f64 = 1e-6;
    let across = (rows.len() as f64).sqrt() + 2.0;
    // The best factor for a square grid of as many places.
    let over = 2.0 / (1.0 + libm::sin(std::f64::consts::PI / across));
    for _ in 0..SWEEPS {
        let mut moved = 0.0_f64;
        for (k, row) in rows.iter().enumerate() {
            let now = at[first + k];
            let mean = row.iter().fold([0.0; 2], |sum, &(w, a)| [sum[0] + a * at[w][0], sum[1] + a * at[w][1]]);
            let next = [0, 1].map(|c| (now[c] + over * (mean[c] - now[c])).clamp(0.0, 1.0));
            moved = moved.max((next[0] - now[0]).abs()).max((next[1] - now[1]).abs());
            at[first + k] = next;
        }
        if moved < STILL {
            break;
        }
    }
}

/// Spreads places that crowd: a bump or the tip of a horn shrinks to a spot in the barycentric map. Neighbours count
/// the less the more the faces around them are stretched, as long as that lowers the stretch of all.
fn spread(mut rows: Vec<Vec<(usize, f64)>>, at: &mut Vec<[f64; 2]>, first: usize, faces: &[([usize; 3], [DVec3; 3])]) {
    /// Below so many times the stretch of a map that keeps lengths the samples are dense enough everywhere.
    const EVEN: f64 = 1.5;
    /// Rounds of weights; the first ones do most.
    const ROUNDS: usize = 10;
    /// Of the stretch: less is not worth a round.
    const BETTER: f64 = 0.98;
    let mut now = Stretch::of(at, first, faces);
    for _ in 0..ROUNDS {
        if now.all <= EVEN {
            return;
        }
        for row in &mut rows {
            for (w, weight) in row.iter_mut() {
                *weight /= now.around[*w];
            }
            let sum: f64 = row.iter().map(|&(_, weight)| weight).sum();
            for (_, weight) in row.iter_mut() {
                *weight /= sum;
            }
        }
        let mut next = at.clone();
        relax(&rows, &mut next, first);
        let after = Stretch::of(&next, first, faces);
        if after.all >= BETTER * now.all {
            return;
        }
        (*at, now) = (next, after);
    }
}

/// How much longer lengths are on the mesh than in the square, as a root mean square over the area.
struct Stretch {
    /// Around each place, relative to the whole; 1 where nothing tells.
    around: Vec<f64>,
    /// Of the whole: 1 where lengths are kept but for one factor, else more.
    all: f64,
}

impl Stretch {
    fn of(at: &[[f64; 2]], first: usize, faces: &[([usize; 3], [DVec3; 3])]) -> Self {
        /// Of the square: a flat face of less area is taken for one of this.
        const LEAST: f64 = 1e-9;
        let (mut sums, mut areas) = (vec![0.0; at.len()], vec![0.0; at.len()]);
        let (mut sum, mut total) = (0.0, 0.0);
        // Faces with all corners on one side are flat whatever is done inside.
        for (corners, points) in faces.iter().filter(|(corners, _)| corners.iter().any(|&c| c >= first)) {
            let [a, b, c] = corners.map(|k| at[k]);
            let twice = ((b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1])).abs().max(LEAST);
            let slope =
                |x: usize| (points[0] * (b[x] - c[x]) + points[1] * (c[x] - a[x]) + points[2] * (a[x] - b[x])) / twice;
            let area = triangle_area(*points);
            let square = area * 0.5 * (slope(0).length_squared() + slope(1).length_squared());
            (sum, total) = (sum + square, total + area);
            for &corner in corners {
                sums[corner] += square;
                areas[corner] += area;
            }
        }
        let whole = (sum / total).sqrt();
        let around = |(&sum, &area): (&f64, &f64)| {
            let own = (sum / area).sqrt() / whole;
            if own.is_finite() && own > 0.0 { own } else { 1.0 }
        };
        let all = if total > 0.0 { whole / total.sqrt() } else { 1.0 };
        Self { around: sums.iter().zip(&areas).map(around).collect(), all }
    }
}

/// The vertices of the rim in order with their places; a triangle's last corner lies in the middle of the side v = 1.
fn rim(frame: &Frame<'_>, element: usize) -> Vec<(VertexId, [f64; 2])> {
    let ground = frame.layout.ground;
    let sides = &frame.sides[element];
    let mut all = Vec::new();
    for (k, &(arc, is_along)) in sides.iter().enumerate() {
        let mut path = frame.arcs[arc].path.clone();
        if !is_along {
            path.reverse();
        }
        let mut at = vec![0.0];
        for w in path.windows(2) {
            at.push(at[at.len() - 1] + ground.point(w[0]).distance(ground.point(w[1])));
        }
        let total = at[at.len() - 1].max(f64::MIN_POSITIVE);
        for (&v, s) in path.iter().zip(&at).take(path.len() - 1) {
            let t = s / total;
            let uv = match (k, sides.len()) {
                (0, _) => [t, 0.0],
                (1, _) => [1.0, t],
                (2, 4) => [1.0 - t, 1.0],
                (2, _) if t == 0.0 => [0.5, 1.0],
                _ => [0.0, 1.0 - t],
            };
            all.push((v, uv));
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::mesh::Surface;

    #[test]
    fn shares_of_a_place_give_it_back_whichever_way_the_triangle_turns() {
        let corners = [[0.1, 0.2], [0.9, 0.3], [0.4, 0.8]];
        let turned = [corners[1], corners[0], corners[2]];
        for triangle in [corners, turned] {
            let shares = barycentric(triangle, [0.45, 0.4]).expect("a place inside");
            for c in 0..2 {
                let back: f64 = triangle.iter().zip(shares).map(|(corner, share)| corner[c] * share).sum();
                assert!((back - [0.45, 0.4][c]).abs() < 1e-15, "{back}");
            }
        }
        assert_eq!(barycentric(corners, [0.1, 0.8]), None);
        assert_eq!(barycentric([[0.1, 0.1], [0.2, 0.2], [0.3, 0.3]], [0.2, 0.2]), None, "a triangle without area");
    }

    #[test]
    fn an_element_without_an_inner_vertex_still_has_samples_on_its_faces() {
        let points = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
        let surface = Surface {
            points: points.iter().map(|&[x, y]| DVec3::new(x, y, 0.5 * x)).collect(),
            faces: [[0, 1, 2], [0, 2, 3]].iter().map(|f| f.map(VertexId::new)).collect(),
            ..Surface::default()
        };
        let ground = Ground::new(&surface);
        let faces: Vec<_> = surface.faces.enumerate().map(|(f, v)| (f, v.map(|v| points[v.index()]))).collect();
        let mut samples = Samples::default();
        fill_gaps(&ground, &faces, &mut samples);
        assert_eq!(samples.points.len(), 64);
        for (p, [u, v]) in samples.points.iter().zip(&samples.places) {
            assert!(p.distance(DVec3::new(*u, *v, 0.5 * u)) < 1e-15, "{p}");
        }
        let area = 1.25_f64.sqrt();
        assert!((samples.weights.iter().sum::<f64>() - 0.1 * area).abs() < 1e-12);
    }

    #[test]
    fn the_vertices_of_a_horn_are_spread() {
        const N: usize = 15;
        let rim = |k: usize| k / N == 0 || k / N == N - 1 || k.is_multiple_of(N) || k % N == N - 1;
        let mut order: Vec<usize> = (0..N * N).filter(|&k| rim(k)).collect();
        let first = order.len();
        order.extend((0..N * N).filter(|&k| !rim(k)));
        let number: FxHashMap<usize, usize> = order.iter().enumerate().map(|(n, &k)| (k, n)).collect();
        let mut at: Vec<[f64; 2]> = order.iter().map(|k| [k % N, k / N].map(|x| x as f64 / (N - 1) as f64)).collect();
        let lift = |[x, y]: [f64; 2]| {
            let r = (x - 0.5) * (x - 0.5) + (y - 0.5) * (y - 0.5);
            DVec3::new(x, y, 3.0 * libm::exp(-40.0 * r))
        };
        let points: Vec<DVec3> = at.iter().map(|&p| lift(p)).collect();
        let cell = |k: usize| [[k, k + 1, k + N + 1], [k, k + N + 1, k + N]];
        let faces = (0..N * N).filter(|k| k % N < N - 1 && k / N < N - 1).flat_map(cell);
        let faces: Vec<([usize; 3], [DVec3; 3])> =
            faces.map(|f| f.map(|k| number[&k])).map(|f| (f, f.map(|n| points[n]))).collect();
        let row = |&k: &usize| [k - 1, k + 1, k - N, k + N].map(|other| (number[&other], 0.25)).to_vec();
        let rows: Vec<Vec<(usize, f64)>> = order[first..].iter().map(row).collect();
        let before = Stretch::of(&at, first, &faces).all;
        spread(rows, &mut at, first, &faces);
        let after = Stretch::of(&at, first, &faces).all;
        assert!(before > 3.0 && after < 0.7 * before, "{before} {after}");
        let turn = |[a, b, c]: [usize; 3]| {
            (at[b][0] - at[a][0]) * (at[c][1] - at[a][1]) - (at[c][0] - at[a][0]) * (at[b][1] - at[a][1])
        };
        assert!(faces.iter().all(|&(f, _)| turn(f) > 0.0), "a face folds");
    }
}
